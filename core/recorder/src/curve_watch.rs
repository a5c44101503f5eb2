//! Where on a curve samples are: its curvature there, and how far the chords between samples stand off it.

use std::collections::VecDeque;

use tandem_motion::nurbs::Nurbs;
use tandem_rings::Sample;
use tandem_sdk::{Axes, AxisVector, Block, Curve};

/// Spans searched around the last foot.
const SPANS_AROUND: usize = 4;
/// Distance from the curve that asks for a search of all of it, mm.
const FAR_MM: f64 = 1e-3;

/// A curve, and where the last sample was.
#[derive(Debug)]
struct Watched {
    block: u64,
    curve: Nurbs,
    u: f64,
}

/// What a sample on a curve says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OnCurve {
    /// Curvature where the sample is, 1/mm.
    pub curvature_per_mm: f64,
    /// Most that the chord from the sample before stands off the curve, mm.
    pub chord_error_mm: f64,
}

/// Keeps the curves that are still to be driven.
#[derive(Debug)]
pub struct CurveWatch {
    axes: Axes,
    curves: VecDeque<Watched>,
    last: Option<AxisVector>,
}

impl CurveWatch {
    /// Nothing seen yet.
    pub fn new(axes: Axes) -> Self {
        Self {
            axes,
            curves: VecDeque::new(),
            last: None,
        }
    }

    /// A block that will be driven: a curve is copied. Rough loop; allocates.
    pub fn block(&mut self, block: &Block, curve: Option<Curve<'_>>) {
        let Some(curve) = curve else { return };
        if let Ok(curve) = Nurbs::new(&curve.to_data(), &self.axes) {
            self.curves.push_back(Watched {
                block: block.index,
                u: curve.range().0,
                curve,
            });
        }
    }

    /// What `sample` says; `None` where it is on no curve. Samples come in order.
    pub fn sample(&mut self, sample: &Sample) -> Option<OnCurve> {
        let last = self.last.replace(sample.command).unwrap_or(sample.command);
        while self
            .curves
            .front()
            .is_some_and(|watched| watched.block < sample.block)
        {
            self.curves.pop_front();
        }
        let watched = self
            .curves
            .front_mut()
            .filter(|watched| watched.block == sample.block)?;
        Some(watched.at(&last, &sample.command))
    }
}

impl Watched {
    fn at(&mut self, last: &AxisVector, position: &AxisVector) -> OnCurve {
        let (before, span) = (self.u, self.curve.span(self.u));
        let mut foot = self.curve.nearest(
            position,
            span.saturating_sub(SPANS_AROUND),
            span + SPANS_AROUND,
        );
        if foot.distance_mm > FAR_MM {
            foot = self.curve.nearer(position, foot);
        }
        self.u = foot.u;
        let off = |share: f64| {
            off_chord_mm(
                &self.curve.position(before + share * (foot.u - before)),
                last,
                position,
            )
        };
        let chord_error_mm = [0.25, 0.5, 0.75].map(off).into_iter().fold(0.0, f64::max);
        let at = self.curve.derivatives_in(self.curve.span(foot.u), foot.u);
        OnCurve {
            curvature_per_mm: self.curve.curvature(&at).unwrap_or(f64::NAN),
            chord_error_mm,
        }
    }
}

/// Distance of `point` from the line through two samples, mm; zero where they are one.
fn off_chord_mm(point: &AxisVector, from: &AxisVector, to: &AxisVector) -> f64 {
    let dot =
        |a: &AxisVector, b: &AxisVector| -> f64 { a.0.iter().zip(&b.0).map(|(x, y)| x * y).sum() };
    let (chord, reach) = (*to - *from, *point - *from);
    let squared = dot(&chord, &chord);
    if squared < 1e-18 {
        return 0.0;
    }
    let off = reach - chord * (dot(&reach, &chord) / squared);
    dot(&off, &off).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use tandem_sdk::{BlockKind, NurbsData};

    /// A quarter of a circle of 10 mm in steps of a tenth of a radian.
    #[test]
    fn a_circle_has_its_curvature_and_the_sagitta_of_its_chords() {
        let data = NurbsData {
            degree: 2,
            control_points: [[10.0, 0.0], [10.0, 10.0], [0.0, 10.0]]
                .iter()
                .map(|p| AxisVector::from_slice(p))
                .collect(),
            weights: vec![1.0, 0.5f64.sqrt(), 1.0],
            knots: vec![0.0, 0.0, 0.0, 1.0, 1.0, 1.0],
        };
        let mut block = Block::at(data.control_points[0]);
        block.kind = BlockKind::Nurbs;
        block.index = 3;
        block.end = data.control_points[2];
        let mut watch = CurveWatch::new(Axes::new(&[('X', false), ('Y', false)]).unwrap());
        watch.block(&block, Some(data.curve()));
        let sagitta_mm = 10.0 * (1.0 - 0.05f64.cos());
        for n in 0..=15 {
            let angle = 0.1 * f64::from(n);
            let command = AxisVector::from_slice(&[10.0 * angle.cos(), 10.0 * angle.sin()]);
            let on = watch
                .sample(&Sample {
                    block: 3,
                    command,
                    ..Sample::default()
                })
                .unwrap();
            assert!((on.curvature_per_mm - 0.1).abs() < 1e-9, "{on:?}");
            // The parameter is not quite even in the angle.
            assert!(
                n == 0 || (on.chord_error_mm / sagitta_mm - 1.0).abs() < 1e-3,
                "{on:?}, {sagitta_mm}"
            );
        }
        assert_eq!(
            watch.sample(&Sample {
                block: 4,
                ..Sample::default()
            }),
            None
        );
    }
}
