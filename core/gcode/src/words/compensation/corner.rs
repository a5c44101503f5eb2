//! Corners of a path that is driven beside the programmed one. Pure geometry in a plane, mm and rad.

use std::f64::consts::{PI, TAU};

use crate::words::circle::Point;

/// A corner that turns by less is none, rad: LinuxCNC's value. What is left of it is a step of 1/800 of the tool's radius.
const STRAIGHT_ON: f64 = 0.05;

/// Rounding of places and angles, mm and rad.
const ROUNDING: f64 = 1e-9;

/// What the centre of the tool follows.
#[derive(Clone, Copy, Debug)]
pub(super) enum Track {
    Line {
        through: Point,
        direction: Point,
    },
    Circle {
        center: Point,
        radius_mm: f64,
        outside: bool,
        clockwise: bool,
    },
}

impl Track {
    /// How much the programmed path bends away from the side of the tool, 1/mm.
    fn bend(&self, tool_radius_mm: f64) -> f64 {
        match self {
            Self::Line { .. } => 0.0,
            Self::Circle {
                radius_mm,
                outside: true,
                ..
            } => 1.0 / (radius_mm - tool_radius_mm),
            Self::Circle { radius_mm, .. } => -1.0 / (radius_mm + tool_radius_mm),
        }
    }
}

/// How two tracks join.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Corner {
    /// One goes on where the other ends.
    Straight,
    /// An outside corner: the tool rolls around it.
    Round,
    /// An inside corner: they meet here.
    Inside(Point),
}

/// The unit vector to the side of the tool, 1 for left, of a direction.
pub(super) fn beside(direction: Point, side: f64) -> Point {
    [-direction[1] * side, direction[0] * side]
}

/// `from` and a length of `by` in a direction.
pub(super) fn along(from: Point, direction: Point, by: f64) -> Point {
    [from[0] + by * direction[0], from[1] + by * direction[1]]
}

/// The unit vector from one point to another that lies elsewhere.
pub(super) fn unit(from: Point, to: Point) -> Point {
    let length = distance(from, to);
    [(to[0] - from[0]) / length, (to[1] - from[1]) / length]
}

pub(super) fn distance(a: Point, b: Point) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

pub(super) fn dot(a: Point, b: Point) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

/// How the path joins where it goes from one direction into another, with the side and the radius of the tool; `end` is where the
/// first track ends.
///
/// # Errors
/// The tracks do not meet: the tool does not fit into the corner.
pub(super) fn join(
    directions: [Point; 2],
    (side, tool_radius_mm): (f64, f64),
    tracks: [&Track; 2],
    end: Point,
) -> Result<Corner, ()> {
    let [before, after] = directions;
    // Positive towards the side of the tool.
    let turn = side * (before[0] * after[1] - before[1] * after[0]).atan2(dot(before, after));
    if turn.abs() < STRAIGHT_ON {
        return Ok(Corner::Straight);
    }
    let back = turn.abs() > PI - STRAIGHT_ON;
    // Where the path turns back, only its bends tell a thin wall, around which the tool rolls, from a slot that ends in a
    // point, as over a round top and straight down beside it: in that one the tool stays where it is as wide as the tool.
    let slot = back
        && tracks
            .map(|track| track.bend(tool_radius_mm))
            .iter()
            .sum::<f64>()
            > ROUNDING;
    if (turn < 0.0 || back) && !slot {
        return Ok(Corner::Round);
    }
    meet(tracks, end).map(Corner::Inside).ok_or(())
}

/// How far back on a track, whose end is `end`, a place lies, mm; ahead of the end is nowhere.
fn way_back(track: &Track, place: Point, end: Point) -> f64 {
    let way = match track {
        Track::Line { direction, .. } => dot([end[0] - place[0], end[1] - place[1]], *direction),
        Track::Circle {
            center,
            radius_mm,
            clockwise,
            ..
        } => {
            let angle = |at: Point| (at[1] - center[1]).atan2(at[0] - center[0]);
            let turned = if *clockwise {
                angle(place) - angle(end)
            } else {
                angle(end) - angle(place)
            };
            // What lies a rounding ahead is no whole turn behind.
            radius_mm * ((turned + ROUNDING).rem_euclid(TAU) - ROUNDING)
        }
    };
    if way < -ROUNDING * 10.0 {
        f64::INFINITY
    } else {
        way
    }
}

/// Half the length of a chord at a distance from the centre of a circle; NaN where the distance is greater than the radius by
/// more than rounding.
fn half_chord(radius_mm: f64, distance: f64) -> f64 {
    let inside = (radius_mm - distance.abs()) / radius_mm;
    if inside.abs() < ROUNDING {
        return 0.0;
    }
    radius_mm * (inside * (1.0 + distance.abs() / radius_mm)).sqrt()
}

/// Where two tracks meet: of two places the one that shortens the first track, which ends at `end`, least.
fn meet(tracks: [&Track; 2], end: Point) -> Option<Point> {
    let places = match tracks {
        [
            Track::Line {
                through: p,
                direction: d,
            },
            Track::Line {
                through: q,
                direction: e,
            },
        ] => {
            let cross = d[0] * e[1] - d[1] * e[0];
            let way = ((q[0] - p[0]) * e[1] - (q[1] - p[1]) * e[0]) / cross;
            let place = along(*p, *d, way);
            [place, place]
        }
        [
            Track::Line { through, direction },
            Track::Circle {
                center, radius_mm, ..
            },
        ]
        | [
            Track::Circle {
                center, radius_mm, ..
            },
            Track::Line { through, direction },
        ] => {
            let foot = along(
                *through,
                *direction,
                dot([center[0] - through[0], center[1] - through[1]], *direction),
            );
            let half = half_chord(*radius_mm, distance(foot, *center));
            [
                along(foot, *direction, half),
                along(foot, *direction, -half),
            ]
        }
        [
            Track::Circle {
                center: c,
                radius_mm: r,
                ..
            },
            Track::Circle {
                center: e,
                radius_mm: s,
                ..
            },
        ] => {
            let between = distance(*c, *e);
            let way = (between * between + r * r - s * s) / (2.0 * between);
            let half = half_chord(*r, way);
            let towards = unit(*c, *e);
            let foot = along(*c, towards, way);
            [
                along(foot, beside(towards, 1.0), half),
                along(foot, beside(towards, 1.0), -half),
            ]
        }
    };
    let finite = places
        .into_iter()
        .filter(|place| place.iter().all(|value| value.is_finite()));
    finite.min_by(|a, b| way_back(tracks[0], *a, end).total_cmp(&way_back(tracks[0], *b, end)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(through: Point, direction: Point) -> Track {
        Track::Line { through, direction }
    }

    #[test]
    fn corners_are_told_apart_by_the_side_of_the_tool() {
        // Along X to the origin, then up, the tool left by 1 (inside) or right by 1 (outside).
        let directions = [[1.0, 0.0], [0.0, 1.0]];
        let tracks = [
            line([0.0, 1.0], directions[0]),
            line([-1.0, 0.0], directions[1]),
        ];
        assert_eq!(
            join(directions, (1.0, 1.0), [&tracks[0], &tracks[1]], [0.0, 1.0]),
            Ok(Corner::Inside([-1.0, 1.0]))
        );
        assert_eq!(
            join(
                directions,
                (-1.0, 1.0),
                [&tracks[0], &tracks[1]],
                [0.0, -1.0]
            ),
            Ok(Corner::Round)
        );
        let on = [directions[0], [1.0, 0.01]];
        assert_eq!(
            join(on, (1.0, 1.0), [&tracks[0], &tracks[1]], [0.0, 1.0]),
            Ok(Corner::Straight)
        );
    }

    #[test]
    fn where_the_path_turns_back_its_bends_tell_a_slot_from_a_wall() {
        // Up along a track with the tool on its left, and down along another.
        let directions = [[0.0, 1.0], [0.0, -1.0]];
        let arc = |radius_mm: f64, outside: bool, x: f64| Track::Circle {
            center: [x, 0.0],
            radius_mm,
            outside,
            clockwise: outside,
        };
        let wall = line([-1.0, 0.0], directions[0]);
        let back = line([1.0, 0.0], directions[1]);
        let join = |first: Track, second: Track| {
            join(directions, (1.0, 1.0), [&first, &second], [-1.0, 0.0])
        };
        assert_eq!(join(wall, back), Ok(Corner::Round));
        assert_eq!(join(wall, arc(9.0, false, 10.0)), Ok(Corner::Round));
        assert!(matches!(
            join(wall, arc(11.0, true, -10.0)),
            Ok(Corner::Inside(_))
        ));
        // Beside a round top of radius 10 and in a round of radius 20: between the two the tool stops.
        let top = arc(11.0, true, 10.0);
        assert!(matches!(
            join(top, arc(19.0, false, 20.0)),
            Ok(Corner::Inside(_))
        ));
        assert_eq!(join(top, arc(4.0, false, 5.0)), Ok(Corner::Round));
        // Back on the same circle there is no slot, and in a slightly larger one no room.
        assert_eq!(join(top, arc(9.0, false, 10.0)), Ok(Corner::Round));
        assert_eq!(join(top, arc(9.5, false, 10.5)), Err(()));
    }

    #[test]
    fn a_line_may_touch_a_circle() {
        let circle = Track::Circle {
            center: [0.0, 0.0],
            radius_mm: 5.0,
            outside: true,
            clockwise: true,
        };
        let touching = line([-3.0, 5.0 + 1e-12], [1.0, 0.0]);
        let place = meet([&touching, &circle], [3.0, 5.0]).unwrap();
        assert!(distance(place, [0.0, 5.0]) < 1e-6, "{place:?}");
    }

    #[test]
    fn tracks_meet_where_the_first_is_shortened_least_or_not_at_all() {
        let circle = |x, radius_mm| Track::Circle {
            center: [x, 0.0],
            radius_mm,
            outside: true,
            clockwise: true,
        };
        let across = line([-9.0, 3.0], [1.0, 0.0]);
        assert_eq!(
            meet([&across, &circle(0.0, 5.0)], [-3.0, 3.0]),
            Some([-4.0, 3.0])
        );
        assert_eq!(meet([&across, &circle(0.0, 2.0)], [-5.0, 3.0]), None);
        // Two round tops side by side: the clockwise one comes from above.
        assert_eq!(
            meet([&circle(0.0, 5.0), &circle(6.0, 5.0)], [5.0, 0.0]),
            Some([3.0, 4.0])
        );
    }
}
