//! What each stop took: reaction, time and distance, from the samples.

use serde::Serialize;
use tandem_rings::{Sample, StopCause};
use tandem_sdk::{Axes, AxisVector};

use crate::record::TraceCsv;

/// Most stops kept one by one; all are counted.
pub const MAX_STOPS: usize = 1000;

/// One stop: a hold, a program stop, starvation, an abort or a fault.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Stop {
    /// Fine period in which the command acted, or the cause was first answered.
    pub tick: u64,
    /// Program line that moved.
    pub line: u32,
    /// Why, in words: see [`StopCause::name`].
    pub cause: &'static str,
    /// Periods to the first sample that is slower than the plan's: 1 is the first sample there could be. None where no
    /// sample had to be: the machine rested, or the plan itself went to rest as fast as the limits allow.
    pub reaction_periods: Option<u64>,
    /// To rest, s; or as long as it lasted.
    pub time_s: f64,
    /// Path of the samples to rest, mm (deg where only rotary axes move).
    pub distance_mm: f64,
    /// Whether the machine came to rest before it went on.
    pub rest: bool,
}

/// Watches samples for stops.
#[derive(Debug)]
pub struct StopWatch {
    axes: Axes,
    period_s: f64,
    /// A sample has been seen.
    started: bool,
    /// Positions of the last two samples, and which of them is the last.
    places: [AxisVector; 2],
    last: usize,
    /// Rate of program time of the last one.
    sigma: f64,
    cause: StopCause,
    /// The last stop has not come to rest.
    open: bool,
    /// Rate of program time before it, and speed: what "slower" is compared with.
    before: (f64, f64),
    /// The first [`MAX_STOPS`].
    pub stops: Vec<Stop>,
    /// How many there were.
    pub count: u64,
}

impl StopWatch {
    /// No stop yet.
    pub fn new(axes: Axes, period_s: f64) -> Self {
        let (stops, before) = (vec![], (1.0, 0.0));
        let cause = StopCause::None;
        Self {
            axes,
            period_s,
            started: false,
            places: [AxisVector::ZERO; 2],
            last: 0,
            sigma: 1.0,
            cause,
            open: false,
            before,
            stops,
            count: 0,
        }
    }

    /// A sample was sent.
    pub fn sample(&mut self, sample: &Sample) {
        if !self.started {
            self.started = true;
            self.places = [sample.command; 2];
        }
        if sample.cause != self.cause {
            self.open = false;
            if sample.cause != StopCause::None {
                self.begin(sample);
            }
        }
        if self.open {
            let way = sample.command - self.places[self.last];
            self.go_on(sample, self.length_mm(&way));
        }
        self.cause = sample.cause;
        self.sigma = sample.sigma;
        self.last = 1 - self.last;
        self.places[self.last] = sample.command;
    }

    fn begin(&mut self, sample: &Sample) {
        self.count += 1;
        if self.stops.len() == MAX_STOPS {
            return;
        }
        self.open = true;
        let way = self.places[self.last] - self.places[1 - self.last];
        let speed_mm_per_s = self.length_mm(&way) / self.period_s;
        self.before = (self.sigma, speed_mm_per_s);
        let (cause, reaction_periods) = (sample.cause.name(), None);
        let (tick, line) = (sample.tick, sample.line);
        self.stops.push(Stop {
            tick,
            line,
            cause,
            reaction_periods,
            time_s: 0.0,
            distance_mm: 0.0,
            rest: false,
        });
    }

    fn go_on(&mut self, sample: &Sample, way_mm: f64) {
        let Some(stop) = self.stops.last_mut() else {
            return;
        };
        let (sigma, speed_mm_per_s) = self.before;
        let slower = match sample.cause {
            StopCause::Fault => way_mm / self.period_s < speed_mm_per_s,
            _ => speed_mm_per_s > 0.0 && sample.sigma < sigma,
        };
        if slower {
            stop.reaction_periods
                .get_or_insert(sample.tick + 1 - stop.tick);
        }
        if way_mm == 0.0 {
            (stop.rest, self.open) = (true, false);
            return;
        }
        stop.time_s = TraceCsv::t_s(sample.tick + 1 - stop.tick, self.period_s);
        stop.distance_mm += way_mm;
    }

    fn length_mm(&self, way: &AxisVector) -> f64 {
        let slides =
            (0..self.axes.count()).any(|axis| !self.axes.is_rotary(axis) && way[axis] != 0.0);
        let length = self.axes.path_length(way);
        if slides { length } else { length.to_degrees() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Samples along X with the given speeds, mm/s, and causes; σ goes with the speed.
    fn watched(samples: &[(f64, StopCause)]) -> StopWatch {
        let mut watch = StopWatch::new(Axes::new(&[('X', false)]).unwrap(), 0.001);
        let mut x = 0.0;
        for (tick, (speed, cause)) in samples.iter().enumerate() {
            x += speed * 0.001;
            let command = AxisVector::from_slice(&[x]);
            let (tick, sigma) = (tick as u64, speed / 4.0);
            watch.sample(&Sample {
                tick,
                command,
                sigma,
                cause: *cause,
                line: 3,
                ..Sample::default()
            });
        }
        watch
    }

    #[test]
    fn a_hold_from_its_tick_to_the_rest() {
        let (run, hold) = (StopCause::None, StopCause::Hold);
        let watch = watched(&[
            (4.0, run),
            (4.0, run),
            (3.0, hold),
            (1.0, hold),
            (0.0, hold),
            (0.0, hold),
            (4.0, run),
        ]);
        let stop = &watch.stops[0];
        assert_eq!(
            (watch.count, stop.tick, stop.line, stop.cause),
            (1, 2, 3, "hold")
        );
        assert_eq!((stop.reaction_periods, stop.rest), (Some(1), true));
        assert!((stop.time_s - 0.002).abs() < 1e-12 && (stop.distance_mm - 0.004).abs() < 1e-12);
    }

    #[test]
    fn what_is_late_at_rest_or_resumed_is_said() {
        use StopCause::{Abort, Hold, None as Run, ProgramStop};
        let late = watched(&[
            (4.0, Run),
            (4.0, Run),
            (4.0, Hold),
            (4.0, Hold),
            (2.0, Hold),
            (4.0, Run),
        ]);
        assert_eq!(
            (late.stops[0].reaction_periods, late.stops[0].rest),
            (Some(3), false)
        );
        let rest = watched(&[
            (0.0, Run),
            (0.0, ProgramStop),
            (0.0, ProgramStop),
            (0.0, Abort),
            (0.0, Run),
        ]);
        let each: Vec<_> = rest
            .stops
            .iter()
            .map(|s| (s.cause, s.reaction_periods, s.time_s, s.rest))
            .collect();
        assert_eq!(
            each,
            [
                ("program stop", None, 0.0, true),
                ("abort", None, 0.0, true)
            ]
        );
    }

    #[test]
    fn many_stops_are_counted_and_the_first_thousand_kept() {
        let one = [(4.0, StopCause::None), (0.0, StopCause::Starvation)];
        let watch = watched(&one.repeat(1200));
        assert_eq!((watch.count, watch.stops.len()), (1200, MAX_STOPS));
    }
}
