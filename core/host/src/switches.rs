//! What a run is asked for besides its machine and its program.

use tandem_machine::Machine;
use tandem_rough::Source;

/// Which clock drives the loops.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Clock {
    /// Lockstep, as fast as the processor allows.
    Virtual,
    /// Real time.
    Wall,
}

/// Makes the source of a run that moves by itself before it hands out another source, if any, as homing does. It is given the
/// machine as it stands.
pub type Lead = fn(&Machine, Option<Box<dyn Source + Send>>) -> Box<dyn Source + Send>;

/// The switches of the operator's panel.
#[derive(Clone, Copy, Debug, Default)]
#[allow(clippy::struct_excessive_bools)] // independent switches of a panel
pub struct Switches {
    /// Lines that begin with `/` are left out.
    pub block_delete: bool,
    /// M0 and M6 wait for the operator.
    pub pause_at_stops: bool,
    /// M1 waits for the operator, until the switch is turned off.
    pub optional_stop: bool,
    /// No spindle, coolant or user output is switched, nothing waits for the operator, and feed motion runs at the
    /// machine's dry-run feed.
    pub dry_run: bool,
    /// What homes the axes that the machine file tells how to, before the program; none where nothing is homed.
    pub home: Option<Lead>,
    /// Joints of which it is not known where they are may move: jogging.
    pub unhomed: bool,
    /// Faults in which drives stand are reset before they are enabled.
    pub reset: bool,
    /// Edges that do not come are assumed where the motion towards them ends: something stands in for real drives.
    pub assumes_edges: bool,
    /// The clock that is asked for; none where it follows the driver.
    pub clock: Option<Clock>,
}
