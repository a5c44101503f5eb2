//! Machines and programs of any kind under a sender: what is driven is what was sent, within the limits, in the time of a run.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use tandem_machine::Machine;
use tandem_oracle::{Options, Trace, judge};
use tandem_rig::Random;

use crate::speak::{Streamer, alone_s, assert_as_long_as_a_run, field, jobs, serve_recorded};

/// Letters of a machine, and which of them turn.
const AXES: [&str; 5] = ["XYZ", "XY", "XYZA", "XZC", "XYZAB"];

struct Drawn {
    random: Random,
    letters: &'static str,
    /// Half of the travel that programs use, mm or degrees.
    reach: Vec<f64>,
    at: Vec<f64>,
    inches: bool,
    absolute: bool,
}

fn turns(letter: char) -> bool {
    "ABC".contains(letter)
}

impl Drawn {
    fn new(seed: u64) -> Self {
        let mut random = Random::new(seed);
        let letters = random.pick(&AXES);
        let reach = letters.chars().map(|_| random.between(20.0, 120.0));
        let reach: Vec<f64> = reach.collect();
        Self {
            at: vec![0.0; reach.len()],
            random,
            letters,
            reach,
            inches: false,
            absolute: true,
        }
    }

    fn machine(&mut self, folder: &Path) -> PathBuf {
        let (rough_ms, fine_ms) =
            self.random
                .pick(&[(8.0, 1.0), (4.0, 1.0), (8.0, 2.0), (5.0, 0.5)]);
        let difference = self.random.pick(&[60.0, 100.0, 300.0]);
        let mut text = format!(
            "format = 1\n[machine]\nname = \"drawn\"\n[loops]\nrough_period_ms = {rough_ms}\nfine_period_ms = {fine_ms}\n\
             [motion]\nallowable_speed_difference_mm_per_min = {difference}\n\
             allowable_speed_difference_deg_per_min = {difference}\njerk = \"report\"\npath_tolerance_mm = 0.01\ntime_constant_ms = 50\n\
             [planner]\nplugin = \"look-ahead\"\n[driver]\nplugin = \"sim\"\n"
        );
        let places: Vec<(char, f64)> = self.letters.chars().zip(self.reach.clone()).collect();
        for (letter, reach) in places {
            let unit = if turns(letter) { "deg" } else { "mm" };
            let kind = if turns(letter) {
                "kind = \"rotary\"\n"
            } else {
                ""
            };
            let [low, high] = [0; 2].map(|_| reach * self.random.between(1.1, 3.0));
            let [feed, rapid] = [0; 2].map(|_| self.random.between(2000.0, 30_000.0).round());
            let acceleration = self.random.between(300.0, 5000.0).round();
            let axis = letter.to_ascii_lowercase();
            // A string takes whatever is written to it.
            let _ = write!(
                text,
                "[axes.{axis}]\n{kind}travel_{unit} = [{:.3}, {high:.3}]\nmax_feed_{unit}_per_min = {feed:.1}\n\
                 max_rapid_{unit}_per_min = {rapid:.1}\nmax_acceleration_{unit}_per_s2 = {acceleration:.1}\n",
                -low
            );
        }
        let path = folder.join("drawn.toml");
        std::fs::write(&path, text).unwrap();
        path
    }

    /// A value of an axis as the program writes it.
    fn written(&self, nth: usize, value: f64) -> String {
        let letter = self.letters.as_bytes()[nth] as char;
        if self.inches && !turns(letter) {
            format!("{letter}{:.5}", value / 25.4)
        } else {
            format!("{letter}{value:.4}")
        }
    }

    /// What a value is once it has been written.
    fn rounded(&self, nth: usize, value: f64) -> f64 {
        let text = self.written(nth, value);
        let number: f64 = text[1..].parse().unwrap();
        let scale = if self.inches && !turns(self.letters.as_bytes()[nth] as char) {
            25.4
        } else {
            1.0
        };
        number * scale
    }

    fn line(&mut self, text: &mut String) {
        let word = self.random.pick(&["G1", "G1", "G1", "", "G0"]);
        let step = self.random.length(0.05, 30.0);
        let mut line = word.to_string();
        let mut moves = false;
        for nth in 0..self.letters.len() {
            if self.random.below(3) == 0 {
                continue;
            }
            let to = self.at[nth] + step * self.random.between(-1.0, 1.0);
            let to = to.clamp(-self.reach[nth], self.reach[nth]);
            let (shown, end) = if self.absolute {
                (to, self.rounded(nth, to))
            } else {
                let by = to - self.at[nth];
                (by, self.at[nth] + self.rounded(nth, by))
            };
            line.push_str(&self.written(nth, shown));
            self.at[nth] = end;
            moves = true;
        }
        if !moves {
            return;
        }
        if self.random.below(6) == 0 {
            let feed = self.random.length(300.0, 12_000.0);
            let _ = write!(line, "F{:.2}", if self.inches { feed / 25.4 } else { feed });
        }
        let _ = writeln!(text, "{line}");
    }

    fn program(&mut self) -> String {
        let mut text = String::from("G21G90G94\nF2400\nG1\n");
        for _ in 0..60 + self.random.below(90) {
            match self.random.below(40) {
                0 => {
                    (self.inches, text) = (
                        !self.inches,
                        text + if self.inches {
                            "G21F3000\n"
                        } else {
                            "G20F90\n"
                        },
                    );
                }
                1 => {
                    (self.absolute, text) = (
                        !self.absolute,
                        text + if self.absolute { "G91\n" } else { "G90\n" },
                    );
                }
                2 => text.push_str(self.random.pick(&[
                    "(a remark)\n",
                    "N17\n",
                    "M8\n",
                    "S1200M3\n",
                    "\n",
                    "G17\n",
                ])),
                3 => text.push_str(self.random.pick(&["G61\n", "G64\n", "G64P0.02\n"])),
                _ => self.line(&mut text),
            }
        }
        text
    }
}

#[test]
fn any_machine_drives_what_a_sender_sends_as_it_would_a_file() {
    let first = std::env::var("TANDEM_SEED").map_or(0, |seed| seed.parse().unwrap());
    let count = if std::env::var_os("TANDEM_SEED").is_some() {
        1
    } else {
        14
    };
    for seed in first..first + count {
        println!("TANDEM_SEED={seed}");
        let folder = tempfile::tempdir().unwrap();
        let mut drawn = Drawn::new(seed);
        let file = drawn.machine(folder.path());
        let machine = Machine::read(&file, &[]).unwrap();
        let text = drawn.program();
        let alone_s = alone_s(&machine, &text);
        let in_inches = drawn.random.below(2) == 1;
        let sent = format!("$13={}\n{text}", u8::from(in_inches));
        let budget = drawn.random.pick(&[60, 127, 1000]);
        let (streamer, seen) = Streamer::new(&sent, budget, 150, seed as u8);
        let record = folder.path().join("jobs");
        let told = serve_recorded(&machine, vec![streamer], vec![], Some(&record));
        let seen = seen.lock().unwrap();
        assert_eq!(seen.errors, [""; 0], "{sent}");
        assert_eq!(seen.lies, [""; 0]);
        assert_eq!(seen.answers, sent.lines().count());
        let jobs = jobs(&told);
        assert_eq!(
            jobs.len(),
            1,
            "it is planned through with {budget} bytes on the way: {jobs:?}\n{sent}"
        );
        assert_as_long_as_a_run(&jobs, alone_s, &format!("{budget} bytes on the way"));

        let jobs = std::fs::read_dir(&record)
            .unwrap()
            .map(|entry| entry.unwrap().path());
        let jobs: Vec<PathBuf> = jobs
            .filter(|folder| folder.join("trace.csv").exists())
            .collect();
        assert_eq!(jobs.len(), 1, "{jobs:?}");
        let trace = Trace::read(&jobs[0].join("trace.csv")).unwrap();
        let machine = tandem_oracle::Machine::read(&file).unwrap();
        let verdict = judge(&trace, &text, &machine, &Options::for_machine(&machine));
        assert!(verdict.passed(), "{verdict}\n{text}");
        drawn.assert_shown(field(&seen.last_report, "MPos").unwrap(), in_inches);
    }
}

impl Drawn {
    /// X Y Z first, whether the machine has them or not, then the others; linear axes in inches where that was asked for.
    fn assert_shown(&self, shown: &str, in_inches: bool) {
        let others = self
            .letters
            .chars()
            .filter(|letter| !"XYZ".contains(*letter));
        let letters = "XYZ".chars().chain(others);
        let shown: Vec<f64> = shown
            .split(',')
            .map(|number| number.parse().unwrap())
            .collect();
        let expected: Vec<f64> = letters
            .map(|letter| {
                let place = self.letters.find(letter).map_or(0.0, |nth| self.at[nth]);
                if in_inches && !turns(letter) {
                    place / 25.4
                } else {
                    place
                }
            })
            .collect();
        assert_eq!(shown.len(), expected.len(), "{shown:?} {expected:?}");
        let near = |(a, b): (&f64, &f64)| (a - b).abs() < 0.000_51;
        assert!(
            shown.iter().zip(&expected).all(near),
            "{shown:?}, not {expected:?}"
        );
    }
}
