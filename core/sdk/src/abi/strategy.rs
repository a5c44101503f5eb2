//! Feed strategies across the border.

use std::ffi::c_void;
use std::marker::PhantomData;

use super::Descriptor;
use super::entry::{self, Handle, Instance, ask, foreign, function};
use super::layout::{layout, table};
use super::watch::Method;
use crate::{
    Answer, FeedStrategy, MAX_SIGNALS, Made, PluginError, PluginKind, PluginOptions, RawSlice, Request,
    StrategyContext, Window, size_of_contract,
};

type Errors = *mut PluginError;

/// What a strategy says of itself.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct Description {
    max_ratio_change_per_s: f64,
    signal_count: u32,
    signals: [RawSlice<u8>; MAX_SIGNALS],
}

layout!(Description { max_ratio_change_per_s, signal_count, signals });

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

layout!(Reply { ratio, request, code, signals });

impl Reply {
    fn new(answer: &Answer) -> Self {
        let (request, code) = match answer.request {
            Request::None => (0, 0),
            Request::Hold => (1, 0),
            Request::Fault(code) => (2, code),
        };
        Self { ratio: answer.ratio, request, code, signals: answer.signals }
    }

    fn read(&self) -> Result<Answer, PluginError> {
        let request = match self.request {
            0 => Request::None,
            1 => Request::Hold,
            2 => Request::Fault(self.code),
            other => return Err(foreign(Method::StrategyUpdate, "the request", other, "0, 1 and 2")),
        };
        Ok(Answer { ratio: self.ratio, request, signals: self.signals })
    }
}

table! {
    /// The functions of a feed strategy. Each that answers writes its answer, or an error.
    pub struct Table {
        size: u32,
        open: unsafe extern "C" fn(RawSlice<u8>, RawSlice<u8>, *const StrategyContext, *mut *mut c_void, Errors) -> u32,
        close: unsafe extern "C" fn(*mut c_void),
        describe: unsafe extern "C" fn(*const c_void, *mut Description, Errors) -> u32,
        update: unsafe extern "C" fn(*mut c_void, *const Window<'_>, *mut Reply, Errors) -> u32,
    }
}

/// The plugin `name` of the strategy that `open` makes from its options.
pub const fn feed_strategy<T, O, F>(name: &'static str, version: &'static str, _open: F) -> Descriptor
where
    T: FeedStrategy + 'static,
    O: PluginOptions + 'static,
    F: Fn(&O, &StrategyContext) -> Result<T, PluginError> + Copy + 'static,
{
    Descriptor::new(PluginKind::FeedStrategy, (name, version), entry::describe::<O>, &Side::<T, O, F>::TABLE)
}

/// The plugin's side.
struct Side<T, O, F>(PhantomData<(T, O, F)>);

impl<T, O, F> Side<T, O, F>
where
    T: FeedStrategy + 'static,
    O: PluginOptions + 'static,
    F: Fn(&O, &StrategyContext) -> Result<T, PluginError> + Copy + 'static,
{
    const TABLE: Table = Table {
        size: size_of_contract::<Table>(),
        open: Self::open,
        close: entry::close::<T>,
        describe: describe::<T>,
        update: update::<T>,
    };

    unsafe extern "C" fn open(
        name: RawSlice<u8>,
        options: RawSlice<u8>,
        context: *const StrategyContext,
        handle: *mut *mut c_void,
        error: Errors,
    ) -> u32 {
        // SAFETY: the host gives what lives for the call.
        unsafe { entry::open([name, options], handle, error, |options: &O| function::<F>()(options, &*context)) }
    }
}

// SAFETY of both: the host passes the handle that `open` gave, places that can be written to, and references that live
// for the call; it calls a strategy from one thread at a time.

unsafe extern "C" fn describe<T: FeedStrategy>(this: *const c_void, answer: *mut Description, error: Errors) -> u32 {
    let this = unsafe { &*this.cast::<Instance<T>>() };
    unsafe { this.fault.guard("signals", answer, error, || description(this)) }
}

fn description(this: &Instance<impl FeedStrategy>) -> Result<Description, PluginError> {
    let names = this.plugin.signals();
    if names.len() > MAX_SIGNALS {
        return Err(PluginError::new(format!("it names {} signals; {MAX_SIGNALS} are possible", names.len())));
    }
    let mut signals = [RawSlice::EMPTY; MAX_SIGNALS];
    for (place, name) in signals.iter_mut().zip(names) {
        *place = RawSlice::new(name.as_bytes());
    }
    let most = || this.plugin.max_ratio_change_per_s();
    let max_ratio_change_per_s = this.fault.run("max_ratio_change_per_s", most)?;
    Ok(Description { max_ratio_change_per_s, signal_count: names.len() as u32, signals })
}

unsafe extern "C" fn update<T: FeedStrategy>(
    this: *mut c_void,
    window: *const Window<'_>,
    answer: *mut Reply,
    error: Errors,
) -> u32 {
    let Instance { plugin, fault } = unsafe { &mut *this.cast::<Instance<T>>() };
    unsafe { fault.guard("update", answer, error, || plugin.update(&*window).map(|answer| Reply::new(&answer))) }
}

/// The host's side: a strategy behind its table.
struct Linked {
    table: &'static Table,
    handle: Handle,
    max_ratio_change_per_s: f64,
    signals: &'static [&'static str],
}

/// Opens a strategy behind its table.
pub fn open(
    table: &'static Table,
    name: &'static str,
    options: &str,
    context: &StrategyContext,
) -> Made<dyn FeedStrategy> {
    let (name, options) = (RawSlice::new(name.as_bytes()), RawSlice::new(options.as_bytes()));
    // SAFETY: everything lives for the call; the handle is open; names live as long as their library, which stays.
    let handle = Handle::open([Method::StrategyNew, Method::StrategyDrop], table.close, |handle, error| unsafe {
        (table.open)(name, options, context, handle, error)
    })?;
    let described =
        ask(Method::StrategyDescribe, |answer, error| unsafe { (table.describe)(handle.instance, answer, error) })?;
    let names = &described.signals[..(described.signal_count as usize).min(MAX_SIGNALS)];
    // The contract hands names out for good, and few strategies are opened: their list is never freed.
    let signals = names.iter().map(|name| unsafe { entry::text(*name) }).collect::<Vec<_>>().leak();
    Ok(Box::new(Linked { table, handle, max_ratio_change_per_s: described.max_ratio_change_per_s, signals }))
}

impl FeedStrategy for Linked {
    fn signals(&self) -> &'static [&'static str] {
        self.signals
    }

    fn max_ratio_change_per_s(&self) -> f64 {
        self.max_ratio_change_per_s
    }

    fn update(&mut self, window: &Window) -> Result<Answer, PluginError> {
        // SAFETY: the handle is open, `ask` gives places to write to, the window lives for the call.
        let reply: Reply = ask(Method::StrategyUpdate, |answer, error| unsafe {
            (self.table.update)(self.handle.instance, window, answer, error)
        })?;
        reply.read()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_request_that_is_no_choice_is_an_error_with_its_number() {
        for request in [Request::None, Request::Hold, Request::Fault(7)] {
            let answer = Answer { request, ..Answer::of_ratio(0.5) };
            assert_eq!(Reply::new(&answer).read(), Ok(answer));
        }
        let foreign = Reply { request: 250, ..Reply::new(&Answer::of_ratio(0.5)) };
        let error = foreign.read().unwrap_err();
        assert_eq!(error.message(), "its update gives 250 as the request: 0, 1 and 2 are known");
    }
}
