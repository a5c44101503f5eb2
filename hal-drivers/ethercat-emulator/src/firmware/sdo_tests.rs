//! The SDO server alone: segments, their toggle bit, and objects at once.

use super::dictionary::{Abort, Access, Dictionary, Kind};
use super::sdo::{Context, SdoServer};
use crate::al::AlState;

/// A dictionary with an object of octets and a record.
fn dictionary() -> Dictionary {
    let mut dictionary = Dictionary::default();
    dictionary.add_bytes(0x2000, (0..200).collect());
    dictionary.add(0x3000, 0, Kind::U8, Access::ReadOnly, 2);
    dictionary.add(0x3000, 1, Kind::U16, Access::ReadWrite, 0x1234);
    dictionary.add(0x3000, 2, Kind::U8, Access::ReadWrite, 0x56);
    dictionary
}

/// Sends one request and answers what comes back behind the service.
fn ask(server: &mut SdoServer, dictionary: &mut Dictionary, body: &[u8]) -> Vec<u8> {
    let mut message = vec![0x00, 0x20];
    message.extend(body);
    message.resize(message.len().max(10), 0);
    let mut context = Context {
        dictionary,
        state: AlState::PreOp,
        room: 122,
        complete_access: true,
        refusals: &[],
        is_drive: false,
    };
    server.serve(&message, &mut context).remove(0).split_off(2)
}

fn abort(answer: &[u8]) -> Abort {
    assert_eq!(answer[0], 0x80);
    Abort(u32::from_le_bytes(answer[4..8].try_into().unwrap()))
}

#[test]
fn a_long_object_goes_up_in_segments() {
    let (mut server, mut dictionary) = (SdoServer::default(), dictionary());
    let first = ask(&mut server, &mut dictionary, &[0x40, 0x00, 0x20, 0]);
    assert_eq!(first[..8], [0x41, 0x00, 0x20, 0, 200, 0, 0, 0]);
    let second = ask(&mut server, &mut dictionary, &[0x60]);
    // The last segment: its toggle bit is 0, no byte of it is unused.
    assert_eq!(second[0], 0x01);
    let all: Vec<u8> = first[8..].iter().chain(&second[1..]).copied().collect();
    assert_eq!(all, (0..200).collect::<Vec<u8>>());
    assert_eq!(
        abort(&ask(&mut server, &mut dictionary, &[0x70])),
        Abort::COMMAND
    );
}

#[test]
fn a_wrong_toggle_bit_ends_a_transfer_either_way() {
    let (mut server, mut dictionary) = (SdoServer::default(), dictionary());
    ask(&mut server, &mut dictionary, &[0x40, 0x00, 0x20, 0]);
    assert_eq!(
        abort(&ask(&mut server, &mut dictionary, &[0x70])),
        Abort::TOGGLE
    );
    assert_eq!(
        abort(&ask(&mut server, &mut dictionary, &[0x60])),
        Abort::COMMAND
    );
    ask(
        &mut server,
        &mut dictionary,
        &[0x21, 0x00, 0x20, 0, 14, 0, 0, 0],
    );
    assert_eq!(
        ask(&mut server, &mut dictionary, &[0x00, 1, 2, 3, 4, 5, 6, 7])[0],
        0x20
    );
    assert_eq!(
        abort(&ask(
            &mut server,
            &mut dictionary,
            &[0x01, 1, 2, 3, 4, 5, 6, 7]
        )),
        Abort::TOGGLE
    );
}

#[test]
fn a_long_object_goes_down_in_segments_and_counts_to_its_last_byte() {
    let (mut server, mut dictionary) = (SdoServer::default(), dictionary());
    assert_eq!(
        ask(
            &mut server,
            &mut dictionary,
            &[0x21, 0x00, 0x20, 0, 9, 0, 0, 0]
        )[0],
        0x60
    );
    assert_eq!(
        ask(&mut server, &mut dictionary, &[0x00, 1, 2, 3, 4, 5, 6, 7])[0],
        0x20
    );
    // Two bytes more, five unused, the last segment, the toggle bit turned over.
    let last = 0x10 | 5 << 1 | 1;
    assert_eq!(
        ask(&mut server, &mut dictionary, &[last, 8, 9, 0, 0, 0, 0, 0])[0],
        0x30
    );
    let slot = dictionary.slot(0x2000, 0).unwrap();
    assert_eq!(dictionary.entry(slot).value, [1, 2, 3, 4, 5, 6, 7, 8, 9]);
    // One that ends before it has what it announced is refused.
    ask(
        &mut server,
        &mut dictionary,
        &[0x21, 0x00, 0x20, 0, 9, 0, 0, 0],
    );
    assert_eq!(
        abort(&ask(
            &mut server,
            &mut dictionary,
            &[0x01, 1, 2, 3, 4, 5, 6, 7]
        )),
        Abort::TOO_SHORT
    );
}

#[test]
fn an_object_goes_at_once_with_its_count() {
    let (mut server, mut dictionary) = (SdoServer::default(), dictionary());
    let answer = ask(&mut server, &mut dictionary, &[0x50, 0x00, 0x30, 0]);
    assert_eq!(
        answer,
        [0x51, 0x00, 0x30, 0, 5, 0, 0, 0, 2, 0, 0x34, 0x12, 0x56]
    );
    // The entries without their count, three bytes of them.
    let written = ask(
        &mut server,
        &mut dictionary,
        &[0x31 | 1 << 2 | 2, 0x00, 0x30, 1, 0x78, 0x56, 0x9a, 0],
    );
    assert_eq!(written[0], 0x60);
    assert_eq!(
        (dictionary.number(0x3000, 1), dictionary.number(0x3000, 2)),
        (0x5678, 0x9a)
    );
    assert_eq!(
        abort(&ask(&mut server, &mut dictionary, &[0x50, 0x00, 0x30, 2])),
        Abort::UNSUPPORTED
    );
}
