//! Random machines.

mod tables;

use tandem_rig::Random;

use crate::case::MachineText;

/// A planner with what its promises depend on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Planner {
    /// `look-ahead`: on the path, within velocity and acceleration and the allowable speed difference.
    LookAhead,
    /// `block-overlap` within tolerance, velocity and acceleration.
    BlockOverlap,
    /// `after-interpolation`, as published: neither path nor limits.
    AfterInterpolation,
    /// `nurbs` in a form within all limits.
    Nurbs,
    /// `smooth`: within all limits and the tolerance.
    Smooth,
}

impl Planner {
    /// All of them, and how many of a hundred machines have each.
    pub const SHARES: [(Self, u64); 5] = [
        (Self::LookAhead, 24),
        (Self::BlockOverlap, 22),
        (Self::AfterInterpolation, 4),
        (Self::Nurbs, 24),
        (Self::Smooth, 26),
    ];

    /// The name in the machine file.
    pub fn name(self) -> &'static str {
        match self {
            Self::LookAhead => "look-ahead",
            Self::BlockOverlap => "block-overlap",
            Self::AfterInterpolation => "after-interpolation",
            Self::Nurbs => "nurbs",
            Self::Smooth => "smooth",
        }
    }

    /// Of a name.
    pub fn named(name: &str) -> Option<Self> {
        Self::SHARES
            .into_iter()
            .map(|(planner, _)| planner)
            .find(|planner| planner.name() == name)
    }

    /// Whether it asks for a jerk limit of every axis, and keeps it.
    pub fn keeps_jerk(self) -> bool {
        matches!(self, Self::Nurbs | Self::Smooth)
    }
}

/// An axis as it was drawn, in the units of the machine file.
#[derive(Clone, Copy, Debug)]
pub struct Axis {
    /// Its letter.
    pub letter: char,
    /// Whether it turns.
    pub rotary: bool,
    /// Lowest position, mm or deg.
    pub low: f64,
    /// Highest position, mm or deg.
    pub high: f64,
    /// Where the machine stands at first, mm or deg.
    pub start: f64,
    /// Highest feed, mm/min or deg/min.
    pub feed: f64,
    /// Highest speed in rapids, mm/min or deg/min.
    pub rapid: f64,
    /// Highest acceleration, mm/s² or deg/s².
    pub acceleration: f64,
    /// Highest jerk, mm/s³ or deg/s³.
    pub jerk: f64,
}

impl Axis {
    /// The unit of its keys.
    fn unit(&self) -> &'static str {
        if self.rotary { "deg" } else { "mm" }
    }
}

/// A plane that a probe touches.
#[derive(Clone, Copy, Debug)]
pub struct Surface {
    /// Index of the axis that it is square to.
    pub axis: usize,
    /// Where it is, mm.
    pub at_mm: f64,
    /// The probe touches above it.
    pub above: bool,
}

impl Surface {
    /// Whether the probe touches where the axis stands.
    pub fn touches(&self, position_mm: f64) -> bool {
        if self.above {
            position_mm > self.at_mm
        } else {
            position_mm < self.at_mm
        }
    }
}

/// A machine as a file, and what programs and commands for it depend on.
#[derive(Clone, Debug)]
pub struct Drawn {
    /// The machine file.
    pub text: MachineText,
    /// The axes in the order of the file.
    pub axes: Vec<Axis>,
    /// The planner.
    pub planner: Planner,
    /// Fine period, ms.
    pub fine_ms: f64,
    /// Rough period, ms.
    pub rough_ms: f64,
    /// Highest feed ratio that may be asked.
    pub max_feed_ratio: f64,
    /// How long a filter behind the interpolation takes to settle at each rest, ms; 0 where that is no longer than its window.
    pub settling_ms: f64,
    /// Time constant of a block at the start of a program, ms.
    pub constant_ms: f64,
    /// Every block takes its time constant, however short it is: corners are not controlled.
    pub keeps_constant: bool,
    /// What there is to probe.
    pub probe: Option<Surface>,
}

/// Time constant of a block where the machine file states none, ms.
const DEFAULT_CONSTANT_MS: f64 = 50.0;

/// A number with four significant digits: what somebody would write.
pub fn rounded(value: f64) -> f64 {
    format!("{value:.3e}")
        .parse()
        .expect("what is written is a number")
}

/// How the limits of one axis relate to those of the others.
struct Style {
    /// Every limit is drawn by itself over four decades.
    odd: bool,
    feed: f64,
    /// Speed over acceleration, s.
    speed_up_s: f64,
    /// Acceleration over jerk, s.
    build_up_s: f64,
    /// How much axes differ.
    spread: f64,
}

impl Style {
    fn draw(random: &mut Random) -> Self {
        Self {
            odd: random.below(4) == 0,
            feed: random.length(20.0, 200_000.0),
            speed_up_s: random.length(0.003, 1.0),
            build_up_s: random.length(0.002, 0.3),
            spread: [1.0, 1.5, 10.0][random.below(3) as usize],
        }
    }

    /// Feed, rapid, acceleration and jerk, the feeds per minute.
    fn limits(&self, random: &mut Random) -> [f64; 4] {
        let rapid_of = [1.0, 1.0, 1.5, 4.0, 0.7][random.below(5) as usize];
        if self.odd {
            let [feed, acceleration, jerk] =
                [(20.0, 200_000.0), (5.0, 50_000.0), (100.0, 1_000_000.0)]
                    .map(|(low, high)| random.length(low, high));
            return [feed, feed * rapid_of, acceleration, jerk].map(rounded);
        }
        let mut near = |value: f64| value * random.length(1.0 / self.spread, self.spread);
        let feed = near(self.feed);
        let acceleration = near(feed / 60.0 / self.speed_up_s);
        let jerk = near(acceleration / self.build_up_s);
        [feed, feed * rapid_of, acceleration, jerk].map(rounded)
    }
}

/// Draws a machine, with `planner` where one is asked for.
pub fn draw(random: &mut Random, planner: Option<Planner>) -> Drawn {
    let planner = planner.unwrap_or_else(|| draw_planner(random));
    let fines = [
        0.125, 0.2, 0.25, 0.37, 0.4, 0.5, 0.625, 0.8, 1.0, 1.0, 1.0, 1.25, 1.3, 1.6, 2.0,
    ];
    let fine_ms = if random.below(8) == 0 {
        rounded(random.between(0.125, 2.0))
    } else {
        random.pick(&fines)
    };
    let per_rough = if random.below(4) == 0 {
        random.pick(&[1, 1, 2, 4, 8])
    } else {
        1 + random.below(25)
    };
    let rough_ms = fine_ms * per_rough as f64;
    let max_feed_ratio = if random.below(2) == 0 {
        1.0
    } else {
        (random.between(1.0, 2.0) * 100.0).round() / 100.0
    };
    let axes = draw_axes(random);
    let mut drawn = Drawn {
        text: MachineText::default(),
        axes,
        planner,
        fine_ms,
        rough_ms,
        max_feed_ratio,
        settling_ms: 0.0,
        constant_ms: DEFAULT_CONSTANT_MS,
        keeps_constant: false,
        probe: None,
    };
    drawn.text.key("format", 1);
    drawn.loops_and_motion(random);
    let jerk = planner.keeps_jerk() || random.below(2) == 0;
    for axis in &drawn.axes {
        write_axis(&mut drawn.text, axis, jerk);
    }
    let plain = drawn.kinematics(random, jerk);
    drawn.planner(random);
    drawn.driver(random, plain);
    drawn
}

fn draw_planner(random: &mut Random) -> Planner {
    let mut of_hundred = random.below(100);
    for (planner, share) in Planner::SHARES {
        if of_hundred < share {
            return planner;
        }
        of_hundred -= share;
    }
    Planner::Smooth
}

fn draw_axes(random: &mut Random) -> Vec<Axis> {
    let count = random.pick(&[1, 2, 2, 3, 3, 3, 3, 4, 4, 5, 6, 8]);
    let mut letters: Vec<char> = "XYZABCUVW".chars().collect();
    // X first where there are few, so that most machines have a plane.
    while letters.len() > count {
        let last = if random.below(4) > 0 {
            letters.len() - 1
        } else {
            random.below(letters.len() as u64) as usize
        };
        letters.remove(if count <= 3 {
            last
        } else {
            last.max(random.below(3) as usize)
        });
    }
    let style = Style::draw(random);
    let wide = random.length(0.02, 2000.0);
    letters
        .into_iter()
        .map(|letter| draw_axis(random, letter, &style, wide))
        .collect()
}

fn draw_axis(random: &mut Random, letter: char, style: &Style, wide: f64) -> Axis {
    let rotary = ('A'..='C').contains(&letter) && random.below(5) > 0;
    let wide = if rotary {
        random.length(0.5, 7200.0)
    } else {
        wide * random.length(0.3, 3.0)
    };
    let four = |value: f64| (value * 1e4).round() / 1e4;
    let any = random.unit();
    let share = random.pick(&[0.0, 0.5, 0.5, any]);
    let (low, high) = (0.0 - four(share * wide), four((1.0 - share) * wide + 0.001));
    let start = if random.below(6) == 0 {
        four(random.between(low, high)).clamp(low, high)
    } else {
        0.0
    };
    let [feed, rapid, acceleration, jerk] = style.limits(random);
    Axis {
        letter,
        rotary,
        low,
        high,
        start,
        feed,
        rapid,
        acceleration,
        jerk,
    }
}

fn write_axis(text: &mut MachineText, axis: &Axis, jerk: bool) {
    let unit = axis.unit();
    text.table(&format!("[axes.{}]", axis.letter.to_ascii_lowercase()));
    if axis.rotary {
        text.key("kind", "\"rotary\"");
    }
    text.key(
        &format!("travel_{unit}"),
        format!("[{}, {}]", axis.low, axis.high),
    );
    if axis.start != 0.0 {
        text.key(&format!("start_{unit}"), axis.start);
    }
    text.key(&format!("max_feed_{unit}_per_min"), axis.feed);
    if axis.rapid != axis.feed {
        text.key(&format!("max_rapid_{unit}_per_min"), axis.rapid);
    }
    text.key(
        &format!("max_acceleration_{unit}_per_s2"),
        axis.acceleration,
    );
    if jerk {
        text.key(&format!("max_jerk_{unit}_per_s3"), axis.jerk);
    }
}
