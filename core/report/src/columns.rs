//! From the samples of a report to the columns of the page.

use std::io;

use crate::binding::Binding;
use crate::differences::steps_s;
use crate::encode::Column;
use crate::findings::Findings;
use crate::judge::AxisMotion;
use crate::model::Report;
use crate::thin::Thinning;

/// What is worked out of a report before anything is written.
pub(crate) struct Derived {
    /// One per axis.
    pub motions: Vec<AxisMotion>,
    /// Command less feedback, one per axis; empty where there is no feedback.
    pub following: Vec<Vec<f64>>,
    /// 1 where a sample lies outside the path tolerance.
    pub off_path: Vec<u8>,
    /// What keeps the motion from being faster.
    pub binding: Binding,
    /// What exceeds a limit.
    pub findings: Findings,
    /// Middle of each axis' range: positions are embedded relative to it, so that single precision suffices.
    pub centres: Vec<f64>,
    /// How the columns are thinned.
    pub thinning: Thinning,
}

impl Derived {
    /// Differentiates and judges all samples; thins nothing yet.
    pub(crate) fn of(report: &Report, cap: usize) -> io::Result<Self> {
        check(report)?;
        let samples = &report.samples;
        let steps = steps_s(&samples.t_s, report.fine_period_s);
        let axes = report.axes.iter().zip(&samples.command);
        let motions: Vec<_> = axes
            .map(|(axis, position)| AxisMotion::of(axis, position, &steps, report.fine_period_s))
            .collect();
        let off_path = off_path(report);
        Ok(Self {
            binding: Binding::of(report, &motions),
            findings: Findings::of(report, &motions, &off_path),
            following: (0..report.axes.len())
                .map(|axis| following(report, axis))
                .collect(),
            centres: samples
                .command
                .iter()
                .map(|position| centre(position))
                .collect(),
            thinning: Thinning::new(samples.t_s.len(), cap),
            motions,
            off_path,
        })
    }

    /// The columns of the page, each made only when it is written.
    pub(crate) fn columns<'a>(&'a self, report: &'a Report) -> impl Iterator<Item = Column> + 'a {
        let axes = (0..report.axes.len()).flat_map(|axis| self.axis_columns(report, axis));
        let signals = report.signals.iter().enumerate();
        let signals = signals.map(|(i, signal)| self.curve(format!("signal{i}"), &signal.values));
        self.shared_columns(report)
            .into_iter()
            .chain(axes)
            .chain(signals)
            .flatten()
    }

    fn shared_columns(&self, report: &Report) -> Vec<Option<Column>> {
        let samples = &report.samples;
        vec![
            Some(Column::f64("t", &self.thinning.picks(&samples.t_s))),
            Some(Column::u32("line", &self.thinning.picks(&samples.line))),
            self.curve("feed", &samples.feed_mm_s),
            self.curve("programmed", &samples.programmed_feed_mm_s),
            self.curve("sigma", &samples.sigma),
            samples
                .deviation_mm
                .as_ref()
                .and_then(|values| self.curve("deviation", values)),
            Some(Column::u8(
                "binding",
                self.thinning.marks(&self.binding.marks),
            )),
            (!self.off_path.is_empty())
                .then(|| Column::u8("offpath", self.thinning.marks(&self.off_path))),
        ]
    }

    fn axis_columns(&self, report: &Report, axis: usize) -> Vec<Option<Column>> {
        let motion = &self.motions[axis];
        let mut position = self.thinning.picks(&report.samples.command[axis]);
        for value in &mut position {
            *value -= self.centres[axis];
        }
        vec![
            Some(Column::f32(format!("position{axis}"), &position)),
            self.curve(format!("velocity{axis}"), &motion.velocity),
            self.curve(format!("acceleration{axis}"), &motion.acceleration),
            self.curve(format!("jerk{axis}"), &motion.jerk),
            self.curve(format!("following{axis}"), &self.following[axis]),
            Some(Column::u8(
                format!("marks{axis}"),
                self.thinning.marks(&motion.marks),
            )),
        ]
    }

    fn curve(&self, name: impl Into<String>, values: &[f64]) -> Option<Column> {
        (!values.is_empty()).then(|| Column::f32(name, &self.thinning.extremes(values)))
    }
}

fn off_path(report: &Report) -> Vec<u8> {
    let off =
        |(i, d): (usize, &f64)| u8::from(report.tolerance_at_mm(i).is_some_and(|limit| *d > limit));
    match &report.samples.deviation_mm {
        Some(values) if report.path_tolerance_mm.is_some() => {
            values.iter().enumerate().map(off).collect()
        }
        _ => Vec::new(),
    }
}

fn following(report: &Report, axis: usize) -> Vec<f64> {
    let feedback = report
        .samples
        .feedback
        .get(axis)
        .map_or(&[][..], Vec::as_slice);
    report.samples.command[axis]
        .iter()
        .zip(feedback)
        .map(|(command, actual)| command - actual)
        .collect()
}

fn centre(position: &[f64]) -> f64 {
    let low = position.iter().copied().fold(f64::INFINITY, f64::min);
    let high = position.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if position.is_empty() {
        0.0
    } else {
        f64::midpoint(low, high)
    }
}

/// Refuses what cannot be drawn truthfully.
fn check(report: &Report) -> io::Result<()> {
    let samples = &report.samples;
    let n = samples.t_s.len();
    if report.fine_period_s.is_nan() || report.fine_period_s <= 0.0 {
        return refuse(format!(
            "fine_period_s is {}, not a period",
            report.fine_period_s
        ));
    }
    if samples.command.len() != report.axes.len() {
        return refuse(format!(
            "{} command columns for {} axes",
            samples.command.len(),
            report.axes.len()
        ));
    }
    let needed = samples
        .command
        .iter()
        .chain([&samples.feed_mm_s])
        .chain(report.signals.iter().map(|s| &s.values));
    let optional = samples
        .feedback
        .iter()
        .chain([&samples.sigma, &samples.programmed_feed_mm_s]);
    let optional = optional.chain(&samples.chord_share);
    let optional = optional.filter(|column| !column.is_empty());
    let lengths = needed
        .chain(optional)
        .chain(&samples.deviation_mm)
        .chain(&samples.tolerance_mm)
        .map(Vec::len);
    match lengths
        .chain([samples.line.len()])
        .find(|&length| length != n)
    {
        Some(length) => refuse(format!("a column has {length} samples, t_s has {n}")),
        None => Ok(()),
    }
}

fn refuse<T>(message: String) -> io::Result<T> {
    Err(io::Error::new(io::ErrorKind::InvalidInput, message))
}
