//! Corners: places where the limit of the speed is lowest.

use super::ramp::Tangential;
use super::ripple::Corner;

/// Places of a survey at most: what lies beyond belongs to the next window.
const MAX_PLACES: usize = 40_000;
/// Steps of a golden section for corners as published: 1e-6 of the places around.
pub const SECTIONS: usize = 30;

/// What holds at a place of the path.
#[derive(Clone, Copy, Debug)]
pub struct Spot {
    /// Highest speed, mm/s.
    pub speed_mm_per_s: f64,
    /// What axes leave along the path.
    pub tangential: Tangential,
    /// The path is straight there: nothing but the speed itself is limited, and samples show whatever is above it.
    pub is_straight: bool,
    /// Distance to the next place to be looked at, mm.
    pub step_mm: f64,
    /// Distance to the next place where the derivatives of the path may jump, mm: that is one to be looked at.
    pub knot_mm: f64,
}

/// The places of a window; keeps its memory.
#[derive(Debug, Default)]
pub struct Survey {
    pub places: Vec<Corner>,
    /// At which of the places the path is straight.
    straight: Vec<bool>,
    /// Both ends and the corners between them, in their order.
    pub corners: Vec<Corner>,
    /// Highest speed anywhere, mm/s.
    pub feed_mm_per_s: f64,
    /// Least of what the axes leave anywhere.
    pub tangential: Option<Tangential>,
    /// Steps in which a corner is sought between places.
    pub sections: usize,
    /// Places and corners as they were found.
    found: [Vec<Corner>; 2],
}

impl Survey {
    /// Looks at the path from `start` to `end_mm`, or as far as it takes about `window_s`; the last corner is a rest.
    /// Gives whether it goes to the end.
    pub fn make(
        &mut self,
        start: Corner,
        end_mm: f64,
        window_s: f64,
        look: &mut dyn FnMut(f64) -> Spot,
    ) -> bool {
        let whole = self.look_around(start, end_mm, window_s, look);
        self.feed_mm_per_s = self
            .places
            .iter()
            .map(|place| place.speed_mm_per_s)
            .fold(0.0, f64::max);
        self.corners.clear();
        self.corners.push(start);
        self.find(look);
        if let Some(last) = self.places.last() {
            self.corners.push(Corner {
                speed_mm_per_s: 0.0,
                ..*last
            });
        }
        whole
    }

    /// The limit between the places.
    pub fn limit(&self) -> Limit<'_> {
        Limit {
            straight: &self.straight,
            ..Limit::new(&self.places)
        }
    }

    /// Keeps what was found, to be slowed again and again.
    pub fn keep(&mut self) {
        self.found[0].clone_from(&self.places);
        self.found[1].clone_from(&self.corners);
    }

    /// What was kept, with the speed in a share everywhere and, of parts between two path coordinates, in shares of that.
    /// The speed at the start stays.
    pub fn slow(&mut self, share: f64, parts: impl Iterator<Item = ([f64; 2], f64)>) {
        self.places.clone_from(&self.found[0]);
        self.corners.clone_from(&self.found[1]);
        let start = self.corners.first().copied();
        let everywhere = ([f64::NEG_INFINITY, f64::INFINITY], share);
        for ([from_mm, to_mm], share) in std::iter::once(everywhere).chain(parts) {
            let first = self
                .corners
                .partition_point(|corner| corner.at_mm < from_mm);
            let inside = self.corners[first..]
                .iter_mut()
                .take_while(|corner| corner.at_mm <= to_mm);
            inside.for_each(|corner| corner.speed_mm_per_s *= share);
            // The part may be shorter than the way from one place to the next: those around it count too.
            let first = self.places.partition_point(|place| place.at_mm < from_mm);
            let behind = self.places.partition_point(|place| place.at_mm <= to_mm);
            let around = first.saturating_sub(1)..(behind + 1).min(self.places.len());
            self.places[around]
                .iter_mut()
                .for_each(|place| place.speed_mm_per_s *= share);
        }
        if let (Some(first), Some(start)) = (self.corners.first_mut(), start) {
            *first = start;
        }
        self.feed_mm_per_s = self
            .places
            .iter()
            .map(|place| place.speed_mm_per_s)
            .fold(0.0, f64::max);
    }

    fn look_around(
        &mut self,
        start: Corner,
        end_mm: f64,
        window_s: f64,
        look: &mut dyn FnMut(f64) -> Spot,
    ) -> bool {
        self.places.clear();
        self.straight.clear();
        self.tangential = None;
        let mut at_mm = start.at_mm;
        let mut time_s = 0.0;
        let mut speed = start.speed_mm_per_s;
        loop {
            let spot = look(at_mm);
            self.places.push(Corner {
                at_mm,
                speed_mm_per_s: spot.speed_mm_per_s,
            });
            self.straight.push(spot.is_straight);
            self.tangential = Some(
                self.tangential
                    .map_or(spot.tangential, |least| least.min(&spot.tangential)),
            );
            let ahead_mm = end_mm - at_mm;
            if ahead_mm <= 0.0 {
                return true;
            }
            if time_s > window_s || self.places.len() >= MAX_PLACES {
                return false;
            }
            // No sliver before the end or a knot.
            let near_mm = ahead_mm.min(spot.knot_mm);
            let step_mm = if near_mm < 1.5 * spot.step_mm {
                near_mm
            } else {
                spot.step_mm
            };
            let faster =
                (speed * speed + 2.0 * spot.tangential.acceleration_mm_per_s2 * step_mm).sqrt();
            let next = faster.min(spot.speed_mm_per_s);
            // Beside a cusp both are next to nothing, though the way is driven in the time from rest to rest.
            let rests_s = 4.0 * (step_mm / (2.0 * spot.tangential.jerk_mm_per_s3)).cbrt();
            time_s += rests_s.min(2.0 * step_mm / (speed + next));
            speed = next;
            at_mm = if step_mm == ahead_mm {
                end_mm
            } else {
                at_mm + step_mm
            };
        }
    }

    /// Inner places where the speed is lower than on both sides; of level ones the middle.
    fn find(&mut self, look: &mut dyn FnMut(f64) -> Spot) {
        let mut i = 1;
        while i + 1 < self.places.len() {
            let speed = self.places[i].speed_mm_per_s;
            let level = self.places[i..]
                .iter()
                .take_while(|c| c.speed_mm_per_s == speed)
                .count();
            let after = self.places.get(i + level).map_or(0.0, |c| c.speed_mm_per_s);
            if speed < self.feed_mm_per_s
                && self.places[i - 1].speed_mm_per_s > speed
                && after > speed
            {
                let between = (self.places[i - 1].at_mm, self.places[i + level].at_mm);
                let corner = lowest(between, self.sections, &mut |at_mm| {
                    look(at_mm).speed_mm_per_s
                });
                // At a knot the speed may be lower than anywhere beside it.
                let place = self.places[i];
                self.corners
                    .push(if place.speed_mm_per_s < corner.speed_mm_per_s {
                        place
                    } else {
                        corner
                    });
            }
            i += level;
        }
    }
}

/// The lowest place between two others, by golden section.
fn lowest(
    (mut from, mut to): (f64, f64),
    sections: usize,
    speed: &mut dyn FnMut(f64) -> f64,
) -> Corner {
    let share = 0.5 * (5.0f64.sqrt() - 1.0);
    let mut inner = [to - share * (to - from), from + share * (to - from)];
    let mut speeds = inner.map(&mut *speed);
    for _ in 0..sections {
        if speeds[0] <= speeds[1] {
            to = inner[1];
            inner[1] = inner[0];
            speeds[1] = speeds[0];
            inner[0] = to - share * (to - from);
            speeds[0] = speed(inner[0]);
        } else {
            from = inner[0];
            inner[0] = inner[1];
            speeds[0] = speeds[1];
            inner[1] = from + share * (to - from);
            speeds[1] = speed(inner[1]);
        }
    }
    let n = usize::from(speeds[1] < speeds[0]);
    Corner {
        at_mm: inner[n],
        speed_mm_per_s: speeds[n],
    }
}

/// The limit between the places of a survey, straight from one to the next.
#[derive(Debug)]
pub struct Limit<'a> {
    places: &'a [Corner],
    /// Of each place; empty where nothing is known of that.
    straight: &'a [bool],
    at: usize,
}

/// A limit that rises by this factor from one place to the next steps there: a block of a higher feed begins. Along a curve places stand so
/// close that it rises by less, and a ramp that is compared at each of them is another one at nearly every curve. With half of the rise one
/// place in fifty of a curve steps, and with twice as much a block of a seventh more feed does not
/// (`a_higher_feed_is_a_step_of_the_limit_and_a_curve_hardly_ever_is`).
const STEP: f64 = 1.1;

impl<'a> Limit<'a> {
    /// Of two places at least.
    pub fn new(places: &'a [Corner]) -> Self {
        Self {
            places,
            straight: &[],
            at: 0,
        }
    }

    /// The limit at `at_mm`, mm/s; found soonest near the last one asked for.
    pub fn at(&mut self, at_mm: f64) -> f64 {
        let last = self.places.len() - 2;
        while self.at < last && self.places[self.at + 1].at_mm < at_mm {
            self.at += 1;
        }
        if self.places[self.at].at_mm > at_mm {
            self.at = self
                .places
                .partition_point(|place| place.at_mm <= at_mm)
                .max(1)
                - 1;
        }
        let [a, b] = [self.places[self.at], self.places[self.at + 1]];
        let share = ((at_mm - a.at_mm) / (b.at_mm - a.at_mm)).clamp(0.0, 1.0);
        a.speed_mm_per_s + share * (b.speed_mm_per_s - a.speed_mm_per_s)
    }

    /// The limit between two path coordinates where the path is straight and the limit the same all along, mm/s.
    pub fn level_between(&mut self, from_mm: f64, to_mm: f64) -> Option<f64> {
        let speed = self.at(from_mm);
        let mut within = (self.at..self.places.len())
            .take_while(|place| *place == self.at || self.places[*place].at_mm < to_mm);
        let is_level = within.all(|place| {
            self.straight.get(place) == Some(&true) && self.places[place].speed_mm_per_s == speed
        });
        (is_level && self.at(to_mm) == speed).then_some(speed)
    }

    /// The places behind one path coordinate, at which the limit was asked for last, and before another, right behind which the limit
    /// rises at once: where a block of a higher feed begins.
    pub fn between(&self, from_mm: f64, to_mm: f64) -> impl Iterator<Item = &'a Corner> {
        let pairs = self.places[self.at..].windows(2);
        pairs
            .skip_while(move |pair| pair[0].at_mm <= from_mm)
            .take_while(move |pair| pair[0].at_mm < to_mm)
            .filter(|pair| pair[1].speed_mm_per_s > STEP * pair[0].speed_mm_per_s)
            .map(|pair| &pair[0])
    }
}

impl Tangential {
    fn min(&self, other: &Self) -> Self {
        Self {
            acceleration_mm_per_s2: self
                .acceleration_mm_per_s2
                .min(other.acceleration_mm_per_s2),
            jerk_mm_per_s3: self.jerk_mm_per_s3.min(other.jerk_mm_per_s3),
        }
    }
}
