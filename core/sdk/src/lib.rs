//! The contracts of Tandem: what a planner, a feed strategy, a driver or a kinematics sees, and nothing else.
//!
//! Units inside are mm, s, rad and mm/s. A rotary axis is in rad wherever a linear one is in mm. Every type that
//! crosses a contract is `repr(C)`, so that the same structures serve shared libraries; whether both sides mean the same is
//! judged by the names, places and types of the fields ([`abi`]).
//!
//! Which loop calls what:
//!
//! | contract | loop | may allocate |
//! |---|---|---|
//! | [`Planner`], [`FeedStrategy`] | rough (soft) | yes, but not in a steady state |
//! | [`Driver::send`], [`Driver::exchange`], [`Driver::quick_stop`], [`Kinematics`] | fine (hard) | no |
//! | factories, [`Driver::open`], [`Driver::start`], [`Driver::stop`], [`Driver::explain`] | host, outside the loops | yes |
//!
//! No plugin reads a clock or a source of randomness: time and seeds are arguments.

pub mod abi;
mod axis;
mod block;
mod driver;
mod error;
mod event;
mod kinematics;
mod lanes;
mod limits;
pub mod log;
mod option_values;
mod options;
mod planner;
mod plugin;
mod segment;
mod slice;
mod strategy;
mod text;

pub use axis::{Axes, AxisVector, MAX_AXES};
pub use block::{ArcGeometry, Block, BlockKind, Curve, NurbsData, PathMode};
pub use driver::{
    Arm, Attached, Driver, DriverContext, DriverDescription, Feedback, JointDescription,
    JointState, Latch, MAX_ANALOG, MAX_DELAY_PERIODS, MAX_DIGITAL, MAX_ENABLE_S, MAX_LATCHES, Name,
    Setpoint,
};
pub use error::PluginError;
pub use event::{Event, EventKind};
pub use kinematics::{Identity, Kinematics, KinematicsContext};
pub use lanes::JointLanes;
pub use limits::{AxisLimits, Limits, PathLimits};
pub use options::{NoOptions, OptionDoc, PluginOptions, RawOptions, parse_options};
pub use planner::{
    Accepted, Advanced, BlockReport, LimitedBy, Planner, PlannerContext, PlannerDescription,
    SegmentSink,
};
pub use plugin::{Plugin, PluginKind, PluginResult};
pub use segment::{Edge, Segment, SegmentFlags, StopOn, derivatives, polynomial};
pub use slice::Slice;
pub use strategy::{
    Answer, FeedStrategy, FineSample, MAX_SIGNALS, Request, StrategyContext, Window,
};
pub use text::Words;

#[doc(hidden)]
pub use serde;

// The macros name this crate as their users do.
#[doc(hidden)]
extern crate self as tandem_sdk;

/// Number of the plugin contract. A plugin built against another number is refused.
pub const ABI_VERSION: u32 = 5;
