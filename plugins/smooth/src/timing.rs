//! The first timing: speed caps on nodes along the path, and two passes over them.

use tandem_motion::tube::{Lanes, each};

use crate::frame::{Frame, along, largest};
use crate::peaks::AT_FEED;
use crate::route::{Chord, Run, chord_at};

/// A turn by more than this, as the size of the change of direction, is sharp: nodes gather around it.
const SHARP: f64 = 0.25;
/// Distances of the nodes around a sharp turn: the first, mm, and the factor from one to the next.
const GRADED: (f64, f64) = (1e-3, 1.35);
/// Longest distance between nodes, mm.
const LONGEST: f64 = 1.0;
/// Part of a window's time that the way between two nodes takes at most: a slow window is not longer than it should be.
const PART: f64 = 0.1;
/// Where the grid is finer than that, s, nodes lie no farther apart than its steps: boxes are so narrow along the path that they
/// would hold the motion to the corners of a timing that is a line between two nodes.
pub const FINE_S: f64 = 4e-3;
/// Distance, mm, below which vertices that are not sharp are no nodes of their own.
const SHORTEST: f64 = 0.02;
/// Sagitta of a chord, as a share of the tolerance, up to which a motion beside the vertices does not see them.
const SMOOTHED: f64 = 0.9;
/// Time that the motion takes for a chord beyond that, as a multiple of that in which jerk goes half of what is beyond.
const SCALLOP: f64 = 4.2;
/// Share of the jerk by which speed is built up along the path: on a way from one speed to another the acceleration comes and
/// goes, and the axes have their turns to take beside it.
const RAMP: f64 = 0.35;
/// Factor from one speed tried to the next.
const SLOWER: f64 = 0.9;

/// A place on the path.
#[derive(Clone, Copy, Debug)]
struct Node {
    s: f64,
    speed: f64,
    /// What feed and axis speeds allow here.
    most: f64,
    /// Along the path.
    acceleration: f64,
    jerk: f64,
}

/// Time and path coordinate.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Mark {
    pub t: f64,
    pub s: f64,
}

/// Memory of the nodes.
#[derive(Debug, Default)]
pub struct Timing {
    nodes: Vec<Node>,
}

/// From where and how far.
#[derive(Clone, Copy, Debug)]
pub struct Reach {
    /// Path coordinate and speed at the start.
    pub s: f64,
    pub speed: f64,
    /// Time after which the window stops, s.
    pub window_s: f64,
    /// The farthest that it may end.
    pub end: f64,
    /// Step of the grid, s: nodes lie no farther apart.
    pub step_s: f64,
}

/// Directions at `s` and a way behind and before it, looked up in chords.
struct DirectionLookup<'a, const L: usize> {
    chords: &'a [Chord<L>],
    at: usize,
    /// The chords a corner's way behind and before the place looked at last: a node lies near the one before it.
    ends: [usize; 2],
}

impl<const L: usize> DirectionLookup<'_, L> {
    /// The direction at `s`. Where it was last looked for is `near`, and where it is found afterwards.
    #[inline(always)]
    fn direction_at(&self, s: f64, near: &mut usize) -> &Lanes<L> {
        *near = chord_at(self.chords, s, *near);
        &self.chords[*near].direction
    }

    /// The direction here: at a vertex the mean.
    #[inline(always)]
    fn here(&self, s: f64) -> Lanes<L> {
        let chord = &self.chords[self.at];
        if self.at > 0 && s <= chord.s + 1e-9 {
            let last = &self.chords[self.at - 1].direction;
            return each(|l| f64::midpoint(last[l], chord.direction[l]));
        }
        chord.direction
    }
}

/// The highest speed, of `most` and downwards, at which a motion that runs over the path around `s` for the time of a corner
/// keeps acceleration and jerk.
#[inline(always)]
fn cap<const L: usize>(
    directions: &mut DirectionLookup<'_, L>,
    frame: &Frame<L>,
    s: f64,
    most: f64,
    corner_s: f64,
) -> f64 {
    let here = directions.here(s);
    let mut v = most;
    let [mut behind, mut before] = directions.ends;
    for _ in 0..80 {
        let way = v * corner_s;
        let from = directions.direction_at(s - way, &mut behind);
        let to = directions.direction_at(s + way, &mut before);
        let mut fits = true;
        for l in 0..L {
            let bend = (from[l] - 2.0 * here[l] + to[l]).abs();
            let turn = (to[l] - from[l]).abs() / (2.0 * corner_s);
            fits &= v * bend <= 1.5 * frame.jerk[l] * corner_s * corner_s
                && v * turn <= frame.acceleration[l]
                && v * turn * turn <= frame.jerk[l];
        }
        if fits {
            break;
        }
        v *= SLOWER;
    }
    directions.ends = [behind, before];
    v
}

impl Timing {
    /// Whether the path that was timed last goes as fast as it may for this time.
    pub fn is_at_feed(&self, until_s: f64) -> bool {
        let mut t = 0.0;
        for pair in self.nodes.windows(2) {
            if t >= until_s {
                break;
            }
            if pair[1].speed < AT_FEED * pair[1].most {
                return false;
            }
            t += 2.0 * (pair[1].s - pair[0].s) / (pair[0].speed + pair[1].speed);
        }
        true
    }

    /// Times the path from `reach.s` on, behind the `marks` that are known already; the last mark is at rest.
    #[inline(always)]
    pub fn make<const L: usize>(
        &mut self,
        run: &Run<'_, L>,
        frame: &Frame<L>,
        counted: &Lanes<L>,
        reach: &Reach,
        marks: &mut Vec<Mark>,
    ) {
        self.place_nodes(run, frame, counted, reach);
        let last = self.nodes.len() - 1;
        self.nodes[last].speed = 0.0;
        for i in (1..last).rev() {
            let next = self.nodes[i + 1];
            let node = &mut self.nodes[i];
            node.speed = reached(&next, node.speed, next.s - node.s);
        }
        let mut t = marks.last().map_or(0.0, |mark| mark.t);
        for pair in self.nodes.windows(2) {
            let way = pair[1].s - pair[0].s;
            let cell_s = 2.0 * way / (pair[0].speed + pair[1].speed);
            // From rest and to rest way goes with the third power of time.
            let from_rest = pair[0].speed == 0.0;
            let to_rest = pair[1].speed == 0.0;
            let cell_s = if from_rest || to_rest {
                1.5 * cell_s
            } else {
                cell_s
            };
            if from_rest != to_rest {
                for share in [0.125, 0.25, 0.375, 0.5, 0.625, 0.75, 0.875] {
                    let part: f64 = if from_rest { share } else { 1.0 - share };
                    let gone = if from_rest {
                        part.powi(3)
                    } else {
                        1.0 - part.powi(3)
                    };
                    marks.push(Mark {
                        t: t + share * cell_s,
                        s: pair[0].s + gone * way,
                    });
                }
            }
            t += cell_s;
            marks.push(Mark { t, s: pair[1].s });
        }
    }

    #[inline(always)]
    fn place_nodes<const L: usize>(
        &mut self,
        run: &Run<'_, L>,
        frame: &Frame<L>,
        counted: &Lanes<L>,
        reach: &Reach,
    ) {
        self.nodes.clear();
        let at = run.chord_at(reach.s, 0);
        let mut directions = DirectionLookup {
            chords: run.chords,
            at,
            ends: [at; 2],
        };
        let limits = frame.speed[usize::from(run.rapid)];
        let mut s = reach.s;
        let mut t = 0.0;
        let mut last_cap = f64::INFINITY;
        // How long a corner takes, and what that follows from.
        let mut last_corner = (f64::NAN, 0.0);
        // Where the next sharp turn before and the last one behind are.
        let mut ahead = directions.at;
        let mut grown = 0.25;
        loop {
            directions.at = run.chord_at(s, directions.at);
            let chord = &run.chords[directions.at];
            let limit = feed(chord, counted).min(along(&limits, &chord.direction));
            let jerk = along(&frame.jerk, &chord.direction);
            let tolerance = chord.tolerance;
            let next = run.chords.get(directions.at + 1);
            let speed = limit.min(polygon_speed(chord, next, jerk));
            let corner = tolerance / frame.jerk[0].min(jerk);
            if corner != last_corner.0 {
                last_corner = (corner, (6.0 * corner).cbrt());
            }
            let corner_s = last_corner.1;
            let most = speed.min(last_cap / (SLOWER * SLOWER * SLOWER * SLOWER));
            let cap = cap(&mut directions, frame, s, most, corner_s);
            last_cap = cap;
            let acceleration = along(&frame.acceleration, &chord.direction);
            let mut node = Node {
                s,
                speed: cap,
                most: limit,
                acceleration,
                jerk,
            };
            if let Some(before) = self.nodes.last() {
                let way = s - before.s;
                node.speed = reached(before, cap, way);
                t += 2.0 * way / (before.speed + node.speed);
            } else {
                node.speed = reach.speed;
            }
            self.nodes.push(node);
            if s >= reach.end || t >= reach.window_s && self.nodes.len() > 8 {
                return;
            }
            let part_s = PART * reach.window_s;
            let apart_s = if reach.step_s < FINE_S {
                reach.step_s
            } else {
                part_s
            };
            let longest = (apart_s * node.speed).clamp(GRADED.0, LONGEST);
            s = next_node(run, &directions, reach, s, longest, &mut ahead, &mut grown);
        }
    }
}

/// The speed at which the motion follows a polygon whose chords stand off the curve through its vertices by more than the
/// tolerance: across the path it goes to and fro once a chord, and the time for that goes by the third root of how far. Chords that
/// are longer than the way in which a corner is taken are not driven any faster than its [`cap`].
#[inline(always)]
fn polygon_speed<const L: usize>(chord: &Chord<L>, next: Option<&Chord<L>>, jerk: f64) -> f64 {
    let turn = next.map_or(0.0, |next| next.turn.min(chord.turn));
    let sagitta = turn * chord.length / 8.0;
    let over = (sagitta - SMOOTHED * chord.tolerance) / 2.0;
    if over > 0.0 {
        chord.length / (SCALLOP * (over / jerk).cbrt())
    } else {
        f64::INFINITY
    }
}

/// Path coordinate of the node behind the one at `s`.
#[inline(always)]
fn next_node<const L: usize>(
    run: &Run<'_, L>,
    directions: &DirectionLookup<'_, L>,
    reach: &Reach,
    s: f64,
    longest: f64,
    ahead: &mut usize,
    grown: &mut f64,
) -> f64 {
    let chords = run.chords;
    let i = directions.at;
    *ahead = (*ahead).max(i + 1);
    // Nodes gather around sharp turns and the ends: behind one the distance grows, before one it shrinks.
    let behind = if i == 0 || chords[i].turn > SHARP {
        s - chords[i].s.max(reach.s)
    } else {
        f64::INFINITY
    };
    let next = chords.get(i + 1);
    let vertex = next.map_or(reach.end, |next| next.s.min(reach.end));
    let sharp = next.is_none_or(|next| next.turn > SHARP) || vertex >= reach.end;
    let before = if sharp { vertex - s } else { f64::INFINITY };
    let spread = (GRADED.1 - 1.0) * behind + GRADED.0;
    let narrow = ((GRADED.1 - 1.0) / GRADED.1 * before).max(GRADED.0);
    *grown = if i + 1 == *ahead && s > chords[i].s {
        (*grown * 1.2).min(LONGEST)
    } else {
        0.25
    };
    let step = spread.min(narrow).min(*grown).min(longest);
    if !sharp && step >= vertex - s {
        // Vertices that are near each other share a node.
        let mut k = i + 1;
        while k + 1 < chords.len() && chords[k].s < s + SHORTEST && chords[k + 1].turn <= SHARP {
            k += 1;
        }
        return chords[k].s.min(reach.end).max(s + 1e-9);
    }
    if vertex - s < 1.3 * step {
        vertex
    } else {
        s + step
    }
}

/// The lane speed along a chord at which path speed reaches its pace.
#[inline(always)]
pub fn feed<const L: usize>(chord: &Chord<L>, counted: &Lanes<L>) -> f64 {
    let weighted: Lanes<L> = each(|l| counted[l] * chord.direction[l]);
    let size = weighted.iter().map(|v| v * v).sum::<f64>().sqrt();
    if size > 0.0 && largest(&weighted) > 0.0 {
        chord.pace / size
    } else {
        f64::INFINITY
    }
}

/// The speed reached from a node over `way`, at most `cap`. Most nodes are passed at one speed: it is known to be reached.
#[inline(always)]
fn reached(from: &Node, cap: f64, way: f64) -> f64 {
    if cap <= from.speed {
        cap
    } else {
        cap.min(gain(from, way))
    }
}

/// The speed gained from a node over `way`: the jerk ramp from rest at a share of the jerk, and 0.8 of the acceleration.
#[inline(always)]
fn gain(from: &Node, way: f64) -> f64 {
    let v = from.speed;
    let ramp = v * v.sqrt() + 3.0 * (RAMP * from.jerk / 2.0).sqrt() * way;
    (ramp * ramp)
        .cbrt()
        .min((v * v + 1.6 * from.acceleration * way).sqrt())
}
