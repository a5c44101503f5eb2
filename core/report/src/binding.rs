//! What keeps the motion from being faster, sample by sample, from the samples alone.

use crate::judge::AxisMotion;
use crate::model::Report;

/// Number of what may bind.
pub(crate) const LIMITS: usize = 6;

/// What may bind, in the order in which it is asked for; the bit in [`Binding::marks`] is its place here.
pub(crate) const NAMES: [&str; LIMITS] = [
    "feed",
    "velocity",
    "acceleration",
    "jerk",
    "tolerance",
    "chord error",
];

/// Shares of what is allowed from which on it counts as binding, in the same order.
const FROM: [f64; LIMITS] = [0.99, 0.985, 0.95, 0.9, 0.25, 0.98];
/// Samples on each side whose largest share counts: where the sign of a derivative changes, a single one is small.
const AROUND: usize = 2;
/// Path speed from which on something moves, mm/s.
const MOVES_MM_S: f64 = 1e-6;

/// What binds where.
#[derive(Default)]
pub(crate) struct Binding {
    /// Per sample the bit of what binds; none at rest, and where nothing is used up.
    pub marks: Vec<u8>,
    /// Samples that move.
    pub moving: usize,
}

impl Binding {
    /// Asks every sample.
    pub(crate) fn of(report: &Report, motions: &[AxisMotion]) -> Self {
        let shares: Vec<[f64; LIMITS]> = (0..report.samples.t_s.len())
            .map(|i| shares(report, motions, i))
            .collect();
        let moves = |i: usize| report.samples.feed_mm_s[i] > MOVES_MM_S;
        let mark = |i: usize| {
            let around = &shares[i.saturating_sub(AROUND)..(i + AROUND + 1).min(shares.len())];
            let binds = |k: &usize| around.iter().any(|share| share[*k] > FROM[*k]);
            if moves(i) {
                (0..NAMES.len()).find(binds).map_or(0, |k| 1 << k)
            } else {
                0
            }
        };
        Self {
            marks: (0..shares.len()).map(mark).collect(),
            moving: (0..shares.len()).filter(|i| moves(*i)).count(),
        }
    }

    /// The shares of the time in motion, as a sentence.
    pub(crate) fn words(&self) -> String {
        let percent = |count: usize| 100.0 * count as f64 / self.moving.max(1) as f64;
        let count = |k: usize| {
            self.marks
                .iter()
                .map(|mark| usize::from(mark >> k & 1))
                .sum()
        };
        let each = NAMES.iter().enumerate().map(|(k, name)| (*name, count(k)));
        let bound: usize = each.clone().map(|(_, count)| count).sum();
        let words = each.chain([("none of these", self.moving.saturating_sub(bound))]);
        let words = words.filter(|(_, count)| *count > 0);
        words
            .map(|(name, count)| format!("{name} {:.1} %", percent(count)))
            .collect::<Vec<_>>()
            .join(", ")
    }
}

/// How much of each is used at sample `i`.
fn shares(report: &Report, motions: &[AxisMotion], i: usize) -> [f64; LIMITS] {
    let samples = &report.samples;
    let programmed = samples
        .programmed_feed_mm_s
        .get(i)
        .copied()
        .unwrap_or(f64::NAN);
    let mut shares = [samples.feed_mm_s[i] / programmed, 0.0, 0.0, 0.0, 0.0, 0.0];
    for (axis, motion) in report.axes.iter().zip(motions) {
        let limits = [
            axis.max_velocity,
            axis.max_acceleration,
            axis.max_jerk.unwrap_or(f64::INFINITY),
        ];
        let values = [motion.velocity[i], motion.acceleration[i], motion.jerk[i]];
        for (share, (value, limit)) in shares[1..4].iter_mut().zip(values.iter().zip(limits)) {
            *share = share.max(value.abs() / limit);
        }
    }
    let off = samples.deviation_mm.as_ref().map_or(0.0, |off| off[i]);
    shares[5] = samples
        .chord_share
        .as_ref()
        .and_then(|each| each.get(i))
        .copied()
        .unwrap_or(0.0);
    shares[4] = report
        .tolerance_at_mm(i)
        .map_or(0.0, |most| off / most.max(f64::MIN_POSITIVE));
    shares
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::differences::steps_s;
    use crate::model::{Axis, Samples};

    /// X at `x` each ms, with a feed of 10 mm/s programmed.
    fn words(x: &[f64], deviation_mm: f64) -> String {
        words_on_curve(x, deviation_mm, None)
    }

    fn words_on_curve(x: &[f64], deviation_mm: f64, chord_share: Option<f64>) -> String {
        let t_s: Vec<f64> = (0..x.len()).map(|i| i as f64 * 1e-3).collect();
        let feed_mm_s = std::iter::once(0.0)
            .chain(x.windows(2).map(|w| (w[1] - w[0]) * 1e3))
            .collect();
        let axis = Axis {
            letter: 'X',
            max_velocity: 100.0,
            max_acceleration: 1000.0,
            ..Axis::default()
        };
        let report = Report {
            axes: vec![axis],
            fine_period_s: 1e-3,
            path_tolerance_mm: Some(0.01),
            samples: Samples {
                programmed_feed_mm_s: vec![10.0; x.len()],
                deviation_mm: Some(vec![deviation_mm; x.len()]),
                chord_share: chord_share.map(|share| vec![share; x.len()]),
                command: vec![x.to_vec()],
                t_s: t_s.clone(),
                feed_mm_s,
                ..Samples::default()
            },
            ..Report::default()
        };
        let motion = AxisMotion::of(&report.axes[0], x, &steps_s(&t_s, 1e-3), 1e-3);
        Binding::of(&report, &[motion]).words()
    }

    #[test]
    fn what_is_used_up_binds() {
        let steady: Vec<f64> = (0..100).map(|i| f64::from(i) * 0.01).collect();
        assert_eq!(words(&steady, 0.0), "feed 100.0 %");
        let slow: Vec<f64> = (0..100).map(|i| f64::from(i) * 0.005).collect();
        assert_eq!(words(&slow, 0.0), "none of these 100.0 %");
        assert_eq!(words(&slow, 0.009), "tolerance 100.0 %");
        assert_eq!(
            words_on_curve(&slow, 0.0, Some(0.99)),
            "chord error 100.0 %"
        );
        assert_eq!(
            words_on_curve(&slow, 0.0, Some(f64::NAN)),
            "none of these 100.0 %",
            "beside a curve"
        );
        let speeding_up: Vec<f64> = (0..9).map(|i| f64::from(i * i) * 0.5e-3).collect();
        assert_eq!(words(&speeding_up, 0.0), "acceleration 100.0 %");
        assert_eq!(words(&[1.0; 9], 0.009), "", "at rest nothing binds");
    }
}
