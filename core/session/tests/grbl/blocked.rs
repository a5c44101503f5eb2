//! What a sender hears while a line of it is not answered, and who drives where two senders are there.

use crate::speak::{Log, Speaker, field, machine, serve, speak, state, words};

/// Says `before`, then asks once a period while nothing else is answered.
fn asked_while(machine_file: &str, before: &[u8], from: u64, until: u64) -> Vec<(u64, String)> {
    let machine = machine(machine_file, &[]);
    let mut says: Vec<(u64, &[u8])> = vec![(from, before)];
    says.extend((from + 1..until).map(|tick| (tick, &b"?"[..])));
    speak(&machine, &says, until + 2, vec![]).log
}

#[test]
fn a_question_is_answered_in_its_period_whatever_blocks_the_lines() {
    let flood = "G1 X1 F60\n".to_owned() + &"G1 X2 F60\nG1 X1\n".repeat(100);
    let cases: [(&str, &str, u64, &str); 7] = [
        ("a dwell", "mill-3axis.toml", 1000, "G4 P2\n"),
        ("a stop", "mill-3axis.toml", 1000, "M0\n"),
        ("an input", "mill-3axis.toml", 1000, "M66 P5 L3 Q2\n"),
        ("a full planner", "mill-3axis.toml", 1000, &flood),
        ("a hold", "mill-3axis.toml", 1000, "G1 X50 F600\n!G1 X0\n"),
        ("a probe", "mill-probe.toml", 1000, "G91 G38.3 X50 F60\n"),
        ("homing", "mill-homing.toml", 1500, "$H\n"),
    ];
    for (what, file, from, before) in cases {
        let until = from + 400;
        let log = asked_while(file, before.as_bytes(), from, until);
        let reports: Vec<u64> = log
            .iter()
            .filter(|(_, line)| line.starts_with('<'))
            .map(|(tick, _)| *tick)
            .collect();
        // What is said in a period is heard in the next.
        let expected: Vec<u64> = (from + 2..=until).collect();
        assert_eq!(reports, expected, "{what}");
        let last = log.iter().rev().find(|(_, line)| line.starts_with('<'));
        assert_ne!(state(&last.unwrap().1), "Idle", "{what} blocks nothing");
    }
}

fn messages(log: &Log) -> Vec<String> {
    let all = words(log);
    all.into_iter()
        .filter(|word| word.starts_with("[MSG:") || word.starts_with("error"))
        .collect()
}

#[test]
fn a_second_sender_is_told_who_drives_and_can_only_look_and_stop() {
    let machine = machine("mill-3axis.toml", &[]);
    let first: [(u64, &[u8]); 2] = [(1000, b"G1 X100 F3000\n"), (6000, b"?")];
    let second: [(u64, &[u8]); 8] = [
        (1100, b"?G0 X1\n"),
        (1110, b"$J=G91 X1 F100\n"),
        (1120, b"\x91"),
        (1130, b"\x18"),
        (1400, b"?"),
        (1500, b"!"),
        (2000, b"?~"),
        (5900, b"G0 X90\n"),
    ];
    let (one, log_of_one) = Speaker::new(&first, 9000);
    let (two, log_of_two) = Speaker::new(&second, 9000);
    serve(&machine, vec![one, two], vec![]);
    let told = messages(&log_of_two);
    let holder = "[MSG:the sender at the virtual clock (client 4294967296)";
    assert_eq!(
        told,
        [
            &format!("{holder} holds the machine]"),
            "error:9",
            &format!("{holder} holds the machine]"),
            "error:9",
            &format!("{holder} holds the machine]"),
            &format!("{holder} drives the machine: it goes on]"),
            &format!("{holder} holds the machine]"),
        ]
        .map(str::to_string)
    );
    let reports: Vec<String> = words(&log_of_two)
        .into_iter()
        .filter(|w| w.starts_with('<'))
        .collect();
    let seen: Vec<&str> = reports.iter().map(|report| state(report)).collect();
    assert_eq!(seen, ["Run", "Run", "Hold:0"], "{reports:?}");
    let of_one = words(&log_of_one);
    // Who holds goes on only by itself: the hold of the other is still in force.
    assert_eq!(state(of_one.last().unwrap()), "Hold:0", "{of_one:?}");
    assert!(
        field(&reports[2], "MPos")
            .unwrap()
            .starts_with(|c: char| c.is_ascii_digit())
    );
}
