//! Every configuration key: one table, from which unknown keys find their nearest and the reference is written.

/// A key of a configuration file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Key {
    /// Dotted path. A part in angle brackets stands for a name; a last part for anything that a plugin reads, at any depth.
    pub path: &'static str,
    /// Unit, or kind of value where it has none.
    pub unit: &'static str,
    /// Value where the file states none, or `required`.
    pub default: &'static str,
    /// What it means.
    pub meaning: &'static str,
}

const fn key(
    path: &'static str,
    unit: &'static str,
    default: &'static str,
    meaning: &'static str,
) -> Key {
    Key {
        path,
        unit,
        default,
        meaning,
    }
}

#[rustfmt::skip]
static MACHINE: &[Key] = &[
    key("format", "number", "required", "Number of the file format: 1"),
    key("include", "files", "[]", "Files whose keys come first, relative to this file; its own keys override them"),
    key("machine.name", "text", "the file's name", "Name of the machine in reports"),
    key("machine.require_homing", "boolean", "false", "A program is refused where the axes are not homed first (--home)"),
    key("loops.rough_period_ms", "ms", "8", "Period of the rough loop, which plans; a whole multiple of the fine period"),
    key("loops.fine_period_ms", "ms", "1", "Period of the fine loop, which interpolates and talks to the drives"),
    key("loops.max_missed_periods", "count", "2", "Fine periods missed in a row above which a machine that moves faults"),
    key("loops.max_missed_share", "share", "0.01", "Share of the fine periods of a sliding second, missed in motion, above which the machine faults; 1 is no limit"),
    key("loops.fine_hang_after_ms", "ms", "the longer of 2000 and 1000 fine periods", "Time without a fine period on the wall clock after which the process ends"),
    key("loops.soft_hang_after_s", "s", "60", "Time after which any other call of a plugin counts as hung: the process ends"),
    key("loops.fine_core", "number", "the last core allowed", "Core that the fine loop is pinned to on the wall clock"),
    key("loops.fine_priority", "1 to 99", "80", "Priority of the fine loop among SCHED_FIFO threads on the wall clock"),
    key("motion.allowable_speed_difference_mm_per_min", "mm/min", "0", "Velocity step that linear axes accept where blocks meet"),
    key("motion.allowable_speed_difference_deg_per_min", "deg/min", "the same number as for linear axes", "Velocity step that rotary axes accept where blocks meet"),
    key("motion.path_tolerance_mm", "mm", "0.01", "Distance allowed from the programmed path where a block states none"),
    key("motion.time_constant_ms", "ms", "50", "Time constant of acceleration where a block states none"),
    key("motion.time_constant_range_ms", "ms", "the fine period, 1000", "Least and greatest time constant that a program may ask for with TA"),
    key("motion.jerk", "limit or report", "limit", "What max_jerk means to a planner that does not know jerk: refuse to start, or only report"),
    key("motion.max_feed_ratio", "ratio", "1", "Highest feed ratio that may be asked while running; at least 1"),
    key("axes.<axis>.kind", "linear or rotary", "linear", "Whether the axis slides (keys in mm) or turns (keys in deg)"),
    key("axes.<axis>.travel_mm", "mm", "required", "Lowest and highest position of a linear axis"),
    key("axes.<axis>.travel_deg", "deg", "required", "Lowest and highest position of a rotary axis"),
    key("axes.<axis>.start_mm", "mm", "0", "Where a simulated machine stands at power-on"),
    key("axes.<axis>.start_deg", "deg", "0", "Where a simulated machine stands at power-on"),
    key("axes.<axis>.home_mm", "mm", "start", "Reference position, in machine coordinates"),
    key("axes.<axis>.home_deg", "deg", "start", "Reference position, in machine coordinates"),
    key("axes.<axis>.max_feed_mm_per_min", "mm/min", "required", "Highest speed in feed motion"),
    key("axes.<axis>.max_feed_deg_per_min", "deg/min", "required", "Highest speed in feed motion"),
    key("axes.<axis>.max_rapid_mm_per_min", "mm/min", "max_feed", "Highest speed in rapid motion"),
    key("axes.<axis>.max_rapid_deg_per_min", "deg/min", "max_feed", "Highest speed in rapid motion"),
    key("axes.<axis>.max_acceleration_mm_per_s2", "mm/s²", "required", "Highest acceleration"),
    key("axes.<axis>.max_acceleration_deg_per_s2", "deg/s²", "required", "Highest acceleration"),
    key("axes.<axis>.max_jerk_mm_per_s3", "mm/s³", "no limit", "Highest jerk"),
    key("axes.<axis>.max_jerk_deg_per_s3", "deg/s³", "no limit", "Highest jerk"),
    key("axes.<axis>.max_following_error_mm", "mm", "no limit", "Largest distance between command and feedback of a fine period; beyond it the machine faults"),
    key("axes.<axis>.max_following_error_deg", "deg", "no limit", "Largest distance between command and feedback of a fine period; beyond it the machine faults"),
    key("axes.<axis>.unhomed_max_feed_mm_per_min", "mm/min", "the search feed, else max_feed / 10", "Highest speed while it is not known where the axis is"),
    key("axes.<axis>.unhomed_max_feed_deg_per_min", "deg/min", "the search feed, else max_feed / 10", "Highest speed while it is not known where the axis is"),
    key("axes.<axis>.max_skew_mm", "mm", "1", "How far apart the joints of a gantry may stand when their drives are claimed; beyond it the machine is refused"),
    key("axes.<axis>.max_skew_deg", "deg", "1", "How far apart the joints of a gantry may stand when their drives are claimed; beyond it the machine is refused"),
    key("joints.<joint>.axis", "axis", "none", "Axis that the joint moves; two joints on one axis are a gantry. Without it the kinematics alone say what moves it"),
    key("joints.<joint>.kind", "linear or rotary", "linear", "Whether a joint without an axis slides (keys in mm) or turns (keys in deg)"),
    key("joints.<joint>.travel_mm", "mm", "the axis's; without one no end", "Lowest and highest position of a linear joint"),
    key("joints.<joint>.travel_deg", "deg", "the axis's; without one no end", "Lowest and highest position of a rotary joint"),
    key("joints.<joint>.home_mm", "mm", "the axis's; without one 0", "Reference position, in machine coordinates"),
    key("joints.<joint>.home_deg", "deg", "the axis's; without one 0", "Reference position, in machine coordinates"),
    key("joints.<joint>.max_feed_mm_per_min", "mm/min", "the axis's; without one required", "Highest speed in feed motion"),
    key("joints.<joint>.max_feed_deg_per_min", "deg/min", "the axis's; without one required", "Highest speed in feed motion"),
    key("joints.<joint>.max_rapid_mm_per_min", "mm/min", "the axis's; without one max_feed", "Highest speed in rapid motion"),
    key("joints.<joint>.max_rapid_deg_per_min", "deg/min", "the axis's; without one max_feed", "Highest speed in rapid motion"),
    key("joints.<joint>.max_acceleration_mm_per_s2", "mm/s²", "the axis's; without one required", "Highest acceleration"),
    key("joints.<joint>.max_acceleration_deg_per_s2", "deg/s²", "the axis's; without one required", "Highest acceleration"),
    key("joints.<joint>.max_jerk_mm_per_s3", "mm/s³", "the axis's; without one no limit", "Highest jerk"),
    key("joints.<joint>.max_jerk_deg_per_s3", "deg/s³", "the axis's; without one no limit", "Highest jerk"),
    key("joints.<joint>.max_following_error_mm", "mm", "the axis's; without one no limit", "Largest distance between command and feedback"),
    key("joints.<joint>.max_following_error_deg", "deg", "the axis's; without one no limit", "Largest distance between command and feedback"),
    key("kinematics.plugin", "name or file", "identity", "Map between axes and joints"),
    key("kinematics.options.<option>", "plugin's", "none", "Options of the kinematics"),
    key("planner.plugin", "name or file", "required", "A built-in's name, or the path of a shared library"),
    key("planner.options.<option>", "plugin's", "none", "Options of the planner"),
    key("feed_strategy.plugin", "name or file", "required", "Feed strategy; without the table there is none"),
    key("feed_strategy.options.<option>", "plugin's", "none", "Options of the feed strategy"),
    key("driver.plugin", "name or file", "required", "Driver of the drives, simulated or not"),
    key("driver.options.<option>", "plugin's", "none", "Options of the driver"),
    key("driver.stand_in.plugin", "plugin", "ideal drives", "Driver that stands in for one with real drives where nothing may move: estimate, calibrate"),
    key("driver.stand_in.options.<option>", "plugin's", "none", "Options of the driver that stands in"),
    key("driver.analog", "names", "[]", "Names of the driver's analog inputs from 0 on, at most 4: signals of trace and report"),
    key("outputs.<name>.output", "number", "required", "Number of the digital output that is called so, 0 to 61"),
    key("outputs.<name>.on_fault", "off or keep", "off", "What an emergency stop does with the output at once, and a fault when the axes are at rest"),
    key("inputs.<name>.input", "number", "required", "Number of the digital input that is called so, 0 to 63"),
    key("inputs.<name>.role", "word", "none", "emergency-stop, drives-ready, door, feed-hold, limit, home, probe: what it does where it trips"),
    key("inputs.<name>.normally_closed", "boolean", "true", "The input is 1 as long as nothing trips it; false: it is 0"),
    key("inputs.<name>.max_age_ms", "ms", "10", "Age above which an input with a role counts as tripped"),
    key("drivers.<driver>.plugin", "name or file", "required", "One driver of several: each has a part of the machine. Instead of [driver], which has all of it"),
    key("drivers.<driver>.options.<option>", "plugin's", "none", "Options of the driver"),
    key("drivers.<driver>.joints", "names", "[]", "Joints that it moves; a joint that is an axis is called as its axis is. The first one is the driver's joint 0"),
    key("drivers.<driver>.inputs", "numbers", "[]", "Digital inputs that it has, 0 to 63. The first one is the driver's input 0"),
    key("drivers.<driver>.outputs", "numbers", "[]", "Digital outputs that it has, 0 to 63; 62 is mist, 63 flood coolant. The first one is the driver's output 0"),
    key("drivers.<driver>.analog", "numbers", "[]", "Analog inputs that it has, 0 to 3. The first one is the driver's analog input 0"),
    key("drivers.<driver>.spindle", "boolean", "false", "It turns the spindle"),
    key("drivers.<driver>.stand_in.plugin", "plugin", "ideal drives", "Driver that stands in for one with real drives where nothing may move: estimate, calibrate"),
    key("drivers.<driver>.stand_in.options.<option>", "plugin's", "none", "Options of the driver that stands in"),
    key("analog.<analog>.input", "number", "required", "Analog input that has this name, 0 to 3: a signal of trace and report"),
    key("analog.<analog>.unit", "text", "none", "Unit of its values: stands behind the name of the signal"),
    key("faults.<fault>", "wrapper's", "none", "Seeded faults around the driver"),
    key("guard.mode", "stop or count", "stop", "What a sample beyond a limit does: stops the machine, or is counted (simulated drives only)"),
    key("recorder.on_error", "continue or hold", "continue", "Whether the motion goes on or comes to rest where a file of the run cannot be written: a full disk"),
    key("policy.script", "file", "required", "Policy script, a WASM module; without the table there is none"),
    key("policy.fuel_per_call", "instructions", "20000", "Instructions that one call of the script may use; a window of blocks may use more"),
    key("policy.fuel_per_block", "instructions", "1000", "Instructions for each block of a window, on top"),
    key("policy.memory_pages", "pages of 64 KiB", "32", "Memory that the script may use"),
    key("policy.time_constant_ms", "ms", "[1, 1000]", "Shortest and longest time constant that the script may ask for"),
    key("policy.path_tolerance_mm", "mm", "up to the one in force", "Smallest and largest path tolerance that the script may ask for"),
    key("policy.lowest_feed_ratio", "ratio", "0.05", "Share of the programmed feed below which the script cannot go, by cap, by ratio or by both"),
    key("policy.ratio_change_per_s", "1/s", "10", "How fast the script may change the feed ratio"),
    key("policy.parameters.<parameter>", "script's", "none", "Parameters of the policy script"),
    key("spindle.at_speed_within_s", "s", "30", "Time for which a cut waits for the spindle; 0.1 to 600"),
    key("spindle.max_rpm", "rpm", "no limit", "Highest spindle speed"),
    key("spindle.min_rpm", "rpm", "0", "Lowest spindle speed that turns"),
    key("probe.input", "number", "required", "Digital input of the probe, 0 to 63; without the table there is no probe"),
    key("probe.invert", "boolean", "false", "The input is 0 where the probe touches"),
    key("operator.dry_run_feed_mm_per_min", "mm/min", "the programmed feed", "Feed of all feed motion in a dry run"),
    key("homing.<axis>.max_torque_percent", "% of the rated torque", "the drive's own limit", "Torque that the drive keeps to while the axis is homed, up to 300"),
    key("homing.<axis>.sequence", "number", "in the order of the axes", "Axes home one after the other, the lowest number first; those with the same number together"),
    key("homing.<axis>.input", "number", "required", "Digital input of the home switch, 0 to 63"),
    key("homing.<axis>.invert", "boolean", "false", "The input is 0 on the switch"),
    key("homing.<axis>.search_mm_per_min", "mm/min", "required", "Velocity towards the switch; its sign is the direction"),
    key("homing.<axis>.latch_mm_per_min", "mm/min", "required", "Feed at which the position of the switch is taken"),
    key("homing.<axis>.back_off_mm", "mm", "required", "How far the axis backs off before that"),
    key("homing.<axis>.switch_mm", "mm", "required", "Machine coordinate of the edge of the switch"),
    key("homing.<axis>.search_deg_per_min", "deg/min", "required", "Velocity towards the switch; its sign is the direction"),
    key("homing.<axis>.latch_deg_per_min", "deg/min", "required", "Feed at which the position of the switch is taken"),
    key("homing.<axis>.back_off_deg", "deg", "required", "How far the axis backs off before that"),
    key("homing.<axis>.switch_deg", "deg", "required", "Machine coordinate of the edge of the switch"),
    key("homing.<axis>.index_input", "number", "none", "Digital input that is 1 at an index pulse, 0 to 63: the first one behind the edge of the switch counts instead of it"),
    key("homing.<axis>.index_mm", "mm", "required with index_input", "Machine coordinate of that pulse"),
    key("homing.<axis>.index_within_mm", "mm", "required with index_input", "How far behind the edge of the switch it comes at most"),
    key("homing.<axis>.index_deg", "deg", "required with index_input", "Machine coordinate of that pulse"),
    key("homing.<axis>.index_within_deg", "deg", "required with index_input", "How far behind the edge of the switch it comes at most"),
    key("homing.<axis>.drive_method", "number", "none", "CiA 402 method, 1 to 127, by which the drive homes the axis by itself, instead of a switch"),
    key("homing.<axis>.drive_within_s", "s", "one minute", "Time that the drive has for its homing"),
    key("operator.jog_keep_alive_ms", "ms", "200", "Time without a keep-alive, as key repeats are, after which a jog stops"),
    key("tools.table", "file", "required", "Tool table; without it there are no tools"),
    key("tools.without_table", "text", "none", "zero: instead of `table`, every tool has length zero; simulated drives do so without it"),
    key("tools.change", "text", "ask", "How M6 changes tools: ask, whoever operates the machine; sub:NAME, the subroutine `o<NAME>` of `program.subroutine_path`, with the number of the tool as #1 and that of the one in the spindle as #2"),
    key("tools.retract_z_mm", "mm", "none", "Machine coordinate of Z up to which M6 takes the tool by a rapid before it is changed"),
    key("program.subroutine_path", "file", "none", "Folder of files that O-word calls look up: `o<name> call` runs `name.ngc`"),
    key("program.max_steps", "number", "50000000", "Lines that a program with O-words may execute in the check"),
    key("user_commands.<command>", "file", "none", "Program that the word runs at rest, M100 to M199, with the values of P and Q as its arguments; nothing is run that is not listed"),
    key("user_commands.time_limit_s", "s", "60", "Time that such a program has; then it is ended, and the run faults"),
];

#[rustfmt::skip]
static TOOLS: &[Key] = &[
    key("format", "number", "1", "Number of the file format: 1"),
    key("tool.number", "number", "required", "Number by which T calls the tool"),
    key("tool.pocket", "number", "the tool's number", "Pocket of the magazine"),
    key("tool.name", "text", "none", "What people call the tool"),
    key("tool.diameter_mm", "mm", "0", "Diameter of the tool"),
    key("tool.length_mm", "mm", "0", "Length offset along z; short for offset_mm.z"),
    key("tool.offset_mm.<axis>", "mm", "0", "Offset along a linear axis"),
    key("tool.offset_deg.<axis>", "deg", "0", "Offset about a rotary axis"),
];

/// Every key of `machine.toml`.
pub fn keys() -> &'static [Key] {
    MACHINE
}

/// Every key of a tool table.
pub fn tool_keys() -> &'static [Key] {
    TOOLS
}

/// Whether a part of a key's path stands for names that the file chooses.
pub fn is_placeholder(part: &str) -> bool {
    part.starts_with('<')
}

/// Last parts of a key's path that stand for whatever a plugin, script or wrapper reads.
const OPEN: [&str; 3] = ["<option>", "<parameter>", "<fault>"];

/// Whether a key's path ends in something that a plugin or script reads.
pub fn is_open(pattern: &str) -> bool {
    OPEN.iter().any(|open| pattern.ends_with(open))
}

/// Whether a path begins like a key's path, over the shorter of the two.
pub fn agree(pattern: &str, path: &[&str]) -> bool {
    pattern
        .split('.')
        .zip(path)
        .all(|(pattern, part)| is_placeholder(pattern) || pattern == *part)
}

/// The reference of both files as Markdown tables.
pub fn markdown() -> String {
    format!(
        "## machine.toml\n\n{}\n## Tool table\n\n{}",
        table(MACHINE),
        table(TOOLS)
    )
}

fn table(keys: &[Key]) -> String {
    let row = |k: &Key| {
        format!(
            "| `{}` | {} | {} | {} |\n",
            k.path, k.unit, k.default, k.meaning
        )
    };
    let rows: String = keys.iter().map(row).collect();
    format!("| key | unit | default | meaning |\n|---|---|---|---|\n{rows}")
}
