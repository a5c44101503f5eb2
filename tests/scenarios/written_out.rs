//! A program with calls, loops, branches and words that change nothing is driven like its moves written out, sample for sample.

use std::fmt::Write;

use crate::bench::Bench;
use crate::random::{Random, program};
use crate::replay::for_each_seed;

const PLANNERS: [&str; 5] = [
    "look-ahead",
    "smooth",
    "block-overlap",
    "after-interpolation",
    "nurbs",
];
/// Lines that change nothing where nothing is switched on.
const WORDS: [&str; 8] = [
    "M9",
    "G90 G21",
    "(a comment)",
    "#33 = [#33 + 1]",
    "M5",
    "N7",
    "M48",
    "G40 G49 G54",
];
/// Numbers of the subprograms, apart from all other labels.
const FIRST_SUBPROGRAM: u32 = 5000;

/// Moves that become calls and blocks.
struct Structured {
    random: Random,
    labels: u32,
    subs: String,
    subprograms: String,
}

impl Structured {
    /// The same moves as `text`.
    fn of(text: &str, seed: u64) -> String {
        let mut this = Self {
            random: Random::new(seed | 1 << 41),
            labels: 0,
            subs: String::new(),
            subprograms: String::new(),
        };
        let lines: Vec<_> = text.lines().filter(|line| *line != "M2").collect();
        let body = this.block(&lines, 0);
        format!("{}{body}M2\n{}", this.subs, this.subprograms)
    }

    fn block(&mut self, lines: &[&str], depth: u32) -> String {
        let mut text = String::new();
        let mut rest = lines;
        while !rest.is_empty() {
            let most = if depth == 0 { 12 } else { 3 };
            let count = (1 + self.random.below(most) as usize).min(rest.len());
            let (now, later) = rest.split_at(count);
            rest = later;
            text += &self.part(now, depth);
            if self.random.below(2) == 0 {
                let word = WORDS[self.random.below(WORDS.len() as u64) as usize];
                writeln!(text, "{word}").unwrap();
            }
        }
        text
    }

    fn part(&mut self, lines: &[&str], depth: u32) -> String {
        let form = self.random.below(7);
        if depth == 3 || form == 0 {
            return lines.join("\n") + "\n";
        }
        let body = self.block(lines, depth + 1);
        self.labels += 1;
        let label = self.labels;
        match form {
            1 => format!("o{label} if [#33 GE 0]\n{body}o{label} endif\n"),
            2 => format!("o{label} if [0]\nG0 X1\no{label} else\n{body}o{label} endif\n"),
            3 => format!("o{label} repeat [1]\n{body}o{label} endrepeat\n"),
            4 => format!("o{label} do\n{body}o{label} while [0]\n"),
            5 => {
                let sub = format!("o{label} sub\n{body}o{label} endsub [#33]\n");
                self.subs += &sub;
                format!("o{label} call [7]\n")
            }
            _ => {
                let number = FIRST_SUBPROGRAM + label;
                let subprogram = format!("O{number}\n{body}M99\n");
                self.subprograms += &subprogram;
                format!("M98 P{number}\n")
            }
        }
    }
}

#[test]
fn programs_with_calls_and_blocks_are_driven_like_their_moves_written_out() {
    for_each_seed(
        "programs_with_calls_and_blocks_are_driven_like_their_moves_written_out",
        30,
        |seed| {
            let planner = PLANNERS[(seed % 5) as usize];
            let mut random = Random::new(seed);
            let fine_ms = [0.25, 0.37, 1.0, 1.3, 2.0][random.below(5) as usize];
            let rough_ms = fine_ms * (1 + random.below(16)) as f64;
            let mut settings = vec![
                ("planner.plugin".to_string(), planner.to_string()),
                ("loops.fine_period_ms".to_string(), fine_ms.to_string()),
                ("loops.rough_period_ms".to_string(), rough_ms.to_string()),
            ];
            // As published it breaks limits, and says so.
            let breaks_limits = planner == "after-interpolation";
            if breaks_limits {
                settings.push(("guard.mode".into(), "count".into()));
            }
            for axis in ["x", "y", "z"] {
                let acceleration = 10f64.powf(random.between(2.0, 4.0)).round();
                settings.push((
                    format!("axes.{axis}.max_acceleration_mm_per_s2"),
                    acceleration.to_string(),
                ));
            }
            let plain = program(seed);
            let structured = Structured::of(&plain, seed);
            let about = format!("{settings:?}\n{structured}");
            let [written, called] = [&plain, &structured].map(|text| {
                let ran = Bench::text(text).try_run(&settings);
                ran.map_err(|error| format!("{error}\n{about}"))
            });
            let (written, called) = (written?, called?);
            if !breaks_limits {
                let clean = called.expect_clean();
                clean.map_err(|cause| format!("{cause}\n{about}"))?;
            }
            let differs = written
                .samples
                .iter()
                .zip(&called.samples)
                .find(|(a, b)| a.command != b.command);
            if let Some((a, _)) = differs {
                return Err(format!(
                    "{planner}: not the same at tick {}\n{about}",
                    a.tick
                ));
            }
            if written.samples.len() == called.samples.len() {
                return Ok(());
            }
            let [a, b] = [&written, &called].map(|ran| ran.samples.len());
            Err(format!(
                "{planner}: {a} samples written out, {b} called\n{about}"
            ))
        },
    );
}
