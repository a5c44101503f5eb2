//! What goes in comes out.

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
    assert_eq!(tandem_trace::Reader::new(&bytes[..]).unwrap().header(), &header);
}

#[test]
fn motion_takes_a_fraction_of_its_raw_size() {
    let rows = motion(10 * KEY_INTERVAL);
    let bytes = written(&header(3, 0), &rows).len() as f64 / rows.len() as f64;
    // Thirteen numbers of eight bytes each.
    assert!(bytes < 0.5 * 104.0, "{bytes} bytes a sample");
}

#[test]
fn what_cannot_be_read_is_not_written() {
    let mut other = header(3, 1);
    assert!(Writer::new(vec![], &other).unwrap().sample(&motion(1)[0].0, &[]).is_err());
    other.fine_period_s = f64::NAN;
    assert!(Writer::new(vec![], &other).is_err());
    let mut long = header(3, 0);
    long.program = "x".repeat(1 << 17);
    assert!(Writer::new(vec![], &long).is_err());
}
