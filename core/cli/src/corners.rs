//! The time constant and the corner error along the path, for the report.

use tandem_report::Signal;
use tandem_rings::Sample;
use tandem_sdk::{AxisVector, Block, BlockReport};

/// One block of a planner with time constants.
struct Corner {
    block: u64,
    /// The corner where it starts.
    vertex: AxisVector,
    time_constant_ms: f64,
    error_um: f64,
}

/// Collects them: about 90 bytes a block, 12 a sample. Empty for planners that know no time constant.
#[derive(Default)]
pub struct Corners {
    list: Vec<Corner>,
    /// The place in `list` of the block that each sample belongs to; `u32::MAX` where it is none of them.
    places: Vec<u32>,
    at: usize,
    last: Option<AxisVector>,
}

impl Corners {
    /// A block is planned for good.
    pub fn block(&mut self, block: &Block, report: &BlockReport) {
        if report.time_constant_s.is_nan() || block.length_mm == 0.0 {
            return;
        }
        let time_constant_ms = report.time_constant_s * 1e3;
        self.list.push(Corner {
            block: block.index,
            vertex: block.start,
            time_constant_ms,
            error_um: f64::INFINITY,
        });
    }

    /// A sample was sent. Blocks are planned before their samples come.
    pub fn sample(&mut self, sample: &Sample) {
        while self.at + 1 < self.list.len() && self.list[self.at + 1].block <= sample.block {
            self.at += 1;
        }
        let last = self.last.replace(sample.command).unwrap_or(sample.command);
        let Some(corner) = self
            .list
            .get_mut(self.at)
            .filter(|corner| corner.block == sample.block)
        else {
            self.places.push(u32::MAX);
            return;
        };
        corner.error_um = corner
            .error_um
            .min(1e3 * distance_mm(&corner.vertex, &last, &sample.command));
        self.places.push(self.at as u32);
    }

    /// The curves, a value a sample; none where there is nothing to show.
    pub fn signals(self) -> Vec<Signal> {
        if self.list.is_empty() {
            return vec![];
        }
        let curve = |name: &str, unit: &str, of: fn(&Corner) -> f64| Signal {
            name: name.to_string(),
            unit: unit.to_string(),
            values: self
                .places
                .iter()
                .map(|place| self.list.get(*place as usize).map_or(f64::NAN, of))
                .collect(),
        };
        vec![
            curve("time constant where the block ends", "ms", |corner| {
                corner.time_constant_ms
            }),
            curve(
                "error of the corner where the block starts",
                "µm",
                |corner| corner.error_um,
            ),
        ]
    }
}

/// Distance of `point` from the chord between two samples, mm.
fn distance_mm(point: &AxisVector, from: &AxisVector, to: &AxisVector) -> f64 {
    let dot =
        |a: &AxisVector, b: &AxisVector| -> f64 { a.0.iter().zip(&b.0).map(|(x, y)| x * y).sum() };
    let (chord, reach) = (*to - *from, *point - *from);
    let square = dot(&chord, &chord);
    let along = if square > 0.0 {
        (dot(&reach, &chord) / square).clamp(0.0, 1.0)
    } else {
        0.0
    };
    let off = reach - chord * along;
    dot(&off, &off).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distance_is_to_the_chord_and_its_ends() {
        let at = |x: f64, y: f64| AxisVector::from_slice(&[x, y]);
        assert_eq!(
            distance_mm(&at(1.0, 2.0), &at(0.0, 0.0), &at(3.0, 0.0)),
            2.0
        );
        assert_eq!(
            distance_mm(&at(-3.0, 4.0), &at(0.0, 0.0), &at(3.0, 0.0)),
            5.0
        );
        assert_eq!(
            distance_mm(&at(0.0, 4.0), &at(0.0, 0.0), &at(0.0, 0.0)),
            4.0
        );
    }

    #[test]
    fn a_planner_without_time_constants_shows_nothing() {
        assert!(Corners::default().signals().is_empty());
    }
}
