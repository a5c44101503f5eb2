//! Any bytes as a frame.

use proptest::prelude::*;
use tandem_ethercat_emulator::{BusDescription, DeviceDescription, Kind, MAX_FRAME, Wire};

fn one_of_each() -> BusDescription {
    let kinds = [
        Kind::Coupler,
        Kind::DigitalInputs,
        Kind::DigitalOutputs,
        Kind::AnalogInputs,
        Kind::AnalogOutputs,
        Kind::Drive,
    ];
    BusDescription {
        devices: kinds.map(DeviceDescription::new).to_vec(),
        ..BusDescription::default()
    }
}

/// A frame of datagrams with any command, at places where there is something.
fn frames() -> impl Strategy<Value = Vec<u8>> {
    let address = prop_oneof![
        any::<u16>(),
        0x0100..0x0140_u16,
        0x0500..0x0510_u16,
        0x0600..0x0640_u16,
        0x0800..0x0840_u16,
        0x0900..0x09C0_u16,
        0x1000..0x1480_u16,
    ];
    let data = prop::collection::vec(any::<u8>(), 0..200);
    let datagram = (0..16_u8, 0..4_u16, address, data, any::<bool>());
    prop::collection::vec(datagram, 1..6).prop_map(|datagrams| {
        let mut frame = vec![0x10; 12];
        frame.extend([0x88, 0xa4, 0xff, 0x15]);
        for (command, station, address, data, last) in datagrams {
            frame.extend([command, 0]);
            frame.extend(station.wrapping_neg().to_le_bytes());
            frame.extend(address.to_le_bytes());
            frame.extend((data.len() as u16 | if last { 0 } else { 0x8000 }).to_le_bytes());
            frame.extend([0, 0]);
            frame.extend(data);
            frame.extend([0, 0]);
        }
        frame
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 100, ..ProptestConfig::default() })]

    /// Whatever comes in, what goes back is as long and differs in the source, in data and counters only.
    #[test]
    fn frames_of_any_content_pass(frames in prop::collection::vec(frames(), 1..20)) {
        let mut wire = Wire::new(&one_of_each()).unwrap();
        for (n, frame) in (1..).zip(&frames) {
            let at_ns = n * 1_000_000;
            wire.send(at_ns, frame);
            let mut reply = [0; MAX_FRAME];
            let length = wire.receive(at_ns + 900_000, &mut reply);
            prop_assert_eq!(length, Some(frame.len()));
            prop_assert_eq!(&reply[..6], &frame[..6]);
            prop_assert_eq!(reply[6], frame[6] | 2);
            prop_assert_eq!(&reply[7..18], &frame[7..18]);
        }
    }

    /// What comes back does not depend on how often somebody looked at the time in between.
    #[test]
    fn time_may_pass_in_any_pieces(
        frames in prop::collection::vec(frames(), 1..8),
        pieces in prop::collection::vec(0..1_000_000_u64, 0..20),
    ) {
        let replies = |pieces: &[u64]| {
            let mut wire = Wire::new(&one_of_each()).unwrap();
            let mut replies = vec![];
            for (n, frame) in (1..).zip(&frames) {
                let at_ns = n * 1_000_000;
                wire.send(at_ns, frame);
                let mut reply = [0; MAX_FRAME];
                let length = wire.receive(at_ns + 200_000, &mut reply).unwrap_or(0);
                replies.push(reply[..length].to_vec());
                let mut all: Vec<u64> = pieces.iter().map(|piece| at_ns + 200_000 + piece * 4 / 5).collect();
                all.sort_unstable();
                for now_ns in all {
                    wire.advance(now_ns);
                }
            }
            replies
        };
        prop_assert_eq!(replies(&pieces), replies(&[]));
    }

    #[test]
    fn bytes_that_are_no_frame_go_nowhere(bytes in prop::collection::vec(any::<u8>(), 0..100)) {
        let mut wire = Wire::new(&one_of_each()).unwrap();
        wire.send(0, &bytes);
        prop_assert_eq!(wire.receive(1_000_000, &mut [0; MAX_FRAME]), None);
    }
}
