//! A window of the published method: a change of speed as a cubic of time, without acceleration at its ends.

/// Least duration of a ramp, s. A shorter one would change the speed by less than 0.003 mm/s.
pub const MIN_S: f64 = 2e-4;
/// Halvings in which a place of a ramp is found.
const HALVINGS: usize = 30;

/// What a ramp may use along the path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tangential {
    /// Acceleration, mm/s².
    pub acceleration_mm_per_s2: f64,
    /// Jerk, mm/s³.
    pub jerk_mm_per_s3: f64,
}

/// One ramp or a stretch at level speed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Ramp {
    /// Path coordinate at the start, mm.
    pub start_mm: f64,
    /// Duration, s.
    pub duration_s: f64,
    /// Speed `a + b·t + c·t² + d·t³`, mm/s.
    pub speed: [f64; 4],
}

impl Tangential {
    /// Shortest duration in which a cubic changes the speed by `change_mm_per_s`, s: its acceleration peaks in the middle
    /// at 3/2 of the mean, its jerk at the ends at 6 times the change over the square of the duration.
    pub fn duration_s(&self, change_mm_per_s: f64) -> f64 {
        let change = change_mm_per_s.abs();
        if change == 0.0 {
            return 0.0;
        }
        (1.5 * change / self.acceleration_mm_per_s2)
            .max((6.0 * change / self.jerk_mm_per_s3).sqrt())
            .max(MIN_S)
    }

    /// Way of that change, mm: a cubic is symmetric, so the mean speed is that of its ends.
    pub fn way_mm(&self, from_mm_per_s: f64, to_mm_per_s: f64) -> f64 {
        f64::midpoint(from_mm_per_s, to_mm_per_s) * self.duration_s(to_mm_per_s - from_mm_per_s)
    }

    /// The highest speed, at most `max_mm_per_s`, that can be reached from `from_mm_per_s` within `way_mm`.
    pub fn reach_mm_per_s(&self, from_mm_per_s: f64, way_mm: f64, max_mm_per_s: f64) -> f64 {
        if max_mm_per_s <= from_mm_per_s {
            return max_mm_per_s;
        }
        highest((from_mm_per_s, max_mm_per_s), |speed| {
            way_mm - self.way_mm(from_mm_per_s, speed)
        })
    }
}

/// Room, mm, that is as good as none.
const ENOUGH_MM: f64 = 1e-12;

/// The highest value between two up to which there is `room`, which falls, and which there is at the lower one: false
/// position after Illinois, so a few steps.
pub fn highest((least, most): (f64, f64), room: impl Fn(f64) -> f64) -> f64 {
    let mut low = least;
    let mut high = most;
    let mut rooms = [room(least), room(most)];
    let mut side = 0;
    if rooms[1] >= 0.0 || rooms[0] <= 0.0 {
        return if rooms[1] >= 0.0 { most } else { least };
    }
    for _ in 0..60 {
        let middle = low + (high - low) * rooms[0] / (rooms[0] - rooms[1]);
        let found = room(middle);
        if found >= 0.0 {
            low = middle;
            rooms[0] = found;
            rooms[1] *= if side == 1 { 0.5 } else { 1.0 };
            side = 1;
        } else {
            high = middle;
            rooms[1] = found;
            rooms[0] *= if side == 2 { 0.5 } else { 1.0 };
            side = 2;
        }
        if (0.0..ENOUGH_MM).contains(&found) || high - low <= 1e-15 * high {
            break;
        }
    }
    low
}

/// The cubic `a + b·t + c·t² + d·t³` of speed with speed and acceleration given at both ends of `duration_s`.
///
/// Equations (1) and (2) of the published method with the coefficients that meet the end conditions: as printed, b is the
/// acceleration at the end and d has the other sign.
pub fn cubic(
    speeds_mm_per_s: [f64; 2],
    accelerations_mm_per_s2: [f64; 2],
    duration_s: f64,
) -> [f64; 4] {
    let ([from, to], [start, end], t) = (speeds_mm_per_s, accelerations_mm_per_s2, duration_s);
    let c = 3.0 * (to - from) / (t * t) - (2.0 * start + end) / t;
    let d = 2.0 * (from - to) / (t * t * t) + (start + end) / (t * t);
    [from, start, c, d]
}

impl Ramp {
    /// The ramp between two speeds.
    pub fn new(start_mm: f64, speeds_mm_per_s: [f64; 2], duration_s: f64) -> Self {
        let [from, to] = speeds_mm_per_s;
        let level = from == to || duration_s == 0.0;
        let speed = if level {
            [from, 0.0, 0.0, 0.0]
        } else {
            cubic(speeds_mm_per_s, [0.0; 2], duration_s)
        };
        Self {
            start_mm,
            duration_s,
            speed,
        }
    }

    /// Path coordinate, speed, acceleration and jerk along the path at `t_s`.
    pub fn at(&self, t_s: f64) -> [f64; 4] {
        let ([a, b, c, d], t) = (self.speed, t_s);
        [
            self.start_mm + t * (a + t * (b / 2.0 + t * (c / 3.0 + t * d / 4.0))),
            a + t * (b + t * (c + t * d)),
            b + t * (2.0 * c + t * 3.0 * d),
            2.0 * c + t * 6.0 * d,
        ]
    }

    /// When it is at `at_mm`, between two times, s: by halving.
    pub fn time_at(&self, at_mm: f64, [mut from_s, mut to_s]: [f64; 2]) -> f64 {
        for _ in 0..HALVINGS {
            let middle_s = f64::midpoint(from_s, to_s);
            if self.at(middle_s)[0] < at_mm {
                from_s = middle_s;
            } else {
                to_s = middle_s;
            }
        }
        to_s
    }
}
