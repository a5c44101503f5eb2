//! Feed strategies across the border.

use super::contract::contract;
use super::entry::{self, foreign};
use super::layout::layout;
use super::watch::Method;
use crate::{
    Answer, FeedStrategy, MAX_SIGNALS, PluginError, PluginResult, Request, Slice, StrategyContext,
    Window, Words,
};

contract! {
    /// The functions of a feed strategy. Each writes its answer, or an error.
    feed_strategy: FeedStrategy, FeedStrategy(StrategyContext), StrategyNew, StrategyDrop;
    ref signals(plugin) -> Signals = StrategySignals { Signals::new(plugin.signals()) }
    ref max_ratio_change_per_s(plugin) -> f64 = StrategyMaxRatioChange { Ok(plugin.max_ratio_change_per_s()) }
    ref takes_override(plugin) -> u32 = StrategyTakesOverride { Ok(u32::from(plugin.takes_override())) }
    ref explain(plugin) -> Words = StrategyExplain { Ok(plugin.explain()) }
    mut update(plugin, window: *const Window<'_>) -> Reply = StrategyUpdate {
        plugin.update(&*window).map(|answer| Reply::new(&answer))
    }
}

/// The names of a strategy's signals. They live as long as its library, which is never unloaded.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct Signals {
    count: u32,
    names: [Slice<'static, u8>; MAX_SIGNALS],
}

layout!(Signals { count, names });

impl Signals {
    fn new(names: &'static [&'static str]) -> Result<Self, PluginError> {
        if names.len() > MAX_SIGNALS {
            return Err(PluginError::new(format!(
                "it names {} signals; {MAX_SIGNALS} are possible",
                names.len()
            )));
        }
        let name = |i: usize| {
            names
                .get(i)
                .map_or(Slice::default(), |name| Slice::new(name.as_bytes()))
        };
        Ok(Self {
            count: names.len() as u32,
            names: std::array::from_fn(name),
        })
    }
}

/// An [`Answer`] on its way: what is asked for is a number until it has been looked at.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct Reply {
    ratio: f64,
    /// 0 for nothing, 1 for a hold, 2 for a fault.
    request: u32,
    /// Code of the fault.
    code: u32,
    signals: [f64; MAX_SIGNALS],
}

layout!(Reply {
    ratio,
    request,
    code,
    signals
});

impl Reply {
    fn new(answer: &Answer) -> Self {
        let (request, code) = match answer.request {
            Request::None => (0, 0),
            Request::Hold => (1, 0),
            Request::Fault(code) => (2, code),
        };
        Self {
            ratio: answer.ratio,
            request,
            code,
            signals: answer.signals,
        }
    }

    fn read(&self) -> Result<Answer, PluginError> {
        let request = match self.request {
            0 => Request::None,
            1 => Request::Hold,
            2 => Request::Fault(self.code),
            other => {
                return Err(foreign(
                    Method::StrategyUpdate,
                    "the request",
                    other,
                    "0, 1 and 2",
                ));
            }
        };
        Ok(Answer {
            ratio: self.ratio,
            request,
            signals: self.signals,
        })
    }
}

/// The host's side: a strategy behind its table, and what it says of itself.
struct Linked {
    calls: Calls,
    max_ratio_change_per_s: f64,
    takes_override: bool,
    signals: &'static [&'static str],
}

/// Opens a strategy behind its table.
pub fn open(
    table: &'static Table,
    name: &'static str,
    options: &str,
    context: &StrategyContext,
) -> PluginResult<dyn FeedStrategy> {
    let calls = Calls::make(table, name, options, context)?;
    let named = calls.signals()?;
    let max_ratio_change_per_s = calls.max_ratio_change_per_s()?;
    let takes_override = calls.takes_override()? != 0;
    let names = &named.names[..(named.count as usize).min(MAX_SIGNALS)];
    // The contract hands names out for good, and few strategies are opened: their list is never freed.
    let signals = names
        .iter()
        .map(|name| entry::text(*name))
        .collect::<Vec<_>>()
        .leak();
    Ok(Box::new(Linked {
        calls,
        max_ratio_change_per_s,
        takes_override,
        signals,
    }))
}

impl FeedStrategy for Linked {
    fn signals(&self) -> &'static [&'static str] {
        self.signals
    }

    fn max_ratio_change_per_s(&self) -> f64 {
        self.max_ratio_change_per_s
    }

    fn takes_override(&self) -> bool {
        self.takes_override
    }

    fn explain(&self) -> Words {
        self.calls.explain().unwrap_or_default()
    }

    fn update(&mut self, window: &Window) -> Result<Answer, PluginError> {
        self.calls.update(window)?.read()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_request_that_is_no_choice_is_an_error_with_its_number() {
        for request in [Request::None, Request::Hold, Request::Fault(7)] {
            let answer = Answer {
                request,
                ..Answer::of_ratio(0.5)
            };
            assert_eq!(Reply::new(&answer).read(), Ok(answer));
        }
        let foreign = Reply {
            request: 250,
            ..Reply::new(&Answer::of_ratio(0.5))
        };
        let error = foreign.read().unwrap_err();
        assert_eq!(
            error.message(),
            "its update gives 250 as the request: 0, 1 and 2 are known"
        );
    }
}
