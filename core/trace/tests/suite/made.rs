//! Traces to test with.

use proptest::prelude::*;
use tandem_rings::{MachineState, Sample, Switched};
use tandem_sdk::{Axes, AxisVector, MAX_SIGNALS};
use tandem_trace::{Ending, Header, Item, Reader, TraceError, Writer};

/// A sample with the strategy's signals.
pub type Row = (Sample, [f64; MAX_SIGNALS]);

/// A header with so many axes and signals.
pub fn header(axes: usize, signals: usize) -> Header {
    let letters: Vec<_> = "XYZABCUV"
        .chars()
        .map(|letter| (letter, "ABC".contains(letter)))
        .take(axes)
        .collect();
    Header {
        fine_period_s: 0.001,
        axes: Axes::new(&letters).unwrap(),
        machine: "mühle".to_string(),
        program: "part.ngc".to_string(),
        planner: "look-ahead".to_string(),
        dry_run: false,
        signals: (0..signals)
            .map(|index| format!("force_{index}_n"))
            .collect(),
    }
}

/// The trace as bytes.
pub fn written(header: &Header, rows: &[Row]) -> Vec<u8> {
    let mut writer = Writer::new(vec![], header).unwrap();
    for (sample, signals) in rows {
        writer
            .sample(sample, &signals[..header.signals.len()])
            .unwrap();
    }
    writer.finish().unwrap()
}

/// All items of a trace, and how it ends.
pub fn read(bytes: &[u8]) -> Result<(Vec<Item>, Ending), TraceError> {
    let mut reader = Reader::new(bytes)?;
    let items = reader.by_ref().collect::<Result<Vec<_>, _>>()?;
    Ok((
        items,
        reader
            .ending()
            .expect("a trace that was read has an ending"),
    ))
}

/// Every bit of what a trace keeps.
pub fn bits((s, signals): &Row) -> Vec<u64> {
    let floats =
        s.command
            .0
            .into_iter()
            .chain(s.feedback.0)
            .chain([s.feed_mm_per_s, s.sigma, s.ratio]);
    let bits = floats.chain(*signals).map(f64::to_bits);
    let phase = s.phase_ns.map_or([0, 0], |ns| [1, ns.cast_unsigned()]);
    let switched = [s.switched.outputs, s.switched.spindle_rad_per_s.to_bits()]
        .into_iter()
        .chain(phase);
    let age = u64::from(*s.age_periods.iter().max().unwrap_or(&0));
    [s.tick, s.block, u64::from(s.line), s.state as u64, age]
        .into_iter()
        .chain(switched)
        .chain(bits)
        .collect()
}

/// Rows of any numbers whatever, with so many axes and signals.
pub fn any_rows(axes: usize, signals: usize, most: usize) -> impl Strategy<Value = Vec<Row>> {
    let floats = prop::array::uniform32(any_double());
    let phase = prop::option::of(i64::MIN + 1..=i64::MAX);
    let row = (
        any::<u64>(),
        any::<u64>(),
        any::<u32>(),
        0..7_u32,
        floats,
        any::<u64>(),
        phase,
        any::<u32>(),
    )
        .prop_map(
            move |(tick, block, line, state, f, outputs, phase_ns, age)| {
                let some = |from: usize, count: usize| {
                    std::array::from_fn(|i| if i < count { f[from + i] } else { 0.0 })
                };
                let sample = Sample {
                    tick,
                    block,
                    line,
                    state: MachineState::from_number(state),
                    command: AxisVector(some(0, axes)),
                    feedback: AxisVector(some(8, axes)),
                    feed_mm_per_s: f[16],
                    sigma: f[17],
                    ratio: f[18],
                    switched: Switched {
                        outputs,
                        spindle_rad_per_s: f[27],
                        ..Switched::default()
                    },
                    phase_ns,
                    age_periods: std::array::from_fn(|axis| if axis < axes { age } else { 0 }),
                    ..Sample::default()
                };
                (sample, some(19, signals))
            },
        );
    prop::collection::vec(row, 0..most)
}

/// Any pattern of bits, NaN and the rest, and ordinary numbers as often.
fn any_double() -> impl Strategy<Value = f64> {
    prop_oneof![
        any::<u64>().prop_map(f64::from_bits),
        -1e3..1e3_f64,
        Just(0.0),
        Just(-0.0)
    ]
}

/// A run of `count` samples that moves as machines do.
pub fn motion(count: u64) -> Vec<Row> {
    let row = |tick: u64| {
        let angle = tick as f64 * 1e-3;
        let sample = Sample {
            tick,
            block: tick / 40,
            line: 5 + (tick / 40) as u32,
            state: MachineState::Running,
            command: AxisVector::from_slice(&[20.0 * angle.cos(), 20.0 * angle.sin(), -1.0]),
            feedback: AxisVector::from_slice(&[19.99 * angle.cos(), 19.99 * angle.sin(), -1.0]),
            feed_mm_per_s: 20.0,
            sigma: 1.0,
            ratio: 1.0,
            ..Sample::default()
        };
        (sample, [0.0; MAX_SIGNALS])
    };
    (0..count).map(row).collect()
}
