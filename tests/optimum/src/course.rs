//! A curve by its arc length, and what holds on it.

use tandem_motion::nurbs::{AlongPath, ArcLength, Nurbs, NurbsError, Place};
use tandem_sdk::{Axes, AxisVector, NurbsData};

/// What a motion along a curve keeps: lengths in mm, times in s, all axes linear.
#[derive(Clone, Debug)]
pub struct Limits {
    /// Highest path speed.
    pub feed_mm_per_s: f64,
    /// Of each axis.
    pub speed_mm_per_s: Vec<f64>,
    /// Of each axis.
    pub acceleration_mm_per_s2: Vec<f64>,
    /// Of each axis.
    pub jerk_mm_per_s3: Vec<f64>,
    /// Most that the chord of a fine period may stand off the curve; infinite where it does not count.
    pub chord_error_mm: f64,
    /// The fine period.
    pub period_s: f64,
}

/// A smooth curve by its arc length.
#[derive(Clone, Debug)]
pub struct Course {
    curve: Nurbs,
    table: ArcLength,
    /// Where knots lie inside, mm.
    knots_mm: Vec<f64>,
}

/// How far beside a knot the derivatives of its sides are taken, mm.
const BESIDE_MM: f64 = 1e-7;

impl Course {
    /// The curve of `data`, whose tangent has no corner.
    ///
    /// # Errors
    /// It is no curve.
    pub fn new(data: &NurbsData, axes: &Axes) -> Result<Self, NurbsError> {
        let curve = Nurbs::new(data, axes)?;
        let table = ArcLength::new(&curve);
        let inside = curve.inner_knots();
        let knots_mm = inside.map(|knot| table.length_at(&curve, knot)).collect();
        Ok(Self {
            curve,
            table,
            knots_mm,
        })
    }

    /// Its length, mm.
    pub fn length_mm(&self) -> f64 {
        self.table.length().mm
    }

    /// The knots inside it, mm from its start.
    pub fn knots_mm(&self) -> &[f64] {
        &self.knots_mm
    }

    /// Position and derivatives at `s_mm`, which is moved into the curve.
    pub fn at(&self, s_mm: f64, place: &mut Place) -> AlongPath {
        let s_mm = s_mm.clamp(0.0, self.length_mm());
        self.table
            .along_path(&self.curve, s_mm, place)
            .unwrap_or_default()
    }

    /// Position at `s_mm`, mm.
    pub fn position(&self, s_mm: f64, place: &mut Place) -> AxisVector {
        let s_mm = s_mm.clamp(0.0, self.length_mm());
        self.table.position(&self.curve, s_mm, place)
    }

    /// Both sides of a knot.
    pub fn sides(&self, knot_mm: f64) -> [AlongPath; 2] {
        [-BESIDE_MM, BESIDE_MM].map(|off| self.at(knot_mm + off, &mut Place::default()))
    }

    /// The highest speed at a place: the feed, the speed of the axes and the chord error.
    pub fn cap_mm_per_s(&self, at: &AlongPath, limits: &Limits) -> f64 {
        let mut cap = limits.feed_mm_per_s;
        for (axis, speed) in limits.speed_mm_per_s.iter().enumerate() {
            cap = cap.min(speed / at.direction[axis].abs().max(1e-12));
        }
        let curvature = self.curve.counted_length(&at.curvature);
        if limits.chord_error_mm.is_finite() && curvature > 0.0 {
            // The chord of an arc of radius ρ that stands off by δ: 2·√(2ρδ − δ²).
            let radius = 1.0 / curvature;
            let error = limits.chord_error_mm.min(radius);
            let chord = 2.0 * (2.0 * radius * error - error * error).sqrt();
            cap = cap.min(chord / limits.period_s);
        }
        cap
    }
}
