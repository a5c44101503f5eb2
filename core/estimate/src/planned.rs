//! Another control taken for one of Tandem's planners: limits and tolerance of its own, and no closed form.
//!
//! A control that bounds jerk, or rounds corners within a tolerance, has no time of a block that depends on its neighbours alone. But
//! it is near the fastest motion within its limits, and so are the planners here. So its times are those of a planner with limits
//! that are fitted: `smooth` (acceleration, jerk and tolerance) or `block-overlap` with its defaults (time constant, acceleration,
//! tolerance). For the fit the planner plans the polygons alone, without a loop behind it.

use nalgebra::{DMatrix, DVector};
use tandem_gcode::Program;
use tandem_host::{Registry, Switches, each_block, planner};
use tandem_machine::{GuardMode, JerkMode, Machine};
use tandem_sdk::{
    Accepted, Block, BlockKind, BlockReport, MAX_AXES, Planner, Segment, SegmentSink,
};

use crate::polygon::{PlaneAxis, Polygon, Timed};

mod strokes;

/// Blocks of a polygon before the rounds that are timed.
const BEFORE_BLOCKS: u32 = 8;
/// Blocks in those at least: to find where to begin, and to tell the axes apart. A round differs from the next by some percent where
/// limits are unequal, because windows of the plan end at another place of it.
const FEW_BLOCKS: u32 = 12;
const MANY_BLOCKS: u32 = 60;
/// Program time that the planner is asked for at once, s, and calls without any after which it is stuck.
const PART_S: f64 = 0.1;
const MAX_IDLE_CALLS: u32 = 4;
/// Where the polygons lie for the fit: as far as they need.
const ROOM_MM: f64 = 1e5;

/// Which planner.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlannerKind {
    /// Jerk is bounded, and the path is smoothed within the tolerance.
    Smooth,
    /// Blocks overlap by a time constant, within tolerance and acceleration.
    BlockOverlap,
}

impl PlannerKind {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Smooth, Self::BlockOverlap];

    /// The name of the plugin, of the model, and of its table in a model file.
    pub fn name(self) -> &'static str {
        match self {
            Self::Smooth => "smooth",
            Self::BlockOverlap => "block-overlap",
        }
    }
}

/// A planner with its constants.
#[derive(Clone, Debug, PartialEq)]
pub struct Planned {
    /// Which.
    pub kind: PlannerKind,
    /// Acceleration of each axis in the order of the machine file, mm/s².
    pub acceleration_mm_per_s2: [f64; MAX_AXES],
    /// Jerk of each axis, mm/s³: `smooth`.
    pub jerk_mm_per_s3: [f64; MAX_AXES],
    /// Distance from the path where a program states none, mm.
    pub path_tolerance_mm: f64,
    /// Time constant, s: `block-overlap`.
    pub time_constant_s: f64,
}

impl Planned {
    /// What a machine file says of itself, for the planner `kind`: where a fit begins.
    pub fn of(machine: &Machine, kind: PlannerKind) -> Self {
        let axes = &machine.limits.axes;
        Self {
            kind,
            acceleration_mm_per_s2: axes.map(|axis| axis.acceleration_mm_per_s2),
            jerk_mm_per_s3: axes.map(|axis| axis.jerk_mm_per_s3),
            path_tolerance_mm: machine.motion.path_tolerance_mm,
            time_constant_s: machine.motion.time_constant_s,
        }
    }

    /// `machine` with this planner and these constants; what it is driven by stays.
    pub fn machine(&self, machine: &Machine) -> Machine {
        let mut made = machine.clone();
        made.planner.plugin = self.kind.name().to_string();
        made.planner.options = String::new();
        for (i, axis) in made.limits.axes.iter_mut().enumerate() {
            axis.acceleration_mm_per_s2 = self.acceleration_mm_per_s2[i];
            axis.jerk_mm_per_s3 = match self.kind {
                PlannerKind::Smooth => self.jerk_mm_per_s3[i],
                PlannerKind::BlockOverlap => f64::INFINITY,
            };
        }
        made.motion.path_tolerance_mm = self.path_tolerance_mm;
        made.motion.time_constant_s = self.time_constant_s;
        made.motion.jerk = JerkMode::Limit;
        made.guard = GuardMode::Stop;
        made
    }

    /// With one acceleration and one jerk for both axes of the plane, between those.
    fn alike(&self) -> Self {
        let mut alike = self.clone();
        for limits in [&mut alike.acceleration_mm_per_s2, &mut alike.jerk_mm_per_s3] {
            *limits = [(limits[0] * limits[1]).sqrt(); MAX_AXES];
        }
        alike
    }

    /// Its constants, in a line.
    pub fn constants(&self) -> String {
        let both = |values: &[f64; MAX_AXES], unit: &str| {
            if values[0] == values[1] {
                format!("{:.1} {unit}", values[0])
            } else {
                format!(
                    "{:.1} {unit} along X and {:.1} along Y",
                    values[0], values[1]
                )
            }
        };
        let acceleration = both(&self.acceleration_mm_per_s2, "mm/s²");
        let tolerance_um = 1e3 * self.path_tolerance_mm;
        match self.kind {
            PlannerKind::Smooth => {
                let jerk = both(&self.jerk_mm_per_s3, "mm/s³");
                format!("acceleration {acceleration}, jerk {jerk}, tolerance {tolerance_um:.2} µm")
            }
            PlannerKind::BlockOverlap => {
                let constant_ms = 1e3 * self.time_constant_s;
                format!(
                    "time constant {constant_ms:.2} ms, acceleration {acceleration}, tolerance {tolerance_um:.2} µm"
                )
            }
        }
    }
}

/// The polygons as blocks, and which rounds of each are timed.
pub struct Bench<'a> {
    machine: Machine,
    registry: &'a Registry,
    blocks: Vec<Block>,
    parts: Vec<Part>,
}

/// The blocks of one polygon: all, and those of the rounds in the middle.
struct Part {
    all: std::ops::Range<u64>,
    middle: std::ops::Range<u64>,
    /// Rounds driven here, rounds in the middle, and rounds that were timed.
    rounds: [u32; 3],
}

impl<'a> Bench<'a> {
    /// The polygons that were `timed`, on a machine like `machine` with room for them, with so many blocks of each in the middle.
    ///
    /// # Errors
    /// They are no program that the machine reads.
    pub fn new(
        machine: &Machine,
        registry: &'a Registry,
        timed: &[Timed],
        blocks: u32,
    ) -> Result<Self, String> {
        let mut machine = machine.clone();
        for axis in &mut machine.limits.axes {
            (axis.min_mm, axis.max_mm) = (-ROOM_MM, ROOM_MM);
        }
        let axis = |letter| {
            machine
                .axes
                .index(letter)
                .ok_or_else(|| format!("the polygons need an axis {letter}"))
        };
        let (x, y) = (axis('X')?, axis('Y')?);
        (machine.start[x], machine.start[y]) = (0.0, 0.0);
        let mut text = "G21 G90 G94 G17 G40 G49 G80\nG64\n".to_string();
        let mut wanted = vec![];
        for timed in timed {
            let Polygon {
                corners, rounds, ..
            } = timed.polygon;
            let middle = blocks.div_ceil(corners);
            let around = (2 * BEFORE_BLOCKS).div_ceil(corners);
            let driven = (middle + around).min(rounds);
            let shorter = Polygon {
                rounds: driven,
                ..timed.polygon
            };
            shorter.write([0.0; 2], &mut text);
            let from = if driven == middle + around {
                BEFORE_BLOCKS
            } else {
                0
            };
            wanted.push((corners, from, [driven, middle.min(driven), rounds]));
        }
        text += "M2\n";
        let mut program =
            Program::spool("the polygons", text.as_bytes()).map_err(|e| e.to_string())?;
        let mut blocks = vec![];
        let report = each_block(
            &machine,
            &mut program,
            Switches::default(),
            &mut |block, _| {
                blocks.push(*block);
            },
        )
        .map_err(|e| e.to_string())?;
        if let Some(wrong) = report.diagnostics.first() {
            return Err(wrong.to_string());
        }
        let mut lines = blocks
            .iter()
            .filter(|block| block.kind == BlockKind::Line)
            .map(|block| block.index);
        let parts = wanted.iter().map(|(corners, from, rounds)| {
            let first = lines.next()?;
            let count = u64::from(corners * rounds[0]);
            lines.nth(count as usize - 2)?;
            let middle = first + u64::from(*from);
            Some(Part {
                all: first..first + count,
                middle: middle..middle + u64::from(corners * rounds[1]),
                rounds: *rounds,
            })
        });
        let parts: Option<Vec<_>> = parts.collect();
        Ok(Self {
            parts: parts.ok_or("the polygons are not driven as they are written")?,
            machine,
            registry,
            blocks,
        })
    }

    /// What the polygons take under `planned`, s.
    ///
    /// # Errors
    /// The planner refuses, or is stuck.
    pub fn times_s(&self, planned: &Planned) -> Result<Vec<f64>, String> {
        let machine = planned.machine(&self.machine);
        let mut planner = planner(&machine, self.registry).map_err(|e| e.to_string())?;
        let taken = durations(planner.as_mut(), &self.blocks)?;
        let sum = |range: &std::ops::Range<u64>| -> f64 {
            let within = range.clone().filter_map(|index| taken.get(index as usize));
            within.sum()
        };
        let time = |part: &Part| {
            let [driven, middle, rounds] = part.rounds;
            let round_s = sum(&part.middle) / f64::from(middle);
            sum(&part.all) + f64::from(rounds - driven) * round_s
        };
        Ok(self.parts.iter().map(time).collect())
    }
}

/// What each block takes by its index, s: program time in which it is the one that moves.
fn durations(planner: &mut dyn Planner, blocks: &[Block]) -> Result<Vec<f64>, String> {
    let last = blocks.last().map_or(0, |block| block.index) as usize;
    let mut taken = Taken(vec![0.0; last + 1]);
    let (mut next, mut idle) = (0, 0);
    loop {
        let mut fed = false;
        while let Some(block) = blocks.get(next) {
            match planner.accept(block, None).map_err(|e| e.to_string())? {
                Accepted::Accepted => (next, fed) = (next + 1, true),
                Accepted::Full => break,
            }
        }
        if fed && next == blocks.len() {
            planner.finish();
        }
        let advanced = planner
            .advance(PART_S, &mut taken)
            .map_err(|e| e.to_string())?;
        if advanced.done != 0 {
            return Ok(taken.0);
        }
        idle = if fed || advanced.duration_s > 0.0 {
            0
        } else {
            idle + 1
        };
        if idle > MAX_IDLE_CALLS {
            return Err("the planner does not get on".to_string());
        }
    }
}

/// Program time by block.
struct Taken(Vec<f64>);

impl SegmentSink for Taken {
    fn segment(&mut self, segment: &Segment) {
        if let Some(taken) = self.0.get_mut(segment.block as usize) {
            *taken += segment.duration_s;
        }
    }

    fn block(&mut self, _report: &BlockReport) {}
}

/// Widest range of a constant that a fit looks in, as a factor on both sides of where it begins.
const WIDEST: f64 = 400.0;
/// Steps of a fit, and the share by which a probe changes a constant. Planning on a grid makes times a little rough, so that a
/// smaller one finds roughness.
const MAX_STEPS: u32 = 8;
const PROBE: f64 = 0.03;
/// Share by which the sum of the squares is to fall for another step, and for constants of each axis to be worth their number.
const WORTH: f64 = 1e-2;
/// Damping at which a step is too short to matter.
const MAX_DAMPING: f64 = 1e2;
const WORTH_OF_AXES: f64 = 0.8;
/// How unequal two axes are where the search for that begins.
const ASKEW: [f64; 3] = [0.6, 1.0, 1.0 / 0.6];
/// Two axes exchanged are a start worth a search where they leave less than so many times the squares.
const TURNED: f64 = 4.0;
/// Strokes along each axis with which acceleration and jerk of it are told by them alone. Their times are smooth in the constants, while
/// those of polygons step by up to a percent where windows of the plan end elsewhere, and a search among those alone stops early.
const TELLING_STROKES: usize = 3;
/// Tolerances that are tried beside what strokes tell, mm: of what a control may keep, so near to each other that a search from one of them
/// comes to those between.
const TOLERANCES_MM: [f64; 6] = [0.001, 0.003, 0.008, 0.02, 0.05, 0.12];
/// From so many of the starts that fit best the search goes on.
const FOLLOWED: usize = 4;
/// Polygons this near to their feed tell nothing of the limits.
const AT_FEED: f64 = 0.998;

/// Which constants are fitted, as logarithms.
#[derive(Clone, Copy)]
struct Form {
    kind: PlannerKind,
    /// X and Y each have their own.
    by_axes: bool,
}

impl Form {
    fn logs(self, planned: &Planned) -> Vec<f64> {
        let mut all = vec![planned.path_tolerance_mm];
        let axes = if self.by_axes { 2 } else { 1 };
        all.extend(&planned.acceleration_mm_per_s2[..axes]);
        match self.kind {
            PlannerKind::Smooth => all.extend(&planned.jerk_mm_per_s3[..axes]),
            PlannerKind::BlockOverlap => all.push(planned.time_constant_s),
        }
        all.iter().map(|value| value.ln()).collect()
    }

    /// By how much the logarithm of a constant is changed to see what it does: a time constant by whole periods, because the planner rounds
    /// it to them.
    fn probe(self, index: usize, logs: &[f64], period_s: f64) -> f64 {
        if self.kind == PlannerKind::BlockOverlap && index + 1 == logs.len() {
            let periods = (logs[index].exp() / period_s).round().max(1.0);
            ((periods + (PROBE * periods).ceil()) / periods).ln()
        } else {
            PROBE
        }
    }

    fn planned(self, logs: &[f64]) -> Planned {
        let mut values = logs.iter().map(|log| log.exp());
        let mut next = || values.next().unwrap_or(1.0);
        let path_tolerance_mm = next();
        let mut each = || {
            let x = next();
            let y = if self.by_axes { next() } else { x };
            let mut all = [x.min(y); MAX_AXES];
            (all[0], all[1]) = (x, y);
            all
        };
        let acceleration_mm_per_s2 = each();
        let (jerk_mm_per_s3, time_constant_s) = match self.kind {
            PlannerKind::Smooth => (each(), 0.05),
            PlannerKind::BlockOverlap => ([f64::INFINITY; MAX_AXES], next()),
        };
        Planned {
            kind: self.kind,
            acceleration_mm_per_s2,
            jerk_mm_per_s3,
            path_tolerance_mm,
            time_constant_s,
        }
    }
}

/// Fits the planner `kind` to the times of polygons. It begins where lines there and back fit best; without lines along both axes at what the
/// machine file says. Host; allocates.
///
/// # Errors
/// The polygons cannot be planned on this machine.
pub fn fit(
    machine: &Machine,
    registry: &Registry,
    timed: &[Timed],
    kind: PlannerKind,
) -> Result<(Planned, Vec<f64>), String> {
    let tells = |timed: &&Timed| timed.mean_feed_mm_per_s() < AT_FEED * timed.polygon.feed_mm_per_s;
    let mut telling: Vec<Timed> = timed.iter().filter(tells).copied().collect();
    if telling.len() < 6 {
        telling = timed.to_vec();
    }
    let bench = |timed: &[Timed], blocks| Bench::new(machine, registry, timed, blocks);
    let rough = Fit {
        bench: &bench(&telling, FEW_BLOCKS)?,
        timed: &telling,
    };
    let one = Form {
        kind,
        by_axes: false,
    };
    let fine = Fit {
        bench: &bench(&telling, MANY_BLOCKS)?,
        timed: &telling,
    };
    // Where to begin a third of them says as well.
    let some: Vec<Timed> = telling.iter().step_by(3).copied().collect();
    let few = Fit {
        bench: &bench(&some, FEW_BLOCKS)?,
        timed: &some,
    };
    let each = Form {
        kind,
        by_axes: true,
    };
    let own = Planned::of(machine, kind);
    let is_stroke = |timed: &&Timed| timed.polygon.is_stroke();
    let strokes: Vec<Timed> = telling.iter().filter(is_stroke).copied().collect();
    let along = |axis| strokes.iter().filter(|t| t.polygon.along == axis).count();
    let tell_axes = [PlaneAxis::X, PlaneAxis::Y]
        .into_iter()
        .all(|axis| along(axis) >= TELLING_STROKES);
    let found = if tell_axes {
        let starts = strokes::starts(&own, &strokes, machine.fine_period_s);
        if starts.tell_jerk {
            from_strokes([&few, &rough, &fine], [one, each], &starts.all)
        } else {
            starts.all.into_iter().next()
        }
        .ok_or("no lines are timed")?
    } else {
        let alike = rough.near(one, &few.start(one, &own)).planned;
        without_strokes(&rough, &fine, each, &alike)
            .filter(|of_axes| is_worth(of_axes, fine.square(&alike)))
            .map_or(alike, |of_axes| of_axes.planned)
    };
    let times_s = bench(timed, MANY_BLOCKS)?.times_s(&found)?;
    Ok((found, times_s))
}

/// Whether constants for each axis leave so much less than the squares of those for both that they are worth their number.
fn is_worth(of_axes: &Found, alike: f64) -> bool {
    of_axes.square < WORTH_OF_AXES.powi(2) * alike
}

/// The best constants from `starts` that lines there and back tell, with two forms: alike for both axes, and for each its own.
fn from_strokes(
    [few, rough, fine]: [&Fit; 3],
    [one, each]: [Form; 2],
    starts: &[Planned],
) -> Option<Planned> {
    let of_axes = few.near_one_of(each, starts)?;
    let mut start = of_axes.planned.clone();
    // A few polygons tell the tolerance, and what lines leave open. Their times are rougher than those of lines.
    if let [told] = starts {
        start = Planned {
            path_tolerance_mm: start.path_tolerance_mm,
            ..told.clone()
        };
    }
    let alike = few.near(one, &start.alike());
    Some(if is_worth(&of_axes, alike.square) {
        settle(rough, fine, each, &start)
    } else {
        settle(rough, fine, one, &start.alike())
    })
}

/// The best constants near `start`: fewer blocks of the same polygons tell the slopes in half the time.
fn settle(rough: &Fit, fine: &Fit, form: Form, start: &Planned) -> Planned {
    let slopes = |logs: &[f64], here: &[f64]| {
        let there = rough.residuals(&form.planned(logs));
        there.map_or_else(
            || fine.slopes(form, logs, here),
            |there| rough.slopes(form, logs, &there),
        )
    };
    fine.search(form, start, slopes).planned
}

/// The best constants for each axis that polygons alone tell, and the squares that they leave. They lie askew, and so they tell which
/// axis is the weaker one; it may be so in one limit and not in the other.
fn without_strokes(rough: &Fit, fine: &Fit, each: Form, alike: &Planned) -> Option<Found> {
    let factors = ASKEW.iter().flat_map(|a| ASKEW.map(|j| [*a, j]));
    let counts = |[a, j]: &[f64; 2]| match each.kind {
        PlannerKind::Smooth => [*a, *j] != [1.0; 2],
        PlannerKind::BlockOverlap => *a != 1.0 && *j == 1.0,
    };
    let starts = factors
        .filter(counts)
        .map(|factors| rough.askew(alike, factors));
    let (_, start) = starts.min_by(|(one, _), (other, _)| one.total_cmp(other))?;
    let found = fine.near(each, &start);
    // Two axes exchanged make nearly the same times.
    let mut turned = found.planned.clone();
    turned.acceleration_mm_per_s2.swap(0, 1);
    turned.jerk_mm_per_s3.swap(0, 1);
    if fine.square(&turned) >= TURNED * found.square {
        return Some(found);
    }
    let other = fine.near(each, &turned);
    Some(if other.square < found.square {
        other
    } else {
        found
    })
}

/// The best constants near a start.
struct Found {
    planned: Planned,
    /// The sum of the squares that they leave.
    square: f64,
}

/// What is fitted to what.
struct Fit<'a> {
    bench: &'a Bench<'a>,
    timed: &'a [Timed],
}

impl Fit<'_> {
    /// Logarithms of the ratios of times, by how well each is known; none where it cannot be planned.
    fn residuals(&self, planned: &Planned) -> Option<Vec<f64>> {
        let times_s = self.bench.times_s(planned).ok()?;
        let pairs = times_s.iter().zip(self.timed);
        let residuals = pairs.map(|(s, t)| (s / t.time_s).ln() * t.weight());
        let all: Vec<f64> = residuals.collect();
        all.iter().all(|r| r.is_finite()).then_some(all)
    }

    fn square(&self, planned: &Planned) -> f64 {
        let residuals = self.residuals(planned);
        residuals.map_or(f64::INFINITY, |all| all.iter().map(|r| r * r).sum())
    }

    /// The best of some constants around those of the machine file.
    fn start(&self, form: Form, of: &Planned) -> Planned {
        let mut from = of.clone();
        let a = from.acceleration_mm_per_s2[0];
        let finite = |jerk: f64| if jerk.is_finite() { jerk } else { 20.0 * a };
        from.jerk_mm_per_s3 = from.jerk_mm_per_s3.map(finite);
        from.path_tolerance_mm = from.path_tolerance_mm.max(1e-4);
        from.time_constant_s = from.time_constant_s.max(1e-3);
        let scaled = |factors: [f64; 2]| {
            let mut start = from.clone();
            start.acceleration_mm_per_s2 = start.acceleration_mm_per_s2.map(|a| a * factors[0]);
            match form.kind {
                PlannerKind::Smooth => {
                    start.jerk_mm_per_s3 = start.jerk_mm_per_s3.map(|j| j * factors[1]);
                }
                PlannerKind::BlockOverlap => start.time_constant_s *= factors[1],
            }
            start
        };
        let factors = [0.25, 1.0, 4.0];
        let all = factors.iter().flat_map(|a| factors.map(|b| [*a, b]));
        let tried = all.map(scaled).map(|start| (self.square(&start), start));
        let best = tried.min_by(|(one, _), (other, _)| one.total_cmp(other));
        best.map_or(from.clone(), |(_, start)| start)
    }

    /// The best constants of `form` near the best of some `starts`, each of which gets one of a few tolerances.
    fn near_one_of(&self, form: Form, starts: &[Planned]) -> Option<Found> {
        let of_tolerances = starts.iter().map(|start| {
            let tried = TOLERANCES_MM.map(|path_tolerance_mm| {
                let start = Planned {
                    path_tolerance_mm,
                    ..start.clone()
                };
                (self.square(&start), start)
            });
            let best = tried
                .into_iter()
                .min_by(|one, other| one.0.total_cmp(&other.0));
            best.unwrap_or_else(|| (f64::INFINITY, start.clone()))
        });
        let mut tried: Vec<_> = of_tolerances.collect();
        tried.sort_by(|(one, _), (other, _)| one.total_cmp(other));
        let followed = tried.iter().take(FOLLOWED);
        let found = followed.map(|(_, start)| self.near(form, start));
        found.min_by(|one, other| one.square.total_cmp(&other.square))
    }

    /// `alike` with two unequal axes whose times are as long in the mean, and the squares that it leaves.
    fn askew(&self, alike: &Planned, [a, j]: [f64; 2]) -> (f64, Planned) {
        let mut start = alike.clone();
        let unequal = |limits: &mut [f64; MAX_AXES], factor: f64| {
            (limits[0], limits[1]) = (limits[0] * factor, limits[1] / factor);
        };
        unequal(&mut start.acceleration_mm_per_s2, a);
        unequal(&mut start.jerk_mm_per_s3, j);
        let Some(residuals) = self.residuals(&start) else {
            return (f64::INFINITY, start);
        };
        let mean = residuals.iter().sum::<f64>() / residuals.len() as f64;
        // Times go with the square root of accelerations, and with the cube root of jerks.
        start.acceleration_mm_per_s2 = start.acceleration_mm_per_s2.map(|a| a * (2.0 * mean).exp());
        start.jerk_mm_per_s3 = start.jerk_mm_per_s3.map(|j| j * (3.0 * mean).exp());
        let squares = residuals.iter().map(|r| (r - mean).powi(2)).sum();
        (squares, start)
    }

    /// The constants of `form` that fit best near `start`.
    fn near(&self, form: Form, start: &Planned) -> Found {
        self.search(form, start, |logs, here| self.slopes(form, logs, here))
    }

    /// How the residuals `here` change with each constant.
    fn slopes(&self, form: Form, logs: &[f64], here: &[f64]) -> DMatrix<f64> {
        let mut slopes = DMatrix::zeros(here.len(), logs.len());
        for index in 0..logs.len() {
            let probe = form.probe(index, logs, self.bench.machine.fine_period_s);
            let mut moved = logs.to_vec();
            moved[index] += probe;
            let there = self.residuals(&form.planned(&moved)).unwrap_or_default();
            for (row, (there, here)) in there.iter().zip(here).enumerate() {
                slopes[(row, index)] = (there - here) / probe;
            }
        }
        slopes
    }

    /// The constants of `form` that fit best near `start`, by damped Gauss-Newton steps with the `slopes` at logarithms and residuals.
    fn search(
        &self,
        form: Form,
        start: &Planned,
        slopes: impl Fn(&[f64], &[f64]) -> DMatrix<f64>,
    ) -> Found {
        let first = form.logs(start);
        let mut logs = first.clone();
        let Some(mut here) = self.residuals(&form.planned(&logs)) else {
            return Found {
                planned: start.clone(),
                square: f64::INFINITY,
            };
        };
        let square = |values: &[f64]| values.iter().map(|v| v * v).sum::<f64>();
        let mut damping = 1e-2;
        'steps: for _ in 0..MAX_STEPS {
            let jacobian = slopes(&logs, &here);
            let gradient = jacobian.transpose() * DVector::from_column_slice(&here);
            let normal = jacobian.transpose() * &jacobian;
            loop {
                let eased = normal.diagonal().map(|d| damping * d + 1e-9);
                let Some(step) = (&normal + DMatrix::from_diagonal(&eased))
                    .lu()
                    .solve(&gradient)
                else {
                    break 'steps;
                };
                let stepped = logs.iter().zip(step.iter()).zip(&first);
                let next: Vec<f64> = stepped
                    .map(|((log, step), first)| {
                        let widest = WIDEST.ln();
                        (log - step.clamp(-1.0, 1.0)).clamp(first - widest, first + widest)
                    })
                    .collect();
                let there = self.residuals(&form.planned(&next));
                let before = square(&here);
                if let Some(there) = there.filter(|there| square(there) < before) {
                    let after = square(&there);
                    logs = next;
                    here = there;
                    damping /= 5.0;
                    if after > before * (1.0 - WORTH) {
                        break 'steps;
                    }
                    break;
                }
                damping *= 6.0;
                if damping > MAX_DAMPING {
                    break 'steps;
                }
            }
        }
        Found {
            planned: form.planned(&logs),
            square: square(&here),
        }
    }
}
