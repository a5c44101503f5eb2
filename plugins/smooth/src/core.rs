//! Windows one after the other: what is driven, what is planned next, and what is done where a plan is refused.

use tandem_motion::blocks::{BlockId, report};
use tandem_motion::tube::Lanes;
use tandem_sdk::{AxisVector, Block, Curve, PlannerContext, PluginError, SegmentSink};

use crate::emit::Emitter;
use crate::flatten::{self, Flat};
use crate::frame::Frame;
use crate::plan::{Effort, Planning, Start, Tuning};
use crate::profile;
use crate::route::{Item, Route};
use crate::window::{Piece, State, Window};

/// Part of a window in which it may be left for the next.
const COMMIT: (f64, f64) = (0.42, 0.70);
/// Speeds that count as equal when the place to leave is chosen.
const EQUAL: f64 = 0.995;
/// What a refused plan moves that place by, as a share of the window.
const LATER: f64 = 0.1;
/// Positions before a window that its check looks at.
const BEFORE: usize = 16;
/// A turn by more than this ends a window that is cut short.
const CUT: f64 = 0.25;
/// Time at the programmed feed that is held, in windows and beyond that, s.
const HELD: (f64, f64) = (1.2, 0.3);

/// The planner for machines of at most `L` axes. Rough loop; allocates while its memory grows to the size of a window.
#[derive(Debug)]
pub struct Core<const L: usize> {
    pub(crate) frame: Frame<L>,
    context: PlannerContext,
    pub(crate) route: Route<L>,
    planning: Planning<L>,
    pub(crate) window: Window<L>,
    next: Window<L>,
    /// How far the window is driven, s; none at rest.
    pub(crate) driven_s: Option<f64>,
    flat: Flat<L>,
    before: Vec<Lanes<L>>,
    pub(crate) emitter: Emitter,
    /// Path coordinate and position at rest.
    pub(crate) at: f64,
    pub(crate) position: Lanes<L>,
    /// Least time that the blocks held take, s.
    pub(crate) held_s: f64,
    finished: bool,
}

/// What the planner for any number of axes asks of one.
pub trait AnyCore: Send + std::fmt::Debug {
    /// Whether there is room for another block: fewer chords than that are held, and fewer blocks.
    fn has_room(&self, most_chords: usize) -> bool;
    /// Whether the path of a block can be laid.
    fn check_path(&self, block: &Block, curve: Option<Curve<'_>>) -> Result<(), PluginError>;
    /// Takes a block that was checked.
    fn push(&mut self, block: &Block, curve: Option<Curve<'_>>) -> Result<(), PluginError>;
    fn finish(&mut self);
    fn emit(&mut self, left_s: f64, sink: &mut dyn SegmentSink) -> Result<Option<f64>, PluginError>;
    fn is_done(&self) -> bool;
    fn reset(&mut self, position: &AxisVector);
    fn effort(&self) -> Effort;
}

impl<const L: usize> Core<L> {
    /// At rest.
    pub fn new(context: &PlannerContext, tuning: Tuning) -> Self {
        let frame = Frame::new(context);
        Self {
            frame,
            context: *context,
            route: Route::default(),
            planning: Planning::new(tuning),
            window: Window::new(),
            next: Window::new(),
            driven_s: None,
            flat: Flat::default(),
            before: Vec::with_capacity(BEFORE),
            emitter: Emitter::new(&context.position),
            at: 0.0,
            position: frame.lanes(&context.position),
            held_s: 0.0,
            finished: false,
        }
    }

    /// At rest: the next dwell or window.
    fn begin(&mut self, sink: &mut dyn SegmentSink) -> Result<Option<f64>, PluginError> {
        match self.route.items.front() {
            None => Ok(None),
            Some(Item::Dwell(_)) => {
                if let Some(Item::Dwell(block)) = self.route.pop() {
                    self.emitter.begin_dwell(&block, sink);
                }
                Ok(Some(0.0))
            }
            Some(Item::Leg(leg)) if leg.end <= self.at + 1e-12 => {
                self.skip(sink);
                Ok(Some(0.0))
            }
            Some(Item::Leg(leg)) => {
                let line = leg.block.line;
                if !self.plan_from_rest() {
                    return Err(PluginError::new(format!("line {line}: no motion from rest keeps the limits")));
                }
                self.driven_s = Some(0.0);
                self.emitter.begin_window();
                Ok(Some(0.0))
            }
        }
    }

    /// A block too short to be a motion: it begins and ends.
    fn skip(&mut self, sink: &mut dyn SegmentSink) {
        if let Some(Item::Leg(leg)) = self.route.pop() {
            self.held_s -= leg.least_s;
            if !self.emitter.knows(&leg.block) {
                sink.block(&report(leg.block.index, tandem_sdk::LimitedBy::Acceleration, [0.0; 3], 0.0));
            }
            self.position = self.frame.lanes(&leg.block.end);
            self.emitter.rest(BlockId::from(&leg.block), &leg.block.end, sink);
        }
    }

    /// The longest window from rest that passes; in the end one chord.
    fn plan_from_rest(&mut self) -> bool {
        self.route.begin_run(self.at);
        let run = self.route.run(self.at, self.finished);
        let frame = &self.frame;
        let at = self.at;
        let here = run.chord_at(at, 0);
        let mut start = Start {
            state: [self.position, [0.0; L], [0.0; L]],
            s: at,
            resting: true,
            before: &[],
            end: run.end(),
            window_s: self.planning.tuning.window_s,
            old: None,
        };
        let single = run.chords.len() == here + 1;
        if !(single && run.closed) {
            let mut end = run.end();
            while end > run.chords[here].end() + 1e-9 || !single && end == run.end() {
                start.end = end;
                if self.planning.plan(&run, frame, &start, &mut self.next) {
                    std::mem::swap(&mut self.window, &mut self.next);
                    self.commit();
                    return true;
                }
                // The next try ends where the path first turns, or has half the chords.
                let last = run.chord_at(end.min(self.planning.end()) - 1e-9, here);
                let cut = (here + 1..=last).find(|i| run.chords[*i].turn > CUT).map(|i| run.chords[i].s);
                let half = run.chords[usize::midpoint(here, last)].end();
                end = cut.filter(|s| *s < end - 1e-9).unwrap_or(half);
            }
        }
        let chord = run.chords[here];
        let counted = frame.counted(run.rotary);
        profile::drive(&run, frame, &counted, &chord, (at, chord.end()), &mut self.window);
        true
    }

    fn tolerance_mm(&self, block: &Block) -> f64 {
        let stated = block.path_tolerance_mm;
        if stated.is_nan() { self.context.path_tolerance_mm } else { stated }
    }

    /// Chooses until when the window is driven: to its end where that is a rest of the program, else to where it is fastest.
    fn commit(&mut self) {
        let window = &mut self.window;
        let whole_s = window.duration_s();
        let mut most = 0.0;
        let mut found = whole_s;
        if !window.whole {
            for piece in &window.pieces {
                let t = piece.end_s();
                let v = piece.velocity(piece.duration_s);
                let speed = v.iter().map(|v| v * v).sum::<f64>().sqrt();
                if (COMMIT.0 * whole_s..=COMMIT.1 * whole_s).contains(&t) && speed >= EQUAL * most {
                    most = speed.max(most);
                    found = t;
                }
            }
        }
        window.commit_s = found;
    }

    /// The next window, from the state where this one is left; where it is refused, or nothing more of the path is known,
    /// this one is driven on for a while.
    fn go_on(&mut self, now_s: f64) {
        let window = &self.window;
        let period_s = self.context.fine_period_s;
        self.before.clear();
        for n in (1..=BEFORE).rev() {
            let t = now_s - n as f64 * period_s;
            if t >= 0.0 {
                self.before.push(window.state(t)[0]);
            }
        }
        let state: State<L> = window.state(now_s);
        let s = window.along(now_s);
        let run = self.route.run(s, self.finished);
        let window_s = self.planning.tuning.window_s;
        let start = Start {
            state,
            s,
            resting: false,
            before: &self.before,
            end: run.end(),
            window_s,
            old: Some((&self.window, now_s)),
        };
        let known = run.end() <= self.window.end() + 1e-9;
        let closed = run.closed;
        if !known && self.planning.plan(&run, &self.frame, &start, &mut self.next) {
            std::mem::swap(&mut self.window, &mut self.next);
            self.driven_s = Some(0.0);
            self.emitter.begin_window();
            self.commit();
        } else {
            self.window.whole |= known && closed;
            self.drive_on(now_s);
        }
        self.route.forget(s);
    }

    /// Drives the window on for a while, near its end to its rest.
    fn drive_on(&mut self, now_s: f64) {
        let window = &mut self.window;
        let whole_s = window.duration_s();
        let later_s = now_s + LATER * whole_s;
        let place = window.pieces.partition_point(|piece| piece.end_s() < later_s);
        window.commit_s = window.pieces.get(place).map_or(whole_s, Piece::end_s);
        if window.commit_s > 0.97 * whole_s {
            window.commit_s = whole_s;
        }
    }
}

impl<const L: usize> AnyCore for Core<L> {
    fn has_room(&self, most_chords: usize) -> bool {
        let held_s = self.held_s - self.front_driven_s();
        let enough_s = HELD.0 * self.planning.tuning.window_s + HELD.1;
        let held = self.route.chord_count().max(self.route.items.len());
        self.route.items.is_empty() || held < most_chords && held_s < enough_s
    }

    fn check_path(&self, block: &Block, curve: Option<Curve<'_>>) -> Result<(), PluginError> {
        let tolerance_mm = self.tolerance_mm(block);
        flatten::check(&self.context.axes, &self.frame, (block, curve), tolerance_mm)
    }

    fn push(&mut self, block: &Block, curve: Option<Curve<'_>>) -> Result<(), PluginError> {
        self.finished = false;
        if block.kind == tandem_sdk::BlockKind::Dwell {
            self.route.push_dwell(block);
            return Ok(());
        }
        let tolerance_mm = self.tolerance_mm(block);
        self.flat.lay(&self.context.axes, &self.frame, (block, curve), tolerance_mm)?;
        self.held_s += self.route.push(block, &self.flat, &self.frame, self.context.max_feed_ratio, tolerance_mm);
        self.flat.forget();
        Ok(())
    }

    fn finish(&mut self) {
        self.finished = true;
    }

    fn emit(&mut self, left_s: f64, sink: &mut dyn SegmentSink) -> Result<Option<f64>, PluginError> {
        if let Some(time_s) = self.emitter.writer.emit_dwell(left_s, sink) {
            self.position = self.frame.lanes(&self.emitter.position);
            return Ok(Some(time_s));
        }
        let Some(driven_s) = self.driven_s else { return self.begin(sink) };
        if driven_s < self.window.commit_s {
            return Ok(Some(self.emit_motion(driven_s, left_s, sink)));
        }
        if self.window.commit_s >= self.window.duration_s() {
            let stopped = !self.window.whole;
            self.emit_rest(sink);
            self.planning.effort.stops += u64::from(stopped);
        } else {
            self.go_on(driven_s);
        }
        Ok(Some(0.0))
    }

    fn is_done(&self) -> bool {
        self.finished && self.route.items.is_empty() && self.driven_s.is_none() && !self.emitter.writer.is_dwelling()
    }

    fn reset(&mut self, position: &AxisVector) {
        self.route.clear();
        self.driven_s = None;
        self.finished = false;
        self.at = 0.0;
        self.held_s = 0.0;
        self.position = self.frame.lanes(position);
        self.emitter = Emitter::new(position);
    }

    fn effort(&self) -> Effort {
        self.planning.effort
    }
}
