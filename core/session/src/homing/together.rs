//! Axes that home at once: those of one sequence number, and the joints of a gantry, which squares itself so.
//!
//! All of them move on one straight line, each at its own feed, until the switch of one trips; that one stays where it is, and the
//! others go on. A joint of a gantry goes on without the others no further than the gantry may be askew.

use tandem_machine::SwitchHoming;
use tandem_rings::{Rest, RestCause};
use tandem_sdk::{AxisVector, Edge, EventKind, StopOn};

use super::BOUNCE_S;
use super::axis::Axis;

/// The shortest way that a joint goes alone, mm: its end is then told as any other.
const MIN_MM: f64 = 1e-3;
/// Stops without a switch that has changed, after which it is said to be unsteady: it bounces.
const MAX_STOPS: u32 = 50;

/// What is asked of the machine.
pub enum Ask {
    /// The level of a switch: as it is, or once it is `on` (true) or off, for which it has so long.
    Read {
        /// The switch.
        plan: SwitchHoming,
        /// The level that is waited for.
        on: Option<bool>,
        /// How long, s.
        within_s: f64,
    },
    /// A straight line to `end` that takes so many seconds, or as few as it can.
    Move {
        /// Machine coordinates.
        end: AxisVector,
        /// Its time, s; none for a rapid.
        seconds: Option<f64>,
        /// What ends it early.
        stop_on: StopOn,
    },
    /// Something that the loop is told of an axis.
    Tell {
        /// What.
        kind: EventKind,
        /// Index of the axis.
        axis: usize,
        /// Its value.
        value: f64,
    },
    /// Nothing is waited for any more.
    Done,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    /// Reads all switches.
    Look,
    /// Those on their switches go away.
    Leave,
    /// All go towards theirs.
    Search,
    /// All go off theirs, which must be off then.
    BackOff,
    /// All go slowly onto theirs.
    Latch,
    /// The position of each is set anew.
    Correct,
    /// All go home.
    GoHome,
}

/// Axes on their way home, one bit each in the order of the list.
pub struct Together {
    axes: Vec<Axis>,
    phase: Phase,
    /// Whose switch is waited for.
    open: u32,
    /// Whose switch is still to be read, and those of them that have changed.
    unread: u32,
    changed: u32,
    /// Where the switches tripped, mm or rad.
    edges_mm: Vec<f64>,
    /// Where joints of gantries began to go on alone.
    alone_from_mm: Vec<Option<f64>>,
    /// Whose way was the shortest of the motion that is driven.
    ends_first: usize,
    edge: AxisVector,
    stops: u32,
    over: bool,
}

impl Together {
    pub fn new(axes: Vec<Axis>) -> Self {
        let mut this = Self {
            edges_mm: vec![0.0; axes.len()],
            alone_from_mm: vec![None; axes.len()],
            ends_first: 0,
            axes,
            phase: Phase::Look,
            open: 0,
            unread: 0,
            changed: 0,
            edge: AxisVector::ZERO,
            stops: 0,
            over: false,
        };
        this.begin_anew();
        this
    }

    pub fn begin_anew(&mut self) {
        self.begin(Phase::Look, 0);
        self.unread = self.all();
    }

    pub fn is_over(&self) -> bool {
        self.over
    }

    fn all(&self) -> u32 {
        (1 << self.axes.len()) - 1
    }

    fn begin(&mut self, phase: Phase, open: u32) {
        self.phase = phase;
        self.open = open;
        self.unread = 0;
        self.changed = 0;
        self.stops = 0;
        self.alone_from_mm.fill(None);
    }

    fn those(&self, mask: u32) -> impl Iterator<Item = (usize, &Axis)> {
        self.axes
            .iter()
            .enumerate()
            .filter(move |(at, _)| mask >> at & 1 == 1)
    }

    /// What goes with `open`: where a joint of a gantry leaves its switch, the others leave with it.
    fn with_feet(&self, open: u32) -> u32 {
        let gantries: Vec<_> = self.those(open).filter_map(|(_, of)| of.foot).collect();
        let goes = |axis: &Axis| {
            let gantry = axis.foot.map(|foot| foot.axis);
            gantry.is_some_and(|of| gantries.iter().any(|foot| foot.axis == of))
        };
        self.those(self.all())
            .filter(|(_, axis)| goes(axis))
            .fold(open, |all, (at, _)| all | 1 << at)
    }

    /// How far a joint goes alone: the others of its gantry stand on their switches.
    fn alone_mm(&self, axis: &Axis) -> Option<f64> {
        let foot = axis.foot?;
        let waits = |other: &Axis| other.foot.is_some_and(|of| of.axis == foot.axis);
        let others = self.those(self.all() & !self.open);
        let is_alone = others.map(|(_, other)| other).any(waits);
        is_alone.then_some(foot.max_skew_mm)
    }

    /// Joints that go on alone from `position` on are remembered.
    fn look_who_is_alone(&mut self, position: &AxisVector) {
        for at in 0..self.axes.len() {
            let begins = self.open >> at & 1 == 1 && self.alone_mm(&self.axes[at]).is_some();
            if begins && self.phase == Phase::Search {
                self.alone_from_mm[at].get_or_insert(position[self.axes[at].index]);
            }
        }
    }

    /// The ways of the axes that move from `position`, signed, and their feeds.
    fn ways(&self, position: &AxisVector) -> Vec<(&Axis, f64, f64)> {
        let moving = match self.phase {
            Phase::Leave => self.with_feet(self.open),
            _ => self.open,
        };
        let way = |at: usize, axis: &Axis| {
            let fast = axis.plan.search_mm_per_s.abs();
            let (way_mm, feed) = match self.phase {
                Phase::Leave => (-axis.search_mm(), fast),
                Phase::BackOff => (-axis.direction() * axis.plan.back_off_mm, fast),
                Phase::Latch => (axis.latch_mm(), axis.plan.latch_mm_per_s),
                _ => (axis.search_mm(), fast),
            };
            // What it has gone alone before a stop counts.
            let max_mm = match (self.alone_mm(axis), self.alone_from_mm[at]) {
                (Some(max_mm), Some(from_mm)) => {
                    (max_mm - (position[axis.index] - from_mm).abs()).max(MIN_MM)
                }
                _ => f64::INFINITY,
            };
            (way_mm.clamp(-max_mm, max_mm), feed)
        };
        self.those(moving)
            .map(|(at, axis)| {
                let (way_mm, feed) = way(at, axis);
                (axis, way_mm, feed)
            })
            .collect()
    }

    /// Who comes to the end of its way first.
    fn who_ends_first(&self, position: &AxisVector) -> usize {
        let ways = self.ways(position);
        let shortest = ways
            .iter()
            .min_by(|a, b| (a.1.abs() / a.2).total_cmp(&(b.1.abs() / b.2)));
        let index = shortest.map(|(axis, ..)| axis.index);
        let place = self.axes.iter().position(|axis| Some(axis.index) == index);
        place.unwrap_or(0)
    }

    /// The motion of this phase from `position`, as far as the first that has come to the end of its way.
    fn travel(&self, position: &AxisVector) -> Ask {
        let ways = self.ways(position);
        let seconds = ways.iter().map(|(_, way_mm, feed)| way_mm.abs() / feed);
        // Who backs off does so to the end, whoever needs longest.
        let seconds = if self.phase == Phase::BackOff {
            seconds.fold(0.0, f64::max)
        } else {
            seconds.fold(f64::INFINITY, f64::min)
        };
        let mut end = *position;
        for (axis, way_mm, feed) in &ways {
            end[axis.index] += if self.phase == Phase::BackOff {
                *way_mm
            } else {
                way_mm.signum() * feed * seconds
            };
        }
        let watched = self
            .those(self.open)
            .fold(0, |all, (_, axis)| all | 1 << axis.index);
        let stop_on = match self.phase {
            Phase::BackOff => StopOn::default(),
            Phase::Leave => StopOn::home_switches(watched, Edge::Falling),
            _ => StopOn::home_switches(watched, Edge::Rising),
        };
        Ask::Move {
            end,
            seconds: Some(seconds),
            stop_on,
        }
    }

    /// What follows from here, where the machine stands at `position`.
    pub fn asks(&mut self, position: &AxisVector) -> Vec<Ask> {
        if let Some((_, axis)) = self.those(self.unread).next() {
            return vec![self.read(axis)];
        }
        match self.phase {
            Phase::Look => vec![],
            Phase::Leave | Phase::Search | Phase::Latch => {
                self.look_who_is_alone(position);
                self.ends_first = self.who_ends_first(position);
                vec![self.travel(position)]
            }
            Phase::BackOff => {
                let back = self.travel(position);
                self.unread = self.open;
                let first = self
                    .those(self.unread)
                    .next()
                    .map(|(_, axis)| self.read(axis));
                [Some(back), first].into_iter().flatten().collect()
            }
            Phase::Correct => {
                let next = self.those(self.open).next();
                let tell = next.map(|(at, axis)| Ask::Tell {
                    kind: EventKind::Correct,
                    axis: axis.index,
                    value: axis.plan.switch_mm - self.edges_mm[at],
                });
                tell.into_iter().collect()
            }
            Phase::GoHome => {
                let mut end = *position;
                for axis in &self.axes {
                    end[axis.index] = axis.home_mm;
                }
                self.over = true;
                let homed = self.axes.iter().map(|axis| Ask::Tell {
                    kind: EventKind::Homed,
                    axis: axis.index,
                    value: 0.0,
                });
                let home = Ask::Move {
                    end,
                    seconds: None,
                    stop_on: StopOn::default(),
                };
                [home].into_iter().chain(homed).chain([Ask::Done]).collect()
            }
        }
    }

    fn read(&self, axis: &Axis) -> Ask {
        let on = match self.phase {
            Phase::Look => None,
            Phase::Leave | Phase::BackOff => Some(false),
            _ => Some(true),
        };
        Ask::Read {
            plan: axis.plan,
            on,
            within_s: if on.is_none() { 0.0 } else { BOUNCE_S },
        }
    }

    /// A switch was read: its level, below zero where what was waited for did not come.
    ///
    /// # Errors
    /// It sticks, or does not work.
    pub fn after_input(&mut self, value: f64) -> Result<(), String> {
        let Some((at, axis)) = self.those(self.unread).next() else {
            return Ok(());
        };
        let changed = match self.phase {
            // Here it has changed where it is on.
            Phase::Look => (value == 1.0) != axis.plan.inverted,
            Phase::BackOff if value < 0.0 => return Err(axis.sticks()),
            _ => value >= 0.0,
        };
        self.unread &= !(1 << at);
        if changed {
            self.changed |= 1 << at;
            if self.phase == Phase::Latch {
                self.edges_mm[at] = self.edge[self.axes[at].index];
            }
        }
        if self.unread == 0 {
            self.go_on()?;
        }
        Ok(())
    }

    /// All that was to be read is read.
    fn go_on(&mut self) -> Result<(), String> {
        let changed = std::mem::take(&mut self.changed);
        match self.phase {
            Phase::Look if changed != 0 => self.begin(Phase::Leave, changed),
            Phase::Look => self.begin(Phase::Search, self.all()),
            Phase::BackOff => self.begin(Phase::Latch, self.all()),
            Phase::Leave | Phase::Search | Phase::Latch => {
                self.open &= !changed;
                self.stops += u32::from(changed == 0);
                if self.stops > MAX_STOPS {
                    let unsteady = self.those(self.open).next();
                    return Err(unsteady.map_or_else(String::new, |(_, axis)| axis.is_unsteady()));
                }
                match (self.open, self.phase) {
                    (0, Phase::Leave) => self.begin(Phase::Search, self.all()),
                    (0, Phase::Search) => self.begin(Phase::BackOff, self.all()),
                    (0, _) => self.begin(Phase::Correct, self.all()),
                    _ => {}
                }
            }
            Phase::Correct | Phase::GoHome => {}
        }
        Ok(())
    }

    /// The machine rests.
    ///
    /// # Errors
    /// A switch did not change where it should have.
    pub fn after_rest(&mut self, rest: &Rest) -> Result<(), String> {
        match (self.phase, rest.cause) {
            (Phase::Correct, RestCause::Corrected) => {
                // The others stand where they did, whether their position has been set anew yet or not.
                self.open &= self.open - 1;
                if self.open == 0 {
                    self.begin(Phase::GoHome, 0);
                }
                Ok(())
            }
            (_, RestCause::Edge | RestCause::Already) => {
                self.edge = rest.latch.unwrap_or(rest.position);
                self.unread = self.open;
                Ok(())
            }
            _ => Err(self.missed()),
        }
    }

    /// Who came to the end of its way without its switch.
    fn missed(&self) -> String {
        let axis = &self.axes[self.ends_first];
        match self.phase {
            Phase::Leave => axis.stays_on(),
            Phase::Search => match self.alone_mm(axis) {
                Some(max_mm) => axis.is_askew(max_mm),
                None => axis.never_trips(),
            },
            _ => axis.is_unsteady(),
        }
    }
}
