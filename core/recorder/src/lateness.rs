//! How late the fine loop woke, as a histogram of fixed size.

use hdrhistogram::Histogram;

/// Latest wake-up that is told from later ones, ns: 69 s. Later ones share the last bucket.
const MAX_NS: u64 = 1 << 36;
/// Significant digits of what is counted: a percentile is exact to a hundredth.
const DIGITS: u8 = 2;

/// Wake-ups counted by their lateness. The counts, the number and the maximum are exact.
///
/// [`Lateness::new`] allocates (32 kB); [`Lateness::record`] runs on the fine thread and does not.
#[derive(Clone, Debug)]
pub struct Lateness {
    counts: Histogram<u64>,
    max_ns: u64,
}

/// Wake-ups later than `from_ns` and at most as late as `below_ns` (exclusive).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Row {
    /// Shortest lateness counted here, ns.
    pub from_ns: u64,
    /// The lateness from which the next row counts, ns.
    pub below_ns: u64,
    /// Wake-ups.
    pub count: u64,
}

impl Lateness {
    /// Nothing counted. Host; allocates.
    ///
    /// # Panics
    /// Never: the bounds of the histogram are constants that it takes.
    pub fn new() -> Self {
        Self {
            counts: Histogram::new_with_bounds(1, MAX_NS, DIGITS)
                .expect("its bounds are constants"),
            max_ns: 0,
        }
    }

    /// Counts one wake-up; one before its time counts as in time. Fine thread; does not allocate.
    pub fn record(&mut self, late_ns: i64) {
        self.record_many(late_ns.max(0).unsigned_abs(), 1);
    }

    /// Counts so many wake-ups of the same lateness. Any thread; does not allocate.
    pub fn record_many(&mut self, late_ns: u64, count: u64) {
        if count > 0 {
            self.counts.saturating_record_n(late_ns, count);
            self.max_ns = self.max_ns.max(late_ns);
        }
    }

    /// Wake-ups counted.
    pub fn count(&self) -> u64 {
        self.counts.len()
    }

    /// The latest, ns.
    pub fn max_ns(&self) -> u64 {
        self.max_ns
    }

    /// The lateness that `share` of the wake-ups kept, ns: the nearest rank, at the upper end of its bucket. 0 where
    /// nothing was counted.
    pub fn percentile_ns(&self, share: f64) -> u64 {
        self.counts.value_at_quantile(share).min(self.max_ns)
    }

    /// The counts by half doublings, from the first to the last that holds any.
    pub fn rows(&self) -> Vec<Row> {
        let mut rows: Vec<Row> = vec![];
        for recorded in self.counts.iter_recorded() {
            let of = row_of(recorded.value_iterated_to());
            while let Some(last) = rows
                .last()
                .copied()
                .filter(|last| last.below_ns < of.below_ns)
            {
                rows.push(row_of(last.below_ns));
            }
            if rows.is_empty() {
                rows.push(of);
            }
            if let Some(last) = rows.last_mut() {
                last.count += recorded.count_since_last_iteration();
            }
        }
        rows
    }
}

impl Default for Lateness {
    fn default() -> Self {
        Self::new()
    }
}

/// The row that counts `ns`: half of a doubling, but nothing shorter than 16 ns.
fn row_of(ns: u64) -> Row {
    let width_ns = 1 << ns.max(32).ilog2().saturating_sub(1);
    let from_ns = ns / width_ns * width_ns;
    Row {
        from_ns,
        below_ns: from_ns + width_ns,
        count: 0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_are_exact_and_percentiles_to_a_hundredth() {
        let mut lateness = Lateness::new();
        for us in 1..=1000 {
            lateness.record(us * 1000);
        }
        lateness.record(-5);
        assert_eq!((lateness.count(), lateness.max_ns()), (1001, 1_000_000));
        for (share, us) in [(0.5, 500.0), (0.99, 990.0), (0.999, 999.0)] {
            let found = lateness.percentile_ns(share) as f64 / 1000.0;
            assert!(found >= us && found <= us * 1.01, "{share}: {found}");
        }
        assert_eq!(lateness.percentile_ns(1.0), 1_000_000);
    }

    #[test]
    fn rows_join_without_gap_and_hold_what_lies_between_their_ends() {
        let mut lateness = Lateness::new();
        // Both ends of every half doubling up to 69 s, and the doublings between.
        for shift in 4..36 {
            for late_ns in [1_u64 << shift, 3 << (shift - 1)] {
                lateness.record_many(late_ns - 1, 1);
                lateness.record_many(late_ns, 1);
            }
        }
        let rows = lateness.rows();
        assert_eq!(
            rows.iter().map(|row| row.count).sum::<u64>(),
            lateness.count()
        );
        for pair in rows.windows(2) {
            assert_eq!(pair[0].below_ns, pair[1].from_ns);
        }
        // Rows below 32 ns are wider, and of the last only the lower end is drawn.
        for row in rows
            .iter()
            .filter(|row| row.from_ns >= 32 && row.below_ns < MAX_NS)
        {
            assert_eq!(row.count, 2, "{row:?}");
        }
    }

    #[test]
    fn what_is_later_than_any_bucket_counts_in_the_last_and_stays_the_maximum() {
        let mut lateness = Lateness::new();
        lateness.record_many(u64::MAX, 2);
        assert_eq!((lateness.count(), lateness.max_ns()), (2, u64::MAX));
        assert_eq!(lateness.rows().len(), 1);
    }

    #[test]
    fn nothing_counted_is_nothing() {
        assert_eq!(Lateness::new().percentile_ns(0.5), 0);
        assert!(Lateness::new().rows().is_empty());
    }
}
