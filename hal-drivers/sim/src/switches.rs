//! The simulated switches on the digital inputs: their edges, caught where they are, and their bounce.

use tandem_random::Random;
use tandem_sdk::{Arm, AxisVector, Latch, MAX_AXES, MAX_LATCHES};

use crate::options::Options;
use crate::shape::{Shape, edge, is_on};

/// One digital input with the switches on it.
#[derive(Clone, Debug, PartialEq)]
struct Line {
    input: u32,
    shapes: Vec<Shape>,
    bounce_periods: u32,
    on: bool,
    /// Periods for which the contact still bounces.
    bouncing: u32,
}

/// All inputs. What is caught in a period is reported in that period only.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Switches {
    lines: Vec<Line>,
    latching: bool,
    /// Bit per joint whose drive catches its position.
    catching: u32,
    random: Random,
}

impl Switches {
    /// The inputs of checked options. Host; allocates.
    pub fn new(options: &Options) -> Self {
        let mut lines: Vec<Line> = Vec::new();
        for switch in &options.switches {
            let Some(shape) = switch.shape() else {
                continue;
            };
            let found = lines.iter().position(|line| line.input == switch.input);
            let index = found.unwrap_or_else(|| {
                let (input, shapes) = (switch.input, Vec::new());
                lines.push(Line {
                    input,
                    shapes,
                    bounce_periods: 0,
                    on: false,
                    bouncing: 0,
                });
                lines.len() - 1
            });
            lines[index].shapes.push(shape);
            lines[index].bounce_periods = lines[index].bounce_periods.max(switch.bounce_periods);
        }
        let catching = options
            .latch_joints
            .iter()
            .fold(0, |mask, joint| mask | 1 << joint);
        let catching = if options.latch_joints.is_empty() {
            u32::MAX
        } else {
            catching
        };
        Self {
            lines,
            latching: options.latches,
            catching,
            random: Random::new(options.seed),
        }
    }

    /// The machine stands at `at` and has not moved: nothing bounces.
    pub fn start(&mut self, at: &AxisVector) {
        for line in &mut self.lines {
            (line.on, line.bouncing) = (is_on(line.shapes.iter(), at), 0);
        }
    }

    /// Whether no input has a switch: all stay 0.
    pub fn are_none(&self) -> bool {
        self.lines.is_empty()
    }

    /// The joints went from one position to the other in a period of `period_s`: the inputs. `latches`, empty before, take the
    /// positions caught at the edge that is `armed`. Fine loop.
    pub fn step(
        &mut self,
        [from, to]: [&AxisVector; 2],
        armed: Arm,
        period_s: f64,
        latches: &mut [Latch; MAX_LATCHES],
    ) -> u64 {
        let mut inputs = 0;
        for line in &mut self.lines {
            let shapes = &line.shapes;
            let on = is_on(shapes.iter(), to);
            if on != line.on {
                (line.on, line.bouncing) = (on, line.bounce_periods);
                let came = Arm {
                    input: line.input,
                    edge: if on { 1 } else { 2 },
                };
                if self.latching && came == armed {
                    let (position, share) = edge(from, to, |at| is_on(shapes.iter(), at));
                    latches[0] = caught(came, self.catching, position, (1.0 - share) * period_s);
                }
            }
            let shown = if line.bouncing > 0 {
                self.random.once_in(2)
            } else {
                line.on
            };
            line.bouncing = line.bouncing.saturating_sub(1);
            inputs |= u64::from(shown) << line.input;
        }
        inputs
    }
}

/// What the drives of `joints` have caught. What the others write there is not to be read, so it is no place.
fn caught(edge: Arm, joints: u32, mut position: AxisVector, before_s: f64) -> Latch {
    for joint in (0..MAX_AXES).filter(|joint| joints >> joint & 1 == 0) {
        position[joint] = 0.0;
    }
    Latch {
        input: edge.input,
        edge: edge.edge,
        joints,
        before_s,
        position,
    }
}
