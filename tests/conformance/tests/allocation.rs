//! The kit sees one use of the heap in a method of the fine loop, and one a period in a feed strategy.

#![allow(clippy::unnecessary_wraps)] // the form of constructors

use tandem_conformance::{CountingAllocator, Setup, judge};
use tandem_rig::Echo;
use tandem_sdk::{
    Answer, AxisVector, FeedStrategy, Kinematics, KinematicsContext, Plugin, PluginError,
    StrategyContext, Window, local_plugin,
};

#[global_allocator]
static COUNTING: CountingAllocator = CountingAllocator;

tandem_sdk::options! {
    struct Options {
        /// The call that uses the heap; none where it is 0.
        call: u64 = 0,
    }
}

/// Uses the heap once the number of calls has come.
struct Uses {
    call: u64,
    calls: std::sync::atomic::AtomicU64,
}

impl Uses {
    fn new(options: &Options) -> Self {
        Self {
            call: options.call,
            calls: 0.into(),
        }
    }

    fn now(&self) {
        if self
            .calls
            .fetch_add(1, std::sync::atomic::Ordering::Relaxed)
            + 1
            == self.call
        {
            drop(std::hint::black_box(vec![1_u8; 10]));
        }
    }
}

fn drives(options: &Options) -> Echo {
    let uses = Uses::new(options);
    Echo::new(move |_, _| {
        uses.now();
        Ok(())
    })
}

struct Feeds(Uses);

impl FeedStrategy for Feeds {
    fn update(&mut self, _window: &Window) -> Result<Answer, PluginError> {
        self.0.now();
        Ok(Answer::of_ratio(1.0))
    }
}

struct Same(Uses);

impl Kinematics for Same {
    fn to_joints(&self, axes: &AxisVector) -> AxisVector {
        self.0.now();
        *axes
    }
    fn to_axes(&self, joints: &AxisVector) -> AxisVector {
        *joints
    }
}

fn assert_found(plugin: Plugin, call: u64) {
    let judged = |call: u64| {
        judge(
            plugin,
            &Setup {
                options: format!("call = {call}\n"),
                ..Setup::default()
            },
        )
    };
    assert!(judged(0).conforms(), "{}", judged(0));
    let report = judged(call);
    assert!(
        report
            .findings()
            .iter()
            .any(|finding| finding.check == "allocation"),
        "{report}"
    );
}

#[test]
fn one_use_of_the_heap_is_found() {
    assert_found(
        local_plugin!(driver "drives" = |o: &Options| Ok(drives(o))),
        1500,
    );
    assert_found(
        local_plugin!(feed_strategy "feeds" = |o: &Options, _: &StrategyContext| Ok(Feeds(Uses::new(o)))),
        1500,
    );
    assert_found(
        local_plugin!(kinematics "same" = |o: &Options, _: &KinematicsContext| Ok(Same(Uses::new(o)))),
        50,
    );
}
