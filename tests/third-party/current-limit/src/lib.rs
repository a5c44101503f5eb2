//! Feed strategy: lowers the feed where a motor draws more current than it should.

use tandem_sdk::{Answer, FeedStrategy, PluginError, StrategyContext, Window};

tandem_sdk::options! {
    pub struct Options {
        /// Mean motor current above which the feed is lowered, A.
        pub max_current_a: f64 = 8.0,
        /// How fast the feed ratio changes at most, 1/s.
        pub ratio_change_per_s: f64 = 2.0,
    }
}

pub struct CurrentLimit(Options, StrategyContext, f64);

tandem_sdk::plugin!(feed_strategy "current-limit" = |options: &Options, context: &StrategyContext| {
    Ok(CurrentLimit(options.clone(), *context, 1.0))
});

impl FeedStrategy for CurrentLimit {
    fn signals(&self) -> &'static [&'static str] {
        &["current_a"]
    }

    fn max_ratio_change_per_s(&self) -> f64 {
        self.0.ratio_change_per_s
    }

    fn update(&mut self, window: &Window) -> Result<Answer, PluginError> {
        let currents = window.samples().iter().flat_map(|sample| sample.current_a.0);
        let current_a = currents.fold(0.0, |most: f64, current_a| most.max(current_a.abs()));
        let step = self.0.ratio_change_per_s * self.1.rough_period_s;
        let wanted = (self.0.max_current_a / current_a).clamp(0.1, 1.0);
        self.2 += (wanted - self.2).clamp(-step, step);
        Ok(Answer::of_ratio(self.2).with_signals(&[current_a]))
    }
}
