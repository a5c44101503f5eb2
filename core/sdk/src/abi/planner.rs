//! Planners across the border.

use std::any::Any;
use std::ffi::c_void;
use std::marker::PhantomData;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};

use super::Descriptor;
use super::entry::{self, DONE, FAILED, Handle, Instance, ask, foreign, function};
use super::layout::table;
use super::watch::{Method, beat, calling};
use crate::{
    Accepted, Advanced, AxisVector, Block, BlockReport, Edge, LimitedBy, Made, Planner, PlannerContext,
    PlannerDescription, PluginError, PluginKind, PluginOptions, RawSlice, Segment, SegmentSink, size_of_contract,
};

type Errors = *mut PluginError;

table! {
    /// The functions of a planner. Each that answers writes its answer, or an error.
    pub struct Table {
        size: u32,
        open: unsafe extern "C" fn(RawSlice<u8>, RawSlice<u8>, *const PlannerContext, *mut *mut c_void, Errors) -> u32,
        close: unsafe extern "C" fn(*mut c_void),
        describe: unsafe extern "C" fn(*const c_void, *mut PlannerDescription, Errors) -> u32,
        check: unsafe extern "C" fn(*const c_void, *const Block, *mut (), Errors) -> u32,
        accept: unsafe extern "C" fn(*mut c_void, *const Block, *mut u32, Errors) -> u32,
        finish: unsafe extern "C" fn(*mut c_void, *mut (), Errors) -> u32,
        advance: unsafe extern "C" fn(*mut c_void, f64, *const Sink, *mut Advanced, Errors) -> u32,
        reset: unsafe extern "C" fn(*mut c_void, *const AxisVector, *mut (), Errors) -> u32,
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

/// The plugin `name` of the planner that `open` makes from its options.
pub const fn planner<T, O, F>(name: &'static str, version: &'static str, _open: F) -> Descriptor
where
    T: Planner + 'static,
    O: PluginOptions + 'static,
    F: Fn(&O, &PlannerContext) -> Result<T, PluginError> + Copy + 'static,
{
    Descriptor::new(PluginKind::Planner, (name, version), entry::describe::<O>, &Side::<T, O, F>::TABLE)
}

/// The plugin's side.
struct Side<T, O, F>(PhantomData<(T, O, F)>);

impl<T, O, F> Side<T, O, F>
where
    T: Planner + 'static,
    O: PluginOptions + 'static,
    F: Fn(&O, &PlannerContext) -> Result<T, PluginError> + Copy + 'static,
{
    const TABLE: Table = Table {
        size: size_of_contract::<Table>(),
        open: Self::open,
        close: entry::close::<T>,
        describe: describe::<T>,
        check: check::<T>,
        accept: accept::<T>,
        finish: finish::<T>,
        advance: advance::<T>,
        reset: reset::<T>,
    };

    unsafe extern "C" fn open(
        name: RawSlice<u8>,
        options: RawSlice<u8>,
        context: *const PlannerContext,
        handle: *mut *mut c_void,
        error: Errors,
    ) -> u32 {
        // SAFETY: the host gives what lives for the call.
        unsafe { entry::open([name, options], handle, error, |options: &O| function::<F>()(options, &*context)) }
    }
}

// SAFETY of all of these: the host passes the handle that `open` gave, places that can be written to, and references that
// live for the call; it calls a planner from one thread at a time.

unsafe extern "C" fn describe<T: Planner>(this: *const c_void, answer: *mut PlannerDescription, error: Errors) -> u32 {
    let this = unsafe { &*this.cast::<Instance<T>>() };
    unsafe { this.fault.guard("describe", answer, error, || Ok(this.plugin.describe())) }
}

unsafe extern "C" fn check<T: Planner>(
    this: *const c_void,
    block: *const Block,
    answer: *mut (),
    error: Errors,
) -> u32 {
    let this = unsafe { &*this.cast::<Instance<T>>() };
    unsafe { this.fault.guard("check", answer, error, || this.plugin.check(&*block)) }
}

unsafe extern "C" fn accept<T: Planner>(
    this: *mut c_void,
    block: *const Block,
    answer: *mut u32,
    error: Errors,
) -> u32 {
    let Instance { plugin, fault } = unsafe { &mut *this.cast::<Instance<T>>() };
    unsafe { fault.guard("accept", answer, error, || plugin.accept(&*block).map(|accepted| accepted as u32)) }
}

unsafe extern "C" fn finish<T: Planner>(this: *mut c_void, answer: *mut (), error: Errors) -> u32 {
    let Instance { plugin, fault } = unsafe { &mut *this.cast::<Instance<T>>() };
    let work = || {
        plugin.finish();
        Ok(())
    };
    unsafe { fault.guard("finish", answer, error, work) }
}

unsafe extern "C" fn advance<T: Planner>(
    this: *mut c_void,
    duration_s: f64,
    sink: *const Sink,
    answer: *mut Advanced,
    error: Errors,
) -> u32 {
    let Instance { plugin, fault } = unsafe { &mut *this.cast::<Instance<T>>() };
    unsafe { fault.guard("advance", answer, error, || plugin.advance(duration_s, &mut Outlet(&*sink))) }
}

unsafe extern "C" fn reset<T: Planner>(
    this: *mut c_void,
    position: *const AxisVector,
    answer: *mut (),
    error: Errors,
) -> u32 {
    let Instance { plugin, fault } = unsafe { &mut *this.cast::<Instance<T>>() };
    let work = || {
        plugin.reset(unsafe { &*position });
        Ok(())
    };
    unsafe { fault.guard("reset", answer, error, work) }
}

/// The sink as the planner sees it.
struct Outlet<'a>(&'a Sink);

impl SegmentSink for Outlet<'_> {
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
const MOST_EMITTED: u32 = 100_000;

/// The host's sink behind a [`Sink`]. Its panics must not cross the plugin.
struct Inlet<'a> {
    sink: &'a mut dyn SegmentSink,
    emitted: u32,
    panic: Option<Box<dyn Any + Send>>,
    /// A number among what was emitted that stands for nothing.
    foreign: Option<PluginError>,
}

impl Inlet<'_> {
    fn take(&mut self, put: impl FnOnce(&mut dyn SegmentSink)) -> u32 {
        self.emitted += 1;
        beat();
        if self.emitted > MOST_EMITTED || self.panic.is_some() || self.foreign.is_some() {
            return FAILED;
        }
        let taken = calling(Method::None, || catch_unwind(AssertUnwindSafe(|| put(self.sink))));
        self.panic = taken.err();
        if self.panic.is_none() { DONE } else { FAILED }
    }

    /// Whether `number`, which the planner has put into `field`, is one of `known` choices from 0 on.
    fn knows(&mut self, number: u32, known: u32, field: &str) -> bool {
        if number >= known {
            let words = format!("0 to {}", known - 1);
            self.foreign.get_or_insert_with(|| foreign(Method::PlannerAdvance, field, number, &words));
        }
        number < known
    }
}

unsafe extern "C" fn take_segment(context: *mut c_void, segment: *const Segment) -> u32 {
    // SAFETY: the context is the inlet of the call that is going on; the segment lives for this call. The edge is read as the
    // number that it is in memory: a reference to the segment is made only where that number is an edge.
    unsafe {
        let inlet = &mut *context.cast::<Inlet<'_>>();
        let edge = (&raw const (*segment).stop_on.edge).cast::<u32>().read();
        if !inlet.knows(edge, Edge::COUNT, "the edge of a segment") {
            return FAILED;
        }
        inlet.take(|sink| sink.segment(&*segment))
    }
}

unsafe extern "C" fn take_block(context: *mut c_void, report: *const BlockReport) -> u32 {
    // SAFETY: as above, with what limits the block.
    unsafe {
        let inlet = &mut *context.cast::<Inlet<'_>>();
        let limited_by = (&raw const (*report).limited_by).cast::<u32>().read();
        if !inlet.knows(limited_by, LimitedBy::COUNT, "limited_by of a block") {
            return FAILED;
        }
        inlet.take(|sink| sink.block(&*report))
    }
}

/// The host's side: a planner behind its table.
struct Linked {
    table: &'static Table,
    handle: Handle,
}

/// Opens a planner behind its table.
pub fn open(table: &'static Table, name: &'static str, options: &str, context: &PlannerContext) -> Made<dyn Planner> {
    let (name, options) = (RawSlice::new(name.as_bytes()), RawSlice::new(options.as_bytes()));
    // SAFETY: everything lives for the call.
    let handle = Handle::open([Method::PlannerNew, Method::PlannerDrop], table.close, |handle, error| unsafe {
        (table.open)(name, options, context, handle, error)
    })?;
    Ok(Box::new(Linked { table, handle }))
}

// SAFETY of the calls: the handle is open, `ask` gives places to write to, references live for the call.
impl Planner for Linked {
    fn describe(&self) -> PlannerDescription {
        let asked = ask(Method::PlannerDescribe, |answer, error| unsafe {
            (self.table.describe)(self.handle.instance, answer, error)
        });
        // It has panicked, and says so with the first block.
        asked.unwrap_or_else(|_| PlannerDescription::order_2())
    }

    fn check(&self, block: &Block) -> Result<(), PluginError> {
        ask(Method::PlannerCheck, |answer, error| unsafe {
            (self.table.check)(self.handle.instance, block, answer, error)
        })
    }

    fn accept(&mut self, block: &Block) -> Result<Accepted, PluginError> {
        let answer = ask(Method::PlannerAccept, |answer, error| unsafe {
            (self.table.accept)(self.handle.instance, block, answer, error)
        })?;
        beat();
        Accepted::of_number(answer).ok_or_else(|| foreign(Method::PlannerAccept, "its answer", answer, "0 and 1"))
    }

    fn finish(&mut self) {
        // It has panicked, and says so when it is to advance.
        let _ = ask(Method::PlannerFinish, |answer, error| unsafe {
            (self.table.finish)(self.handle.instance, answer, error)
        });
    }

    fn advance(&mut self, duration_s: f64, sink: &mut dyn SegmentSink) -> Result<Advanced, PluginError> {
        let mut inlet = Inlet { sink, emitted: 0, panic: None, foreign: None };
        let context = (&raw mut inlet).cast();
        let sink = Sink { context, segment: take_segment, block: take_block };
        let advanced = ask(Method::PlannerAdvance, |answer, error| unsafe {
            (self.table.advance)(self.handle.instance, duration_s, &raw const sink, answer, error)
        });
        match (inlet.panic, inlet.foreign) {
            (Some(panic), _) => resume_unwind(panic),
            (None, Some(foreign)) => Err(foreign),
            (None, None) => advanced,
        }
    }

    fn reset(&mut self, position: &AxisVector) {
        // It has panicked, and says so with the next block.
        let _ = ask(Method::PlannerReset, |answer, error| unsafe {
            (self.table.reset)(self.handle.instance, position, answer, error)
        });
    }
}

#[cfg(test)]
#[path = "planner_tests.rs"]
mod tests;
