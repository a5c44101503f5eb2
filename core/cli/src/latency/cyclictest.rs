//! A histogram that `cyclictest -h` has printed.

use std::path::Path;

use tandem_recorder::Lateness;

/// What `cyclictest` counted, over all of its threads.
pub struct Cyclictest {
    /// Its wake-ups, in whole µs as it prints them.
    pub lateness: Lateness,
    /// Wake-ups later than its histogram reaches; all but the latest stand at its end.
    pub overflows: u64,
}

impl Cyclictest {
    /// Reads a file.
    ///
    /// # Errors
    /// The file cannot be read, or holds no histogram.
    pub fn read(path: &Path) -> Result<Self, String> {
        let text = std::fs::read_to_string(path).map_err(|e| format!("{}: {e}", path.display()))?;
        Self::parse(&text).map_err(|e| format!("{}{e}", path.display()))
    }

    /// Lines `latency_us count count …`, a count for each thread, and comments.
    fn parse(text: &str) -> Result<Self, String> {
        let (mut lateness, mut end_us) = (Lateness::new(), 0);
        for (number, line) in (1..).zip(text.lines()) {
            if !line.starts_with(|c: char| c.is_ascii_digit()) {
                continue;
            }
            let fields: Result<Vec<u64>, _> = line.split_whitespace().map(str::parse).collect();
            let fields = fields
                .map_err(|_| format!(":{number}: not a latency with its counts: {line:?}"))?;
            lateness.record_many(fields[0] * 1000, fields[1..].iter().sum());
            end_us = fields[0] + 1;
        }
        let overflows = comment(text, "# Histogram Overflows:").iter().sum();
        let latest_us = comment(text, "# Max Latencies:")
            .into_iter()
            .max()
            .unwrap_or(0);
        if overflows > 0 {
            lateness.record_many(end_us * 1000, overflows - 1);
            lateness.record_many(latest_us.max(end_us) * 1000, 1);
        }
        let found = lateness.count() > 0;
        found
            .then_some(Self {
                lateness,
                overflows,
            })
            .ok_or(": no histogram of cyclictest (its option -h)".to_string())
    }
}

/// The numbers behind a comment.
fn comment(text: &str, name: &str) -> Vec<u64> {
    let behind = text
        .lines()
        .find_map(|line| line.strip_prefix(name))
        .unwrap_or_default();
    behind
        .split_whitespace()
        .filter_map(|word| word.parse().ok())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const PRINTED: &str = "# /dev/cpu_dma_latency set to 0us\n# Histogram\n000000 000000\t000000\n000001 000012\t000003\n\
        000002 000085\t000000\n# Total: 000000097 000000003\n# Min Latencies: 00001 00001\n# Avg Latencies: 00002 00001\n\
        # Max Latencies: 00113 00001\n# Histogram Overflows: 00003 00000\n# Histogram Overflow at cycle number:\n\
        # Thread 0: 00113 01208 01209\n";

    #[test]
    fn all_threads_and_what_overflowed_are_counted() {
        let read = Cyclictest::parse(PRINTED).unwrap();
        assert_eq!(
            (
                read.lateness.count(),
                read.overflows,
                read.lateness.max_ns()
            ),
            (103, 3, 113_000)
        );
        assert!((2000..2100).contains(&read.lateness.percentile_ns(0.5)));
    }

    #[test]
    fn what_is_no_histogram_is_refused() {
        for (text, words) in [
            ("", ": no histogram"),
            ("# Histogram\n", ": no histogram"),
            ("a\n1 x\n", ":2: not a latency"),
        ] {
            let refusal = Cyclictest::parse(text).err().unwrap();
            assert!(refusal.starts_with(words), "{refusal}");
        }
    }
}
