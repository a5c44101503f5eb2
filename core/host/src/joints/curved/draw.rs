//! Segments of a plan that is driven at another rate.

use tandem_motion::hermite;
use tandem_sdk::{Axes, AxisVector, Segment, SegmentFlags, SegmentSink};

use super::super::space::JointSpace;
use super::point::{Point, State};
use super::rates::Interval;

/// Longest part that is drawn as one polynomial, s.
const LONGEST_S: f64 = 0.004;
/// Most parts of one interval: at next to no rate they are longer.
const MAX_PARTS: f64 = 1000.0;

/// A stretch of the segment `from` that begins at its local time `begins_s`, whose rate goes from `rates[0]` to `rates[1]`.
pub struct Stretch<'a> {
    pub from: &'a Segment,
    pub begins_s: f64,
    pub interval: &'a Interval,
    pub rates: [f64; 2],
    /// It is the first, or the last, of its segment.
    pub first: bool,
    pub last: bool,
}

/// The plan at one instant of machine time.
fn driven(state: &State, rate: f64, change: f64) -> [AxisVector; 3] {
    let square = rate * rate;
    [
        state.position,
        state.velocity * rate,
        state.acceleration * square + state.velocity * change,
    ]
}

/// Writes polynomials over `h` s from one state to the next.
fn polynomials(segment: &mut Segment, ends: &[[AxisVector; 3]; 2], count: usize, h: f64) {
    for entry in 0..count {
        let [from, to] = ends.map(|end| end.map(|vector| vector[entry]));
        segment.coefficients[entry] = hermite(from, to, h);
    }
}

/// `from` as it is, with the joints behind the axes, and with no more deceleration than they leave in its `intervals`.
pub fn as_planned(
    from: &Segment,
    intervals: &[Interval],
    space: &JointSpace,
    axes: &Axes,
    sink: &mut dyn SegmentSink,
) {
    let mut segment = *from;
    let count = axes.count();
    for point in intervals.iter().flat_map(|i| [&i.start, &i.end]) {
        let left = point.deceleration(1.0);
        segment.stop_deceleration_mm_per_s2 = segment.stop_deceleration_mm_per_s2.min(left);
    }
    let start = State::of(from, 0.0, space, axes);
    if from.duration_s > 0.0 {
        let end = State::of(from, from.duration_s, space, axes);
        let ends = [driven(&start, 1.0, 0.0), driven(&end, 1.0, 0.0)];
        polynomials(&mut segment, &ends, count + space.count(), from.duration_s);
        segment.coefficients[..count].copy_from_slice(&from.coefficients[..count]);
        if intervals.iter().any(|interval| interval.without_lead) {
            let none = |vector: &mut AxisVector| vector.0[count..].fill(0.0);
            none(&mut segment.step_velocity);
            none(&mut segment.step_acceleration);
        } else {
            leads(&mut segment, [&start, &end], [1.0; 2]);
        }
        (segment.step_velocity.0[..count]).copy_from_slice(&from.step_velocity.0[..count]);
        (segment.step_acceleration.0[..count]).copy_from_slice(&from.step_acceleration.0[..count]);
    } else {
        for joint in count..count + space.count() {
            segment.coefficients[joint] = [start.position[joint], 0.0, 0.0, 0.0, 0.0, 0.0];
        }
    }
    sink.segment(&segment);
}

/// The leads over the continuous velocity at both ends, as the line between them.
fn leads(segment: &mut Segment, states: [&State; 2], rates: [f64; 2]) {
    let [from, to] = [0, 1].map(|end| states[end].lead * rates[end]);
    segment.step_velocity = from;
    segment.step_acceleration = (from - to) * (1.0 / segment.duration_s);
}

/// Draws `stretch`; gives how long it takes, s.
pub fn stretch(
    stretch: &Stretch<'_>,
    space: &JointSpace,
    axes: &Axes,
    sink: &mut dyn SegmentSink,
) -> f64 {
    let Stretch {
        from,
        interval,
        rates,
        ..
    } = stretch;
    let all_s = 2.0 * interval.duration_s / (rates[0] + rates[1]);
    let change = (rates[1] - rates[0]) / all_s;
    let parts = (all_s / LONGEST_S).ceil().clamp(1.0, MAX_PARTS);
    let (h, count) = (all_s / parts, axes.count() + space.count());
    let at = |t_s: f64| {
        let rate = rates[0] + change * t_s;
        let gone_s = (rates[0] + 0.5 * change * t_s) * t_s;
        let state = State::of(from, stretch.begins_s + gone_s, space, axes);
        (state, rate)
    };
    let least = |point: &Point, rate: f64| point.deceleration(rate * rate);
    let deceleration = least(&interval.start, rates[0]).min(least(&interval.end, rates[1]));
    let mut segment = **from;
    segment.duration_s = h;
    (segment.step_velocity, segment.step_acceleration) = (AxisVector::ZERO, AxisVector::ZERO);
    segment.stop_deceleration_mm_per_s2 = from.stop_deceleration_mm_per_s2.min(deceleration);
    let only = |flag: SegmentFlags, here: bool| {
        if here {
            SegmentFlags(from.flags.0 & flag.0)
        } else {
            SegmentFlags(0)
        }
    };
    let ends = SegmentFlags::BLOCK_ENDS.with(SegmentFlags::ENDS_AT_REST);
    let always = from.flags.without(ends).without(SegmentFlags::BLOCK_BEGINS);
    let (mut state, mut rate) = at(0.0);
    for part in 0..parts as usize {
        let last = part + 1 == parts as usize;
        let (next, next_rate) = at(if last { all_s } else { h * (part + 1) as f64 });
        segment.flags = always
            .with(only(SegmentFlags::BLOCK_BEGINS, stretch.first && part == 0))
            .with(only(ends, stretch.last && last));
        let both = [
            driven(&state, rate, change),
            driven(&next, next_rate, change),
        ];
        polynomials(&mut segment, &both, count, h);
        let path = [(&state, rate), (&next, next_rate)].map(|(state, rate)| {
            let [place, speed, acceleration] = state.path;
            let along = acceleration * rate * rate + speed * change;
            [place, speed * rate, along]
        });
        segment.path = hermite(path[0], path[1], h);
        if !interval.without_lead {
            leads(&mut segment, [&state, &next], [rate, next_rate]);
        }
        sink.segment(&segment);
        (state, rate) = (next, next_rate);
    }
    all_s
}
