//! What every entry of a plugin has in common: it catches panics, and a plugin that has panicked is not called again.

use std::any::Any;
use std::cell::RefCell;
use std::ffi::c_void;
use std::panic::{AssertUnwindSafe, PanicHookInfo, catch_unwind};
use std::ptr::NonNull;
use std::sync::{Once, OnceLock};

use super::layout::Choice;
use super::watch::{Method, calling, is_within};
use crate::options::OptionDocs;
use crate::text::Text;
use crate::{PluginError, PluginOptions, Slice};

/// A call that did what it was asked for; what it answers is written.
pub const DONE: u32 = 0;
/// A call that failed; the error is written.
pub const FAILED: u32 = 1;

/// A plugin behind a handle.
pub struct Instance<T> {
    pub plugin: T,
    pub guard: CallGuard,
}

/// Stands before every call of a plugin: catches its panic, and lets no call through after it. Holds the plugin's name and the
/// words of the panic, which are kept for good, so that repeating them needs no memory.
#[derive(Debug)]
pub struct CallGuard {
    name: &'static str,
    words: OnceLock<&'static str>,
}

impl CallGuard {
    fn new(name: &'static str) -> Self {
        Self {
            name,
            words: OnceLock::new(),
        }
    }

    /// Calls `work`, unless the plugin has panicked before; writes what it answers.
    ///
    /// # Safety
    /// `answer` and `error` can be written to.
    pub unsafe fn run_into<R>(
        &self,
        method: &str,
        answer: *mut R,
        error: *mut PluginError,
        work: impl FnOnce() -> Result<R, PluginError>,
    ) -> u32 {
        // SAFETY: the caller's promise; the place of an error or an answer holds nothing to drop.
        unsafe {
            match self.run(method, work).and_then(|outcome| outcome) {
                Ok(value) => answer.write(value),
                Err(words) => {
                    error.write(words);
                    return FAILED;
                }
            }
        }
        DONE
    }

    /// Calls `work`, unless the plugin has panicked before.
    ///
    /// # Errors
    /// It has panicked, now or before.
    #[inline]
    pub fn run<R>(&self, method: &str, work: impl FnOnce() -> R) -> Result<R, PluginError> {
        match self.words.get() {
            Some(words) => Err(PluginError::of_panic(words)),
            None => catch_unwind(AssertUnwindSafe(work)).map_err(|panic| self.keep(method, panic)),
        }
    }

    #[cold]
    fn keep(&self, method: &str, panic: Box<dyn Any + Send>) -> PluginError {
        let words = panic.downcast_ref::<String>().map(String::as_str);
        let words = words
            .or_else(|| panic.downcast_ref::<&str>().copied())
            .unwrap_or("without words");
        let place = PANICKED.with(|panicked| panicked.0.take().place);
        let text: &'static str = Box::leak(
            format!("{} panicked in {method}{place}: {words}", self.name).into_boxed_str(),
        );
        // Dropping what the panic carries runs code of the plugin again, which may panic again.
        std::mem::forget(panic);
        let _ = self.words.set(text);
        PluginError::of_panic(text)
    }

    /// Whether there was a panic.
    fn happened(&self) -> bool {
        self.words.get().is_some()
    }
}

thread_local! {
    static PANICKED: Panicked = const { Panicked(RefCell::new(PanicText { place: String::new(), words: String::new() })) };
}

/// The last panic of this thread, until the error of a call has it.
struct Panicked(RefCell<PanicText>);

#[derive(Default)]
struct PanicText {
    place: String,
    words: String,
}

impl Drop for Panicked {
    /// No call has it: it is the end of a thread that a plugin has started, and nothing else tells of that.
    fn drop(&mut self) {
        let PanicText { place, words } = self.0.get_mut();
        if !place.is_empty() {
            crate::log!(Error, "a thread of a plugin panicked{place}: {words}");
        }
    }
}

/// Keeps where a panic happened instead of printing it: a backtrace takes tens of milliseconds. A shared library has a
/// hook of its own, so that this touches nobody else's.
pub fn quiet_panics() {
    std::panic::set_hook(Box::new(keep_place));
}

/// The same for plugins that are linked into this program, whose hook is that of the program: panics while a host calls a
/// plugin print nothing, because the error that the call gives has their place and words. All others go to the hook that was
/// there before. Host, at start; the first call counts.
pub fn quiet_linked_panics() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        let before = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |info| {
            if is_within() {
                keep_place(info);
            } else {
                before(info);
            }
        }));
    });
}

fn keep_place(info: &PanicHookInfo<'_>) {
    let place = info
        .location()
        .map(|at| format!(" ({}:{})", at.file(), at.line()))
        .unwrap_or_default();
    let words = info.payload_as_str().unwrap_or("without words").to_string();
    // At the very end of a thread there is no place for it any more.
    let _ = PANICKED.try_with(|panicked| panicked.0.replace(PanicText { place, words }));
}

/// A function or closure that captures nothing, made from its type: it has no data.
pub fn function<F: Copy + 'static>() -> F {
    const {
        assert!(
            size_of::<F>() == 0,
            "name the function itself, or a closure that captures nothing"
        );
    };
    // SAFETY: a value without data is read from anywhere; `F` is `Copy`, and the one given to the macro exists.
    unsafe { NonNull::<F>::dangling().read() }
}

/// Opens a plugin from its options.
///
/// # Safety
/// `handle` and `error` can be written to.
pub unsafe fn open<T, O: PluginOptions>(
    name: Slice<'static, u8>,
    options: Slice<'_, u8>,
    handle: *mut *mut c_void,
    error: *mut PluginError,
    make: impl FnOnce(&O) -> Result<T, PluginError>,
) -> u32 {
    let name = text(name);
    let work = || {
        let plugin = make(&O::read(text(options))?)?;
        Ok(Box::into_raw(Box::new(Instance {
            plugin,
            guard: CallGuard::new(name),
        }))
        .cast::<c_void>())
    };
    // SAFETY: the caller's promise.
    unsafe { CallGuard::new(name).run_into("its constructor", handle, error, work) }
}

/// Describes the options `O`, as TOML.
///
/// # Safety
/// Both can be written to.
pub unsafe extern "C" fn describe<O: PluginOptions>(
    answer: *mut Text,
    error: *mut PluginError,
) -> u32 {
    let work = || {
        let docs = OptionDocs {
            option: O::describe(),
        };
        toml::to_string(&docs)
            .map(Text::owned)
            .map_err(|e| PluginError::new(e.to_string()))
    };
    // SAFETY: the caller's promise.
    unsafe { CallGuard::new("it").run_into("the description of its options", answer, error, work) }
}

/// Closes a plugin. One that has panicked is left as it is: what it would drop may be half made.
///
/// # Safety
/// `handle` was given by [`open`] for the same type, and is not used again.
pub unsafe extern "C" fn close<T>(handle: *mut c_void) {
    // SAFETY: the caller's promise.
    let Instance { plugin, guard } = unsafe { *Box::from_raw(handle.cast::<Instance<T>>()) };
    if guard.happened() {
        std::mem::forget(plugin);
        return;
    }
    if let Err(panic) = catch_unwind(AssertUnwindSafe(|| drop(plugin))) {
        crate::log!(Error, "{}", guard.keep("drop", panic));
    }
}

/// A text of the other side.
pub fn text(raw: Slice<'_, u8>) -> &str {
    std::str::from_utf8(raw.get()).unwrap_or("")
}

/// The host's side of an opened plugin.
pub struct Handle {
    pub instance: *mut c_void,
    close: unsafe extern "C" fn(*mut c_void),
    drop: Method,
}

// SAFETY: every contract asks for plugins that may be sent, and those that are shared for plugins that may be.
unsafe impl Send for Handle {}
// SAFETY: as above: only a kinematics is called through a shared reference from several threads, and it is `Sync`.
unsafe impl Sync for Handle {}

impl Handle {
    /// Opens a plugin with one of the `open` functions.
    pub fn open(
        [new, drop]: [Method; 2],
        close: unsafe extern "C" fn(*mut c_void),
        call: impl FnOnce(*mut *mut c_void, *mut PluginError) -> u32,
    ) -> Result<Self, PluginError> {
        let instance = ask(new, call)?;
        Ok(Self {
            instance,
            close,
            drop,
        })
    }
}

impl Drop for Handle {
    fn drop(&mut self) {
        // SAFETY: it was opened, and is closed once.
        calling(self.drop, || unsafe { (self.close)(self.instance) });
    }
}

/// The choice that `number`, which a plugin has put into `field`, stands for.
///
/// # Errors
/// It stands for none.
pub fn choice<C: Choice>(method: Method, field: &str, number: u32) -> Result<C, PluginError> {
    C::try_from(number).map_err(|number| match C::COUNT {
        2 => foreign(method, field, number, "0 and 1"),
        count => foreign(method, field, number, &format!("0 to {}", count - 1)),
    })
}

/// A plugin has put `value` into `field`, where only `known` numbers mean something. It was written to a place of plain numbers:
/// one that stands for no choice is never taken for a choice.
pub fn foreign(method: Method, field: &str, value: u32, known: &str) -> PluginError {
    let name = method.words().map_or("a call", |(_, name)| name);
    PluginError::new(format!(
        "its {name} gives {value} as {field}: {known} are known"
    ))
}

/// Makes a call of a table: room for its answer and its error, and the one of the two that came.
#[inline]
pub fn ask<R>(
    method: Method,
    call: impl FnOnce(*mut R, *mut PluginError) -> u32,
) -> Result<R, PluginError> {
    let mut answer = std::mem::MaybeUninit::<R>::uninit();
    let mut error = std::mem::MaybeUninit::<PluginError>::uninit();
    let status = calling(method, || call(answer.as_mut_ptr(), error.as_mut_ptr()));
    // SAFETY: each status says which of the two was written.
    unsafe {
        if status == DONE {
            Ok(answer.assume_init())
        } else {
            Err(error.assume_init())
        }
    }
}
