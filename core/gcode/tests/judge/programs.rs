//! Random programs from seeds.

use std::fmt::Write as _;

use tandem_rig::Random;

/// A program that is being written.
struct Writer {
    random: Random,
    text: String,
    /// The next number of a loop or a branch.
    label: u32,
    /// Statements that may still be written, so that a program ends.
    left: u32,
    /// Subroutines that may be called: those before it, so that none calls itself.
    subs: u32,
    in_sub: bool,
}

impl Writer {
    fn new(seed: u64, statements: u32) -> Self {
        let text = "G21 G90 G94 G17 F600\nG64\n".to_owned();
        Self {
            random: Random::new(seed),
            text,
            label: 1000,
            left: statements,
            subs: 0,
            in_sub: false,
        }
    }

    fn line(&mut self, text: &str) {
        let _ = writeln!(self.text, "{text}");
    }

    fn label(&mut self) -> u32 {
        self.label += 1;
        self.label
    }

    fn below(&mut self, count: u64) -> u64 {
        self.random.below(count)
    }

    /// A value that stays small: parameters hold 0 to 12.
    fn value(&mut self) -> String {
        match self.below(8) {
            0 | 1 => format!("#{}", 1 + self.below(5)),
            2 => format!("#{}", 31 + self.below(4)),
            3 => "#<_count>".into(),
            4 => format!("[#{} * 3 + #31]", 1 + self.below(5)),
            5 => format!("[#{} MOD 4 + 0.5]", 1 + self.below(5)),
            6 => "#<_value>".into(),
            _ => format!("{}", self.below(13)),
        }
    }

    fn condition(&mut self) -> String {
        let (a, b) = (self.value(), self.value());
        let operator = self.random.pick(&["GT", "LT", "GE", "LE", "EQ", "NE"]);
        let simple = format!("[{a} {operator} {b}]");
        match self.below(4) {
            0 => format!("[{simple} AND [{} LT 9]]", self.value()),
            1 => format!("[{simple} OR [{} GT 7]]", self.value()),
            _ => simple,
        }
    }

    fn statements(&mut self, depth: u32) {
        for _ in 0..=self.below(4) {
            if self.left == 0 {
                return;
            }
            self.left -= 1;
            self.statement(depth);
        }
    }

    fn statement(&mut self, depth: u32) {
        match self.below(if depth < 4 { 14 } else { 6 }) {
            0..=2 | 9 => self.motion(),
            3 | 4 => {
                let target = match self.below(3) {
                    0 => format!("#{}", 1 + self.below(5)),
                    1 => format!("#{}", 31 + self.below(4)),
                    _ => "#<_count>".into(),
                };
                let value = self.value();
                self.line(&format!("{target} = [[{value}] MOD 13]"));
            }
            5 => {
                let text = self.random.pick(&[
                    "G91",
                    "G90",
                    "G90",
                    "G90",
                    "(a comment)",
                    "",
                    "G4 P0.25",
                    "N77",
                ]);
                self.line(text);
            }
            6 | 7 => self.branch(depth),
            8 => self.while_loop(depth),
            // No `do`: once another loop has been there, the judge ends it after one turn, or never.
            10 => self.repeat(depth),
            11 if self.in_sub => {
                let (label, condition, value) = (self.label(), self.condition(), self.value());
                let sub = self.subs + 1;
                self.line(&format!("o{label} if {condition}"));
                let end = if self.below(2) == 0 {
                    format!("o{sub} return")
                } else {
                    format!("o{sub} return [{value}]")
                };
                self.line(&end);
                self.line(&format!("o{label} endif"));
            }
            _ => self.call(),
        }
    }

    fn motion(&mut self) {
        let (word, x, y) = (
            self.random.pick(&["G0", "G1", ""]),
            self.value(),
            self.value(),
        );
        let z = if self.below(3) == 0 {
            format!(" Z{}", self.value())
        } else {
            String::new()
        };
        self.line(&format!("{word} X{x} Y{y}{z}"));
    }

    fn branch(&mut self, depth: u32) {
        let (label, condition) = (self.label(), self.condition());
        self.line(&format!("o{label} if {condition}"));
        self.statements(depth + 1);
        for _ in 0..self.below(3) {
            let condition = self.condition();
            self.line(&format!("o{label} elseif {condition}"));
            self.statements(depth + 1);
        }
        if self.below(2) == 0 {
            self.line(&format!("o{label} else"));
            self.statements(depth + 1);
        }
        self.line(&format!("o{label} endif"));
    }

    /// Leaves the loop `label`, or begins its next turn.
    fn leave(&mut self, label: u32) {
        if self.below(3) == 0 {
            let (inner, condition) = (self.label(), self.condition());
            let how = self.random.pick(&["break", "continue"]);
            self.line(&format!(
                "o{inner} if {condition}\no{label} {how}\no{inner} endif"
            ));
        }
    }

    fn while_loop(&mut self, depth: u32) {
        let label = self.label();
        let turns = 1 + self.below(4);
        self.line(&format!(
            "#<turn{label}> = 0\no{label} while [#<turn{label}> LT {turns}]"
        ));
        self.line(&format!("#<turn{label}> = [#<turn{label}> + 1]"));
        self.statements(depth + 1);
        self.leave(label);
        self.statements(depth + 1);
        self.line(&format!("o{label} endwhile"));
    }

    fn repeat(&mut self, depth: u32) {
        let label = self.label();
        let turns = self
            .random
            .pick(&["0", "1", "2", "3", "2.6", "-1", "#31 MOD 4"]);
        self.line(&format!("o{label} repeat [{turns}]"));
        // No `return`: the judge keeps the count of a repeat that is left so for the next call.
        let in_sub = std::mem::replace(&mut self.in_sub, false);
        self.statements(depth + 1);
        self.in_sub = in_sub;
        self.line(&format!("o{label} endrepeat"));
    }

    fn call(&mut self) {
        if self.subs == 0 {
            return self.motion();
        }
        let sub = 1 + self.below(u64::from(self.subs));
        let arguments: Vec<_> = (0..self.below(4))
            .map(|_| format!("[{}]", self.value()))
            .collect();
        self.line(&format!("o{sub} call {}", arguments.join(" ")));
    }
}

/// Subroutines, calls, loops and branches around straight moves.
pub fn with_o_words(seed: u64) -> String {
    let mut writer = Writer::new(seed, 24);
    writer.line("#31=1 #32=5 #33=2 #34=9 #<_count>=3");
    for _ in 0..writer.below(4) {
        let number = writer.subs + 1;
        writer.line(&format!("o{number} sub"));
        writer.in_sub = true;
        writer.left += 8;
        writer.statements(1);
        writer.in_sub = false;
        let value = writer.value();
        let end = if writer.below(2) == 0 {
            format!("o{number} endsub [{value}]")
        } else {
            format!("o{number} endsub")
        };
        writer.line(&end);
        writer.subs = number;
    }
    // The judge takes the value of an `endsub` that it passes over for one that has been returned: a call forgets it.
    writer.line("o99 sub\no99 endsub\no99 call\n#1=4 #2=7 #3=1 #4=0 #5=11\nG0 X0 Y0");
    while writer.left > 0 {
        writer.statements(0);
    }
    writer.line("G90 G0 X1 Y#<_count>\nM2");
    writer.text
}

/// Subprograms that call those behind them, some times over.
pub fn with_subprograms(seed: u64) -> String {
    let mut writer = Writer::new(seed, 0);
    let count = 1 + writer.below(4);
    writer.line("O7 (title)\nG0 X0 Y0\n#1 = 1\n#<_count> = 2");
    for number in 0..=count {
        if number > 0 {
            writer.line(&format!("O{:04}", 100 + number));
        }
        for _ in 0..=writer.below(2) {
            writer.left = 6;
            // No blocks of O-words: the judge loses its way in those that M98 leaves.
            writer.statements(4);
            writer.line("#1 = [[#1 * 3 + 1] MOD 7]");
            if number < count {
                let called = number + 1 + writer.below(count - number);
                // The judge takes L0 in a subprogram for a call, from which the next M99 returns; and it wants L to be whole in
                // lines, too, that it only passes over while it looks for a subprogram.
                let none = if number == 0 { " L0" } else { "" };
                let times = writer
                    .random
                    .pick(&["", " L2", none, " L[1 + [FIX[#1] MOD 2]]"]);
                writer.line(&format!("M98 P{}{times}", 100 + called));
            }
        }
        writer.line(if number == 0 { "M30" } else { "M99" });
    }
    // What a subroutine returns: there is none.
    writer.text.replace("#<_value>", "3")
}

/// Canned cycles in three planes, absolute and incremental, in mm and inches, with offsets.
pub fn with_cycles(seed: u64) -> String {
    let mut writer = Writer::new(seed, 0);
    let start = writer
        .random
        .pick(&["G54", "G10 L2 P1 X2 Y-1 Z3", "G92 X1 Z-2", "G43 H2", "G20"]);
    writer.line(&format!("{start}\nF90 S500 M3"));
    for _ in 0..2 + writer.below(4) {
        let modes = writer
            .random
            .pick(&["G17", "G18", "G19", "G17 G98", "G17 G99"]);
        let distance = writer.random.pick(&["G90", "G91"]);
        let normal = match &modes[..3] {
            "G18" => 'Y',
            "G19" => 'X',
            _ => 'Z',
        };
        let high = writer.below(12);
        writer.line(
            &format!("{modes} G90 G0 X1 Y2 Z3 {distance}\nG90 G0 {normal}{high} {distance}")
                .replace("G90 G0", "G0"),
        );
        cycle_lines(&mut writer, normal, distance == "G91", high);
    }
    writer.line("G80 G90 G0 X0 Y0\nM2");
    writer.text
}

/// One cycle, and lines that repeat it.
fn cycle_lines(writer: &mut Writer, normal: char, incremental: bool, high: u64) {
    // The judge taps along the wrong axes in G18 and G19, and takes the dwell of another cycle for a tap without P.
    let word = match writer
        .random
        .pick(&["G73", "G81", "G82", "G83", "G84", "G85", "G86", "G89"])
    {
        "G84" if normal != 'Z' => "G81",
        word => word,
    };
    let r = writer.below(6).cast_signed();
    let depth = 1 + writer.below(5).cast_signed();
    let bottom = if incremental { -depth } else { r - depth };
    let more = match word {
        "G73" | "G83" => format!(" Q{}", writer.random.pick(&["1", "0.5", "2", "9"])),
        "G82" | "G84" | "G86" | "G89" => format!(" P{}", writer.random.pick(&["0.25", "1"])),
        _ => String::new(),
    };
    let place = |writer: &mut Writer| {
        let letters: Vec<_> = "XYZ".chars().filter(|letter| *letter != normal).collect();
        let mut text = String::new();
        for letter in letters {
            if writer.below(2) == 0 {
                let _ = write!(text, " {letter}{}", writer.below(9));
            }
        }
        text
    };
    let at = place(writer);
    let repeats = if writer.below(3) == 0 { " L2" } else { "" };
    writer.line(&format!("{word}{at} {normal}{bottom} R{r}{more}{repeats}"));
    for _ in 0..writer.below(3) {
        let at = place(writer);
        let deeper = writer.below(2).cast_signed();
        writer.line(&format!("{at} {normal}{}", bottom - deeper));
    }
    // The same cycle goes on in the other distance mode, from the same level: where that is another, the judge goes to it and
    // to the next hole at once.
    if writer.below(3) == 0 && !incremental {
        let (at, bottom, r) = (
            place(writer),
            -1 - writer.below(3).cast_signed(),
            r - high.cast_signed(),
        );
        writer.line(&format!("G91 {word}{at} {normal}{bottom} R{r}{more}"));
        let polar = writer.random.pick(&["@3 ^30", "^45", "@2"]);
        if normal == 'Z' {
            writer.line(&format!("X1 Y2 {normal}{bottom}\n{polar} {normal}{bottom}"));
        }
    }
}

/// Coordinate systems, rotations, G92 and tools between lines and arcs.
pub fn with_offsets(seed: u64) -> String {
    let mut writer = Writer::new(seed, 0);
    for _ in 0..14 {
        let [x, y, z] = [0; 3].map(|_| writer.below(20).cast_signed() - 9);
        let (system, tool) = (writer.below(10), 1 + writer.below(2));
        let degrees = writer.random.pick(&["0", "30", "90", "-12.5"]);
        let line = match writer.below(19) {
            0 => format!("G10 L2 P{system} X{x} Y{y} R{degrees}"),
            1 => format!("G10 L2 P{system} Z{z} R{degrees}"),
            2 => format!("G10 L20 P{system} X{x} Y{y}"),
            3 => format!("G10 L20 P{system} Y{y} Z{z}"),
            // After a rotation the judge forgets the offset of G92 in where it stands, which distances then begin from.
            4 if seed.is_multiple_of(2) => format!("G92 X{x} Z{z}"),
            5 => writer.random.pick(&["G92.1", "G92.2", "G92.3"]).to_owned(),
            6 => writer
                .random
                .pick(&["G54", "G55", "G56", "G59", "G59.1", "G59.3"])
                .to_owned(),
            7 => format!("G10 L1 P{tool} Z{z}"),
            8 => format!("G10 L10 P{tool} Z{z}"),
            9 => format!("G10 L11 P{tool} Z{z}"),
            10 => writer.random.pick(&["G43 H1", "G43 H2", "G49"]).to_owned(),
            11 => format!("G90 G53 G0 X{x} Y{y}"),
            12 => format!("G90 G17 G3 X{x} Y{y} I[{x} - #5420] J[{y} - #5421 + 0]")
                .replace(&format!("X{x} Y{y} "), ""),
            13 if seed % 2 == 1 => writer.random.pick(&["G90", "G91"]).to_owned(),
            14 if seed.is_multiple_of(2) => format!("G52 X{x} Y{y}"),
            15 => format!("G43.1 Z{z}"),
            16 => format!("G43.2 H{tool}"),
            _ => format!("G1 X{x} Y{y}"),
        };
        writer.line(&line);
        let (x, y) = (writer.below(9), writer.below(9));
        writer.line(&format!("G0 X{x} Y{y}"));
    }
    writer.line("M2");
    writer.text
}

/// Modes that words of other subjects must mind: planes, diameters, distances, what M70 saves, and words that share letters.
pub fn with_modes(seed: u64) -> String {
    let mut writer = Writer::new(seed, 0);
    writer.line("S100 M3 $0\nG0 X1 Y2 Z30");
    let mut plane = ['X', 'Y', 'Z'];
    for _ in 0..14 {
        let [x, y, z] = [0; 3].map(|_| writer.below(20).cast_signed() - 9);
        let [a, b, normal] = plane;
        let centre =
            |axis: char, value: u32| format!(" {}{value}", (axis as u8 - b'X' + b'I') as char);
        let centres = centre(plane[0], 2) + &centre(plane[1], 3);
        let line = match writer.below(14) {
            0 => writer.random.pick(&["G7", "G8"]).to_owned(),
            1 => {
                let word = writer.random.pick(&["G17", "G18", "G19"]);
                plane = match word {
                    "G17" => ['X', 'Y', 'Z'],
                    "G18" => ['X', 'Z', 'Y'],
                    _ => ['Y', 'Z', 'X'],
                };
                word.to_owned()
            }
            2 => writer.random.pick(&["G90", "G91"]).to_owned(),
            3 => format!("G3{centres}\nM19 R90\nM3"),
            4 => format!("G2{centres}\nG4 P0.5\nG1 X{x}"),
            5 => format!("M70\nG92 X{x} Z{z}\nG0 Y{y}\nM72"),
            6 => format!("G92 X{x}\nM70\nG92.2 G91 G7\nG0 X{x}\nM72"),
            7 => format!("M70\nG55 G91 G8\nG10 L20 P0 X{x} Y{y}\nG1 X{x}\nM72"),
            8 => {
                let word = writer
                    .random
                    .pick(&["G81", "G82 P0.2", "G83 Q7", "G73 Q9", "G85"]);
                let distance = writer.random.pick(&["G90", "G91"]);
                let ends = writer.random.pick(&["G98", "G99"]);
                format!(
                    "G90 G53 G0 X90 Y90 Z90\n{ends} {distance} {word} {a}{x} {b}{y} {normal}-120 R-100 L2\n{a}{z}\nG80"
                )
            }
            9 => format!("G90 G17 G0 X5 Y1\n@{} ^{} G4 P0", x.abs() + 1, 10 * y),
            10 => format!("G90 G53 G1 X{x} Z{z}"),
            11 => {
                let label = writer.label();
                format!(
                    "o{label} if [{x} GT 3]\nG0 X1\no{label} else if [{y} GT 0]\nG1 Y2\no{label} end if"
                )
            }
            12 => format!("G28.1\nG28 {a}{x} {b}{y}"),
            _ => format!("G1 X{x} Y{y}"),
        };
        if line.contains("G17") {
            plane = ['X', 'Y', 'Z'];
        }
        writer.line(&line);
        let (x, y) = (writer.below(9), writer.below(9));
        writer.line(&format!("G0 X{x} Y{y}"));
    }
    writer.line("M2");
    writer.text
}

/// Contours with radius compensation in XY and ZX: lines and arcs, inside and outside corners, moves across, entry and exit.
pub fn with_compensation(seed: u64) -> String {
    let mut writer = Writer::new(seed, 0);
    let zx = writer.below(4) == 0;
    let (a, b, across) = if zx { ('Z', 'X', 'Y') } else { ('X', 'Y', 'Z') };
    let start = writer
        .random
        .pick(&["G54", "G10 L2 P1 X2 Y-1 Z3", "G92 X1 Y-2", "G54"]);
    writer.line(&format!("{}\n{start}", if zx { "G18" } else { "G17" }));
    if !zx && writer.below(3) == 0 {
        writer.line("G10 L2 P1 R30");
    }
    for _ in 0..2 {
        let word = writer.random.pick(&[
            "G41.1 D2",
            "G42.1 D2",
            "G41 D1",
            "G42 D2",
            "G41.1 D6",
            "G42.1 D0.5",
        ]);
        writer.line(&format!("G0 X0 Y0 Z0\n{word}\nG1 {a}20 {b}5"));
        let mut contour = Contour {
            at: [20.0, 5.0],
            arc_towards: None,
        };
        for _ in 0..2 + writer.below(6) {
            contour = contour.go_on(&mut writer, [a, b]);
            if writer.below(5) == 0 {
                let depth = writer.below(9);
                writer.line(&format!("G1 {across}-{depth}"));
            }
        }
        writer.line(&format!("G40\nG1 {a}90 {b}90"));
    }
    writer.line("M2");
    writer.text
}

/// Where a contour has come to, and the direction in which an arc has come there.
struct Contour {
    at: [f64; 2],
    arc_towards: Option<f64>,
}

impl Contour {
    /// A line, or an arc by its centre.
    fn go_on(&self, writer: &mut Writer, [a, b]: [char; 2]) -> Self {
        let steps = [10.0, 15.0, -10.0, -15.0, 0.0, 20.0];
        let mut step = [writer.random.pick(&steps), writer.random.pick(&steps)];
        if step == [0.0; 2] {
            step[0] = 10.0;
        }
        let end = [self.at[0] + step[0], self.at[1] + step[1]];
        let wants_line = writer.below(5) < 3;
        // The centre lies on the line that halves the chord.
        let share = writer.random.pick(&[0.0, 0.5, -0.5, 1.0]);
        let center = [
            step[0] / 2.0 - share * step[1],
            step[1] / 2.0 + share * step[0],
        ];
        let word = writer.random.pick(&["G2", "G3"]);
        let way = if word == "G3" { 1.0 } else { -1.0 };
        let tangent = |from: [f64; 2]| (way * -from[0]).atan2(way * from[1]);
        let begins = tangent([center[0], center[1]]);
        // Where an arc turns back into an arc the judge rolls around the end also where that is a slot, and cuts.
        let turns_back = self
            .arc_towards
            .is_some_and(|before| (before - begins).cos() < -0.99);
        if wants_line || turns_back {
            let word = if writer.below(8) == 0 { "G0" } else { "G1" };
            writer.line(&format!("{word} {a}{:.4} {b}{:.4}", end[0], end[1]));
            return Self {
                at: end,
                arc_towards: None,
            };
        }
        let [i, j] = if a == 'Z' { ['K', 'I'] } else { ['I', 'J'] };
        writer.line(&format!(
            "{word} {a}{:.4} {b}{:.4} {i}{:.4} {j}{:.4}",
            end[0], end[1], center[0], center[1]
        ));
        Self {
            at: end,
            arc_towards: Some(tangent([center[0] - step[0], center[1] - step[1]])),
        }
    }
}
