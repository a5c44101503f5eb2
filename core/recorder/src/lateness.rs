//! How late the fine loop woke, as a histogram of fixed size.

/// Buckets per doubling; below this many ns a bucket holds one ns. A percentile is exact to one part in this.
const STEPS: u64 = 32;
/// Values of 2³⁶ ns (69 s) and more share the last bucket.
const BUCKETS: usize = 32 * STEPS as usize;
/// Buckets a row of a drawn histogram holds: half a doubling.
const ROW: usize = STEPS as usize / 2;

/// Wake-ups counted by their lateness. The counts, the number and the maximum are exact.
///
/// [`Lateness::new`] allocates (8 kB); [`Lateness::record`] runs on the fine thread and does not.
#[derive(Clone, Debug)]
pub struct Lateness {
    counts: Box<[u64; BUCKETS]>,
    count: u64,
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
    pub fn new() -> Self {
        Self {
            counts: Box::new([0; BUCKETS]),
            count: 0,
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
            self.counts[bucket(late_ns)] += count;
            self.count += count;
            self.max_ns = self.max_ns.max(late_ns);
        }
    }

    /// Wake-ups counted.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// The latest, ns.
    pub fn max_ns(&self) -> u64 {
        self.max_ns
    }

    /// The lateness that `share` of the wake-ups kept, ns: the nearest rank, at the upper end of its bucket. 0 where
    /// nothing was counted.
    pub fn percentile_ns(&self, share: f64) -> u64 {
        let rank = (share * self.count as f64).ceil().max(1.0) as u64;
        let mut seen = 0;
        let reached = self.counts.iter().position(|count| {
            seen += count;
            seen >= rank
        });
        reached.map_or(self.max_ns, |found| {
            (lowest_ns(found + 1) - 1).min(self.max_ns)
        })
    }

    /// The counts by half doublings, from the first to the last that holds any.
    pub fn rows(&self) -> Vec<Row> {
        let row = |(index, counts): (usize, &[u64])| Row {
            from_ns: lowest_ns(index * ROW),
            below_ns: lowest_ns((index + 1) * ROW),
            count: counts.iter().sum(),
        };
        let mut rows: Vec<Row> = self
            .counts
            .chunks(ROW)
            .enumerate()
            .map(row)
            .skip_while(|r| r.count == 0)
            .collect();
        rows.truncate(
            rows.iter()
                .rposition(|r| r.count > 0)
                .map_or(0, |last| last + 1),
        );
        rows
    }
}

impl Default for Lateness {
    fn default() -> Self {
        Self::new()
    }
}

/// The bucket of a value: linear below [`STEPS`], then as many buckets for each doubling.
fn bucket(ns: u64) -> usize {
    if ns < STEPS {
        return ns as usize;
    }
    let shift = ns.ilog2() - STEPS.ilog2();
    ((u64::from(shift) * STEPS + (ns >> shift)) as usize).min(BUCKETS - 1)
}

/// The smallest value of a bucket, ns.
fn lowest_ns(bucket: usize) -> u64 {
    let bucket = bucket as u64;
    if bucket < STEPS {
        bucket
    } else {
        (bucket % STEPS + STEPS) << (bucket / STEPS - 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn buckets_join_without_gap_or_overlap() {
        for index in 0..BUCKETS {
            assert_eq!(bucket(lowest_ns(index)), index);
            assert_eq!(bucket(lowest_ns(index + 1) - 1), index);
        }
        assert_eq!(bucket(u64::MAX), BUCKETS - 1);
    }

    #[test]
    fn counts_are_exact_and_percentiles_to_a_bucket() {
        let mut lateness = Lateness::new();
        for us in 1..=1000 {
            lateness.record(us * 1000);
        }
        lateness.record(-5);
        assert_eq!((lateness.count(), lateness.max_ns()), (1001, 1_000_000));
        for (share, us) in [(0.5, 500.0), (0.99, 990.0), (0.999, 999.0)] {
            let found = lateness.percentile_ns(share) as f64 / 1000.0;
            assert!(
                found >= us && found <= us * (1.0 + 1.0 / STEPS as f64),
                "{share}: {found}"
            );
        }
        assert_eq!(lateness.percentile_ns(1.0), 1_000_000);
        let rows = lateness.rows();
        assert_eq!(rows.iter().map(|row| row.count).sum::<u64>(), 1001);
        assert!(
            rows.windows(2)
                .all(|pair| pair[0].below_ns == pair[1].from_ns)
        );
    }

    #[test]
    fn nothing_counted_is_nothing() {
        assert_eq!(Lateness::new().percentile_ns(0.5), 0);
        assert!(Lateness::new().rows().is_empty());
    }
}
