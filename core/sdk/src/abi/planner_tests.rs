//! A planner of another side, which writes what it likes.

use super::super::entry::Handle;
use super::*;
use crate::Slice;

unsafe extern "C" fn unused_describe(_: *mut c_void, _: *mut PlannerDescription, _: Errors) -> u32 {
    unreachable!("it is not asked")
}
unsafe extern "C" fn unused_check(
    _: *mut c_void,
    _: *const Block,
    _: *const Curve<'_>,
    _: *mut (),
    _: Errors,
) -> u32 {
    unreachable!("it is not asked")
}
unsafe extern "C" fn unused_finish(_: *mut c_void, _: *mut (), _: Errors) -> u32 {
    unreachable!("it is not asked")
}
unsafe extern "C" fn unused_reset(
    _: *mut c_void,
    _: *const AxisVector,
    _: *mut (),
    _: Errors,
) -> u32 {
    unreachable!("it is not asked")
}
unsafe extern "C" fn unused_make(
    _: Slice<'static, u8>,
    _: Slice<'_, u8>,
    _: *const PlannerContext,
    _: *mut *mut c_void,
    _: Errors,
) -> u32 {
    unreachable!("it is open")
}
unsafe extern "C" fn free(_: *mut c_void) {}

unsafe extern "C" fn accept_250(
    _: *mut c_void,
    _: *const Block,
    _: *const Curve<'_>,
    answer: *mut u32,
    _: Errors,
) -> u32 {
    unsafe { answer.write(250) };
    DONE
}

/// Emits a segment and a report; one of them holds 250 where an edge, or what limits a block, should be.
unsafe fn emit(sink: *const Sink, answer: *mut Advanced, bad_segment: bool) -> u32 {
    let mut segment = std::mem::MaybeUninit::new(Segment::rest(&AxisVector::ZERO, 1.0));
    let mut report = std::mem::MaybeUninit::new(BlockReport {
        limited_by: LimitedBy::Feed,
        block: 0,
        start_feed_mm_per_s: 0.0,
        peak_feed_mm_per_s: 0.0,
        end_feed_mm_per_s: 0.0,
        time_s: 1.0,
        time_constant_s: f64::NAN,
    });
    // SAFETY: the host's sink; places inside of what is there.
    unsafe {
        if bad_segment {
            (&raw mut (*segment.as_mut_ptr()).stop_on.edge)
                .cast::<u32>()
                .write(250);
        } else {
            (&raw mut (*report.as_mut_ptr()).limited_by)
                .cast::<u32>()
                .write(250);
        }
        let sink = &*sink;
        (sink.block)(sink.context, report.as_ptr());
        (sink.segment)(sink.context, segment.as_ptr());
        answer.write(Advanced {
            duration_s: 1.0,
            done: 1,
        });
    }
    DONE
}
unsafe extern "C" fn bad_segment(
    _: *mut c_void,
    _: f64,
    sink: *const Sink,
    answer: *mut Advanced,
    _: Errors,
) -> u32 {
    unsafe { emit(sink, answer, true) }
}
unsafe extern "C" fn bad_report(
    _: *mut c_void,
    _: f64,
    sink: *const Sink,
    answer: *mut Advanced,
    _: Errors,
) -> u32 {
    unsafe { emit(sink, answer, false) }
}

const fn table(
    advance: unsafe extern "C" fn(*mut c_void, f64, *const Sink, *mut Advanced, Errors) -> u32,
) -> Table {
    Table {
        make: unused_make,
        free,
        describe: unused_describe,
        check: unused_check,
        accept: accept_250,
        finish: unused_finish,
        advance,
        reset: unused_reset,
    }
}

static BAD_SEGMENT: Table = table(bad_segment);
static BAD_REPORT: Table = table(bad_report);

fn planner(table: &'static Table) -> Linked {
    let opened = |handle: *mut *mut c_void, _: Errors| {
        // SAFETY: the place is one to write to.
        unsafe { handle.write(ptr::null_mut()) };
        DONE
    };
    let handle = Handle::open([Method::PlannerNew, Method::PlannerDrop], free, opened);
    Linked(Calls {
        table,
        handle: handle.unwrap(),
    })
}

#[derive(Default)]
struct Taken(Vec<&'static str>);

impl SegmentSink for Taken {
    fn segment(&mut self, _: &Segment) {
        self.0.push("segment");
    }

    fn block(&mut self, _: &BlockReport) {
        self.0.push("block");
    }
}

#[test]
fn an_answer_that_is_no_choice_is_an_error_with_its_number() {
    let error = planner(&BAD_SEGMENT)
        .accept(&Block::at(AxisVector::ZERO), None)
        .unwrap_err();
    assert_eq!(
        error.message(),
        "its accept gives 250 as its answer: 0 and 1 are known"
    );
}

#[test]
fn what_is_emitted_with_a_number_that_is_no_choice_goes_no_further() {
    let mut taken = Taken::default();
    let error = planner(&BAD_SEGMENT).advance(1.0, &mut taken).unwrap_err();
    assert_eq!(
        error.message(),
        "its advance gives 250 as the edge of a segment: 0 to 2 are known"
    );
    assert_eq!(taken.0, ["block"]);
    let mut taken = Taken::default();
    let error = planner(&BAD_REPORT).advance(1.0, &mut taken).unwrap_err();
    assert_eq!(
        error.message(),
        "its advance gives 250 as limited_by of a block: 0 to 9 are known"
    );
    assert!(taken.0.is_empty());
}
