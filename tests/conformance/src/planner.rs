//! Planners: random programs, driven as the rough loop does.

use tandem_sdk::{AxisVector, Block, Planner, PlannerDescription, Plugin, Segment, SegmentFlags};

use crate::limits::{self, Sample};
use crate::machine::{FINE_PERIOD_S, context};
use crate::motion::{Driven, Stuck, Timings, drive, drive_as_sent};
use crate::random::Random;
use crate::report::Report;
use crate::{Setup, heap, joints, nonsense, program};

/// Blocks of a program.
const BLOCKS: usize = 100;
/// How far a sample may be from the path where the planner says that it stays on it, mm: corners aside.
const PATH_TOLERANCE_MM: f64 = 2e-6;

/// Judges a planner.
pub fn judge(plugin: Plugin, setup: &Setup, report: &mut Report) {
    let opened = crate::open(setup, report, |options| {
        plugin.planner(options, &context(AxisVector::ZERO))
    });
    let Some(planner) = opened else { return };
    let description = planner.describe();
    judge_description(&description, report);
    nonsense::judge(planner.as_ref(), report);
    let mut timings = Timings::default();
    for number in 0..setup.programs {
        let seed = setup.seed.wrapping_add(number.wrapping_mul(0x1_0000_0001));
        let mut judge = Judge {
            plugin,
            setup,
            report,
            description,
            timings: &mut timings,
            seed,
            how: "",
        };
        if let Err(Stuck { check, words }) = judge.program() {
            report.find(check, format!("program seed {seed}: {words}"));
            break;
        }
    }
    joints::judge(plugin, setup, report, &mut timings);
    report.time([timings.check, timings.accept, timings.advance]);
}

fn judge_description(description: &PlannerDescription, report: &mut Report) {
    const CHECK: &str = "self-description";
    report.judged(CHECK);
    if !(2..=3).contains(&description.order) {
        report.find(
            CHECK,
            format!("order {} is neither 2 nor 3", description.order),
        );
    }
    if description
        .speed_difference_mm_per_s
        .iter()
        .any(|v| !v.is_finite() || *v < 0.0)
    {
        report.find(
            CHECK,
            "the allowable speed difference is no number from 0".to_string(),
        );
    }
}

/// One program.
struct Judge<'a> {
    plugin: Plugin,
    setup: &'a Setup,
    report: &'a mut Report,
    description: PlannerDescription,
    timings: &'a mut Timings,
    seed: u64,
    /// How blocks came, in what is found.
    how: &'static str,
}

/// No end but the program's.
const TO_THE_END: usize = 1_000_000;

impl Judge<'_> {
    fn program(&mut self) -> Result<(), Stuck> {
        let mut random = Random::new(self.seed);
        let mut planner = self.open(AxisVector::ZERO)?;
        let timings = &mut *self.timings;
        let takes = |block: &Block| timings.check.of(|| planner.check(block, None)).is_ok();
        let blocks = program::random(&mut random, AxisVector::ZERO, BLOCKS, takes);
        if blocks.is_empty() {
            return Err(Stuck {
                check: "programs",
                words: "it takes no block of a whole program".to_string(),
            });
        }
        self.report.judged("programs");
        let mut driven = Driven::default();
        drive(
            planner.as_mut(),
            &blocks,
            TO_THE_END,
            &mut driven,
            self.timings,
        )?;
        self.judge_output(&blocks, &driven);
        self.judge_as_sent(&mut random, &blocks)?;
        self.judge_determinism(&blocks, &driven)?;
        self.judge_reset(planner.as_mut(), &blocks, &driven)
    }

    fn open(&self, position: AxisVector) -> Result<Box<dyn Planner>, Stuck> {
        let opened = self.plugin.planner(&self.setup.options, &context(position));
        opened.map_err(|error| Stuck {
            check: "options",
            words: error.to_string(),
        })
    }

    fn find(&mut self, check: &'static str, words: Option<String>) {
        self.report.judged(check);
        if let Some(words) = words {
            let (seed, how) = (self.seed, self.how);
            self.report
                .find(check, format!("program seed {seed}{how}: {words}"));
        }
    }

    fn judge_output(&mut self, blocks: &[Block], driven: &Driven) {
        let segments = &driven.segments;
        self.find("segments", unsound(segments));
        self.find("reports", misreported(blocks, driven));
        self.find("end points", missed(blocks, segments));
        let samples = limits::samples(segments);
        if self.description.breaks_limits != 0 {
            self.report
                .skip("limits", "it declares that it breaks them");
        } else {
            let found = limits::judge(
                segments,
                &samples,
                &context(AxisVector::ZERO).limits,
                &self.description,
            );
            self.find("limits", found);
            self.find("feed", too_fast(blocks, segments, &samples));
        }
        if self.description.leaves_path != 0 {
            self.report.skip("path", "it declares that it leaves it");
        } else {
            self.find("path", off_the_path(blocks, segments, &samples));
        }
    }

    /// Blocks that come a few at a time: nothing is asked of the time that they take.
    fn judge_as_sent(&mut self, random: &mut Random, blocks: &[Block]) -> Result<(), Stuck> {
        self.how = ", as somebody sends it";
        let mut driven = Driven::default();
        let mut planner = self.open(AxisVector::ZERO)?;
        drive_as_sent(planner.as_mut(), blocks, random, &mut driven)?;
        self.judge_output(blocks, &driven);
        self.how = "";
        Ok(())
    }

    /// The same once more, without a `check` before: the same bits.
    fn judge_determinism(&mut self, blocks: &[Block], driven: &Driven) -> Result<(), Stuck> {
        let mut again = Driven::default();
        drive(
            self.open(AxisVector::ZERO)?.as_mut(),
            blocks,
            TO_THE_END,
            &mut again,
            self.timings,
        )?;
        self.find("determinism", different(&driven.segments, &again.segments));
        Ok(())
    }

    /// After a reset in mid-program a planner is as one just opened, and needs no more memory.
    fn judge_reset(
        &mut self,
        planner: &mut dyn Planner,
        blocks: &[Block],
        driven: &Driven,
    ) -> Result<(), Stuck> {
        planner.reset(&AxisVector::ZERO);
        drive(planner, blocks, 20, &mut Driven::default(), self.timings)?;
        planner.reset(&AxisVector::ZERO);
        let mut again = Driven::with_room_for(driven);
        drive(planner, blocks, TO_THE_END, &mut again, self.timings)?;
        self.find("reset", different(&driven.segments, &again.segments));
        if heap::counts() {
            let uses = again.heap_uses;
            let used = (uses > 0)
                .then(|| format!("{uses} uses of the heap in a program that it has driven before"));
            self.find("allocation", used);
        } else {
            self.report.skip("allocation", heap::NOT_COUNTED);
        }
        Ok(())
    }
}

/// Numbers that are finite, time that goes forward, positions that join, blocks in order.
fn unsound(segments: &[Segment]) -> Option<String> {
    let alone = segments.iter().find_map(|segment| {
        let coefficients = segment.coefficients.iter().chain([&segment.path]).flatten();
        let finite =
            segment.duration_s.is_finite() && coefficients.into_iter().all(|c| c.is_finite());
        // Zero is for a plan whose end is always queued with it.
        let stops = segment.stop_deceleration_mm_per_s2 >= 0.0;
        match (finite && segment.duration_s >= 0.0, stops) {
            (false, _) => Some(format!(
                "block {}: a number that is not finite, or a negative duration",
                segment.block
            )),
            (_, false) => Some(format!(
                "block {}: the deceleration to stop with is negative, or no number",
                segment.block
            )),
            _ => None,
        }
    });
    alone.or_else(|| {
        segments
            .windows(2)
            .find_map(|pair| unjoined(&pair[0], &pair[1]))
    })
}

fn unjoined(before: &Segment, after: &Segment) -> Option<String> {
    let gap = after.position(0.0) - before.position(before.duration_s);
    let gap_mm = gap.0.iter().fold(0.0, |most: f64, v| most.max(v.abs()));
    let path_gap_mm = (after.path_mm(0.0) - before.path_mm(before.duration_s)).abs();
    if gap_mm > 1e-6 || path_gap_mm > 1e-6 {
        return Some(format!(
            "block {}: a gap of {gap_mm:e} mm, of {path_gap_mm:e} mm along the path",
            after.block
        ));
    }
    (after.block < before.block)
        .then(|| format!("block {} comes after block {}", after.block, before.block))
}

/// Each block is reported once, in order, before it moves.
fn misreported(blocks: &[Block], driven: &Driven) -> Option<String> {
    let reported = driven.reports.iter().map(|report| report.block);
    if !reported.eq(blocks.iter().map(|block| block.index)) {
        return Some(format!(
            "{} reports of {} blocks, or out of order",
            driven.reports.len(),
            blocks.len()
        ));
    }
    let wrong = driven
        .reports
        .iter()
        .find(|report| !report.peak_feed_mm_per_s.is_finite() || !report.time_s.is_finite());
    wrong.map(|report| {
        format!(
            "block {}: a report with a number that is not finite",
            report.block
        )
    })
}

/// Where the program asks for rest, the plan rests on the programmed position, bit for bit.
fn missed(blocks: &[Block], segments: &[Segment]) -> Option<String> {
    let rests = |block: &Block| {
        let mut own = segments
            .iter()
            .filter(|segment| segment.block == block.index);
        own.any(|s| {
            s.flags.contains(SegmentFlags::ENDS_AT_REST) && s.position(s.duration_s) == block.end
        })
    };
    let asked = blocks
        .iter()
        .enumerate()
        .filter(|(index, block)| block.ends_at_rest() || index + 1 == blocks.len());
    let missed = asked.map(|(_, block)| block).find(|block| !rests(block))?;
    let (index, kind, length_mm) = (missed.index, missed.kind, missed.length_mm);
    Some(format!(
        "block {index}, {kind:?} of {length_mm} mm: no rest on its end {:?}",
        &missed.end.0[..3]
    ))
}

/// No faster between two samples than the highest feed that is programmed there, and that feed is one of the program's.
fn too_fast(blocks: &[Block], segments: &[Segment], samples: &[Sample]) -> Option<String> {
    let mut moving = segments
        .iter()
        .filter(|segment| segment.path_mm(segment.duration_s) > segment.path_mm(0.0));
    let too_high =
        |segment: &&Segment| segment.feed_mm_per_s > programmed(blocks, segment) * (1.0 + 1e-9);
    if let Some(segment) = moving.find(too_high) {
        let programmed = programmed(blocks, segment);
        return Some(format!(
            "block {}: {} mm/s, programmed {programmed}",
            segment.block, segment.feed_mm_per_s
        ));
    }
    samples.windows(2).find_map(|pair| {
        let speed = program::norm(&(pair[1].position - pair[0].position)) / FINE_PERIOD_S;
        let feeds = segments[pair[0].segment..=pair[1].segment]
            .iter()
            .map(|segment| segment.feed_mm_per_s);
        let feed = feeds.fold(0.0, f64::max);
        let wrong = speed > feed * (1.0 + 1e-6) + 1e-9;
        let block = segments[pair[1].segment].block;
        let kind = blocks.get(block as usize).map(|block| block.kind);
        wrong.then(|| format!("block {block}, {kind:?}: {speed} mm/s, programmed {feed}"))
    })
}

/// The highest feed of the blocks that may move in a segment: its own, and a few beside it where blocks overlap.
fn programmed(blocks: &[Block], segment: &Segment) -> f64 {
    let index = segment.block as usize;
    let near =
        blocks[index.saturating_sub(4).min(blocks.len())..blocks.len().min(index + 5)].iter();
    near.map(Block::command_feed_mm_per_s).fold(0.0, f64::max)
}

fn off_the_path(blocks: &[Block], segments: &[Segment], samples: &[Sample]) -> Option<String> {
    let corner_mm = context(AxisVector::ZERO).path_tolerance_mm * (1.0 + 1e-6);
    samples.iter().find_map(|sample| {
        let index = segments[sample.segment].block as usize;
        let own = program::distance_mm(&blocks[index], &sample.position);
        if own <= PATH_TOLERANCE_MM {
            return None;
        }
        // Blocks that overlap may be shorter than the tolerance.
        let near = blocks[index.saturating_sub(4)..blocks.len().min(index + 5)].iter();
        let distance_mm = near
            .map(|block| program::distance_mm(block, &sample.position))
            .fold(own, f64::min);
        (distance_mm > corner_mm).then(|| format!("block {index}: {distance_mm} mm off the path"))
    })
}

fn different(one: &[Segment], other: &[Segment]) -> Option<String> {
    let bits = |s: &Segment| {
        (
            s.block,
            s.duration_s.to_bits(),
            s.coefficients.map(|c| c.map(f64::to_bits)),
        )
    };
    let index = one.iter().zip(other).position(|(a, b)| bits(a) != bits(b));
    match index {
        Some(index) => Some(format!(
            "segment {index}, of block {}, comes out differently",
            one[index].block
        )),
        None => (one.len() != other.len())
            .then(|| format!("{} segments, then {}", one.len(), other.len())),
    }
}
