//! What goes in comes out.

use std::cell::RefCell;
use std::io::{self, BufWriter, Write};
use std::rc::Rc;

use proptest::prelude::*;
use tandem_trace::{Ending, Item, KEY_INTERVAL, Writer};

use crate::made::{any_rows, bits, header, motion, read, written};

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn every_bit_survives((axes, signals, rows) in (1..=8_usize, 0..=8_usize)
        .prop_flat_map(|(axes, signals)| (Just(axes), Just(signals), any_rows(axes, signals, 600))))
    {
        let (items, ending) = read(&written(&header(axes, signals), &rows)).unwrap();
        prop_assert_eq!(ending, Ending::Complete);
        prop_assert_eq!(items.len(), rows.len());
        for (number, (item, row)) in items.iter().zip(&rows).enumerate() {
            let Item::Record(record) = item else { panic!("{item:?}") };
            prop_assert_eq!(record.number, number as u64);
            prop_assert_eq!(bits(&(record.sample, record.signals)), bits(row));
        }
    }
}

#[test]
fn the_header_survives() {
    let header = header(8, 8);
    let bytes = written(&header, &[]);
    let reader = tandem_trace::Reader::new(&bytes[..]).unwrap();
    assert_eq!(reader.header(), &header);
    assert_eq!(reader.format(), tandem_trace::FORMAT);
}

/// What a format does not have is not looked for in it.
#[test]
fn what_is_switched_came_with_format_3_and_the_age_with_4() {
    let has = |format| {
        (
            tandem_trace::has_switched(format),
            tandem_trace::has_age(format),
        )
    };
    assert_eq!(has(2), (false, false));
    assert_eq!(has(3), (true, false));
    assert_eq!(has(4), (true, true));
}

/// Gives nothing every other time, as a system call does that a signal has interrupted.
struct Interrupted<'a>(&'a [u8], bool);

impl io::Read for Interrupted<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.1 = !self.1;
        if self.1 {
            return Err(io::ErrorKind::Interrupted.into());
        }
        self.0.read(buffer)
    }
}

#[test]
fn a_reading_that_is_interrupted_goes_on() {
    let bytes = written(&header(2, 0), &[]);
    let reader = tandem_trace::Reader::new(Interrupted(&bytes, false)).unwrap();
    assert_eq!(reader.header(), &header(2, 0));
    assert_eq!(reader.map(Result::unwrap).count(), 0);
}

#[test]
fn motion_takes_a_fraction_of_its_raw_size() {
    let rows = motion(10 * KEY_INTERVAL);
    let bytes = written(&header(3, 0), &rows).len() as f64 / rows.len() as f64;
    // Thirteen numbers of eight bytes each.
    assert!(bytes < 0.5 * 104.0, "{bytes} bytes a sample");
}

#[test]
fn commands_stand_before_the_sample_of_their_tick() {
    let mut writer = Writer::new(vec![], &header(3, 0)).unwrap();
    let rows = motion(KEY_INTERVAL + 20);
    for (index, (sample, _)) in rows.iter().enumerate() {
        // Before a key, behind one, and in the midst.
        if [0, 1, 7, 256, 257].contains(&index) {
            writer.command(&format!("{index},hold")).unwrap();
        }
        writer.sample(sample, &[]).unwrap();
    }
    writer.command("300,feed-override,0.5").unwrap();
    let (items, ending) = read(&writer.finish().unwrap()).unwrap();
    assert_eq!(ending, Ending::Complete);
    let mut expected = vec![];
    for number in 0..rows.len() {
        expected.extend(
            [0, 1, 7, 256, 257]
                .contains(&number)
                .then(|| format!("{number},hold")),
        );
        expected.push(number.to_string());
    }
    expected.push("300,feed-override,0.5".to_string());
    let said = items.iter().map(|item| match item {
        Item::Record(record) => record.number.to_string(),
        Item::Command(line) => line.clone(),
        Item::Damage(damage) => panic!("{damage:?}"),
    });
    assert!(said.eq(expected));
    assert!(
        Writer::new(vec![], &header(3, 0))
            .unwrap()
            .command(&"x".repeat(1 << 13))
            .is_err()
    );
}

#[test]
fn what_cannot_be_read_is_not_written() {
    let mut other = header(3, 1);
    assert!(
        Writer::new(vec![], &other)
            .unwrap()
            .sample(&motion(1)[0].0, &[])
            .is_err()
    );
    for none_s in [f64::NAN, f64::INFINITY, 0.0, -0.001] {
        other.fine_period_s = none_s;
        assert!(Writer::new(vec![], &other).is_err(), "{none_s}");
    }
    let mut long = header(3, 0);
    long.program = "x".repeat(1 << 17);
    assert!(Writer::new(vec![], &long).is_err());
}

/// A file whose bytes others see once they are written.
#[derive(Clone, Default)]
struct File(Rc<RefCell<Vec<u8>>>);

impl Write for File {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.borrow_mut().write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

#[test]
fn what_lies_before_a_key_is_in_the_file_while_the_run_goes_on() {
    let (file, header) = (File::default(), header(3, 0));
    // More room than is written here: what the file holds has been flushed.
    let buffer = BufWriter::with_capacity(1 << 20, file.clone());
    let mut writer = Writer::new(buffer, &header).unwrap();
    let rows = motion(2 * KEY_INTERVAL + 1);
    for (number, (sample, _)) in rows.iter().enumerate() {
        writer.sample(sample, &[]).unwrap();
        let before_the_key = number as u64 / KEY_INTERVAL * KEY_INTERVAL;
        if before_the_key == 0 || !number.is_multiple_of(KEY_INTERVAL as usize / 2) {
            continue;
        }
        let (items, ending) = read(&file.0.borrow()).unwrap();
        assert_eq!(
            items.len() as u64,
            before_the_key,
            "behind sample {number}: {ending:?}"
        );
    }
}
