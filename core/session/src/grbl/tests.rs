//! Bytes of senders, without a machine.

use proptest::prelude::*;

use super::scan::{Heard, RealTime, Scanner, SentLine, Step};

fn heard(bytes: &[u8]) -> Vec<Heard> {
    let mut scanner = Scanner::default();
    bytes
        .iter()
        .filter_map(|byte| scanner.push(*byte))
        .collect()
}

fn line(text: &str, bytes: usize) -> Heard {
    Heard::Line(SentLine {
        text: text.to_string(),
        bytes,
        too_long: false,
    })
}

#[test]
fn bytes_act_at_once_wherever_they_stand_in_a_line() {
    assert_eq!(
        heard(b"G1 X?1\r\nY2~\n"),
        [
            Heard::RealTime(RealTime::Status),
            line("G1 X1", 6),
            Heard::RealTime(RealTime::Resume),
            line("Y2", 3),
        ]
    );
    assert_eq!(
        heard(b"G1 X1\x18G0\n"),
        [Heard::RealTime(RealTime::Reset), line("G0", 3)],
        "a reset forgets what stands before it"
    );
    assert_eq!(
        heard(b"?\n"),
        [Heard::RealTime(RealTime::Status), line("", 1)]
    );
    assert_eq!(
        heard(b"G0\r?\nG1\n"),
        [
            line("G0", 3),
            Heard::RealTime(RealTime::Status),
            line("G1", 3)
        ],
        "both ends of a line are one, whatever comes between"
    );
}

#[test]
fn overrides_come_as_bytes_or_as_text() {
    let more = Heard::RealTime(RealTime::Feed(Step::By(10)));
    assert_eq!(heard(&[0x91]), std::slice::from_ref(&more));
    assert_eq!(heard("\u{91}".as_bytes()), [more]);
    assert_eq!(
        heard("(Ñandú — 90 °)\n".as_bytes()),
        [line("(and  90 )", 20)],
        "letters of comments are no overrides, and count as the bytes that they are"
    );
    assert_eq!(heard(&[0xc2]), [], "a lone one is passed over");
}

#[test]
fn a_line_that_is_too_long_is_told_from_its_end() {
    let long = [vec![b'X'; 5000], b"\nG0\n".to_vec()].concat();
    let heard = heard(&long);
    assert!(matches!(&heard[0], Heard::Line(line) if line.too_long && line.bytes == 5001));
    assert_eq!(heard[1], line("G0", 3));
}

proptest! {
    /// However bytes are cut into chunks, and whatever they are: what a sender counts is what is counted here.
    #[test]
    fn every_byte_is_counted_once(bytes in proptest::collection::vec(any::<u8>(), 0..400)) {
        let mut scanner = Scanner::default();
        let (mut counted, mut sent) = (0, 0);
        for byte in &bytes {
            let before = scanner.bytes();
            match scanner.push(*byte) {
                Some(Heard::Line(line)) => {
                    prop_assert!(line.bytes - before <= 2);
                    prop_assert!(line.text.bytes().all(|b| b == b'\t' || (b' '..0x7f).contains(&b)));
                    counted += line.bytes;
                    sent += 1;
                }
                Some(Heard::RealTime(RealTime::Reset)) => prop_assert_eq!(scanner.bytes(), 0),
                Some(Heard::RealTime(_)) => prop_assert_eq!(scanner.bytes(), before),
                None => prop_assert!(scanner.bytes() <= before + 2),
            }
        }
        prop_assert!(counted <= bytes.len());
        prop_assert!(sent <= bytes.iter().filter(|b| b"\r\n".contains(b)).count());
    }
}
