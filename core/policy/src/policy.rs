//! A script at work: windows, periods, strikes, quarantine, reload.

use tandem_sdk::{Block, Curve};

use crate::bounds::{Asks, Bounds, InForce, Tuning};
use crate::budget::Budget;
use crate::counters::Counters;
use crate::error::{Refusal, Trouble};
use crate::facts::Facts;
use crate::inputs::{Input, Places, Sights};
use crate::notes::Notes;
use crate::parameters::{Parameter, Values};
use crate::period::{Period, of_version};
use crate::window::{BlockWindow, Looks};
use crate::{Instance, Script};

/// Calls that go wrong before a script is not called any more.
pub const MAX_STRIKES: u32 = 3;

/// A script that runs. Where it fails, the default policy takes over: blocks as programmed, ratio 1.
pub struct Policy {
    script: Script,
    values: Values,
    budget: Budget,
    /// Of each answer.
    bounds: Bounds,
    /// Whether the first script tunes blocks, and whether it answers periods: the bounds are made for that.
    answers: (bool, bool),
    instance: Option<Instance>,
    /// What there is to see, and where what the script looks at is.
    sights: Sights,
    places: Places,
    strikes: u32,
    window: BlockWindow,
    asks: Vec<Asks>,
    tunings: Vec<Tuning>,
    ratio: f64,
    notes: Notes,
    counters: Counters,
}

impl Policy {
    /// Starts `script` with the parameters `values` of the machine file. Allocates.
    ///
    /// # Errors
    /// It does not start, its layout is wrong, the parameters do not fit, or the machine has not what it looks at.
    pub fn new(
        script: Script,
        values: Values,
        budget: Budget,
        bounds: Bounds,
        facts: &Facts,
    ) -> Result<Self, Refusal> {
        let mut instance = Instance::new(&script, &budget, &values)?;
        let sights = Sights::new(facts.axes, &facts.signals, instance.inputs());
        let places = sights.places(instance.inputs())?;
        instance.place(&places);
        let mut window = BlockWindow::new(facts);
        window.look_at(looks(&script, &instance));
        let answers = (script.tunes_blocks, script.answers_periods);
        Ok(Self {
            script,
            values,
            budget,
            bounds: bounds.for_each_answer(answers == (true, true)),
            answers,
            instance: Some(instance),
            sights,
            places,
            strikes: 0,
            window,
            asks: Vec::with_capacity(crate::abi::WINDOW_BLOCKS),
            tunings: Vec::with_capacity(crate::abi::WINDOW_BLOCKS),
            ratio: 1.0,
            notes: Notes::new(facts.rough_period_s),
            counters: Counters::default(),
        })
    }

    /// The parameters that the script declares; none once it is in quarantine. Allocates.
    pub fn declared(&self) -> Vec<Parameter> {
        let instance = self.instance.as_ref();
        instance.map_or(vec![], |instance| instance.parameters().to_vec())
    }

    /// What the script looks for in the part program: each is stated by [`Self::state`] where the program states it.
    pub fn program_inputs(&self) -> &[Input] {
        &self.sights.program
    }

    /// Which signals the script sees, as indices of [`Facts::signals`], in the order of [`Period::signals`].
    pub fn signals(&self) -> &[usize] {
        &self.places.signals
    }

    /// Whether the script is told more than version 1 of the ABI tells.
    pub fn looks_closer(&self) -> bool {
        self.script.version > 1
    }

    /// The program states `value` for [`Self::program_inputs`] number `which`: it holds for the blocks offered from here on. NaN
    /// where it states what is no number and no word.
    pub fn state(&mut self, which: usize, value: f64) {
        self.window.state(which, value);
    }

    /// Takes the next block of the window, at most 64 of them. The first one after [`Self::decide`] begins a new window.
    pub fn offer(&mut self, block: &Block, curve: Option<Curve<'_>>) {
        if !self.tunings.is_empty() {
            self.tunings.clear();
            self.window.clear();
        }
        self.window.push(block, curve);
    }

    /// Asks the script about the blocks offered; `next` follows them in the same stretch.
    pub fn decide(&mut self, next: Option<(&Block, Option<Curve<'_>>)>) {
        self.window.close(next);
        self.asks.clear();
        if self.script.tunes_blocks && self.ask_window().is_none() {
            self.asks.clear();
        }
        for (index, block) in self.window.blocks().iter().enumerate() {
            let asks = self.asks.get(index).copied().unwrap_or([f64::NAN; 3]);
            let (tuning, limited) = self.bounds.apply(&asks, block);
            count(&mut self.counters, &tuning, limited);
            let told = told(&tuning, limited);
            if self.notes.is_full() {
                self.notes.leave_out(told);
            } else if told > 0 {
                note(&mut self.notes, block, &asks, &tuning, limited);
            }
            self.tunings.push(tuning);
        }
    }

    /// What block `index` of the window gets.
    pub fn tuning(&self, index: usize) -> Tuning {
        self.tunings.get(index).copied().unwrap_or_default()
    }

    /// The planner refused a tuning: the block is driven as programmed.
    pub fn refused_by_planner(&mut self, line: u32, cause: &str) {
        self.counters.refused_by_planner += 1;
        self.notes.note(|| {
            format!("policy: line {line}: the planner refuses what was asked for, {cause}")
        });
    }

    /// The feed ratio after a rough period; `None` where the script asks for none.
    pub fn period(&mut self, period: &Period) -> Option<f64> {
        self.notes.period();
        if !self.script.answers_periods {
            return None;
        }
        let Some(asked) = self.ask_period(period).filter(|asked| !asked.is_nan()) else {
            self.ratio = 1.0;
            return None;
        };
        let (ratio, limited) = self.bounds.ratio(asked, self.ratio, period.duration_s);
        self.counters.limited += u64::from(limited);
        self.counters.ratios += u64::from(ratio != 1.0);
        if ratio != self.ratio {
            let (line, old) = (period.line, self.ratio);
            self.notes
                .note(|| format!("policy: line {line}: feed ratio {old:.3} -> {ratio:.3}"));
        }
        self.ratio = ratio;
        Some(ratio)
    }

    /// Puts `script`, started as `instance`, in the place of the one that runs, and hands over its state where both keep
    /// any. Strikes and quarantine are forgotten. Not to be called between [`Self::offer`] and [`Self::decide`].
    ///
    /// # Errors
    /// The new script gives an answer that the first did not give, looks at what is not there, or does not take over the
    /// state: the old one goes on.
    pub fn swap(&mut self, script: Script, mut instance: Instance) -> Result<(), Refusal> {
        let (tunes_blocks, answers_periods) = self.answers;
        let calls = [
            (script.tunes_blocks, tunes_blocks, "on_blocks"),
            (script.answers_periods, answers_periods, "on_period"),
        ];
        // Blocks that are planned already have caps down to a floor that was made for the first script alone.
        if let Some((_, _, call)) = calls.into_iter().find(|(has, had, _)| *has && !had) {
            return Err(Refusal::Exports(vec![format!(
                "it exports {call}, which the script that the run began with did not: that takes a new run"
            )]));
        }
        let places = self.sights.places(instance.inputs())?;
        instance.place(&places);
        if let Some(old) = &mut self.instance
            && script.keeps_state
        {
            // Where the old one cannot save, the new one begins afresh.
            let state = old.save().unwrap_or_default();
            instance.restore(&state).map_err(Refusal::Restore)?;
        }
        self.window.look_at(looks(&script, &instance));
        self.places = places;
        self.script = script;
        self.instance = Some(instance);
        self.strikes = 0;
        self.counters.reloads += 1;
        self.notes
            .always("policy: the script is loaded anew".to_string());
        Ok(())
    }

    /// A new script is not taken: the one that runs goes on.
    pub fn keep(&mut self, why: &str) {
        self.counters.refused_reloads += 1;
        self.notes.always(format!(
            "policy: the new script is refused, the old one goes on: {why}"
        ));
    }

    /// The parameters of the machine file, for a new instance.
    pub fn values(&self) -> &Values {
        &self.values
    }

    /// The budget, for a new instance.
    pub fn budget(&self) -> &Budget {
        &self.budget
    }

    /// What has been counted.
    pub fn counters(&self) -> &Counters {
        &self.counters
    }

    /// Whether the script is not called any more.
    pub fn is_quarantined(&self) -> bool {
        self.strikes >= MAX_STRIKES
    }

    /// Calls that went wrong since the script was loaded.
    pub fn strikes(&self) -> u32 {
        self.strikes
    }

    /// What has been noted since the last look, a line each.
    pub fn take_notes(&mut self) -> Vec<String> {
        self.notes.take()
    }

    fn ask_window(&mut self) -> Option<()> {
        let mut instance = self.live()?;
        (self.counters.windows, self.counters.blocks) = (
            self.counters.windows + 1,
            self.counters.blocks + self.window.blocks().len() as u64,
        );
        let (sights, geometries) = self.window.sights();
        let asked = instance.blocks(self.window.records(), sights, geometries, &mut self.asks);
        self.counters.max_window_fuel = self.counters.max_window_fuel.max(instance.fuel_used);
        let line = self.window.blocks().first().map_or(0, |block| block.line);
        self.settle(instance, asked, "on_blocks", line)
    }

    fn ask_period(&mut self, period: &Period) -> Option<f64> {
        let mut instance = self.live()?;
        self.counters.periods += 1;
        let version = self.script.version;
        let record = period.bytes(self.ratio, version);
        let asked = instance.period(&record[..of_version(version)]);
        self.counters.max_period_fuel = self.counters.max_period_fuel.max(instance.fuel_used);
        self.settle(instance, asked, "on_period", period.line)
    }

    /// The instance, made anew where the last one went wrong; none in quarantine.
    fn live(&mut self) -> Option<Instance> {
        while self.instance.is_none() && !self.is_quarantined() {
            match Instance::new(&self.script, &self.budget, &self.values) {
                Ok(mut instance) => {
                    instance.place(&self.places);
                    self.instance = Some(instance);
                }
                Err(refusal) => self.strike(&Trouble::Trap(refusal.to_string()), "start", 0),
            }
        }
        self.instance.take()
    }

    /// Keeps the instance where the call went well, else drops it.
    fn settle<T>(
        &mut self,
        instance: Instance,
        answer: Result<T, Trouble>,
        call: &str,
        line: u32,
    ) -> Option<T> {
        match answer {
            Ok(answer) => {
                self.instance = Some(instance);
                Some(answer)
            }
            Err(trouble) => {
                self.strike(&trouble, call, line);
                None
            }
        }
    }

    fn strike(&mut self, trouble: &Trouble, call: &str, line: u32) {
        self.counters.count(trouble);
        self.strikes += 1;
        let then = if self.is_quarantined() {
            "in quarantine until the file changes or reload-policy is given; the default policy goes on"
        } else {
            "the default policy takes over, the script is made anew"
        };
        let strikes = self.strikes;
        self.notes.always(format!(
            "policy: line {line}: {call}: {trouble}; strike {strikes} of {MAX_STRIKES}, {then}"
        ));
    }
}

/// What `script`, started as `instance`, looks at.
fn looks(script: &Script, instance: &Instance) -> Looks {
    let sight = script.version > 1;
    Looks {
        sight,
        geometry: sight && instance.sees_geometry(),
    }
}

fn count(counters: &mut Counters, tuning: &Tuning, limited: [bool; 3]) {
    counters.time_constants += u64::from(tuning.time_constant_s.is_some());
    counters.tolerances += u64::from(tuning.path_tolerance_mm.is_some());
    counters.feed_caps += u64::from(tuning.feed_cap_mm_per_s.is_some());
    counters.limited += limited.iter().filter(|limited| **limited).count() as u64;
}

/// Notes that a block makes: what it is given, or asked for in vain.
fn told(tuning: &Tuning, limited: [bool; 3]) -> u64 {
    let given = [
        tuning.time_constant_s.is_some(),
        tuning.path_tolerance_mm.is_some(),
        tuning.feed_cap_mm_per_s.is_some(),
    ];
    (0..3)
        .map(|index| u64::from(given[index] || limited[index]))
        .sum()
}

/// Notes each change of a block, in the units of the machine file.
fn note(notes: &mut Notes, block: &InForce, asks: &Asks, tuning: &Tuning, limited: [bool; 3]) {
    let feed_mm_per_s = block.programmed_feed_mm_per_s.min(block.feed_cap_mm_per_s);
    let rows = [
        (
            "time constant",
            "ms",
            1e3,
            block.time_constant_s,
            tuning.time_constant_s,
        ),
        (
            "path tolerance",
            "mm",
            1.0,
            block.path_tolerance_mm,
            tuning.path_tolerance_mm,
        ),
        (
            "feed",
            "mm/min",
            60.0,
            feed_mm_per_s,
            tuning.feed_cap_mm_per_s,
        ),
    ];
    for (index, (what, unit, scale, old, new)) in rows.into_iter().enumerate() {
        if new.is_none() && !limited[index] {
            continue;
        }
        let (line, scaled) = (block.line, |value: f64| {
            shown((value * scale).clamp(f64::MIN, f64::MAX))
        });
        let change = || match new {
            Some(new) => format!("{} -> {} {unit}", scaled(old), scaled(new)),
            None => format!("stays {} {unit}", scaled(old)),
        };
        let asked = || {
            if limited[index] {
                format!(", {} was asked for", scaled(asks[index]))
            } else {
                String::new()
            }
        };
        notes.note(|| format!("policy: line {line}: {what} {}{}", change(), asked()));
    }
}

/// A number of any size, short.
fn shown(value: f64) -> String {
    let plain = value == 0.0 || (1e-3..1e7).contains(&value.abs());
    if plain {
        format!("{}", (value * 1e4).round() / 1e4)
    } else {
        format!("{value:.3e}")
    }
}
