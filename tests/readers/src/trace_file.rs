//! Any bytes as a binary trace, and any bytes in the middle of a sound one: reading ends, says how, and takes no more
//! memory than a record.

use std::sync::LazyLock;

use tandem_rings::Sample;
use tandem_sdk::Axes;
use tandem_trace::{Header, Item, Reader, Writer};

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

/// Judges one input.
///
/// # Panics
/// The reader broke what it promises.
pub fn judge(bytes: &[u8]) {
    // A record is a few bytes at least: samples cannot be made of nothing.
    assert!(read(bytes) <= bytes.len() as u64);
    let Some((place, patch)) = bytes.split_at_checked(2) else {
        return;
    };
    let mut damaged = SOUND.clone();
    let at = usize::from(u16::from_le_bytes([place[0], place[1]])) % damaged.len();
    let end = (at + patch.len()).min(damaged.len());
    damaged[at..end].copy_from_slice(&patch[..end - at]);
    assert!(read(&damaged) <= 600);
}
