//! How long calls take, as a histogram. It says something about this computer and is never judged.

use std::fmt;
use std::time::Instant;

/// Buckets by powers of two, from below 1 ns to above a second.
const BUCKETS: usize = 32;

/// The calls of one method.
#[derive(Clone, Debug)]
pub struct Timing {
    /// The method.
    pub method: &'static str,
    /// Calls that took less than 2^n ns, and at least half of it, by n.
    pub buckets: [u64; BUCKETS],
    /// The longest call, ns.
    pub longest_ns: u64,
}

impl Timing {
    pub(crate) fn new(method: &'static str) -> Self {
        Self {
            method,
            buckets: [0; BUCKETS],
            longest_ns: 0,
        }
    }

    /// Measures one call.
    pub(crate) fn of<T>(&mut self, call: impl FnOnce() -> T) -> T {
        let started = Instant::now();
        let answer = call();
        let ns = started.elapsed().as_nanos() as u64;
        self.longest_ns = self.longest_ns.max(ns);
        self.buckets[(64 - ns.leading_zeros() as usize).min(BUCKETS - 1)] += 1;
        answer
    }

    /// Number of calls.
    pub fn calls(&self) -> u64 {
        self.buckets.iter().sum()
    }

    /// An upper bound, ns, that so large a share of the calls kept: within a factor of two.
    pub fn quantile_ns(&self, share: f64) -> u64 {
        let wanted = (self.calls() as f64 * share).ceil() as u64;
        let mut counted = 0;
        let bucket = self.buckets.iter().position(|count| {
            counted += count;
            counted >= wanted
        });
        1 << bucket.unwrap_or(BUCKETS - 1)
    }
}

impl fmt::Display for Timing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (half, most) = (self.quantile_ns(0.5), self.quantile_ns(0.99));
        let (method, calls, longest) = (self.method, self.calls(), self.longest_ns);
        write!(
            f,
            "{method:<16} {calls:>8} calls, half below {half} ns, 99 % below {most} ns, longest {longest} ns"
        )?;
        let Some(first) = self.buckets.iter().position(|count| *count > 0) else {
            return Ok(());
        };
        write!(
            f,
            "\n{:<16} {} from {} ns by powers of two",
            "",
            self.bars(first),
            (1u64 << first) / 2
        )
    }
}

impl Timing {
    /// A bar for each bucket from `first` to the last one used, as high as its logarithm.
    fn bars(&self, first: usize) -> String {
        const HEIGHTS: [char; 8] = ['▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];
        let last = self
            .buckets
            .iter()
            .rposition(|count| *count > 0)
            .unwrap_or(first);
        let most = self
            .buckets
            .iter()
            .max()
            .map_or(1.0, |most| (*most as f64).ln().max(1.0));
        let bar = |count: &u64| match count {
            0 => '·',
            _ => HEIGHTS[((*count as f64).ln() / most * 7.0).round() as usize],
        };
        self.buckets[first..=last].iter().map(bar).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_come_from_the_buckets() {
        let mut timing = Timing::new("x");
        timing.buckets[5] = 90;
        timing.buckets[10] = 10;
        assert_eq!(
            (
                timing.quantile_ns(0.5),
                timing.quantile_ns(0.99),
                timing.calls()
            ),
            (32, 1024, 100)
        );
        timing.buckets[7] = 1;
        assert!(
            timing
                .to_string()
                .ends_with("\n                 █·▁··▅ from 16 ns by powers of two"),
            "{timing}"
        );
    }
}
