//! Where the motion must pass, and how near.

use tandem_motion::in_wide_instructions;
use tandem_motion::tube::{Lanes, Waypoint, each};

use crate::frame::{dot, larger, largest, minus};
use crate::route::{Chord, Run};
use crate::timing::Mark;
use crate::travel::Travel;

/// Share of the tolerance that boxes use.
pub const BOX_SHARE: f64 = 0.955;
/// A turn by more than this, as the size of the change of direction, always has a waypoint.
const SHARP: f64 = 0.1;
/// Share of a feed below which another is another feed.
const OTHER_FEED: f64 = 0.99;
/// Time by which the motion may be early or late where the feed changes, s.
const TIMELY_S: f64 = 3e-4;
/// Half a box along the path at most, as a multiple of the tolerance: where a single axis moves nothing else bounds it.
const LONGEST: f64 = 150.0;
/// The same in mm, where that is more: how early or late the motion is on a line has nothing to do with the tolerance.
const LONGEST_MM: f64 = 1.5;
/// Share of the tolerance that a box may stand off a path that bends, at its ends along the path.
const BENT: f64 = 0.2;
/// Half a box along a path that bends at most, mm; or ten times the tolerance, where that is more.
const LOOSE_MM: f64 = 0.1;
/// Steps of the grid in whose way, and in that of the time in which the speed is built up, a box is of use: a slow motion has
/// next to no jerk, and would go anywhere in a wider one.
const SWING_STEPS: f64 = 4.0;
/// Half a box along the path at most, in the same way.
const LONGEST_SWING: f64 = 10.0;
/// Way over which turns count for the shape of a box, mm.
const NEAR: f64 = 0.6;
/// Steps behind the start of a window in motion over which boxes become as narrow as they are to be.
const BEGINNING: f64 = 8.0;
/// Firm waypoints in a step at most.
const DENSEST: f64 = 16.0;
/// Other waypoints in a step at most. At 2 and 4 curves at 1 µm are driven up to 1.3 times as long as they need be, where 3.5 and 3
/// keep within 1.2 (`smooth_at_a_micrometre_is_near_the_exact_curve`).
const DENSE: f64 = 3.5;
/// Intervals of a window at least and at most.
pub const INTERVALS: (usize, usize) = (7, 420);
/// Most waypoints of a window: two lie a sixteenth of a step apart, or between them lie those that fill a gap.
pub const MAX_WAYPOINTS: usize = (DENSEST as usize + 2) * INTERVALS.1;
/// Share of its box that a lane gets which rests: a slow motion has next to no jerk, and would go to the middle of what its travel
/// leaves of a wide one.
const STILL: f64 = 1e-6;
/// Vertices looked at on each side.
const LOOKS: usize = 24;

/// A place that may become a waypoint.
#[derive(Clone, Copy, Debug)]
pub struct Candidate<const L: usize> {
    pub s: f64,
    chord: u32,
    /// At the start of the chord.
    vertex: bool,
    /// It is always a waypoint.
    firm: bool,
    /// Half widths, once they are known.
    half: Option<Lanes<L>>,
}

/// What a vertex is to the boxes around it.
#[derive(Clone, Copy, Debug)]
struct Vertex<const L: usize> {
    s: f64,
    /// How much every lane turns.
    turns: Lanes<L>,
    /// How much the path bends, 1/mm.
    bend: f64,
    /// The motion is to pass it in its time, and how far it may be off then, mm.
    marked: bool,
    timely: f64,
}

/// Waypoints of a window; keeps its memory.
#[derive(Debug)]
pub struct Waypoints<const L: usize> {
    candidates: Vec<Candidate<L>>,
    /// Vertices in and around the window, of which each is looked at for many boxes; and the first one's chord.
    vertices: Vec<Vertex<L>>,
    first: usize,
    /// The waypoints chosen, with their path coordinates and chords.
    pub chosen: Vec<Waypoint<L>>,
    pub along: Vec<(f64, u32)>,
}

impl<const L: usize> Default for Waypoints<L> {
    fn default() -> Self {
        Self {
            candidates: Vec::new(),
            vertices: Vec::new(),
            first: 0,
            chosen: Vec::new(),
            along: Vec::new(),
        }
    }
}

/// The grid of pseudo-time.
#[derive(Clone, Copy, Debug)]
pub struct Grid {
    pub intervals: usize,
    pub step_s: f64,
    /// Lanes in use.
    pub lanes: usize,
}

/// What is left of the boxes.
#[derive(Clone, Copy, Debug)]
pub struct Keep<const L: usize> {
    /// Share of the tolerance that is used, and where the window begins in motion: the state there is given, and a box that
    /// became narrower beside it would take all the jerk.
    pub share: f64,
    pub begin: f64,
    /// The ends of the travel, where they are near, and how far inside of them the motion is to stay, in lane units.
    pub travel: Option<Travel<L>>,
    pub margin: f64,
    /// Lanes that rest in the whole window: they stay on the path, whatever the tolerance leaves.
    pub rests: [bool; L],
    /// Path coordinates of the window's start and end.
    pub ends: (f64, f64),
}

impl<const L: usize> Waypoints<L> {
    /// Vertices between two path coordinates, and middles of chords that bulge between them.
    #[inline(always)]
    pub fn gather(&mut self, run: &Run<'_, L>, from: f64, to: f64) {
        self.candidates.clear();
        let mut i = run.chord_at(from, 0);
        let last = run.chord_at(to, i);
        self.first = i.saturating_sub(LOOKS).max(1);
        self.vertices.clear();
        let around = self.first..(last + 1 + LOOKS).min(run.chords.len());
        self.vertices.extend(around.map(|v| vertex(run.chords, v)));
        while i < run.chords.len() && run.chords[i].s < to {
            let chord = &run.chords[i];
            let turn = run
                .chords
                .get(i + 1)
                .map_or(chord.turn, |next| next.turn.max(chord.turn));
            let sagitta = turn * chord.length / 8.0;
            let mut add = |s: f64, vertex: bool, firm: bool| {
                if s > from && s < to {
                    self.candidates.push(Candidate {
                        s,
                        chord: i as u32,
                        vertex,
                        firm,
                        half: None,
                    });
                }
            };
            add(chord.s, true, i > 0 && is_marked(run.chords, i));
            if sagitta > 0.05 * chord.tolerance {
                add(
                    chord.s + chord.length / 2.0,
                    false,
                    sagitta > 0.3 * chord.tolerance,
                );
            }
            i += 1;
        }
    }

    /// Chooses waypoints by the timing `marks`: firm ones, others at least a [`DENSE`]th of a step apart, and places between so that no
    /// gap exceeds three quarters of a step. Firm ones that are much nearer than the spline can tell apart are left to the
    /// check. Boxes are what `keep` leaves of them.
    #[inline(always)]
    pub fn choose(&mut self, run: &Run<'_, L>, marks: &[Mark], grid: Grid, keep: &Keep<L>) {
        self.chosen.clear();
        self.along.clear();
        let h = grid.step_s;
        let end_s = grid.intervals as f64 * h;
        let mut timer = Timer { marks, at: 0 };
        let mut last_t = 0.0;
        for n in 0..self.candidates.len() {
            let candidate = self.candidates[n];
            let t = timer.time(candidate.s);
            let most = if candidate.firm { DENSEST } else { DENSE };
            if t < last_t + h / most {
                continue;
            }
            self.fill(run, marks, &mut last_t, t, grid, keep);
            if t > 0.4 * h && t < end_s {
                let half = candidate
                    .half
                    .unwrap_or_else(|| self.half_widths(run, &candidate, grid));
                self.candidates[n].half = Some(half);
                self.add(run, t, &candidate, &half, grid, keep);
            }
            last_t = t;
        }
        self.fill(run, marks, &mut last_t, end_s, grid, keep);
    }

    /// Places between `last_t` and `t`.
    #[inline(always)]
    fn fill(
        &mut self,
        run: &Run<'_, L>,
        marks: &[Mark],
        last_t: &mut f64,
        t: f64,
        grid: Grid,
        keep: &Keep<L>,
    ) {
        let h = grid.step_s;
        let count = ((t - *last_t) / (0.75 * h) * (1.0 - 1e-9)).ceil() as usize;
        if count < 2 {
            return;
        }
        let mut at = self.along.last().map_or(0, |last| last.1 as usize);
        let mut mark = marks.partition_point(|mark| mark.t <= *last_t).max(1);
        for n in 1..count {
            let time = *last_t + (t - *last_t) * n as f64 / count as f64;
            if time < 0.4 * h || time > (grid.intervals as f64 - 0.5) * h {
                continue;
            }
            while mark + 1 < marks.len() && marks[mark].t <= time {
                mark += 1;
            }
            let a = marks[mark - 1];
            let b = marks[mark];
            let s = a.s + (b.s - a.s) * ((time - a.t) / (b.t - a.t)).clamp(0.0, 1.0);
            at = run.chord_at(s, at);
            let candidate = Candidate {
                s,
                chord: at as u32,
                vertex: false,
                firm: false,
                half: None,
            };
            let half = self.half_widths(run, &candidate, grid);
            self.add(run, time, &candidate, &half, grid, keep);
        }
    }

    #[inline(always)]
    fn add(
        &mut self,
        run: &Run<'_, L>,
        t: f64,
        candidate: &Candidate<L>,
        half: &Lanes<L>,
        grid: Grid,
        keep: &Keep<L>,
    ) {
        let place = t / grid.step_s;
        let interval = (place as usize).min(grid.intervals - 1);
        let on_path = run.chords[candidate.chord as usize].at(candidate.s);
        let mut point = on_path;
        let begun = (place / BEGINNING).min(1.0);
        let share = keep.begin + begun * (keep.share - keep.begin);
        let mut half = each(|l| share * half[l]);
        if let Some(travel) = &keep.travel {
            let way = (candidate.s - keep.ends.0)
                .min(keep.ends.1 - candidate.s)
                .max(0.0);
            travel.cut(&mut point, &mut half, keep.margin, way);
        }
        for l in (0..grid.lanes).filter(|l| keep.rests[*l]) {
            (point[l], half[l]) = (on_path[l], STILL * half[l].max(f64::MIN_POSITIVE));
        }
        self.chosen.push(Waypoint {
            interval: interval as u32,
            z: place - interval as f64,
            point,
            half,
        });
        self.along.push((candidate.s, candidate.chord));
    }

    in_wide_instructions! {
        /// Half widths of the box at a place: all corners of the box stand off the path by no more than the tolerance, and the axes
        /// that turn get most of it. Along the path the box may be longer.
        fn half_widths = half_widths_any, half_widths_wide(
            &self,
            run: &Run<'_, L>,
            candidate: &Candidate<L>,
            grid: Grid,
        ) -> Lanes<L>;
    }

    #[inline(always)]
    fn half_widths_any(&self, run: &Run<'_, L>, candidate: &Candidate<L>, grid: Grid) -> Lanes<L> {
        let chords = run.chords;
        let i = candidate.chord as usize;
        let s = candidate.s;
        let lanes = grid.lanes;
        let before = if candidate.vertex && i > 0 {
            &chords[i - 1]
        } else {
            &chords[i]
        };
        let swing = chords[i].speed.max(before.speed)
            * (chords[i].turn_s.max(before.turn_s) + SWING_STEPS * grid.step_s);
        let tolerance = chords[i].tolerance.min(before.tolerance).min(swing);
        let Needs {
            mut need,
            sharp_way,
            timely,
            bend,
        } = self.needs(run, i, s);
        let most = largest(&need);
        if most > 0.0 {
            need = each(|l| (need[l] + 0.08 * most) / (1.08 * most));
        } else {
            need = [1.0; L];
        }
        // Lanes without an axis take nothing of the tolerance.
        need[lanes..].fill(0.0);
        let widen = |half: Lanes<L>, along: Lanes<L>| {
            each(|l| {
                if half[l] > 0.0 {
                    half[l].min(timely / along[l].abs().max(1e-9))
                } else {
                    tolerance
                }
            })
        };
        let Some(tangent) = tangent(run, candidate) else {
            // Round a sharp vertex the motion may be anywhere in a disc.
            let size = dot(&need, &need).sqrt();
            return widen(each(|l| need[l] * (BOX_SHARE * tolerance / size)), [1.0; L]);
        };
        let straight = (BENT * tolerance / bend.max(1e-12)).sqrt().min(LOOSE_MM);
        let loose = (0.5 * sharp_way / tolerance).clamp(1.0, (straight / tolerance).max(10.0));
        for l in 0..lanes {
            let t = tangent[l].abs();
            let across = (1.0 - t * t).max(1e-6).sqrt();
            need[l] = need[l].max(t * (0.3 / across).min(loose));
        }
        let worst = farthest(&need, &tangent, lanes);
        widen(
            each(|l| {
                (need[l] * (BOX_SHARE / worst)).min(LONGEST.max(LONGEST_MM / tolerance)) * tolerance
            })
            .map(|half| half.min(LONGEST_SWING * swing)),
            tangent,
        )
    }

    /// What lies around `s` on chord `i`.
    #[inline(always)]
    fn needs(&self, run: &Run<'_, L>, i: usize, s: f64) -> Needs<L> {
        let mut needs = Needs {
            need: [0.0; L],
            sharp_way: run.end() - s,
            timely: f64::INFINITY,
            bend: 0.0,
        };
        // A chord behind a rest, or a turn back, has no turn.
        let here = (i + 1).saturating_sub(self.first).min(self.vertices.len());
        let (behind, ahead) = self.vertices.split_at(here);
        for vertex in behind.iter().rev().take(LOOKS) {
            if s - vertex.s > NEAR {
                break;
            }
            needs.look(vertex, s);
        }
        for vertex in ahead.iter().take(LOOKS) {
            if vertex.s - s > NEAR {
                break;
            }
            needs.look(vertex, s);
        }
        needs
    }
}

/// Time along marks, asked for in order.
pub struct Timer<'a> {
    pub marks: &'a [Mark],
    pub at: usize,
}

impl Timer<'_> {
    /// When the motion passes `s`.
    #[inline(always)]
    pub fn time(&mut self, s: f64) -> f64 {
        while self.at + 2 < self.marks.len() && self.marks[self.at + 1].s <= s {
            self.at += 1;
        }
        let a = self.marks[self.at];
        let b = self.marks[self.at + 1];
        let way = b.s - a.s;
        if way > 0.0 {
            a.t + (b.t - a.t) * ((s - a.s) / way).clamp(0.0, 1.0)
        } else {
            b.t
        }
    }
}

/// Whether the motion is to pass vertex `v` in its time: a sharp turn, or another feed.
#[inline(always)]
fn is_marked<const L: usize>(chords: &[Chord<L>], v: usize) -> bool {
    chords[v].turn > SHARP || timely(chords, v).is_finite()
}

/// How far along the path the motion may be off vertex `v` in its time, mm: where the feed changes, no more than the lower
/// one covers in a fraction of a fine period. Infinite where it does not change.
#[inline(always)]
fn timely<const L: usize>(chords: &[Chord<L>], v: usize) -> f64 {
    let last = chords[v - 1].feed;
    let feed = chords[v].feed;
    if last.min(feed) < OTHER_FEED * last.max(feed) {
        TIMELY_S * last.min(feed)
    } else {
        f64::INFINITY
    }
}

/// What lies around a place.
struct Needs<const L: usize> {
    /// How much every lane turns.
    need: Lanes<L>,
    /// Way to the nearest sharp turn, change of feed or end, mm.
    sharp_way: f64,
    /// How far along the path the motion may be off, so that it is where the feed changes in its time, mm.
    timely: f64,
    /// How much the path bends at most, 1/mm.
    bend: f64,
}

impl<const L: usize> Needs<L> {
    #[inline(always)]
    fn look(&mut self, vertex: &Vertex<L>, s: f64) {
        let need = &self.need;
        self.need = each(|l| larger(need[l], vertex.turns[l]));
        self.bend = larger(self.bend, vertex.bend);
        if vertex.marked {
            let way = (s - vertex.s).abs();
            self.sharp_way = self.sharp_way.min(way);
            self.timely = self.timely.min(vertex.timely + way / 2.0);
        }
    }
}

/// The vertex at the start of chord `v`, which has one before it.
#[inline(always)]
fn vertex<const L: usize>(chords: &[Chord<L>], v: usize) -> Vertex<L> {
    let turn = minus(&chords[v].direction, &chords[v - 1].direction);
    let length = f64::midpoint(chords[v].length, chords[v - 1].length);
    let timely = timely(chords, v);
    Vertex {
        s: chords[v].s,
        turns: turn.map(f64::abs),
        bend: chords[v].turn / length,
        marked: chords[v].turn > SHARP || timely.is_finite(),
        timely,
    }
}

/// The direction of the path; none at a sharp vertex.
#[inline(always)]
fn tangent<const L: usize>(run: &Run<'_, L>, candidate: &Candidate<L>) -> Option<Lanes<L>> {
    let i = candidate.chord as usize;
    let chord = &run.chords[i];
    if !candidate.vertex || i == 0 {
        return Some(chord.direction);
    }
    let last = &run.chords[i - 1].direction;
    let sum: Lanes<L> = each(|l| last[l] + chord.direction[l]);
    let size = dot(&sum, &sum).sqrt();
    (size >= 1.95).then(|| each(|l| sum[l] / size))
}

/// How far the corners of the box `need` stand off a line through its middle along `tangent`. Only the first `lanes` have a width.
#[inline(always)]
fn farthest<const L: usize>(need: &Lanes<L>, tangent: &Lanes<L>, lanes: usize) -> f64 {
    if L > 4 {
        // A bound: every pair of lanes at its worst.
        let mut sum = 0.0;
        for i in 0..L {
            for j in 0..L {
                let entry = f64::from(u8::from(i == j)) - tangent[i] * tangent[j];
                sum += entry.abs() * need[i] * need[j];
            }
        }
        return sum.sqrt();
    }
    match (need.first_chunk::<3>(), tangent.first_chunk()) {
        (Some(need), Some(tangent)) if lanes <= 3 => farthest_corner(need, tangent),
        _ => farthest_corner(need, tangent),
    }
}

/// The same of a box with few lanes, corner by corner.
#[inline(always)]
fn farthest_corner<const L: usize>(need: &Lanes<L>, tangent: &Lanes<L>) -> f64 {
    let mut most = 0.0f64;
    // The corners are all as far from the middle.
    let reach = dot(need, need);
    for signs in 0..1 << (L - 1) {
        let corner: Lanes<L> = each(|l| {
            if signs >> l & 1 == 1 {
                -need[l]
            } else {
                need[l]
            }
        });
        let along = dot(&corner, tangent);
        most = most.max(reach - along * along);
    }
    most.sqrt()
}
