//! Windows: filled by order, whatever the source hands out at once.

use std::sync::{Arc, Mutex};

use super::*;
use crate::doubles::{Answer, Script, Waits, block, probe, rest};
use tandem_gcode::{Input, InputMode, InputWait};
use tandem_sdk::{Curve, Event, EventKind};

/// What a policy was shown: blocks of each window by their index, and the block behind it.
type Seen = Arc<Mutex<Vec<(Vec<u64>, Option<u64>)>>>;

/// Caps the feed of every block at its index in the window.
#[derive(Default)]
struct Recorder {
    window: Vec<u64>,
    seen: Seen,
    /// What the program stated last of number 0, and what it was for each block.
    stated: f64,
    of_blocks: Arc<Mutex<Vec<f64>>>,
}

impl BlockPolicy for Recorder {
    fn state(&mut self, which: usize, value: f64) {
        assert_eq!(which, 0);
        self.stated = value;
    }

    fn offer(&mut self, block: &Block, _curve: Option<Curve<'_>>) {
        self.window.push(block.index);
        self.of_blocks.lock().unwrap().push(self.stated);
    }

    fn decide(&mut self, next: Option<(&Block, Option<Curve<'_>>)>) {
        let window = std::mem::take(&mut self.window);
        self.seen
            .lock()
            .unwrap()
            .push((window, next.map(|(block, _)| block.index)));
    }

    fn tuned(&mut self, index: usize, block: &Block, _curve: Option<Curve<'_>>) -> Option<Block> {
        Some(Block {
            feed_cap_mm_per_s: index as f64,
            path_tolerance_mm: 0.25,
            time_constant_s: 0.5,
            line: 999,
            ..*block
        })
    }
}

fn wait() -> Item {
    let (input, mode) = (Input::Digital(0), InputMode::High);
    Item::Wait(InputWait {
        line: 1,
        before_block: 0,
        input,
        mode,
        timeout_s: 1.0,
    })
}

fn tuned(script: Vec<Result<Vec<Item>, String>>) -> (Tuned<Script, Recorder>, Seen) {
    let recorder = Recorder::default();
    let seen = Arc::clone(&recorder.seen);
    (Tuned::new(Script::of(script), recorder), seen)
}

/// Everything that comes, until the source is dry or refuses.
fn drain(source: &mut impl Source) -> (Vec<Item>, Option<String>) {
    let mut items = vec![];
    for _ in 0..1000 {
        let before = items.len();
        match source.next_items(&mut items) {
            Ok(false) if items.len() == before => return (items, None),
            Ok(_) => {}
            Err(error) => return (items, Some(error)),
        }
    }
    panic!("it says that there is more, and never gives it");
}

fn windows(seen: &Seen) -> Vec<(usize, Option<u64>)> {
    seen.lock()
        .unwrap()
        .iter()
        .map(|(window, next)| (window.len(), *next))
        .collect()
}

#[test]
fn windows_are_full_whatever_comes_at_once() {
    for at_once in [1, 7, 64, 65, 200] {
        let all: Vec<u64> = (0..150).collect();
        let script = all
            .chunks(at_once)
            .map(|chunk| Ok(chunk.iter().map(|i| block(*i)).collect()))
            .collect();
        let (mut source, seen) = tuned(script);
        let (items, error) = drain(&mut source);
        assert_eq!(
            windows(&seen),
            [(64, Some(64)), (64, Some(128)), (22, None)],
            "{at_once} at once"
        );
        let caps = items.iter().map(|item| block_of(item).0).map(|b| {
            (
                b.index,
                b.feed_cap_mm_per_s,
                b.path_tolerance_mm,
                b.time_constant_s,
                b.line,
            )
        });
        let expected = all.iter().map(|i| (*i, (*i % 64) as f64, 0.25, 0.5, 1));
        assert!(
            caps.eq(expected) && error.is_none(),
            "only what a policy may change has changed"
        );
    }
}

#[test]
fn a_stretch_ends_a_window_and_nothing_behind_it_is_asked_for() {
    let event = || Item::Event(Event::new(EventKind::Mist, 1, 1, 0, 0.0));
    let script = vec![
        Ok(vec![block(0), event()]),
        Ok(vec![block(1), wait()]),
        Ok(vec![block(2)]),
        Ok(vec![probe(3), event()]),
        Ok(vec![block(4), Item::End]),
    ];
    let (mut source, seen) = tuned(script);
    for expected in [4, 3, 2] {
        let mut items = vec![];
        assert_eq!(source.next_items(&mut items), Ok(true));
        assert_eq!(items.len(), expected);
    }
    assert_eq!(windows(&seen), [(2, None), (2, None), (1, None)]);
}

#[test]
fn nothing_for_now_ends_a_window() {
    let (mut source, seen) = tuned(vec![Ok(vec![block(0)]), Ok(vec![]), Ok(vec![block(1)])]);
    drain(&mut source);
    assert_eq!(windows(&seen), [(1, None), (1, None)]);
}

#[test]
fn what_waits_until_all_is_driven_ends_a_window() {
    let mut script = Script::of(vec![Ok(vec![block(0)]), Ok(vec![block(1)])]);
    script.waits_for_rest = true;
    let recorder = Recorder::default();
    let seen = Arc::clone(&recorder.seen);
    let mut source = Tuned::new(script, recorder);
    for _ in 0..2 {
        assert_eq!(source.next_items(&mut vec![]), Ok(true));
    }
    assert_eq!(windows(&seen), [(1, None), (1, None)]);
}

#[test]
fn blocks_before_an_error_are_handed_out_first() {
    let (mut source, seen) = tuned(vec![Ok(vec![block(0)]), Err("line 2: no".to_string())]);
    let (items, error) = drain(&mut source);
    assert_eq!(
        (items.len(), error.as_deref(), windows(&seen)),
        (1, Some("line 2: no"), vec![(1, None)])
    );
}

#[test]
fn an_abort_drops_the_blocks_of_windows_to_come() {
    let (mut source, seen) = tuned(vec![
        Ok((0..100).map(block).collect()),
        Ok(vec![block(100)]),
    ]);
    source.next_items(&mut vec![]).unwrap();
    assert!(source.provide_rest(&rest(RestCause::Abort)));
    let (items, _) = drain(&mut source);
    assert_eq!(
        (items.len(), windows(&seen)),
        (1, vec![(64, Some(64)), (1, None)])
    );
}

#[test]
fn what_the_program_states_holds_from_its_place_on_however_windows_fall() {
    let stated = |value: f64| Item::Stated { which: 0, value };
    for at_once in [1, 3, 64, 65, 400] {
        // In front of the first block, between two windows, within one, behind the last block before a wait.
        let mut items = vec![stated(1.0)];
        for index in 0..150 {
            items.push(block(index));
            match index {
                63 => items.push(stated(2.0)),
                100 => items.extend([stated(9.0), stated(3.0)]),
                120 => items.extend([stated(4.0), wait()]),
                _ => {}
            }
        }
        items.push(stated(5.0));
        let mut script: Vec<Vec<Item>> = vec![vec![]];
        for item in items {
            let ends = ends_stretch(&item);
            let last = script.last_mut().unwrap();
            last.push(item);
            if ends || last.len() == at_once {
                script.push(vec![]);
            }
        }
        script.retain(|items| !items.is_empty());
        let recorder = Recorder::default();
        let seen = Arc::clone(&recorder.of_blocks);
        let mut source = Tuned::new(Script::of(script.into_iter().map(Ok).collect()), recorder);
        let (handed, error) = drain(&mut source);
        assert_eq!(error, None);
        assert!(
            !handed
                .iter()
                .any(|item| matches!(item, Item::Stated { .. })),
            "it is the policy's alone"
        );
        let expected = |index: u64| match index {
            0..=63 => 1.0,
            64..=100 => 2.0,
            101..=120 => 3.0,
            _ => 4.0,
        };
        let expected: Vec<f64> = (0..150).map(expected).collect();
        assert_eq!(*seen.lock().unwrap(), expected, "{at_once} at once");
    }
}

#[test]
fn more_can_come_from_a_window_or_from_the_source() {
    let mut script = Script::of(vec![Ok((0..70).map(block).collect())]);
    script.waits_for_rest = true;
    let mut source = Tuned::new(script, Recorder::default());
    assert!(!source.may_go_on(false), "the source waits for a rest");
    assert!(source.may_go_on(true));
    source.next_items(&mut vec![]).unwrap();
    assert!(source.may_go_on(false), "six blocks are left of what came");
}

#[test]
fn what_an_input_has_answered_reaches_the_program_behind_a_policy() {
    let script = Script::of(vec![Ok(vec![wait()])]);
    let told = Arc::clone(&script.told);
    let mut source = Tuned::new(script, Recorder::default());
    source.next_items(&mut vec![]).unwrap();
    source.provide_input(-1.0);
    assert_eq!(*told.lock().unwrap(), [Answer::Input(-1.0)]);
}

#[test]
fn a_source_behind_a_policy_streams_and_counts_the_periods_for_which_it_waits() {
    let mut source = Tuned::new(Waits::default(), Recorder::default());
    assert!(
        source.streams(),
        "more may come in time: the end of what is there is no rest"
    );
    assert!(!source.is_waiting());
    source.period();
    assert!(source.is_waiting());
}
