//! Windows one after the other: what is driven, what is planned next, and what is done where a plan is refused.

use tandem_motion::blocks::{BlockId, report};
use tandem_motion::stream::{Blocks, Emitted, Next, Planned, Stream, Windows};
use tandem_motion::tube::Lanes;
use tandem_sdk::{AxisVector, Block, Curve, PlannerContext, PluginError, SegmentSink};

use crate::flatten::{self, Flat};
use crate::frame::Frame;
use crate::plan::{Effort, Planning};
use crate::profile;
use crate::route::{Item, Route};
use crate::span::Span;
use crate::tuning::{COMMIT, Tuning};
use crate::window::{Piece, Start, State, Window};

/// Speeds that count as equal when the place to leave is chosen.
const EQUAL: f64 = 0.995;
/// What a refused plan moves that place by, as a share of the window. Behind the
/// fastest place the window brakes for its rest, and what goes on from there has to build the speed up again: with twice as much one of
/// 64 machines beside each other comes to rest on the path of two-step-arcs, with this and half of it none.
const LATER: f64 = 0.05;
/// Positions before a window that its check looks at.
const BEFORE: usize = 16;
/// A turn by more than this, as the size of the change of direction, ends a window that is cut short.
const CUT: f64 = 0.25;
/// Time at the programmed feed that is held, in windows and beyond that, s.
const HELD: (f64, f64) = (1.2, 0.3);

/// The planner for machines of at most `L` axes. Rough loop; allocates while its memory grows to the size of a window.
#[derive(Debug)]
pub struct Core<const L: usize> {
    stream: Stream,
    ahead: PathAhead<L>,
}

/// The path ahead, and the window that is driven on it.
#[derive(Debug)]
pub struct PathAhead<const L: usize> {
    pub(crate) frame: Frame<L>,
    context: PlannerContext,
    pub(crate) route: Route<L>,
    planning: Planning<L>,
    pub(crate) window: Window<L>,
    next: Window<L>,
    flat: Flat<L>,
    before: Vec<Lanes<L>>,
    pub(crate) driven: DrivenPath,
    /// Path coordinate and position at rest.
    pub(crate) at: f64,
    pub(crate) position: Lanes<L>,
    /// Least time that the blocks held take, s.
    pub(crate) held_s: f64,
    span: Span,
}

/// The path coordinate of what was emitted.
#[derive(Debug, Default)]
pub struct DrivenPath {
    /// Length driven, mm.
    pub path_mm: f64,
    /// Path coordinate polynomial of the piece at `piece`, mm.
    pub(crate) path: [f64; 6],
    pub(crate) piece: Option<usize>,
}

impl DrivenPath {
    /// Another window begins.
    pub fn begin_window(&mut self) {
        self.piece = None;
    }
}

/// What the planner for any number of axes asks of one.
pub trait AnyCore: Send + std::fmt::Debug {
    /// Whether there is room for another block: fewer chords than that are held, and fewer blocks.
    fn has_room(&self, max_chords: usize) -> bool;
    /// Whether the path of a block can be laid.
    fn check_path(&self, block: &Block, curve: Option<Curve<'_>>) -> Result<(), PluginError>;
    /// Takes a block that was checked.
    fn push(&mut self, block: &Block, curve: Option<Curve<'_>>) -> Result<(), PluginError>;
    fn finish(&mut self);
    fn emit(&mut self, left_s: f64, sink: &mut dyn SegmentSink)
    -> Result<Option<f64>, PluginError>;
    fn is_done(&self) -> bool;
    fn reset(&mut self, position: &AxisVector);
    fn effort(&self) -> Effort;
}

impl<const L: usize> Core<L> {
    /// At rest.
    pub fn new(context: &PlannerContext, tuning: Tuning) -> Self {
        Self {
            stream: Stream::new(&context.position),
            ahead: PathAhead::new(context, tuning),
        }
    }
}

impl<const L: usize> PathAhead<L> {
    fn new(context: &PlannerContext, tuning: Tuning) -> Self {
        let frame = Frame::new(context);
        Self {
            frame,
            context: *context,
            route: Route::default(),
            planning: Planning::new(tuning),
            window: Window::new(),
            next: Window::new(),
            flat: Flat::default(),
            before: Vec::with_capacity(BEFORE),
            driven: DrivenPath::default(),
            at: 0.0,
            position: frame.lanes(&context.position),
            held_s: 0.0,
            span: Span::new(tuning.window_s(&frame)),
        }
    }

    /// A block too short to be a motion: it begins and ends.
    fn skip(&mut self, blocks: &mut Blocks, sink: &mut dyn SegmentSink) {
        if let Some(Item::Motion(queued)) = self.route.pop() {
            self.held_s -= queued.min_s;
            if !blocks.is_reported(&queued.block) {
                let index = queued.block.index;
                blocks.report(
                    &report(index, tandem_sdk::LimitedBy::Acceleration, [0.0; 3], 0.0),
                    sink,
                );
            }
            self.position = self.frame.lanes(&queued.block.end);
            blocks.rest(
                BlockId::from(&queued.block),
                &queued.block.end,
                self.driven.path_mm,
                sink,
            );
        }
    }

    /// The longest window from rest that passes; in the end one chord.
    fn longest_from_rest(&mut self, finished: bool) {
        self.route.begin_run(self.at);
        let run = self.route.run(self.at, finished);
        let frame = &self.frame;
        let at = self.at;
        let here = run.chord_at(at, 0);
        let mut start = Start {
            state: [self.position, [0.0; L], [0.0; L]],
            s: at,
            resting: true,
            before: &[],
            end: run.end(),
            window_s: self.span.now_s(),
            old: None,
        };
        let mut refused = 0;
        let single = run.chords.len() == here + 1;
        if !(single && run.closed) {
            let mut end = run.end();
            while end > run.chords[here].end() + 1e-9 || !single && end == run.end() {
                start.end = end;
                if self.planning.plan(&run, frame, &start, &mut self.next) {
                    std::mem::swap(&mut self.window, &mut self.next);
                    self.span.passed(refused, self.window.duration_s());
                    return;
                }
                refused += 1;
                // The next try ends where the path first turns, or has half the chords.
                let last = run.chord_at(end.min(self.planning.end()) - 1e-9, here);
                let cut = (here + 1..=last)
                    .find(|i| run.chords[*i].turn > CUT)
                    .map(|i| run.chords[i].s);
                let half = run.chords[usize::midpoint(here, last)].end();
                end = cut.filter(|s| *s < end - 1e-9).unwrap_or(half);
            }
        }
        let chord = run.chords[here];
        let counted = frame.counted(run.rotary);
        profile::drive(
            &run,
            frame,
            &counted,
            &chord,
            (at, chord.end()),
            &mut self.window,
        );
        self.span.passed(refused, self.window.duration_s());
    }

    /// Forgets everything: at rest at `position`.
    fn reset(&mut self, position: &AxisVector) {
        self.route.clear();
        self.at = 0.0;
        self.held_s = 0.0;
        self.span.restart();
        self.position = self.frame.lanes(position);
        self.driven = DrivenPath::default();
    }

    fn tolerance_mm(&self, block: &Block) -> f64 {
        let stated = block.path_tolerance_mm;
        if stated.is_nan() {
            self.context.path_tolerance_mm
        } else {
            stated
        }
    }

    /// Until when the window is driven, s: to its end where that is a rest of the program, else to where it is fastest.
    fn commit_s(&self) -> f64 {
        let window = &self.window;
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
        found
    }

    /// Until when the window is driven on where no other was found, s: for a while, near its end to its rest.
    fn later_s(&self, now_s: f64) -> f64 {
        let window = &self.window;
        let whole_s = window.duration_s();
        let later_s = now_s + LATER * whole_s;
        let place = window
            .pieces
            .partition_point(|piece| piece.end_s() < later_s);
        let commit_s = window.pieces.get(place).map_or(whole_s, Piece::end_s);
        if commit_s > 0.97 * whole_s {
            whole_s
        } else {
            commit_s
        }
    }
}

impl<const L: usize> Windows for PathAhead<L> {
    fn next(&mut self, blocks: &mut Blocks, sink: &mut dyn SegmentSink) -> Next {
        match self.route.items.front() {
            None => Next::Nothing,
            Some(Item::Dwell(block)) => {
                let block = *block;
                self.route.pop();
                self.position = self.frame.lanes(&block.end);
                Next::Dwell(block, self.driven.path_mm)
            }
            Some(Item::Motion(queued)) if queued.end <= self.at + 1e-12 => {
                self.skip(blocks, sink);
                Next::Again
            }
            Some(Item::Motion(_)) => Next::Path,
        }
    }

    fn plan_from_rest(&mut self, finished: bool) -> Result<f64, PluginError> {
        self.longest_from_rest(finished);
        self.driven.begin_window();
        Ok(self.commit_s())
    }

    /// The next window, from the state where this one is left; where it is refused, or nothing more of the path is known,
    /// this one is driven on for a while.
    fn plan_on(&mut self, now_s: f64, finished: bool) -> Planned {
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
        let run = self.route.run(s, finished);
        let start = Start {
            state,
            s,
            resting: false,
            before: &self.before,
            end: run.end(),
            window_s: self.span.now_s(),
            old: Some((&self.window, now_s)),
        };
        let known = run.end() <= self.window.end() + 1e-9;
        let closed = run.closed;
        let planned = if !known
            && self
                .planning
                .plan(&run, &self.frame, &start, &mut self.next)
        {
            std::mem::swap(&mut self.window, &mut self.next);
            self.span.passed(0, self.window.duration_s());
            self.driven.begin_window();
            Planned::NextWindow {
                commit_s: self.commit_s(),
            }
        } else {
            self.window.whole |= known && closed;
            Planned::SameWindow {
                commit_s: self.later_s(now_s),
            }
        };
        self.route.forget(s);
        planned
    }

    fn duration_s(&self) -> f64 {
        self.window.duration_s()
    }

    fn emit(
        &mut self,
        from_s: f64,
        commit_s: f64,
        left_s: f64,
        blocks: &mut Blocks,
        sink: &mut dyn SegmentSink,
    ) -> Emitted {
        self.emit_motion((from_s, commit_s), left_s, blocks, sink)
    }

    fn rest(&mut self, blocks: &mut Blocks, sink: &mut dyn SegmentSink) {
        self.planning.effort.stops += u64::from(!self.window.whole);
        self.emit_rest(blocks, sink);
    }
}

impl<const L: usize> AnyCore for Core<L> {
    fn has_room(&self, max_chords: usize) -> bool {
        let Self { stream, ahead } = self;
        let driven_s = stream
            .driven_s()
            .map_or(0.0, |driven_s| ahead.front_driven_s(driven_s));
        let enough_s = HELD.0 * ahead.span.asked_s() + HELD.1;
        let held = ahead.route.chord_count().max(ahead.route.items.len());
        ahead.route.items.is_empty() || held < max_chords && ahead.held_s - driven_s < enough_s
    }

    fn check_path(&self, block: &Block, curve: Option<Curve<'_>>) -> Result<(), PluginError> {
        let ahead = &self.ahead;
        let tolerance_mm = ahead.tolerance_mm(block);
        flatten::check(
            &ahead.context.axes,
            &ahead.frame,
            (block, curve),
            tolerance_mm,
        )
    }

    fn push(&mut self, block: &Block, curve: Option<Curve<'_>>) -> Result<(), PluginError> {
        self.stream.accepted();
        let ahead = &mut self.ahead;
        if block.kind == tandem_sdk::BlockKind::Dwell {
            ahead.route.push_dwell(block);
            return Ok(());
        }
        let tolerance_mm = ahead.tolerance_mm(block);
        ahead.flat.lay(
            &ahead.context.axes,
            &ahead.frame,
            (block, curve),
            tolerance_mm,
        )?;
        let feed_ratio = ahead.context.max_feed_ratio;
        ahead.held_s +=
            ahead
                .route
                .push(block, &ahead.flat, &ahead.frame, feed_ratio, tolerance_mm);
        ahead.flat.forget();
        Ok(())
    }

    fn finish(&mut self) {
        self.stream.finish();
    }

    fn emit(
        &mut self,
        left_s: f64,
        sink: &mut dyn SegmentSink,
    ) -> Result<Option<f64>, PluginError> {
        self.stream.emit(&mut self.ahead, left_s, sink)
    }

    fn is_done(&self) -> bool {
        self.stream.is_done(self.ahead.route.items.is_empty())
    }

    fn reset(&mut self, position: &AxisVector) {
        self.stream = Stream::new(position);
        self.ahead.reset(position);
    }

    fn effort(&self) -> Effort {
        self.ahead.planning.effort
    }
}
