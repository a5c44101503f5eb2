//! The tool table.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use tandem_sdk::{Axes, AxisVector};

use crate::joints::{index, letters};
use crate::keys::tool_keys;
use crate::load::{Loader, Named};
use crate::node::{Node, Table};
use crate::problems::{Origin, Problems};
use crate::schema::check;
use crate::section::Section;
use crate::shown::shorten;

/// A tool.
#[derive(Clone, Debug, PartialEq)]
pub struct Tool {
    /// Number by which T calls it; never 0, which is no tool.
    pub number: u32,
    /// Pocket of the magazine.
    pub pocket: u32,
    /// What people call it; may be empty.
    pub name: String,
    /// Diameter, mm; 0 where none is stated.
    pub diameter_mm: f64,
    /// Offset per axis, mm or rad.
    pub offset: AxisVector,
}

/// The tools of a machine.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ToolTable {
    /// The file they were read from, if there is one.
    pub path: Option<PathBuf>,
    /// The tools, in the order of the file.
    pub tools: Vec<Tool>,
    /// There is no file, and the machine says that every tool has length zero then.
    pub zero_without_table: bool,
    /// The subroutine that changes tools; none where whoever operates the machine does.
    pub change_sub: Option<String>,
    /// Machine coordinate of Z up to which the tool is taken before a change, mm.
    pub retract_z_mm: Option<f64>,
}

impl ToolTable {
    /// The tool called by T`number`.
    pub fn get(&self, number: u32) -> Option<&Tool> {
        self.tools.iter().find(|tool| tool.number == number)
    }

    /// Reads `[tools]` and the file that it names; what is wrong is reported and left out.
    pub(crate) fn read(tools: &Section<'_>, axes: &Axes, problems: &Problems) -> Option<Self> {
        let zero = tools.choice("without_table", &[("zero", true)]);
        let change_sub = change_sub(tools);
        let retract_z_mm = retract_z_mm(tools, axes);
        // How tools are changed is no table: what is said of machines without one holds.
        let without = ["change", "retract_z_mm"].iter().any(|key| tools.has(key));
        if (zero.is_some() || without) && !tools.has("table") {
            return Some(Self {
                zero_without_table: zero.is_some(),
                change_sub,
                retract_z_mm,
                ..Self::default()
            });
        }
        let path = tools.required("table", Section::text).map(PathBuf::from)?;
        let from = Named {
            origin: tools.node("table")?.origin,
            key: "tools.table",
        };
        let tools = read_file(&path, from, axes, problems)?;
        Some(Self {
            path: Some(path),
            tools,
            zero_without_table: false,
            change_sub,
            retract_z_mm,
        })
    }
}

/// The name of the subroutine that changes tools: that of its file.
fn change_sub(tools: &Section<'_>) -> Option<String> {
    let text = tools.text("change")?;
    if text == "ask" {
        return None;
    }
    let fits = |c: char| c.is_ascii_alphanumeric() || matches!(c, '_' | '-');
    let name = text.strip_prefix("sub:").unwrap_or_default();
    if name.is_empty() || !name.chars().all(fits) {
        tools.refuse(
            "change",
            format!("must be ask, or sub: and a name of letters, digits, _ and -, not {text}"),
        );
        return None;
    }
    Some(name.to_ascii_lowercase())
}

fn retract_z_mm(tools: &Section<'_>, axes: &Axes) -> Option<f64> {
    let up_mm = tools.number("retract_z_mm")?;
    let z = (0..axes.count()).find(|axis| axes.letter(*axis).eq_ignore_ascii_case(&'Z'));
    if z.is_none_or(|axis| axes.is_rotary(axis)) {
        tools.refuse("retract_z_mm", "the machine has no linear axis z");
        return None;
    }
    Some(up_mm)
}

fn read_file(path: &Path, from: Named, axes: &Axes, problems: &Problems) -> Option<Vec<Tool>> {
    let mut root = Loader::new(problems).tools(path, from)?;
    let list = root.remove("tool");
    check(tool_keys(), &mut Vec::new(), &root, problems);
    let Some(list) = list else {
        return Some(Vec::new());
    };
    let Some(nodes) = list.array() else {
        problems.report(list.origin, "tool", "every tool is written as [[tool]]");
        return None;
    };
    let mut numbers = BTreeSet::new();
    let tools = nodes
        .iter()
        .filter_map(|node| entry(node, axes, &mut numbers, problems));
    Some(tools.collect())
}

fn entry(
    node: &Node,
    axes: &Axes,
    numbers: &mut BTreeSet<u32>,
    problems: &Problems,
) -> Option<Tool> {
    let Some(table) = node.table() else {
        problems.report(
            node.origin,
            "tool",
            format!("must be a table, not {}", node.kind()),
        );
        return None;
    };
    let tool = tool(node.origin, table, axes, problems)?;
    if !numbers.insert(tool.number) {
        let section = Section::new(vec!["tool".to_owned()], node.origin, table, problems);
        section.refuse("number", format!("tool {} is listed twice", tool.number));
    }
    Some(tool)
}

fn tool(origin: Origin, table: &Table, axes: &Axes, problems: &Problems) -> Option<Tool> {
    check(tool_keys(), &mut vec!["tool"], table, problems);
    let section = Section::new(vec!["tool".to_owned()], origin, table, problems);
    let number = section.required("number", |s, key| s.whole(key, 1, u32::MAX));
    let pocket = section.whole("pocket", 0, u32::MAX).or(number);
    let mut offset = AxisVector::ZERO;
    offsets(&section, "offset_mm", false, axes, &mut offset);
    offsets(&section, "offset_deg", true, axes, &mut offset);
    length(&section, axes, &mut offset);
    Some(Tool {
        number: number?,
        pocket: pocket?,
        name: section.text("name").unwrap_or_default().to_owned(),
        diameter_mm: section.at_least("diameter_mm", 0.0).unwrap_or(0.0),
        offset,
    })
}

fn offsets(tool: &Section<'_>, key: &str, rotary: bool, axes: &Axes, offset: &mut AxisVector) {
    let section = tool.section(key);
    for name in section.keys() {
        let Some(value) = section.number(name) else {
            continue;
        };
        match index(axes, name) {
            Some(axis) if axes.is_rotary(axis) == rotary => {
                offset[axis] = if rotary { value.to_radians() } else { value };
            }
            Some(_) if rotary => {
                section.refuse(name, "a linear axis is in mm; did you mean `offset_mm`?");
            }
            Some(_) => section.refuse(
                name,
                "a rotary axis is in degrees; did you mean `offset_deg`?",
            ),
            None => {
                section.refuse(
                    name,
                    format!(
                        "no axis is called \"{}\"; the machine has {}",
                        shorten(name),
                        letters(axes)
                    ),
                );
            }
        }
    }
}

/// The length is another name of the offset along z.
fn length(tool: &Section<'_>, axes: &Axes, offset: &mut AxisVector) {
    let Some(length) = tool.number("length_mm") else {
        return;
    };
    match axes.index('Z').filter(|z| !axes.is_rotary(*z)) {
        Some(_) if tool.section("offset_mm").has("z") => {
            tool.refuse(
                "length_mm",
                "the offset along z is stated twice: offset_mm.z is the same",
            );
        }
        Some(z) => offset[z] = length,
        None => tool.refuse(
            "length_mm",
            "the machine has no linear axis z; did you mean `offset_mm`?",
        ),
    }
}
