//! Progress of program time: where nothing is asked to stop, it gets on, or the machine faults.
//!
//! In any window of [`Progress::max_periods`] fine periods in which nothing asks for a stop, the queue is not starved and
//! something is queued, program time grows by at least one fine period at the least rate that was asked for in the window, or a
//! rest further on is reached: blocks of far less than a period that each end at rest take one period each, however short they are.
//! The window is derived from the machine: from rest an axis is at its highest speed V after `V/A + A/J`. At half the rate
//! the plan itself takes a quarter of the acceleration and an eighth of the jerk at most, so that what is left brings σ up in
//! four times that, and by then far more than one period of program time has passed.

use super::govern::Ask;
use crate::config::FineConfig;
use crate::cursor::{Cursor, Reached};
use crate::fault::FaultKind;

/// How many times the longest way of an axis from rest to its highest speed a window lasts.
const WINDOW: f64 = 4.0;
/// Periods beside that: in the first 16 a jerk limit lets σ change by hundredths only, whatever the axes could.
const FIRST_PERIODS: f64 = 32.0;

/// An override or a ratio below it is as good as 0, and a rate of program time that is none: a period of it is the rounding of a day of program time.
const NO_RATE: f64 = 1e-8;

/// What has passed since progress was last made.
#[derive(Debug)]
pub(super) struct Progress {
    max_periods: u64,
    periods: u64,
    /// Program time when the window began, s.
    from_s: f64,
    /// Program time after the last period, s.
    last_s: f64,
    /// Least rate asked for in the window.
    asked: f64,
}

impl Progress {
    /// A window that has just begun. Host.
    pub(super) fn new(config: &FineConfig) -> Self {
        let longest_s =
            config.limits.axes[..config.lane_count()]
                .iter()
                .fold(0.0, |most: f64, axis| {
                    let build_up_s = if config.order >= 3 {
                        axis.acceleration_mm_per_s2 / axis.jerk_mm_per_s3
                    } else {
                        0.0
                    };
                    most.max(
                        axis.feed_mm_per_s.max(axis.rapid_mm_per_s) / axis.acceleration_mm_per_s2
                            + build_up_s,
                    )
                });
        let max_periods = (WINDOW * longest_s / config.period_s + FIRST_PERIODS).ceil() as u64;
        Self {
            max_periods,
            periods: 0,
            from_s: 0.0,
            last_s: 0.0,
            asked: 1.0,
        }
    }

    /// The least rate that was asked for in a period.
    pub(super) fn ask(&mut self, rate: f64) {
        self.asked = self.asked.min(rate);
    }

    fn begin(&mut self, now_s: f64) {
        self.periods = 0;
        self.from_s = now_s;
        self.asked = 1.0;
    }

    /// After a move that `reached` something: program time has got on, or nothing asks for it, or that is the fault given. It is
    /// to get on at a rate of `least_ratio`, the lower one of those for feeds and rapids.
    #[inline]
    pub(super) fn watch(
        &mut self,
        cursor: &Cursor,
        ask: Ask,
        reached: Reached,
        period_s: f64,
        least_ratio: impl FnOnce() -> f64,
    ) -> Option<FaultKind> {
        let now_s = cursor.program_time_s();
        let grown_s = now_s - self.from_s;
        let min_s = self.asked * period_s;
        let is_at_next_rest = reached == Reached::Rest && now_s > self.last_s;
        self.last_s = now_s;
        // What is true nearly always is looked at first.
        if grown_s > min_s
            || is_at_next_rest
            || ask != Ask::Run
            || least_ratio() < NO_RATE
            || (reached == Reached::Rest && cursor.is_last())
        {
            self.begin(now_s);
            return None;
        }
        self.periods += 1;
        (self.periods > self.max_periods).then_some(FaultKind::NoProgress {
            periods: self.periods,
            grown_s,
            asked: self.asked,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rtrb::{Producer, RingBuffer};
    use tandem_rings::Queued;
    use tandem_sdk::{AxisLimits, AxisVector, Limits, Segment, SegmentFlags};

    const PERIOD_S: f64 = 0.001;

    fn config(order: u32) -> FineConfig {
        let axis = |feed_mm_per_s, rapid_mm_per_s| AxisLimits {
            feed_mm_per_s,
            rapid_mm_per_s,
            acceleration_mm_per_s2: 1000.0,
            jerk_mm_per_s3: 5000.0,
            ..AxisLimits::unlimited()
        };
        let limits = Limits::new(&[axis(100.0, 50.0), axis(10.0, 150.0)]).unwrap();
        FineConfig {
            order,
            ..FineConfig::new(PERIOD_S, limits)
        }
    }

    /// In motion on the first of two segments of a second, and the end of the queue that more may come from.
    fn cursor() -> (Cursor, Producer<Queued>) {
        let (mut input, output) = RingBuffer::new(8);
        for start_s in [0.0, 1.0] {
            let mut segment = Segment::rest(&AxisVector::ZERO, 1.0);
            segment.flags = SegmentFlags::default();
            input.push(Queued::Segment { start_s, segment }).unwrap();
        }
        let mut cursor = Cursor::new(output, &AxisVector::ZERO);
        cursor.advance(0.1, |_| false);
        (cursor, input)
    }

    #[test]
    fn a_window_is_derived_from_the_longest_way_to_the_highest_speed() {
        assert_eq!(Progress::new(&config(2)).max_periods, 4 * 150 + 32);
        assert_eq!(Progress::new(&config(3)).max_periods, 4 * (150 + 200) + 32);
    }

    #[test]
    fn what_gets_on_by_less_than_a_period_of_the_least_rate_asked_for_is_a_fault_after_the_window()
    {
        let ((mut cursor, _input), mut progress) = (cursor(), Progress::new(&config(2)));
        let watch = |progress: &mut Progress, cursor: &Cursor, ask, ratio: f64| {
            progress.watch(cursor, ask, Reached::Inside, PERIOD_S, || ratio)
        };
        let first = watch(&mut progress, &cursor, Ask::Run, 1.0);
        assert_eq!(first, None, "it has got on since the start");
        progress.ask(0.5);
        progress.ask(0.8);
        let most = progress.max_periods;
        cursor.advance(0.4 * PERIOD_S, |_| false);
        let stand = |progress: &mut Progress, cursor: &Cursor| {
            (1..=most).all(|_| watch(progress, cursor, Ask::Run, 1.0).is_none())
        };
        assert!(stand(&mut progress, &cursor));
        let mut again = copy_of(&progress);
        let Some(FaultKind::NoProgress {
            periods,
            grown_s,
            asked,
        }) = again.watch(&cursor, Ask::Run, Reached::Inside, PERIOD_S, || 1.1e-8)
        else {
            panic!("no fault")
        };
        assert_eq!((periods, asked), (most + 1, 0.5));
        assert!((grown_s - 0.4 * PERIOD_S).abs() < 1e-12, "{grown_s} s");
        // A hold, and a ratio of nothing, ask for nothing; what has got on by enough begins anew.
        for (ask, ratio, further_s) in [
            (Ask::Hold, 1.0, 0.0),
            (Ask::Run, 0.9e-8, 0.0),
            (Ask::Run, 1.0, 0.2 * PERIOD_S),
        ] {
            let mut again = copy_of(&progress);
            cursor.advance(further_s, |_| false);
            let found = again.watch(&cursor, ask, Reached::Inside, PERIOD_S, || ratio);
            assert_eq!((found, again.periods), (None, 0), "{ask:?} {ratio}");
        }
    }

    /// Where a rest ahead asks for less and less, to come to it is still progress, and to stand before it is none.
    #[test]
    fn what_stands_is_a_fault_after_the_window_however_little_was_asked_for() {
        for asked in [1.0, 1e-3, 0.0] {
            let ((mut cursor, _input), mut progress) = (cursor(), Progress::new(&config(2)));
            let most = progress.max_periods;
            let mut watch = |cursor: &Cursor| {
                progress.ask(asked);
                progress.watch(cursor, Ask::Run, Reached::Inside, PERIOD_S, || 1.0)
            };
            for _ in 0..2 * most {
                cursor.advance(2.0 * asked.max(1e-6) * PERIOD_S / 10.0, |_| false);
                assert_eq!(watch(&cursor), None, "it gets on");
            }
            assert!((0..=most).any(|_| watch(&cursor).is_some()));
        }
    }

    fn copy_of(progress: &Progress) -> Progress {
        Progress { ..*progress }
    }

    #[test]
    fn a_rest_further_on_is_progress_and_the_last_one_is_all_there_is() {
        let ((mut cursor, input), mut progress) = (cursor(), Progress::new(&config(2)));
        let rest = |progress: &mut Progress, cursor: &Cursor| {
            let found = progress.watch(cursor, Ask::Run, Reached::Rest, PERIOD_S, || 1.0);
            assert_eq!(found, None);
            progress.periods
        };
        assert_eq!(rest(&mut progress, &cursor), 0);
        cursor.advance(1e-6, |_| false);
        assert_eq!(
            rest(&mut progress, &cursor),
            0,
            "further on, by however little"
        );
        assert_eq!(rest(&mut progress, &cursor), 1, "the same rest");
        cursor.advance(5.0, |_| false);
        drop(input);
        assert!(cursor.is_last());
        assert_eq!(rest(&mut progress, &cursor), 0);
        assert_eq!(rest(&mut progress, &cursor), 0, "nothing is left to do");
        let stands = progress.watch(&cursor, Ask::Run, Reached::Wall, PERIOD_S, || 1.0);
        assert_eq!((stands, progress.periods), (None, 1), "at a wall there is");
    }
}
