//! Feed strategies: windows of a machine that cuts, rests and is hit.

use tandem_sdk::{
    Answer, AxisVector, FeedStrategy, FineSample, MAX_SIGNALS, Plugin, Request, StrategyContext,
    Window,
};

use crate::machine::{FINE_PERIOD_S, ROUGH_PERIOD_S};
use crate::random::Random;
use crate::report::Report;
use crate::timing::Timing;
use crate::{Setup, heap};

/// Rough periods that are driven, and after how many of them memory is no longer asked for.
const PERIODS: u64 = 4000;
const WARM: u64 = 200;

/// Judges a feed strategy.
pub fn judge(plugin: Plugin, setup: &Setup, report: &mut Report) {
    let mut timing = Timing::new("update");
    for max_feed_ratio in [1.0, 1.5] {
        let open = |options: &str| plugin.feed_strategy(options, &context(max_feed_ratio));
        let (Some(mut first), Ok(mut second)) =
            (crate::open(setup, report, open), open(&setup.options))
        else {
            return;
        };
        judge_signals(first.as_ref(), report);
        let Some(answers) = answers(first.as_mut(), setup.seed, report, &mut timing) else {
            return;
        };
        judge_answers(
            &answers,
            first.max_ratio_change_per_s(),
            max_feed_ratio,
            first.signals().len(),
            report,
        );
        let again = self::answers(
            second.as_mut(),
            setup.seed,
            report,
            &mut Timing::new("update"),
        );
        report.judged("determinism");
        if again.is_none_or(|again| bits(&again) != bits(&answers)) {
            report.find(
                "determinism",
                "the same windows get other answers".to_string(),
            );
        }
    }
    report.time([timing]);
}

fn context(max_feed_ratio: f64) -> StrategyContext {
    let machine = crate::machine::context(AxisVector::ZERO);
    StrategyContext {
        limits: machine.limits,
        ..StrategyContext::new(machine.axes, FINE_PERIOD_S, ROUGH_PERIOD_S, max_feed_ratio)
    }
}

fn judge_signals(strategy: &dyn FeedStrategy, report: &mut Report) {
    const CHECK: &str = "signals";
    report.judged(CHECK);
    let names = strategy.signals();
    let plain = |name: &&str| {
        name.chars()
            .all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_')
    };
    if let Some(name) = names.iter().find(|name| name.is_empty() || !plain(name)) {
        report.find(
            CHECK,
            format!("{name:?} has other characters than a-z, 0-9 and _"),
        );
    }
    if names.len() > MAX_SIGNALS {
        report.find(
            CHECK,
            format!("{} names; {MAX_SIGNALS} are possible", names.len()),
        );
    }
}

/// The answers to all windows; none where it fails.
fn answers(
    strategy: &mut dyn FeedStrategy,
    seed: u64,
    report: &mut Report,
    timing: &mut Timing,
) -> Option<Vec<Answer>> {
    let mut random = Random::new(seed);
    let mut machine = Machine::default();
    let mut answers = vec![];
    for period in 0..PERIODS {
        let samples = machine.period(&mut random, period);
        let before = heap::uses();
        let answer = timing.of(|| strategy.update(&Window::new(period, &samples)));
        let used = heap::uses() - before;
        match answer {
            Ok(answer) => answers.push(answer),
            Err(error) => {
                let check = if error.is_panic() {
                    "panics"
                } else {
                    "lifecycle"
                };
                report.find(check, format!("update, period {period}: {error}"));
                return None;
            }
        }
        if !heap::counts() {
            report.skip("allocation", heap::NOT_COUNTED);
        } else if used > 0 && period > WARM {
            report.find(
                "allocation",
                format!("update uses the heap {used} times in period {period}"),
            );
        } else {
            report.judged("allocation");
        }
    }
    Some(answers)
}

/// In range, and no faster than it declares.
fn judge_answers(
    answers: &[Answer],
    change_per_s: f64,
    most: f64,
    signals: usize,
    report: &mut Report,
) {
    const RANGE: &str = "ratio in range";
    const RATE: &str = "ratio changes as declared";
    const FINITE: &str = "signals are numbers";
    for check in [RANGE, RATE, FINITE] {
        report.judged(check);
    }
    let step = change_per_s * ROUGH_PERIOD_S * (1.0 + 1e-9);
    let mut last = 1.0;
    for (period, answer) in answers.iter().enumerate() {
        let ratio = answer.ratio;
        if !(0.0..=most).contains(&ratio) {
            report.find(
                RANGE,
                format!("period {period}: {ratio}; 0 to {most} are possible"),
            );
        }
        if (ratio - last).abs() > step {
            report.find(
                RATE,
                format!("period {period}: from {last} to {ratio}; {step} in a period is declared"),
            );
        }
        if answer.signals[..signals]
            .iter()
            .any(|value| !value.is_finite())
        {
            report.find(
                FINITE,
                format!("period {period}: {:?}", &answer.signals[..signals]),
            );
        }
        last = ratio;
    }
}

fn bits(answers: &[Answer]) -> Vec<(u64, [u64; MAX_SIGNALS], Request)> {
    answers
        .iter()
        .map(|a| (a.ratio.to_bits(), a.signals.map(f64::to_bits), a.request))
        .collect()
}

/// A machine that cuts on circles; its load wanders, and now and then it rests, runs idle or is hit.
#[derive(Default)]
struct Machine {
    tick: u64,
    angle_rad: f64,
    load_a: f64,
    hit_a: f64,
    resting: bool,
}

impl Machine {
    fn period(&mut self, random: &mut Random, period: u64) -> Vec<FineSample> {
        if random.once_in(50) {
            self.resting = !self.resting;
        }
        if random.once_in(20) {
            self.load_a = random.magnitude(0.01, 100.0);
        }
        self.hit_a = if random.once_in(100) {
            random.magnitude(10.0, 1e6)
        } else {
            0.0
        };
        if period.is_multiple_of(500) {
            self.load_a = 0.0;
        }
        (0..8).map(|_| self.sample(random)).collect()
    }

    fn sample(&mut self, random: &mut Random) -> FineSample {
        let feed_mm_per_s = if self.resting { 0.0 } else { 40.0 };
        self.angle_rad += feed_mm_per_s * FINE_PERIOD_S / 30.0;
        self.tick += 1;
        let (sin, cos) = self.angle_rad.sin_cos();
        let noise = random.between(-0.01, 0.01);
        let command = AxisVector::from_slice(&[30.0 * cos, 30.0 * sin]);
        FineSample {
            tick: self.tick,
            line: 1 + (self.tick / 1000) as u32,
            command,
            position: command + AxisVector::from_slice(&[noise, noise]),
            speed: AxisVector::from_slice(&[-feed_mm_per_s * sin, feed_mm_per_s * cos]),
            current_a: AxisVector::from_slice(&[
                self.load_a * (1.0 + noise) + self.hit_a,
                self.load_a,
                noise,
            ]),
            feed_mm_per_s,
            programmed_feed_mm_per_s: 40.0,
            sigma: 1.0,
            spindle_rad_per_s: 300.0 + noise,
            ..FineSample::default()
        }
    }
}
