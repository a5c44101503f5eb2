//! The conformance kit: whether a plugin keeps the promises of its contract.
//!
//! A plugin's crate has it as a development dependency:
//!
//! ```no_run
//! # use tandem_sdk::{Identity, KinematicsContext, NoOptions};
//! # tandem_sdk::plugin!(kinematics "same" = |_: &NoOptions, _: &KinematicsContext| Ok(Identity));
//! # fn main() {
//! // Lets the kit see what the plugin allocates.
//! #[global_allocator]
//! static COUNTING: tandem_conformance::CountingAllocator = tandem_conformance::CountingAllocator;
//!
//! // #[test]
//! fn it_conforms() {
//!     tandem_conformance::judge(PLUGIN, &tandem_conformance::Setup::default()).assert_conforms();
//! }
//! # it_conforms();
//! # }
//! ```
//!
//! `tandem plugin check` runs the same on a shared library. Everything random comes from [`Setup::seed`], which the
//! report shows.

mod driver;
mod heap;
mod joints;
mod kinematics;
mod limits;
mod machine;
mod motion;
mod nonsense;
mod planner;
mod program;
mod random;
mod report;
mod strategy;
mod timing;

pub use heap::CountingAllocator;
pub use report::{Finding, Report};
pub use timing::Timing;

use tandem_sdk::{Plugin, PluginKind};

/// What the kit is told.
#[derive(Clone, Debug)]
pub struct Setup {
    /// The plugin's options as TOML.
    pub options: String,
    /// Seed of everything random.
    pub seed: u64,
    /// How many random programs a planner drives.
    pub programs: u64,
    /// Whether a driver that moves metal is driven all the same.
    pub moves_metal: bool,
    /// Where kinematics are tried: lowest and highest position of X, Y and Z, mm.
    pub work_area: [[f64; 2]; 3],
}

impl Default for Setup {
    /// No options, seed 1, 10 programs, no metal, 200 mm around zero.
    fn default() -> Self {
        Self {
            options: String::new(),
            seed: 1,
            programs: 10,
            moves_metal: false,
            work_area: [[-machine::REACH_MM, machine::REACH_MM]; 3],
        }
    }
}

/// Judges a plugin of any kind.
pub fn judge(plugin: Plugin, setup: &Setup) -> Report {
    let mut report = Report::new(plugin, setup.seed);
    judge_description(plugin, &mut report);
    match plugin.kind() {
        PluginKind::Planner => planner::judge(plugin, setup, &mut report),
        PluginKind::FeedStrategy => strategy::judge(plugin, setup, &mut report),
        PluginKind::Driver => driver::judge(plugin, setup, &mut report),
        PluginKind::Kinematics => kinematics::judge(plugin, setup, &mut report),
    }
    report
}

/// A name that fits `machine.toml`, and options that say what they mean.
fn judge_description(plugin: Plugin, report: &mut Report) {
    const CHECK: &str = "description";
    report.judged(CHECK);
    let plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-';
    if plugin.name().is_empty() || !plugin.name().chars().all(plain) {
        report.find(
            CHECK,
            format!(
                "the name {:?} has other characters than a-z, 0-9 and -",
                plugin.name()
            ),
        );
    }
    match plugin.options() {
        Err(error) => report.find(CHECK, format!("options: {error}")),
        Ok(options) => {
            for option in options.iter().filter(|option| option.doc.is_empty()) {
                report.find(
                    CHECK,
                    format!("the option {} has no documentation", option.key),
                );
            }
        }
    }
}

/// An option that no plugin has.
const UNKNOWN_OPTION: &str = "no_plugin_has_this_option = 1\n";

/// Opens a plugin with the setup's options, after it has refused an unknown one.
fn open<T>(
    setup: &Setup,
    report: &mut Report,
    open: impl Fn(&str) -> Result<T, tandem_sdk::PluginError>,
) -> Option<T> {
    const CHECK: &str = "options";
    report.judged(CHECK);
    match open(&format!("{UNKNOWN_OPTION}{}", setup.options)) {
        Ok(_) => report.find(
            CHECK,
            "it takes an option that it does not know".to_string(),
        ),
        Err(error) if error.is_panic() => report.find(CHECK, error.to_string()),
        Err(_) => {}
    }
    open(&setup.options)
        .map_err(|error| report.find(CHECK, format!("it does not open: {error}")))
        .ok()
}
