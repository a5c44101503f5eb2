//! What the judge found.

mod display;

/// Pass, fail, or neither.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Outcome {
    /// Everything asked for was judged and kept.
    #[default]
    Pass,
    /// Something was broken.
    Fail,
    /// Nothing was found broken, but not everything asked for could be judged.
    NotJudged {
        /// Why not.
        reason: String,
    },
}

/// The judgement of one trace.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Verdict {
    /// The outcome. A broken limit is a failure even where the program could not be read.
    pub outcome: Outcome,
    /// What was broken, in the order of time.
    pub findings: Vec<Finding>,
    /// The reason why a part could not be judged, whatever the outcome.
    pub not_judged: Option<String>,
    /// The greatest values met, within limits or not.
    pub maxima: Maxima,
}

/// What a finding is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// A value of the trace is no finite number.
    NotFinite,
    /// Two rows are not one fine period apart; value and limit in s.
    Period,
    /// The first sample is not where the machine stands before the run.
    StartPoint,
    /// A sample lies beyond the travel.
    Travel,
    /// An axis is too fast.
    Velocity,
    /// An axis accelerates too hard, where no speed step is allowed.
    Acceleration,
    /// An axis changes its speed by more than acceleration and allowed speed step give together.
    SpeedStep,
    /// The acceleration of an axis changes too fast.
    Jerk,
    /// The path speed is above the programmed feed, or an axis above its rapid speed in a rapid.
    Feed,
    /// A sample is off the programmed path, or out of the order of travel.
    PathDeviation,
    /// A programmed vertex is not met; the line is that of the block that ends there.
    VertexMissed,
    /// The rest of the path was not travelled; value is its length.
    NotCovered,
    /// The last sample is not the programmed end.
    EndPoint,
}

/// One thing that was broken. Units are mm and s, degrees for a rotary axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Finding {
    /// What is broken.
    pub kind: Kind,
    /// Index of the sample, from 0.
    pub sample: usize,
    /// Its time, s.
    pub t_s: f64,
    /// Program line: the trace's, or the vertex's.
    pub line: u32,
    /// Index of the axis in [`crate::LETTERS`], where one axis is meant.
    pub axis: Option<usize>,
    /// The joint that is meant, where it is no axis.
    pub joint: Option<String>,
    /// The value met.
    pub value: f64,
    /// The value allowed.
    pub limit: f64,
}

/// The greatest values met.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Maxima {
    /// Per axis, in the order of the machine.
    pub axes: Vec<AxisMaxima>,
    /// Per joint that has limits of its own.
    pub joints: Vec<(String, AxisMaxima)>,
    /// Path speed over programmed feed.
    pub feed_ratio: f64,
    /// Distance of a sample from the path, mm.
    pub sample_deviation_mm: f64,
    /// Distance of a vertex from the samples joined by chords, mm.
    pub vertex_deviation_mm: f64,
    /// Distance of an exact-stop position from the nearest sample, mm.
    pub exact_stop_error_mm: f64,
    /// Distance of the last sample from the programmed end, worst axis, mm or deg.
    pub end_error_mm: f64,
}

/// The greatest finite differences of one axis; degrees instead of mm for a rotary axis.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AxisMaxima {
    /// Index of the axis in [`crate::LETTERS`].
    pub axis: usize,
    /// Speed, mm/s.
    pub velocity_mm_per_s: f64,
    /// Acceleration as the plain second difference, mm/s²; a speed step counts in full.
    pub acceleration_mm_per_s2: f64,
    /// Speed change beyond what the acceleration limit gives, over any window, mm/s.
    pub speed_step_mm_per_s: f64,
    /// Jerk as the plain third difference, mm/s³.
    pub jerk_mm_per_s3: f64,
}

impl Verdict {
    /// Whether everything asked for was judged and kept.
    pub fn passed(&self) -> bool {
        self.outcome == Outcome::Pass
    }

    /// The kinds of finding, each once.
    pub fn kinds(&self) -> Vec<Kind> {
        let mut kinds: Vec<Kind> = self.findings.iter().map(|finding| finding.kind).collect();
        kinds.sort_unstable();
        kinds.dedup();
        kinds
    }

    pub(crate) fn settle(mut self) -> Self {
        self.findings
            .sort_by_key(|finding| (finding.sample, finding.kind));
        self.outcome = match &self.not_judged {
            _ if !self.findings.is_empty() => Outcome::Fail,
            Some(reason) => Outcome::NotJudged {
                reason: reason.clone(),
            },
            None => Outcome::Pass,
        };
        self
    }
}
