//! Any bytes as frames of a master, at any pace: nothing panics, nothing hangs, what comes back is as long as what went in.

use tandem_ethercat_emulator::{BusDescription, DeviceDescription, Kind, MAX_FRAME, Wire};

/// Destination, source, protocol.
const HEADER: [u8; 14] = [
    0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0x10, 0x10, 0x10, 0x10, 0x10, 0x10, 0x88, 0xa4,
];

/// Judges one input.
///
/// # Panics
/// The reader broke what it promises.
pub fn judge(bytes: &[u8]) {
    let kinds = [
        Kind::Coupler,
        Kind::DigitalInputs,
        Kind::DigitalOutputs,
        Kind::AnalogInputs,
        Kind::Drive,
    ];
    let devices = kinds.map(DeviceDescription::new).to_vec();
    let mut wire = Wire::new(&BusDescription {
        devices,
        ..BusDescription::default()
    })
    .unwrap();
    let mut now_ns = 0;
    let mut rest = bytes;
    // Each frame: its length in two bytes, the time until it in steps of 100 µs, its bytes behind the Ethernet header.
    while let [low, high, pause, after @ ..] = rest {
        let length = usize::from(u16::from_le_bytes([*low, *high])) % (MAX_FRAME - HEADER.len());
        let (body, next) = after.split_at(length.min(after.len()));
        rest = next;
        now_ns += u64::from(*pause) * 100_000;
        let frame = [&HEADER[..], body].concat();
        wire.send(now_ns, &frame);
        let mut reply = [0; MAX_FRAME];
        while let Some(length) = wire.receive(now_ns + 500_000, &mut reply) {
            assert_eq!(length, frame.len());
        }
    }
}
