//! Traces that were cut short or changed: what is sound is read, what is not is said, nothing panics.

use proptest::prelude::*;
use tandem_trace::{Cause, Damage, Ending, Item, KEY_INTERVAL, MAGIC, Reader, Record};

use crate::made::{Row, bits, header, motion, read, written};

/// Three groups of records that begin with a key, and a few more.
const COUNT: u64 = 3 * KEY_INTERVAL + 9;

fn records(items: &[Item]) -> Vec<Record> {
    items
        .iter()
        .filter_map(|item| {
            if let Item::Record(record) = item {
                Some(*record)
            } else {
                None
            }
        })
        .collect()
}

fn damages(items: &[Item]) -> Vec<Damage> {
    items
        .iter()
        .filter_map(|item| {
            if let Item::Damage(damage) = item {
                Some(*damage)
            } else {
                None
            }
        })
        .collect()
}

/// Every record is the one that was written under its number, in order.
fn are_sound(items: &[Item], rows: &[Row]) -> bool {
    let records = records(items);
    let same = |r: &Record| {
        rows.get(r.number as usize)
            .is_some_and(|row| bits(row) == bits(&(r.sample, r.signals)))
    };
    records.iter().all(same)
        && records
            .windows(2)
            .all(|pair| pair[0].number < pair[1].number)
}

/// Where each record ends, the closing one last.
fn ends(bytes: &[u8]) -> Vec<usize> {
    let starts: Vec<_> = records(&read(bytes).unwrap().0)
        .iter()
        .map(|r| r.offset as usize)
        .collect();
    // The closing record: head, marker, number.
    [&starts[1..], &[bytes.len() - 18, bytes.len()]].concat()
}

#[test]
fn cut_at_every_byte_all_complete_records_are_read() {
    let rows = motion(KEY_INTERVAL + 40);
    let bytes = written(&header(3, 0), &rows);
    let ends = ends(&bytes);
    let first = records(&read(&bytes).unwrap().0)[0].offset as usize;
    for cut in 0..bytes.len() {
        let Ok((items, ending)) = read(&bytes[..cut]) else {
            assert!(cut < first, "cut at {cut}");
            continue;
        };
        let complete = ends.iter().take_while(|end| **end <= cut).count();
        assert_eq!(items.len(), complete, "cut at {cut}");
        assert!(are_sound(&items, &rows), "cut at {cut}");
        let byte = if complete == 0 {
            first
        } else {
            ends[complete - 1]
        } as u64;
        assert_eq!(ending, Ending::Truncated { byte }, "cut at {cut}");
    }
}

#[test]
fn one_flipped_bit_anywhere_is_noticed() {
    let rows = motion(KEY_INTERVAL + 3);
    let sound = written(&header(3, 0), &rows);
    for byte in 0..sound.len() {
        let mut bytes = sound.clone();
        bytes[byte] ^= 1 << (byte % 8);
        is_noticed(&bytes, &rows);
    }
}

/// The bytes are refused, or read with the damage said.
fn is_noticed(bytes: &[u8], rows: &[Row]) {
    let Ok((items, ending)) = read(bytes) else {
        return;
    };
    assert!(are_sound(&items, rows));
    assert!(ending != Ending::Complete || !damages(&items).is_empty());
}

#[test]
fn damage_costs_records_up_to_the_next_key_and_says_how_many() {
    let rows = motion(COUNT);
    let mut bytes = written(&header(3, 0), &rows);
    let ends = ends(&bytes);
    let hit = KEY_INTERVAL as usize + 17;
    bytes[ends[hit - 1] + 9] ^= 0x40;
    let (items, ending) = read(&bytes).unwrap();
    assert_eq!(ending, Ending::Complete);
    let [damage] = damages(&items)[..] else {
        panic!("{:?}", damages(&items))
    };
    assert_eq!(
        (damage.from, damage.lost_records),
        (ends[hit - 1] as u64, Some(KEY_INTERVAL - 17))
    );
    assert_eq!(damage.to, ends[2 * KEY_INTERVAL as usize - 1] as u64);
    assert_eq!(records(&items).len() as u64, COUNT - (KEY_INTERVAL - 17));
    assert!(are_sound(&items, &rows));
}

#[test]
fn a_missing_group_a_doubled_group_and_bytes_at_the_end_are_noticed() {
    let rows = motion(COUNT);
    let bytes = written(&header(3, 0), &rows);
    let ends = ends(&bytes);
    let [one, two] = [1, 2].map(|group| ends[group * KEY_INTERVAL as usize - 1]);
    for changed in [
        [&bytes[..one], &bytes[two..]].concat(),
        [&bytes[..two], &bytes[one..]].concat(),
        [&bytes[..], b"more"].concat(),
        [&bytes[..ends[4]], &bytes[ends[5]..]].concat(),
    ] {
        let (items, _) = read(&changed).unwrap();
        assert_eq!(damages(&items).len(), 1);
        assert!(are_sound(&items, &rows));
    }
}

#[test]
fn records_of_another_trace_are_not_taken() {
    let (mut other, rows) = (header(3, 0), motion(COUNT));
    let bytes = written(&other, &rows);
    other.program.replace_range(..1, "q");
    let foreign = written(&other, &rows);
    let at = ends(&bytes)[KEY_INTERVAL as usize - 1];
    let (items, ending) = read(&[&bytes[..at], &foreign[at..]].concat()).unwrap();
    assert_eq!(records(&items).len() as u64, KEY_INTERVAL);
    assert_eq!(
        (damages(&items).len(), ending),
        (1, Ending::Truncated { byte: at as u64 })
    );
}

#[test]
fn other_files_are_refused_with_the_cause() {
    let refused = |bytes: &[u8]| Reader::new(bytes).err().unwrap().to_string();
    assert_eq!(
        refused(b""),
        "byte 0: not a Tandem trace (its first bytes are others)"
    );
    assert_eq!(
        refused(b"t_s,line"),
        "byte 0: not a Tandem trace (its first bytes are others)"
    );
    let mut bytes = written(&header(3, 0), &[]);
    assert_eq!(
        refused(&bytes[..30]),
        "byte 30: the file ends within its header"
    );
    bytes[MAGIC.len()] = 9;
    assert_eq!(
        refused(&bytes),
        "byte 8: the trace has format 9, this program reads formats 1 to 4"
    );
    bytes[MAGIC.len()] = 1;
    bytes[20] ^= 1;
    assert_eq!(
        refused(&bytes),
        "byte 0: the header is damaged: its checksum differs"
    );
}

#[test]
fn what_the_system_refuses_is_an_error_once() {
    struct Broken;
    impl std::io::Read for Broken {
        fn read(&mut self, _: &mut [u8]) -> std::io::Result<usize> {
            Err(std::io::ErrorKind::TimedOut.into())
        }
    }
    let bytes = written(&header(3, 0), &motion(3));
    let reader = Reader::new(std::io::Read::chain(&bytes[..bytes.len() - 20], Broken));
    let Ok(mut reader) = reader else { return };
    let last = reader.by_ref().last().unwrap();
    assert!(matches!(last.unwrap_err().cause, Cause::Io(_)));
    assert!(reader.next().is_none());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    #[test]
    fn random_flips_are_never_taken_for_data(flips in prop::collection::vec((any::<usize>(), 1..=255_u8), 1..20)) {
        let rows = motion(COUNT);
        let sound = written(&header(3, 0), &rows);
        let mut bytes = sound.clone();
        for (place, bits) in flips {
            let place = place % bytes.len();
            bytes[place] ^= bits;
        }
        if bytes != sound {
            is_noticed(&bytes, &rows);
        }
    }

    #[test]
    fn bytes_put_in_or_taken_out_are_noticed(place: usize, bytes in prop::collection::vec(any::<u8>(), 0..40), out in 0..300_usize) {
        let rows = motion(COUNT);
        let sound = written(&header(3, 0), &rows);
        let place = place % sound.len();
        let after = (place + out).min(sound.len());
        let changed = [&sound[..place], &bytes, &sound[after..]].concat();
        if changed != sound {
            is_noticed(&changed, &rows);
        }
    }

    #[test]
    fn any_bytes_are_read_without_a_panic(bytes in prop::collection::vec(any::<u8>(), 0..4000), keep in 0..200_usize) {
        let _ = read(&bytes);
        let start = written(&header(2, 1), &[]);
        let _ = read(&[&start[..keep.min(start.len())], &bytes].concat());
    }
}

#[test]
fn a_command_behind_damage_is_read_and_samples_wait_for_the_next_key() {
    let rows = motion(2 * KEY_INTERVAL);
    let mut writer = tandem_trace::Writer::new(vec![], &header(3, 0)).unwrap();
    for (index, (sample, _)) in rows.iter().enumerate() {
        if index == 100 {
            writer.command("100,hold").unwrap();
        }
        writer.sample(sample, &[]).unwrap();
    }
    let mut bytes = writer.finish().unwrap();
    let sound = records(&read(&bytes).unwrap().0);
    bytes[sound[50].offset as usize + 8] ^= 1;
    let (items, ending) = read(&bytes).unwrap();
    assert_eq!(ending, Ending::Complete);
    assert!(items.contains(&Item::Command("100,hold".to_string())));
    assert!(are_sound(&items, &rows));
    let numbers: Vec<_> = records(&items).iter().map(|r| r.number).collect();
    assert!(
        numbers
            .iter()
            .copied()
            .eq((0..50).chain(KEY_INTERVAL..2 * KEY_INTERVAL))
    );
    let lost: u64 = damages(&items)
        .iter()
        .filter_map(|damage| damage.lost_records)
        .sum();
    assert_eq!(lost, KEY_INTERVAL - 50);
}
