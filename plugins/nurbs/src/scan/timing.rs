//! The first timing: speed caps on nodes along the path, and two passes over them.

use tandem_motion::nurbs::AlongPath;

use crate::stream::slowdown::Slowdowns;
use crate::stream::{Bounds, Cursor, Leg, Route, State};

/// Time between nodes at most, s.
const NODE_S: f64 = 0.5e-3;
/// Nodes of a window at most: what lies beyond belongs to the next.
const MAX_NODES: usize = 20_000;

/// A place on the path.
#[derive(Clone, Copy, Debug)]
pub struct Node {
    s_mm: f64,
    speed_mm_per_s: f64,
    /// Along the path, mm/s² and mm/s³.
    acceleration: f64,
    jerk: f64,
}

/// Memory of the nodes.
#[derive(Debug, Default)]
pub struct Timing {
    nodes: Vec<Node>,
    /// Time, s, and path coordinate, mm.
    pub steps: Vec<(f64, f64)>,
}

impl Timing {
    /// The timing from `start` to rest at `end_mm`, or `window_s` later. Gives whether it goes to the end.
    pub fn make(
        &mut self,
        route: &Route,
        bounds: &Bounds,
        slowdowns: &Slowdowns,
        start: &State,
        (end_mm, window_s): (f64, f64),
    ) -> bool {
        let whole = self.place_nodes(route, bounds, slowdowns, start, (end_mm, window_s));
        self.nodes[0].speed_mm_per_s = start.speed_mm_per_s;
        let last = self.nodes.len() - 1;
        self.nodes[last].speed_mm_per_s = 0.0;
        for i in (0..last).rev() {
            let reached = reach(
                &self.nodes[i + 1],
                self.nodes[i + 1].s_mm - self.nodes[i].s_mm,
            );
            if i > 0 {
                self.nodes[i].speed_mm_per_s = self.nodes[i].speed_mm_per_s.min(reached);
            }
        }
        self.steps.clear();
        let mut t = 0.0;
        self.steps.push((t, self.nodes[0].s_mm));
        for pair in self.nodes.windows(2) {
            let rest = if pair[0].speed_mm_per_s == 0.0 || pair[1].speed_mm_per_s == 0.0 {
                1.5
            } else {
                1.0
            };
            let way = pair[1].s_mm - pair[0].s_mm;
            t += rest * 2.0 * way / (pair[0].speed_mm_per_s + pair[1].speed_mm_per_s);
            self.steps.push((t, pair[1].s_mm));
        }
        whole
    }

    /// Path coordinate at `t_s`; `at` is where the last one was found.
    pub fn at(&self, t_s: f64, at: &mut usize) -> f64 {
        while *at + 2 < self.steps.len() && self.steps[*at + 1].0 < t_s {
            *at += 1;
        }
        let a = self.steps[*at];
        let b = self.steps[*at + 1];
        let share = ((t_s - a.0) / (b.0 - a.0)).clamp(0.0, 1.0);
        // To rest it comes with the jerk alone, as it leaves it.
        let way = if *at + 2 == self.steps.len() {
            1.0 - (1.0 - share).powi(3)
        } else if *at == 0 && self.nodes[0].speed_mm_per_s == 0.0 {
            share.powi(3)
        } else {
            share
        };
        a.1 + (b.1 - a.1) * way
    }

    /// Nodes with their caps, and the pass forward, until the time of the window has gone by.
    fn place_nodes(
        &mut self,
        route: &Route,
        bounds: &Bounds,
        slowdowns: &Slowdowns,
        start: &State,
        (end_mm, window_s): (f64, f64),
    ) -> bool {
        self.nodes.clear();
        let mut cursor = Cursor::default();
        let mut s_mm = start.s_mm;
        let mut t = 0.0;
        loop {
            let (at, leg) = route.at(s_mm, &mut cursor);
            let mut node = node(leg, &at, bounds, slowdowns, s_mm);
            let cap = node.speed_mm_per_s;
            if let Some(before) = self.nodes.last() {
                let way = s_mm - before.s_mm;
                node.speed_mm_per_s = cap.min(reach(before, way));
                t += 2.0 * way / (before.speed_mm_per_s + node.speed_mm_per_s);
            } else {
                node.speed_mm_per_s = start.speed_mm_per_s;
            }
            self.nodes.push(node);
            if s_mm >= end_mm {
                return true;
            }
            if t > window_s && self.nodes.len() > 8 || self.nodes.len() >= MAX_NODES {
                return false;
            }
            let bend = leg.course.counted_length(&at.curvature).max(1e-9);
            let step = (0.05 / bend).clamp(2e-3, 0.05).min(cap * NODE_S).max(1e-3);
            // No sliver before the end.
            s_mm = if end_mm - s_mm < 1.5 * step {
                end_mm.max(s_mm)
            } else {
                s_mm + step
            };
        }
    }
}

fn node(leg: &Leg, at: &AlongPath, bounds: &Bounds, slowdowns: &Slowdowns, s_mm: f64) -> Node {
    let along = bounds.context.limits.along(&at.direction);
    let cap = leg.smooth_cap_mm_per_s(at, bounds);
    Node {
        s_mm,
        speed_mm_per_s: slowdowns.at(s_mm)[0] * cap,
        acceleration: along.acceleration_mm_per_s2,
        jerk: along.jerk_mm_per_s3,
    }
}

/// The speed reached from a node over `way_mm`: the exact jerk ramp from rest, and 0.8 of the acceleration.
fn reach(from: &Node, way_mm: f64) -> f64 {
    let v = from.speed_mm_per_s;
    let ramp = v * v.sqrt() + 3.0 * (from.jerk / 2.0).sqrt() * way_mm;
    (ramp * ramp)
        .cbrt()
        .min((v * v + 1.6 * from.acceleration * way_mm).sqrt())
}
