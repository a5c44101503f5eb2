//! Whatever a client sends, it is answered or its connection ends, and nobody else's.

use std::cell::RefCell;
use std::io::{Read, Write};
use std::net::Shutdown;
use std::os::unix::net::UnixStream;

use proptest::prelude::*;
use serde_json::Value;

use super::{NEVER, TestServer};

/// Numbers as JSON has them, with those at its edges.
fn number() -> impl Strategy<Value = String> {
    let edges = [
        "0",
        "-0",
        "-0.0",
        "1e-21",
        "1e-300",
        "5e-324",
        "1e-400",
        "1e300",
        "-1e300",
        "1.7976931348623157e308",
        "1e309",
        "1e999999999",
        "18446744073709551615",
        "18446744073709551616",
        "-9223372036854775809",
        "0.1",
        "1",
        "-1",
        "20",
        "100",
        "100.00000000000001",
        "\"NaN\"",
        "\"inf\"",
        "\"-0\"",
        "NaN",
        "Infinity",
        "null",
        "true",
        "[]",
        "{}",
    ];
    prop_oneof![
        4 => prop::sample::select(edges.to_vec()).prop_map(str::to_string),
        2 => any::<f64>().prop_map(|number| format!("{number:e}")),
        1 => any::<i64>().prop_map(|number| number.to_string()),
        1 => (1_usize..2000).prop_map(|digits| "9".repeat(digits)),
    ]
}

fn command() -> impl Strategy<Value = String> {
    let names = [
        "hold",
        "resume",
        "feed-override",
        "rapid-override",
        "single-block",
        "optional-stop",
        "abort",
        "reload-policy",
        "emergency-stop",
        "stall-rough",
        "",
        "\\u0000",
        "\\ud800",
    ];
    (
        prop::sample::select(names.to_vec()),
        number(),
        any::<bool>(),
    )
        .prop_map(|(name, number, bare)| {
            if bare {
                format!("{{\"command\":\"{name}\"}}")
            } else {
                format!("{{\"command\":\"{name}\",\"value\":{number}}}")
            }
        })
}

fn jog() -> impl Strategy<Value = String> {
    let axes = prop::sample::select(vec!["x", "A", "a", "q", "", "xy", "\\u00df"]);
    let keys = [
        "direction",
        "distance_mm",
        "distance_deg",
        "feed_mm_per_min",
        "feed_deg_per_min",
        "stop",
    ];
    let key = prop::sample::select(keys.to_vec());
    (axes, prop::collection::vec((key, number()), 0..4)).prop_map(|(axis, numbers)| {
        let keys = [format!("\"axis\":\"{axis}\"")];
        let numbers = numbers
            .iter()
            .map(|(key, number)| format!("\"{key}\":{number}"));
        let all: Vec<String> = keys.into_iter().chain(numbers).collect();
        format!("{{\"jog\":{{{}}}}}", all.join(","))
    })
}

/// A jog that is asked for as it should be, with numbers that are not.
fn whole_jog() -> impl Strategy<Value = String> {
    (number(), number(), any::<bool>()).prop_map(|(feed, distance, turns)| {
        let (axis, unit) = if turns { ("a", "deg") } else { ("x", "mm") };
        format!("{{\"jog\":{{\"axis\":\"{axis}\",\"distance_{unit}\":{distance},\"feed_{unit}_per_min\":{feed}}}}}")
    })
}

fn nest() -> impl Strategy<Value = String> {
    let parts = [
        ("[", "]"),
        ("{\"a\":", "}"),
        ("{\"command\":\"hold\",\"value\":[", "]}"),
        ("{\"status\":", "}"),
    ];
    (
        prop::sample::select(parts.to_vec()),
        1_usize..1500,
        any::<bool>(),
    )
        .prop_map(|((open, close), depth, ends)| {
            format!(
                "{}1{}",
                open.repeat(depth),
                if ends {
                    close.repeat(depth)
                } else {
                    String::new()
                }
            )
        })
}

/// Bytes of one client: whole lines, half lines, lines that are none.
fn line() -> impl Strategy<Value = Vec<u8>> {
    let text = prop_oneof![
        3 => number().prop_map(|rate| format!("{{\"subscribe\":{{\"rate_hz\":{rate}}}}}")),
        3 => command(),
        2 => jog(),
        3 => whole_jog(),
        2 => prop::sample::select(vec!["take", "release", "take-over", "steal"])
            .prop_map(|word| format!("{{\"lease\":\"{word}\"}}")),
        1 => number().prop_map(|number| format!("{{\"status\":{number}}}")),
        1 => Just("{\"status\":{}}".to_string()),
        1 => number().prop_map(|number| format!("{{\"token\":{number}}}")),
        1 => nest(),
        1 => (0_usize..9000).prop_map(|length| "x".repeat(length)),
        1 => "\\PC*",
    ];
    let bytes = prop_oneof![
        8 => text.prop_map(String::into_bytes),
        1 => prop::collection::vec(any::<u8>(), 0..300),
    ];
    // What is cut off is the end of a line, or of a character.
    (bytes, 0_u8..10, 0_usize..40).prop_map(|(mut bytes, kind, cut)| {
        if kind == 0 {
            bytes.truncate(bytes.len().saturating_sub(cut));
        }
        if kind != 1 {
            bytes.push(b'\n');
        }
        bytes
    })
}

/// Everything that a client hears until the server hangs up.
fn hear_all(mut stream: UnixStream) -> Vec<u8> {
    let mut heard = vec![];
    let mut chunk = [0; 4096];
    loop {
        match stream.read(&mut chunk) {
            Ok(0) => return heard,
            Ok(count) => heard.extend_from_slice(&chunk[..count]),
            // It was closed with words of ours unread.
            Err(error) if error.kind() == std::io::ErrorKind::ConnectionReset => return heard,
            Err(error) => panic!("the server neither answers nor hangs up: {error}"),
        }
    }
}

#[test]
fn whatever_a_client_sends_it_is_answered_in_json_and_everybody_else_is_still_served() {
    let server = TestServer::open();
    let friend = RefCell::new(server.over_unix());
    proptest!(ProptestConfig::with_cases(400), |(lines in prop::collection::vec(line(), 1..8))| {
        let mut stream = UnixStream::connect(server.socket()).unwrap();
        stream.set_read_timeout(Some(NEVER)).unwrap();
        for line in &lines {
            // It may have been sent away already.
            let _ = stream.write_all(line);
        }
        let _ = stream.shutdown(Shutdown::Write);
        let heard = hear_all(stream);
        let whole = heard.iter().rposition(|byte| *byte == b'\n').map_or(0, |end| end + 1);
        for answer in heard[..whole].split(|byte| *byte == b'\n').filter(|answer| !answer.is_empty()) {
            let answer: Value = serde_json::from_slice(answer).expect("an answer is JSON");
            prop_assert!(answer["error"]["what"] != "failed", "{answer}");
        }
        let is_served = friend.borrow_mut().ask(r#"{"status":{}}"#)["ok"].is_object();
        prop_assert!(is_served, "the others are served");
    });
}

#[test]
fn a_rate_that_no_clock_can_wait_for_is_refused_with_its_field_and_ends_nothing() {
    let server = TestServer::open();
    let mut client = server.over_unix();
    for rate in ["1e-21", "1e-300", "5e-324", "-1", "101", "1e300", "0.0099"] {
        let answer = client.ask(&format!("{{\"subscribe\":{{\"rate_hz\":{rate}}}}}"));
        assert!(
            answer["error"]["where"]
                .as_str()
                .unwrap()
                .contains("\"rate_hz\""),
            "{rate}: {answer}"
        );
        assert!(
            answer["error"]["why"]
                .as_str()
                .unwrap()
                .contains("within 0.01 to 100"),
            "{rate}: {answer}"
        );
    }
    assert!(client.holds() && server.over_unix().holds());
}
