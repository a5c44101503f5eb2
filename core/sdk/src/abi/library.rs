//! What a plugin crate exports: who made it, against which contract, and its plugins.

use std::ffi::c_void;

use super::entry::{self, text};
use crate::log::{HostTable, LogRecord};
use crate::text::Text;
use crate::{
    ABI_VERSION, Advanced, Answer, Axes, Block, BlockReport, DriverContext, DriverDescription, Feedback, FineSample,
    JointLanes, KinematicsContext, Limits, PlannerContext, PlannerDescription, Plugin, PluginError, PluginKind,
    RawSlice, Segment, Setpoint, StrategyContext, Window, size_of_contract,
};

/// What the exported symbol is called before the name of the crate. The number is that of [`Library`] itself.
pub const SYMBOL_PREFIX: &str = "tandem_plugin_v1__";

/// One plugin of a library.
#[derive(Debug)]
#[repr(C)]
pub struct Descriptor {
    /// Size of this structure in bytes.
    size: u32,
    /// Number of the [`PluginKind`].
    kind: u32,
    name: RawSlice<u8>,
    version: RawSlice<u8>,
    /// Describes the options, as TOML.
    options: unsafe extern "C" fn(*mut Text, *mut PluginError) -> u32,
    /// The table of the kind.
    table: *const c_void,
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
            size: size_of_contract::<Self>(),
            kind: kind as u32,
            name: RawSlice::new(name.as_bytes()),
            version: RawSlice::new(version.as_bytes()),
            options,
            table: std::ptr::from_ref(table).cast(),
        }
    }

    pub(crate) fn name(&self) -> &'static str {
        // SAFETY: descriptors are made of fixed texts, and a library is never unloaded.
        unsafe { text(self.name) }
    }

    pub(crate) fn version(&self) -> &'static str {
        // SAFETY: as above.
        unsafe { text(self.version) }
    }

    pub(crate) fn kind(&self) -> Option<PluginKind> {
        PluginKind::ALL.into_iter().find(|kind| *kind as u32 == self.kind)
    }

    /// The table, where the plugin is of `kind`.
    pub(crate) fn table<T>(&self, kind: PluginKind) -> Option<&'static T> {
        // SAFETY: `kind` says which table it is, and `of_library` has seen that the contract is the same.
        (self.kind == kind as u32).then(|| unsafe { &*self.table.cast::<T>() })
    }

    /// The description of the options, as TOML.
    pub(crate) fn options(&self) -> Result<Text, PluginError> {
        // SAFETY: `ask` gives places that can be written to.
        entry::ask(|answer, error| unsafe { (self.options)(answer, error) })
    }
}

/// What a plugin crate exports under [`SYMBOL_PREFIX`] and its name.
#[derive(Debug)]
#[repr(C)]
pub struct Library {
    /// Size of this structure in bytes.
    size: u32,
    abi_version: u32,
    /// Sizes of all structures of the contract in one number.
    layout: u64,
    /// Version of the SDK that it was built with.
    sdk_version: RawSlice<u8>,
    plugins: RawSlice<Descriptor>,
    /// Told once after loading: the host's table.
    prepare: unsafe extern "C" fn(*const HostTable),
}

impl Library {
    /// A library with these plugins.
    pub const fn new(plugins: &'static [Descriptor]) -> Self {
        Self {
            size: size_of_contract::<Self>(),
            abi_version: ABI_VERSION,
            layout: LAYOUT,
            sdk_version: RawSlice::new(env!("CARGO_PKG_VERSION").as_bytes()),
            plugins: RawSlice::new(plugins),
            prepare,
        }
    }

    /// The plugins of a loaded library; they write to `host`'s log.
    ///
    /// # Errors
    /// It was built against another contract, or with a kind of plugin that this host does not know.
    ///
    /// # Safety
    /// `library` is the symbol of a plugin crate, in a shared library that is never unloaded.
    pub unsafe fn plugins(library: *const Self, host: &'static HostTable) -> Result<Vec<Plugin>, String> {
        // SAFETY: the caller's promise. The first two numbers stand there in every version of the contract.
        let (size, version) = unsafe { ((*library).size, (*library).abi_version) };
        if version != ABI_VERSION {
            return Err(format!(
                "it is built for version {version} of the plugin contract; this host has {ABI_VERSION}"
            ));
        }
        if size != size_of_contract::<Self>() {
            return Err(format!("it is not a Tandem plugin: its descriptor has {size} bytes"));
        }
        // SAFETY: the version says that the rest is there.
        let this: &'static Self = unsafe { &*library };
        if this.layout != LAYOUT {
            // SAFETY: a fixed text.
            let other = unsafe { text(this.sdk_version) };
            return Err(format!(
                "it is built with another revision of tandem-sdk ({other}; this host has {}): build it again",
                env!("CARGO_PKG_VERSION")
            ));
        }
        // SAFETY: a fixed list, in a library that stays.
        let descriptors: &'static [Descriptor] = unsafe { this.plugins.as_slice() };
        if let Some(unknown) = descriptors.iter().find(|d| d.kind().is_none()) {
            return Err(format!("{} is of kind {}, which this host does not know", unknown.name(), unknown.kind));
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

/// Sizes of what crosses the contract, folded into one number (FNV-1a): another revision of the SDK has another.
pub const LAYOUT: u64 = {
    let sizes = [
        size_of::<PlannerContext>(),
        size_of::<StrategyContext>(),
        size_of::<DriverContext>(),
        size_of::<KinematicsContext>(),
        size_of::<PlannerDescription>(),
        size_of::<DriverDescription>(),
        size_of::<Axes>(),
        size_of::<Limits>(),
        size_of::<Block>(),
        size_of::<JointLanes>(),
        size_of::<Segment>(),
        size_of::<BlockReport>(),
        size_of::<Advanced>(),
        size_of::<FineSample>(),
        size_of::<Window<'_>>(),
        size_of::<Answer>(),
        size_of::<Setpoint>(),
        size_of::<Feedback>(),
        size_of::<PluginError>(),
        size_of::<Descriptor>(),
        size_of::<LogRecord>(),
        super::planner::TABLE_SIZE,
        super::strategy::TABLE_SIZE,
        super::driver::TABLE_SIZE,
        super::kinematics::TABLE_SIZE,
    ];
    let mut folded = 0xcbf2_9ce4_8422_2325_u64;
    let mut index = 0;
    while index < sizes.len() {
        folded = (folded ^ sizes[index] as u64).wrapping_mul(0x0100_0000_01b3);
        index += 1;
    }
    folded
};
