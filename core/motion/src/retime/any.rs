//! Retiming of motions whose number of axes is known when it is asked for.

use tandem_sdk::MAX_AXES;

use super::retimer::{Asked, Factors, Retimer, Status};
use super::timing::Rate;
use super::{End, PLACES, Point};
use crate::lanes::each;

/// Groups of rows: jerk at three places, acceleration at two.
const GROUPS: usize = PLACES + 2;
/// Axes of the smaller of both forms: four numbers fill a wide register.
const FEW: usize = 4;

/// What is asked of a solution where nothing else is said: its rows are kept within two thousandths, its time is within about 1e-4 of
/// the least.
pub const ASKED: Asked = Asked {
    gap: 1e-4,
    violation: 2e-3,
    iterations: 40,
    min_rate_squared: 1e-3,
};

/// Further places of an interval at which limits are asked for: where a derivative of the motion jumps both sides of that,
/// where it turns much more places between.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Between {
    /// The interval.
    pub interval: usize,
    /// Where in it, 0 to 1.
    pub z: [f64; PLACES],
    /// The motion there.
    pub points: [Point<MAX_AXES>; PLACES],
}

/// Share of a limit that is next to none: an axis that takes less of all of its limits at a rate of 1 keeps them at any.
const NONE: f64 = 1e-5;

/// What each axis may do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisLimits {
    /// Number of axes.
    pub count: usize,
    /// Acceleration, mm/s².
    pub acceleration_mm_per_s2: [f64; MAX_AXES],
    /// Jerk, mm/s³.
    pub jerk_mm_per_s3: [f64; MAX_AXES],
}

/// What is to be retimed.
#[derive(Clone, Copy, Debug)]
pub struct Task<'a> {
    /// Three places on each interval of the grid.
    pub points: &'a [[Point<MAX_AXES>; PLACES]],
    /// Further places.
    pub between: &'a [Between],
    /// What each axis may do.
    pub limits: AxisLimits,
    /// Length of an interval, s.
    pub step_s: f64,
    /// How the motion begins and ends.
    pub ends: (End, End),
}

/// Solves retimings of any number of axes; keeps its memory from one to the next.
#[derive(Debug, Default)]
pub struct AnyRetimer {
    few: Retimer<FEW, GROUPS>,
    all: Retimer<MAX_AXES, GROUPS>,
    /// The result.
    pub rate: Rate,
}

impl AnyRetimer {
    /// Finds the rate for `task`. Rough loop; allocates where the grid is larger than any before.
    pub fn solve(&mut self, task: &Task) -> Status {
        self.solve_to(task, &ASKED)
    }

    /// The same, as near as is asked for.
    pub fn solve_to(&mut self, task: &Task, asked: &Asked) -> Status {
        self.solve_from(task, asked, false)
    }

    /// The same as [`AnyRetimer::solve`], from the present [`AnyRetimer::rate`]: that of points which were about the same, on the same
    /// grid.
    pub fn solve_again(&mut self, task: &Task) -> Status {
        self.solve_from(task, &ASKED, true)
    }

    fn solve_from(&mut self, task: &Task, asked: &Asked, again: bool) -> Status {
        if task.limits.count <= FEW {
            solve(&mut self.few, &mut self.rate, task, asked, again)
        } else {
            solve(&mut self.all, &mut self.rate, task, asked, again)
        }
    }
}

fn solve<const L: usize>(
    retimer: &mut Retimer<L, GROUPS>,
    rate: &mut Rate,
    task: &Task,
    asked: &Asked,
    again: bool,
) -> Status {
    let limits = &task.limits;
    let per = |limits: &[f64; MAX_AXES], l: usize| {
        if l < task.limits.count {
            1.0 / limits[l]
        } else {
            0.0
        }
    };
    let factors = Factors {
        per_acceleration: each(|l| per(&limits.acceleration_mm_per_s2, l)),
        per_jerk: each(|l| per(&limits.jerk_mm_per_s3, l)),
    };
    let moving = std::array::from_fn(|l| l < limits.count && task.moves(l));
    let count = task.points.len() + task.between.len();
    retimer.begin(count, task.step_s, &moving);
    for points in task.points {
        retimer.push(&points.each_ref().map(narrow), &factors);
    }
    for more in task.between {
        let points = more.points.each_ref().map(narrow);
        retimer.push_between(more.interval, (&more.z, &points), &factors);
    }
    std::mem::swap(rate, &mut retimer.rate);
    let status = if again {
        retimer.solve_again(task.ends, asked)
    } else {
        retimer.solve(task.ends, asked)
    };
    std::mem::swap(rate, &mut retimer.rate);
    status
}

impl Task<'_> {
    /// Whether an axis moves so much that its rows count.
    fn moves(&self, l: usize) -> bool {
        let acceleration = NONE * self.limits.acceleration_mm_per_s2[l];
        let jerk = NONE * self.limits.jerk_mm_per_s3[l];
        let speed = (acceleration * self.step_s).min(jerk * self.step_s * self.step_s);
        let rests = |point: &Point<MAX_AXES>| {
            speed.is_finite()
                && point.first[l].abs() <= speed
                && point.second[l].abs() <= acceleration
                && point.third[l].abs() <= jerk
        };
        let between = self.between.iter().map(|more| &more.points);
        !self.points.iter().chain(between).flatten().all(rests)
    }
}

/// The point of the first axes.
fn narrow<const L: usize>(point: &Point<MAX_AXES>) -> Point<L> {
    Point {
        first: each(|l| point.first[l]),
        second: each(|l| point.second[l]),
        third: each(|l| point.third[l]),
        most: point.most,
        jerk_share: point.jerk_share,
        acceleration_share: point.acceleration_share,
    }
}
