//! M3, M4, M5, M19, G96, G97 and S: the spindle. There is one, so that `$0` says nothing new.

use std::f64::consts::PI;

use tandem_sdk::{AxisVector, EventKind};

use super::{Action, Group, Word};
use crate::line::Line;
use crate::line_error::Checked;

pub(super) const WORDS: &[Word] = &[
    Word::new(
        "M3",
        Group::Spindle,
        "$",
        "spindle clockwise",
        Action::Act(|line| turn(line, 1)),
        "S100 M3",
    ),
    Word::new(
        "M4",
        Group::Spindle,
        "$",
        "spindle counter-clockwise",
        Action::Act(|line| turn(line, -1)),
        "S100 M4",
    ),
    Word::new(
        "M5",
        Group::Spindle,
        "$",
        "spindle stop",
        Action::Act(|line| turn(line, 0)),
        "M5",
    ),
    Word::new(
        "M19",
        Group::Spindle,
        "RQP$",
        "stop the spindle at the angle R in degrees; P the way round (0 the shorter), Q seconds at most",
        Action::Act(orient),
        "M19 R90",
    ),
    Word::new(
        "G96",
        Group::SpindleMode,
        "D$",
        "S is the speed of the surface at X, in m/min (G21) or ft/min (G20); D rpm at most",
        Action::Act(surface_speed),
        "G96 D2000 S100",
    ),
    Word::new(
        "G97",
        Group::SpindleMode,
        "$",
        "S is in revolutions a minute",
        Action::Act(revolutions),
        "G97 S100",
    ),
];

/// Speed and direction of the spindle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Spindle {
    /// 1 clockwise, −1 counter-clockwise, 0 stopped.
    pub direction: i8,
    pub speed_rad_per_s: f64,
    /// G96.
    pub surface: Option<Surface>,
}

/// Constant speed of the surface that is turned (G96).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Surface {
    /// Speed of the surface.
    pub mm_per_s: f64,
    /// The spindle turns no faster: D.
    pub max_rad_per_s: f64,
}

impl Spindle {
    /// The speed commanded, positive clockwise.
    pub fn command_rad_per_s(self) -> f64 {
        match self.direction {
            0 => 0.0,
            direction => f64::from(direction) * self.speed_rad_per_s,
        }
    }

    /// Up to this radius the spindle turns as fast as it may; 0 where nothing limits it.
    pub fn radius_at_most_mm(self) -> f64 {
        self.surface
            .map_or(0.0, |surface| surface.mm_per_s / surface.max_rad_per_s)
    }

    /// The spindle as G96 asks for at a radius.
    fn at_radius(self, radius_mm: f64) -> Self {
        let Some(surface) = self.surface else {
            return self;
        };
        let speed_rad_per_s = (surface.mm_per_s / radius_mm).min(surface.max_rad_per_s);
        // In the centre no speed is the right one, if nothing limits it.
        if speed_rad_per_s.is_finite() {
            Self {
                speed_rad_per_s,
                ..self
            }
        } else {
            self
        }
    }

    /// Reads a new S, which stands in a program with units of `unit_mm`.
    fn set_speed(&mut self, s: f64, unit_mm: f64) {
        match &mut self.surface {
            None => self.speed_rad_per_s = s * PI / 30.0,
            // Metres, or feet of 12 inches, a minute.
            Some(surface) => {
                surface.mm_per_s = s * if unit_mm == 1.0 {
                    1000.0
                } else {
                    12.0 * unit_mm
                } / 60.0;
            }
        }
    }
}

/// G96. Without D only the machine limits the speed, as in LinuxCNC.
fn surface_speed(line: &mut Line) -> Checked<()> {
    if line
        .letters
        .axis(b'X')
        .is_none_or(|axis| line.letters.is_rotary(axis))
    {
        return Err(line.orders.error(
            Group::SpindleMode,
            "axis",
            "G96 needs the linear axis X, the radius",
        ));
    }
    if !line.words.has(b'S') {
        return Err(line.orders.error(
            Group::SpindleMode,
            "word-missing",
            "G96 needs S, the speed of the surface",
        ));
    }
    let max_rad_per_s = line
        .words
        .not_negative(b'D')?
        .map_or(f64::INFINITY, |rpm| rpm * PI / 30.0);
    // S itself is read next.
    line.state.spindle.surface = Some(Surface {
        mm_per_s: 0.0,
        max_rad_per_s,
    });
    Ok(())
}

/// G97.
fn revolutions(line: &mut Line) -> Checked<()> {
    line.state.spindle.surface = None;
    Ok(())
}

/// The radius at `position`, machine coordinates: the distance of X from its zero, in the system in force.
pub(super) fn radius_mm(line: &Line, position: &AxisVector) -> f64 {
    line.letters.axis(b'X').map_or(0.0, |x| {
        line.state.coordinates.to_program(position)[x].abs()
    })
}

/// The spindle turns as G96 asks at a radius.
pub(super) fn follow_radius(line: &mut Line, radius_mm: f64) {
    let spindle = line.state.spindle.at_radius(radius_mm);
    set(line, spindle);
}

/// M19: rest, and the spindle is turned to an angle and held there.
fn orient(line: &mut Line) -> Checked<()> {
    let missing = |message: &str| line.orders.error(Group::Spindle, "word-missing", message);
    let degrees = line
        .words
        .get(b'R')
        .ok_or_else(|| missing("M19 needs R, the angle in degrees"))?;
    if !(0.0..360.0).contains(&degrees) {
        return Err(line.words.error(
            b'R',
            "word-range",
            "R, the angle of the spindle, is 0 to less than 360 degrees",
        ));
    }
    line.words.integer(b'P', 0..=2)?;
    line.words.not_negative(b'Q')?;
    if !line.config.orients_spindle {
        let message =
            "M19 (oriented spindle stop): no driver of this machine turns the spindle to an angle";
        return Err(line.orders.error(Group::Spindle, "refused", message));
    }
    turn(line, 0)?;
    line.rest();
    line.event(EventKind::OrientSpindle, 0, degrees.to_radians());
    Ok(())
}

/// The word S in a line without M3, M4 and M5.
pub(crate) fn speed(line: &mut Line) -> Checked<()> {
    turn(line, line.state.spindle.direction)
}

/// A change of direction needs rest, a change of speed does not.
pub(super) fn turn(line: &mut Line, direction: i8) -> Checked<()> {
    let mut spindle = Spindle {
        direction,
        ..line.state.spindle
    };
    if let Some(speed) = line.words.not_negative(b'S')? {
        spindle.set_speed(speed, line.state.modes.unit_mm);
    }
    if spindle.surface.is_some() {
        spindle = spindle.at_radius(radius_mm(line, &line.state.path.position));
    }
    set(line, spindle);
    Ok(())
}

/// The spindle is to turn so.
pub(super) fn set(line: &mut Line, spindle: Spindle) {
    let before = line.state.spindle;
    let turns = spindle.direction != before.direction;
    if turns {
        line.rest();
    }
    line.state.spindle = spindle;
    if turns || spindle.command_rad_per_s() != before.command_rad_per_s() {
        line.event(EventKind::Spindle, 0, spindle.command_rad_per_s());
    }
}

/// Stops the spindle where it turns.
pub(crate) fn stop(line: &mut Line) {
    if line.state.spindle.direction != 0 {
        line.rest();
        line.state.spindle.direction = 0;
        line.event(EventKind::Spindle, 0, 0.0);
    }
}

#[cfg(test)]
mod tests {
    use crate::testing::{assert_items, messages, mill, run_on};

    #[test]
    fn a_change_of_direction_rests_and_a_change_of_speed_does_not() {
        assert_items(
            "F60 G1 X1 S60\nM3\nX2\nX3 S30\nM4 X4\nM5",
            &[
                "1: Line 0 to 1 0 0 0 length 1 feed 1",
                "2: Dwell 1 to 1 0 0 0 for 0",
                "2: Spindle 0 6.283 before 2",
                "3: Line 2 to 2 0 0 0 length 1 feed 1",
                "4: Spindle 0 3.142 before 3",
                "4: Line 3 to 3 0 0 0 length 1 feed 1",
                "5: Dwell 4 to 3 0 0 0 for 0",
                "5: Spindle 0 -3.142 before 5",
                "5: Line 5 to 4 0 0 0 length 1 feed 1",
                "6: Dwell 6 to 4 0 0 0 for 0",
                "6: Spindle 0 0 before 7",
                "End",
            ],
        );
    }

    #[test]
    fn a_dollar_names_the_one_spindle() {
        assert_items(
            "M3 $0 S60\nG97 S30 $#31 M3\nS60 $0\nM5 $-1",
            &[
                "1: Spindle 0 6.283 before 0",
                "2: Spindle 0 3.142 before 0",
                "3: Spindle 0 6.283 before 0",
                "4: Spindle 0 0 before 0",
                "End",
            ],
        );
        for (wrong, code) in [
            ("M3 $1 S60", "word-range"),
            ("M3 $0 $0", "word-twice"),
            ("M3 $", "value-missing"),
            ("F1 $0", "unused-word"),
            ("$0", "unused-word"),
            ("G0 X1 $0", "unused-word"),
            ("$H", "unexpected"),
        ] {
            let found = run_on(mill(), wrong).1;
            let codes: Vec<_> = found.iter().map(|message| message.code).collect();
            assert_eq!(codes, [code], "{wrong}");
        }
    }

    #[test]
    fn the_spindle_is_turned_to_an_angle_at_rest() {
        assert_items(
            "F60 G1 X1 S60\nM3\nM19 R180 P1 Q5",
            &[
                "1: Line 0 to 1 0 0 0 length 1 feed 1",
                "2: Dwell 1 to 1 0 0 0 for 0",
                "2: Spindle 0 6.283 before 2",
                "3: Spindle 0 0 before 2",
                "3: OrientSpindle 0 3.142 before 2",
                "End",
            ],
        );
        assert!(
            messages("F60 G2 X2 I1\nM19 R90").is_empty(),
            "R is not the arc's"
        );
        for wrong in ["M19", "M19 R360", "M19 R1 P3"] {
            assert_eq!(messages(wrong).len(), 1, "{wrong}");
        }
        let config = crate::Config {
            orients_spindle: false,
            ..mill()
        };
        assert_eq!(run_on(config, "M19 R1").1[0].code, "refused");
    }
}
