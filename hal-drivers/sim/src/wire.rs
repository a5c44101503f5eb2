//! The wire between driver and drives: frames that are lost, answers that are late, and the time that they take.

use serde::{Deserialize, Serialize};
use tandem_random::Random;
use tandem_sdk::{Feedback, Latch, MAX_DELAY_PERIODS, MAX_DIGITAL, MAX_LATCHES, PluginError};

use crate::options::{Options, refusal, within};

/// Which frames something happens to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Frames {
    /// Share of the exchanges at which it begins, 0 to 1.
    pub probability: f64,
    /// Ticks at which it begins.
    pub ticks: Vec<u64>,
    /// Fine periods that it lasts.
    pub periods: u32,
}

impl Default for Frames {
    fn default() -> Self {
        Self {
            probability: 0.0,
            ticks: Vec::new(),
            periods: 1,
        }
    }
}

impl Frames {
    pub(crate) fn check(&self, key: &str) -> Result<(), PluginError> {
        within(&format!("{key}.probability"), self.probability, 0.0, 1.0)?;
        within(&format!("{key}.periods"), f64::from(self.periods), 1.0, 1e6)?;
        if self.probability == 0.0 && self.ticks.is_empty() {
            return Err(refusal(
                key,
                "neither a probability nor ticks: it would never happen",
            ));
        }
        Ok(())
    }
}

/// Tells which frames something happens to.
#[derive(Clone, Debug)]
struct Gate {
    frames: Frames,
    random: Random,
    /// Periods that it still lasts.
    left: u32,
    /// The tick at which it began last: a tick that is sent again begins nothing.
    begun: Option<u64>,
}

impl Gate {
    fn new(frames: &Frames, seed: u64) -> Self {
        Self {
            frames: frames.clone(),
            random: Random::new(seed),
            left: 0,
            begun: None,
        }
    }

    fn hits(&mut self, tick: u64) -> bool {
        let drawn = self.frames.probability > 0.0 && self.random.share() < self.frames.probability;
        if self.left > 0 {
            self.left -= 1;
            return true;
        }
        let stated = self.begun != Some(tick) && self.frames.ticks.contains(&tick);
        if stated {
            self.begun = Some(tick);
        }
        let hit = drawn || stated;
        self.left = if hit { self.frames.periods - 1 } else { 0 };
        hit
    }
}

/// What becomes of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Frame {
    /// It goes through.
    Sound,
    /// The drives get no setpoint and the driver no answer.
    Lost,
    /// The drives get their setpoint; the answer is not there yet.
    Late,
}

/// The wire of a driver. Nothing here allocates once it is made.
#[derive(Clone, Debug)]
pub(crate) struct Wire {
    lost: Option<Gate>,
    late: Option<Gate>,
    patience_periods: u32,
    /// Answers on their way, the oldest at `next`; none where they come in the same exchange.
    coming: Vec<Feedback>,
    next: usize,
    /// What came last.
    told: Feedback,
    /// Fine periods since then.
    age: u32,
    /// Edges that were caught and not told yet.
    caught: [Latch; MAX_LATCHES],
    period_s: f64,
}

impl Wire {
    /// A wire whose drives would have answered `first` up to now.
    pub fn new(options: &Options, first: &Feedback, period_s: f64) -> Self {
        let gate = |frames: &Option<Frames>, salt| {
            frames
                .as_ref()
                .map(|f| Gate::new(f, options.seed.wrapping_add(salt)))
        };
        Self {
            lost: gate(&options.lost_frames, LOST),
            late: gate(&options.late_frames, LATE),
            patience_periods: options.patience_periods,
            coming: vec![*first; options.delay_periods as usize],
            next: 0,
            told: *first,
            age: 0,
            caught: [Latch::default(); MAX_LATCHES],
            period_s,
        }
    }

    /// Whether everything goes through at once: then [`Wire::deliver`] need not be asked.
    pub fn is_ideal(&self) -> bool {
        self.lost.is_none() && self.late.is_none() && self.coming.is_empty()
    }

    /// What becomes of the frame of this exchange. Fine loop.
    pub fn send(&mut self, tick: u64) -> Frame {
        let lost = self.lost.as_mut().is_some_and(|gate| gate.hits(tick));
        let late = self.late.as_mut().is_some_and(|gate| gate.hits(tick));
        match (lost, late) {
            (true, _) => Frame::Lost,
            (false, true) => Frame::Late,
            (false, false) => Frame::Sound,
        }
    }

    /// Puts what the driver hears in this exchange in the place of what the drives say in it; whether the driver has lost its
    /// patience. Fine loop.
    pub fn deliver(&mut self, frame: Frame, feedback: &mut Feedback) -> bool {
        if let Some(oldest) = self.coming.get_mut(self.next) {
            std::mem::swap(oldest, feedback);
            self.next = (self.next + 1) % self.coming.len();
        }
        self.caught
            .iter_mut()
            .for_each(|latch| latch.before_s += self.period_s);
        feedback
            .latches
            .iter()
            .filter(|latch| latch.edge != 0)
            .for_each(|latch| keep(&mut self.caught, latch));
        if frame == Frame::Sound {
            feedback.latches = std::mem::take(&mut self.caught);
            (self.told, self.age) = (*feedback, 0);
        } else {
            *feedback = self.told;
            feedback.latches = [Latch::default(); MAX_LATCHES];
            self.age = self.age.saturating_add(1);
        }
        self.mark(feedback);
        self.age > self.patience_periods
    }

    /// Writes how old what is told is.
    fn mark(&self, feedback: &mut Feedback) {
        let input_age = u16::try_from(self.age).unwrap_or(u16::MAX);
        feedback.input_age_periods = [input_age; MAX_DIGITAL];
        // A joint whose drive is lost was old already.
        feedback
            .age_periods
            .iter_mut()
            .for_each(|age| *age = age.saturating_add(self.age));
    }
}

/// Puts `latch` where nothing is kept; where everything is full, the newest is told no more.
fn keep(caught: &mut [Latch; MAX_LATCHES], latch: &Latch) {
    if let Some(free) = caught.iter_mut().find(|kept| kept.edge == 0) {
        *free = *latch;
    }
}

/// What makes rows of random numbers from one seed different ones.
const LOST: u64 = 0x6c6f_7374;
const LATE: u64 = 0x6c61_7465;

/// Whether the numbers of the options make a wire.
pub(crate) fn check(options: &Options) -> Result<(), PluginError> {
    options
        .lost_frames
        .as_ref()
        .map_or(Ok(()), |frames| frames.check("lost_frames"))?;
    options
        .late_frames
        .as_ref()
        .map_or(Ok(()), |frames| frames.check("late_frames"))?;
    within(
        "delay_periods",
        f64::from(options.delay_periods),
        0.0,
        f64::from(MAX_DELAY_PERIODS),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use tandem_sdk::{AxisVector, MAX_AXES};

    fn said(number: u32) -> Feedback {
        Feedback {
            position: AxisVector([f64::from(number); MAX_AXES]),
            ..Feedback::default()
        }
    }

    /// Place and age that the driver hears of joint 0 in each of ten exchanges, and whether it has lost its patience.
    fn heard(options: &str) -> Vec<(f64, u32, bool)> {
        let mut wire = Wire::new(&Options::parse(options).unwrap(), &said(0), 0.001);
        let exchange = |tick: u32| {
            let (frame, mut feedback) = (wire.send(u64::from(tick)), said(tick));
            let impatient = wire.deliver(frame, &mut feedback);
            assert_eq!(
                u32::from(feedback.input_age_periods[63]),
                feedback.age_periods[0]
            );
            (feedback.position[0], feedback.age_periods[0], impatient)
        };
        (1..=10).map(exchange).collect()
    }

    #[test]
    fn old_numbers_go_out_with_their_age() {
        for key in ["lost_frames", "late_frames"] {
            let heard = heard(&format!(
                "patience_periods = 2\n{key} = {{ ticks = [3], periods = 3 }}"
            ));
            let some = [
                (2.0, 0, false),
                (2.0, 1, false),
                (2.0, 2, false),
                (2.0, 3, true),
                (6.0, 0, false),
            ];
            assert_eq!(heard[1..6], some);
        }
    }

    #[test]
    fn answers_may_take_their_time() {
        let heard = heard("delay_periods = 2");
        assert_eq!(
            heard[..4],
            [
                (0.0, 0, false),
                (0.0, 0, false),
                (1.0, 0, false),
                (2.0, 0, false)
            ]
        );
    }

    #[test]
    fn frames_get_lost_as_often_as_they_are_to() {
        let row = |seed: u32| {
            let text = format!("seed = {seed}\nlost_frames = {{ probability = 0.1 }}");
            let mut wire = Wire::new(&Options::parse(&text).unwrap(), &said(0), 0.001);
            (1..=10_000)
                .filter(|tick| wire.send(*tick) == Frame::Lost)
                .collect::<Vec<_>>()
        };
        assert!((900..1100).contains(&row(1).len()), "{}", row(1).len());
        assert!(row(1) == row(1) && row(1) != row(2));
    }

    #[test]
    fn a_latch_is_told_once_with_the_next_frame_that_gets_through() {
        let options = Options::parse("lost_frames = { ticks = [3], periods = 2 }").unwrap();
        let mut wire = Wire::new(&options, &said(0), 0.001);
        let mut told = Vec::new();
        for tick in 1..=8_u32 {
            let (frame, mut feedback) = (wire.send(u64::from(tick)), said(tick));
            if tick == 3 {
                feedback.latches[0] = Latch {
                    edge: 1,
                    joints: 1,
                    before_s: 0.000_25,
                    ..Latch::default()
                };
            }
            wire.deliver(frame, &mut feedback);
            told.extend(
                feedback
                    .latches
                    .iter()
                    .filter(|l| l.edge != 0)
                    .map(|l| (tick, (l.before_s * 1e6).round())),
            );
        }
        assert_eq!(told, [(5, 2250.0)]);
    }
}
