//! Feed strategy and policy between the sample ring and the ratio ring.

use rtrb::Producer;
use tandem_rings::{Ratio, RequestKind, Sample, StrategyRequest};
use tandem_sdk::{Answer, FeedStrategy, FineSample, MAX_SIGNALS, Request, Window, Words};

use crate::policy::{Looks, Means, PolicyHost};

/// Collects the samples of a rough period and asks the strategy and the policy.
pub struct FeedRunner {
    strategy: Option<Box<dyn FeedStrategy>>,
    /// What the strategy answers counts an operator's feed override above 1 already.
    takes_override: bool,
    /// The strategy's name, or the file that it came from.
    pub name: String,
    policy: Option<(PolicyHost, Means)>,
    window: Vec<FineSample>,
    per_window: usize,
    max_ratio: f64,
    /// The last answer of the strategy.
    pub answer: Option<Answer>,
    /// Why the strategy stops the machine, in words: it is not asked again.
    pub fault: Option<String>,
    /// The strategy asked for a hold in the rough period before: that has been said.
    holds: bool,
}

impl FeedRunner {
    /// A runner for windows of `per_window` fine samples. Ratios are kept within 0 and `max_ratio`.
    pub fn new(
        strategy: Option<Box<dyn FeedStrategy>>,
        policy: Option<(PolicyHost, Means)>,
        per_window: usize,
        max_ratio: f64,
    ) -> Self {
        let window = Vec::with_capacity(per_window);
        let takes_override = strategy.as_ref().is_some_and(|it| it.takes_override());
        Self {
            strategy,
            takes_override,
            name: String::new(),
            policy,
            window,
            per_window,
            max_ratio,
            answer: None,
            fault: None,
            holds: false,
        }
    }

    /// Names of the strategy's signals.
    pub fn signals(&self) -> &'static [&'static str] {
        self.strategy
            .as_ref()
            .map_or(&[], |strategy| strategy.signals())
    }

    /// Whether the ratios that go out count an operator's feed override above 1 already.
    pub fn takes_override(&self) -> bool {
        self.takes_override
    }

    /// Takes a sample; where it completes a rough period k, the lesser of the ratios that strategy and policy ask for goes
    /// out for the first tick of period k + 2, and what else the strategy asks for with it.
    /// Gives what is to be logged of it.
    pub fn sample(
        &mut self,
        sample: &Sample,
        ratios: &mut Producer<Ratio>,
        requests: &mut Producer<StrategyRequest>,
    ) -> Option<String> {
        if self.fault.is_some() {
            return None;
        }
        self.window.push(fine_sample(sample));
        if self.window.len() < self.per_window {
            return None;
        }
        let period = sample.tick / self.per_window as u64;
        let tick = (period + 2) * self.per_window as u64;
        let asked = self.ask(period);
        let kind = match asked {
            Ok(answer) => {
                self.answer = answer.or(self.answer);
                let strategy = answer.map(|answer| answer.ratio);
                let ratio = match (strategy, self.ask_policy(period)) {
                    // A policy asks for a ratio of what the operator makes of the programmed feed.
                    (Some(strategy), Some(policy)) if self.takes_override => {
                        strategy.min(policy * sample.feed_override.max(1.0))
                    }
                    (Some(strategy), Some(policy)) => strategy.min(policy),
                    (strategy, policy) => strategy.or(policy).unwrap_or(1.0),
                };
                // A full ring means that 64 ratios wait for their tick: the fine loop has stopped, and the last one stands.
                let _ = ratios.push(Ratio {
                    tick,
                    ratio: ratio.clamp(0.0, self.max_ratio),
                });
                match answer.map_or(Request::None, |answer| answer.request) {
                    Request::None => None,
                    Request::Hold => Some(RequestKind::Hold),
                    Request::Fault(code) => Some(self.fail(&format!("fault {code}"))),
                }
            }
            Err(cause) => Some(self.fail(&cause)),
        };
        self.window.clear();
        let held = std::mem::replace(&mut self.holds, kind == Some(RequestKind::Hold));
        let kind = kind?;
        // Where the ring is full the same was asked for eight times, and has not acted yet.
        let _ = requests.push(StrategyRequest { tick, kind });
        // A strategy may ask in every period for as long as its cause lasts.
        (self.holds && !held).then(|| self.words_of_hold(sample, tick))
    }

    /// Who asks for a hold, where, and what its signals say.
    fn words_of_hold(&self, sample: &Sample, tick: u64) -> String {
        let values = self
            .answer
            .map_or([0.0; MAX_SIGNALS], |answer| answer.signals);
        let signals: Vec<String> = self
            .signals()
            .iter()
            .zip(values)
            .map(|(name, value)| format!("{name} = {value:.4}"))
            .collect();
        let words = self.strategy.as_ref().map(|strategy| strategy.explain());
        let words = words.as_ref().map_or("", Words::as_str);
        let signals = signals.join(", ");
        let parts = [words, &signals].into_iter();
        let because = parts
            .filter(|text| !text.is_empty())
            .fold(String::new(), |said, text| said + ": " + text);
        format!(
            "line {}: the feed strategy {} asks for a hold, at tick {tick}{because}",
            sample.line, self.name
        )
    }

    fn ask(&mut self, period: u64) -> Result<Option<Answer>, String> {
        let Some(strategy) = &mut self.strategy else {
            return Ok(None);
        };
        let window = Window::new(period, &self.window);
        let answer = strategy.update(&window).map_err(|e| e.to_string())?;
        if !answer.ratio.is_finite() {
            return Err(format!("update answers the ratio {}", answer.ratio));
        }
        match strategy
            .signals()
            .iter()
            .zip(answer.signals)
            .find(|(_, value)| !value.is_finite())
        {
            Some((name, value)) => Err(format!("update answers {value} for the signal {name}")),
            None => Ok(Some(answer)),
        }
    }

    fn ask_policy(&mut self, period: u64) -> Option<f64> {
        let (policy, means) = self.policy.as_mut()?;
        let strategy = self
            .answer
            .as_ref()
            .map(|answer| (answer.ratio, answer.signals.as_slice()));
        policy.period(|script| {
            let looks = Looks {
                closer: script.looks_closer(),
                signals: script.signals(),
            };
            means.of(period, &self.window, strategy, &looks)
        })
    }

    fn fail(&mut self, cause: &str) -> RequestKind {
        self.fault = Some(format!("feed strategy {}: {cause}", self.name));
        RequestKind::Fault
    }
}

fn fine_sample(sample: &Sample) -> FineSample {
    FineSample {
        tick: sample.tick,
        line: sample.line,
        command: sample.command,
        position: sample.feedback,
        speed: sample.speed,
        current_a: sample.current_a,
        feed_mm_per_s: sample.feed_mm_per_s,
        programmed_feed_mm_per_s: sample.programmed_feed_mm_per_s,
        feed_override: sample.feed_override,
        sigma: sample.sigma,
        spindle_rad_per_s: sample.spindle_rad_per_s,
        analog: sample.analog,
        inputs: sample.inputs,
        old_inputs: sample.old_inputs,
        age_periods: sample.age_periods,
    }
}
