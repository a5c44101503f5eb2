//! What samples of the drawn segments show at any phase of the tick, bounded and not sampled.
//!
//! The difference of order n of samples, over the n-th power of the period T, is the n-th derivative averaged over n periods
//! with a B-spline as weight. So it is never more than the derivative is at any point, and what steps of position, velocity
//! and acceleration between segments add: a step Δv is seen as acceleration of Δv/T at most, and so on. Where that sum keeps
//! a limit, every sample does. Where it does not, the difference itself is asked for: as a function of the phase it is a
//! polynomial between the places where one of its samples enters the next segment, and its bound is exact.

use std::collections::VecDeque;

use tandem_sdk::{MAX_AXES, Segment, SegmentFlags};

use super::Bounds;
use super::bernstein::{add_square, bernstein, highest, largest};
use super::check::Worst;

/// Periods that the longest difference takes.
const PERIODS: usize = 3;
/// What rounding may add to a share.
const ROUNDING: f64 = 1e-9;
/// The same for the share of a feed, which the path by arc length takes too.
const FEED_ROUNDING: f64 = 1e-7;
/// Jerk at a rest as a share of its limit: there the tick begins anew, so the jerk itself is asked for and no difference. A
/// segment follows the jerk of its path to 0.004.
const AT_REST: f64 = 1.006;
/// What samples show of steps where they are not at their worst place, of order 0, 1 and 2 in a difference of order 3.
const WORST: [f64; 3] = [2.0, 1.0, 0.75];

/// A segment, and what it reaches.
#[derive(Clone, Debug)]
struct Span {
    duration_s: f64,
    coefficients: [[f64; 6]; MAX_AXES],
    path: [f64; 6],
    /// Largest absolute values of the derivatives of order 1, 2 and 3 per lane.
    reached: [[f64; PERIODS]; MAX_AXES],
    /// Steps of position, velocity and acceleration at its start per lane.
    steps: [[f64; PERIODS]; MAX_AXES],
    rapid: bool,
    rests: bool,
    /// Bit per axis whose speed a feed is here.
    counted: u32,
    /// Highest speed of these together, mm/s.
    fastest_mm_per_s: f64,
    /// Highest feed that may be asked for; infinite in rapid motion, mm/s.
    feed_mm_per_s: f64,
}

/// What was found in the periods that end in a segment.
#[derive(Clone, Copy, Debug, Default)]
pub struct Found {
    pub worst: Worst,
    /// Path coordinates between which a limit is exceeded, mm.
    pub from_mm: f64,
    pub to_mm: f64,
    /// Steps between segments are a cause of it: what they show goes with the speed.
    pub stepped: bool,
}

/// The last segments; keeps its memory.
#[derive(Clone, Debug, Default)]
pub struct Trail {
    spans: VecDeque<Span>,
}

impl Trail {
    /// Forgets everything but these segments, of which some may lie further back than counts.
    pub fn begin<'a>(&mut self, recent: impl Iterator<Item = &'a Segment>, bounds: &Bounds) {
        self.spans.clear();
        for segment in recent {
            self.push(segment, bounds);
        }
    }

    /// Adds the segment that comes next. Allocates where more lie in three periods than ever before.
    pub fn push(&mut self, segment: &Segment, bounds: &Bounds) {
        let lanes = bounds.context.limits.axes();
        let rapid = segment.flags.contains(SegmentFlags::RAPID);
        let rests = segment.coefficients.iter().all(|c| c[1..] == [0.0; 5]);
        let mut reached = [[0.0; PERIODS]; MAX_AXES];
        let mut steps = [[0.0; PERIODS]; MAX_AXES];
        for (lane, limits) in lanes.iter().enumerate() {
            let c = &segment.coefficients[lane];
            let h = segment.duration_s;
            let [v, a, j] = rates(c);
            reached[lane] = [
                largest(&bernstein(&v, h), top_mm_per_s(limits, rapid)),
                largest(
                    &bernstein(&[a[0], a[1], a[2], a[3]], h),
                    limits.acceleration_mm_per_s2,
                ),
                largest(&bernstein(&[j[0], j[1], j[2]], h), limits.jerk_mm_per_s3),
            ];
            if let Some(before) = self.spans.back() {
                let end = state(&before.coefficients[lane], before.duration_s);
                let start = [c[0], c[1], 2.0 * c[2]];
                steps[lane] = std::array::from_fn(|n| (start[n] - end[n]).abs());
            }
        }
        let coefficients = segment.coefficients;
        let path = segment.path;
        let counted = counted(segment, bounds);
        let feed_mm_per_s = if rapid {
            f64::INFINITY
        } else {
            segment.feed_mm_per_s * bounds.context.max_feed_ratio
        };
        let mut squares = [0.0; 9];
        for (_, c) in lanes_of(counted, &coefficients) {
            add_square(&bernstein(&rates(c)[0], segment.duration_s), &mut squares);
        }
        let fastest_mm_per_s = highest(&squares, feed_mm_per_s * feed_mm_per_s).sqrt();
        self.spans.push_back(Span {
            duration_s: segment.duration_s,
            coefficients,
            path,
            reached,
            steps,
            rapid,
            rests,
            counted,
            fastest_mm_per_s,
            feed_mm_per_s,
        });
        let max_s = PERIODS as f64 * bounds.context.fine_period_s;
        let mut behind_s: f64 = self
            .spans
            .iter()
            .rev()
            .skip(1)
            .map(|span| span.duration_s)
            .sum();
        while let Some(first) = self.spans.front()
            && behind_s - first.duration_s >= max_s
        {
            behind_s -= first.duration_s;
            self.spans.pop_front();
        }
    }

    /// Every difference of samples that ends in the last segment, velocity and acceleration of the axes at every point of it, and the
    /// way of every period by its feed.
    pub fn judge(&self, bounds: &Bounds) -> Found {
        let Some(head) = self.spans.back() else {
            return Found::default();
        };
        let period_s = bounds.context.fine_period_s;
        let mut found = Found {
            from_mm: f64::INFINITY,
            to_mm: f64::NEG_INFINITY,
            ..Found::default()
        };
        for (lane, limits) in bounds.context.limits.axes().iter().enumerate() {
            let around = self.around(lane, period_s);
            let tops = around.kinds.map(|there| f64::from(u8::from(there)));
            let top = (tops[0] * limits.feed_mm_per_s).max(tops[1] * limits.rapid_mm_per_s);
            let limit = [top, limits.acceleration_mm_per_s2, limits.jerk_mm_per_s3];
            let steps = around.show(period_s);
            let here = [
                head.reached[lane][0] / top_mm_per_s(limits, head.rapid),
                head.reached[lane][1] / limit[1],
            ];
            found.take(
                here,
                [head.path[0], polynomial(&head.path, head.duration_s)],
                false,
            );
            for order in 1..=PERIODS {
                let bound = around.reached[order - 1] + steps[order - 1];
                let noise = noise(&head.coefficients[lane], order, period_s);
                if bound <= limit[order - 1] * (1.0 + ROUNDING) + noise {
                    continue;
                }
                // Without them it would be kept.
                let stepped = around.reached[order - 1] <= limit[order - 1] * (1.0 + ROUNDING);
                self.walk(
                    (lane, order),
                    limit[order - 1],
                    noise,
                    stepped,
                    period_s,
                    &mut found,
                );
                let reached = around.reached[order - 1].min(around.jerk_shown);
                let at_rest = (reached + steps[order - 1]) / limit[order - 1];
                if order == PERIODS && around.rests && at_rest > AT_REST {
                    found.take_order(
                        order,
                        at_rest,
                        [
                            self.back_mm(period_s),
                            polynomial(&head.path, head.duration_s),
                        ],
                        stepped,
                    );
                }
            }
        }
        self.judge_feed(bounds, &mut found);
        found
    }

    /// Whether a period that ends in the last segment goes farther than the feed allows. A segment follows the path within a few
    /// nanometres, which is much of the way of a period where the feed is low.
    fn judge_feed(&self, bounds: &Bounds, found: &mut Found) {
        let period_s = bounds.context.fine_period_s;
        let last = self.spans.len() - 1;
        let (first, _) = self.back(last, 0.0, period_s);
        let spans = &self.spans;
        let inside = || spans.range(first..);
        let rounding_mm_per_s: f64 = lanes_of(spans[last].counted, &spans[last].coefficients)
            .map(|(_, c)| noise(c, 1, period_s))
            .sum();
        let allowed =
            |feed_mm_per_s: f64| feed_mm_per_s * (1.0 + FEED_ROUNDING) + rounding_mm_per_s;
        let fastest = inside().map(|span| span.fastest_mm_per_s);
        let stepped_mm: f64 = inside()
            .skip(1)
            .flat_map(|span| lanes_of(span.counted, &span.steps))
            .map(|(_, steps)| steps[0])
            .sum();
        let slowest = inside()
            .filter(|span| !span.rests)
            .map(|span| span.feed_mm_per_s);
        if fastest.fold(0.0, f64::max) + stepped_mm / period_s
            <= allowed(slowest.fold(f64::INFINITY, f64::min))
        {
            return;
        }
        self.each_stretch(1, period_s, |places, [done_s, step_s]| {
            let [(to, _), (from, from_s), ..] = *places;
            let touched = || spans.range(from..=to);
            let feed = touched().map(|span| span.feed_mm_per_s).fold(0.0, f64::max);
            let counted = touched().fold(u32::MAX, |all, span| all & span.counted);
            if feed.is_infinite() {
                return;
            }
            let mut squares = [0.0; 11];
            for (lane, _) in lanes_of(counted, &spans[to].coefficients) {
                let way = self.difference((lane, 1), places);
                add_square(&bernstein(&way, step_s), &mut squares);
            }
            let most_mm = allowed(feed) * period_s;
            let way_mm = highest(&squares, most_mm * most_mm).sqrt();
            if way_mm > most_mm {
                let from_mm = polynomial(&spans[from].path, from_s);
                let to_mm = polynomial(&spans[to].path, done_s + step_s);
                found.take_order(1, way_mm / (feed * period_s), [from_mm, to_mm], false);
            }
        });
    }

    /// What the periods before and in the last segment reach.
    fn around(&self, lane: usize, period_s: f64) -> Around {
        let mut around = Around::default();
        let mut start_s = 0.0;
        let last = self.spans.len() - 1;
        for (n, span) in self.spans.iter().enumerate().rev() {
            if n < last {
                // Where it ends is where the one behind it starts.
                if start_s <= -(PERIODS as f64) * period_s {
                    break;
                }
                start_s -= span.duration_s;
            }
            for (most, reached) in around.reached.iter_mut().zip(span.reached[lane]) {
                *most = most.max(reached);
            }
            around.jerk_shown +=
                WORST[2] * span.duration_s / period_s * span.reached[lane][PERIODS - 1];
            if start_s > -(PERIODS as f64) * period_s {
                for (sum, step) in around.steps.iter_mut().zip(span.steps[lane]) {
                    *sum += step;
                }
            }
            // A rest is of either kind.
            around.kinds[usize::from(span.rapid)] |= !span.rests;
            around.rests |= span.rests;
        }
        around
    }

    /// Path coordinate three periods before the last segment begins, mm.
    fn back_mm(&self, period_s: f64) -> f64 {
        let (n, t_s) = self.back(self.spans.len() - 1, 0.0, PERIODS as f64 * period_s);
        polynomial(&self.spans[n].path, t_s)
    }

    /// The span and the time in it that lie `back_s` before `t_s` of span `n`; the start of the first where that is less.
    fn back(&self, mut n: usize, mut t_s: f64, back_s: f64) -> (usize, f64) {
        t_s -= back_s;
        while t_s < 0.0 && n > 0 {
            n -= 1;
            t_s += self.spans[n].duration_s;
        }
        (n, t_s.max(0.0))
    }

    /// The exact largest difference of `order` of a lane whose last sample lies in the last segment.
    fn walk(
        &self,
        (lane, order): (usize, usize),
        limit: f64,
        noise: f64,
        stepped: bool,
        period_s: f64,
        found: &mut Found,
    ) {
        let head = &self.spans[self.spans.len() - 1];
        let allowed = (limit * (1.0 + ROUNDING) + noise) * power(period_s, order);
        self.each_stretch(order, period_s, |places, [done_s, step_s]| {
            let sum = self.difference((lane, order), places);
            let most = largest(&bernstein(&sum, step_s), allowed);
            if most > allowed {
                let from_mm = polynomial(&self.spans[places[order].0].path, places[order].1);
                let to_mm = polynomial(&head.path, done_s + step_s);
                found.take_order(
                    order,
                    most / (limit * power(period_s, order)),
                    [from_mm, to_mm],
                    stepped,
                );
            }
        });
    }

    /// Stretch by stretch of the last segment, in which no sample of a difference of `order` that ends there enters another segment:
    /// where these samples are when it begins, from the last one back, and the time in the segment and the duration of the stretch, s.
    fn each_stretch(&self, order: usize, period_s: f64, mut look: impl FnMut(&Places, [f64; 2])) {
        let last = self.spans.len() - 1;
        let head = &self.spans[last];
        let mut places: Places = std::array::from_fn(|n| self.back(last, 0.0, n as f64 * period_s));
        let mut done_s = 0.0;
        while done_s < head.duration_s {
            // To the next place where one of the samples comes to the end of its segment.
            let left = |(n, t_s): &(usize, f64)| self.spans[*n].duration_s - t_s;
            let step_s = places[..=order]
                .iter()
                .map(left)
                .fold(head.duration_s - done_s, f64::min)
                .max(0.0);
            look(&places, [done_s, step_s]);
            done_s += step_s;
            let mut moved = false;
            for (n, t_s) in &mut places {
                *t_s += step_s;
                // The head's own end ends the walk.
                while *n < last && self.spans[*n].duration_s - *t_s <= f64::EPSILON * period_s {
                    *t_s = (*t_s - self.spans[*n].duration_s).max(0.0);
                    *n += 1;
                    moved = true;
                }
            }
            if step_s <= f64::EPSILON * period_s && !moved {
                break;
            }
        }
    }

    /// The difference of `order` of a lane with its samples at `places`, by the powers of the time after these.
    fn difference(&self, (lane, order): (usize, usize), places: &Places) -> [f64; 6] {
        const WEIGHTS: [[f64; PERIODS + 1]; PERIODS] = [
            [1.0, -1.0, 0.0, 0.0],
            [1.0, -2.0, 1.0, 0.0],
            [1.0, -3.0, 3.0, -1.0],
        ];
        let base = self.spans[places[0].0].coefficients[lane][0];
        let mut sum = [0.0; 6];
        for ((n, t_s), weight) in places.iter().zip(WEIGHTS[order - 1]).take(order + 1) {
            let shifted = shift(&self.spans[*n].coefficients[lane], base, *t_s);
            for (sum, c) in sum.iter_mut().zip(shifted) {
                *sum += weight * c;
            }
        }
        sum
    }
}

/// The span and the time in it, s, of each sample of a difference, from the last one back.
type Places = [(usize, f64); PERIODS + 1];

/// The axes whose speed a feed is in a segment, a bit for each: the linear ones where any of them moves, else those that turn.
fn counted(segment: &Segment, bounds: &Bounds) -> u32 {
    let axes = &bounds.context.axes;
    let of = |rotary: bool| {
        (0..axes.count())
            .filter(move |axis| axes.is_rotary(*axis) == rotary)
            .fold(0, |bits, axis| bits | 1 << axis)
    };
    let linear = of(false);
    let moves = lanes_of(linear, &segment.coefficients).any(|(_, c)| c[1..] != [0.0; 5]);
    if moves { linear } else { of(true) }
}

/// Those of all lanes whose bit is set, with their number.
fn lanes_of<T>(bits: u32, all: &[T; MAX_AXES]) -> impl Iterator<Item = (usize, &T)> {
    all.iter()
        .enumerate()
        .filter(move |(lane, _)| bits >> lane & 1 == 1)
}

/// What lies in three periods.
#[derive(Clone, Copy, Debug, Default)]
struct Around {
    reached: [f64; PERIODS],
    /// What a difference shows of the jerk at most, mm/s³: of a span that is much shorter than a period, in which the motion comes from
    /// where it rested to the path beside it, next to nothing.
    jerk_shown: f64,
    steps: [f64; PERIODS],
    /// Whether it moves in feed, and in rapid motion.
    kinds: [bool; 2],
    rests: bool,
}

impl Around {
    /// What its steps show in differences of order 1, 2 and 3 at most.
    fn show(&self, period_s: f64) -> [f64; PERIODS] {
        let ([p, v, a], per) = (self.steps, 1.0 / period_s);
        [
            p * per,
            (p * per + v) * per,
            ((WORST[0] * p * per + WORST[1] * v) * per + WORST[2] * a) * per,
        ]
    }
}

impl Found {
    fn take(&mut self, [speed, acceleration]: [f64; 2], ends_mm: [f64; 2], stepped: bool) {
        for (order, share) in [(1, speed), (2, acceleration)] {
            if share > 1.0 + ROUNDING {
                self.take_order(order, share, ends_mm, stepped);
            }
        }
    }

    fn take_order(&mut self, order: usize, share: f64, [from_mm, to_mm]: [f64; 2], stepped: bool) {
        let worst = &mut self.worst;
        let most = match order {
            1 => &mut worst.speed,
            2 => &mut worst.acceleration,
            _ => &mut worst.jerk,
        };
        *most = most.max(share);
        self.from_mm = self.from_mm.min(from_mm);
        self.to_mm = self.to_mm.max(to_mm);
        self.stepped |= stepped;
    }
}

fn top_mm_per_s(limits: &tandem_sdk::AxisLimits, rapid: bool) -> f64 {
    if rapid {
        limits.rapid_mm_per_s
    } else {
        limits.feed_mm_per_s
    }
}

/// What rounding of positions makes of a difference of `order`.
fn noise(c: &[f64; 6], order: usize, period_s: f64) -> f64 {
    let half = [0.5, 1.0, 2.0][order - 1];
    4.0 * half * f64::EPSILON * c[0].abs().max(1.0) / power(period_s, order)
}

/// Coefficients of velocity, acceleration and jerk; those of the higher powers that are not there are zero.
fn rates(c: &[f64; 6]) -> [[f64; 5]; 3] {
    [
        [c[1], 2.0 * c[2], 3.0 * c[3], 4.0 * c[4], 5.0 * c[5]],
        [2.0 * c[2], 6.0 * c[3], 12.0 * c[4], 20.0 * c[5], 0.0],
        [6.0 * c[3], 24.0 * c[4], 60.0 * c[5], 0.0, 0.0],
    ]
}

/// Position, velocity and acceleration at `t`.
fn state(c: &[f64; 6], t: f64) -> [f64; 3] {
    let [v, a, _] = rates(c);
    let of = |c: &[f64; 5]| c.iter().rev().fold(0.0, |sum, c| sum * t + c);
    [polynomial(c, t), of(&v), of(&a)]
}

fn power(period_s: f64, order: usize) -> f64 {
    (0..order).fold(1.0, |product, _| product * period_s)
}

fn polynomial(c: &[f64; 6], t: f64) -> f64 {
    c.iter().rev().fold(0.0, |sum, c| sum * t + c)
}

/// The same polynomial less `base`, in the powers of the time after `t`.
fn shift(c: &[f64; 6], base: f64, t: f64) -> [f64; 6] {
    let mut shifted = *c;
    shifted[0] -= base;
    for first in 0..5 {
        for n in (first..5).rev() {
            shifted[n] += t * shifted[n + 1];
        }
    }
    shifted
}

#[cfg(test)]
mod tests {
    use tandem_rig::{Random, axis, context};
    use tandem_sdk::AxisVector;

    use super::*;

    const PERIOD_S: f64 = 1.3e-3;
    const JERK: f64 = 2e4;
    const WEIGHTS: [[f64; 4]; 3] = [
        [1.0, -1.0, 0.0, 0.0],
        [1.0, -2.0, 1.0, 0.0],
        [1.0, -3.0, 3.0, -1.0],
    ];

    /// Segments along X with steps of position, velocity and acceleration between them, the first over three periods. The path
    /// coordinate counts segments.
    fn drawn(random: &mut Random) -> Vec<Segment> {
        let mut at = [0.0; 3];
        let segment = |n: usize| {
            let periods = if n == 0 { 3.0 } else { random.length(0.1, 3.0) };
            let mut segment = Segment::rest(&AxisVector::ZERO, periods * PERIOD_S);
            segment.feed_mm_per_s = f64::INFINITY;
            let [position, speed, acceleration] = at;
            let jerk = random.between(-JERK, JERK);
            let changes = 1e7 * random.between(-1.0, 1.0);
            let c = [
                position,
                speed,
                acceleration / 2.0,
                jerk / 6.0,
                changes / 24.0,
                0.0,
            ];
            segment.coefficients[0] = c;
            segment.path = [n as f64, 1.0 / segment.duration_s, 0.0, 0.0, 0.0, 0.0];
            at = state(&c, segment.duration_s);
            for (at, most) in at.iter_mut().zip([4e-6, 1.5e-2, 10.0]) {
                *at += most * random.between(-1.0, 1.0);
            }
            segment
        };
        (0..6).map(segment).collect()
    }

    /// Position along X and path coordinate `t_s` after the last segment begins.
    fn at(segments: &[Segment], mut t_s: f64) -> (f64, f64) {
        let mut n = segments.len() - 1;
        while t_s < 0.0 {
            n -= 1;
            t_s += segments[n].duration_s;
        }
        let of = |c: &[f64; 6]| -> f64 { c.iter().rev().fold(0.0, |sum, c| sum * t_s + c) };
        (of(&segments[n].coefficients[0]), of(&segments[n].path))
    }

    /// Times after the last segment begins: even ones, and those just beside the places where a sample enters a segment, which may
    /// lie as near to each other as they like.
    fn phases(segments: &[Segment]) -> Vec<f64> {
        const EVEN: u32 = 500;
        let end_s = segments[segments.len() - 1].duration_s;
        let mut phases: Vec<f64> = (0..=EVEN)
            .map(|n| end_s * f64::from(n) / f64::from(EVEN))
            .collect();
        let mut begins_s = 0.0;
        for segment in segments.iter().rev().skip(1) {
            for n in 0..=3 {
                let enters_s = begins_s + f64::from(n) * PERIOD_S;
                phases.extend([enters_s - 1e-9, enters_s + 1e-9]);
            }
            begins_s -= segment.duration_s;
        }
        phases.retain(|t_s| (0.0..=end_s).contains(t_s));
        phases
    }

    /// Two periods behind a rest samples show little of the jerk with which a motion begins, and the tick begins anew there: the jerk
    /// itself counts, and from three periods before on. Behind a motion no sample shows it.
    #[test]
    fn the_jerk_behind_a_rest_counts_itself() {
        const PATH_MM: f64 = 7.0;
        let mut limits = axis(1e9);
        limits.jerk_mm_per_s3 = JERK;
        limits.feed_mm_per_s = 1e9;
        let bounds = Bounds {
            context: context(&[limits], PERIOD_S),
            chord_error_mm: 0.01,
        };
        for (share, speed, expected) in [(1.02, 0.0, 1.02), (1.004, 0.0, 0.0), (1.02, 1e-3, 0.0)] {
            let mut before = Segment::rest(&AxisVector::ZERO, 4.0 * PERIOD_S);
            before.path = [PATH_MM, 1.0 / PERIOD_S, 0.0, 0.0, 0.0, 0.0];
            before.coefficients[0][1] = speed;
            let mut head = Segment::rest(&AxisVector::ZERO, 2.0 * PERIOD_S);
            head.path = [PATH_MM + 4.0, 1.0 / PERIOD_S, 0.0, 0.0, 0.0, 0.0];
            head.coefficients[0] = [
                4.0 * PERIOD_S * speed,
                speed,
                0.0,
                share * JERK / 6.0,
                0.0,
                0.0,
            ];
            let mut trail = Trail::default();
            trail.begin([before, head].iter(), &bounds);
            let found = trail.judge(&bounds);
            let jerk = found.worst.jerk;
            assert!(
                (jerk - expected).abs() < 1e-6,
                "{share} at {speed} mm/s: {jerk}"
            );
            if expected > 0.0 {
                let ends_mm = [found.from_mm, found.to_mm];
                let apart = |n: usize, mm: f64| (ends_mm[n] - PATH_MM - mm).abs();
                assert!(apart(0, 1.0) < 1e-9 && apart(1, 6.0) < 1e-9, "{ends_mm:?}");
            }
        }
    }

    /// What samples at many phases show is what is found, and where they show too much lies in the range that is told.
    #[test]
    fn differences_are_those_of_samples_at_any_phase() {
        let mut random = Random::from_the_clock();
        let mut limits = axis(5.0);
        limits.jerk_mm_per_s3 = JERK;
        limits.feed_mm_per_s = 0.01;
        let most_apart = [
            0.01 * PERIOD_S,
            5.0 * PERIOD_S * PERIOD_S,
            JERK * PERIOD_S * PERIOD_S * PERIOD_S,
        ];
        let bounds = Bounds {
            context: context(&[limits], PERIOD_S),
            chord_error_mm: 0.01,
        };
        let mut exceeded = 0;
        for _ in 0..300 {
            let segments = drawn(&mut random);
            let mut trail = Trail::default();
            trail.begin(segments.iter(), &bounds);
            let found = trail.judge(&bounds);
            let worst = [
                found.worst.speed,
                found.worst.acceleration,
                found.worst.jerk,
            ];
            let mut most = [0.0_f64; 3];
            for t_s in phases(&segments) {
                let back = [0, 1, 2, 3].map(|n| at(&segments, t_s - f64::from(n) * PERIOD_S));
                for (order, weights) in WEIGHTS.iter().enumerate() {
                    let sum: f64 = weights.iter().zip(back).map(|(w, (x, _))| w * x).sum();
                    let share = sum.abs() / most_apart[order];
                    most[order] = most[order].max(share);
                    if share > 1.0 + 1e-6 {
                        let (from_mm, to_mm) = (back[order + 1].1, back[0].1);
                        assert!(found.from_mm < from_mm + 1e-9 && found.to_mm > to_mm - 1e-9);
                    }
                }
            }
            for (worst, most) in worst.into_iter().zip(most) {
                assert!(
                    most < worst.max(1.0) + 1e-6,
                    "{most} of samples, {worst} found"
                );
            }
            assert!(worst[2] < (1.02 * most[2]).max(1.02), "{most:?}, {worst:?}");
            exceeded += usize::from(most[2] > 1.0);
        }
        assert!((30..=270).contains(&exceeded), "{exceeded}");
    }

    /// The way of a period of two axes together is what samples at many phases show, and between what path coordinates it is too long
    /// is told. A rapid has no feed.
    #[test]
    fn the_way_of_a_period_is_that_of_samples_at_any_phase() {
        const FEED_MM_PER_S: f64 = 0.3;
        let mut random = Random::from_the_clock();
        let mut limits = axis(1e9);
        limits.jerk_mm_per_s3 = 1e12;
        limits.feed_mm_per_s = 1e9;
        let bounds = Bounds {
            context: context(&[limits; 2], PERIOD_S),
            chord_error_mm: 0.01,
        };
        let mut exceeded = 0;
        for _ in 0..300 {
            let mut along = drawn(&mut random);
            let across = drawn(&mut random);
            for (segment, other) in along.iter_mut().zip(&across) {
                segment.feed_mm_per_s = FEED_MM_PER_S;
                // The second axis takes as long as the first.
                let slower = other.duration_s / segment.duration_s;
                let mut power = 1.0;
                segment.coefficients[1] = other.coefficients[0].map(|c| {
                    let slowed = c * power;
                    power *= slower;
                    slowed
                });
            }
            let mut trail = Trail::default();
            trail.begin(along.iter(), &bounds);
            let found = trail.judge(&bounds);
            let across: Vec<Segment> = along.iter().map(turned).collect();
            let mut most = 0.0_f64;
            for t_s in phases(&along) {
                let [way, other] = [&along, &across]
                    .map(|segments| at(segments, t_s).0 - at(segments, t_s - PERIOD_S).0);
                let share = way.hypot(other) / (FEED_MM_PER_S * PERIOD_S);
                most = most.max(share);
                if share > 1.0 + 1e-6 {
                    let [to_mm, from_mm] = [t_s, t_s - PERIOD_S].map(|t_s| at(&along, t_s).1);
                    assert!(found.from_mm < from_mm + 1e-9 && found.to_mm > to_mm - 1e-9);
                }
            }
            let worst = found.worst.speed;
            assert!(most < worst.max(1.0) + 1e-6, "{most} of {worst}");
            assert!(worst < (1.02 * most).max(1.0), "{most} of {worst}");
            exceeded += usize::from(most > 1.0);
            let last = along.len() - 1;
            along[last].flags = SegmentFlags::RAPID;
            trail.begin(along.iter(), &bounds);
            assert!(trail.judge(&bounds).worst.speed <= 1.0);
        }
        assert!((30..=270).contains(&exceeded), "{exceeded}");
    }

    /// The same with the second axis for the first.
    fn turned(segment: &Segment) -> Segment {
        let mut turned = *segment;
        turned.coefficients.swap(0, 1);
        turned
    }
}
