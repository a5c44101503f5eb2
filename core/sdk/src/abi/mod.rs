//! How a plugin crosses the border of its crate: tables of C functions, the same for a plugin linked into the host and
//! for one in a shared library.
//!
//! An author meets none of this: [`crate::plugin!`] makes it from a plain implementation of a contract. Each kind has a
//! module with a table, the plugin's side (`extern "C"` functions that catch panics) and the host's side (a value that
//! implements the contract by calling the table).
//!
//! What a call costs beyond a plain one: an indirect jump, a look whether the plugin has panicked before, and a word for who
//! watches the thread. Nothing is allocated.
//!
//! What comes back is looked at before it is believed: a number that stands for a choice is read as a number, and one that
//! stands for none is an error with the method, the field and the value.
//!
//! # Why it is so
//!
//! Rust has no stable layout, so a shared library and the host share tables of `extern "C"` functions and `repr(C)`
//! structures (`core/sdk/src/abi`). `tandem_sdk::plugin!` makes them from a plain `impl`; the type of the plugin, of
//! its options and of its constructor are found by inference, so an author writes no type twice. The constructor is a
//! function item or a closure without captures: a type without data, so that the table can call it by its type alone.
//!
//! A contract is a list of methods (`contract.rs`), of which one macro makes the table, the plugin's side and the host's
//! calls. A block is plain data. The curve of a NURBS is borrowed beside it ([`crate::Curve`], made of
//! [`crate::Slice`]s), and who queues blocks keeps an `Arc` of [`crate::NurbsData`].
//!
//! What crosses with an owner (errors, descriptions) carries the function that frees it, because each library has an
//! allocator of its own. A panic is caught where the call enters the plugin; its words are kept there for good, every
//! later call answers them, and the plugin is not dropped. It prints nothing: a library has a panic hook of its own,
//! and for plugins that are linked in, the program's hook looks whether the thread is in a call of a plugin and leaves
//! all other panics to the hook that was there before. The host's sink catches its own panics before they would cross
//! the plugin. A planner that emits without end is ended from within: the SDK's side of the sink panics once the host
//! takes no more, which is 100 000 calls in one `advance`.
//!
//! Two numbers say whether both sides mean the same: `ABI_VERSION`, and one folded at compile time from the name, place
//! and type of every field of every structure that crosses, the variants of every enumeration, and the functions of
//! every table in their order (`core/sdk/src/abi/layout.rs`). Sizes alone would not see two fields of one type that
//! change places. The lists stand beside the types and are taken apart as patterns without a rest, so that a field
//! cannot be forgotten. Each library also hands out the numbers one by one, with names, so that a refusal says which
//! structure differs. The symbol carries the number of the descriptor's own form.
//!
//! A Rust `enum` with a foreign number is undefined behaviour, so none comes back from a plugin: what stands for a
//! choice crosses as a number, and becomes one of ours by `TryFrom` only. Where that would cost time in
//! every fine period, the type is a number with names (`JointState`), and the fine loop treats an unknown one as a
//! fault.
//!
//! A call that never returns cannot be ended from outside. A thread of ordinary priority looks whether calls come back
//! (`core/host/src/plugins/hang.rs`). Each thread holds where the other can see it which method of a plugin it is in,
//! which costs a call less than a nanosecond, and counts how it gets on: periods, blocks, segments. Conversions of a
//! kinematics are too short for even that; the fine loop that asks them is watched instead. What hangs is told by
//! plugin and method; then the process ends, because drives that hear nothing stop by themselves. It judges by looks
//! that saw no change and not by elapsed time, so that a computer that sleeps accuses nobody.
//!
//! Three methods were added to the contracts for this: `FeedStrategy::max_ratio_change_per_s`, because passivity can be
//! judged only against what a strategy promises; `Kinematics::health`, because its other methods cannot fail in words
//! and are called on the fine loop; and a constructor's `KinematicsContext`, because a kinematics needs to know which
//! axis is X. `Window` has its samples behind a method that borrows, so that a strategy needs no `unsafe`.

mod contract;
mod entry;
pub(crate) mod layout;
mod library;
mod watch;

mod driver;
mod kinematics;
mod planner;
mod strategy;

pub use driver::driver;
pub use entry::quiet_linked_panics;
pub use kinematics::kinematics;
pub use library::{Descriptor, LAYOUT, Library, SYMBOL_PREFIX};
pub use planner::planner;
pub use strategy::feed_strategy;
pub use watch::{Method, Watched, Whereabouts, beat, calling, watch_this_thread};

pub(crate) use driver::open as open_driver;
pub(crate) use kinematics::open as open_kinematics;
pub(crate) use planner::open as open_planner;
pub(crate) use strategy::open as open_strategy;
