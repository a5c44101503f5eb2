//! What the judge prints: calls of the canonical machine, with the offsets that it leaves to the machine.

use std::fs::File;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

use super::compare::Move;

/// What is said of a program that the judge does not end: some loops within repeats in subroutines keep it going for ever.
pub const NEVER_ENDS: &str = "the judge does not end";
const NO_END: &str = "File ended with no percent sign";
/// Processor time after which a program is taken to have no end, in hundredths of a second: a busy computer makes none endless.
const GIVE_UP_TICKS: u64 = 300;
/// Without a configuration its tool table is in inches.
const INCH_MM: f64 = 25.4;

/// What the judge is given besides the program.
pub struct Tables {
    tools: String,
}

impl Tables {
    /// Tools by number, length and diameter, mm.
    pub fn of_tools(tools: &[(u32, f64, f64)]) -> Self {
        let row = |(number, length, diameter): &(u32, f64, f64)| {
            format!(
                "T{number} P{number} Z{:.12} D{:.12}\n",
                length / INCH_MM,
                diameter / INCH_MM
            )
        };
        Self {
            tools: tools.iter().map(row).collect(),
        }
    }
}

/// The offsets of the canonical machine, program units.
#[derive(Default)]
struct Machine {
    unit_mm: f64,
    origin: [f64; 3],
    g92: [f64; 3],
    tool: [f64; 3],
    rotation_deg: f64,
    plane: usize,
    at: [f64; 3],
}

impl Machine {
    /// G92 first, then the rotation, then the coordinate system and the tool.
    fn position(&self, program: &[f64]) -> [f64; 3] {
        let mut at = [0, 1, 2].map(|axis| program[axis] + self.g92[axis]);
        let (sin, cos) = self.rotation_deg.to_radians().sin_cos();
        (at[0], at[1]) = (at[0] * cos - at[1] * sin, at[0] * sin + at[1] * cos);
        [0, 1, 2].map(|axis| (at[axis] + self.origin[axis] + self.tool[axis]) * self.unit_mm)
    }

    fn arc(&self, numbers: &[f64]) -> Move {
        // Ends and centres in the plane: XY, YZ or ZX.
        let axes = [[0, 1, 2], [1, 2, 0], [2, 0, 1]][self.plane];
        let place = |first: f64, second: f64| {
            let mut point = [0.0; 3];
            (point[axes[0]], point[axes[1]], point[axes[2]]) = (first, second, numbers[5]);
            self.position(&point)
        };
        let end = place(numbers[0], numbers[1]);
        let center = place(numbers[2], numbers[3]);
        let from = |point: [f64; 3]| {
            [
                center[axes[0]] - point[axes[0]],
                center[axes[1]] - point[axes[1]],
            ]
        };
        let radius = |point| {
            let [a, b] = from(point);
            a.hypot(b)
        };
        let (chord, sum) = (
            (end[axes[0]] - self.at[axes[0]]).hypot(end[axes[1]] - self.at[axes[1]]),
            radius(self.at) + radius(end),
        );
        let moves = if chord > 0.0 {
            (radius(self.at) - radius(end)).abs() * sum / 2.0 / chord
        } else {
            0.0
        };
        // The order of this interpreter's planes: XY, YZ, ZX.
        Move::Arc(end, from(end), moves)
    }
}

/// What the judge says of a program.
/// What it writes, it writes in `folder`.
pub fn judged(
    judge: &Path,
    program: &Path,
    folder: &Path,
    tables: &Tables,
) -> Result<Vec<Move>, String> {
    let tools = folder.join("tools.tbl");
    let variables = folder.join("variables.var");
    std::fs::write(&tools, &tables.tools).unwrap();
    std::fs::write(&variables, "").unwrap();
    let mut command = Command::new(judge);
    command
        .arg("-t")
        .arg(&tools)
        .arg("-v")
        .arg(&variables)
        .arg("-g")
        .arg(program);
    // Its tool table is a file in the home folder, which runs side by side would share.
    // Files of subroutines are looked up where it stands.
    let stands = program.parent().unwrap_or(folder);
    command
        .env("HOME", folder)
        .current_dir(stands)
        .stdin(Stdio::null());
    let [calls, messages] = ["calls.txt", "messages.txt"].map(|name| folder.join(name));
    command
        .stdout(File::create(&calls).unwrap())
        .stderr(File::create(&messages).unwrap());
    let mut running = command.spawn().map_err(|e| e.to_string())?;
    while running.try_wait().map_err(|e| e.to_string())?.is_none() {
        if ticks_used(running.id()) > GIVE_UP_TICKS {
            running
                .kill()
                .and_then(|()| running.wait())
                .map_err(|e| e.to_string())?;
            return Err(NEVER_ENDS.to_owned());
        }
        std::thread::sleep(Duration::from_millis(2));
    }
    let text = |path| String::from_utf8_lossy(&std::fs::read(path).unwrap()).into_owned();
    let calls = text(&calls);
    let messages = text(&messages);
    // Its first line is a greeting. It says nothing of a `%` that ends the program; here the end of the text ends it too.
    let told = messages.lines().skip(1).collect::<Vec<_>>().join(" | ");
    if !calls.contains("PROGRAM_END") && !told.is_empty() && !told.contains(NO_END) {
        return Err(told);
    }
    Ok(read(&calls))
}

/// What a process has used of its processors, user time, as the kernel counts it.
fn ticks_used(process: u32) -> u64 {
    let stat = std::fs::read_to_string(format!("/proc/{process}/stat")).unwrap_or_default();
    // The name, which may hold anything, stands in parentheses before.
    let behind_name = stat.rsplit_once(')').map_or("", |(_, behind)| behind);
    let user = behind_name.split_whitespace().nth(11);
    user.and_then(|ticks| ticks.parse().ok()).unwrap_or(0)
}

/// The call of a line: behind its number stands that of the line of the program, as long as it may be: `12 N100110STRAIGHT_FEED(…)`.
fn name(line: &str) -> Option<&str> {
    let (before, _) = line.split_once('(')?;
    let behind = before.trim_start_matches(|c: char| c.is_ascii_digit() || c == ' ');
    let number = |c: char| c.is_ascii_digit() || matches!(c, ' ' | '.');
    Some(behind.strip_prefix('N')?.trim_start_matches(number))
}

fn read(text: &str) -> Vec<Move> {
    let mut machine = Machine {
        unit_mm: 1.0,
        ..Machine::default()
    };
    let mut moves = Vec::new();
    for line in text.lines() {
        let Some(name) = name(line) else {
            continue;
        };
        let inside = line
            .split_once('(')
            .map_or("", |(_, inside)| inside)
            .trim_end_matches(')');
        let numbers: Vec<f64> = inside
            .split([',', ' '])
            .filter_map(|n| n.parse().ok())
            .collect();
        match name {
            "STRAIGHT_TRAVERSE" => moves.push(Move::Rapid(machine.position(&numbers))),
            "STRAIGHT_FEED" => moves.push(Move::Line(machine.position(&numbers))),
            "ARC_FEED" => moves.push(machine.arc(&numbers)),
            "DWELL" => moves.push(Move::Dwell(numbers[0])),
            "SET_G5X_OFFSET" => machine.origin = [numbers[1], numbers[2], numbers[3]],
            "SET_G92_OFFSET" => machine.g92 = [numbers[0], numbers[1], numbers[2]],
            "SET_XY_ROTATION" => machine.rotation_deg = numbers[0],
            "USE_TOOL_LENGTH_OFFSET" => machine.tool = [numbers[0], numbers[1], numbers[2]],
            "USE_LENGTH_UNITS" => {
                machine.unit_mm = if inside.contains("INCHES") { 25.4 } else { 1.0 }
            }
            "SELECT_PLANE" => {
                machine.plane = ["XY", "YZ", "XZ"]
                    .iter()
                    .position(|plane| inside.contains(plane))
                    .unwrap_or(0);
            }
            _ => {}
        }
        let last = moves.last().and_then(Move::end);
        machine.at = last.unwrap_or(machine.at);
    }
    moves
}
