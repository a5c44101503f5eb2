//! What was judged, and what was found.

use std::fmt;

use tandem_sdk::Plugin;

use crate::timing::Timing;

/// A promise that the plugin does not keep.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Finding {
    /// Which check found it.
    pub check: &'static str,
    /// What is wrong, and where.
    pub words: String,
}

/// Most findings of one check; what is wrong everywhere is said once.
const MAX_FINDINGS: usize = 5;

/// The verdict on one plugin.
#[derive(Clone, Debug)]
pub struct Report {
    plugin: Plugin,
    seed: u64,
    judged: Vec<&'static str>,
    skipped: Vec<(&'static str, String)>,
    findings: Vec<Finding>,
    timings: Vec<Timing>,
}

impl Report {
    /// An empty report.
    pub(crate) fn new(plugin: Plugin, seed: u64) -> Self {
        Self {
            plugin,
            seed,
            judged: vec![],
            skipped: vec![],
            findings: vec![],
            timings: vec![],
        }
    }

    pub(crate) fn judged(&mut self, check: &'static str) {
        if !self.judged.contains(&check) {
            self.judged.push(check);
        }
    }

    pub(crate) fn skip(&mut self, check: &'static str, why: impl Into<String>) {
        if self.skipped.iter().all(|(skipped, _)| *skipped != check) {
            self.skipped.push((check, why.into()));
        }
    }

    pub(crate) fn find(&mut self, check: &'static str, words: String) {
        self.judged(check);
        if self
            .findings
            .iter()
            .filter(|finding| finding.check == check)
            .count()
            < MAX_FINDINGS
        {
            self.findings.push(Finding { check, words });
        }
    }

    pub(crate) fn time(&mut self, timings: impl IntoIterator<Item = Timing>) {
        self.timings.extend(timings);
    }

    /// What is wrong; empty for a plugin that conforms.
    pub fn findings(&self) -> &[Finding] {
        &self.findings
    }

    /// Names of the checks that were made.
    pub fn checks(&self) -> &[&'static str] {
        &self.judged
    }

    /// Checks that could not be made, and why.
    pub fn skipped(&self) -> &[(&'static str, String)] {
        &self.skipped
    }

    /// How long each method took.
    pub fn timings(&self) -> &[Timing] {
        &self.timings
    }

    /// Whether nothing was found.
    pub fn conforms(&self) -> bool {
        self.findings.is_empty()
    }

    /// Prints the report, and panics where something was found: for tests.
    ///
    /// # Panics
    /// The plugin does not conform.
    pub fn assert_conforms(&self) {
        println!("{self}");
        assert!(
            self.conforms(),
            "{} does not conform:\n{self}",
            self.plugin.name()
        );
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let plugin = &self.plugin;
        writeln!(
            f,
            "{} {} {}, seed {}",
            plugin.kind().name(),
            plugin.name(),
            plugin.version(),
            self.seed
        )?;
        for check in &self.judged {
            let mut found = self
                .findings
                .iter()
                .filter(|finding| finding.check == *check)
                .peekable();
            writeln!(
                f,
                "  {} {check}",
                if found.peek().is_none() {
                    "ok    "
                } else {
                    "FAILED"
                }
            )?;
            found.try_for_each(|finding| writeln!(f, "         {}", finding.words))?;
        }
        for (check, why) in &self.skipped {
            writeln!(f, "  -      {check}: not judged: {why}")?;
        }
        self.timings
            .iter()
            .try_for_each(|timing| writeln!(f, "  {timing}"))
    }
}
