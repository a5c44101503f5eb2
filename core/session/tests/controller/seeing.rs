//! What clients see: path, scope, captures, what is to go, inputs and outputs; and what they bring.

use std::fmt::Write as _;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Value, json};
use tandem_session::controller::NoPersistence;

use crate::support::{Says, Told, machine};

const ARC: &str = "G21 G90 G17\nG0 X10\nG1 X20 F1200\nG2 X20 Y-20 J-10\nM2\n";

fn points(pieces: &Value) -> Vec<Vec<f64>> {
    let all = pieces.as_array().unwrap().iter();
    all.flat_map(|piece| piece["points"].as_array().unwrap())
        .map(|point| serde_json::from_value(point.clone()).unwrap())
        .collect()
}

#[test]
fn the_path_is_seen_before_it_is_driven_and_where_the_machine_was_behind_it() {
    let mut says = Says::new();
    let load = says.ask(1000, "load", json!({ "text": ARC, "name": "arc.ngc" }));
    let before = says.ask(10, "path", json!({}));
    says.ask(10, "start", json!({}));
    let driving = says.ask(600, "status", json!({}));
    let after = says.ask(8000, "path", json!({}));
    let end = says.ask(1, "status", json!({}));
    let told = Told::by(
        &machine("mill-3axis.toml"),
        says,
        |_| (),
        Box::new(NoPersistence),
    );
    // printf '…' | sha256sum
    let hash = told.ok(load)["hash"].as_str().unwrap();
    assert_eq!(hash.len(), 64, "{hash}");
    let before = told.ok(before);
    let lines: Vec<_> = before["pieces"]
        .as_array()
        .unwrap()
        .iter()
        .map(|p| p["line"].clone())
        .collect();
    assert_eq!(json!(lines), json!([2, 3, 4]));
    let drawn = points(&before["pieces"]);
    assert_eq!(drawn.last().unwrap()[..2], [20.0, -20.0]);
    // The arc: every point on the circle, no chord off it by more than is allowed.
    let arc = &drawn[2..];
    assert!(arc.len() > 20, "{}", arc.len());
    let radius = |x: f64, y: f64| (x - 20.0).hypot(y + 10.0);
    for pair in arc.windows(2) {
        assert!((radius(pair[0][0], pair[0][1]) - 10.0).abs() < 1e-3);
        let middle = radius(
            f64::midpoint(pair[0][0], pair[1][0]),
            f64::midpoint(pair[0][1], pair[1][1]),
        );
        assert!(10.0 - middle < 0.006, "{middle}");
    }
    let status = told.ok(driving);
    let at = |of: &Value, axis: &str| of[axis].as_f64().unwrap();
    let (place, to_go) = (&status["position"], &status["distance_to_go"]);
    assert_eq!(status["state"], "running");
    assert!(at(to_go, "x_mm") > 0.0, "{status}");
    let end_x = at(place, "x_mm") + at(to_go, "x_mm");
    assert!(
        [10.0, 20.0].iter().any(|end| (end_x - end).abs() < 1e-9),
        "{end_x}"
    );
    assert_eq!(at(&told.ok(end)["distance_to_go"], "x_mm"), 0.0);
    let after = told.ok(after);
    let driven = after["driven"].as_array().unwrap();
    assert!(driven.len() > 50, "{}", driven.len());
    assert_eq!(after["driven_count"].as_u64().unwrap(), driven.len() as u64);
    assert_eq!(*driven.last().unwrap(), json!([20.0, -20.0, 0.0]));
    assert!(after["generation"].as_u64() > before["generation"].as_u64());
}

/// The numbers of a packed answer, `width` to each point.
fn unpacked(text: &Value, width: usize) -> Vec<Vec<f64>> {
    let bytes = STANDARD.decode(text.as_str().unwrap()).unwrap();
    let numbers: Vec<f64> = bytes
        .chunks_exact(4)
        .map(|four| f64::from(f32::from_le_bytes(four.try_into().unwrap())))
        .collect();
    numbers.chunks_exact(width).map(<[f64]>::to_vec).collect()
}

#[test]
fn a_packed_path_is_the_same_path_from_any_point_on_however_long_it_is() {
    let mut says = Says::new();
    let mut text = ARC.replace("M2\n", "G0 Z5\n");
    for n in 0..9000 {
        let _ = writeln!(text, "G1 X{} Y{}", f64::from(n % 200) / 10.0, n % 7);
    }
    text += "M2\n";
    says.ask(1000, "load", json!({ "text": text, "name": "long.ngc" }));
    let plain = says.ask(100, "path", json!({}));
    let all: Vec<_> = (0..4)
        .map(|part| says.ask(1, "path", json!({ "packed": true, "from": part * 3000 })))
        .collect();
    let beyond = says.ask(1, "path", json!({ "packed": true, "from": 1_000_000 }));
    let told = Told::by(
        &machine("mill-3axis.toml"),
        says,
        |_| (),
        Box::new(NoPersistence),
    );
    let plain = told.ok(plain);
    let first = told.ok(all[0]);
    assert!(
        first.to_string().len() < 128 * 1024,
        "it fits what may wait"
    );
    let drawn = unpacked(&first["points"], 3);
    let kinds = STANDARD.decode(first["kinds"].as_str().unwrap()).unwrap();
    assert_eq!(drawn.len(), kinds.len());
    assert_eq!(kinds[..3], [2, 1, 0], "a start, a rapid, a line at feed");
    let shown = points(&plain["pieces"]);
    for (one, other) in drawn[1..].iter().zip(&shown) {
        let apart = one.iter().zip(other).map(|(a, b)| (a - b).abs());
        assert!(apart.fold(0.0, f64::max) < 1e-4, "{one:?} {other:?}");
    }
    assert!(shown.len() > 100);
    let count = first["count"].as_u64().unwrap();
    assert_eq!(first["low"], json!([0.0, -20.0, 0.0]));
    let high: Vec<f64> = serde_json::from_value(first["high"].clone()).unwrap();
    assert!(
        (high[0] - 30.0).abs() < 0.01 && high[1..] == [6.0, 5.0],
        "{high:?}"
    );
    // Parts that overlap have the same points, and together all of them.
    let mut whole = vec![];
    for part in all {
        let told = told.ok(part);
        let from = told["from"].as_u64().unwrap() as usize;
        let points = unpacked(&told["points"], 3);
        for (at, point) in points.into_iter().enumerate() {
            match whole.get(from + at) {
                Some(there) => assert_eq!(*there, point),
                None => whole.push(point),
            }
        }
    }
    assert_eq!(whole.len() as u64, count);
    let end = whole.last().unwrap();
    assert!(
        (end[0] - 19.9).abs() < 1e-5 && end[1..] == [4.0, 5.0],
        "{end:?}"
    );
    assert_eq!(unpacked(&told.ok(beyond)["points"], 3).len(), 0);
}

#[test]
fn lines_by_hand_are_drawn_as_they_are_planned() {
    let mut says = Says::new();
    says.ask(1000, "mdi", json!({ "line": "G1 X10 F3000" }));
    says.ask(5, "mdi", json!({ "line": "G1 Y10" }));
    let path = says.ask(3000, "path", json!({}));
    let rest = says.ask(1, "path", json!({ "from": 1, "driven_from": 100_000 }));
    let told = Told::by(
        &machine("mill-3axis.toml"),
        says,
        |_| (),
        Box::new(NoPersistence),
    );
    assert_eq!(
        points(&told.ok(path)["pieces"]),
        [[10.0, 0.0, 0.0], [10.0, 10.0, 0.0]]
    );
    let rest = told.ok(rest);
    assert_eq!(
        (
            points(&rest["pieces"]).len(),
            rest["driven"].as_array().unwrap().len()
        ),
        (1, 0)
    );
}

#[test]
fn the_scope_sees_every_sample_and_a_capture_those_around_its_trigger() {
    let mut says = Says::new();
    let signals = json!(["x_cmd_mm", "feed_mm_s", "line"]);
    let scope = says.ask(1000, "scope", json!({ "signals": signals, "every": 2 }));
    let none = says.ask(1, "scope", json!({ "signals": ["x_command"] }));
    let with = json!({ "signals": ["x_cmd_mm", "x_fb_mm"], "when": "x_cmd_mm", "above": 5.0, "before_s": 0.05, "after_s": 0.1 });
    let armed = says.ask(1, "capture", with);
    let early = says.ask(1, "captured", json!({}));
    says.ask(1, "mdi", json!({ "line": "G1 X20 F3000" }));
    let captured = says.ask(3000, "captured", json!({}));
    let too_much = json!({ "signals": ["sigma"], "when": "sigma", "above": 5.0, "before_s": 1e6 });
    let too_much = says.ask(1, "capture", too_much);
    let told = Told::by(
        &machine("mill-3axis.toml"),
        says,
        |_| (),
        Box::new(NoPersistence),
    );
    assert_eq!(told.ok(scope)["every"], 2);
    assert!(told.why(none).contains("no signal x_command"));
    assert_eq!(told.ok(armed)["rows"], 150);
    assert!(told.why(early).contains("waits for its trigger"));
    assert!(told.why(too_much).contains("too many"));

    // Every second sample of the job, one after the other without a gap.
    let frames: Vec<_> = told.events("scope");
    let mut tick = frames[0]["tick"].as_u64().unwrap();
    let (mut x, mut rows) = (vec![], 0);
    for frame in &frames {
        assert_eq!(
            (frame["tick"].as_u64(), &frame["lost"]),
            (Some(tick), &json!(0))
        );
        for row in frame["rows"].as_array().unwrap() {
            x.push(row[0].as_f64().unwrap());
            rows += 1;
            tick += 2;
        }
    }
    assert!(
        rows > 200 && x[0] == 0.0 && *x.last().unwrap() == 20.0,
        "{rows} {x:?}"
    );
    // 50 rows before the first beyond 5 mm, 100 from it on.
    let captured = told.ok(captured);
    let rows = captured["rows"].as_array().unwrap();
    assert_eq!((captured["count"].as_u64(), rows.len()), (Some(150), 150));
    assert_eq!(captured["trigger_row"], 50);
    let value = |row: usize| rows[row][0].as_f64().unwrap();
    assert!(
        value(49) <= 5.0 && value(50) > 5.0,
        "{} {}",
        value(49),
        value(50)
    );
    assert_eq!(told.events("captured").len(), 1);
}

#[test]
fn a_program_is_brought_whole_or_not_at_all() {
    let folder = tempfile::tempdir().unwrap();
    let part = "G21 G90\n".to_string() + &"G1 X1 F600\nG1 X0\n".repeat(1000);
    let mut says = Says::new();
    let ask = |says: &mut Says, with: Value| says.ask(10, "upload", with);
    says.ask(1000, "status", json!({}));
    let first = ask(
        &mut says,
        json!({ "name": "part.ngc", "text": part, "more": true }),
    );
    let half = says.ask(10, "list", json!({}));
    let second = ask(&mut says, json!({ "name": "part.ngc", "text": part }));
    let whole = says.ask(10, "list", json!({}));
    let again = ask(&mut says, json!({ "name": "part.ngc", "text": "M2\n" }));
    let replaced = ask(
        &mut says,
        json!({ "name": "part.ngc", "text": "M2\n", "replace": true }),
    );
    let bad: Vec<_> = ["../x.ngc", "/etc/x", "a/b", ".hidden", "", "a\nb"]
        .map(|name| ask(&mut says, json!({ "name": name, "text": "M2\n" })))
        .into();
    let load = says.ask(10, "load", json!({ "path": "part.ngc" }));
    let programs = folder.path().to_owned();
    let told = Told::by(
        &machine("mill-3axis.toml"),
        says,
        |options| options.programs = Some(programs),
        Box::new(NoPersistence),
    );
    assert_eq!(told.ok(first)["more"], true);
    assert_eq!(told.ok(half)["programs"], json!([]));
    assert_eq!(told.ok(second)["bytes"], 2 * part.len());
    let listed = &told.ok(whole)["programs"][0];
    assert_eq!(
        (&listed["name"], &listed["bytes"]),
        (&json!("part.ngc"), &json!(2 * part.len()))
    );
    assert!(told.why(again).contains("\"replace\" replaces it"));
    assert_eq!(told.ok(replaced)["bytes"], 3);
    for id in bad {
        assert!(told.why(id).contains("plain name"), "{}", told.why(id));
    }
    told.ok(load);
    let left: Vec<_> = std::fs::read_dir(folder.path())
        .unwrap()
        .map(|e| e.unwrap().file_name())
        .collect();
    assert_eq!(left, ["part.ngc"]);
}

/// A page that has never had the file shows the lines that move: any part of a long program is told, and never more than an answer
/// holds.
#[test]
fn the_lines_of_the_program_that_is_loaded_are_told() {
    let line = |number: u64| format!("G1 X{}", number % 7);
    let long = format!("({})", "ä".repeat(300));
    let text: String = (1..=1000)
        .map(|number| match number {
            600 => long.clone() + "\r\n",
            1000 => "M2".to_string(),
            _ => line(number) + " F600\n",
        })
        .collect();
    let mut says = Says::new();
    let none = says.ask(1000, "text", json!({}));
    says.ask(10, "load", json!({ "text": text, "name": "long.ngc" }));
    let asked = [
        json!({}),
        json!({ "from": 255, "lines": 3 }),
        json!({ "from": 599, "lines": 2 }),
        json!({ "from": 999, "lines": 9 }),
        json!({ "from": 1001 }),
        json!({ "from": u64::MAX, "lines": u64::MAX }),
    ]
    .map(|with| says.ask(100, "text", with));
    let told = Told::by(
        &machine("mill-3axis.toml"),
        says,
        |_| (),
        Box::new(NoPersistence),
    );
    let nothing = told.ok(none);
    assert_eq!(
        (&nothing["program"], &nothing["lines"]),
        (&Value::Null, &json!([]))
    );
    let [first, middle, wide, last, beyond, far] = asked.map(|id| told.ok(id));
    assert_eq!(
        (&first["program"], &first["count"]),
        (&json!("long.ngc"), &json!(1000))
    );
    assert_eq!(first["lines"].as_array().map(Vec::len), Some(200));
    assert_eq!(first["lines"][0], line(1) + " F600");
    let expected: Vec<_> = (255..258).map(|number| line(number) + " F600").collect();
    assert_eq!(
        (&middle["from"], &middle["lines"]),
        (&json!(255), &json!(expected))
    );
    let shown = wide["lines"][1].as_str().unwrap();
    assert_eq!(shown.chars().count(), 160);
    assert!(shown.starts_with("(ä"));
    assert_eq!(last["lines"], json!([line(999) + " F600", "M2"]));
    for empty in [beyond, far] {
        assert_eq!(empty["lines"], json!([]));
    }
}

#[test]
fn keys_of_axes_that_the_machine_lacks_are_refused() {
    let mut says = Says::new();
    says.ask(1000, "status", json!({}));
    let wrong = says.ask(10, "set-offset", json!({ "w_mm": 1.0 }));
    let unit = says.ask(10, "touch-off", json!({ "x_deg": 1.0 }));
    let set = says.ask(10, "set-offset", json!({ "x_mm": 1.0 }));
    let told = Told::by(
        &machine("mill-3axis.toml"),
        says,
        |_| (),
        Box::new(NoPersistence),
    );
    assert!(told.why(wrong).contains("\"w_mm\"") && told.why(unit).contains("\"x_deg\""));
    told.ok(set);
}

/// A bus is there to be seen where there is one: how old what it brings is, in how many periods it was, and its phase.
#[test]
fn how_well_the_drives_are_heard_is_seen_where_they_are_on_a_bus() {
    let bus = |keys: &[(&str, &str)]| {
        let mut says = Says::new();
        says.ask(1000, "mdi", json!({ "line": "G1 X10 F3000" }));
        let late = says.ask(90, "status", json!({}));
        let after = says.ask(1000, "status", json!({}));
        let on = crate::support::machine_with("mill-3axis.toml", keys);
        let told = Told::by(&on, says, |_| (), Box::new(NoPersistence));
        [late, after].map(|id| told.ok(id)["bus"].clone())
    };
    assert_eq!(bus(&[]), [Value::Null, Value::Null]);
    let clock = (
        "driver.options.bus_clock",
        "{drift_ppm = 20, jitter_us = 5}",
    );
    let stale = (
        "faults.wrap",
        "[{kind = \"drop\", at_call = 1180, periods = 20}]",
    );
    let [late, after] = bus(&[clock, stale]);
    assert!(late["phase_us"].is_number(), "{late}");
    assert!(late["feedback_age_periods"].as_u64().unwrap() > 0, "{late}");
    assert_eq!(after["feedback_age_periods"], 0);
    assert_eq!(after["old_feedback_periods"], 20);
}
