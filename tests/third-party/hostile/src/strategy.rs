//! A feed strategy.

use tandem_sdk::{Answer, FeedStrategy, PluginError, Request, StrategyContext, Window};

use crate::mischief::{Mischief, Options};

pub struct Hostile(Mischief);

impl Hostile {
    pub fn open(options: &Options, _context: &StrategyContext) -> Result<Self, PluginError> {
        Mischief::new(options).map(Self)
    }
}

impl Drop for Hostile {
    fn drop(&mut self) {
        self.0.quietly("drop");
    }
}

impl FeedStrategy for Hostile {
    fn signals(&self) -> &'static [&'static str] {
        self.0.quietly("signals");
        &["mood"]
    }

    fn max_ratio_change_per_s(&self) -> f64 {
        self.0.quietly("max_ratio_change_per_s");
        f64::INFINITY
    }

    fn takes_override(&self) -> bool {
        self.0.quietly("takes_override");
        false
    }

    fn update(&mut self, _window: &Window) -> Result<Answer, PluginError> {
        let what = self.0.of("update")?;
        Ok(Answer { ratio: Mischief::number(what, 0.9), request: Request::None, signals: [0.5; 8] })
    }
}
