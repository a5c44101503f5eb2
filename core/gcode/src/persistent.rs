//! What outlives a program: offsets, parameters and tools as plain data, and how far the path has made them true.

use std::collections::{BTreeMap, VecDeque};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tandem_sdk::AxisVector;

use crate::config::Tool;
use crate::interpreter::Interpreter;
use crate::state::State;
use crate::state::coordinates::SYSTEMS;
use crate::state::parameters::Written;
use crate::words::coolant::Coolant;
use crate::words::spindle::Spindle;

/// Number of work coordinate systems: G54 to G59, G59.1 to G59.3.
pub const WORK_SYSTEMS: usize = SYSTEMS;

/// What lasts from one program to the next, as plain data: vectors in mm or rad, machine coordinates. An interpreter begins with
/// it ([`crate::Config::persistent_data`]) and says it at any time ([`Interpreter::persistent_data`]).
#[derive(Clone, Debug, PartialEq)]
pub struct PersistentData {
    /// Origins of the work coordinate systems, G54 first.
    pub origins: [AxisVector; WORK_SYSTEMS],
    /// Rotation of each about its origin, from X to Y, rad.
    pub rotations_rad: [f64; WORK_SYSTEMS],
    /// Index of the system in force: 0 for G54.
    pub active_system: usize,
    /// Offset of G92 in force.
    pub g92: AxisVector,
    /// What G92.3 restores.
    pub g92_stored: AxisVector,
    /// Stored positions of G28 and G30.
    pub reference: [AxisVector; 2],
    /// Tool length offset in force (G43).
    pub tool_offset: AxisVector,
    /// Numbered parameters that are not zero: #31 to #5000, and what probes have found (#5061 to #5070).
    pub parameters: BTreeMap<u32, f64>,
    /// The tool table.
    pub tools: Vec<Tool>,
    /// Tool in the spindle, 0 for none.
    pub tool_in_spindle: u32,
}

impl Default for PersistentData {
    /// No offset, no parameter, no tool; G54 in force.
    fn default() -> Self {
        let zero = AxisVector::ZERO;
        Self {
            origins: [zero; WORK_SYSTEMS],
            rotations_rad: [0.0; WORK_SYSTEMS],
            active_system: 0,
            g92: zero,
            g92_stored: zero,
            reference: [zero; 2],
            tool_offset: zero,
            parameters: BTreeMap::new(),
            tools: Vec::new(),
            tool_in_spindle: 0,
        }
    }
}

/// What is in force of the tables of [`PersistentData`], by itself: for whoever shows it many times a second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InForce {
    /// Index of the work coordinate system: 0 for G54.
    pub system: usize,
    /// Its origin.
    pub origin: AxisVector,
    /// Offset of G92.
    pub g92: AxisVector,
    /// Tool length offset (G43).
    pub tool_offset: AxisVector,
    /// Tool in the spindle, 0 for none.
    pub tool_in_spindle: u32,
}

/// Modes, offsets, tools and parameters as they are from a place of the path on.
#[derive(Clone)]
pub struct StateTag {
    state: Box<State>,
    written: Vec<Written>,
}

/// The tags of lines that are read ahead of the path, until the path reaches them. The side that reads and the side that
/// sees samples share it; soft side, allocates.
#[derive(Clone, Default)]
pub struct StateTags(Arc<Mutex<Inner>>);

#[derive(Default)]
struct Inner {
    /// Each with the block at which the path reaches it.
    waiting: VecDeque<(u64, StateTag)>,
    reached: Option<StateTag>,
}

impl StateTags {
    /// A line behind which things are as `tag` says counts once the path has begun `block`.
    pub fn push(&self, block: u64, tag: StateTag) {
        self.lock().waiting.push_back((block, tag));
    }

    /// The path has begun `block`.
    pub fn reach(&self, block: u64) {
        let mut inner = self.lock();
        while inner.waiting.front().is_some_and(|(at, _)| *at <= block) {
            inner.take_next();
        }
    }

    /// Everything that was read is driven.
    pub fn reach_all(&self) {
        let mut inner = self.lock();
        while !inner.waiting.is_empty() {
            inner.take_next();
        }
    }

    /// The path ends here: what it has not reached never was.
    pub fn forget(&self) {
        self.lock().waiting.clear();
    }

    /// What the path has reached since this was asked last.
    pub fn take(&self) -> Option<StateTag> {
        self.lock().reached.take()
    }

    fn lock(&self) -> MutexGuard<'_, Inner> {
        // What lies in it is whole after every statement.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Inner {
    fn take_next(&mut self) {
        let Some((_, tag)) = self.waiting.pop_front() else {
            return;
        };
        match &mut self.reached {
            Some(reached) => {
                reached.written.extend(tag.written);
                reached.state = tag.state;
            }
            None => self.reached = Some(tag),
        }
    }
}

impl Interpreter {
    /// What would outlive the program if it ended here. Allocates.
    pub fn persistent_data(&self) -> PersistentData {
        let mut persistent = PersistentData::default();
        self.state.coordinates.tell(&mut persistent);
        persistent.parameters = self.parameters.persistent_data();
        persistent.tools.clone_from(self.state.tools.table());
        persistent.tool_in_spindle = self.state.tools.in_spindle;
        persistent
    }

    /// What is in force of it now. Does not allocate.
    pub fn in_force(&self) -> InForce {
        let coordinates = &self.state.coordinates;
        InForce {
            system: coordinates.active(),
            origin: *coordinates.origin(coordinates.active()),
            g92: *coordinates.g92(),
            tool_offset: *coordinates.tool(),
            tool_in_spindle: self.state.tools.in_spindle,
        }
    }

    /// Takes offsets, parameters and tools as they are said here; modes stay. At rest; allocates.
    pub fn set_persistent_data(&mut self, persistent: &PersistentData) {
        self.state.coordinates.hear(persistent);
        self.parameters.set_persistent_data(&persistent.parameters);
        self.state
            .tools
            .set_table(&persistent.tools, persistent.tool_in_spindle);
    }

    /// From here on what lines write is kept, to be told by [`Interpreter::state_tag_since`].
    pub fn keep_state_tags(&mut self) {
        self.parameters.keep_log();
    }

    /// How things are behind the last line, where they are otherwise than at `before`, which is then this one. Allocates where
    /// something has changed.
    pub fn state_tag_since(&mut self, before: &mut Option<StateTag>) -> Option<StateTag> {
        let written = self.parameters.take_log();
        let same = before
            .as_ref()
            .is_some_and(|before| before.state.is_as(&self.state));
        if same && written.is_empty() {
            return None;
        }
        let tag = StateTag {
            state: Box::new(self.state.clone()),
            written,
        };
        *before = Some(StateTag {
            state: tag.state.clone(),
            written: vec![],
        });
        Some(tag)
    }

    /// Number of the block that comes next.
    pub fn next_block(&self) -> u64 {
        self.state.path.next_index
    }

    /// Blocks are numbered from 0 again: another job begins.
    pub fn number_anew(&mut self) {
        self.state.path.next_index = 0;
    }

    /// Modes, offsets, tools and parameters are as a program has left them at `tag`; where the machine stands is said by
    /// [`Interpreter::set_position`]. Allocates.
    pub fn take_up(&mut self, tag: StateTag) {
        let StateTag { mut state, written } = tag;
        std::mem::swap(&mut state.path, &mut self.state.path);
        state.curves = crate::words::curve::Curves::default();
        state.compensation = crate::words::compensation::Compensation::default();
        state.saved = crate::words::modal::SavedStates::default();
        state.ended = false;
        state.line = self.state.line;
        self.state = *state;
        self.parameters.write(written);
    }

    /// A program has ended: modes are as at the start (G17 G21 G90 G94 G64, no motion word). Offsets, tools and what is in force
    /// of them stay.
    pub fn reset_modes(&mut self) {
        let fresh = State::new(self.config());
        self.state.motion = fresh.motion;
        self.state.modes = fresh.modes;
        self.state.permits = fresh.permits;
        self.state.cycles = fresh.cycles;
        self.state.saved = fresh.saved;
        self.state.compensation = fresh.compensation;
        self.state.spindle.surface = None;
        self.state.curves = fresh.curves;
        self.state.ended = false;
    }

    /// Position in program coordinates, mm or rad, of `machine` in machine coordinates, with all offsets in force.
    pub fn to_program(&self, machine: &AxisVector) -> AxisVector {
        self.state.coordinates.to_program(machine)
    }

    /// The modal words in force, as in `G1 G17 G21 G90 G94 G54 G64`, for people. Allocates.
    pub fn modal_words(&self) -> Vec<String> {
        let modes = &self.state.modes;
        let coordinates = &self.state.coordinates;
        let either = |on: bool, yes: &str, no: &str| if on { yes } else { no }.to_string();
        let mut words: Vec<String> = self
            .state
            .motion
            .code()
            .map(str::to_string)
            .into_iter()
            .collect();
        words.push(modes.plane.code().to_string());
        words.push(either(modes.unit_mm == 1.0, "G21", "G20"));
        words.push(either(modes.absolute, "G90", "G91"));
        words.push(either(modes.arc_absolute, "G90.1", "G91.1"));
        words.push(modes.feed.mode.code().to_string());
        words.extend(modes.diameter.then(|| "G7".to_string()));
        words.extend(self.state.spindle.surface.map(|_| "G96".to_string()));
        words.push(self.state.compensation.word().to_string());
        words.push(system_code(coordinates.active()));
        words.push(either(modes.exact_stop, "G61", "G64"));
        words.push(either(
            *coordinates.tool() == AxisVector::ZERO,
            "G49",
            "G43",
        ));
        words.push(match self.state.spindle.direction {
            0 => "M5".to_string(),
            direction => either(direction > 0, "M3", "M4"),
        });
        words
    }

    /// The coolant that is on: M7, M8. Allocates.
    pub fn coolant_words(&self) -> Vec<&'static str> {
        let coolant = self.state.coolant;
        let [mist, flood] = [(coolant.mist, "M7"), (coolant.flood, "M8")];
        [mist, flood]
            .into_iter()
            .filter(|(on, _)| *on)
            .map(|(_, word)| word)
            .collect()
    }

    /// Speed that S has set, rad/s.
    pub fn spindle_speed_rad_per_s(&self) -> f64 {
        self.state.spindle.speed_rad_per_s
    }

    /// Feed (F) in force, mm/s; 0 for none.
    pub fn feed_mm_per_s(&self) -> f64 {
        self.state.modes.feed.linear_mm_per_s
    }

    /// Tool that T has selected.
    pub fn selected_tool(&self) -> Option<u32> {
        self.state.tools.selected
    }

    /// Tool in the spindle, 0 for none.
    pub fn tool_in_spindle(&self) -> u32 {
        self.state.tools.in_spindle
    }
}

/// A work coordinate system as programs call it: `G54` for 0, `G59.3` for 8.
pub fn system_code(index: usize) -> String {
    if index < 6 {
        format!("G{}", 54 + index)
    } else {
        format!("G59.{}", index - 5)
    }
}

/// Spindle and coolant as lines have left them.
#[derive(Clone, Copy, Debug, Default)]
pub struct SwitchedOn {
    pub(crate) spindle: Spindle,
    pub(crate) coolant: Coolant,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::mill;

    fn interpreter(config: &crate::Config, lines: &[&str]) -> Interpreter {
        let mut interpreter = Interpreter::new(config.clone());
        for (number, line) in (1..).zip(lines) {
            interpreter
                .line(number, line.as_bytes(), &mut vec![])
                .unwrap();
        }
        interpreter
    }

    #[test]
    fn what_lasts_is_said_and_taken_up_again() {
        let lines = [
            "G10 L2 P2 X5 Y6 R30",
            "G55 G92 X3",
            "#100 = 7 #4999 = -2.5 #5 = 9",
            "G28.1",
            "T2 M6",
            "G43 H2",
            "G10 L1 P2 Z12",
        ];
        let first = interpreter(&mill(), &lines);
        let persistent = first.persistent_data();
        assert_eq!(
            (persistent.active_system, persistent.tool_in_spindle),
            (1, 2)
        );
        assert_eq!(
            persistent.parameters,
            BTreeMap::from([(100, 7.0), (4999, -2.5)]),
            "#5 dies with its program"
        );
        let mut config = mill();
        config.persistent = Some(Arc::new(persistent.clone()));
        let second = Interpreter::new(config);
        assert_eq!(second.persistent_data(), persistent);
        let place = AxisVector::from_slice(&[1.0, 2.0, 3.0]);
        assert_eq!(
            second.to_program(&place),
            first.to_program(&place),
            "the rotation in force too"
        );
    }

    #[test]
    fn only_what_the_path_has_reached_counts() {
        let (state_tags, mut standing) = (StateTags::default(), interpreter(&mill(), &[]));
        let mut ahead = standing.clone();
        ahead.keep_state_tags();
        let mut last = None;
        for (number, line) in (1..).zip([
            "G1 X1 F60",
            "G91 #100=1",
            "X1",
            "#100=2 G10 L2 P1 X9",
            "T2",
            "X1",
        ]) {
            let before = ahead.next_block();
            ahead.line(number, line.as_bytes(), &mut vec![]).unwrap();
            if let Some(tag) = ahead.state_tag_since(&mut last) {
                state_tags.push(before, tag);
            }
        }
        state_tags.reach(1);
        state_tags.forget();
        standing.take_up(state_tags.take().unwrap());
        assert_eq!(
            standing.persistent_data().parameters,
            BTreeMap::from([(100, 1.0)])
        );
        assert_eq!(
            standing.persistent_data().origins[0],
            AxisVector::ZERO,
            "the path did not come to line 4"
        );
        assert!(
            standing.modal_words().contains(&"G91".to_string()),
            "{:?}",
            standing.modal_words()
        );
        assert!(standing.modal_words().contains(&"G1".to_string()));
        standing.reset_modes();
        assert!(standing.modal_words().contains(&"G90".to_string()));
        assert!(state_tags.take().is_none());
    }
}
