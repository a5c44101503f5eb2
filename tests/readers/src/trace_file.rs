//! Any bytes as a binary trace, and any bytes in the middle of a sound one: reading ends, says how, and takes no more
//! memory than a record. Both are read as well with their checksums put right: hardly any bytes have those by chance, and
//! what is behind them would never be read.

use std::sync::LazyLock;

use tandem_rings::Sample;
use tandem_sdk::Axes;
use tandem_trace::{Header, Item, MAGIC, Reader, Writer};

/// Bytes of a header before its body: magic, format, length of the body.
const FIXED_BYTES: usize = MAGIC.len() + 8;
/// Bytes of a record before its content: kind and length, checksum.
const HEAD_BYTES: usize = 6;
/// Bits of the length in a record's first word; the kind is above them.
const LENGTH_BITS: u32 = 14;
/// The kind whose checksum goes on from the record before, and not from the header.
const SAMPLE: u16 = 1;

/// A sound trace of 600 samples: more than two keys.
static SOUND: LazyLock<Vec<u8>> = LazyLock::new(|| {
    let header = Header {
        fine_period_s: 0.001,
        axes: Axes::new(&[('X', false), ('A', true)]).expect("two axes"),
        machine: "mill".to_string(),
        program: "slot".to_string(),
        planner: "smooth".to_string(),
        dry_run: false,
        signals: vec!["torque".to_string()],
    };
    let mut writer = Writer::new(Vec::new(), &header).expect("memory");
    for tick in 0..600u64 {
        let mut sample = Sample {
            tick,
            ..Sample::default()
        };
        sample.command[0] = (tick as f64 * 0.01).sin();
        if tick == 300 {
            writer.command("300,hold").expect("memory");
        }
        writer.sample(&sample, &[0.5]).expect("memory");
    }
    writer.finish().expect("memory")
});

/// Reads to the end; gives the samples.
fn read(bytes: &[u8]) -> u64 {
    let Ok(mut reader) = Reader::new(bytes) else {
        return 0;
    };
    let mut samples = 0;
    for item in reader.by_ref() {
        match item {
            Ok(Item::Record(_)) => samples += 1,
            Ok(_) => {}
            Err(error) => {
                assert!(!error.to_string().is_empty());
                return samples;
            }
        }
    }
    assert!(reader.ending().is_some());
    samples
}

/// Puts every checksum right, of the header and of each record, as far as their lengths lead.
fn put_checksums_right(trace: &mut [u8]) {
    let Some(length) = trace
        .get(FIXED_BYTES - 4..)
        .and_then(<[u8]>::first_chunk::<4>)
    else {
        return;
    };
    let end = FIXED_BYTES.saturating_add(u32::from_le_bytes(*length) as usize);
    if end.saturating_add(4) > trace.len() {
        return;
    }
    let header = crc32fast::hash(&trace[..end]);
    trace[end..end + 4].copy_from_slice(&header.to_le_bytes());
    let (mut previous, mut rest) = (header, &mut trace[end + 4..]);
    while let Some(first) = rest.first_chunk::<2>() {
        let word = u16::from_le_bytes(*first);
        let end = HEAD_BYTES + usize::from(word & ((1 << LENGTH_BITS) - 1));
        if end > rest.len() {
            return;
        }
        let (record, behind) = rest.split_at_mut(end);
        let goes_on = word >> LENGTH_BITS == SAMPLE;
        let mut sum = crc32fast::Hasher::new_with_initial(if goes_on { previous } else { header });
        sum.update(&word.to_le_bytes());
        sum.update(&record[HEAD_BYTES..]);
        previous = sum.finalize();
        record[2..HEAD_BYTES].copy_from_slice(&previous.to_le_bytes());
        rest = behind;
    }
}

/// Judges one input.
///
/// # Panics
/// The reader broke what it promises.
pub fn judge(bytes: &[u8]) {
    // A record is a few bytes at least: samples cannot be made of nothing.
    assert!(read(bytes) <= bytes.len() as u64);
    let mut right = bytes.to_vec();
    put_checksums_right(&mut right);
    assert!(read(&right) <= bytes.len() as u64);
    let Some((place, patch)) = bytes.split_at_checked(2) else {
        return;
    };
    let mut damaged = SOUND.clone();
    let at = usize::from(u16::from_le_bytes([place[0], place[1]])) % damaged.len();
    let end = (at + patch.len()).min(damaged.len());
    damaged[at..end].copy_from_slice(&patch[..end - at]);
    assert!(read(&damaged) <= 600);
    put_checksums_right(&mut damaged);
    assert!(read(&damaged) <= damaged.len() as u64);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_checksums_of_a_sound_trace_are_right() {
        let mut trace = SOUND.clone();
        put_checksums_right(&mut trace);
        assert!(trace == *SOUND);
    }

    /// A row that says other numbers is a sample all the same: whoever decodes it is asked.
    #[test]
    fn what_is_behind_a_checksum_is_read() {
        let last = SOUND.len() - 1;
        let read_with = |at: usize, right: bool| {
            let mut trace = SOUND.clone();
            trace[at] ^= 0x01;
            if right {
                put_checksums_right(&mut trace);
            }
            read(&trace)
        };
        // The last byte of the last sample's row: before the closing record of 18 bytes.
        let at = last - 18;
        assert_eq!((read_with(at, false), read_with(at, true)), (599, 600));
    }
}
