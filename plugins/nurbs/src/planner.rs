//! The planner: its form, and what all forms have in common.

use tandem_motion::blocks;
use tandem_sdk::{
    Accepted, Advanced, Axes, AxisVector, Block, BlockKind, Curve, Planner, PlannerContext,
    PlannerDescription, PluginError, SegmentSink,
};

use crate::baseline::Baseline;
use crate::course::{Course, curve_of};
use crate::options::{FormName, Options};
use crate::scan::Scan;
use crate::stream::Streamer;
use crate::windowed::Windowed;

/// Most blocks that wait to be driven.
pub const BUFFER_BLOCKS: usize = 64;

/// Rough loop. A block allocates when it is accepted; so do `scan` and `windowed` where a window is longer than any before.
#[derive(Debug)]
pub struct NurbsPlanner {
    context: PlannerContext,
    form: Form,
}

#[derive(Debug)]
enum Form {
    Adaptive(Box<Baseline>),
    Windowed(Box<Streamer<Windowed>>),
    Scan(Box<Streamer<Scan>>),
}

impl NurbsPlanner {
    /// A planner at rest.
    ///
    /// # Errors
    /// A machine with a speed or acceleration limit, except for the form `adaptive` also a jerk limit, that is no positive
    /// number.
    pub fn new(options: &Options, context: &PlannerContext) -> Result<Self, PluginError> {
        let axes = context.limits.axes();
        let sound = |value: f64| value > 0.0 && value.is_finite();
        let values = axes
            .iter()
            .flat_map(|a| [a.feed_mm_per_s, a.rapid_mm_per_s, a.acceleration_mm_per_s2]);
        if !values.into_iter().all(sound) {
            return Err(PluginError::fixed(
                "nurbs needs finite speed and acceleration limits of all axes",
            ));
        }
        if options.form != FormName::Adaptive && !axes.iter().all(|axis| sound(axis.jerk_mm_per_s3))
        {
            return Err(PluginError::fixed(
                "nurbs needs a jerk limit (max_jerk) of all axes, except with form = \"adaptive\"",
            ));
        }
        let chord_error_mm = options.chord_error_um / 1000.0;
        let form = match options.form {
            FormName::Adaptive => Form::Adaptive(Box::new(Baseline::new(context, chord_error_mm))),
            FormName::Windowed => Form::Windowed(Box::new(Streamer::new(context, chord_error_mm))),
            FormName::Scan => Form::Scan(Box::new(Streamer::new(context, chord_error_mm))),
        };
        Ok(Self {
            context: *context,
            form,
        })
    }

    fn emit(
        &mut self,
        left_s: f64,
        sink: &mut dyn SegmentSink,
    ) -> Result<Option<f64>, PluginError> {
        match &mut self.form {
            Form::Adaptive(form) => Ok(form.emit(left_s, sink)),
            Form::Windowed(form) => form.emit(left_s, sink),
            Form::Scan(form) => form.emit(left_s, sink),
        }
    }
}

/// Whether the curve of a block can be driven by its length.
fn check_curve(axes: &Axes, curve: Option<Curve<'_>>) -> Result<(), PluginError> {
    let curve = curve_of(axes, curve).map_err(|error| PluginError::new(error.to_string()))?;
    match curve.turns_alone() {
        None => Ok(()),
        Some(knot) => Err(PluginError::new(format!(
            "at the knot {knot} of this curve rotary axes move and no other: nurbs drives curves by their length, which \
             stands still there; planner smooth drives it in chords"
        ))),
    }
}

impl Planner for NurbsPlanner {
    fn describe(&self) -> PlannerDescription {
        match self.form {
            Form::Adaptive(_) => PlannerDescription {
                breaks_limits: 1,
                ..PlannerDescription::order_2()
            },
            Form::Windowed(_) | Form::Scan(_) => PlannerDescription {
                order: 3,
                ..PlannerDescription::order_2()
            },
        }
    }

    fn check(&self, block: &Block, curve: Option<Curve<'_>>) -> Result<(), PluginError> {
        blocks::check(block, &self.context.axes)?;
        if block.kind == BlockKind::Nurbs {
            check_curve(&self.context.axes, curve)
        } else {
            Ok(())
        }
    }

    fn accept(&mut self, block: &Block, curve: Option<Curve<'_>>) -> Result<Accepted, PluginError> {
        let waiting = match &self.form {
            Form::Adaptive(form) => form.blocks(),
            Form::Windowed(form) => form.blocks(),
            Form::Scan(form) => form.blocks(),
        };
        if waiting >= BUFFER_BLOCKS {
            return Ok(Accepted::Full);
        }
        self.check(block, curve)?;
        let course = Course::new(&self.context, block, curve)
            .map_err(|error| PluginError::new(error.to_string()))?;
        match &mut self.form {
            Form::Adaptive(form) => form.accept(block, course),
            Form::Windowed(form) => form.accept(block, course),
            Form::Scan(form) => form.accept(block, course),
        }
        Ok(Accepted::Accepted)
    }

    fn finish(&mut self) {
        match &mut self.form {
            Form::Adaptive(form) => form.finish(),
            Form::Windowed(form) => form.finish(),
            Form::Scan(form) => form.finish(),
        }
    }

    fn advance(
        &mut self,
        duration_s: f64,
        sink: &mut dyn SegmentSink,
    ) -> Result<Advanced, PluginError> {
        let mut emitted_s = 0.0;
        while emitted_s < duration_s {
            match self.emit(duration_s - emitted_s, sink)? {
                Some(part_s) => emitted_s += part_s,
                None => break,
            }
        }
        let done = match &self.form {
            Form::Adaptive(form) => form.is_done(),
            Form::Windowed(form) => form.is_done(),
            Form::Scan(form) => form.is_done(),
        };
        Ok(Advanced {
            duration_s: emitted_s,
            done: u32::from(done),
        })
    }

    fn reset(&mut self, position: &AxisVector) {
        match &mut self.form {
            Form::Adaptive(form) => form.reset(position),
            Form::Windowed(form) => form.reset(position),
            Form::Scan(form) => form.reset(position),
        }
    }
}
