//! The planner for any number of axes.

use tandem_motion::blocks;
use tandem_sdk::{
    Accepted, Advanced, AxisVector, Block, BlockKind, Curve, Planner, PlannerContext,
    PlannerDescription, PluginError, SegmentSink,
};

use crate::core::{AnyCore, Core};
use crate::options::Options;
use crate::plan::Effort;

/// Most straight pieces that are held.
pub const BUFFER_CHORDS: usize = 65_536;
/// Time that is told from none, s.
const MIN_S: f64 = 1e-9;
/// Least path tolerance of a block that does not end at rest, mm.
const MIN_TOLERANCE_MM: f64 = 1e-4;

/// Rough loop. A block allocates when it is accepted, a window where one is longer than any before.
#[derive(Debug)]
pub struct SmoothPlanner {
    context: PlannerContext,
    core: Box<dyn AnyCore>,
}

impl SmoothPlanner {
    /// A planner at rest. Corners are rounded axis by axis, so joints that are sums of axes are kept by narrower limits of
    /// the axes ([`PlannerContext::axis_by_axis`]).
    ///
    /// # Errors
    /// A machine with a limit that is no positive number.
    pub fn new(options: &Options, context: &PlannerContext) -> Result<Self, PluginError> {
        let axis_by_axis = context.axis_by_axis();
        let axes = axis_by_axis.limits.axes();
        let sound = |value: f64| value > 0.0 && value.is_finite();
        let values = axes
            .iter()
            .flat_map(|a| [a.feed_mm_per_s, a.rapid_mm_per_s, a.acceleration_mm_per_s2]);
        if !values.into_iter().all(sound) {
            return Err(PluginError::fixed(
                "smooth needs finite speed and acceleration limits of all axes",
            ));
        }
        if !axes.iter().all(|axis| sound(axis.jerk_mm_per_s3)) {
            return Err(PluginError::fixed(
                "smooth needs a jerk limit (max_jerk) of all axes",
            ));
        }
        let tuning = options.tuning();
        let core: Box<dyn AnyCore> = if axes.len() <= 4 {
            Box::new(Core::<4>::new(context, tuning))
        } else {
            Box::new(Core::<8>::new(context, tuning))
        };
        Ok(Self {
            context: *context,
            core,
        })
    }

    /// What was planned so far.
    pub fn effort(&self) -> Effort {
        self.core.effort()
    }
}

impl Planner for SmoothPlanner {
    fn describe(&self) -> PlannerDescription {
        PlannerDescription {
            order: 3,
            ..PlannerDescription::order_2()
        }
    }

    fn check(&self, block: &Block, curve: Option<Curve<'_>>) -> Result<(), PluginError> {
        self.check_facts(block)?;
        self.core.check_path(block, curve)
    }

    fn accept(&mut self, block: &Block, curve: Option<Curve<'_>>) -> Result<Accepted, PluginError> {
        if !self.core.has_room(BUFFER_CHORDS) {
            return Ok(Accepted::Full);
        }
        self.check_facts(block)?;
        self.core.push(block, curve)?;
        Ok(Accepted::Accepted)
    }

    fn finish(&mut self) {
        self.core.finish();
    }

    fn advance(
        &mut self,
        duration_s: f64,
        sink: &mut dyn SegmentSink,
    ) -> Result<Advanced, PluginError> {
        let mut emitted_s = 0.0;
        // What rounding leaves of the duration is no time to rest or move.
        while duration_s - emitted_s > MIN_S {
            match self.core.emit(duration_s - emitted_s, sink)? {
                Some(part_s) => emitted_s += part_s,
                None => break,
            }
        }
        Ok(Advanced {
            duration_s: emitted_s,
            done: u32::from(self.core.is_done()),
        })
    }

    fn reset(&mut self, position: &AxisVector) {
        self.core.reset(position);
        self.context.position = *position;
    }
}

impl SmoothPlanner {
    /// Checks what a block says of itself, without a look at its path.
    fn check_facts(&self, block: &Block) -> Result<(), PluginError> {
        blocks::check(block, &self.context.axes)?;
        let stated = block.path_tolerance_mm;
        let tolerance_mm = if stated.is_nan() {
            self.context.path_tolerance_mm
        } else {
            stated
        };
        match block.kind {
            BlockKind::Dwell => Ok(()),
            BlockKind::Rapid | BlockKind::Line if block.ends_at_rest() => Ok(()),
            _ if tolerance_mm.is_nan() || tolerance_mm < MIN_TOLERANCE_MM => {
                Err(PluginError::fixed(
                    "smooth needs a path tolerance of 0.0001 mm or more (G64 P); G61 drives lines exactly",
                ))
            }
            _ => Ok(()),
        }
    }
}
