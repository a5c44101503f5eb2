//! G and M codes.

use super::{
    line::Line,
    state::{AxisWords, FeedMode, Motion, State},
};

/// What the codes of one line say about that line alone.
pub struct LineCodes {
    pub axis_words: AxisWords,
    /// The motion of this line only: G31.
    pub once: Option<Motion>,
    /// G53
    pub machine_coordinates: bool,
    /// M2 or M30
    pub ends: bool,
}

/// M codes that move nothing.
const QUIET_M_CODES: [i32; 13] = [0, 1, 3, 4, 5, 6, 7, 8, 9, 48, 49, 60, 61];

impl State<'_> {
    /// Puts the codes of a line in force.
    pub fn modal_codes(&mut self, line: &mut Line) -> Result<LineCodes, String> {
        let mut codes = LineCodes {
            axis_words: AxisWords::Motion,
            once: None,
            machine_coordinates: false,
            ends: false,
        };
        // Units first: they hold for every other word of the line.
        for &code in line.g.iter().filter(|&&code| code == 200 || code == 210) {
            self.unit_mm = if code == 200 { 25.4 } else { 1.0 };
        }
        if line
            .g
            .iter()
            .filter(|&&code| matches!(code, 0..=30 | 310 | 382..=385))
            .count()
            > 1
        {
            return Err("two motion words".into());
        }
        for code in std::mem::take(&mut line.g) {
            if !self.geometry_code(code)
                && !self.path_code(code, line)?
                && !line_code(code, &mut codes)?
            {
                return Err(format!("unknown word G{}", f64::from(code) / 10.0));
            }
        }
        codes.ends = machine_codes(line)?;
        Ok(codes)
    }

    /// Codes that say what later axis words mean.
    fn geometry_code(&mut self, code: i32) -> bool {
        match code {
            0 => self.motion = Some(Motion::Rapid),
            10 => self.motion = Some(Motion::Feed),
            20 | 30 => {
                self.motion = Some(Motion::Arc {
                    clockwise: code == 20,
                });
            }
            382..=385 => self.motion = Some(Motion::Probe),
            800 => self.motion = None,
            170 => self.plane = [0, 1, 2],
            180 => self.plane = [2, 0, 1],
            190 => self.plane = [1, 2, 0],
            540..=590 if code % 10 == 0 => self.work_system = (code / 10 - 54) as usize,
            591..=593 => self.work_system = (code - 585) as usize,
            900 | 910 => self.incremental = code == 910,
            901 | 911 => self.absolute_centers = code == 901,
            921 => self.shift = <_>::default(),
            200 | 210 | 400 | 490 => {}
            _ => return false,
        }
        true
    }

    /// Codes that say how the path is travelled.
    fn path_code(&mut self, code: i32, line: &mut Line) -> Result<bool, String> {
        match code {
            // The tolerance of an earlier G64 is no longer in force.
            610 | 611 => (self.exact_stop, self.tolerance_mm) = (true, None),
            640 => {
                self.exact_stop = false;
                // P0 asks for no tolerance of its own.
                self.tolerance_mm = line
                    .take('P')
                    .filter(|&tolerance| tolerance > 0.0)
                    .map(|mm| mm * self.unit_mm);
                // Q joins collinear lines, which changes nothing of the path.
                line.take('Q');
            }
            930 => self.set_feed_mode(FeedMode::InverseTime),
            940 => self.set_feed_mode(FeedMode::PerMinute),
            40 => _ = line.take('P').ok_or("G4 without P")?,
            _ => return Ok(false),
        }
        Ok(true)
    }

    fn set_feed_mode(&mut self, mode: FeedMode) {
        if self.feed_mode != mode {
            self.feed = None;
        }
        self.feed_mode = mode;
    }
}

/// Codes that hold for their line only.
fn line_code(code: i32, codes: &mut LineCodes) -> Result<bool, String> {
    let axis_words = match code {
        100 => AxisWords::WorkOffset,
        920 => AxisWords::Shift,
        530 => {
            codes.machine_coordinates = true;
            return Ok(true);
        }
        310 => {
            codes.once = Some(Motion::Probe);
            return Ok(true);
        }
        _ => return Ok(false),
    };
    if codes.axis_words != AxisWords::Motion {
        return Err("axis words with two meanings".into());
    }
    codes.axis_words = axis_words;
    Ok(true)
}

/// Whether the M codes of a line end the program.
fn machine_codes(line: &mut Line) -> Result<bool, String> {
    let mut ends = false;
    for code in std::mem::take(&mut line.m) {
        match code {
            2 | 30 => ends = true,
            62..=68 => {
                for letter in ['P', 'Q', 'E', 'L'] {
                    line.take(letter);
                }
            }
            _ if QUIET_M_CODES.contains(&code) => {}
            _ => return Err(format!("unknown word M{code}")),
        }
    }
    Ok(ends)
}
