//! Policies: blocks are tuned in windows of a fixed number before the planner sees them, beside what the program states.

use std::collections::VecDeque;

use tandem_gcode::Item;
use tandem_rings::{Rest, RestCause};
use tandem_sdk::{Block, Curve, NurbsData};

use crate::source::Source;

/// Blocks of a full window.
pub const WINDOW_BLOCKS: usize = 64;

/// What decides on blocks, a window at a time. Called on the rough loop; may allocate.
pub trait BlockPolicy: Send {
    /// The program states `value` for number `which` of what is watched for ([`Item::Stated`]): it holds for the blocks offered
    /// from here on.
    fn state(&mut self, _which: usize, _value: f64) {}

    /// The next block of a window, and its curve.
    fn offer(&mut self, block: &Block, curve: Option<Curve<'_>>);

    /// The window is complete: it is full, or the stretch ends with it. `next` follows it in the same stretch.
    fn decide(&mut self, next: Option<(&Block, Option<Curve<'_>>)>);

    /// Block `index` of the window as it is to be driven, where it is not to be driven as it is: only time constant, path
    /// tolerance and feed cap may differ.
    fn tuned(&mut self, index: usize, block: &Block, curve: Option<Curve<'_>>) -> Option<Block>;
}

/// A source whose blocks a policy has tuned.
///
/// A window is full, or ends where the stretch does: at a wait, behind a block that an input ends, where the source gives
/// nothing for now, and at the end. So what a policy sees does not depend on when the rough loop asks.
pub struct Tuned<S, P> {
    source: S,
    policy: P,
    /// Items of windows to come; the first are those of the next.
    items: VecDeque<Item>,
    /// Blocks among them.
    blocks: usize,
    /// Scratch.
    fetched: Vec<Item>,
    /// Nothing is known of what follows the items until the machine has answered.
    stretch_ends: bool,
    /// The program is over.
    over: bool,
    /// Met behind the items.
    error: Option<String>,
}

impl<S: Source, P: BlockPolicy> Tuned<S, P> {
    /// `source` tuned by `policy`.
    pub fn new(source: S, policy: P) -> Self {
        Self {
            source,
            policy,
            items: VecDeque::new(),
            blocks: 0,
            fetched: vec![],
            stretch_ends: false,
            over: false,
            error: None,
        }
    }

    /// Fetches items until a window and the block behind it are there; whether the stretch ends with them.
    fn fetch(&mut self) -> bool {
        loop {
            if self.over || self.stretch_ends || self.error.is_some() {
                return true;
            }
            // What waits for the machine to have driven what is there ends the window.
            if !self.items.is_empty() && !self.source.may_go_on(false) {
                return true;
            }
            match self.source.next_items(&mut self.fetched) {
                Ok(more) => self.over = !more,
                Err(error) => self.error = Some(error),
            }
            if self.fetched.is_empty() {
                return true;
            }
            self.stretch_ends = self.fetched.iter().any(ends_stretch);
            self.blocks += self.fetched.iter().filter(|item| is_block(item)).count();
            self.items.extend(self.fetched.drain(..));
            if self.blocks > WINDOW_BLOCKS {
                return false;
            }
        }
    }

    /// Asks the policy about the first `count` blocks.
    fn tune(&mut self, count: usize) {
        let Self { policy, items, .. } = self;
        let (mut offered, mut rest) = (0, items.iter());
        for item in rest.by_ref() {
            match item {
                Item::Stated { which, value } => policy.state(*which, *value),
                Item::Block(..) => {
                    let (block, curve) = block_of(item);
                    policy.offer(block, curve);
                    offered += 1;
                }
                _ => {}
            }
            if offered == count {
                break;
            }
        }
        policy.decide(rest.find(|item| is_block(item)).map(block_of));
        let blocks = items.iter_mut().filter(|item| is_block(item)).take(count);
        for (index, item) in blocks.enumerate() {
            let (block, curve) = block_of(item);
            let Some(tuned) = policy.tuned(index, block, curve) else {
                continue;
            };
            let Item::Block(facts, _) = item else {
                continue;
            };
            facts.time_constant_s = tuned.time_constant_s;
            facts.path_tolerance_mm = tuned.path_tolerance_mm;
            facts.feed_cap_mm_per_s = tuned.feed_cap_mm_per_s;
        }
    }

    /// Hands over everything up to the last block of a window of `count`; at the end of a stretch everything.
    fn hand_over(&mut self, count: usize, ends: bool, items: &mut Vec<Item>) {
        let mut left = count;
        while let Some(item) = self.items.pop_front() {
            match item {
                // What stands behind the last block holds for the next window.
                Item::Stated { which, value } if left == 0 => self.policy.state(which, value),
                Item::Stated { .. } => {}
                item => {
                    left -= usize::from(is_block(&item));
                    items.push(item);
                }
            }
            if left == 0 && !ends {
                break;
            }
        }
        self.blocks -= count;
        self.stretch_ends &= !self.items.is_empty();
    }
}

impl<S: Source, P: BlockPolicy> Source for Tuned<S, P> {
    fn next_items(&mut self, items: &mut Vec<Item>) -> Result<bool, String> {
        let whole = self.fetch();
        // More than a window may have come at once: then the stretch goes on behind this one.
        let ends = whole && self.blocks <= WINDOW_BLOCKS;
        let count = self.blocks.min(WINDOW_BLOCKS);
        if count > 0 {
            self.tune(count);
        }
        if self.items.is_empty()
            && let Some(error) = self.error.take()
        {
            return Err(error);
        }
        self.hand_over(count, ends, items);
        Ok(!(self.over && self.items.is_empty()))
    }

    fn may_go_on(&mut self, driven: bool) -> bool {
        !self.items.is_empty() || self.source.may_go_on(driven)
    }

    fn streams(&self) -> bool {
        self.source.streams()
    }

    fn period(&mut self) {
        self.source.period();
    }

    fn is_waiting(&self) -> bool {
        self.source.is_waiting()
    }

    fn provide_input(&mut self, value: f64) {
        self.source.provide_input(value);
    }

    fn provide_rest(&mut self, rest: &Rest) -> bool {
        if rest.cause == RestCause::Abort {
            self.items.clear();
            (self.blocks, self.stretch_ends) = (0, false);
        }
        self.over = !self.source.provide_rest(rest);
        !self.over
    }
}

fn is_block(item: &Item) -> bool {
    matches!(item, Item::Block(..))
}

/// Whether nothing is known of what follows until the machine has answered.
fn ends_stretch(item: &Item) -> bool {
    matches!(item, Item::Wait(_) | Item::Command(_) | Item::End) || item.is_probe()
}

fn block_of(item: &Item) -> (&Block, Option<Curve<'_>>) {
    match item {
        Item::Block(block, curve) => (block, curve.as_deref().map(NurbsData::curve)),
        _ => unreachable!("only blocks are asked about"),
    }
}

#[cfg(test)]
#[path = "policy_tests.rs"]
mod tests;
