//! The feed strategy between the sample ring and the ratio ring.

use rtrb::Producer;
use tandem_rings::{Controls, Ratio, Sample};
use tandem_sdk::{Answer, FeedStrategy, FineSample, RawSlice, Request, Window, size_of_contract};

use crate::command::Command;

/// Collects the samples of a rough period and asks the strategy.
pub struct StrategyRunner {
    strategy: Box<dyn FeedStrategy>,
    window: Vec<FineSample>,
    per_window: usize,
    max_ratio: f64,
    /// The last answer.
    pub answer: Option<Answer>,
}

impl StrategyRunner {
    /// A runner for windows of `per_window` fine samples. Ratios are kept within 0 and `max_ratio`.
    pub fn new(strategy: Box<dyn FeedStrategy>, per_window: usize, max_ratio: f64) -> Self {
        Self { strategy, window: Vec::with_capacity(per_window), per_window, max_ratio, answer: None }
    }

    /// Names of the strategy's signals.
    pub fn signals(&self) -> &'static [&'static str] {
        self.strategy.signals()
    }

    /// Takes a sample; where it completes a rough period k, the ratio for the first tick of period k + 2 goes out.
    ///
    /// # Errors
    /// The strategy's own words, or a ratio that is not a number.
    pub fn sample(&mut self, sample: &Sample, ratios: &mut Producer<Ratio>, controls: &Controls) -> Result<(), String> {
        self.window.push(fine_sample(sample));
        if self.window.len() < self.per_window {
            return Ok(());
        }
        let period = sample.tick / self.per_window as u64;
        let window = Window { size: size_of_contract::<Window>(), period, samples: RawSlice::new(&self.window) };
        let answer = self.strategy.update(&window).map_err(|e| e.to_string())?;
        self.window.clear();
        if !answer.ratio.is_finite() {
            return Err(format!("ratio {}", answer.ratio));
        }
        let tick = (period + 2) * self.per_window as u64;
        // A full ring means that 64 ratios wait for their tick: the fine loop has stopped, and the last ratio stands.
        let _ = ratios.push(Ratio { tick, ratio: answer.ratio.clamp(0.0, self.max_ratio) });
        self.answer = Some(answer);
        match answer.request {
            Request::None => Ok(()),
            Request::Hold => {
                Command::Hold.give(controls);
                Ok(())
            }
            Request::Fault(code) => Err(format!("fault {code}")),
        }
    }
}

fn fine_sample(sample: &Sample) -> FineSample {
    FineSample {
        tick: sample.tick,
        line: sample.line,
        reserved: 0,
        command: sample.command,
        position: sample.feedback,
        speed: sample.speed,
        current_a: sample.current_a,
        feed_mm_per_s: sample.feed_mm_per_s,
        programmed_feed_mm_per_s: sample.programmed_feed_mm_per_s,
        sigma: sample.sigma,
        spindle_rad_per_s: sample.spindle_rad_per_s,
    }
}
