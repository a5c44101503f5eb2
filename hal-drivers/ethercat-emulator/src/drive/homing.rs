//! Homing by the drive: towards a switch, off it again slowly, to the index pulse where the method asks for it.

/// Switches of an axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Switches {
    pub(super) negative: bool,
    pub(super) positive: bool,
    pub(super) home: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Switch {
    Negative,
    Positive,
    Home,
}

impl Switch {
    fn of(self, switches: Switches) -> bool {
        match self {
            Self::Negative => switches.negative,
            Self::Positive => switches.positive,
            Self::Home => switches.home,
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Phase {
    /// Until the switch is on.
    Search,
    /// Until it is off again.
    Leave,
    /// Until the index pulse.
    Index,
    /// To rest; the place is found.
    Stop(f64),
}

/// One homing.
#[derive(Clone, Copy, Debug)]
pub(super) struct Homing {
    switch: Option<Switch>,
    /// 1 or −1: towards the switch, and where the index pulse is looked for.
    towards: f64,
    index_direction: f64,
    with_index: bool,
    phase: Phase,
    last_place: f64,
}

/// What a homing wants in this step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Step {
    /// Velocity, as a share of the fast one (for the switch) or of the slow one.
    Fast(f64),
    Slow(f64),
    /// Found at this place, and at rest.
    Found(f64),
    /// The limit of the travel came first.
    Failed,
}

impl Homing {
    /// Begins a method at a place; none for a method that is not known.
    pub(super) fn begin(method: i8, place: f64) -> Option<Self> {
        let (switch, towards, with_index) = match method {
            1 => (Some(Switch::Negative), -1.0, true),
            2 => (Some(Switch::Positive), 1.0, true),
            3 => (Some(Switch::Home), 1.0, true),
            5 => (Some(Switch::Home), -1.0, true),
            17 => (Some(Switch::Negative), -1.0, false),
            18 => (Some(Switch::Positive), 1.0, false),
            19 => (Some(Switch::Home), 1.0, false),
            21 => (Some(Switch::Home), -1.0, false),
            33 => (None, 1.0, true),
            34 => (None, -1.0, true),
            35 | 37 => (None, 1.0, false),
            _ => return None,
        };
        let phase = match (switch, with_index) {
            (Some(_), _) => Phase::Search,
            (None, true) => Phase::Index,
            (None, false) => Phase::Stop(place),
        };
        let index_direction = if switch.is_some() { -towards } else { towards };
        Some(Self {
            switch,
            towards,
            index_direction,
            with_index,
            phase,
            last_place: place,
        })
    }

    /// Goes on. A home switch that is on above its edge is off below: methods 5 and 21 meet it from above, and look for
    /// off instead of on.
    pub(super) fn step(
        &mut self,
        place: f64,
        turn: f64,
        switches: Switches,
        at_rest: bool,
    ) -> Step {
        let before = std::mem::replace(&mut self.last_place, place);
        let from_above = self.switch == Some(Switch::Home) && self.towards < 0.0;
        let on = self.switch.is_some_and(|switch| switch.of(switches)) != from_above;
        let ends = self.switch == Some(Switch::Home) && (switches.negative || switches.positive);
        match self.phase {
            Phase::Search if on => self.phase = Phase::Leave,
            Phase::Search | Phase::Leave if ends => return Step::Failed,
            Phase::Leave if !on => {
                self.phase = if self.with_index {
                    Phase::Index
                } else {
                    Phase::Stop(place)
                }
            }
            Phase::Index if (before / turn).floor() != (place / turn).floor() => {
                self.phase = Phase::Stop((before.max(place) / turn).floor() * turn);
            }
            _ => {}
        }
        match self.phase {
            Phase::Search => Step::Fast(self.towards),
            Phase::Leave => Step::Slow(-self.towards),
            Phase::Index => Step::Slow(self.index_direction),
            Phase::Stop(found) if at_rest => Step::Found(found),
            Phase::Stop(_) => Step::Slow(0.0),
        }
    }
}
