//! The soft loop: part-program items in, segments queued for the fine loop. One call of [`RoughLoop::step`] is one rough
//! period; it may allocate and be late, but what it queues can always be brought to rest on the path.

mod depth;
#[cfg(test)]
mod doubles;
mod easing;
mod gather;
mod junction_steps;
mod policy;
mod queue;
mod rest;
mod rough;
mod source;
mod staged;
mod window;

pub use depth::QueueDepth;
pub use easing::{Easing, easing_s};
pub use gather::Slowness;
pub use policy::{BlockPolicy, Tuned, WINDOW_BLOCKS};
pub use rough::{Progress, RoughConfig, RoughError, RoughLoop};
pub use source::Source;

use tandem_rings::Rest;
use tandem_sdk::{Block, BlockReport, Curve, Event};

/// Is told of blocks as they are planned for good; in order, each once.
pub trait Observer {
    /// `block` is driven as `report` says, along `curve` where it is a NURBS.
    fn block(&mut self, block: &Block, curve: Option<Curve<'_>>, report: &BlockReport);

    /// A non-motion word is planned.
    fn event(&mut self, _event: &Event) {}

    /// The machine came to a rest that ends an epoch: what was planned behind it is not driven.
    fn rest(&mut self, _rest: &Rest) {}
}

impl Observer for () {
    fn block(&mut self, _block: &Block, _curve: Option<Curve<'_>>, _report: &BlockReport) {}
}
