//! Planners across the border.

use std::any::Any;
use std::ffi::c_void;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::ptr;

use super::contract::contract;
use super::entry::{DONE, FAILED, choice};
use super::layout::{Choice, table};
use super::watch::{Method, beat, calling};
use crate::{
    Accepted, Advanced, AxisVector, Block, BlockReport, Curve, Edge, LimitedBy, Planner,
    PlannerContext, PlannerDescription, PluginError, PluginResult, Segment, SegmentSink,
};

contract! {
    /// The functions of a planner. Each writes its answer, or an error. A curve is a null pointer where there is none.
    planner: Planner, Planner(PlannerContext), PlannerNew, PlannerDrop;
    ref describe(plugin) -> PlannerDescription = PlannerDescribe { Ok(plugin.describe()) }
    ref check(plugin, block: *const Block, curve: *const Curve<'_>) -> () = PlannerCheck {
        plugin.check(&*block, curve.as_ref().copied())
    }
    mut accept(plugin, block: *const Block, curve: *const Curve<'_>) -> u32 = PlannerAccept {
        plugin.accept(&*block, curve.as_ref().copied()).map(|accepted| accepted as u32)
    }
    mut finish(plugin) -> () = PlannerFinish {
        plugin.finish();
        Ok(())
    }
    mut advance(plugin, duration_s: f64, sink: *const Sink) -> Advanced = PlannerAdvance {
        plugin.advance(duration_s, &mut PluginSink(&*sink))
    }
    mut reset(plugin, position: *const AxisVector) -> () = PlannerReset {
        plugin.reset(&*position);
        Ok(())
    }
}

table! {
    /// Where a planner's output goes. Both answer [`FAILED`] where the host takes no more.
    pub struct Sink {
        context: *mut c_void,
        segment: unsafe extern "C" fn(*mut c_void, *const Segment) -> u32,
        block: unsafe extern "C" fn(*mut c_void, *const BlockReport) -> u32,
    }
}

/// The sink as the planner sees it.
struct PluginSink<'a>(&'a Sink);

impl SegmentSink for PluginSink<'_> {
    fn segment(&mut self, segment: &Segment) {
        // SAFETY: the host's function with the host's context, during the call of `advance`.
        until_refused(unsafe { (self.0.segment)(self.0.context, segment) });
    }

    fn block(&mut self, report: &BlockReport) {
        // SAFETY: as above.
        until_refused(unsafe { (self.0.block)(self.0.context, report) });
    }
}

/// A planner that never stops emitting can be stopped only from within.
fn until_refused(status: u32) {
    assert!(status == DONE, "it emits without end");
}

/// Most calls of the sink in one `advance`: hundreds of times what the densest program needs.
const MAX_EMITTED: u32 = 100_000;

/// The host's sink behind a [`Sink`]. Its panics must not cross the plugin.
struct HostSink<'a> {
    sink: &'a mut dyn SegmentSink,
    emitted: u32,
    panic: Option<Box<dyn Any + Send>>,
    /// A number among what was emitted that stands for nothing.
    foreign: Option<PluginError>,
}

impl HostSink<'_> {
    fn take(&mut self, put: impl FnOnce(&mut dyn SegmentSink)) -> u32 {
        self.emitted += 1;
        beat();
        if self.emitted > MAX_EMITTED || self.panic.is_some() || self.foreign.is_some() {
            return FAILED;
        }
        let taken = calling(Method::None, || {
            catch_unwind(AssertUnwindSafe(|| put(self.sink)))
        });
        self.panic = taken.err();
        if self.panic.is_none() { DONE } else { FAILED }
    }

    /// Whether `number`, which the planner has put into `field`, is a choice.
    fn knows<C: Choice>(&mut self, number: u32, field: &str) -> bool {
        match choice::<C>(Method::PlannerAdvance, field, number) {
            Ok(_) => true,
            Err(error) => {
                self.foreign.get_or_insert(error);
                false
            }
        }
    }
}

unsafe extern "C" fn take_segment(context: *mut c_void, segment: *const Segment) -> u32 {
    // SAFETY: the context is the sink of the call that is going on; the segment lives for this call. The edge is read as the
    // number that it is in memory: a reference to the segment is made only where that number is an edge.
    unsafe {
        let sink_of_host = &mut *context.cast::<HostSink<'_>>();
        let edge = (&raw const (*segment).stop_on.edge).cast::<u32>().read();
        if !sink_of_host.knows::<Edge>(edge, "the edge of a segment") {
            return FAILED;
        }
        sink_of_host.take(|sink| sink.segment(&*segment))
    }
}

unsafe extern "C" fn take_block(context: *mut c_void, report: *const BlockReport) -> u32 {
    // SAFETY: as above, with what limits the block.
    unsafe {
        let sink_of_host = &mut *context.cast::<HostSink<'_>>();
        let limited_by = (&raw const (*report).limited_by).cast::<u32>().read();
        if !sink_of_host.knows::<LimitedBy>(limited_by, "limited_by of a block") {
            return FAILED;
        }
        sink_of_host.take(|sink| sink.block(&*report))
    }
}

/// The host's side: a planner behind its table.
struct Linked(Calls);

/// Opens a planner behind its table.
pub fn open(
    table: &'static Table,
    name: &'static str,
    options: &str,
    context: &PlannerContext,
) -> PluginResult<dyn Planner> {
    Ok(Box::new(Linked(Calls::make(
        table, name, options, context,
    )?)))
}

/// A curve as it crosses: a null pointer where there is none.
fn crossing<'a>(curve: Option<&Curve<'a>>) -> *const Curve<'a> {
    curve.map_or(ptr::null(), ptr::from_ref)
}

impl Planner for Linked {
    fn describe(&self) -> PlannerDescription {
        // One that has panicked says so with the first block.
        self.0
            .describe()
            .unwrap_or_else(|_| PlannerDescription::order_2())
    }

    fn check(&self, block: &Block, curve: Option<Curve<'_>>) -> Result<(), PluginError> {
        self.0.check(block, crossing(curve.as_ref()))
    }

    fn accept(&mut self, block: &Block, curve: Option<Curve<'_>>) -> Result<Accepted, PluginError> {
        let answer = self.0.accept(block, crossing(curve.as_ref()))?;
        beat();
        choice(Method::PlannerAccept, "its answer", answer)
    }

    fn finish(&mut self) {
        // One that has panicked says so when it is to advance.
        let _ = self.0.finish();
    }

    fn advance(
        &mut self,
        duration_s: f64,
        sink: &mut dyn SegmentSink,
    ) -> Result<Advanced, PluginError> {
        let mut host = HostSink {
            sink,
            emitted: 0,
            panic: None,
            foreign: None,
        };
        let context = (&raw mut host).cast();
        let sink = Sink {
            context,
            segment: take_segment,
            block: take_block,
        };
        let advanced = self.0.advance(duration_s, &raw const sink);
        match (host.panic, host.foreign) {
            (Some(panic), _) => resume_unwind(panic),
            (None, Some(foreign)) => Err(foreign),
            (None, None) => advanced,
        }
    }

    fn reset(&mut self, position: &AxisVector) {
        // One that has panicked says so with the next block.
        let _ = self.0.reset(position);
    }
}

#[cfg(test)]
#[path = "planner_tests.rs"]
mod tests;
