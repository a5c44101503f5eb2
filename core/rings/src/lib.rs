//! What crosses between the rough and the fine loop: five rings and a handful of atomics.
//!
//! Segments and events go one way, samples and rests the other, the feed strategy's ratios and requests beside them.
//! The operator's commands are atomics: a stop never shares a queue with work. Nothing here locks; nothing allocates
//! after [`bridge`].

mod atomics;
mod controls;
mod counts;
mod operator_inputs;
mod request;
mod rest;
mod sample;
mod switched;

pub use atomics::{
    AtomicF64, Depth, MAX_ENTRIES, MIN_JERK_SHARE, STOP_JERK_SHARE, STOP_SHARE,
    max_entries_a_period,
};
pub use controls::{BusStatus, Controls, JogControls, JointStatus, SpindleStatus, Status};
pub use counts::{Counters, Counts};
pub use operator_inputs::OperatorInputs;
pub use request::{RequestKind, StrategyRequest};
pub use rest::{Rest, RestCause};
pub use sample::{MachineState, Sample, StopCause};
pub use switched::{FLOOD, MIST, Switched, SwitchedBy};

use std::sync::Arc;

use rtrb::{Consumer, Producer, RingBuffer};
use tandem_sdk::{Event, Segment};

/// An entry of the segment ring: what travels from the rough to the fine loop, in the order of the path.
#[derive(Clone, Copy, Debug)]
#[allow(clippy::large_enum_variant)] // one slot of a pre-allocated ring; boxing would allocate for every segment
pub enum Queued {
    /// A piece of motion.
    Segment {
        /// Program time at which it starts, s, from the start of the run.
        start_s: f64,
        /// The motion.
        segment: Segment,
    },
    /// Something that happens between two pieces.
    Event(Event),
}

/// A feed ratio asked for by the strategy and the policy, with the tick from which it counts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ratio {
    /// First tick at which it acts: over the rough period that begins there the ratio is led over to it. One that comes later begins
    /// at once, and is counted.
    pub tick: u64,
    /// The ratio.
    pub ratio: f64,
}

/// Sizes of the rings, in entries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sizes {
    /// Segments and events.
    pub segments: usize,
    /// Samples on their way to the feed strategy and the recorder.
    pub samples: usize,
}

impl Sizes {
    /// Fewest and most segments of a ring: 3 MB and 48 MB.
    pub const SEGMENTS: [usize; 2] = [4096, 65_536];

    /// Segments of a ring for as many `entries`, but no more than there is memory for. Where that is less, the rough loop
    /// tells the fine loop so ([`Depth::max_rate`]).
    pub fn segments_for(entries: f64) -> usize {
        let [fewest, most] = Self::SEGMENTS;
        (entries.clamp(fewest as f64, most as f64) as usize).next_power_of_two()
    }
}

impl Default for Sizes {
    /// 4096 segments (3 MB); 4096 samples hold 4 s of a recorder that is not looking.
    fn default() -> Self {
        Self {
            segments: Self::SEGMENTS[0],
            samples: 4096,
        }
    }
}

/// The rough loop's end.
#[derive(Debug)]
pub struct RoughEnd {
    /// Segments and events out.
    pub segments: Producer<Queued>,
    /// Rests that end an epoch, in.
    pub rests: Consumer<Rest>,
    /// How far the queue reaches.
    pub depth: Arc<Depth>,
    /// What the fine loop says of itself.
    pub status: Arc<Status>,
}

/// The fine loop's end.
#[derive(Debug)]
pub struct FineEnd {
    /// Segments and events in.
    pub segments: Consumer<Queued>,
    /// Ratios in.
    pub ratios: Consumer<Ratio>,
    /// The feed strategy's requests, in.
    pub requests: Consumer<StrategyRequest>,
    /// Rests that end an epoch, out.
    pub rests: Producer<Rest>,
    /// How far the queue reaches.
    pub depth: Arc<Depth>,
    /// The operator's commands.
    pub controls: Arc<Controls>,
    /// What the fine loop says of itself.
    pub status: Arc<Status>,
    /// Samples out.
    pub samples: Producer<Sample>,
}

/// The host's end.
#[derive(Debug)]
pub struct HostEnd {
    /// The operator's commands.
    pub controls: Arc<Controls>,
    /// What the fine loop says of itself.
    pub status: Arc<Status>,
    /// Every sample.
    pub samples: Consumer<Sample>,
    /// Ratios out.
    pub ratios: Producer<Ratio>,
    /// The feed strategy's requests, out.
    pub requests: Producer<StrategyRequest>,
}

/// A ring whose memory has been written once, so that no page of it faults when the fine loop writes there first.
fn touched<T: Copy + Default>(size: usize) -> (Producer<T>, Consumer<T>) {
    let (mut input, mut output) = RingBuffer::new(size);
    if let Ok(slots) = input.write_chunk_uninit(size) {
        slots.fill_from_iter(std::iter::repeat_n(T::default(), size));
    }
    if let Ok(written) = output.read_chunk(size) {
        written.commit_all();
    }
    (input, output)
}

/// A ring of `size` samples. Allocates for good.
pub fn sample_ring(size: usize) -> (Producer<Sample>, Consumer<Sample>) {
    touched(size)
}

/// Makes the bridge between the loops. Allocates for good.
pub fn bridge(sizes: Sizes) -> (RoughEnd, FineEnd, HostEnd) {
    bridge_with(sizes, Arc::default(), Arc::default())
}

/// Makes the bridge between the loops of one job among several, which share `controls` and `status`. Allocates for good.
pub fn bridge_with(
    sizes: Sizes,
    controls: Arc<Controls>,
    status: Arc<Status>,
) -> (RoughEnd, FineEnd, HostEnd) {
    let (segments_in, segments_out) = RingBuffer::new(sizes.segments);
    let (ratios_in, ratios_out) = RingBuffer::new(64);
    let (samples_in, samples_out) = sample_ring(sizes.samples);
    let (requests_in, requests_out) = RingBuffer::new(8);
    let (rests_in, rests_out) = RingBuffer::new(8);
    let depth = Arc::<Depth>::default();
    let rough = RoughEnd {
        segments: segments_in,
        rests: rests_out,
        depth: Arc::clone(&depth),
        status: Arc::clone(&status),
    };
    let fine = FineEnd {
        segments: segments_out,
        ratios: ratios_out,
        requests: requests_out,
        rests: rests_in,
        depth,
        controls: Arc::clone(&controls),
        status: Arc::clone(&status),
        samples: samples_in,
    };
    (
        rough,
        fine,
        HostEnd {
            controls,
            status,
            samples: samples_out,
            ratios: ratios_in,
            requests: requests_in,
        },
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ring_is_as_long_as_asked_for_within_what_there_is_memory_for() {
        let sizes = [0.0, 4096.0, 4097.0, 60_000.0, 1e12, f64::INFINITY].map(Sizes::segments_for);
        assert_eq!(sizes, [4096, 4096, 8192, 65_536, 65_536, 65_536]);
    }

    #[test]
    fn what_one_end_gives_the_other_takes_and_what_all_share_is_one() {
        let (mut rough, mut fine, mut host) = bridge(Sizes::default());
        host.controls.feed_override.store(0.25);
        assert_eq!(fine.controls.feed_override.load(), 0.25);
        fine.status.feed_mm_per_s.store(3.0);
        assert_eq!(rough.status.feed_mm_per_s.load(), 3.0);
        assert_eq!(host.status.feed_mm_per_s.load(), 3.0);
        rough.depth.wall_s.store(9.0);
        assert_eq!(fine.depth.wall_s.load(), 9.0);
        let ratio = Ratio {
            tick: 5,
            ratio: 0.5,
        };
        host.ratios.push(ratio).unwrap();
        assert_eq!(fine.ratios.pop(), Ok(ratio));
        assert!(rough.rests.pop().is_err() && host.samples.pop().is_err());
        assert_eq!(fine.samples.slots(), Sizes::default().samples);
        assert_eq!(rough.segments.slots(), Sizes::default().segments);
    }
}
