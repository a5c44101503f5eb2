//! The planner contract: stops, dwells, rapids, flags, reports, refusals, buffer.

use crate::common;

use common::{FILTERS, context, drive, line, norm, open, polyline};
use tandem_after_interpolation::{AfterInterpolation, BUFFER_BLOCKS, Options};
use tandem_rig::{Collected, arc, numbered};
use tandem_sdk::{
    Accepted, AxisVector, Block, BlockKind, LimitedBy, PathMode, Planner, SegmentFlags,
};

/// Two lines with an exact stop between, an arc, a dwell, a rapid, a line of a rotary axis.
fn program() -> Vec<Block> {
    let mut first = line(&AxisVector::ZERO, &[10.0, 0.0], 50.0);
    first.path_mode = PathMode::ExactStop;
    let second = line(&first.end, &[10.0, 7.0], 30.0);
    let third = arc(&second.end, [15.0, 7.0], -3.0, 40.0);
    let mut dwell = Block::at(third.end);
    dwell.dwell_s = 0.0203;
    let mut rapid = line(&third.end, &[0.0, 0.0, 5.0], f64::INFINITY);
    rapid.kind = BlockKind::Rapid;
    let turn = line(&rapid.end, &[0.0, 0.0, 5.0, 2.0], 1.5);
    numbered(vec![first, second, third, dwell, rapid, turn])
}

#[test]
fn stops_rest_exactly_on_the_programmed_position() {
    for filter in FILTERS {
        let blocks = program();
        let recorder = drive(&mut *open(filter, 20.0, &context(0.001)), &blocks);
        let rests: Vec<_> = recorder
            .segments
            .iter()
            .filter(|s| s.flags.contains(SegmentFlags::ENDS_AT_REST))
            .collect();
        assert_eq!(
            rests.iter().map(|s| s.block).collect::<Vec<_>>()[..2],
            [0, 2],
            "{filter}"
        );
        assert_eq!(
            rests.iter().map(|s| s.block).collect::<Vec<_>>()[rests.len() - 2..],
            [4, 5],
            "{filter}"
        );
        for rest in rests {
            let goal = blocks[rest.block as usize].end;
            assert!(
                norm(&(rest.position(rest.duration_s) - goal)) < 1e-12,
                "{filter}"
            );
            assert!(norm(&rest.velocity(rest.duration_s)) < 1e-6, "{filter}");
        }
    }
}

#[test]
fn an_exponential_filter_is_cut_off_where_nothing_is_left() {
    let blocks = numbered(vec![line(&AxisVector::ZERO, &[30.0], 50.0)]);
    let recorder = drive(&mut *open("exponential", 20.0, &context(0.001)), &blocks);
    let last = recorder.segments.last().unwrap();
    let lag = 30.0 - last.position(0.0)[0];
    assert!(
        (0.0..1.2e-9).contains(&lag),
        "the last piece makes up for {lag} mm"
    );
    assert!(
        recorder.duration_s() < 0.6 + 23.0 * 0.02,
        "and the wait is not longer than it must be"
    );
}

#[test]
fn every_block_begins_ends_and_is_reported_once() {
    for filter in FILTERS {
        let blocks = program();
        let recorder = drive(&mut *open(filter, 20.0, &context(0.001)), &blocks);
        assert_eq!(
            recorder.reports.iter().map(|r| r.block).collect::<Vec<_>>(),
            [0, 1, 2, 3, 4, 5]
        );
        for report in &recorder.reports {
            let own: Vec<_> = recorder
                .segments
                .iter()
                .filter(|s| s.block == report.block)
                .collect();
            let with = |flag| own.iter().filter(|s| s.flags.contains(flag)).count();
            assert_eq!(
                (
                    with(SegmentFlags::BLOCK_BEGINS),
                    with(SegmentFlags::BLOCK_ENDS)
                ),
                (1, 1)
            );
            assert!(own[0].flags.contains(SegmentFlags::BLOCK_BEGINS));
            assert!(own[own.len() - 1].flags.contains(SegmentFlags::BLOCK_ENDS));
            let time: f64 = own.iter().map(|s| s.duration_s).sum();
            assert!(
                (time - report.time_s).abs() < 1e-9,
                "{filter} block {}: {time} {}",
                report.block,
                report.time_s
            );
            let rapid = blocks[report.block as usize].kind == BlockKind::Rapid;
            assert!(
                own.iter()
                    .all(|s| s.flags.contains(SegmentFlags::RAPID) == rapid)
            );
            assert!(
                own.iter()
                    .all(|s| s.line == blocks[report.block as usize].line)
            );
        }
    }
}

#[test]
fn reports_give_the_steps_of_feed() {
    let recorder = drive(&mut *open("linear", 20.0, &context(0.001)), &program());
    let feeds = |block: usize| {
        let report = &recorder.reports[block];
        [
            report.start_feed_mm_per_s,
            report.peak_feed_mm_per_s,
            report.end_feed_mm_per_s,
        ]
    };
    assert_eq!(
        (feeds(0), feeds(1), feeds(3)),
        ([50.0; 3], [30.0; 3], [0.0; 3])
    );
    assert!((recorder.reports[0].time_s - (0.2 + 0.02)).abs() < 1e-12);
    assert!((recorder.reports[1].time_s - 7.0 / 30.0).abs() < 1e-12);
    assert!((recorder.reports[3].time_s - 0.0203).abs() < 1e-15);
    assert_eq!(recorder.reports[0].time_constant_s, 0.02);
    assert!(recorder.reports[3].time_constant_s.is_nan());
    assert!(
        feeds(4)[1] > 249.0,
        "a rapid runs at the axis limits, not at {} mm/s",
        feeds(4)[1]
    );
}

#[test]
fn feed_of_a_segment_is_the_highest_in_the_filter() {
    let fast = line(&AxisVector::ZERO, &[10.0], 50.0);
    let slow = line(&fast.end, &[20.0], 20.0);
    let recorder = drive(
        &mut *open("linear", 40.0, &context(0.001)),
        &numbered(vec![fast, slow]),
    );
    for (start, segment) in recorder.timed() {
        let expected = if start + segment.duration_s / 2.0 < 0.24 {
            50.0
        } else {
            20.0
        };
        assert_eq!(segment.feed_mm_per_s, expected, "at {start} s");
        let speed = segment.path_speed_mm_per_s(segment.duration_s / 2.0);
        assert!(speed <= expected * (1.0 + 1e-9), "{speed} at {start} s");
    }
}

#[test]
fn blocks_are_planned_at_the_highest_ratio_and_within_axis_speeds() {
    let mut machine = context(0.001);
    machine.max_feed_ratio = 1.5;
    let mut capped = line(&AxisVector::from_slice(&[20.0]), &[30.0], 60.0);
    capped.feed_cap_mm_per_s = 40.0;
    let blocks = numbered(vec![
        line(&AxisVector::ZERO, &[10.0], 50.0),
        line(&AxisVector::from_slice(&[10.0]), &[20.0], 200.0),
        capped,
    ]);
    let recorder = drive(&mut *open("linear", 10.0, &machine), &blocks);
    let found: Vec<_> = recorder
        .reports
        .iter()
        .map(|r| (r.peak_feed_mm_per_s, r.limited_by))
        .collect();
    let expected = [
        (75.0, LimitedBy::Feed),
        (0.999 * 250.0, LimitedBy::Velocity),
        (60.0, LimitedBy::Policy),
    ];
    assert_eq!(found, expected);
    assert_eq!(
        recorder.segments[0].feed_mm_per_s, 50.0,
        "the programmed feed, which the governor's ratio refers to"
    );
}

#[test]
fn what_cannot_be_driven_is_refused() {
    let planner = open("linear", 50.0, &context(0.001));
    let good = line(&AxisVector::ZERO, &[1.0], 5.0);
    assert!(planner.check(&good, None).is_ok());
    let refusal = |change: fn(&mut Block)| {
        let mut block = good;
        change(&mut block);
        planner.check(&block, None).unwrap_err().to_string()
    };
    assert!(refusal(|b| b.kind = BlockKind::Nurbs).contains("NURBS"));
    assert!(refusal(|b| b.feed_mm_per_s = 0.0).contains("feed"));
    assert!(refusal(|b| b.feed_mm_per_s = f64::NAN).contains("feed"));
    assert!(refusal(|b| b.length_mm = 0.0).contains("length"));
    assert!(refusal(|b| b.end[0] = f64::INFINITY).contains("ends"));
    let mut dwell = Block::at(AxisVector::ZERO);
    dwell.dwell_s = -1.0;
    assert!(
        planner
            .check(&dwell, None)
            .unwrap_err()
            .to_string()
            .contains("dwell")
    );
    let mut round = arc(&AxisVector::ZERO, [1.0, 0.0], 1.0, 5.0);
    assert!(planner.check(&round, None).is_ok());
    round.arc.plane = [0, 4];
    assert!(
        planner
            .check(&round, None)
            .unwrap_err()
            .to_string()
            .contains("plane")
    );
}

#[test]
fn machines_and_options_that_do_not_fit_are_refused() {
    let open =
        |options: &str, machine| tandem_after_interpolation::PLUGIN.planner(options, &machine);
    let refusal = |options: &str, machine| open(options, machine).err().unwrap().to_string();
    assert!(refusal("time_constant_ms = 0", context(0.001)).contains("time_constant_ms"));
    let mut endless = context(0.001);
    endless.limits.axes[1].rapid_mm_per_s = f64::INFINITY;
    assert!(refusal("", endless).contains("limits"));
}

#[test]
fn a_part_below_the_rounding_of_a_dwell_is_emitted_once() {
    let mut planner = open("linear", 20.0, &context(0.001));
    let mut dwell = Block::at(AxisVector::ZERO);
    dwell.dwell_s = 1.0;
    planner.accept(&dwell, None).unwrap();
    planner.finish();
    let mut recorder = Collected::default();
    assert_eq!(
        planner.advance(1e-18, &mut recorder).unwrap().duration_s,
        1e-18
    );
    assert_eq!(recorder.segments.len(), 1);
}

#[test]
fn it_says_what_it_does_not_keep() {
    let description = open("bell", 50.0, &context(0.001)).describe();
    assert_eq!(
        (
            description.order,
            description.breaks_limits,
            description.leaves_path
        ),
        (2, 1, 1)
    );
    assert_eq!(description.speed_difference_mm_per_s, [0.0; 8]);
}

#[test]
fn a_full_buffer_is_said_and_memory_is_bounded_by_the_filter() {
    // 0.01 mm at 20 mm/s: a block takes 0.5 ms, so the average over 50 ms looks back on 100 of them.
    let points: Vec<_> = (1..3000).map(|k| [f64::from(k) * 0.01, 0.0, 0.0]).collect();
    let blocks = polyline(&points, 20.0);
    let mut planner = AfterInterpolation::new(&Options::default(), &context(0.001)).unwrap();
    let full = blocks
        .iter()
        .position(|b| planner.accept(b, None).unwrap() == Accepted::Full);
    assert_eq!(full, Some(BUFFER_BLOCKS));
    let (mut next, mut most, mut recorder) = (BUFFER_BLOCKS, 0, Collected::default());
    while next < blocks.len() {
        planner.advance(0.008, &mut recorder).unwrap();
        while next < blocks.len()
            && planner.accept(&blocks[next], None).unwrap() == Accepted::Accepted
        {
            next += 1;
        }
        most = most.max(planner.held());
    }
    assert!(
        (BUFFER_BLOCKS..BUFFER_BLOCKS + 110).contains(&most),
        "{most} blocks held"
    );
}

#[test]
fn without_finish_it_waits_before_the_block_whose_end_is_open() {
    let mut planner = open("linear", 20.0, &context(0.001));
    let blocks = polyline(&[[10.0, 0.0, 0.0], [20.0, 0.0, 0.0]], 50.0);
    let mut recorder = Collected::default();
    planner.accept(&blocks[0], None).unwrap();
    assert_eq!(planner.advance(1.0, &mut recorder).unwrap().duration_s, 0.0);
    planner.accept(&blocks[1], None).unwrap();
    let advanced = planner.advance(1.0, &mut recorder).unwrap();
    assert!((advanced.duration_s - 0.2).abs() < 1e-12 && advanced.done == 0);
    planner.finish();
    let advanced = planner.advance(1.0, &mut recorder).unwrap();
    assert!((advanced.duration_s - 0.22).abs() < 1e-12 && advanced.done == 1);
    assert!(norm(&(recorder.end() - blocks[1].end)) < 1e-12);
}

#[test]
fn advance_is_cut_at_the_time_asked_for() {
    let mut planner = open("bell", 20.0, &context(0.001));
    for block in &program() {
        assert_eq!(planner.accept(block, None).unwrap(), Accepted::Accepted);
    }
    planner.finish();
    let mut recorder = Collected::default();
    for asked in [0.0, 0.0037, 1e-12, 0.008, 0.25, 0.000_4] {
        let emitted = planner.advance(asked, &mut recorder).unwrap().duration_s;
        assert!(
            (emitted - asked).abs() <= 1e-9,
            "{emitted} s instead of {asked} s"
        );
    }
}

#[test]
fn reset_forgets_and_begins_elsewhere() {
    let mut planner = open("exponential", 20.0, &context(0.001));
    let mut recorder = Collected::default();
    for block in &program() {
        assert_eq!(planner.accept(block, None).unwrap(), Accepted::Accepted);
    }
    planner.advance(0.1, &mut recorder).unwrap();
    let here = AxisVector::from_slice(&[4.0, -3.0, 2.0]);
    planner.reset(&here);
    assert_eq!(planner.advance(0.1, &mut recorder).unwrap().duration_s, 0.0);
    let again = drive(
        &mut *planner,
        &numbered(vec![line(&here, &[4.0, 5.0, 2.0], 20.0)]),
    );
    assert_eq!(again.segments[0].position(0.0), here);
    assert_eq!(again.segments[0].path_mm(0.0), 0.0);
    assert!(norm(&(again.end() - AxisVector::from_slice(&[4.0, 5.0, 2.0]))) < 1e-12);
}
