//! Looking ahead in the queue without moving.

use tandem_rings::Queued;
use tandem_sdk::{Edge, Segment, SegmentFlags, StopOn};

use super::{Cursor, ends};
use crate::horizon::{Horizon, derivatives};
use crate::period_points::PeriodPoints;
use crate::plan_ahead::{PlanAhead, PlanCursor};

/// Most entries that the plan ahead reaches over.
const ON_COURSE: usize = 512;

impl Cursor {
    /// Number, counted from the start, of the entry that comes next.
    pub fn next_number(&self) -> u64 {
        self.taken
    }

    /// Line of the next segment queued.
    pub fn next_line(&mut self) -> Option<u32> {
        let mut line = None;
        self.walk(self.taken, PeriodPoints::SEGMENTS, |queued| {
            if let Queued::Segment { segment, .. } = queued {
                line = Some(segment.line);
            }
            line.is_none()
        });
        line
    }

    /// What the motion that begins next at a rest waits for.
    pub fn next_stop_on(&mut self) -> StopOn {
        let (mut awaited, epoch) = (StopOn::default(), self.epoch);
        self.walk(self.taken, PeriodPoints::SEGMENTS, |queued| match queued {
            Queued::Segment { segment, .. } if segment.epoch >= epoch => {
                awaited = segment.stop_on;
                false
            }
            _ => true,
        });
        awaited
    }

    /// Whether what comes next, with nothing to switch before it, is a cut; elsewhere than at a rest, whether here is one.
    pub fn is_cutting(&mut self) -> bool {
        if !self.resting {
            return is_cut(&self.segment);
        }
        matches!(self.entries.peek(), Ok(Queued::Segment { segment, .. }) if segment.epoch >= self.epoch && is_cut(segment))
    }

    /// Shows the queued entries from `number` on, at most `most` of them, until `look` says stop (`false`); gives the
    /// number of the first entry not shown, or shown last where it said stop.
    pub fn walk(&mut self, number: u64, most: usize, mut look: impl FnMut(&Queued) -> bool) -> u64 {
        let skip = number.saturating_sub(self.taken) as usize;
        let wanted = self.entries.slots().min(skip + most);
        let mut at = self.taken + skip.min(wanted) as u64;
        let Ok(chunk) = self.entries.read_chunk(wanted) else {
            return at;
        };
        let (first, second) = chunk.as_slices();
        let behind = skip.saturating_sub(first.len());
        for part in [first.get(skip..), second.get(behind..)] {
            for queued in part.unwrap_or_default() {
                if !look(queued) {
                    return at;
                }
                at += 1;
            }
        }
        at
    }

    /// Shows the segment here with the time in it, and those behind it with 0, until `look` says stop (`false`), or one ends
    /// at rest. As many as a period looks at.
    pub fn pieces(&mut self, mut look: impl FnMut(&Segment, f64) -> bool) {
        if !self.resting && (!look(&self.segment, self.local_s) || ends(&self.segment)) {
            return;
        }
        self.walk(self.taken, PeriodPoints::SEGMENTS, |queued| match queued {
            Queued::Segment { segment, .. } => look(segment, 0.0) && !ends(segment),
            Queued::Event(_) => true,
        });
    }

    /// First to third derivative of the path coordinate here by program time, mm/s and so on.
    pub fn path_derivatives(&self) -> [f64; 3] {
        if self.resting {
            [0.0; 3]
        } else {
            derivatives(&self.segment.path, self.local_s)
        }
    }

    /// Collects the points of the coming period, and a grid beyond it.
    pub fn fill_horizon(&mut self, period_s: f64, horizon: &mut Horizon) {
        horizon.clear();
        let step_s = horizon.reach_s / Horizon::GRID as f64;
        let mut grid_s = period_s + step_s;
        let mut start_s = 0.0;
        if !self.resting {
            let here_s = self.segment.duration_s - self.local_s;
            horizon.stretch(&self.segment, self.local_s, here_s.min(period_s), 0.0);
            while grid_s <= here_s && grid_s <= horizon.reach_s {
                horizon.point(&self.segment, self.local_s + grid_s, grid_s);
                grid_s += step_s;
            }
            if ends(&self.segment) {
                return;
            }
            start_s = here_s;
        }
        let next = self.taken;
        self.walk(next, PeriodPoints::SEGMENTS, |queued| {
            let Queued::Segment { segment, .. } = queued else {
                return true;
            };
            if start_s < period_s {
                if horizon.is_full() {
                    return false;
                }
                horizon.stretch(
                    segment,
                    0.0,
                    segment.duration_s.min(period_s - start_s),
                    start_s,
                );
            }
            while grid_s <= start_s + segment.duration_s && grid_s <= horizon.reach_s {
                horizon.point(segment, grid_s - start_s, grid_s);
                grid_s += step_s;
            }
            start_s += segment.duration_s;
            grid_s <= horizon.reach_s && !ends(segment)
        });
    }

    /// Shows the plan from here on to `look`, as far as it is queued.
    pub fn on_plan_ahead<T>(
        &mut self,
        axes: (usize, u32),
        look: impl FnOnce(PlanCursor<'_>) -> T,
    ) -> T {
        let wanted = self.entries.slots().min(ON_COURSE);
        let local_s = if self.resting {
            self.segment.duration_s
        } else {
            self.local_s
        };
        match self.entries.read_chunk(wanted) {
            Ok(chunk) => {
                let (first, second) = chunk.as_slices();
                look(PlanAhead::new(&self.segment, [first, second], axes).begin(local_s))
            }
            Err(_) => look(PlanAhead::new(&self.segment, [&[], &[]], axes).begin(local_s)),
        }
    }
}

/// Whether the tool may cut in it: a motion at a feed that waits for no input.
pub fn is_cut(segment: &Segment) -> bool {
    let moves = segment.path[1..]
        .iter()
        .any(|coefficient| *coefficient != 0.0);
    moves && !segment.flags.contains(SegmentFlags::RAPID) && segment.stop_on.edge == Edge::None
}
