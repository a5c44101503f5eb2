//! The feed strategy between the sample ring and the ratio ring.

use tandem_rings::{HostEnd, Ratio, RequestKind, Sample, StrategyRequest};
use tandem_sdk::{Answer, FeedStrategy, FineSample, RawSlice, Request, Window, size_of_contract};

/// Collects the samples of a rough period and asks the strategy.
pub struct StrategyRunner {
    strategy: Box<dyn FeedStrategy>,
    window: Vec<FineSample>,
    per_window: usize,
    max_ratio: f64,
    /// The last answer.
    pub answer: Option<Answer>,
    /// Why the strategy stops the machine, in words: it is not asked again.
    pub fault: Option<String>,
}

impl StrategyRunner {
    /// A runner for windows of `per_window` fine samples. Ratios are kept within 0 and `max_ratio`.
    pub fn new(strategy: Box<dyn FeedStrategy>, per_window: usize, max_ratio: f64) -> Self {
        Self { strategy, window: Vec::with_capacity(per_window), per_window, max_ratio, answer: None, fault: None }
    }

    /// Names of the strategy's signals.
    pub fn signals(&self) -> &'static [&'static str] {
        self.strategy.signals()
    }

    /// Takes a sample; where it completes a rough period k, what the strategy answers goes out for the first tick of
    /// period k + 2.
    pub fn sample(&mut self, sample: &Sample, host: &mut HostEnd) {
        if self.fault.is_some() {
            return;
        }
        self.window.push(fine_sample(sample));
        if self.window.len() < self.per_window {
            return;
        }
        let period = sample.tick / self.per_window as u64;
        let tick = (period + 2) * self.per_window as u64;
        let kind = match self.ask(period) {
            Ok(answer) => {
                // A full ring means that 64 ratios wait for their tick: the fine loop has stopped, and the last one stands.
                let _ = host.ratios.push(Ratio { tick, ratio: answer.ratio.clamp(0.0, self.max_ratio) });
                self.answer = Some(answer);
                match answer.request {
                    Request::None => return,
                    Request::Hold => RequestKind::Hold,
                    Request::Fault(code) => self.fail(&format!("fault {code}")),
                }
            }
            Err(cause) => self.fail(&cause),
        };
        // Where the ring is full the same was asked for eight times, and has not acted yet.
        let _ = host.requests.push(StrategyRequest { tick, kind });
    }

    fn ask(&mut self, period: u64) -> Result<Answer, String> {
        let window = Window { size: size_of_contract::<Window>(), period, samples: RawSlice::new(&self.window) };
        let answer = self.strategy.update(&window).map_err(|e| e.to_string())?;
        self.window.clear();
        if answer.ratio.is_finite() { Ok(answer) } else { Err(format!("ratio {}", answer.ratio)) }
    }

    fn fail(&mut self, cause: &str) -> RequestKind {
        self.fault = Some(format!("feed strategy: {cause}"));
        RequestKind::Fault
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
