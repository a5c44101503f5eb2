//! Which call of a plugin a thread is in, for another thread that looks whether it comes back.
//!
//! Each thread holds the method that it is in, which costs a load and two stores of its own memory in each call, and counts how
//! often it gets on: once a period, a block, a segment.

use std::cell::Cell;
use std::marker::PhantomData;
use std::sync::atomic::{AtomicU8, AtomicU64, Ordering::Relaxed};
use std::sync::{Arc, Mutex, PoisonError};

use crate::PluginKind;

macro_rules! methods {
    ($($method:ident = $kind:ident $name:literal),+ $(,)?) => {
        /// A method of a plugin, or what else a thread may not come back from.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[repr(u8)]
        #[allow(missing_docs)] // the names are those of the contracts' methods
        pub enum Method {
            /// In no plugin.
            None = 0,
            $($method,)+
            /// In a fine period, outside of the driver.
            FinePeriod
        }

        impl Method {
            /// All methods.
            pub const ALL: &'static [Self] = &[$(Self::$method,)+ Self::FinePeriod];

            /// The kind of the plugin and the name of the method; none outside of plugins.
            pub fn words(self) -> Option<(PluginKind, &'static str)> {
                match self {
                    Self::None | Self::FinePeriod => None,
                    $(Self::$method => Some((PluginKind::$kind, $name))),+
                }
            }
        }
    };
}

methods!(
    PlannerNew = Planner "its constructor",
    PlannerDrop = Planner "drop",
    PlannerDescribe = Planner "describe",
    PlannerCheck = Planner "check",
    PlannerAccept = Planner "accept",
    PlannerFinish = Planner "finish",
    PlannerAdvance = Planner "advance",
    PlannerReset = Planner "reset",
    StrategyNew = FeedStrategy "its constructor",
    StrategyDrop = FeedStrategy "drop",
    StrategySignals = FeedStrategy "signals",
    StrategyMaxRatioChange = FeedStrategy "max_ratio_change_per_s",
    StrategyTakesOverride = FeedStrategy "takes_override",
    StrategyExplain = FeedStrategy "explain",
    StrategyUpdate = FeedStrategy "update",
    DriverNew = Driver "its constructor",
    DriverDrop = Driver "drop",
    DriverDescribe = Driver "describe",
    DriverCheck = Driver "check",
    DriverOpen = Driver "open",
    DriverStart = Driver "start",
    DriverExchange = Driver "exchange",
    DriverQuickStop = Driver "quick_stop",
    DriverStop = Driver "stop",
    DriverSend = Driver "send",
    DriverExplain = Driver "explain",
    KinematicsNew = Kinematics "its constructor",
    KinematicsDrop = Kinematics "drop",
    KinematicsJointCount = Kinematics "joint_count",
    KinematicsConvert = Kinematics "to_joints or to_axes",
    KinematicsHealth = Kinematics "health",
);

/// What a thread says of itself. It alone writes it.
#[derive(Debug)]
struct ThreadStatus {
    /// Number of the [`Method`] that it is in.
    method: AtomicU8,
    /// How often it said that it gets on.
    beats: AtomicU64,
}

thread_local! {
    static STATUS: ThreadStatus = const { ThreadStatus { method: AtomicU8::new(0), beats: AtomicU64::new(0) } };
    /// Whether it is in a conversion of a kinematics.
    static CONVERTING: Cell<bool> = const { Cell::new(false) };
}

/// Where a thread is, as another one sees it.
#[derive(Debug, Default)]
pub struct Whereabouts(Mutex<Option<&'static ThreadStatus>>);

impl Whereabouts {
    /// How often the thread said that it gets on, and the method that it is in. Nowhere, where no thread is watched.
    pub fn look(&self) -> (u64, Method) {
        let place = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let Some(place) = *place else {
            return (0, Method::None);
        };
        let number = place.method.load(Relaxed);
        let method = Method::ALL.iter().find(|method| **method as u8 == number);
        (
            place.beats.load(Relaxed),
            method.copied().unwrap_or(Method::None),
        )
    }
}

/// From now on calls of this thread show in `whereabouts`, until the answer is dropped.
pub fn watch_this_thread(whereabouts: &Arc<Whereabouts>) -> Watched {
    // SAFETY: the place lives as long as its thread. `Watched` cannot leave the thread and takes the reference back; who looks
    // holds the lock while it does so. One that is never dropped is one of a thread that never ends.
    let place: &'static ThreadStatus = STATUS.with(|place| unsafe { &*std::ptr::from_ref(place) });
    *whereabouts.0.lock().unwrap_or_else(PoisonError::into_inner) = Some(place);
    Watched {
        whereabouts: Arc::clone(whereabouts),
        _here: PhantomData,
    }
}

/// A thread whose calls of plugins can be seen. It stays on its thread.
#[derive(Debug)]
pub struct Watched {
    whereabouts: Arc<Whereabouts>,
    _here: PhantomData<*const ()>,
}

impl Drop for Watched {
    fn drop(&mut self) {
        *self
            .whereabouts
            .0
            .lock()
            .unwrap_or_else(PoisonError::into_inner) = None;
    }
}

/// This thread gets on: a period is over, a block was looked at, a segment was taken. Any loop; does not allocate.
#[inline]
pub fn beat() {
    STATUS.with(|place| {
        place
            .beats
            .store(place.beats.load(Relaxed).wrapping_add(1), Relaxed);
    });
}

/// Whether this thread is in a call of a plugin.
pub(super) fn is_within() -> bool {
    let of_host =
        [Method::None, Method::FinePeriod, Method::KinematicsConvert].map(|method| method as u8);
    CONVERTING.get() || STATUS.with(|place| !of_host.contains(&place.method.load(Relaxed)))
}

/// Makes a conversion of a kinematics. Nobody else sees it: the store that says that it is over would come between the answer and
/// where it goes, and cost a copy of the answer. Whoever asks says so, with [`calling`], where that matters.
#[inline]
pub(super) fn converting<R>(convert: impl FnOnce() -> R) -> R {
    let before = CONVERTING.replace(true);
    let answer = convert();
    CONVERTING.set(before);
    answer
}

/// Calls a method of a plugin, or with [`Method::None`] back from it into the host. A host names so what the border does not
/// show by itself: a fine period, and what asks a kinematics.
#[inline]
pub fn calling<R>(method: Method, call: impl FnOnce() -> R) -> R {
    STATUS.with(|place| {
        let before = place.method.load(Relaxed);
        place.method.store(method as u8, Relaxed);
        let answer = call();
        place.method.store(before, Relaxed);
        answer
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn another_thread_sees_which_call_a_thread_is_in_and_that_it_gets_on() {
        let place = Arc::new(Whereabouts::default());
        let seen = Arc::clone(&place);
        let watched = watch_this_thread(&place);
        let look = move || std::thread::scope(|scope| scope.spawn(|| seen.look()).join().unwrap());
        let (beats, nowhere) = look();
        assert_eq!(nowhere, Method::None);
        calling(Method::PlannerAdvance, || {
            calling(Method::DriverExchange, || {
                assert_eq!(look().1, Method::DriverExchange);
            });
            calling(Method::None, || assert_eq!(look().1, Method::None));
            assert_eq!(look(), (beats, Method::PlannerAdvance));
            beat();
            assert_eq!(look(), (beats + 1, Method::PlannerAdvance));
        });
        assert_eq!(look(), (beats + 1, Method::None));
        drop(watched);
        calling(Method::PlannerAdvance, || {
            assert_eq!(look(), (0, Method::None));
        });
    }

    #[test]
    fn methods_are_found_by_their_number() {
        let place = Arc::new(Whereabouts::default());
        let _watched = watch_this_thread(&place);
        for method in Method::ALL {
            calling(*method, || assert_eq!(place.look().1, *method));
            assert_eq!(method.words().is_some(), *method != Method::FinePeriod);
        }
    }
}
