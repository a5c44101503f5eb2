//! A computer that loses power, a disk that is full, a file that cannot be written: on a file system layer of SQLite's that
//! forgets what was not synced.
//!
//! `STATE_CUTS=2000` takes power away more often, `STATE_SEED=17` judges one history.

#![allow(clippy::doc_markdown, reason = "SQLite is a name, not code")]
#![allow(
    clippy::cast_possible_wrap,
    reason = "SQLite takes sizes as signed numbers"
)]

#[path = "../common/mod.rs"]
mod common;
mod disk;

use std::path::{Path, PathBuf};

use common::{all_say, axes, owner, recorded, said};
use disk::Disk;
use tandem_rig::Random;
use tandem_state::{Driven, StateError, Store};

fn open(path: &Path, disk: &Disk) -> Result<Store, StateError> {
    Store::open_on(path, owner(&axes()), Some(disk.name()))
}

fn folder() -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mill.sqlite");
    (folder, path)
}

/// One machine whose computer loses power several times.
fn history(seed: u64) -> u64 {
    let mut random = Random::new(seed);
    let (_folder, path) = folder();
    let disk = Disk::new(&format!("power-{seed}"));
    let mut acknowledged = 0;
    for cut in 0..4 {
        // Some end while the file is opened and repaired, some behind a checkpoint.
        let operations = random.pick(&[40, 400, 4000, 9000]);
        disk.cut_after(1 + random.below(operations));
        let opened = open(&path, &disk);
        let mut why = opened.as_ref().err().map(ToString::to_string);
        if let Ok(store) = opened {
            let whole = said(store.load())
                .unwrap_or_else(|| panic!("seed {seed}, cut {cut}: torn: {:?}", store.load()));
            assert!(
                whole == acknowledged || whole == acknowledged + 1,
                "seed {seed}, cut {cut}: {acknowledged} was on disk, now it is {whole}"
            );
            acknowledged = whole;
            let recorder = store.recorder();
            loop {
                why = store
                    .commit(all_say(acknowledged + 1))
                    .err()
                    .map(|error| error.to_string());
                if why.is_some() {
                    break;
                }
                acknowledged += 1;
                recorder.record(recorded(acknowledged)).unwrap();
                recorder.driven(Driven {
                    job: 1,
                    hash: "h".into(),
                    line: 1,
                    epoch: acknowledged,
                });
            }
        }
        assert!(
            disk.is_cut(),
            "seed {seed}, cut {cut}: writing ended before the power did: {why:?}"
        );
        disk.power_on(&mut random);
    }
    let store = open(&path, &disk).unwrap_or_else(|error| panic!("seed {seed}: {error}"));
    let whole =
        said(store.load()).unwrap_or_else(|| panic!("seed {seed}: torn: {:?}", store.load()));
    assert!(
        whole == acknowledged || whole == acknowledged + 1,
        "seed {seed}: {acknowledged} was on disk, now it is {whole}"
    );
    acknowledged
}

#[test]
fn a_power_cut_loses_nothing_acknowledged_and_tears_nothing() {
    let number = |name| {
        std::env::var(name)
            .ok()
            .and_then(|text| text.parse::<u64>().ok())
    };
    let seeds = match number("STATE_SEED") {
        Some(seed) => seed..seed + 1,
        None => 0..number("STATE_CUTS").unwrap_or(100) / 4,
    };
    let (count, writes) = (4 * seeds.clone().count(), seeds.map(history).sum::<u64>());
    println!("{count} cuts, {writes} writes");
    assert!(writes > 0);
}

#[test]
fn a_full_disk_refuses_requests_keeps_what_was_recorded_and_goes_on() {
    let (_folder, path) = folder();
    let disk = Disk::new("full");
    let store = open(&path, &disk).unwrap();
    store.commit(all_say(1)).unwrap();
    disk.hold_at_most(disk.bytes() + 2000);
    let refusal = store.commit(all_say(2)).unwrap_err();
    assert!(matches!(refusal, StateError::Write { .. }), "{refusal}");
    assert!(
        refusal.to_string().contains("the disk is full; make room"),
        "{refusal}"
    );
    let recorder = store.recorder();
    for value in 0..20_000 {
        recorder.record(recorded(value)).unwrap();
    }
    assert!(store.commit(all_say(3)).is_err());
    assert_eq!(store.trouble(), Some(refusal));
    disk.hold_at_most(usize::MAX);
    store.flush().unwrap();
    assert_eq!(store.trouble(), None);
    drop(store);
    let store = open(&path, &disk).unwrap();
    assert_eq!(said(store.load()), Some(1), "what was refused is not there");
    assert_eq!(
        store.load().parameters.get(&100),
        Some(&19_999.0),
        "what was recorded is"
    );
}

#[test]
fn a_file_that_cannot_be_written_is_an_error_in_words() {
    let (_folder, path) = folder();
    let disk = Disk::new("read-only");
    drop(open(&path, &disk).unwrap());
    disk.read_only();
    let refusal = open(&path, &disk).unwrap_err().to_string();
    assert!(
        refusal.contains("mill.sqlite") && refusal.contains("read-only"),
        "{refusal}"
    );
}
