//! The steps of homing, without a machine.

use std::io::Write;

use super::*;

fn machine() -> Machine {
    let mut file = tempfile::NamedTempFile::with_suffix(".toml").unwrap();
    let text = "format = 1\n[axes.x]\ntravel_mm = [0, 100]\nhome_mm = 5\nmax_feed_mm_per_min = 6000\n\
                max_acceleration_mm_per_s2 = 1000\n[homing.x]\ninput = 7\nsearch_mm_per_min = -600\n\
                latch_mm_per_min = 60\nback_off_mm = 2\nswitch_mm = -1\n\
                [planner]\nplugin = \"look-ahead\"\n[driver]\nplugin = \"sim\"\n";
    file.write_all(text.as_bytes()).unwrap();
    Machine::read(file.path(), &[]).unwrap()
}

fn rest(cause: RestCause, at_mm: f64, latch_mm: Option<f64>) -> Rest {
    let at = AxisVector::from_slice(&[at_mm]);
    let latch = latch_mm.map(|mm| AxisVector::from_slice(&[mm]));
    let (stop_on, epoch, tick, block, line) = (StopOn::default(), 0, 0, 0, 0);
    Rest {
        epoch,
        cause,
        tick,
        block,
        line,
        stop_on,
        position: at,
        latch,
        program_time_s: 0.0,
        path_mm: 0.0,
    }
}

fn next(homing: &mut Homing) -> Vec<Item> {
    let mut items = Vec::new();
    homing.next_items(&mut items).unwrap();
    items
}

fn block(items: &[Item]) -> (f64, f64, Edge) {
    let Some(Item::Block(block, _)) = items.first() else {
        panic!("{items:?}")
    };
    (block.end[0], block.feed_mm_per_s, block.stop_on.edge)
}

#[test]
fn an_axis_finds_its_switch_and_goes_home() {
    let machine = machine();
    let mut homing = Homing::new(&machine, &machine.homing, None);
    assert!(matches!(next(&mut homing)[..], [Item::Wait(_)]));
    assert!(next(&mut homing).is_empty(), "the machine has not answered");
    homing.provide_input(0.0);
    let (end, feed, edge) = block(&next(&mut homing));
    assert!(
        (end + 112.0).abs() < 1e-9 && feed == 10.0 && edge == Edge::Rising,
        "{end}"
    );
    assert!(homing.provide_rest(&rest(RestCause::Edge, -40.5, Some(-40.25))));
    let back = next(&mut homing);
    assert_eq!((block(&back), back.len()), ((-38.5, 10.0, Edge::None), 2));
    homing.provide_input(0.0);
    let (end, feed, edge) = block(&next(&mut homing));
    assert!(
        (end + 42.6).abs() < 1e-9 && feed == 1.0 && edge == Edge::Rising,
        "{end}"
    );
    assert!(homing.provide_rest(&rest(RestCause::Edge, -40.5, Some(-40.0))));
    let Item::Event(event) = next(&mut homing)[0] else {
        panic!("an event")
    };
    assert_eq!((event.kind, event.value), (EventKind::Correct, 39.0));
    assert!(homing.provide_rest(&rest(RestCause::Corrected, -1.5, None)));
    let home = next(&mut homing);
    assert_eq!(block(&home), (5.0, f64::INFINITY, Edge::None));
    assert!(matches!(
        home[1],
        Item::Event(Event {
            kind: EventKind::Homed,
            before_block: 4,
            ..
        })
    ));
    assert!(
        !homing.next_items(&mut Vec::new()).unwrap(),
        "there is no program"
    );
}

#[test]
fn what_a_switch_does_not_do_is_told() {
    let machine = machine();
    let failure = |answers: &dyn Fn(&mut Homing)| {
        let mut homing = Homing::new(&machine, &machine.homing, None);
        next(&mut homing);
        answers(&mut homing);
        homing.next_items(&mut Vec::new()).unwrap_err()
    };
    let never = failure(&|homing| {
        homing.provide_input(0.0);
        next(homing);
        homing.provide_rest(&rest(RestCause::Missed, -112.0, None));
    });
    let text = "homing x: the switch on input 7 did not trip within 112.000 mm: it does not work, or the search goes away \
                from it";
    assert_eq!(never, text);
    let stuck = failure(&|homing| {
        homing.provide_input(1.0);
        assert_eq!(block(&next(homing)).2, Edge::Falling);
        homing.provide_rest(&rest(RestCause::Missed, 112.0, None));
    });
    assert!(
        stuck.contains("is on and was not released within 112.000 mm"),
        "{stuck}"
    );
    let sticks = failure(&|homing| {
        homing.provide_input(0.0);
        next(homing);
        homing.provide_rest(&rest(RestCause::Edge, -3.0, Some(-2.9)));
        next(homing);
        homing.provide_input(-1.0);
    });
    assert!(
        sticks.contains("is still on 2.000 mm behind its edge"),
        "{sticks}"
    );
}
