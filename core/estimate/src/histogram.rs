//! Blocks by their length and the feed reached in them.

use std::collections::BTreeMap;

/// Bins of a decade, of lengths and of feeds.
const PER_DECADE: f64 = 5.0;
/// Bins beyond 1e-6 and 1e6 hold all the rest.
const FAR: f64 = 6.0 * PER_DECADE;

/// A field of the histogram.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Field {
    /// Blocks.
    pub blocks: u64,
    /// Their time, s.
    pub time_s: f64,
}

/// Counts over two logarithmic scales. Bounded: a field that no block falls into takes no room.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Histogram {
    fields: BTreeMap<(i32, i32), Field>,
}

impl Histogram {
    /// Adds a block.
    pub fn add(&mut self, length_mm: f64, feed_mm_per_s: f64, time_s: f64) {
        let bin = |value: f64| {
            (value.max(1e-12).log10() * PER_DECADE)
                .floor()
                .clamp(-FAR, FAR) as i32
        };
        let field = self
            .fields
            .entry((bin(length_mm), bin(feed_mm_per_s * 60.0)))
            .or_default();
        field.blocks += 1;
        field.time_s += time_s;
    }

    /// Fields with blocks: lengths in mm and feeds in mm/min, both from and below.
    pub fn fields(&self) -> impl Iterator<Item = ([f64; 2], [f64; 2], &Field)> {
        let edges = |bin: i32| [bin, bin + 1].map(|edge| 10f64.powf(f64::from(edge) / PER_DECADE));
        self.fields
            .iter()
            .map(move |((length, feed), field)| (edges(*length), edges(*feed), field))
    }
}
