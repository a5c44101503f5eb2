//! What a plugin crate exports: who made it, against which contract, and its plugins.

use std::ffi::c_void;

use super::entry::{self, text};
use super::layout::{START, Structure, fold, table};
use super::watch::Method;
use crate::log::{HostTable, LogLevel, LogRecord};
use crate::text::Text;
use crate::{
    ABI_VERSION, Accepted, Advanced, ArcGeometry, Arm, Attached, Axes, AxisLimits, AxisVector,
    Block, BlockKind, BlockReport, Curve, DriverContext, DriverDescription, Edge, Feedback,
    FineSample, JointDescription, JointLanes, JointState, KinematicsContext, Latch, LimitedBy,
    Limits, Name, PathMode, PlannerContext, PlannerDescription, Plugin, PluginError, PluginKind,
    Segment, SegmentFlags, Setpoint, Slice, StopOn, StrategyContext, Window, Words,
};

/// What the exported symbol is called before the name of the crate. The number is that of [`Library`] itself.
pub const SYMBOL_PREFIX: &str = "tandem_plugin_v1__";

table! {
    /// One plugin of a library.
    #[derive(Debug)]
    pub struct Descriptor {
        // Number of the kind.
        kind: u32,
        name: Slice<'static, u8>,
        version: Slice<'static, u8>,
        // Describes the options, as TOML.
        options: unsafe extern "C" fn(*mut Text, *mut PluginError) -> u32,
        // The table of the kind.
        table: *const c_void,
    }
}

// SAFETY: it is never changed, and what it points at lives as long as the program.
unsafe impl Sync for Descriptor {}
// SAFETY: as above.
unsafe impl Send for Descriptor {}

impl Descriptor {
    /// A plugin of `kind` whose functions are in `table`.
    pub(crate) const fn new<T>(
        kind: PluginKind,
        (name, version): (&'static str, &'static str),
        options: unsafe extern "C" fn(*mut Text, *mut PluginError) -> u32,
        table: &'static T,
    ) -> Self {
        Self {
            kind: kind as u32,
            name: Slice::new(name.as_bytes()),
            version: Slice::new(version.as_bytes()),
            options,
            table: std::ptr::from_ref(table).cast(),
        }
    }

    pub(crate) fn name(&self) -> &'static str {
        text(self.name)
    }

    pub(crate) fn version(&self) -> &'static str {
        text(self.version)
    }

    pub(crate) fn kind(&self) -> Option<PluginKind> {
        PluginKind::try_from(self.kind).ok()
    }

    /// The table, where the plugin is of `kind`.
    pub(crate) fn table<T>(&self, kind: PluginKind) -> Option<&'static T> {
        // SAFETY: `kind` says which table it is, and `of_library` has seen that the contract is the same.
        (self.kind == kind as u32).then(|| unsafe { &*self.table.cast::<T>() })
    }

    /// The description of the options, as TOML.
    pub(crate) fn options(&self) -> Result<Text, PluginError> {
        // SAFETY: `ask` gives places that can be written to.
        entry::ask(Method::None, |answer, error| unsafe {
            (self.options)(answer, error)
        })
    }
}

/// What a plugin crate exports under [`SYMBOL_PREFIX`] and its name.
#[derive(Debug)]
#[repr(C)]
pub struct Library {
    /// Size of this structure in bytes.
    size: u32,
    abi_version: u32,
    /// All structures of the contract in one number.
    layout: u64,
    /// Version of the SDK that it was built with.
    sdk_version: Slice<'static, u8>,
    plugins: Slice<'static, Descriptor>,
    /// Told once after loading: the host's table.
    prepare: unsafe extern "C" fn(*const HostTable),
    /// The structures of the contract one by one.
    structures: Slice<'static, Structure>,
}

impl Library {
    /// A library with these plugins.
    pub const fn new(plugins: &'static [Descriptor]) -> Self {
        Self {
            size: size_of::<Self>() as u32,
            abi_version: ABI_VERSION,
            layout: LAYOUT,
            sdk_version: Slice::new(env!("CARGO_PKG_VERSION").as_bytes()),
            plugins: Slice::new(plugins),
            prepare,
            structures: Slice::new(STRUCTURES),
        }
    }

    /// The plugins of a loaded library; they write to `host`'s log.
    ///
    /// # Errors
    /// It was built against another contract, or with a kind of plugin that this host does not know.
    ///
    /// # Safety
    /// `library` is the symbol of a plugin crate, in a shared library that is never unloaded.
    pub unsafe fn plugins(
        library: *const Self,
        host: &'static HostTable,
    ) -> Result<Vec<Plugin>, String> {
        // SAFETY: the caller's promise. The first two numbers stand there in every version of the contract.
        let (size, version) = unsafe { ((*library).size, (*library).abi_version) };
        if version != ABI_VERSION {
            return Err(format!(
                "it is built for version {version} of the plugin contract; this host has {ABI_VERSION}"
            ));
        }
        if size != size_of::<Self>() as u32 {
            return Err(format!(
                "it is not a Tandem plugin: its descriptor has {size} bytes"
            ));
        }
        // SAFETY: the version says that the rest is there, and a library is never unloaded: its texts and lists live as long.
        let this: &'static Self = unsafe { &*library };
        if this.layout != LAYOUT {
            let other = text(this.sdk_version);
            let differs = first_difference(&this.structures);
            let differs =
                differs.map_or_else(String::new, |name| format!(": its {name} is another one"));
            return Err(format!(
                "it is built with another revision of tandem-sdk ({other}; this host has {}){differs}: build it again",
                env!("CARGO_PKG_VERSION")
            ));
        }
        let descriptors: &'static [Descriptor] = this.plugins.get();
        if let Some(unknown) = descriptors.iter().find(|d| d.kind().is_none()) {
            return Err(format!(
                "{} is of kind {}, which this host does not know",
                unknown.name(),
                unknown.kind
            ));
        }
        // SAFETY: the table lives as long as the program.
        unsafe { (this.prepare)(host) };
        Ok(descriptors.iter().map(Plugin::new).collect())
    }
}

/// Runs in the plugin's library: its panics and its log are its own.
unsafe extern "C" fn prepare(host: *const HostTable) {
    entry::quiet_panics();
    // SAFETY: the host's table lives as long as the program.
    crate::log::attach(unsafe { &*host });
}

macro_rules! structures {
    ($($name:ty),+ $(,)?) => {
        [$(Structure::of::<$name>(stringify!($name))),+]
    };
}

/// Every structure that crosses the contract, each behind those that it is made of: the first that differs is the one that was
/// changed.
static STRUCTURES: &[Structure] = &structures();

const fn structures() -> [Structure; 49] {
    structures![
        PluginKind,
        BlockKind,
        PathMode,
        Edge,
        LimitedBy,
        Accepted,
        JointState,
        LogLevel,
        SegmentFlags,
        AxisVector,
        Axes,
        AxisLimits,
        Limits,
        JointLanes,
        Text,
        Words,
        PluginError,
        StopOn,
        ArcGeometry,
        Block,
        Curve<'_>,
        Segment,
        BlockReport,
        Advanced,
        PlannerContext,
        PlannerDescription,
        FineSample,
        Window<'_>,
        StrategyContext,
        super::strategy::Signals,
        super::strategy::Reply,
        Name,
        JointDescription,
        DriverContext,
        DriverDescription,
        Attached,
        Arm,
        Setpoint,
        Latch,
        Feedback,
        KinematicsContext,
        LogRecord,
        HostTable,
        super::planner::Sink,
        super::planner::Table,
        super::strategy::Table,
        super::driver::Table,
        super::kinematics::Table,
        Descriptor,
    ]
}

/// Every structure of the contract, folded into one number.
pub const LAYOUT: u64 = {
    let all = structures();
    let mut folded = START;
    let mut index = 0;
    while index < all.len() {
        folded = fold(folded, all[index].hash);
        index += 1;
    }
    folded
};

/// The first structure of ours that is another one in `theirs`, or is not there.
fn first_difference(theirs: &[Structure]) -> Option<&'static str> {
    let name = |structure: &Structure| text(structure.name);
    let is_same = |ours: &&Structure| {
        theirs
            .iter()
            .any(|other| other.hash == ours.hash && name(other) == name(ours))
    };
    STRUCTURES
        .iter()
        .find(|ours| !is_same(ours))
        .map(|ours| text(ours.name))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_structure_that_differs_is_named_and_not_those_that_hold_it() {
        assert_eq!(first_difference(STRUCTURES), None);
        let mut other = STRUCTURES.to_vec();
        let changed = |name: &str| ["AxisLimits", "Limits", "PlannerContext"].contains(&name);
        for structure in other
            .iter_mut()
            .filter(|structure| changed(text(structure.name)))
        {
            structure.hash ^= 1;
        }
        assert_eq!(first_difference(&other), Some("AxisLimits"));
        assert_eq!(first_difference(&[]), Some("PluginKind"));
    }

    #[test]
    fn every_structure_stands_once_in_the_list() {
        let mut hashes: Vec<u64> = STRUCTURES.iter().map(|structure| structure.hash).collect();
        hashes.sort_unstable();
        hashes.dedup();
        assert_eq!(hashes.len(), STRUCTURES.len());
    }
}
