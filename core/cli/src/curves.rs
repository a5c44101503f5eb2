//! Curvature and chord error along NURBS curves, for the report.

use tandem_machine::Machine;
use tandem_recorder::CurveWatch;
use tandem_report::Signal;
use tandem_rings::Sample;
use tandem_sdk::{Block, Curve};

/// Collects it: 24 bytes a sample, beside the curves. Empty for programs without curves.
pub struct Curves {
    watch: CurveWatch,
    /// What the planner promises, mm; infinite where it promises nothing.
    chord_error_mm: f64,
    seen: bool,
    curvature_per_mm: Vec<f64>,
    chord_error_um: Vec<f64>,
    chord_share: Vec<f64>,
}

impl Curves {
    /// Nothing seen yet.
    pub fn new(machine: &Machine) -> Self {
        let options: toml::Table = machine.planner.options.parse().unwrap_or_default();
        let stated = options
            .get("chord_error_um")
            .and_then(|v| v.as_float().or(v.as_integer().map(|n| n as f64)));
        let promises = machine.planner.plugin == "nurbs";
        let error_um = stated.unwrap_or_else(|| tandem_nurbs::Options::default().chord_error_um);
        Self {
            watch: CurveWatch::new(machine.axes),
            chord_error_mm: if promises {
                error_um / 1e3
            } else {
                f64::INFINITY
            },
            seen: false,
            curvature_per_mm: vec![],
            chord_error_um: vec![],
            chord_share: vec![],
        }
    }

    /// A block is planned for good.
    pub fn block(&mut self, block: &Block, curve: Option<Curve<'_>>) {
        self.watch.block(block, curve);
    }

    /// A sample was sent.
    pub fn sample(&mut self, sample: &Sample) {
        let on = self.watch.sample(sample);
        self.seen |= on.is_some();
        self.curvature_per_mm
            .push(on.map_or(f64::NAN, |on| on.curvature_per_mm));
        self.chord_error_um
            .push(on.map_or(f64::NAN, |on| 1e3 * on.chord_error_mm));
        // The error goes with the square of the speed.
        self.chord_share.push(on.map_or(f64::NAN, |on| {
            (on.chord_error_mm / self.chord_error_mm).sqrt()
        }));
    }

    /// The curves, a value a sample, and the share of the speed that the chord error allows; nothing where there is
    /// nothing to show.
    pub fn signals(self) -> (Vec<Signal>, Option<Vec<f64>>) {
        if !self.seen {
            return (vec![], None);
        }
        let signal = |name: &str, unit: &str, values: Vec<f64>| Signal {
            name: name.into(),
            unit: unit.into(),
            values,
        };
        let signals = vec![
            signal("curvature of the curve", "1/mm", self.curvature_per_mm),
            signal("chord error on the curve", "µm", self.chord_error_um),
        ];
        (signals, Some(self.chord_share))
    }
}
