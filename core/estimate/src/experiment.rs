//! The experiment: polygons to be timed, and corners whose minimum feed is looked for. As a program, and as a run.

use std::fmt::Write as _;

use tandem_gcode::Program;
use tandem_host::{Clock, HostError, Registry, Run, RunObserver, Switches};
use tandem_machine::Machine;
use tandem_rings::Sample;
use tandem_sdk::AxisVector;

use crate::diagnose::Corner;
use crate::measurements::LogRow;
use crate::polygon::{
    CORNERS, FEED_MM_PER_MIN, PlaneAxis, Polygon, SIDES_MM, SLOW_MM_PER_MIN, SLOW_STROKES_MM,
    STROKE, STROKES_MM, Timed,
};

/// Turns of the V paths, degrees.
const TURNS_DEG: [f64; 11] = [
    0.0, 10.0, 20.0, 30.0, 40.0, 45.0, 50.0, 60.0, 70.0, 80.0, 90.0,
];
/// Their feeds, mm/min.
const FEEDS_MM_PER_MIN: [f64; 10] = [
    200.0, 400.0, 600.0, 800.0, 1200.0, 1600.0, 2000.0, 2400.0, 2800.0, 3200.0,
];
/// How long a leg of a V takes at its feed, s: enough to reach it, and to see it.
const LEG_S: f64 = 0.5;
/// What a leg is longer than that, mm.
const LEG_MM: f64 = 2.0;
const MM_PER_MIN: f64 = 60.0;

/// Two legs that meet at the centre.
#[derive(Clone, Copy, Debug)]
struct Vee {
    turn_rad: f64,
    feed_mm_per_s: f64,
    leg_mm: f64,
}

/// The experiment for one machine.
#[derive(Clone, Debug)]
pub struct Experiment {
    /// The polygons that fit into the travel.
    pub polygons: Vec<Polygon>,
    /// Polygons that do not.
    pub left_out: Vec<Polygon>,
    vees: Vec<Vee>,
    center_mm: [f64; 2],
    axes: [usize; 2],
}

/// What was measured.
#[derive(Clone, Debug, Default)]
pub struct Measured {
    /// Times of the polygons.
    pub timed: Vec<Timed>,
    /// Minimum feeds of the corners.
    pub corners: Vec<Corner>,
}

/// The lines of one polygon or V in the program.
#[derive(Clone, Copy, Debug)]
struct Lines {
    first: u32,
    last: u32,
}

impl Experiment {
    /// The experiment in the plane of X and Y of `machine`, with at least `blocks` blocks to each polygon.
    ///
    /// # Errors
    /// The machine has no such plane, or no room in it.
    pub fn new(machine: &Machine, blocks: u32) -> Result<Self, String> {
        let axis = |letter| {
            machine
                .axes
                .index(letter)
                .ok_or_else(|| format!("the experiment needs an axis {letter}"))
        };
        let axes = [axis('X')?, axis('Y')?];
        let limits = axes.map(|axis| machine.limits.axes()[axis]);
        let middle = |i: usize| f64::midpoint(limits[i].min_mm, limits[i].max_mm);
        let half = |i: usize| (limits[i].max_mm - limits[i].min_mm) / 2.0;
        let finite = |value: f64| if value.is_finite() { value } else { 0.0 };
        let room_mm = half(0).min(half(1));
        let most = limits
            .iter()
            .fold(f64::INFINITY, |most, axis| most.min(axis.feed_mm_per_s));
        let all = CORNERS.iter().flat_map(|corners| {
            SIDES_MM.map(|side_mm| Polygon {
                corners: *corners,
                side_mm,
                rounds: blocks.div_ceil(*corners),
                along: PlaneAxis::X,
                feed_mm_per_s: (FEED_MM_PER_MIN / MM_PER_MIN).min(most),
                exact_stop: false,
            })
        });
        // Behind the others, so that a log of a program without them is one that ends early.
        let all = all.chain(strokes(blocks, most));
        let (polygons, left_out) =
            all.partition::<Vec<_>, _>(|polygon| polygon.radius_mm() <= room_mm);
        let this = Self {
            polygons,
            left_out,
            vees: vees().filter(|vee| vee.leg_mm <= room_mm).collect(),
            center_mm: [finite(middle(0)), finite(middle(1))],
            axes,
        };
        if this.polygons.len() < 6 {
            return Err(format!(
                "the travel leaves room for {} of the polygons only",
                this.polygons.len()
            ));
        }
        Ok(this)
    }

    /// The whole experiment as a program. With `stops` it waits before each polygon and says what to note; the V paths,
    /// whose feeds nobody can read by hand, are left out.
    pub fn program(&self, stops: bool) -> String {
        self.write(stops).0
    }

    /// Times of the polygons from the `log` of a control that has driven [`Experiment::program`] with stops: from when the first line
    /// of a polygon moves to when the line behind its last one does. Host; allocates.
    ///
    /// # Errors
    /// A log that misses polygons.
    pub fn timed(&self, log: &[LogRow]) -> Result<Vec<Timed>, String> {
        let lines = self.write(true).1;
        let starts = |line: u32| log.iter().find(|row| row.line >= line).map(|row| row.t_s);
        let timed = self.polygons.iter().zip(&lines).map(|(polygon, lines)| {
            let (from, to) = (starts(lines.first)?, starts(lines.last + 1)?);
            Some(Timed {
                polygon: *polygon,
                time_s: to - from,
                reading_error_s: 0.0,
            })
        });
        let timed: Vec<_> = timed.flatten().filter(|timed| timed.time_s > 0.0).collect();
        // A control may have driven a program that was written before there were strokes.
        let found = timed.iter().filter(|timed| !timed.polygon.is_stroke());
        let wanted = self.polygons.iter().filter(|p| !p.is_stroke());
        let (found, wanted) = (found.count(), wanted.count());
        if found == wanted {
            return Ok(timed);
        }
        Err(format!(
            "{found} of {wanted} polygons are in the log: it is to be that of the program which --program writes"
        ))
    }

    fn write(&self, stops: bool) -> (String, Vec<Lines>) {
        let mut text = "G21 G90 G94 G17 G40 G49 G80\nG64\n".to_string();
        let mut lines = Lines { first: 0, last: 2 };
        let mut all = vec![];
        for polygon in &self.polygons {
            if stops {
                let Polygon {
                    corners,
                    side_mm,
                    rounds,
                    along,
                    feed_mm_per_s,
                    exact_stop,
                } = polygon;
                let what = if polygon.is_stroke() {
                    let feed_mm_per_min = feed_mm_per_s * MM_PER_MIN;
                    format!(
                        "there and back along {}, F{feed_mm_per_min:.0}, exact stop {},",
                        along.letter(),
                        u8::from(*exact_stop)
                    )
                } else {
                    format!("n {corners}")
                };
                let _ = writeln!(
                    text,
                    "(note the seconds from here: {what} side {side_mm} repetitions {rounds})"
                );
                text += "M0\n";
                lines.last += 2;
            }
            lines = self.polygon(polygon, lines.last, &mut text);
            all.push(lines);
        }
        for vee in self.vees.iter().filter(|_| !stops) {
            lines = self.vee(vee, lines.last, &mut text);
            all.push(lines);
        }
        text += "M2\n";
        (text, all)
    }

    fn polygon(&self, polygon: &Polygon, before: u32, text: &mut String) -> Lines {
        polygon.write(self.center_mm, text);
        Lines {
            first: before + 4,
            last: before + 3 + polygon.blocks(),
        }
    }

    fn vee(&self, vee: &Vee, before: u32, text: &mut String) -> Lines {
        let [x, y] = self.center_mm;
        let end = [
            x + vee.leg_mm * vee.turn_rad.cos(),
            y + vee.leg_mm * vee.turn_rad.sin(),
        ];
        let _ = writeln!(text, "G64 G0 X{:.6} Y{y:.6}", x - vee.leg_mm);
        let _ = writeln!(text, "G4 P0.1");
        let _ = writeln!(
            text,
            "G1 X{x:.6} Y{y:.6} F{:.3}",
            vee.feed_mm_per_s * MM_PER_MIN
        );
        let _ = writeln!(text, "G1 X{:.6} Y{:.6}", end[0], end[1]);
        Lines {
            first: before + 3,
            last: before + 4,
        }
    }

    /// Runs the experiment on the machine's driver.
    ///
    /// # Errors
    /// The machine refuses, or the run does not come to its end.
    pub fn run(
        &self,
        machine: &Machine,
        registry: &Registry,
        clock: Clock,
    ) -> Result<Measured, String> {
        let (text, lines) = self.write(false);
        let program =
            Program::spool("the experiment", text.as_bytes()).map_err(|e| e.to_string())?;
        let run = Run::prepare(
            machine.clone(),
            registry,
            program,
            Switches {
                clock: Some(clock),
                ..Switches::default()
            },
        )
        .map_err(|e| match e {
            HostError::Check(report) => report
                .diagnostics
                .first()
                .map_or_else(String::new, ToString::to_string),
            other => other.to_string(),
        })?;
        let mut watch = Watch {
            experiment: self,
            lines: &lines,
            period_s: machine.fine_period_s,
            samples: vec![0; lines.len()],
            least: vec![f64::INFINITY; lines.len()],
            now: 0,
            last: None,
        };
        let summary = run
            .drive(clock, &[], &mut watch)
            .map_err(|e| e.to_string())?
            .summary;
        if let Some(cause) = summary.fault.or(summary.stopped) {
            return Err(format!("the experiment ended early: {cause}"));
        }
        Ok(watch.measured())
    }
}

/// Strokes along both axes, at no more than `most` mm/s. At their feed none takes longer than `blocks` of the longest sides of the
/// polygons.
fn strokes(blocks: u32, most: f64) -> impl Iterator<Item = Polygon> {
    let longest = SIDES_MM[SIDES_MM.len() - 1] / FEED_MM_PER_MIN;
    let fast = STROKES_MM.map(|side_mm| (side_mm, FEED_MM_PER_MIN));
    let slow = SLOW_STROKES_MM.map(|side_mm| (side_mm, SLOW_MM_PER_MIN));
    let all = fast.into_iter().chain(slow);
    all.flat_map(move |(side_mm, feed_mm_per_min)| {
        let share = (longest * feed_mm_per_min / side_mm).min(1.0);
        [PlaneAxis::X, PlaneAxis::Y].map(|along| Polygon {
            corners: STROKE,
            side_mm,
            rounds: (f64::from(blocks) * share / f64::from(STROKE)).ceil() as u32,
            along,
            feed_mm_per_s: (feed_mm_per_min / MM_PER_MIN).min(most),
            exact_stop: feed_mm_per_min < FEED_MM_PER_MIN,
        })
    })
}

fn vees() -> impl Iterator<Item = Vee> {
    let all = TURNS_DEG
        .iter()
        .flat_map(|turn| FEEDS_MM_PER_MIN.map(|feed| (turn.to_radians(), feed / MM_PER_MIN)));
    all.map(|(turn_rad, feed_mm_per_s)| Vee {
        turn_rad,
        feed_mm_per_s,
        leg_mm: LEG_MM + LEG_S * feed_mm_per_s,
    })
}

/// Takes times and feeds from the samples that were sent.
struct Watch<'a> {
    experiment: &'a Experiment,
    lines: &'a [Lines],
    period_s: f64,
    samples: Vec<u64>,
    least: Vec<f64>,
    now: usize,
    last: Option<AxisVector>,
}

impl RunObserver for Watch<'_> {
    fn sample(&mut self, sample: &Sample, _deviation_mm: f64, _signals: &[f64]) {
        let last = self.last.replace(sample.command);
        while self.now < self.lines.len() && sample.line > self.lines[self.now].last {
            self.now += 1;
        }
        let Some(lines) = self
            .lines
            .get(self.now)
            .filter(|lines| sample.line >= lines.first)
        else {
            return;
        };
        self.samples[self.now] += u64::from(sample.line <= lines.last);
        if let (Some(vee), Some(last)) = (self.vee(), last) {
            let [x, y] = self
                .experiment
                .axes
                .map(|axis| sample.command[axis] - last[axis]);
            let near = |position: &AxisVector| {
                let [x, y] = self.experiment.axes.map(|axis| position[axis]);
                (x - self.experiment.center_mm[0]).hypot(y - self.experiment.center_mm[1])
                    < vee.leg_mm / 2.0
            };
            if near(&last) && near(&sample.command) {
                self.least[self.now] = self.least[self.now].min(x.hypot(y) / self.period_s);
            }
        }
    }
}

impl Watch<'_> {
    fn vee(&self) -> Option<&Vee> {
        self.experiment
            .vees
            .get(self.now.checked_sub(self.experiment.polygons.len())?)
    }

    fn measured(self) -> Measured {
        let Experiment { polygons, vees, .. } = self.experiment;
        let times = self
            .samples
            .iter()
            .map(|samples| *samples as f64 * self.period_s);
        let timed = polygons.iter().zip(times);
        let timed = timed.map(|(polygon, time_s)| Timed {
            polygon: *polygon,
            time_s,
            reading_error_s: 0.0,
        });
        let corners = vees
            .iter()
            .zip(&self.least[polygons.len()..])
            .filter(|(_, least)| least.is_finite());
        let corner = |(vee, least): (&Vee, &f64)| Corner {
            turn_rad: vee.turn_rad,
            feed_mm_per_s: vee.feed_mm_per_s,
            min_mm_per_s: *least,
            reading_error_mm_per_s: 0.0,
        };
        Measured {
            timed: timed.collect(),
            corners: corners.map(corner).collect(),
        }
    }
}
