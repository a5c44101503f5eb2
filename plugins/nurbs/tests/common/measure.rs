//! What the samples of a motion along a canonical curve say: the figures that forms are compared by.

use tandem_motion::nurbs::{ArcLength, Nurbs, Place};
use tandem_sdk::{Axes, AxisVector, NurbsData, PlannerContext, SegmentFlags};

use super::Collected;

/// Best known time of a canonical curve under limits along the path and under limits per axis, s (`002_tref.json`).
pub const BEST_S: [(&str, f64, f64); 3] = [
    ("butterfly", 2.782_139, 2.752_93),
    ("trident", 1.933_704, 1.921_169),
    ("infinity", 5.316_549, 5.301_854),
];

/// The figures. Differences of samples at the fine period, with rest before and behind.
#[derive(Clone, Copy, Debug, Default)]
pub struct Figures {
    pub time_s: f64,
    pub rests: usize,
    /// Largest feed, mm/s, acceleration, mm/s², and jerk, mm/s³, of the path coordinate.
    pub path: [f64; 3],
    /// The same of any axis.
    pub axis: [f64; 3],
    /// Largest distance of the chord of a period from the curve, µm.
    pub chord_um: f64,
    /// Largest difference of the realised from the commanded arc of a period, as a share, where the feed is 1 mm/s at
    /// least.
    pub fluctuation: f64,
}

pub fn xy() -> Axes {
    Axes::new(&[('X', false), ('Y', false)]).unwrap()
}

/// Largest differences of first, second and third order.
pub fn differences(mut values: Vec<f64>, period_s: f64) -> [f64; 3] {
    values.splice(0..0, [values[0]; 3]);
    values.extend([values[values.len() - 1]; 3]);
    std::array::from_fn(|_| {
        values = values
            .windows(2)
            .map(|pair| (pair[1] - pair[0]) / period_s)
            .collect();
        values
            .iter()
            .fold(0.0, |most: f64, value| most.max(value.abs()))
    })
}

/// The figures of `collected`, driven along the curve of `data`.
pub fn figures(collected: &Collected, data: &NurbsData, context: &PlannerContext) -> Figures {
    let curve = Nurbs::new(data, &xy()).unwrap();
    let table = ArcLength::new(&curve);
    let period_s = context.fine_period_s;
    let samples = collected.path_samples(period_s);
    let of = |value: &dyn Fn(&(AxisVector, f64)) -> f64| {
        differences(samples.iter().map(value).collect(), period_s)
    };
    let [x, y] = [of(&|sample| sample.0[0]), of(&|sample| sample.0[1])];
    let chords = samples
        .windows(2)
        .map(|pair| chord_error_mm(&curve, &table, pair[0].1, pair[1].1));
    Figures {
        time_s: collected.duration_s(),
        rests: collected
            .segments
            .iter()
            .filter(|s| s.flags.contains(SegmentFlags::ENDS_AT_REST))
            .count(),
        path: of(&|sample| sample.1),
        axis: std::array::from_fn(|n| x[n].max(y[n])),
        chord_um: 1000.0 * chords.fold(0.0, f64::max),
        fluctuation: fluctuation(&curve, &samples, period_s),
    }
}

/// Largest distance between the chord of a period and the curve between its ends, mm.
pub fn chord_error_mm(curve: &Nurbs, table: &ArcLength, from: f64, to: f64) -> f64 {
    let mut place = Place::default();
    let ends = [from, to].map(|s| table.position(curve, s, &mut place));
    let along = ends[1] - ends[0];
    let squared: f64 = along.0.iter().map(|v| v * v).sum();
    if squared < 1e-18 {
        return 0.0;
    }
    let off = |share: f64| {
        let point =
            table.position(curve, from + share * (to - from), &mut Place::default()) - ends[0];
        let foot: f64 = point.0.iter().zip(along.0).map(|(a, b)| a * b).sum::<f64>() / squared;
        distance(&point, &(along * foot))
    };
    (1..100)
        .map(|step| off(f64::from(step) / 100.0))
        .fold(0.0, f64::max)
}

pub fn distance(a: &AxisVector, b: &AxisVector) -> f64 {
    (*a - *b).0.iter().map(|d| d * d).sum::<f64>().sqrt()
}

/// Arc that the curve has between samples, by quadrature from foot to foot and not by the table that drove them, mm.
pub fn realised_mm(curve: &Nurbs, positions: impl IntoIterator<Item = AxisVector>) -> Vec<f64> {
    let mut positions = positions.into_iter();
    let mut at = positions
        .next()
        .map_or(0.0, |first| curve.nearest(&first, 0, curve.points()).u);
    let arc = |position: AxisVector| {
        let span = curve.span(at);
        let from = std::mem::replace(&mut at, curve.nearest(&position, span, span + 3).u);
        arc_mm(curve, from, at)
    };
    positions.map(arc).collect()
}

fn arc_mm(curve: &Nurbs, from: f64, to: f64) -> f64 {
    let borders = curve
        .inner_knots()
        .filter(|knot| *knot > from && *knot < to)
        .chain([to]);
    let (mut sum, mut start) = (0.0, from);
    for border in borders {
        sum += curve.length_in(curve.span(start), start, border).mm;
        start = border;
    }
    sum
}

fn fluctuation(curve: &Nurbs, samples: &[(AxisVector, f64)], period_s: f64) -> f64 {
    let samples = &samples[..samples.len() - 1];
    let realised = realised_mm(curve, samples.iter().map(|sample| sample.0));
    let commanded = samples.windows(2).map(|pair| pair[1].1 - pair[0].1);
    let moving = realised
        .into_iter()
        .zip(commanded)
        .filter(|(_, commanded)| *commanded >= period_s);
    moving
        .map(|(arc, commanded)| (arc - commanded).abs() / commanded)
        .fold(0.0, f64::max)
}
