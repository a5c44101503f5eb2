//! Every limit on the samples of the fine period, and on what segments make of them at any phase.

use tandem_motion::nurbs::AlongPath;
use tandem_sdk::{AxisVector, BlockKind, LimitedBy, Segment, SegmentFlags};

use super::draw::{Drawn, Pen, draw};
use super::slowdown::{Slowdown, Slowdowns};
use super::trail::{Found, Trail};
use super::window::Reserve;
use super::{Bounds, Cursor, Job, Leg, Motion, Route, State, Window};

/// Share of a limit that a sampled difference may reach.
const AIM: f64 = 0.9995;
/// Share of the chord error below which the middle of a chord says enough.
const FAR: f64 = 0.8;
/// What the chord error may exceed: the feed is right for the curvature at one place of the period.
const CHORD: f64 = 1.005;

/// Share of the jerk limit that a motion may reach at any point: the fine loop looks at single points of a period.
pub const POINT: f64 = 1.004;

/// What may bind, in the order in which it is asked for, and the share of what is allowed from which on it does.
pub const BINDS: [(LimitedBy, f64); 5] = [
    (LimitedBy::Feed, 0.99),
    (LimitedBy::Velocity, 0.985),
    (LimitedBy::Acceleration, 0.95),
    (LimitedBy::Jerk, 0.9),
    (LimitedBy::Tolerance, 0.98),
];

/// Share of the acceleration beyond which turning is to blame, whose acceleration goes with the square of the speed.
const TURNING: f64 = 0.85;

/// Share of the jerk limit from which on a jump of curvature is to blame for what samples around it exceed, and what is aimed at.
const STEPPED: f64 = 0.1;
const STEPPED_AIM: f64 = 0.98;

/// Where a motion has no value the speed is lowered on so much of the path, mm.
const LOST_MM: f64 = 0.05;

/// Speed back along the path that is rounding, mm/s.
const BACK_MM_PER_S: f64 = 1e-9;

/// The largest of each, as a share of what is allowed.
#[derive(Clone, Copy, Debug, Default)]
pub struct Worst {
    pub speed: f64,
    pub acceleration: f64,
    pub jerk: f64,
    /// Of one sample: what is used up there.
    pub bound: Option<LimitedBy>,
}

impl Worst {
    pub fn is_kept(&self) -> bool {
        // A comparison with NaN is false.
        self.speed <= 1.0 && self.acceleration <= 1.0 && self.jerk <= 1.0
    }

    pub fn join(&mut self, other: &Self) {
        self.speed = self.speed.max(other.speed);
        self.acceleration = self.acceleration.max(other.acceleration);
        self.jerk = self.jerk.max(other.jerk);
    }

    /// What would keep the limits, between two path coordinates.
    fn slowdown(&self, from_mm: f64, to_mm: f64) -> Slowdown {
        let over = self.acceleration.max(self.jerk);
        Slowdown {
            from_mm,
            to_mm,
            speed: if self.speed > 1.0 {
                (0.9985 / self.speed).max(0.3)
            } else {
                1.0
            },
            jerk: if over > 1.0 {
                (0.995 / over).max(0.5)
            } else {
                1.0
            },
        }
    }
}

/// How closely a window is looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Look {
    /// At its samples: enough for a try that will not do.
    Samples,
    /// Then at its segments: every phase of the samples, and every point.
    Segments,
}

/// Samples the window into its memory, with the samples before it in front, and compares. Where a limit is exceeded,
/// `slowdowns` get what would keep it.
pub fn check<M: Motion, N>(
    job: &Job<N>,
    window: &mut Window<M>,
    look: Look,
    slowdowns: &mut Slowdowns,
) -> Worst {
    let Job {
        route,
        bounds,
        start,
        ..
    } = job;
    window.samples.clear();
    window.samples.extend(start.history);
    window.bounds.clear();
    window.first_tick_s = start.first_tick_s;
    window.reserves.clear();
    window.max_mm_per_s = 0.0;
    let period_s = bounds.context.fine_period_s;
    let duration_s = window.duration_s();
    let known = slowdowns.count();
    if let Some(lost) = window
        .times
        .windows(2)
        .position(|ends| !ends[1].is_finite())
    {
        let from_mm = window.motion.at(lost, 0.0).s_mm;
        slowdowns.add(
            known,
            Slowdown {
                from_mm,
                to_mm: from_mm + LOST_MM,
                speed: 0.5,
                jerk: 1.0,
            },
        );
        return Worst {
            speed: f64::NAN,
            ..Worst::default()
        };
    }
    let mut cursor = Cursor::default();
    let mut worst = Worst::default();
    let mut before_mm = [start.state.s_mm; 3];
    let mut rests = 0;
    while rests < 4 {
        let count = window.samples.len() - start.history.len();
        let t = start.first_tick_s + count as f64 * period_s;
        rests += u32::from(t >= duration_s);
        let state = window.at(t.min(duration_s));
        // No limit says that a motion goes forward.
        if state.speed_mm_per_s < -BACK_MM_PER_S || !state.speed_mm_per_s.is_finite() {
            slowdowns.add(
                known,
                Slowdown {
                    from_mm: before_mm[0],
                    to_mm: before_mm[2] + LOST_MM,
                    speed: 0.5,
                    jerk: 1.0,
                },
            );
            return Worst {
                speed: f64::NAN,
                ..worst
            };
        }
        let (at, leg) = route.at(state.s_mm, &mut cursor);
        note_reserve(window, bounds, &at, state.speed_mm_per_s);
        window.samples.push(at.position);
        let first = if count == 0 { state.s_mm } else { before_mm[2] };
        let here = compare(route, bounds, leg, (first, &state, &at), &window.samples);
        window.bounds.push(here.bound);
        if !here.is_kept() {
            // Where the speed is taken back it becomes higher beside that: a period more on both sides.
            let beside_mm = if here.speed > 1.0 {
                state.s_mm - first
            } else {
                0.0
            };
            let mut part = here.slowdown(before_mm[0] - beside_mm, state.s_mm + beside_mm);
            if here.jerk > 1.0 {
                let ends_mm = [before_mm[0], state.s_mm];
                let shown = shown_at_knots(route, bounds, ends_mm, state.speed_mm_per_s);
                part = blame_step(part, here.jerk, shown);
            }
            slowdowns.add(known, part);
        }
        worst.join(&here);
        before_mm = [before_mm[1], before_mm[2], state.s_mm];
    }
    if look == Look::Segments && worst.is_kept() {
        worst.join(&check_segments(job, window, known, slowdowns));
    }
    worst
}

/// Draws the window as it will be driven, to its end, and bounds what samples at any phase show of that.
fn check_segments<M: Motion, N>(
    job: &Job<N>,
    window: &mut Window<M>,
    known: usize,
    slowdowns: &mut Slowdowns,
) -> Worst {
    let Job { bounds, driven, .. } = job;
    let mut trail = std::mem::take(&mut window.trail);
    trail.begin(driven.segments.iter(), bounds);
    let mut route = Some(*job.route);
    let mut worst = Worst::default();
    let duration_s = window.duration_s();
    let mut from_s = 0.0;
    let mut at = driven.at;
    let mut segment = Segment::rest(&driven.at, 0.0);
    while let Some(ahead) = route.filter(|_| from_s < duration_s) {
        segment.flags = SegmentFlags(if ahead.front().block.kind == BlockKind::Rapid {
            SegmentFlags::RAPID.0
        } else {
            0
        });
        segment.feed_mm_per_s = ahead.front().block.command_feed_mm_per_s();
        let Drawn { until_s, leg_over } = draw(
            &ahead,
            bounds,
            window,
            &Pen { from_s, at: &at },
            &mut segment,
        );
        from_s = until_s;
        if segment.duration_s > 0.0 {
            at = segment.position(segment.duration_s);
            worst.join(&judge_last(
                &mut trail, &ahead, bounds, &segment, known, slowdowns,
            ));
        }
        if leg_over {
            route = ahead.behind_front();
        }
    }
    let mut rest = Segment::rest(&at, 3.0 * bounds.context.fine_period_s);
    rest.path[0] = segment.path_mm(segment.duration_s);
    worst.join(&judge_last(
        &mut trail, job.route, bounds, &rest, known, slowdowns,
    ));
    window.trail = trail;
    worst
}

/// Adds a segment, and what it and those before it exceed.
fn judge_last(
    trail: &mut Trail,
    route: &Route,
    bounds: &Bounds,
    segment: &Segment,
    known: usize,
    slowdowns: &mut Slowdowns,
) -> Worst {
    trail.push(segment, bounds);
    let Found {
        mut worst,
        from_mm,
        to_mm,
        stepped,
    } = trail.judge(bounds);
    if worst.is_kept() {
        return worst;
    }
    let middle_s = 0.5 * segment.duration_s;
    let (at, speed) = (
        route
            .at(segment.path_mm(middle_s), &mut Cursor::default())
            .0,
        segment.path_speed_mm_per_s(middle_s),
    );
    let axes = bounds.context.limits.axes().iter().enumerate();
    let turns = axes.map(|(axis, limits)| {
        at.curvature[axis].abs() * speed * speed / limits.acceleration_mm_per_s2
    });
    if worst.acceleration > 1.0 && turns.fold(0.0, f64::max) > TURNING {
        // What turning takes goes with the square of the speed.
        worst.speed = worst.speed.max(worst.acceleration.sqrt());
        worst.acceleration = 0.0;
    }
    if stepped {
        worst.speed = worst.speed.max(worst.acceleration).max(worst.jerk);
    }
    let (from_mm, to_mm) = if from_mm <= to_mm {
        (from_mm, to_mm)
    } else {
        (to_mm, from_mm)
    };
    slowdowns.add(known, worst.slowdown(from_mm, to_mm));
    worst
}

/// The largest share of the jerk limits that jumps of curvature between two path coordinates show where they are passed at a speed.
fn shown_at_knots(
    route: &Route,
    bounds: &Bounds,
    [mut from_mm, to_mm]: [f64; 2],
    speed_mm_per_s: f64,
) -> f64 {
    let mut cursor = Cursor::default();
    let mut most = 0.0f64;
    while let Some((knot_mm, sides)) = route.knot([from_mm, to_mm], &mut cursor) {
        let left = Leg::jerk_left_at_step(&sides, speed_mm_per_s, f64::INFINITY, bounds);
        most = most.max(1.0 - left);
        from_mm = knot_mm;
    }
    most
}

/// Where a jump of curvature shows a share of the jerk, what is over goes with the square of the speed there: less jerk beside it
/// would be less of a small part.
fn blame_step(part: Slowdown, jerk: f64, shown: f64) -> Slowdown {
    if shown < STEPPED {
        return part;
    }
    let speed = (1.0 - (jerk - STEPPED_AIM) / shown).max(0.5).sqrt();
    Slowdown {
        speed: part.speed.min(speed),
        jerk: 1.0,
        ..part
    }
}

/// What a sample leaves for a stop.
fn note_reserve<M>(window: &mut Window<M>, bounds: &Bounds, at: &AlongPath, speed: f64) {
    window.max_mm_per_s = window.max_mm_per_s.max(speed);
    let mut reserve = Reserve {
        stop_mm_per_s2: f64::INFINITY,
        stop_mm_per_s3: f64::INFINITY,
    };
    for (axis, limits) in bounds.context.limits.axes().iter().enumerate() {
        let along = at.direction[axis].abs();
        let turning = at.direction[axis].signum() * at.curvature[axis] * speed * speed;
        let left = limits.acceleration_mm_per_s2 + turning.min(0.0);
        reserve.stop_mm_per_s2 = reserve.stop_mm_per_s2.min(left / along);
        reserve.stop_mm_per_s3 = reserve.stop_mm_per_s3.min(limits.jerk_mm_per_s3 / along);
    }
    window.reserves.push(reserve);
}

/// Feed, chord and differences at a sample; `before_mm` is where the one before was.
fn compare(
    route: &Route,
    bounds: &Bounds,
    leg: &Leg,
    (before_mm, state, at): (f64, &State, &AlongPath),
    samples: &[AxisVector],
) -> Worst {
    let rapid = leg.block.kind == BlockKind::Rapid;
    let mut here = differences(bounds, samples, rapid);
    let velocity = here.speed;
    let feed = state.speed_mm_per_s / leg.feed_mm_per_s;
    let mut chord_share = 0.0;
    let mean_mm_per_s = (state.s_mm - before_mm) / bounds.context.fine_period_s;
    here.speed = here
        .speed
        .max(state.speed_mm_per_s.max(mean_mm_per_s) / (leg.feed_mm_per_s * (1.0 - 1e-9)));
    if before_mm < state.s_mm && !rapid {
        let curved = leg.course.counted_length(&at.curvature);
        let chord = chord_error_mm(route, bounds, (before_mm, state.s_mm), samples, curved);
        // The chord error goes with the square of the speed.
        chord_share = (chord / (CHORD * bounds.chord_error_mm)).sqrt();
        here.speed = here.speed.max(chord_share);
    }
    let shares = [feed, velocity, here.acceleration, here.jerk, chord_share];
    here.bound = BINDS
        .iter()
        .zip(shares)
        .find(|((_, from), share)| share > from)
        .map(|((bound, _), _)| *bound);
    here
}

/// The differences that end at the last sample.
pub fn differences(bounds: &Bounds, samples: &[AxisVector], rapid: bool) -> Worst {
    let &[p0, p1, p2, p3] = samples.last_chunk().expect("three samples stand in front");
    let rate = 1.0 / bounds.context.fine_period_s;
    let mut here = Worst::default();
    for (axis, limits) in bounds.context.limits.axes().iter().enumerate() {
        let [d0, d1, d2] = [
            p1[axis] - p0[axis],
            p2[axis] - p1[axis],
            p3[axis] - p2[axis],
        ];
        let most = if rapid {
            limits.rapid_mm_per_s
        } else {
            limits.feed_mm_per_s
        };
        here.speed = here.speed.max((d2 * rate).abs() / most);
        let acceleration = (d2 - d1).abs() * rate * rate;
        here.acceleration = here
            .acceleration
            .max(acceleration / (AIM * limits.acceleration_mm_per_s2));
        let jerk = (d2 - 2.0 * d1 + d0).abs() * rate * rate * rate;
        here.jerk = here.jerk.max(jerk / (AIM * limits.jerk_mm_per_s3));
    }
    here
}

/// How far the path between the last two samples stands off its chord in the axes, mm: looked at in its middle, and where
/// that is far at its quarters too.
fn chord_error_mm(
    route: &Route,
    bounds: &Bounds,
    (from_mm, to_mm): (f64, f64),
    samples: &[AxisVector],
    curvature: f64,
) -> f64 {
    let way_mm = to_mm - from_mm;
    let far_mm = FAR * bounds.chord_error_mm;
    let axes = bounds.context.axes.count();
    let dot = |a: &AxisVector, b: &AxisVector| -> f64 {
        a.0[..axes].iter().zip(b.0).map(|(a, b)| a * b).sum()
    };
    // Half of that error would be no reason to look.
    if curvature * way_mm * way_mm < 1e-3 * far_mm {
        return 0.0;
    }
    let &[start, end] = samples.last_chunk().expect("three samples stand in front");
    let chord = end - start;
    let squared = dot(&chord, &chord);
    if squared < 1e-18 {
        return 0.0;
    }
    let mut cursor = Cursor::default();
    let mut off = |share: f64| {
        let point = route.at(from_mm + share * way_mm, &mut cursor).0.position - start;
        let along = dot(&point, &chord);
        (dot(&point, &point) - along * along / squared)
            .max(0.0)
            .sqrt()
    };
    let middle = off(0.5);
    if middle < far_mm {
        middle
    } else {
        middle.max(off(0.25)).max(off(0.75))
    }
}

/// The largest jerk of an axis as a share of its limit, at a place passed with a speed and its derivatives.
pub fn jerk_share(bounds: &Bounds, at: &AlongPath, [v, a, j]: [f64; 3]) -> f64 {
    let axes = bounds.context.limits.axes().iter().enumerate();
    let shares = axes.map(|(axis, limits)| {
        let x1 = at.direction[axis];
        let x2 = at.curvature[axis];
        let x3 = at.third[axis];
        (x3 * v * v * v + 3.0 * x2 * v * a + x1 * j).abs() / limits.jerk_mm_per_s3
    });
    shares.fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use tandem_rig::{axis, context};
    use tandem_sdk::{Block, NurbsData};

    use super::super::queue::Queue;
    use super::*;
    use crate::course::Course;

    /// A curve that stands further off its chord at a quarter than in the middle, by an eighth: where the middle is near the chord
    /// error its quarters count too, and where it is far below that alone.
    #[test]
    fn where_the_middle_is_near_the_chord_error_its_quarters_count() {
        const CHORD_ERROR_MM: f64 = 1e-3;
        for (middle, expected) in [(0.9, 0.9 * 1.125), (0.7, 0.7)] {
            let bounds = Bounds {
                context: context(&[axis(1000.0); 2], 1e-3),
                chord_error_mm: CHORD_ERROR_MM,
            };
            // Of y = 3·a·t·(1 − t)² the middle is 3/8 of a.
            let a_mm = middle * CHORD_ERROR_MM * 8.0 / 3.0;
            let points = [[0.0, 0.0], [1.0 / 3.0, a_mm], [2.0 / 3.0, 0.0], [1.0, 0.0]];
            let data = NurbsData {
                degree: 3,
                control_points: points.map(|p| AxisVector::from_slice(&p)).to_vec(),
                weights: vec![1.0; 4],
                knots: vec![0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0],
            };
            let block = Block {
                end: data.control_points[3],
                kind: BlockKind::Nurbs,
                length_mm: 1.0,
                feed_mm_per_s: 1.0,
                ..Block::at(data.control_points[0])
            };
            let course = Course::new(&bounds.context, &block, Some(data.curve())).unwrap();
            let mut queue = Queue::default();
            queue.push(&block, course, &bounds);
            let route = queue.route().unwrap();
            let ends = [data.control_points[0], data.control_points[3]];
            let off_mm = chord_error_mm(&route, &bounds, (0.0, 1.0), &ends, 0.01);
            let share = off_mm / CHORD_ERROR_MM;
            assert!((share - expected).abs() < 1e-3, "{share} for {middle}");
        }
    }
}
