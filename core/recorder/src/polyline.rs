//! The path of a block as people draw it: a line of points.

use tandem_motion::Path;
use tandem_motion::nurbs::Nurbs;
use tandem_sdk::{Axes, AxisVector, Block, BlockKind, Curve};

/// Chords of an arc, or of one span of a curve, at most: a drawing needs no more.
const MAX_CHORDS: usize = 128;

/// Points behind the start of `block`, along `curve` where it is a NURBS, that stand for its path within `chord_error_mm`; fewer
/// where that would take too many. Machine coordinates, mm or rad; none for a dwell. Soft side; allocates.
pub fn polyline(
    axes: &Axes,
    block: &Block,
    curve: Option<Curve<'_>>,
    chord_error_mm: f64,
) -> Vec<AxisVector> {
    if let Some(curve) = curve.and_then(|curve| Nurbs::new(&curve.to_data(), axes).ok()) {
        return along_curve(&curve, chord_error_mm);
    }
    let Some(path) = Path::new(block).filter(|_| block.kind != BlockKind::Dwell) else {
        return vec![];
    };
    let chords = if path.is_straight() {
        1
    } else {
        let radius_mm = path.radius_mm().max(chord_error_mm);
        let chord_rad = 2.0 * (1.0 - chord_error_mm / radius_mm).clamp(-1.0, 1.0).acos();
        let turn_rad = path.rad_per_mm() * path.length_mm();
        ((turn_rad / chord_rad).ceil() as usize).clamp(1, MAX_CHORDS)
    };
    let between = (1..chords).map(|n| path.position(path.length_mm() * n as f64 / chords as f64));
    between.chain([block.end]).collect()
}

fn along_curve(curve: &Nurbs, chord_error_mm: f64) -> Vec<AxisVector> {
    let (first, last) = curve.range();
    let mut points = vec![];
    let mut knots: Vec<f64> = curve.knots().to_vec();
    knots.retain(|u| (first..=last).contains(u));
    knots.dedup();
    for pair in knots.windows(2) {
        let at = |n: usize, of: usize| {
            curve.position(pair[0] + (pair[1] - pair[0]) * n as f64 / of as f64)
        };
        let mut chords = 1;
        while chords < MAX_CHORDS && sagitta_mm(chords, &at) > chord_error_mm {
            chords *= 2;
        }
        points.extend((1..=chords).map(|n| at(n, chords)));
    }
    points
}

/// How far the middles, and the quarters, between points stand off their chords at most.
fn sagitta_mm(chords: usize, at: &dyn Fn(usize, usize) -> AxisVector) -> f64 {
    let off = |n: usize| {
        let (a, b) = (at(4 * n, 4 * chords), at(4 * n + 4, 4 * chords));
        (1..4)
            .map(|q| {
                let straight = a + (b - a) * (q as f64 / 4.0);
                let off = at(4 * n + q, 4 * chords) - straight;
                off.0.iter().map(|c| c * c).sum::<f64>().sqrt()
            })
            .fold(0.0, f64::max)
    };
    (0..chords).map(off).fold(0.0, f64::max)
}
