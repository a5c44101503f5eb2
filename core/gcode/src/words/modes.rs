//! Units, feed, plane, distance modes, path control, and the time constant: how later words are read.

use std::f64::consts::PI;

use super::orders::Orders;
use super::refused::TURNING;
use super::{Action, Group, Word, nothing};
use crate::config::Config;
use crate::line::Line;
use crate::line_error::{Checked, LineError, show};
use crate::state::letters::{Letters, mask};
use crate::syntax::line_words::LineWords;

pub(super) const WORDS: &[Word] = &[
    Word::new(
        "G20",
        Group::Units,
        "",
        "inches",
        Action::Act(inches),
        "G20",
    ),
    Word::new(
        "G21",
        Group::Units,
        "",
        "millimetres",
        Action::Act(millimetres),
        "G21",
    ),
    Word::new(
        "G70",
        Group::Units,
        "",
        "inches, as G20 (with P or Q it is the finishing of a turned profile, and refused)",
        Action::Act(inches),
        "G70",
    ),
    Word::new(
        "G71",
        Group::Units,
        "",
        "millimetres, as G21 (with P or Q it is the roughing of a turned profile, and refused)",
        Action::Act(millimetres),
        "G71",
    ),
    Word::new(
        "G93",
        Group::FeedMode,
        "",
        "inverse time: a line takes 1/F minutes",
        Action::Act(inverse_time),
        "G93",
    ),
    Word::new(
        "G94",
        Group::FeedMode,
        "",
        "feed a minute; F is forgotten",
        Action::Act(feed_per_minute),
        "G94",
    ),
    Word::new(
        "G95",
        Group::FeedMode,
        "$",
        "feed a revolution of the spindle; F is forgotten",
        Action::Act(feed_per_revolution),
        "G95 F0.1",
    ),
    Word::new(
        "G17",
        Group::Plane,
        "",
        "arcs in the plane XY",
        Action::Act(plane_xy),
        "G17",
    ),
    Word::new(
        "G18",
        Group::Plane,
        "",
        "arcs in the plane ZX",
        Action::Act(plane_zx),
        "G18",
    ),
    Word::new(
        "G19",
        Group::Plane,
        "",
        "arcs in the plane YZ",
        Action::Act(plane_yz),
        "G19",
    ),
    Word::new(
        "G90",
        Group::Distance,
        "",
        "absolute coordinates",
        Action::Act(absolute),
        "G90",
    ),
    Word::new(
        "G91",
        Group::Distance,
        "",
        "incremental coordinates",
        Action::Act(incremental),
        "G91",
    ),
    Word::new(
        "G90.1",
        Group::ArcDistance,
        "",
        "I J K absolute",
        Action::Act(arc_absolute),
        "G90.1",
    ),
    Word::new(
        "G91.1",
        Group::ArcDistance,
        "",
        "I J K from the start of the arc",
        Action::Act(arc_incremental),
        "G91.1",
    ),
    Word::new(
        "G61",
        Group::PathControl,
        "",
        "exact path: rest at the end of each block",
        Action::Act(exact_stop),
        "G61",
    ),
    Word::new(
        "G61.1",
        Group::PathControl,
        "",
        "exact stop",
        Action::Act(exact_stop),
        "G61.1",
    ),
    Word::new(
        "G64",
        Group::PathControl,
        "PQ",
        "continuous path within P; Q is accepted and has no effect",
        Action::Act(continuous),
        "G64 P0.05",
    ),
    Word::new(
        "G15",
        Group::Polar,
        "",
        "polar coordinates off (nothing to do)",
        Action::Act(nothing),
        "G15",
    ),
    Word::new(
        "G50",
        Group::Scaling,
        "",
        "scaling off (nothing to do)",
        Action::Act(nothing),
        "G50",
    ),
    Word::new(
        "G69",
        Group::Rotation,
        "",
        "rotation off (nothing to do)",
        Action::Act(nothing),
        "G69",
    ),
];

/// Millimetres an inch.
const INCH_MM: f64 = 25.4;

/// The plane of arcs, by the letters of its two axes in the order that makes counter-clockwise positive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Plane {
    Xy,
    Zx,
    Yz,
}

impl Plane {
    pub fn letters(self) -> [u8; 2] {
        match self {
            Self::Xy => *b"XY",
            Self::Zx => *b"ZX",
            Self::Yz => *b"YZ",
        }
    }

    /// The word that selects it.
    pub fn code(self) -> &'static str {
        match self {
            Self::Xy => "G17",
            Self::Zx => "G18",
            Self::Yz => "G19",
        }
    }
}

/// What F means.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum FeedMode {
    /// G94.
    #[default]
    PerMinute,
    /// G93: the inverse of the line's duration.
    InverseTime,
    /// G95.
    PerRevolution,
}

impl FeedMode {
    /// The word that selects it.
    pub fn code(self) -> &'static str {
        match self {
            Self::PerMinute => "G94",
            Self::InverseTime => "G93",
            Self::PerRevolution => "G95",
        }
    }
}

/// The feed: F is kept in both units, because an axis that turns reads it in degrees.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Feed {
    pub mode: FeedMode,
    /// G95.
    pub mm_per_revolution: f64,
    pub linear_mm_per_s: f64,
    pub rotary_rad_per_s: f64,
}

/// The modes.
#[derive(Clone, Debug, PartialEq)]
#[allow(
    clippy::struct_excessive_bools,
    reason = "modes that are independent of each other in the language"
)]
pub(crate) struct Modes {
    pub plane: Plane,
    /// Millimetres a program unit of length.
    pub unit_mm: f64,
    /// G7: X words are diameters.
    pub diameter: bool,
    pub absolute: bool,
    pub arc_absolute: bool,
    pub feed: Feed,
    pub exact_stop: bool,
    /// P of G64, mm; NaN for the machine's tolerance.
    pub tolerance_mm: f64,
    /// TA, s; NaN for the machine's time constant.
    pub time_constant_s: f64,
}

impl Default for Modes {
    fn default() -> Self {
        Self {
            plane: Plane::Xy,
            unit_mm: 1.0,
            diameter: false,
            absolute: true,
            arc_absolute: false,
            feed: Feed::default(),
            exact_stop: false,
            tolerance_mm: f64::NAN,
            time_constant_s: f64::NAN,
        }
    }
}

impl Modes {
    /// Whether these are the same; what the machine decides is a number that is none, and the same as itself.
    pub fn is_as(&self, other: &Self) -> bool {
        let bits = |modes: &Self| {
            [
                modes.tolerance_mm.to_bits(),
                modes.time_constant_s.to_bits(),
            ]
        };
        let rest = Self {
            tolerance_mm: 0.0,
            time_constant_s: 0.0,
            ..self.clone()
        };
        bits(self) == bits(other)
            && rest
                == Self {
                    tolerance_mm: 0.0,
                    time_constant_s: 0.0,
                    ..other.clone()
                }
    }

    /// Inner units (mm, rad) a program unit (mm or inch, degree) of `axis`.
    #[inline]
    pub fn scale(&self, letters: &Letters, axis: usize) -> f64 {
        if letters.is_rotary(axis) {
            PI / 180.0
        } else {
            self.unit_mm
        }
    }

    /// The same for an axis word: X may be a diameter.
    #[inline]
    pub fn word_scale(&self, letters: &Letters, axis: usize) -> f64 {
        let scale = self.scale(letters, axis);
        if self.diameter && letters.letter(axis) == b'X' {
            0.5 * scale
        } else {
            scale
        }
    }

    /// Each word of the feed mode forgets F, as in LinuxCNC, also where the mode stays.
    fn set_feed_mode(&mut self, mode: FeedMode) {
        self.feed = Feed {
            mode,
            ..Feed::default()
        };
    }

    /// Some feed where there is none, so that no later line is blamed for one that could not be read.
    pub fn suppose_feed(&mut self) {
        if self.feed
            == (Feed {
                mode: self.feed.mode,
                ..Feed::default()
            })
        {
            self.set_feed(60.0);
        }
    }

    /// F. With G93 it holds for its line only, which reads it itself.
    #[inline]
    fn set_feed(&mut self, feed: f64) {
        match self.feed.mode {
            FeedMode::PerMinute => {
                self.feed.linear_mm_per_s = feed * self.unit_mm / 60.0;
                self.feed.rotary_rad_per_s = feed * PI / 180.0 / 60.0;
            }
            FeedMode::InverseTime => {}
            FeedMode::PerRevolution => self.feed.mm_per_revolution = feed * self.unit_mm,
        }
    }
}

/// G70 and G71 alone are DIN 66025's words for units; on lathes they are cycles, which have one of these letters.
#[cold]
pub(super) fn turning_cycle(orders: &Orders, words: &LineWords) -> Option<LineError> {
    let word = orders.get(Group::Units)?;
    let (letter, _) = words.first_of(mask("DEIKPQR"))?;
    matches!(word.code, "G70" | "G71").then(|| {
        let message = format!("{} with {}: {TURNING}", word.code, letter as char);
        orders.error(Group::Units, "refused", message)
    })
}

fn inches(line: &mut Line) -> Checked<()> {
    line.state.modes.unit_mm = INCH_MM;
    Ok(())
}

fn millimetres(line: &mut Line) -> Checked<()> {
    line.state.modes.unit_mm = 1.0;
    Ok(())
}

fn inverse_time(line: &mut Line) -> Checked<()> {
    line.state.modes.set_feed_mode(FeedMode::InverseTime);
    Ok(())
}

fn feed_per_minute(line: &mut Line) -> Checked<()> {
    line.state.modes.set_feed_mode(FeedMode::PerMinute);
    Ok(())
}

fn feed_per_revolution(line: &mut Line) -> Checked<()> {
    line.state.modes.set_feed_mode(FeedMode::PerRevolution);
    Ok(())
}

fn plane_xy(line: &mut Line) -> Checked<()> {
    line.state.modes.plane = Plane::Xy;
    Ok(())
}

fn plane_zx(line: &mut Line) -> Checked<()> {
    line.state.modes.plane = Plane::Zx;
    Ok(())
}

fn plane_yz(line: &mut Line) -> Checked<()> {
    line.state.modes.plane = Plane::Yz;
    Ok(())
}

fn absolute(line: &mut Line) -> Checked<()> {
    line.state.modes.absolute = true;
    Ok(())
}

fn incremental(line: &mut Line) -> Checked<()> {
    line.state.modes.absolute = false;
    Ok(())
}

fn arc_absolute(line: &mut Line) -> Checked<()> {
    line.state.modes.arc_absolute = true;
    Ok(())
}

fn arc_incremental(line: &mut Line) -> Checked<()> {
    line.state.modes.arc_absolute = false;
    Ok(())
}

fn exact_stop(line: &mut Line) -> Checked<()> {
    line.state.modes.exact_stop = true;
    line.state.modes.tolerance_mm = f64::NAN;
    Ok(())
}

/// P0 is as good as no P: the machine's tolerance. Q, LinuxCNC's tolerance for joining collinear lines, has no effect:
/// planners join what is collinear themselves.
fn continuous(line: &mut Line) -> Checked<()> {
    line.words.not_negative(b'Q')?;
    line.state.modes.exact_stop = false;
    line.state.modes.tolerance_mm = match line.words.not_negative(b'P')? {
        Some(tolerance) if tolerance > 0.0 => tolerance * line.state.modes.unit_mm,
        _ => f64::NAN,
    };
    Ok(())
}

/// The word F.
#[inline]
pub(crate) fn feed(line: &mut Line) -> Checked<()> {
    if let Some(feed) = line.words.not_negative(b'F')? {
        line.state.modes.set_feed(feed);
    }
    Ok(())
}

/// The word TA, in ms.
#[inline]
pub(crate) fn time_constant(line: &mut Line) -> Checked<()> {
    if let Some((value_ms, span)) = line.words.time_constant {
        let why = refuse_time_constant(value_ms, line.config);
        why.map_or(Ok(()), |message| {
            Err(LineError::new(span, "time-constant", message))
        })?;
        line.state.modes.time_constant_s = value_ms / 1000.0;
    }
    Ok(())
}

fn refuse_time_constant(value_ms: f64, config: &Config) -> Option<String> {
    if value_ms <= 0.0 || !value_ms.is_finite() {
        return Some("TA (time constant, ms) must be greater than zero".into());
    }
    let (min_s, max_s) = config.time_constant_s;
    // The limits are in ms in the machine file too; a nanosecond is the rounding on the way.
    let beyond = value_ms < min_s * 1e3 - 1e-6 || value_ms > max_s * 1e3 + 1e-6;
    let [min, max, asked] = [min_s * 1e3, max_s * 1e3, value_ms].map(show);
    beyond.then(|| {
        format!("TA {asked} is beyond the time constants of this machine, {min} to {max} ms")
    })
}

#[cfg(test)]
mod tests {
    use crate::testing::{blocks, last, messages, short};

    #[test]
    fn the_time_constant_goes_with_its_block_and_the_following() {
        let all = blocks("F600\nG1 X1\nTA 20 X2\nX3\nTA[2*5]\nG4 P0\nTA7.5\nX4");
        let shown: Vec<_> = all
            .iter()
            .map(|b| short(b.time_constant_s * 1000.0))
            .collect();
        assert_eq!(shown, ["NaN", "20", "20", "10", "7.5"]);
    }

    #[test]
    fn path_control_is_attached() {
        let all = blocks(
            "F600\nG1 X1\nG64 P0.05 Q1\nX2\nG61\nX3\nG64\nX4\nG61.1\nX5\nG20 G64 P0.001\nX0.2",
        );
        let modes: Vec<_> = all
            .iter()
            .map(|b| {
                (
                    b.path_mode == tandem_sdk::PathMode::ExactStop,
                    short(b.path_tolerance_mm),
                )
            })
            .collect();
        let expected = [
            (false, "NaN"),
            (false, "0.05"),
            (true, "NaN"),
            (false, "NaN"),
            (true, "NaN"),
            (false, "0.025"),
        ];
        assert!(last("G64 P0 G0 X1").path_tolerance_mm.is_nan());
        assert_eq!(
            modes,
            expected.map(|(exact, tolerance)| (exact, tolerance.to_owned()))
        );
    }

    #[test]
    fn units_in_the_words_of_din_66025() {
        assert_eq!(short(last("G70\nG0 X1").end[0]), "25.4");
        assert_eq!(short(last("G20\nG71\nG0 X1").end[0]), "1");
        for wrong in ["G71 Q100", "G70 P10 Q20 U1", "G71 U2 R1", "G20 G71"] {
            assert_eq!(messages(wrong).len(), 1, "{wrong}");
        }
    }

    #[test]
    fn units_and_distance_modes() {
        let block = last("G20 G91 G1 X1 A90 F10\nX1");
        assert_eq!(
            (short(block.end[0]), short(block.end[3])),
            ("50.8".into(), "1.571".into())
        );
        assert_eq!(short(block.feed_mm_per_s), "4.233");
        let turning = last("F360 G1 A180");
        assert_eq!(
            (short(turning.length_mm), short(turning.feed_mm_per_s)),
            ("3.142".into(), "0.105".into())
        );
        let both = last("F600 G1 A90 X3 Y4");
        assert_eq!((both.length_mm, both.feed_mm_per_s), (5.0, 10.0));
    }

    #[test]
    fn inverse_time_gives_the_duration() {
        for program in [
            "G93 G1 X10 F30",
            "G93 G1 A90 F30",
            "G93 G2 X10 I5 F30",
            "G93 G3 I5 Z3 A720 F30",
        ] {
            let block = last(program);
            assert!(
                (block.length_mm / block.feed_mm_per_s - 2.0).abs() < 1e-12,
                "{program}"
            );
        }
    }
}
