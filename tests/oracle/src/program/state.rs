//! What a program line leaves in force for the next ones.

use super::{
    curve::{self, Open},
    line::Line,
};
use crate::{
    LETTERS, Machine, Position, Row,
    path::{Element, Path},
};

/// What an axis word means when it stands alone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Motion {
    Rapid,
    Feed,
    /// G31 and G38.2 to G38.5: a straight line that may end early.
    Probe,
    /// G2 or G3: clockwise or not.
    Arc {
        clockwise: bool,
    },
}

/// What F means.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FeedMode {
    /// G94: units a minute.
    PerMinute,
    /// G93: one over the minutes that the block lasts.
    InverseTime,
}

/// What axis words of the line at hand are for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AxisWords {
    Motion,
    /// G10 L2 and L20
    WorkOffset,
    /// G92
    Shift,
}

pub struct State<'a> {
    pub machine: &'a Machine,
    /// The trace, for what no program says: where probes came to rest.
    pub rows: &'a [Row],
    /// Machine coordinates, mm and deg.
    pub position: Position,
    pub motion: Option<Motion>,
    /// First and second axis of the arc plane, and the one square to it.
    pub plane: [usize; 3],
    /// mm a unit of length.
    pub unit_mm: f64,
    pub incremental: bool,
    pub absolute_centers: bool,
    pub feed_mode: FeedMode,
    /// F as programmed, with the unit of then in mm.
    pub feed: Option<(f64, f64)>,
    pub work_offsets: [Position; 9],
    pub work_system: usize,
    /// What G92 adds.
    pub shift: Position,
    pub exact_stop: bool,
    pub tolerance_mm: Option<f64>,
    /// The curve whose lines are being read.
    pub curve: Option<Open>,
    pub elements: Vec<Element>,
}

impl<'a> State<'a> {
    pub fn new(machine: &'a Machine, rows: &'a [Row]) -> Self {
        Self {
            machine,
            rows,
            position: machine.start(),
            motion: None,
            plane: [0, 1, 2],
            unit_mm: 1.0,
            incremental: false,
            absolute_centers: false,
            feed_mode: FeedMode::PerMinute,
            feed: None,
            work_offsets: [Position::default(); 9],
            work_system: 0,
            shift: Position::default(),
            exact_stop: false,
            tolerance_mm: None,
            curve: None,
            elements: Vec::new(),
        }
    }

    pub fn into_path(self) -> Result<Path, String> {
        match self.curve {
            Some(_) => Err("a curve that is not complete".into()),
            None => Ok(Path {
                elements: self.elements,
                end: self.position,
            }),
        }
    }

    /// Executes a line and says whether the program ends with it; an error names the word that is not known.
    pub fn execute(&mut self, mut line: Line, number: usize) -> Result<bool, String> {
        if let Some(open) = self.curve.take() {
            return self.curve_line(open, line).map(|()| false);
        }
        let curve = curve::code(&line);
        line.g.retain(|code| Some(*code) != curve);
        let codes = self.modal_codes(&mut line)?;
        self.words(&mut line);
        if let Some(code) = curve {
            self.curve_code(code, &mut line, number)?;
        }
        match codes.axis_words {
            AxisWords::WorkOffset => self.set_work_offset(&mut line)?,
            AxisWords::Shift => self.set_shift(&mut line)?,
            AxisWords::Motion => self.move_axes(&mut line, &codes, number)?,
        }
        match line.left_over() {
            Some(word) => Err(format!("unknown word {word}")),
            None => Ok(codes.ends),
        }
    }

    /// What is added to program coordinates, mm.
    pub fn offset_mm(&self, axis: usize) -> f64 {
        self.work_offsets[self.work_system][axis] + self.shift[axis]
    }

    /// mm or degrees of an axis per unit of the program.
    pub fn scale(&self, axis: usize) -> f64 {
        if self.machine.axis(axis).is_some_and(|axis| axis.rotary) {
            1.0
        } else {
            self.unit_mm
        }
    }

    /// Takes the axis words out of a line: axis and value in mm or degrees.
    pub fn take_axes(&self, line: &mut Line) -> Result<Vec<(usize, f64)>, String> {
        let mut axes = Vec::new();
        for (axis, &letter) in LETTERS.iter().enumerate() {
            if let Some(value) = line.take(letter) {
                self.machine
                    .axis(axis)
                    .ok_or_else(|| format!("the machine has no axis {letter}"))?;
                axes.push((axis, value * self.scale(axis)));
            }
        }
        Ok(axes)
    }

    /// F, S and T.
    fn words(&mut self, line: &mut Line) {
        if let Some(feed) = line.take('F') {
            self.feed = Some((feed, self.unit_mm));
        } else if self.feed_mode == FeedMode::InverseTime {
            // A duration holds for its own line only.
            self.feed = None;
        }
        line.take('S');
        line.take('T');
    }

    fn set_work_offset(&mut self, line: &mut Line) -> Result<(), String> {
        let (Some(table), Some(system)) = (line.take('L'), line.take('P')) else {
            return Err("G10 without L2 or L20 and P".into());
        };
        let here = table == 20.0;
        if !(here || table == 2.0) || system.fract() != 0.0 || !(0.0..=9.0).contains(&system) {
            return Err(format!("G10 L{table} P{system}"));
        }
        if self.incremental && !here {
            return Err("G10 L2 with G91: controls differ in what it means".into());
        }
        let system = if system == 0.0 {
            self.work_system
        } else {
            system as usize - 1
        };
        for (axis, value) in self.take_axes(line)? {
            let origin = if here {
                self.position[axis] - self.shift[axis] - value
            } else {
                value
            };
            self.work_offsets[system][axis] = origin;
        }
        Ok(())
    }

    fn set_shift(&mut self, line: &mut Line) -> Result<(), String> {
        for (axis, value) in self.take_axes(line)? {
            self.shift[axis] =
                self.position[axis] - self.work_offsets[self.work_system][axis] - value;
        }
        Ok(())
    }
}
