//! One line as it is executed: its words take effect in their order, and what they have in common is here.

use std::cell::Cell;
use std::fmt::Write as _;

use tandem_sdk::{AxisVector, Block, BlockKind, Event, EventKind};

use crate::config::Config;
use crate::item::Item;
use crate::line_error::{Checked, LineError, Span, show};
use crate::state::letters::{AXIS_MASK, Letters, mask};
use crate::state::{MotionMode, State};
use crate::syntax::line_words::LineWords;
use crate::words::modes::FeedMode;
use crate::words::orders::Orders;
use crate::words::{Action, Group, Shape, compensation, modes, motion, spindle, tool};

/// Rounding that a travel limit forgives, mm or rad.
const TRAVEL_ROUNDING: f64 = 1e-9;
/// Groups that take effect before F, and those between T and S. The units and the feed mode of a line hold for all its
/// words, unlike in LinuxCNC: `G20 F10` is 10 inches a minute.
const BEFORE_FEED: u32 = Group::Units.bit() | Group::FeedMode.bit() | Group::LatheDiameter.bit();
const BEFORE_SPEED: u32 = Group::ModalState.bit()
    | Group::InputOutput.bit()
    | Group::ToolChange.bit()
    | Group::SpindleMode.bit();
const BEFORE_MOTION: u32 = (Group::Motion.bit() - 1) & !(BEFORE_FEED | BEFORE_SPEED);
/// Modes that later lines are read with.
const MODES: u32 = Group::Plane.bit()
    | Group::Distance.bit()
    | Group::ArcDistance.bit()
    | Group::ToolLength.bit()
    | Group::CoordinateSystem.bit();

/// A line that is being executed: what it says, the state that it changes, and where its items go.
pub(crate) struct Line<'a> {
    pub config: &'a Config,
    pub letters: &'a Letters,
    pub words: &'a LineWords,
    pub orders: &'a Orders,
    pub state: &'a mut State,
    pub out: &'a mut Vec<Item>,
    /// A value of the line follows from what the first pass has assumed.
    pub reads_assumed: &'a Cell<bool>,
}

impl Line<'_> {
    /// Obeys the words in LinuxCNC's order.
    #[inline]
    pub fn execute(&mut self) -> Checked<()> {
        if self.state.compensation.is_on()
            && self
                .orders
                .get(Group::CutterRadius)
                .is_none_or(|word| word.tenths != 400)
        {
            compensation::refuse_incompatible(self)?;
        }
        self.act(BEFORE_FEED)?;
        modes::feed(self)?;
        modes::time_constant(self)?;
        if self.words.has(b'T') {
            tool::select(self)?;
        }
        self.act(BEFORE_SPEED)?;
        if self.words.has(b'S') && !self.orders.has(Group::Spindle) {
            spindle::speed(self)?;
        }
        self.act(BEFORE_MOTION)?;
        self.execute_motion()?;
        self.act(Group::Stop.bit())
    }

    /// Obeys the word whose path the line makes.
    #[inline]
    pub fn execute_motion(&mut self) -> Checked<()> {
        self.set_motion();
        match self.orders.motion {
            Some(MotionMode::Word(word)) => {
                if let Action::Move(_, act) | Action::MoveOnce(_, act) = word.action {
                    act(self)?;
                }
            }
            Some(MotionMode::Refused) => self.advance(),
            Some(MotionMode::None) | None => {}
        }
        Ok(())
    }

    /// Lets the words of `groups` act, one group after the other.
    #[inline]
    fn act(&mut self, groups: u32) -> Checked<()> {
        let mut pending = self.orders.present() & groups;
        while pending != 0 {
            let word = self.orders.word(pending.trailing_zeros() as usize);
            pending &= pending - 1;
            if let Action::Act(act) = word.action {
                act(self)?;
            }
        }
        Ok(())
    }

    #[inline]
    fn set_motion(&mut self) {
        if let Some(word) = self.orders.get(Group::Motion) {
            self.state.cycles.begin(word);
            match word.action {
                Action::Move(..) => self.state.motion = MotionMode::Word(word),
                Action::MoveOnce(..) => {}
                Action::Act(_) | Action::Refuse(_) => self.state.motion = MotionMode::None,
            }
        } else if self.orders.has(Group::CycleCancel) {
            self.state.cycles.end();
            self.state.motion = MotionMode::None;
        }
    }

    /// After an erroneous line: takes over what can be, so that the next lines are judged fairly. `complete` says
    /// whether all words of the line have been read.
    #[cold]
    pub fn recover(&mut self, complete: bool) {
        // Errors of what follows have been reported already, or do not matter now.
        let _ = self
            .act(BEFORE_FEED)
            .and_then(|()| modes::feed(self))
            .and_then(|()| self.act(MODES));
        self.set_motion();
        self.state.compensation.spoil();
        if matches!(self.orders.motion, Some(MotionMode::Refused)) {
            self.state.motion = MotionMode::Refused;
        }
        if !complete {
            // The words that were not read may have set the feed.
            self.state.modes.suppose_feed();
            self.state.path.uncertain |= (1 << self.letters.count()) - 1;
        }
        if self.orders.axes_taken {
            self.state.path.uncertain |= self.letters.axes_of(self.words.named());
        } else if !self.state.path.moved {
            self.advance();
        }
    }

    /// Whether what the line does follows from an assumed answer, so that only the run can judge its numbers.
    #[inline]
    pub fn is_assumed(&self) -> bool {
        let path = &self.state.path;
        if !self.reads_assumed.get() && (path.assumed | path.assumed_start) == 0 {
            return false;
        }
        let named = self.letters.axes_of(self.words.named()) & path.assumed;
        let shape = match self.orders.motion {
            Some(MotionMode::Word(word)) => word.shape(),
            _ => None,
        };
        // Where a straight line ends is its axis words; what is bent and a probe also depend on where they begin.
        let moves = match (shape, self.orders.motion) {
            (Some(Shape::Straight), _) | (_, None) => named != 0,
            _ => (path.assumed_start | path.assumed) != 0,
        };
        self.reads_assumed.get() || path.moved && moves
    }

    /// The axes that the line names, with their values in inner units.
    pub fn named_axes(&self) -> impl Iterator<Item = (usize, f64)> + '_ {
        (0..self.letters.count()).filter_map(|axis| {
            let value = self.words.get(self.letters.letter(axis))?;
            Some((
                axis,
                value * self.state.modes.word_scale(self.letters, axis),
            ))
        })
    }

    /// Whether G53 stands in the line: its axis words are machine coordinates.
    #[inline]
    pub fn in_machine_coordinates(&self) -> bool {
        self.orders
            .get(Group::NonModal)
            .is_some_and(|word| word.tenths == 530)
    }

    /// Takes the axis words into the programmed position.
    #[inline]
    pub fn advance(&mut self) {
        let machine = self.in_machine_coordinates();
        let absolute = machine || self.state.modes.absolute;
        if !machine && (self.state.coordinates.is_rotated() || self.words.polar.is_some()) {
            return self.advance_in_plane(absolute);
        }
        let base = match (machine, absolute) {
            (true, _) => AxisVector::ZERO,
            (_, true) => *self.state.coordinates.total(),
            _ => self.state.path.position,
        };
        let mut moved = 0;
        for (axis, letter) in self.letters.each().iter().enumerate() {
            if let Some(value) = self.words.get(*letter) {
                let value = value * self.state.modes.word_scale(self.letters, axis);
                self.state.path.position[axis] = base[axis] + value;
                moved |= 1 << axis;
            }
        }
        self.assume_target(moved, machine, absolute);
        self.state.path.moved = true;
    }

    /// The same in a rotated coordinate system or in polar coordinates, where one word moves two axes.
    #[cold]
    fn advance_in_plane(&mut self, absolute: bool) {
        let mut program = self.state.coordinates.to_program(&self.state.path.position);
        for (axis, value) in self.named_axes() {
            program[axis] = if absolute {
                value
            } else {
                program[axis] + value
            };
        }
        if let (Some(polar), Some([x, y])) = (self.words.polar, self.state.coordinates.plane()) {
            let unit_mm = self.state.modes.unit_mm;
            let place = polar.place([program[x] / unit_mm, program[y] / unit_mm], absolute);
            [program[x], program[y]] = place.map(|value| value * unit_mm);
        }
        self.state.path.position = self.state.coordinates.to_machine(&program);
        let plane = mask("XY");
        let named = self.words.named();
        let moved = if named & plane == 0 {
            named
        } else {
            named | plane
        };
        if absolute && named & plane == plane {
            self.state.path.uncertain &= !self.letters.axes_of(named);
        }
        let follows = self.reads_assumed.get() || self.state.coordinates.assumed != 0;
        if follows {
            self.state.path.assumed |= self.letters.axes_of(moved);
        }
        self.state.path.moved = true;
    }

    /// Whether the programmed positions of the axes `moved`, bit per axis, now follow from what the first pass has assumed.
    #[inline]
    fn assume_target(&mut self, moved: u32, machine: bool, absolute: bool) {
        let path = &mut self.state.path;
        let base = match (machine, absolute) {
            (true, _) => 0,
            (_, true) => self.state.coordinates.assumed,
            _ => path.assumed,
        };
        let read = if self.reads_assumed.get() { moved } else { 0 };
        path.assumed = path.assumed & !moved | base & moved | read;
        if absolute {
            path.uncertain &= !moved;
        }
    }

    #[inline]
    pub fn moves_linear(&self, displacement: &AxisVector) -> bool {
        (0..self.letters.count())
            .any(|axis| displacement[axis] != 0.0 && !self.letters.is_rotary(axis))
    }

    /// The feed of a path of `length_mm`, mm/s or rad/s.
    #[inline]
    pub fn feed(&self, length_mm: f64, linear: bool) -> Checked<f64> {
        let feed = &self.state.modes.feed;
        if feed.mode == FeedMode::PerRevolution {
            return self.feed_a_revolution();
        }
        if feed.mode == FeedMode::InverseTime {
            return match self.words.get(b'F') {
                Some(inverse) if inverse > 0.0 => Ok(length_mm * inverse / 60.0),
                _ => Err(self.no_inverse_time()),
            };
        }
        let feed = if linear {
            feed.linear_mm_per_s
        } else {
            feed.rotary_rad_per_s
        };
        if feed > 0.0 {
            Ok(feed)
        } else {
            Err(self.no_feed())
        }
    }

    /// G95: the feed at the speed that the spindle is commanded.
    #[cold]
    fn feed_a_revolution(&self) -> Checked<f64> {
        let speed_rad_per_s = self.state.spindle.speed_rad_per_s;
        if speed_rad_per_s <= 0.0 {
            return Err(self.motion_error(
                "feed-missing",
                "G95 is a feed a revolution, and the spindle has no speed (S)",
            ));
        }
        let feed =
            self.state.modes.feed.mm_per_revolution * speed_rad_per_s / std::f64::consts::TAU;
        if feed > 0.0 {
            Ok(feed)
        } else {
            Err(self.no_feed())
        }
    }

    /// The motion word whose path this line makes, where it is no straight line and no arc.
    fn special_motion(&self) -> Option<&'static crate::words::Word> {
        match self.orders.motion {
            Some(MotionMode::Word(word))
                if !matches!(word.shape(), Some(Shape::Straight | Shape::Arc)) =>
            {
                Some(word)
            }
            _ => None,
        }
    }

    #[cold]
    fn no_inverse_time(&self) -> LineError {
        let curve = self
            .special_motion()
            .is_some_and(|word| word.shape() == Some(Shape::Curve));
        let why = if curve {
            "with G93 every curve needs its F, in its first line"
        } else {
            "with G93 every line with G1, G2 or G3 needs its F"
        };
        self.motion_error("feed-missing", why)
    }

    #[cold]
    fn no_feed(&self) -> LineError {
        let why = if self.words.has(b'F') {
            "the feed is zero"
        } else {
            "the feed is missing: no F has been set"
        };
        let who = self
            .special_motion()
            .map_or("G1, G2 and G3 need".into(), |word| {
                format!("{} needs", word.code)
            });
        self.motion_error("feed-missing", format!("{why}; {who} one"))
    }

    /// Appends a block.
    #[inline]
    #[allow(
        clippy::large_types_passed_by_value,
        reason = "built in place: a reference would copy once more"
    )]
    pub fn push(&mut self, block: Block) {
        if self.state.compensation.holds() {
            return self.state.compensation.hold(Item::Block(block, None));
        }
        self.state.path.advance_to(block.end);
        self.out.push(Item::Block(block, None));
    }

    /// Appends a block to `end`, otherwise a blank one but for what `fill` sets.
    #[inline]
    pub fn push_to(&mut self, end: AxisVector, fill: impl FnOnce(&mut Block)) {
        let state = &*self.state;
        let next = || {
            let mut block = state.blank_block();
            block.end = end;
            fill(&mut block);
            Item::Block(block, None)
        };
        if self.state.compensation.holds() {
            return self.state.compensation.hold(next());
        }
        // What is made behind the place for it is made in its place: a block is large.
        self.out.extend(std::iter::once_with(next));
        self.state.path.advance_to(end);
    }

    /// Appends a block whose turn has come only now.
    #[allow(clippy::large_types_passed_by_value, reason = "as in `push`")]
    pub fn emit(&mut self, mut block: Block) {
        block.index = self.state.path.next_index;
        self.state.path.advance_to(block.end);
        self.out.push(Item::Block(block, None));
    }

    /// Appends an event before the next block.
    pub fn event(&mut self, kind: EventKind, index: u32, value: f64) {
        let line = self.state.line;
        let before_block = self.state.path.next_index;
        let event = Item::Event(Event::new(
            kind,
            line,
            before_block,
            index.cast_signed(),
            value,
        ));
        if self.state.compensation.holds() {
            return self.state.compensation.hold(event);
        }
        self.out.push(event);
    }

    /// Brings the machine to rest: an event that needs it follows.
    pub fn rest(&mut self) {
        if !self.state.path.at_rest {
            self.dwell(0.0);
        }
    }

    /// Rest for `dwell_s`.
    pub fn dwell(&mut self, dwell_s: f64) {
        let block = Block {
            kind: BlockKind::Dwell,
            dwell_s,
            ..self.state.blank_block()
        };
        self.push(block);
        self.state.path.at_rest = true;
    }

    /// Whether `low` to `high`, machine coordinates, lies within the travel of `axis`.
    #[inline]
    pub fn check_travel(&self, axis: usize, low: f64, high: f64) -> Checked<()> {
        let (min, max) = self.config.travel_mm[axis];
        if low >= min - TRAVEL_ROUNDING && high <= max + TRAVEL_ROUNDING
            || self.state.path.uncertain >> axis & 1 != 0
        {
            return Ok(());
        }
        Err(self.beyond_travel(
            axis,
            if high > max + TRAVEL_ROUNDING {
                high
            } else {
                low
            },
        ))
    }

    #[cold]
    fn beyond_travel(&self, axis: usize, value: f64) -> LineError {
        let rotary = self.letters.is_rotary(axis);
        let shown = |v: f64| show(if rotary { v.to_degrees() } else { v });
        let unit = if rotary { "deg" } else { "mm" };
        let letter = self.letters.letter(axis);
        let name = letter as char;
        let (min, max) = self.config.travel_mm[axis];
        let travel = format!("{} to {} {unit}", shown(min), shown(max));
        let mut message = format!(
            "{name} would reach {} {unit}, beyond its travel of {travel} (machine coordinates",
            shown(value)
        );
        let offset = self.state.coordinates.total()[axis];
        if offset != 0.0 {
            let _ = write!(message, "; the offset in force is {} {unit}", shown(offset));
        }
        message.push(')');
        if self.words.has(letter) {
            self.words.error(letter, "travel", message)
        } else if self.orders.axes_taken {
            self.orders.error(Group::NonModal, "travel", message)
        } else {
            self.motion_error("travel", message)
        }
    }

    /// An error at the motion word, or at the first axis word where the motion is modal.
    pub fn motion_error(&self, code: &'static str, message: impl Into<String>) -> LineError {
        match self.words.first_of(AXIS_MASK) {
            _ if self.orders.has(Group::Motion) => self.orders.error(Group::Motion, code, message),
            Some((_, span)) => LineError::new(span, code, message),
            None => LineError::new(Span::new(0, 1), code, message),
        }
    }

    /// Motions other than G0 and G1 do not go with G53.
    pub fn refuse_machine_coordinates(&self) -> Checked<()> {
        if self.in_machine_coordinates() {
            return Err(self.orders.error(
                Group::NonModal,
                "conflict",
                "G53 goes with G0 and G1 only",
            ));
        }
        Ok(())
    }

    /// A rapid from where the last block ended to the programmed position.
    pub fn rapid(&mut self) -> Checked<()> {
        motion::straight(self, BlockKind::Rapid)
    }
}
