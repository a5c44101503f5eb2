//! What is written is there again; what is not ours, not whole or not writable is refused in words.

mod common;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use common::{any_state, any_tool, change, machine_of, owner};
use tandem_machine::Machine;
use tandem_rig::Random;
use tandem_sdk::{Axes, AxisVector};
use tandem_state::{
    Alarm, Change, Driven, Job, JobEnd, JobKind, Outcome, Owner, PersistentState, Reader,
    StateError, Store, Tool, ToolLife,
};

fn folder() -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("deeper/mill.sqlite");
    (folder, path)
}

fn example() -> Machine {
    let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/machines");
    Machine::read(&examples.join("mill-3axis.toml"), &[]).unwrap()
}

fn mill() -> Axes {
    Axes::new(&[('X', false), ('Y', false), ('Z', false), ('A', true)]).unwrap()
}

fn open(path: &Path, axes: &Axes) -> Result<Store, StateError> {
    Store::open(path, owner(axes))
}

#[test]
fn any_state_of_any_machine_is_there_again_bit_for_bit() {
    for seed in 0..20 {
        let mut random = Random::new(seed);
        let (_folder, path) = folder();
        let axes = machine_of(&mut random);
        let state = any_state(&mut random, &axes);
        let store = open(&path, &axes).unwrap();
        assert!(store.is_new(), "seed {seed}");
        store
            .commit(vec![Change::Whole(Box::new(state.clone()))])
            .unwrap();
        drop(store);
        let store = open(&path, &axes).unwrap();
        assert!(!store.is_new(), "seed {seed}");
        assert_eq!(store.load(), &state, "seed {seed}");
        assert_eq!(
            Reader::open(&path).unwrap().state().unwrap(),
            state,
            "seed {seed}, while it is open"
        );
    }
}

#[test]
fn a_file_begins_with_what_the_machine_says_and_keeps_what_it_holds_when_it_is_opened_again() {
    let (_folder, path) = folder();
    let machine = example();
    let mut begun = Store::open(&path, Owner::of(&machine)).unwrap();
    begun.fill(&machine).unwrap();
    assert_eq!(begun.load(), &PersistentState::initial(&machine));
    let mut state = begun.load().clone();
    state.offsets.origins[1] = AxisVector::from_slice(&[12.5]);
    state.parameters.insert(600, 7.0);
    let persistent = Arc::new(state.to_program(&machine.home));
    begun.commit(vec![Change::Program(persistent)]).unwrap();
    drop(begun);
    let mut again = Store::open(&path, Owner::of(&machine)).unwrap();
    again.fill(&machine).unwrap();
    // A controller that is killed now has written nothing of its own.
    assert_eq!(Reader::open(&path).unwrap().state().unwrap(), state);
    assert_eq!(again.load(), &state);
}

#[test]
fn values_of_a_file_that_was_never_given_initial_ones_stay() {
    let (_folder, path) = folder();
    let machine = example();
    let store = Store::open(&path, Owner::of(&machine)).unwrap();
    let mut state = PersistentState::default();
    state.offsets.origins[2] = AxisVector::from_slice(&[0.0, -4.0]);
    let persistent = Arc::new(state.to_program(&machine.home));
    store.commit(vec![Change::Program(persistent)]).unwrap();
    drop(store);
    let mut store = Store::open(&path, Owner::of(&machine)).unwrap();
    store.fill(&machine).unwrap();
    drop(store);
    assert_eq!(Reader::open(&path).unwrap().state().unwrap(), state);
}

#[test]
fn axes_may_come_go_and_change_their_order() {
    let (_folder, path) = folder();
    let full = mill();
    let origin = AxisVector::from_slice(&[1.0, 2.0, 3.0, 4.0]);
    let mut state = PersistentState::default();
    state.offsets.origins[0] = origin;
    open(&path, &full)
        .unwrap()
        .commit(vec![change(&state)])
        .unwrap();
    let turned = Axes::new(&[('Z', false), ('X', false), ('W', false)]).unwrap();
    let store = open(&path, &turned).unwrap();
    assert_eq!(
        store.load().offsets.origins[0],
        AxisVector::from_slice(&[3.0, 1.0, 0.0])
    );
    drop(store);
    // What the machine had no axis for was not lost.
    assert_eq!(
        open(&path, &full).unwrap().load().offsets.origins[0],
        origin
    );
    let other = Axes::new(&[('X', false), ('A', false)]).unwrap();
    let refusal = open(&path, &other).unwrap_err().to_string();
    assert!(
        refusal.contains("its axis A turns, that of this machine slides"),
        "{refusal}"
    );
    let refusal = Store::open(
        &path,
        Owner {
            machine: "lathe",
            ..owner(&full)
        },
    )
    .unwrap_err()
    .to_string();
    assert!(
        refusal.contains("\"mill\"")
            && refusal.contains("\"lathe\"")
            && refusal.contains("--state"),
        "{refusal}"
    );
}

#[test]
fn changes_one_by_one_end_where_the_state_says() {
    let (_folder, path) = folder();
    let axes = mill();
    let home = AxisVector::from_slice(&[1.0, 1.0, 1.0]);
    let store = Store::open(
        &path,
        Owner {
            home,
            ..owner(&axes)
        },
    )
    .unwrap();
    let recorder = store.recorder();
    let mut tool = any_tool(&mut Random::new(1), &axes, 3);
    let worn = any_tool(&mut Random::new(3), &axes, 5);
    let place = AxisVector::from_slice(&[7.0, 8.0]);
    let life = ToolLife {
        used_s: 12.0,
        limit_s: None,
        uses: 4,
        limit_uses: Some(5),
    };
    for change in [
        Change::ListParameter {
            number: 101,
            value: 1.0,
        },
        Change::ListParameter {
            number: 102,
            value: 7.0,
        },
        Change::Tool(Box::new(tool.clone())),
        Change::Tool(Box::new(worn.clone())),
        Change::ToolLife { number: 3, life },
        Change::Tool(Box::new(any_tool(&mut Random::new(2), &axes, 4))),
        Change::ForgetTool(4),
        Change::Turns { axis: 3, turns: -2 },
        Change::LastPosition(place),
    ] {
        recorder.record(change).unwrap();
    }
    store.flush().unwrap();

    // A program measures tool 3 and a new tool 6, stores G28 and sets parameters; #100 is nobody's, #102 becomes zero.
    let mut program = store.read_back().unwrap().to_program(&home);
    assert_eq!(program.reference, [home; 2]);
    let measured = |number| tandem_gcode::Tool {
        number,
        pocket: Some(9),
        offset: place,
        diameter_mm: 5.0,
    };
    program.tools[0] = tandem_gcode::Tool {
        pocket: tool.pocket,
        ..measured(3)
    };
    program.tools.push(measured(6));
    program.reference[0] = place;
    program.parameters = [(100, 3.0), (101, 4.0), (500, 2.0), (5061, 1.0)].into();
    program.active_system = 8;
    program.g92_stored = place;
    program.tool_offset = place;
    recorder
        .record(Change::Program(Arc::new(program.clone())))
        .unwrap();
    store.close().unwrap();

    tool.measure(&program.tools[0]);
    tool.life = life;
    let mut new = Tool::default();
    new.measure(&measured(6));
    assert_eq!(tool.wear, AxisVector::ZERO);
    let mut expected = PersistentState {
        parameters: BTreeMap::from([(101, 4.0), (102, 0.0), (500, 2.0)]),
        tools: BTreeMap::from([(3, tool), (5, worn), (6, new)]),
        reference: [Some(place), None],
        last_position: Some(place),
        ..PersistentState::default()
    };
    expected.turns[3] = -2;
    expected.offsets.active_system = 8;
    expected.offsets.g92_stored = place;
    let store = open(&path, &axes).unwrap();
    assert_eq!(store.load(), &expected);
    // What a program sees of the file is nothing new.
    program.tool_offset = AxisVector::ZERO;
    program.parameters = [(101, 4.0), (500, 2.0)].into();
    assert_eq!(store.load().to_program(&home), program);
    store
        .commit(vec![Change::Program(Arc::new(program.clone()))])
        .unwrap();
    assert_eq!(store.read_back().unwrap().tools, expected.tools);
    // That the place of G30 is home by now is known only by who is told to forget it.
    store.commit(vec![Change::ForgetReference(0)]).unwrap();
    assert_eq!(store.read_back().unwrap().reference[0], None);
    let late = recorder.record(Change::Program(Arc::new(program)));
    assert!(matches!(late, Err(StateError::Closed { .. })), "{late:?}");
}

#[test]
fn jobs_and_alarms_are_history() {
    let (_folder, path) = folder();
    let axes = mill();
    let store = open(&path, &axes).unwrap();
    let recorder = store.recorder();
    let job = |id| Job {
        id,
        kind: JobKind::Program,
        program: "part.ngc".into(),
        hash: "abc".into(),
        started_unix_ms: 1000,
        end: None,
    };
    let [first, second] = [store.next_job(), store.next_job()];
    let end = JobEnd {
        at_unix_ms: 2000,
        outcome: Outcome::EmergencyStop,
        motion_s: 1.5,
        limited_by_s: BTreeMap::from([("acceleration".to_owned(), 0.5)]),
        stops: 2,
    };
    let alarm = |id| Alarm {
        id,
        raised_unix_ms: 1500,
        code: "following-error".into(),
        text: "axis X".into(),
        job: Some(first),
        acknowledged_unix_ms: None,
    };
    let alarms = [store.next_alarm(), store.next_alarm()];
    recorder
        .record(Change::JobBegan(Box::new(job(first))))
        .unwrap();
    recorder
        .record(Change::JobEnded {
            id: first,
            end: Box::new(end.clone()),
        })
        .unwrap();
    recorder
        .record(Change::JobBegan(Box::new(job(second))))
        .unwrap();
    for id in alarms {
        recorder
            .record(Change::Raised(Box::new(alarm(id))))
            .unwrap();
    }
    let driven = Driven {
        job: second,
        hash: "abc".into(),
        line: 17,
        epoch: 3,
    };
    recorder.driven(Driven {
        line: 16,
        ..driven.clone()
    });
    recorder.driven(driven.clone());
    store
        .commit(vec![Change::Acknowledged {
            id: alarms[0],
            at_unix_ms: 1600,
        }])
        .unwrap();
    // As after a crash: the second job has no end.
    store.close().unwrap();
    let store = open(&path, &axes).unwrap();
    assert_eq!(store.load().alarms, [alarm(alarms[1])]);
    assert_eq!(store.load().driven, Some(driven));
    assert!(store.next_job() > second && store.next_alarm() > alarms[1]);
    let jobs = store.jobs(10).unwrap();
    assert_eq!(jobs.len(), 2);
    assert_eq!(
        jobs[0].end.as_ref().map(|end| end.outcome),
        Some(Outcome::Lost)
    );
    assert_eq!(
        jobs[1],
        Job {
            end: Some(end),
            ..job(first)
        }
    );
    let seen = store.alarms(1).unwrap();
    assert_eq!(seen, [alarm(alarms[1])]);
}

#[test]
fn what_is_no_number_is_refused_and_takes_nothing_with_it() {
    let (_folder, path) = folder();
    let axes = mill();
    let store = open(&path, &axes).unwrap();
    let good = Change::LastPosition(AxisVector::from_slice(&[1.0]));
    let mut tool = Tool {
        number: 5,
        ..Tool::default()
    };
    tool.wear[2] = f64::INFINITY;
    let program = |spoil: &dyn Fn(&mut PersistentState)| {
        let mut state = PersistentState::default();
        spoil(&mut state);
        change(&state)
    };
    for bad in [
        program(&|state| state.parameters = [(500, f64::NAN)].into()),
        program(&|state| state.offsets.active_system = 9),
        program(&|state| state.offsets.g92[0] = f64::NEG_INFINITY),
        program(&|state| state.offsets.rotations_rad[8] = f64::NAN),
        Change::ListParameter {
            number: 5221,
            value: 1.0,
        },
        Change::Tool(Box::new(tool.clone())),
        Change::Tool(Box::new(Tool {
            number: 0,
            ..Tool::default()
        })),
        Change::Whole(Box::new(PersistentState {
            tools: BTreeMap::from([(5, tool)]),
            ..PersistentState::default()
        })),
        Change::PolicyParameter {
            name: "x".repeat(100_000),
            value: 1.0,
        },
    ] {
        let refusal = store.commit(vec![good.clone(), bad.clone()]).unwrap_err();
        assert!(
            matches!(refusal, StateError::Value { .. }),
            "{bad:?}: {refusal}"
        );
        assert_eq!(store.recorder().record(bad).unwrap_err(), refusal);
    }
    assert_eq!(store.read_back().unwrap(), PersistentState::default());
}

#[test]
fn one_process_writes_and_others_look() {
    let (_folder, path) = folder();
    let axes = mill();
    let in_spindle = |number| {
        change(&PersistentState {
            tool_in_spindle: number,
            ..PersistentState::default()
        })
    };
    let missing = Reader::open(&path).unwrap_err();
    assert!(
        missing.to_string().contains("there is no such file"),
        "{missing}"
    );
    let store = open(&path, &axes).unwrap();
    let refusal = open(&path, &axes).unwrap_err();
    assert!(matches!(refusal, StateError::InUse { .. }), "{refusal}");
    store.commit(vec![in_spindle(4)]).unwrap();
    let reader = Reader::open(&path).unwrap();
    assert_eq!((reader.machine(), reader.axes()), ("mill", &axes));
    assert_eq!(reader.state().unwrap().tool_in_spindle, 4);
    store.commit(vec![in_spindle(5)]).unwrap();
    assert_eq!(reader.state().unwrap().tool_in_spindle, 5);
    drop(store);
    assert_eq!(open(&path, &axes).unwrap().load().tool_in_spindle, 5);
}

#[test]
fn damaged_and_foreign_files_are_refused_and_left_alone() {
    let (_folder, path) = folder();
    let axes = mill();
    let whole = any_state(&mut Random::new(7), &axes);
    open(&path, &axes)
        .unwrap()
        .commit(vec![Change::Whole(Box::new(whole))])
        .unwrap();
    let sound = std::fs::read(&path).unwrap();
    let mut refused = 0;
    for seed in 0..60 {
        let mut random = Random::new(seed);
        let mut bytes = sound.clone();
        let from = random.below(bytes.len() as u64) as usize;
        let to = bytes.len().min(from + 1 + random.below(4000) as usize);
        for byte in &mut bytes[from..to] {
            *byte = random.below(256) as u8;
        }
        std::fs::write(&path, &bytes).unwrap();
        // Free space may have been hit; what is opened all the same must be read without a panic.
        match open(&path, &axes) {
            Ok(_) | Err(StateError::OtherMachine { .. }) => {}
            Err(
                StateError::Damaged { .. } | StateError::Foreign { .. } | StateError::Newer { .. },
            ) => refused += 1,
            Err(other) => panic!("seed {seed}: {other}"),
        }
        for beside in ["-wal", "-shm"] {
            let _ = std::fs::remove_file(format!("{}{beside}", path.display()));
        }
    }
    assert!(refused > 30, "{refused} of 60 were found out");
    std::fs::write(&path, &sound[..sound.len() / 2]).unwrap();
    let refusal = open(&path, &axes).unwrap_err();
    assert!(
        matches!(refusal, StateError::Damaged { .. })
            && refusal.to_string().contains("Move the file away"),
        "{refusal}"
    );
    assert_eq!(std::fs::read(&path).unwrap(), sound[..sound.len() / 2]);

    std::fs::write(&path, "# a machine file\n".repeat(100)).unwrap();
    let refusal = open(&path, &axes).unwrap_err();
    assert!(matches!(refusal, StateError::Foreign { .. }), "{refusal}");
    std::fs::remove_file(&path).unwrap();
    let other = rusqlite::Connection::open(&path).unwrap();
    other
        .execute_batch("CREATE TABLE bookmarks (url TEXT)")
        .unwrap();
    drop(other);
    let refusal = open(&path, &axes).unwrap_err();
    assert!(
        matches!(refusal, StateError::Foreign { .. })
            && refusal.to_string().contains("another program"),
        "{refusal}"
    );
    assert!(matches!(
        Reader::open(&path),
        Err(StateError::Foreign { .. })
    ));
}
