//! Arcs and curves as chords fine enough to count as the path itself.

use tandem_motion::Path;
use tandem_motion::nurbs::{ArcLength, Nurbs, NurbsError, Place};
use tandem_motion::tube::Lanes;
use tandem_sdk::{Axes, AxisVector, Block, BlockKind, Curve, NurbsData, PluginError};

use crate::frame::{Frame, minus, to_chord};

/// Share of the tolerance that chords of a curved block stand off it.
pub const SAGITTA_SHARE: f64 = 0.015;
/// Halvings that show whether a part of a curve is beside its chord: each brings the control points four times nearer to it.
const HALVINGS: u32 = 5;
/// How much shorter the next chord is that is tried.
const SHORTER: f64 = 0.6;
/// What is no longer than that is its own chord, mm: less than the sagitta of the least tolerance.
const MIN_MM: f64 = 1e-6;
/// Shortest chord that is tried first, and longest one of a curved block, mm.
const SHORTEST_MM: f64 = 1e-4;
const LONGEST_MM: f64 = 1.0;
/// Most chords of one block: what takes more is refused. On a machine of eight axes they take 80 MB.
pub const MAX_CHORDS: usize = 500_000;

/// Chords whose memory is kept from one block to the next.
const KEPT: usize = 8192;

/// The ends of the chords of a block; keeps its memory.
#[derive(Debug, Default)]
pub struct Flat<const L: usize> {
    pub points: Vec<Lanes<L>>,
    /// The block is no line.
    pub curved: bool,
}

impl<const L: usize> Flat<L> {
    /// Lays the chords of a block and its curve, which stand off it by at most [`SAGITTA_SHARE`] of the tolerance. Allocates.
    ///
    /// # Errors
    /// A curve that is none, and an arc or a curve that takes more than [`MAX_CHORDS`].
    pub fn lay(
        &mut self,
        axes: &Axes,
        frame: &Frame<L>,
        (block, curve): (&Block, Option<Curve<'_>>),
        tolerance_mm: f64,
    ) -> Result<(), PluginError> {
        self.points.clear();
        self.curved = matches!(block.kind, BlockKind::Arc | BlockKind::Nurbs);
        let sagitta_mm = SAGITTA_SHARE * tolerance_mm;
        match block.kind {
            BlockKind::Arc => self.lay_arc(frame, block, sagitta_mm),
            BlockKind::Nurbs => {
                let laid = self.lay_curve(axes, frame, (block, curve), sagitta_mm);
                laid.map_err(|error| PluginError::new(error.to_string()))?;
            }
            _ => self.points.push(frame.lanes(&block.end)),
        }
        if self.points.len() > MAX_CHORDS {
            Err(too_many())
        } else {
            Ok(())
        }
    }

    /// Gives memory back that only a block of very many chords needs.
    pub fn forget(&mut self) {
        if self.points.capacity() > KEPT {
            self.points = Vec::new();
        }
    }

    fn lay_arc(&mut self, frame: &Frame<L>, block: &Block, sagitta_mm: f64) {
        let Some(path) = Path::new(block) else { return };
        // The circle as the oracle of distances sees it: rotary lanes beside it go straight.
        let count = count(block.arc.radius_mm, block.arc.sweep_rad, sagitta_mm);
        for n in 1..=count {
            let at = path.position(block.length_mm * n as f64 / count as f64);
            self.points.push(frame.lanes(&at));
        }
    }

    fn lay_curve(
        &mut self,
        axes: &Axes,
        frame: &Frame<L>,
        (block, curve): (&Block, Option<Curve<'_>>),
        sagitta: f64,
    ) -> Result<(), NurbsError> {
        let data = curve.map_or_else(NurbsData::default, |curve| curve.to_data());
        let curve = Nurbs::new(&data, axes)?;
        for piece in &curve.pieces() {
            let table = ArcLength::of_piece(&curve, piece);
            self.lay_piece(&Smooth {
                frame,
                curve: &curve,
                table,
                sagitta,
            });
        }
        if let Some(last) = self.points.last_mut() {
            *last = frame.lanes(&block.end);
        }
        Ok(())
    }

    /// The chords of a smooth part of a curve.
    fn lay_piece(&mut self, part: &Smooth<L>) {
        let length = part.table.length().mm;
        let mut place = Place::default();
        let mut s = 0.0;
        let mut from = part.at(s, &mut place);
        while s < length && self.points.len() <= MAX_CHORDS {
            let reach = part.reach(s, &mut place);
            let mut to = if length - s < 1.3 * reach {
                length
            } else {
                s + reach
            };
            let mut at = part.at(to, &mut place);
            while !part.is_beside((s, to), (&from, &at), &mut place) {
                to = s + SHORTER * (to - s);
                at = part.at(to, &mut place);
            }
            self.points.push(at);
            s = to;
            from = at;
        }
    }
}

/// A smooth part of a curve by its arc length.
struct Smooth<'a, const L: usize> {
    frame: &'a Frame<L>,
    curve: &'a Nurbs,
    table: ArcLength,
    /// What a chord may stand off it, in lane units.
    sagitta: f64,
}

impl<const L: usize> Smooth<'_, L> {
    fn at(&self, s: f64, place: &mut Place) -> Lanes<L> {
        self.frame.lanes(&self.table.position(self.curve, s, place))
    }

    /// A guess of the length of the chord at `s`; where the curve bends more sharply further on, that counts.
    fn reach(&self, s: f64, place: &mut Place) -> f64 {
        let first = self.step(s, place);
        let length = self.table.length().mm;
        let further = [0.5, 1.0].map(|share| self.step((s + share * first).min(length), place));
        further
            .into_iter()
            .fold(first, |least, next| least.min(next.max(0.3 * first)))
    }

    /// Length of a chord that stands off the curve by the sagitta where it bends as at `s`.
    fn step(&self, s: f64, place: &mut Place) -> f64 {
        let bend = self
            .table
            .along_path(self.curve, s, place)
            .map_or(0.0, |at| {
                let lanes = self.frame.lanes(&at.curvature);
                lanes.iter().map(|v| v * v).sum::<f64>().sqrt()
            });
        (8.0 * self.sagitta / bend.max(1e-9))
            .sqrt()
            .min(0.3 / bend.max(1e-9))
            .clamp(SHORTEST_MM, LONGEST_MM)
    }

    /// Whether the curve between two path coordinates stands off its chord by no more than the sagitta, and does not run to and
    /// fro beside it. How it bends at some places tells nothing of what lies between: where control points coincide it is
    /// straight at its ends, and a narrow bend or a cusp is stepped over.
    fn is_beside(
        &self,
        (from, to): (f64, f64),
        (start, end): (&Lanes<L>, &Lanes<L>),
        place: &mut Place,
    ) -> bool {
        let way = minus(end, start);
        // What path speed counts, as the length of the curve does.
        let straight = (0..L)
            .map(|l| {
                if self.frame.rotary[l] > 0.0 {
                    0.0
                } else {
                    way[l] * way[l]
                }
            })
            .sum::<f64>()
            .sqrt();
        let range = (
            self.table.parameter(from, place).0,
            self.table.parameter(to, place).0,
        );
        // The chord of a circle meets it exactly; rounding is not to make it shorter.
        let most = (1.001 * self.sagitta).powi(2);
        let near = |at: &AxisVector| to_chord(&self.frame.lanes(at), start, end) <= most;
        to - from <= MIN_MM
            || to - from <= straight + 2.0 * self.sagitta
                && self.curve.lies_inside(range, HALVINGS, &near)
    }
}

fn too_many() -> PluginError {
    PluginError::new(format!(
        "within its tolerance the path takes more than {MAX_CHORDS} chords; nurbs drives it as it is"
    ))
}

/// Whether chords can be laid along an arc or a curve.
///
/// # Errors
/// A curve that is none, and an arc or a curve that takes more than [`MAX_CHORDS`].
pub fn check<const L: usize>(
    axes: &Axes,
    frame: &Frame<L>,
    (block, curve): (&Block, Option<Curve<'_>>),
    tolerance_mm: f64,
) -> Result<(), PluginError> {
    let arc = || {
        count(
            block.arc.radius_mm,
            block.arc.sweep_rad,
            SAGITTA_SHARE * tolerance_mm,
        )
    };
    match block.kind {
        BlockKind::Nurbs => Flat::default().lay(axes, frame, (block, curve), tolerance_mm),
        BlockKind::Arc if arc() > MAX_CHORDS => Err(too_many()),
        _ => Ok(()),
    }
}

/// Chords of a circle.
pub fn count(radius: f64, sweep_rad: f64, sagitta: f64) -> usize {
    let angle = (8.0 * sagitta / radius)
        .sqrt()
        .min(LONGEST_MM / radius)
        .min(0.3);
    ((sweep_rad.abs() / angle).ceil() as usize).clamp(1, MAX_CHORDS + 1)
}

#[cfg(test)]
mod tests {
    use tandem_rig::Random;
    use tandem_sdk::{AxisLimits, NurbsData};

    use super::*;
    use crate::frame::dot;

    const SAGITTA: f64 = 1e-4;

    fn machine() -> (Axes, Frame<4>) {
        let limits = AxisLimits {
            min_mm: -1e4,
            max_mm: 1e4,
            feed_mm_per_s: 100.0,
            rapid_mm_per_s: 100.0,
            acceleration_mm_per_s2: 1000.0,
            jerk_mm_per_s3: 1e5,
            speed_difference_mm_per_s: 0.0,
        };
        let context = tandem_rig::context(&[limits; 3], 1e-3);
        (context.axes, Frame::new(&context))
    }

    /// A Bezier curve.
    fn bezier(points: &[[f64; 3]]) -> NurbsData {
        let degree = points.len() - 1;
        NurbsData {
            degree,
            control_points: points.iter().map(|p| AxisVector::from_slice(p)).collect(),
            weights: vec![1.0; points.len()],
            knots: [vec![0.0; degree + 1], vec![1.0; degree + 1]].concat(),
        }
    }

    /// The ends of the chords of a curve, and the curve.
    fn chain_and_curve(data: &NurbsData) -> (Vec<Lanes<4>>, Nurbs) {
        let (axes, frame) = machine();
        let mut block = Block::at(data.control_points[0]);
        block.kind = BlockKind::Nurbs;
        block.end = data.control_points[data.degree];
        let mut flat = Flat::default();
        flat.lay(
            &axes,
            &frame,
            (&block, Some(data.curve())),
            SAGITTA / SAGITTA_SHARE,
        )
        .unwrap();
        let mut chain = vec![frame.lanes(&block.start)];
        chain.append(&mut flat.points);
        (chain, Nurbs::new(data, &axes).unwrap())
    }

    /// How far the curve is from its chords at most, at many places.
    fn off_chords(data: &NurbsData) -> f64 {
        let (chain, curve) = chain_and_curve(data);
        let (_, frame) = machine();
        let places =
            (0..=2000).map(|n| frame.lanes(&curve.derivatives(f64::from(n) / 2000.0).position));
        let off = |at| {
            chain
                .windows(2)
                .map(|ends| to_chord(&at, &ends[0], &ends[1]).sqrt())
                .fold(f64::INFINITY, f64::min)
        };
        places.map(off).fold(0.0, f64::max)
    }

    #[test]
    fn coinciding_control_points_are_not_flattened_to_their_chord() {
        // At both ends a cubic is straight whose inner control points coincide.
        let corner = [-0.1, 0.05, 0.0];
        assert!(
            off_chords(&bezier(&[[0.0; 3], corner, corner, [-0.1, 0.0, 0.0]])) <= 1.01 * SAGITTA
        );
    }

    #[test]
    fn a_narrow_bend_is_not_stepped_over() {
        // Almost a cusp, and control points that are nearly those of one.
        let narrow = [
            [-0.06537, -4.364, 0.0],
            [-0.0679, -4.361, 0.0],
            [-0.03, -4.409, 0.0],
            [-0.053, -4.38, 0.0],
        ];
        assert!(off_chords(&bezier(&narrow)) <= 1.01 * SAGITTA);
    }

    fn length(chain: &[Lanes<4>]) -> f64 {
        chain
            .windows(2)
            .map(|ends| minus(&ends[1], &ends[0]))
            .map(|way| dot(&way, &way).sqrt())
            .sum()
    }

    #[test]
    fn a_curve_that_runs_to_and_fro_beside_a_line_is_followed() {
        // All of it is beside the chord of its ends, or nearly so.
        let near_line = [
            [0.0; 3],
            [0.15, 0.06005, 0.0],
            [-0.05, -0.02005, 0.0],
            [0.09, 0.036, 0.0],
        ];
        let (chain, curve) = chain_and_curve(&bezier(&near_line));
        let (_, frame) = machine();
        let places =
            (0..=2000).map(|n| frame.lanes(&curve.derivatives(f64::from(n) / 2000.0).position));
        let fine: Vec<Lanes<4>> = places.collect();
        assert!(
            length(&chain) > 0.99 * length(&fine),
            "{} for {}",
            length(&chain),
            length(&fine)
        );
        assert!(length(&fine) > 1.1 * length(&[fine[0], fine[2000]]));
    }

    #[test]
    fn chords_are_beside_any_curve() {
        let mut random = Random::new(1);
        for _ in 0..100 {
            let size = random.length(1e-3, 10.0);
            let mut points: Vec<[f64; 3]> = Vec::new();
            for _ in 0..3 + random.below(3) {
                let same = random.below(3) == 0;
                let other = [(); 3].map(|()| random.between(-size, size));
                points.push(points.last().copied().filter(|_| same).unwrap_or(other));
            }
            points.push([size, 0.0, 0.0]);
            assert!(off_chords(&bezier(&points)) <= 1.01 * SAGITTA, "{points:?}");
        }
    }
}
