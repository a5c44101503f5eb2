//! `[driver]` and `[drivers.*]`: who talks to the drives, and what of the machine each of them has.

use std::collections::BTreeMap;

use tandem_sdk::MAX_ANALOG;

use crate::joints::Joint;
use crate::node::Node;
use crate::parts::PluginChoice;
use crate::probe::LAST_INPUT;
use crate::section::Section;
use crate::shown::shorten;

/// A driver that the machine asks for.
#[derive(Clone, Debug, PartialEq)]
pub struct DriverChoice {
    /// Its name in `[drivers.<name>]`; none for `[driver]`.
    pub name: Option<String>,
    /// The plugin.
    pub choice: PluginChoice,
    /// What stands in for it where nothing may move, such as in an estimate.
    pub stand_in: Option<PluginChoice>,
    /// What it has of the machine; none where it has everything.
    pub owns: Option<Owned>,
    /// Inputs of the machine, a bit each, that are 1 whatever it says. No file states it: ideal drives that stand in for real ones
    /// have nothing wired to them, and what is 1 as long as nothing trips it is so there.
    pub inputs_at_rest: u64,
}

/// What one of several drivers has of the machine, in the driver's own order: its joint 0 is the first of `joints`, its input 0
/// the first of `inputs`, and so on.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Owned {
    /// Names of joints; of axes, where a joint is an axis.
    pub joints: Vec<String>,
    /// Numbers of digital inputs, 0 to 63.
    pub inputs: Vec<u32>,
    /// Numbers of digital outputs, 0 to 63; 62 is mist, 63 flood coolant.
    pub outputs: Vec<u32>,
    /// Numbers of analog inputs, 0 to 3.
    pub analog: Vec<u32>,
    /// Whether the spindle is its.
    pub spindle: bool,
}

impl DriverChoice {
    /// The dotted path of its table.
    pub fn section(&self) -> String {
        self.name
            .as_ref()
            .map_or_else(|| "driver".to_owned(), |name| format!("drivers.{name}"))
    }

    /// What people call it: its plugin, behind its name where it has one.
    pub fn title(&self) -> String {
        match &self.name {
            Some(name) => format!("{name} ({})", self.choice.plugin),
            None => self.choice.plugin.clone(),
        }
    }

    /// Reads `[driver]`; `None` where it is wrong, which is reported.
    fn read_one(section: &Section<'_>) -> Option<Self> {
        let stand_in = stand_in(section);
        let choice = PluginChoice::read(section)?;
        Some(Self {
            name: None,
            choice,
            stand_in,
            owns: None,
            inputs_at_rest: 0,
        })
    }

    /// Reads `[drivers.<name>]`; `None` where it is wrong, which is reported.
    fn read_named(section: &Section<'_>, name: &str) -> Option<Self> {
        let numbers = |key, last| numbers(section, key, last);
        let owns = Owned {
            joints: list(section, "joints", "names of joints", |node| {
                node.text().map(str::to_owned)
            }),
            inputs: numbers("inputs", LAST_INPUT),
            outputs: numbers("outputs", LAST_INPUT),
            analog: numbers("analog", MAX_ANALOG as u32 - 1),
            spindle: section.truth("spindle").unwrap_or(false),
        };
        let stand_in = stand_in(section);
        let choice = PluginChoice::read(section)?;
        Some(Self {
            name: Some(name.to_owned()),
            choice,
            stand_in,
            owns: Some(owns),
            inputs_at_rest: 0,
        })
    }
}

/// Reads `stand_in` of a driver's table; `None` where there is none, or where it is wrong, which is reported.
fn stand_in(section: &Section<'_>) -> Option<PluginChoice> {
    let stand_in = section.section("stand_in");
    if stand_in.exists() {
        PluginChoice::read(&stand_in)
    } else {
        None
    }
}

/// Reads `[driver]`, or else all of `[drivers.*]`. What is wrong is reported; there is one driver at least in any case.
pub(crate) fn read(root: &Section<'_>) -> Vec<DriverChoice> {
    let (one, several) = (root.section("driver"), root.section("drivers"));
    let nothing = || {
        let choice = PluginChoice::named("");
        DriverChoice {
            name: None,
            choice,
            stand_in: None,
            owns: None,
            inputs_at_rest: 0,
        }
    };
    if !root.has("drivers") {
        return vec![DriverChoice::read_one(&one).unwrap_or_else(nothing)];
    }
    let named = several
        .keys()
        .filter_map(|name| DriverChoice::read_named(&several.section(name), name));
    let mut all: Vec<_> = named.collect();
    if root.has("driver") {
        several
            .refuse_whole("[driver] has the whole machine: it stands alone, or each driver is one of [drivers.<name>]");
    } else if several.keys().next().is_none() && !several.is_broken() {
        several.refuse_whole("missing: a machine has at least one driver");
    }
    if all.is_empty() {
        all.push(nothing());
    }
    all
}

/// Names of what drivers may own, and of what must be owned.
pub(crate) struct Wanted<'a> {
    /// Names of all joints, and the table that each comes from.
    pub joints: Vec<(String, String)>,
    /// Inputs that some table reads, with that table.
    pub inputs: Vec<(u32, String)>,
    /// Outputs that some table names, with that table.
    pub outputs: Vec<(u32, String)>,
    /// Analog inputs that have a name, with their table.
    pub analog: Vec<(u32, String)>,
    /// The root of the file.
    pub root: &'a Section<'a>,
}

impl Wanted<'_> {
    /// Reports what no driver of `[drivers.*]` has, and what two have. A `[driver]` has everything.
    pub fn check(&self, drivers: &[DriverChoice]) {
        if drivers.iter().any(|driver| driver.owns.is_none()) {
            return;
        }
        let all = self.root.section("drivers");
        let names: Vec<_> = drivers
            .iter()
            .filter_map(|driver| driver.name.as_deref())
            .collect();
        let names = names.join(", ");
        let known: Vec<_> = self.joints.iter().map(|(name, _)| name.as_str()).collect();
        let joints = owners(&all, "joints", |node| node.text().map(str::to_owned));
        for (joint, owner) in joints
            .iter()
            .filter(|(joint, _)| !known.contains(&joint.as_str()))
        {
            let cause = format!(
                "no joint is called \"{}\"; the machine has {}",
                shorten(joint),
                known.join(", ")
            );
            owner.refuse(cause);
        }
        let whole = |node: &Node| node.whole();
        let of = |key| owners(&all, key, whole);
        let inputs = self.inputs.iter().map(|(n, table)| (*n, table.as_str()));
        let outputs = self.outputs.iter().map(|(n, table)| (*n, table.as_str()));
        let analog = self.analog.iter().map(|(n, table)| (*n, table.as_str()));
        self.unowned(
            "joint",
            &joints,
            self.joints
                .iter()
                .map(|(name, table)| (name.clone(), table.as_str())),
            &names,
        );
        self.unowned("input", &of("inputs"), inputs, &names);
        self.unowned("output", &of("outputs"), outputs, &names);
        self.unowned("analog input", &of("analog"), analog, &names);
        self.check_spindle(&all, drivers, &names);
    }

    /// Reports each of `wanted` that nobody has.
    fn unowned<'w, T: Ord + std::fmt::Display>(
        &self,
        what: &str,
        owned: &BTreeMap<T, Owner<'_>>,
        wanted: impl Iterator<Item = (T, &'w str)>,
        names: &str,
    ) {
        for (one, table) in wanted.filter(|(one, _)| !owned.contains_key(one)) {
            let words = format!(
                "no driver has {what} {one}: it is in no list of [drivers.*], which are {names}"
            );
            self.root.refuse_dotted(table, words);
        }
    }

    fn check_spindle(&self, all: &Section<'_>, drivers: &[DriverChoice], names: &str) {
        let spindle =
            |driver: &&DriverChoice| driver.owns.as_ref().is_some_and(|owns| owns.spindle);
        let mut owners = drivers
            .iter()
            .filter(spindle)
            .filter_map(|driver| driver.name.as_deref());
        let Some(first) = owners.next() else {
            if self.root.has("spindle") {
                let words = format!(
                    "no driver has the spindle: none of [drivers.*], which are {names}, says spindle = true"
                );
                self.root.refuse("spindle", words);
            }
            return;
        };
        for second in owners {
            let place = all.section(first).place("spindle");
            let words = format!("the spindle is that of drivers.{first} already ({place})");
            all.section(second).refuse("spindle", words);
        }
    }
}

/// Who has something, and where that is written.
struct Owner<'a> {
    section: Section<'a>,
    driver: &'a str,
    key: &'static str,
    node: &'a Node,
}

impl Owner<'_> {
    fn refuse(&self, words: String) {
        self.section.refuse_node(self.key, self.node, words);
    }
}

/// Who has each of what the lists `key` of all drivers name; what two have is reported.
fn owners<'a, T: Ord + std::fmt::Display>(
    all: &Section<'a>,
    key: &'static str,
    read: impl Fn(&Node) -> Option<T>,
) -> BTreeMap<T, Owner<'a>> {
    let mut owned: BTreeMap<T, Owner<'a>> = BTreeMap::new();
    for driver in all.keys() {
        let section = all.section(driver);
        for node in section.right(key).and_then(Node::array).unwrap_or_default() {
            let Some(one) = read(node) else { continue };
            match owned.get(&one) {
                Some(first) => {
                    let (place, first) = (section.place_of(first.node), first.driver);
                    let words = format!(
                        "{} is that of drivers.{first} already ({place})",
                        shorten(&one.to_string())
                    );
                    section.refuse_node(key, node, words);
                }
                None => {
                    _ = owned.insert(
                        one,
                        Owner {
                            section: section.clone(),
                            driver,
                            key,
                            node,
                        },
                    );
                }
            }
        }
    }
    owned
}

/// The names of the joints that drives move, each with its table: those that the file states, and an axis without one is its own
/// joint, but for machines whose kinematics say what the joints are.
pub(crate) fn joint_names(
    axes: &[String],
    joints: &[Joint],
    identity: bool,
) -> Vec<(String, String)> {
    let stated = joints
        .iter()
        .map(|joint| (joint.name.clone(), format!("joints.{}", joint.name)));
    let lone = |axis: &usize| identity && !joints.iter().any(|joint| joint.axis == Some(*axis));
    let alone = (0..axes.len())
        .filter(lone)
        .map(|axis| (axes[axis].clone(), format!("axes.{}", axes[axis])));
    stated.chain(alone).collect()
}

/// The list `key`, each entry read by `read`; none where one of them is wrong, which is reported.
fn list<T>(
    section: &Section<'_>,
    key: &str,
    what: &str,
    read: impl Fn(&Node) -> Option<T>,
) -> Vec<T> {
    let Some(node) = section.right(key) else {
        return vec![];
    };
    let read: Option<Vec<T>> = node
        .array()
        .and_then(|nodes| nodes.iter().map(read).collect());
    read.unwrap_or_else(|| {
        section.refuse(key, format!("must be an array of {what}"));
        vec![]
    })
}

fn numbers(section: &Section<'_>, key: &str, last: u32) -> Vec<u32> {
    let fits = |node: &Node| node.whole().filter(|number| *number <= last);
    list(section, key, &format!("numbers from 0 to {last}"), fits)
}
