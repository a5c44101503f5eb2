//! Makes a failing case smaller while it fails in the same way.

use crate::case::Case;
use crate::verdict::Report;

/// A smaller case counts only where it exceeds its limit by at least this share of what the first one did.
const SIZE_SHARE: f64 = 0.3;

/// A case on its way to the smallest.
pub struct Minimiser<'a> {
    run: &'a mut dyn FnMut(&Case) -> Report,
    best: Case,
    report: Report,
    first_size: f64,
    /// Runs that may still be tried.
    left: u32,
}

/// The smallest case found within `most` runs that fails as `case` does, and how it fails.
pub fn minimise(
    run: &mut dyn FnMut(&Case) -> Report,
    case: &Case,
    report: &Report,
    most: u32,
) -> (Case, Report) {
    let mut this = Minimiser {
        run,
        best: case.clone(),
        report: report.clone(),
        first_size: report.size,
        left: most,
    };
    loop {
        let before = this.best.clone();
        this.commands();
        this.program();
        this.axes();
        this.machine();
        this.words();
        if this.best == before || this.left == 0 {
            return (this.best, this.report);
        }
    }
}

impl Minimiser<'_> {
    /// Takes the case where it fails as the first one does.
    fn attempt(&mut self, case: Case) -> bool {
        if self.left == 0 || case == self.best {
            return false;
        }
        self.left -= 1;
        let report = (self.run)(&case);
        let far_enough =
            !self.first_size.is_finite() || report.size >= SIZE_SHARE * self.first_size;
        let same =
            report.kind == self.report.kind && report.planner == self.report.planner && far_enough;
        if same {
            (self.best, self.report) = (case, report);
        }
        same
    }

    /// Leaves lines out: halves, quarters and so on, then one by one.
    fn lines(&mut self, of: fn(&mut Case) -> &mut String) {
        let count = of(&mut self.best.clone()).lines().count();
        let mut chunk = count.div_ceil(2).max(1);
        while self.left > 0 {
            let mut from = 0;
            loop {
                let mut case = self.best.clone();
                let text = of(&mut case);
                let lines: Vec<String> = text.lines().map(str::to_string).collect();
                if from >= lines.len() {
                    break;
                }
                let to = (from + chunk).min(lines.len());
                *text = lines[..from]
                    .iter()
                    .chain(&lines[to..])
                    .fold(String::new(), |text, line| text + line + "\n");
                if !self.attempt(case) {
                    from = to;
                }
            }
            if chunk == 1 {
                return;
            }
            chunk = chunk.div_ceil(2);
        }
    }

    fn commands(&mut self) {
        self.lines(|case| &mut case.commands);
    }

    fn program(&mut self) {
        self.lines(|case| &mut case.program);
    }

    /// Fewer axes: their tables, joints and words.
    fn axes(&mut self) {
        let letters: Vec<char> = "XYZABCUVW".chars().collect();
        for letter in letters {
            let lower = letter.to_ascii_lowercase();
            let mut case = self.best.clone();
            let named = format!("\"{lower}\"");
            case.machine.tables.retain(|table| {
                let joint = table.head.starts_with("[joints.");
                let moves = table
                    .keys
                    .iter()
                    .any(|(key, value)| key == "axis" && *value == named);
                table.head != format!("[axes.{lower}]") && !(joint && moves)
            });
            case.program = without_words(&case.program, letter);
            self.attempt(case);
        }
    }

    /// Tables and keys are left out, numbers rounded.
    fn machine(&mut self) {
        let mut index = 0;
        while index < self.best.machine.tables.len() {
            let mut case = self.best.clone();
            let head = case.machine.tables.remove(index).head;
            // Kinematics go with their joints.
            if head == "[kinematics]" {
                let of_it =
                    |head: &str| head.starts_with("[kinematics") || head.starts_with("[joints.");
                case.machine.tables.retain(|table| !of_it(&table.head));
            }
            if !self.attempt(case) {
                index += 1;
            }
        }
        for table in 0..self.best.machine.tables.len() {
            let mut key = 0;
            while key < self.best.machine.tables[table].keys.len() {
                let mut case = self.best.clone();
                case.machine.tables[table].keys.remove(key);
                if !self.attempt(case) {
                    self.rounder(table, key);
                    key += 1;
                }
            }
        }
    }

    /// A rounder number in the place of one value.
    fn rounder(&mut self, table: usize, key: usize) {
        let value = self.best.machine.tables[table].keys[key].1.clone();
        let wide =
            (value.starts_with('[') && value.contains(',')).then(|| "[-1000, 1000]".to_string());
        let number = value.parse::<f64>().ok();
        let digits = |digits: usize| {
            number.map(|n| {
                format!("{n:.digits$e}")
                    .parse::<f64>()
                    .map(|n| n.to_string())
            })
        };
        let rounded = [digits(0), digits(1), digits(2)]
            .into_iter()
            .flatten()
            .flatten();
        for simpler in wide
            .into_iter()
            .chain(rounded)
            .filter(|text| *text != value)
        {
            let mut case = self.best.clone();
            case.machine.tables[table].keys[key].1 = simpler;
            if self.attempt(case) {
                return;
            }
        }
    }

    /// Words are left out of lines, and numbers lose digits.
    fn words(&mut self) {
        let mut line = 0;
        while line < self.best.program.lines().count() && self.left > 0 {
            let count = |case: &Case| {
                case.program
                    .lines()
                    .nth(line)
                    .map_or(0, |text| text.split(' ').count())
            };
            let mut word = 0;
            while word < count(&self.best) {
                if !self.word(line, word, None) {
                    let _ = (0..4).any(|digits| self.word(line, word, Some(digits)));
                    word += 1;
                }
            }
            line += 1;
        }
    }

    /// Leaves a word out, or rounds it to so many digits behind the point.
    fn word(&mut self, line: usize, word: usize, digits: Option<usize>) -> bool {
        let mut case = self.best.clone();
        let mut lines: Vec<String> = case.program.lines().map(str::to_string).collect();
        let mut words: Vec<String> = lines[line].split(' ').map(str::to_string).collect();
        match digits {
            None => _ = words.remove(word),
            Some(digits) => {
                let start = words[word]
                    .find(|c: char| c == '-' || c.is_ascii_digit())
                    .unwrap_or(words[word].len());
                let (letters, number) = words[word].split_at(start);
                let fewer = number
                    .split('.')
                    .nth(1)
                    .is_some_and(|behind| behind.len() > digits);
                let Some(number) = number.parse::<f64>().ok().filter(|_| fewer) else {
                    return false;
                };
                words[word] = format!("{letters}{number:.digits$}");
            }
        }
        lines[line] = words.join(" ");
        case.program = lines.join("\n") + "\n";
        self.attempt(case)
    }
}

fn without_words(program: &str, letter: char) -> String {
    let line = |line: &str| {
        let kept: Vec<&str> = line
            .split(' ')
            .filter(|word| !word.starts_with(letter))
            .collect();
        kept.join(" ") + "\n"
    };
    program.lines().map(line).collect()
}
