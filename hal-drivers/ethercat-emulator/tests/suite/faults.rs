//! What goes wrong: each fault at its frame, for its time, and nothing besides.

use tandem_ethercat_emulator::{
    AlCode, AlState, BusDescription, BusFault, DeviceDescription, Kind, MAX_FRAME, Span, What,
    When, Wire,
};

/// A frame with one datagram.
pub fn frame(number: u8, command: u8, station: u16, address: u16, data: &[u8]) -> Vec<u8> {
    let mut frame = vec![0xff; 6];
    frame.extend([0x10; 6]);
    frame.extend([0x88, 0xa4]);
    frame.extend((0x1000 | (data.len() as u16 + 12)).to_le_bytes());
    frame.extend([command, number]);
    frame.extend(station.to_le_bytes());
    frame.extend(address.to_le_bytes());
    frame.extend((data.len() as u16).to_le_bytes());
    frame.extend([0, 0]);
    frame.extend(data);
    frame.extend([0, 0]);
    frame
}

/// A frame that asks every device for its state.
fn broadcast(number: u8) -> Vec<u8> {
    frame(number, 7, 0, 0x130, &[0, 0])
}

fn counter(reply: &[u8]) -> u16 {
    u16::from_le_bytes([reply[28], reply[29]])
}

fn three_drives() -> BusDescription {
    BusDescription {
        devices: vec![DeviceDescription::new(Kind::Drive); 3],
        ..BusDescription::default()
    }
}

/// Sends so many frames, one a ms, and answers what came back: when, after the frame's ms, and the frame.
fn sent(wire: &mut Wire, frames: u8) -> Vec<(u64, Vec<u8>)> {
    let mut back = vec![];
    for number in 1..=frames {
        let begin_ns = u64::from(number) * 1_000_000;
        wire.send(begin_ns, &broadcast(number));
        for at_ns in (begin_ns..begin_ns + 1_000_000).step_by(1000) {
            let mut reply = [0; MAX_FRAME];
            while let Some(length) = wire.receive(at_ns, &mut reply) {
                back.push((at_ns, reply[..length].to_vec()));
            }
        }
    }
    back
}

/// The numbers of EtherCAT frames in the order in which they come back, where the third of six is faulty.
fn numbers(what: What) -> (Vec<u8>, Vec<(u64, Vec<u8>)>) {
    let mut wire = Wire::new(&three_drives()).unwrap();
    wire.add(BusFault {
        at: When::Frame(3),
        lasts: None,
        what,
    })
    .unwrap();
    let back = sent(&mut wire, 6);
    (back.iter().map(|(_, frame)| frame[17]).collect(), back)
}

#[test]
fn faults_of_frames_meet_one_frame() {
    assert_eq!(numbers(What::LostRequest).0, [1, 2, 4, 5, 6]);
    assert_eq!(numbers(What::LostReply).0, [1, 2, 4, 5, 6]);
    assert_eq!(numbers(What::Swapped).0, [1, 2, 4, 3, 5, 6]);
    assert_eq!(
        numbers(What::Duplicate { after_us: 100.0 }).0,
        [1, 2, 3, 3, 4, 5, 6]
    );
    assert_eq!(numbers(What::Late { by_us: 2500.0 }).0, [1, 2, 4, 5, 3, 6]);
    let (late, back) = numbers(What::Late { by_us: 500.0 });
    assert_eq!(late, [1, 2, 3, 4, 5, 6]);
    assert!((3_500_000..3_520_000).contains(&back[2].0), "{}", back[2].0);
    let (foreign, back) = numbers(What::Foreign);
    assert_eq!(foreign, [1, 2, 3 + 128, 3, 4, 5, 6]);
    assert_ne!(back[2].1[6..12], back[3].1[6..12]);
    let (_, back) = numbers(What::Stray);
    assert_eq!((back.len(), &back[2].1[12..14]), (7, &[0x08, 0x00][..]));
    let (_, back) = numbers(What::Truncated { bytes: 20 });
    assert_eq!(
        back.iter()
            .map(|(_, frame)| frame.len())
            .collect::<Vec<_>>(),
        [30, 30, 20, 30, 30, 30]
    );
    let (_, back) = numbers(What::Corrupt {
        byte: 26,
        mask: 0x40,
    });
    assert_eq!(
        back.iter().map(|(_, frame)| frame[26]).collect::<Vec<_>>(),
        [1, 1, 0x41, 1, 1, 1]
    );
    assert!(
        back.iter()
            .all(|(_, frame)| counter(frame) == 3 && frame[6] & 2 == 2)
    );
}

#[test]
fn a_lost_request_is_not_done_and_a_lost_reply_is() {
    for (what, done) in [(What::LostRequest, false), (What::LostReply, true)] {
        let mut wire = Wire::new(&three_drives()).unwrap();
        wire.add(BusFault {
            at: When::Frame(1),
            lasts: None,
            what,
        })
        .unwrap();
        wire.send(0, &frame(1, 8, 0, 0x0420, &[7, 0]));
        wire.send(1_000_000, &frame(2, 7, 0, 0x0420, &[0, 0]));
        let mut reply = [0; MAX_FRAME];
        assert!(wire.receive(2_000_000, &mut reply).is_some());
        assert_eq!(reply[26] == 7, done);
    }
}

#[test]
fn a_cut_cable_ends_the_bus_there_until_it_is_plugged_again() {
    for (behind, reached) in [
        (None, None),
        (Some(0), Some(1)),
        (Some(1), Some(2)),
        (Some(2), Some(3)),
    ] {
        let mut wire = Wire::new(&three_drives()).unwrap();
        wire.add(BusFault {
            at: When::Frame(2),
            lasts: Some(Span::Ms(2.5)),
            what: What::Cut { behind },
        })
        .unwrap();
        let back = sent(&mut wire, 6);
        let counters: Vec<u16> = back.iter().map(|(_, frame)| counter(frame)).collect();
        let cut = reached.into_iter().flat_map(|reached| [reached; 3]);
        assert_eq!(
            counters,
            [3].into_iter().chain(cut).chain([3, 3]).collect::<Vec<_>>()
        );
    }
}

#[test]
fn a_device_that_is_deaf_lacks_in_the_working_counter() {
    let outputs = DeviceDescription {
        channels: Some(8),
        ..DeviceDescription::new(Kind::DigitalOutputs)
    };
    let mut wire = Wire::new(&BusDescription {
        devices: vec![outputs; 3],
        ..BusDescription::default()
    })
    .unwrap();
    wire.add(BusFault {
        at: When::Cycle(2),
        lasts: Some(Span::Cycles(2)),
        what: What::Deaf { device: 1 },
    })
    .unwrap();
    let setup = [
        (0x0800, vec![0, 0x0f, 1, 0, 0x44, 0, 1, 0]),
        (
            0x0600,
            vec![0, 0, 0, 0, 1, 0, 0, 7, 0, 0x0f, 0, 2, 1, 0, 0, 0],
        ),
    ];
    for (address, data) in setup {
        wire.send(0, &frame(0, 8, 0, address, &data));
    }
    let mut reply = [0; MAX_FRAME];
    while wire.receive(1_000_000, &mut reply).is_some() {}
    let mut counters = vec![];
    for number in 1..=5 {
        let at_ns = u64::from(number) * 2_000_000;
        wire.send(at_ns, &frame(number, 11, 0, 0, &[0x55]));
        let length = wire.receive(at_ns + 500_000, &mut reply).unwrap();
        counters.push(u16::from_le_bytes([reply[length - 2], reply[length - 1]]));
    }
    assert_eq!(counters, [3, 2, 2, 3, 3]);
}

#[test]
fn power_gone_and_back_leaves_the_alias_and_nothing_else() {
    let device = DeviceDescription {
        alias: 77,
        ..DeviceDescription::new(Kind::Drive)
    };
    let mut wire = Wire::new(&BusDescription {
        devices: vec![device],
        ..BusDescription::default()
    })
    .unwrap();
    let station = |wire: &mut Wire, at_ns: u64| {
        let mut reply = [0; MAX_FRAME];
        wire.send(at_ns, &frame(2, 1, 0, 0x10, &[0; 4]));
        assert!(wire.receive(at_ns + 500_000, &mut reply).is_some());
        (
            u16::from_le_bytes([reply[26], reply[27]]),
            u16::from_le_bytes([reply[28], reply[29]]),
        )
    };
    wire.send(0, &frame(1, 2, 0, 0x10, &[0xe9, 3]));
    wire.receive(500_000, &mut [0; MAX_FRAME]);
    assert_eq!(station(&mut wire, 1_000_000), (1001, 77));
    wire.inject(What::PowerCycle { device: 0 }, None).unwrap();
    assert_eq!(station(&mut wire, 2_000_000), (0, 77));
}

#[test]
fn every_fault_can_be_written_in_a_file_and_happens_to_the_device_that_it_names() {
    let kinds = [
        "kind = \"lost-request\"",
        "kind = \"lost-reply\"",
        "kind = \"late\", by_us = 10.5",
        "kind = \"duplicate\", after_us = 3.0",
        "kind = \"swapped\"",
        "kind = \"corrupt\", byte = 20, mask = 255",
        "kind = \"truncated\", bytes = 30",
        "kind = \"foreign\"",
        "kind = \"stray\"",
        "kind = \"cut\"",
        "kind = \"cut\", behind = 1",
        "kind = \"deaf\", device = 1",
        "kind = \"power-cycle\", device = 1",
        "kind = \"al-error\", device = 1, state = \"safe-op\", code = 0x2C",
        "kind = \"refuse-state\", device = 1, state = \"op\", code = 0x1D",
        "kind = \"hang-state\", device = 1, state = \"pre-op\"",
        "kind = \"sdo-abort\", device = 1, index = 0x1C12, abort = 0x08000021",
        "kind = \"silent-mailbox\", device = 1",
        "kind = \"emergencies\", device = 1, messages = 2, code = 0x6100",
        "kind = \"drive-fault\", device = 1, code = 0x7210, stays = true",
        "kind = \"never-enables\", device = 1",
        "kind = \"disables-itself\", device = 1",
        "kind = \"brake\", device = 1, open_ms = 3000.0",
        "kind = \"mode-shown\", device = 1, mode = 9",
        "kind = \"torque-off\", device = 1",
        "kind = \"blocked\", device = 1",
        "kind = \"load\", device = 1, share = 0.5",
        "kind = \"drift\", device = 1, ppm = 100.0",
        "kind = \"clock-jump\", device = 1, by_ns = -5000",
        "kind = \"lost-clock\", device = 1",
        "kind = \"missed-sync\", device = 1, pulses = 3",
        "kind = \"input\", device = 1, input = 0",
        "kind = \"analog\", device = 1, input = 0, value = -3",
    ];
    for kind in kinds {
        let with = |devices: usize, kind: &str| {
            let devices = "[[devices]]\nkind = \"drive\"\n".repeat(devices);
            let text = format!(
                "{devices}[[faults]]\nat = {{ ms = 1.5 }}\nlasts = {{ ms = 2 }}\nwhat = {{ {kind} }}\n"
            );
            BusDescription::from_toml(&text)
        };
        let description = with(3, kind).unwrap_or_else(|e| panic!("{kind}: {e}"));
        sent(&mut Wire::new(&description).unwrap(), 6);
        // It names a device that is there.
        if kind.contains("device = 1") {
            let refused = Wire::new(&with(1, kind).unwrap()).unwrap_err().to_string();
            assert_eq!(refused, "a fault is about device 1, which is not there");
        }
        assert!(with(3, &kind.replace("kind = \"", "kind = \"un")).is_err());
    }
}

#[test]
fn an_error_of_a_device_begins_at_its_time_and_not_before() {
    let mut wire = Wire::new(&three_drives()).unwrap();
    let what = What::AlError {
        device: 1,
        state: AlState::SafeOp,
        code: AlCode::FATAL_SYNC_ERROR,
    };
    wire.add(BusFault {
        at: When::Ms(3.25),
        lasts: None,
        what,
    })
    .unwrap();
    wire.advance(3_249_999);
    assert_eq!(wire.bus().devices()[1].al_code(), None);
    wire.advance(3_250_000);
    let codes: Vec<_> = wire
        .bus()
        .devices()
        .iter()
        .map(tandem_ethercat_emulator::Device::al_code)
        .collect();
    assert_eq!(codes, [None, Some(AlCode::FATAL_SYNC_ERROR), None]);
}

#[test]
fn a_file_with_an_unknown_key_is_refused_with_its_place() {
    let refused = BusDescription::from_toml("[[devices]]\nkind = \"drive\"\nalais = 3\n")
        .unwrap_err()
        .to_string();
    assert!(
        refused.contains("line 3") && refused.contains("alais"),
        "{refused}"
    );
}
