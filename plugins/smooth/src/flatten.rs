//! Arcs and curves as chords fine enough to count as the path itself.

use tandem_motion::Path;
use tandem_motion::nurbs::{ArcLength, Nurbs, NurbsError, Place};
use tandem_motion::tube::Lanes;
use tandem_sdk::{Axes, Block, BlockKind, PluginError};

use crate::frame::Frame;

/// Share of the tolerance that chords of a curved block stand off it.
pub const SAGITTA_SHARE: f64 = 0.015;
/// Longest chord of a curved block, mm.
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
    /// Lays the chords of `block`, which stand off it by at most [`SAGITTA_SHARE`] of the tolerance. Allocates.
    ///
    /// # Errors
    /// A curve that is none, and an arc or a curve that takes more than [`MAX_CHORDS`].
    pub fn lay(&mut self, axes: &Axes, frame: &Frame<L>, block: &Block, tolerance_mm: f64) -> Result<(), PluginError> {
        self.points.clear();
        self.curved = matches!(block.kind, BlockKind::Arc | BlockKind::Nurbs);
        let sagitta_mm = SAGITTA_SHARE * tolerance_mm;
        match block.kind {
            BlockKind::Arc => self.lay_arc(frame, block, sagitta_mm),
            BlockKind::Nurbs => {
                let laid = self.lay_curve(axes, frame, block, sagitta_mm);
                laid.map_err(|error| PluginError::new(error.to_string()))?;
            }
            _ => self.points.push(frame.lanes(&block.end)),
        }
        if self.points.len() > MAX_CHORDS { Err(too_many()) } else { Ok(()) }
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

    fn lay_curve(&mut self, axes: &Axes, frame: &Frame<L>, block: &Block, sagitta: f64) -> Result<(), NurbsError> {
        // SAFETY: the block is handed over in the call that asks, and its slices with it.
        let data = unsafe { block.nurbs.to_data() };
        let curve = Nurbs::new(&data, axes)?;
        for piece in &curve.pieces() {
            let table = ArcLength::of_piece(&curve, piece);
            let (length, mut place, mut s) = (table.length().mm, Place::default(), 0.0);
            while s < length {
                let reach = |s: f64, place: &mut Place| step(frame, &curve, &table, s, place, sagitta);
                let first = reach(s, &mut place);
                // Where the curve bends more sharply further on, that counts.
                let mut next = first;
                for share in [0.5, 1.0] {
                    next = next.min(reach((s + share * first).min(length), &mut place).max(0.3 * first));
                }
                s = if length - s < 1.3 * next { length } else { s + next };
                let at = table.position(&curve, s, &mut place);
                self.points.push(frame.lanes(&at));
                if self.points.len() > MAX_CHORDS {
                    break;
                }
            }
        }
        if let Some(last) = self.points.last_mut() {
            *last = frame.lanes(&block.end);
        }
        Ok(())
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
    block: &Block,
    tolerance_mm: f64,
) -> Result<(), PluginError> {
    let arc = || count(block.arc.radius_mm, block.arc.sweep_rad, SAGITTA_SHARE * tolerance_mm);
    match block.kind {
        BlockKind::Nurbs => Flat::default().lay(axes, frame, block, tolerance_mm),
        BlockKind::Arc if arc() > MAX_CHORDS => Err(too_many()),
        _ => Ok(()),
    }
}

/// Chords of a circle.
pub fn count(radius: f64, sweep_rad: f64, sagitta: f64) -> usize {
    let angle = (8.0 * sagitta / radius).sqrt().min(LONGEST_MM / radius).min(0.3);
    ((sweep_rad.abs() / angle).ceil() as usize).clamp(1, MAX_CHORDS + 1)
}

/// Length of a chord that stands off the curve by `sagitta` where it bends as at `s`.
fn step<const L: usize>(
    frame: &Frame<L>,
    curve: &Nurbs,
    table: &ArcLength,
    s: f64,
    place: &mut Place,
    sagitta: f64,
) -> f64 {
    let bend = table.along_path(curve, s, place).map_or(0.0, |at| {
        let lanes = frame.lanes(&at.curvature);
        lanes.iter().map(|v| v * v).sum::<f64>().sqrt()
    });
    (8.0 * sagitta / bend.max(1e-9)).sqrt().min(0.3 / bend.max(1e-9)).clamp(1e-4, LONGEST_MM)
}
