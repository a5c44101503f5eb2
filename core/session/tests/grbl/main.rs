//! Senders of grbl's protocol on the virtual clock: what they are told, and what the machine does.

mod blocked;
mod counting;
mod height_map;
mod planned_through;
mod random_machines;
mod speak;

use proptest::prelude::Rng;
use proptest::test_runner::{RngAlgorithm, TestRng};
use serde_json::{Value, json};
use tandem_session::controller::{ScriptLine, VirtualSender};

use speak::{
    Heard, Speaker, Streamer, alone_s, assert_as_long_as_a_run, beginning, chords, field, jobs,
    machine, serve, speak, state, states, ticks_of, took_s, words,
};

#[test]
fn a_program_that_is_streamed_takes_the_time_of_a_run() {
    let machine = machine("mill-3axis.toml", &[]);
    let text = chords(2000);
    let alone_s = alone_s(&machine, &text);
    for budget in [40, 127, 1023] {
        let (streamer, seen) = Streamer::new(&text, budget, 200, budget as u8);
        let told = serve(&machine, vec![streamer], vec![]);
        let (seen, jobs) = (seen.lock().unwrap(), jobs(&told));
        assert_eq!(seen.errors, [""; 0]);
        assert_eq!(seen.answers, 2001, "each line has one answer");
        assert_eq!(seen.lies, [""; 0]);
        assert_eq!(jobs.len(), 1, "it is planned through: {jobs:?}");
        assert_as_long_as_a_run(&jobs, alone_s, &format!("{budget} bytes on the way"));
    }
}

/// Chords of 0.01 mm, of which the planner sees no more than a few millimetres: it is to have all that it holds, and not what comes in
/// a rough period and then a rest.
#[test]
fn chords_of_a_hundredth_are_streamed_in_the_time_of_a_run() {
    let machine = machine("mill-3axis.toml", &[]);
    let all = chords(100_000);
    let text: String = all.split_inclusive('\n').take(4000).collect();
    let alone_s = alone_s(&machine, &text);
    for budget in [127, 1023] {
        let (streamer, seen) = Streamer::new(&text, budget, 200, 3);
        let told = serve(&machine, vec![streamer], vec![]);
        assert_eq!(seen.lock().unwrap().errors, [""; 0]);
        assert_as_long_as_a_run(&jobs(&told), alone_s, &format!("{budget} bytes on the way"));
    }
}

/// `cargo test -p tandem-session --test grbl hundred -- --ignored --nocapture`.
#[test]
#[ignore = "it takes some seconds"]
fn a_hundred_thousand_lines_are_streamed_in_the_time_of_a_run() {
    let machine = machine("mill-3axis.toml", &[]);
    let text = chords(100_000);
    let began = std::time::Instant::now();
    let alone_s = alone_s(&machine, &text);
    let run_took = began.elapsed();
    let began = std::time::Instant::now();
    let (streamer, seen) = Streamer::new(&text, 127, 200, 1);
    let told = serve(&machine, vec![streamer], vec![]);
    let stream_took = began.elapsed();
    assert_eq!(seen.lock().unwrap().errors, [""; 0]);
    let took_s = took_s(&jobs(&told));
    let of_processor = stream_took.as_secs_f64() / run_took.as_secs_f64();
    println!(
        "machine time {took_s:.2} s of {alone_s:.2} s, {} jobs; processor {:.2} of a run, {:.1} µs a line",
        jobs(&told).len(),
        of_processor,
        stream_took.as_secs_f64() * 1e6 / 1e5
    );
    assert_as_long_as_a_run(&jobs(&told), alone_s, "127 bytes on the way");
}

#[test]
fn a_sender_that_stops_leaves_the_machine_on_the_path_and_finds_it_there() {
    let machine = machine("mill-3axis.toml", &[]);
    let lines: Vec<String> = (1..=60).map(|x| format!("G1 X{x}\n")).collect();
    let text = format!("G21 G90 F3000\n{}", lines.concat());
    let (mut streamer, seen) = Streamer::new(&text, 127, 100, 7);
    streamer.stall = Some((31, 4000));
    let ask = |tick, id| ScriptLine {
        tick,
        client: 1,
        line: json!({ "id": id, "request": "status" }).to_string(),
    };
    let told = serve(
        &machine,
        vec![streamer],
        vec![ask(3000, 1), ask(3500, 2), ask(9000, 3)],
    );
    assert_eq!(seen.lock().unwrap().errors, [""; 0]);
    let place = |id: u64| {
        let of = told.iter().find(|told| told["told"]["id"] == id).unwrap();
        of["told"]["ok"]["position"].clone()
    };
    assert_eq!(place(1), place(2), "it rests");
    let x = place(1)["x_mm"].as_f64().unwrap();
    assert!(
        (x - 30.0).abs() < 1e-9,
        "at the end of the last line that came: {x}"
    );
    assert_eq!(place(1)["y_mm"], 0.0);
    assert_eq!(place(3)["x_mm"], 60.0);
    assert_eq!(jobs(&told).len(), 2);
}

#[test]
fn a_hold_acts_in_the_period_after_it_is_read_and_a_resume_goes_on() {
    let machine = machine("mill-3axis.toml", &[]);
    let mut says: Vec<(u64, &[u8])> = vec![(1000, b"G1 X100 F3000\n")];
    for tick in 1390..1420 {
        says.push((tick, if tick == 1400 { b"!?" } else { b"?" }));
    }
    says.extend([(2500, &b"?"[..]), (2600, b"~"), (5500, b"?")]);
    let Heard { log, .. } = speak(&machine, &says, 6000, vec![]);
    let reports: Vec<(u64, &str)> = log
        .iter()
        .filter(|(_, line)| line.starts_with('<'))
        .map(|(tick, line)| (*tick, line.as_str()))
        .collect();
    let feed_at = |tick: u64| -> f64 {
        let (_, report) = reports.iter().find(|(at, _)| *at == tick + 1).unwrap();
        field(report, "FS")
            .unwrap()
            .split(',')
            .next()
            .unwrap()
            .parse()
            .unwrap()
    };
    assert_eq!((feed_at(1395), feed_at(1400)), (3000.0, 3000.0));
    // 1000 mm/s² take 60 mm/min off in a period.
    assert!(feed_at(1401) < 2945.0, "{}", feed_at(1401));
    assert!(feed_at(1410) < feed_at(1405) && feed_at(1405) < feed_at(1402));
    let (_, held) = reports[reports.len() - 2];
    let (_, end) = reports[reports.len() - 1];
    assert_eq!(state(held), "Hold:0");
    assert_eq!(
        (state(end), field(end, "MPos")),
        ("Idle", Some("100.000,0.000,0.000"))
    );
}

#[test]
fn jogs_are_planned_through_and_end_within_their_limits() {
    let machine = machine("mill-3axis.toml", &[]);
    let says: [(u64, &[u8]); 12] = [
        (1000, b"$J=G91 X5 Y5 F3000\n"),
        (1010, b"$J=G91 X5 Y5 F3000\n?"),
        (1020, b"G0 X1\n"),
        (4000, b"?"),
        (4010, b"$J=G90 G21 X200 F6000\n$J=G91 X-1 F6000\n"),
        (4500, b"\x85"),
        (5500, b"?"),
        (5510, b"$J=X500 F100\n$J=X1\n$J=G2 X1 F1\n"),
        (5520, b"$G\n"),
        (5530, b"G20\n$J=G21 X10 F100\n$G\n"),
        (5540, b"\x85"),
        (6500, b"G1 X2 F60\n$J=X1 F5\n"),
    ];
    let Heard { words, told, .. } = speak(&machine, &says, 7000, vec![]);
    assert_eq!((&*words[0], &*words[2]), ("ok", "ok"));
    assert_eq!(state(&words[1]), "Jog");
    assert_eq!(words[4], "error:9", "{words:?}");
    assert_eq!(
        (state(&words[5]), field(&words[5], "MPos")),
        ("Idle", Some("10.000,10.000,0.000"))
    );
    assert_eq!(&words[6..8], ["ok", "ok"]);
    assert_eq!(state(&words[8]), "Idle");
    let x: f64 = field(&words[8], "MPos")
        .unwrap()
        .split(',')
        .next()
        .unwrap()
        .parse()
        .unwrap();
    assert!(x > 40.0 && x < 70.0, "it was let go on its way: {x}");
    let errors = beginning(&words, "error");
    assert_eq!(
        errors,
        ["error:9", "error:15", "error:22", "error:16", "error:8"],
        "{words:?}"
    );
    let modes = beginning(&words, "[GC:");
    assert_eq!(modes.len(), 2);
    assert!(
        modes[0].contains("G80") && modes[0].contains("G21"),
        "a jog leaves no modes: {modes:?}"
    );
    assert!(
        modes[1].contains("G20") && modes[1].contains("F0"),
        "{modes:?}"
    );
    assert!(
        jobs(&told).iter().all(|job| job["fault"].is_null()),
        "{told:?}"
    );
}

#[test]
fn what_is_refused_has_a_number_that_senders_know_and_our_words() {
    let machine = machine("mill-3axis.toml", &[]);
    let cases: [(&str, &str, &str); 14] = [
        ("G1 X1", "error:22", "feed"),
        ("G0 X9999", "error:15", "travel"),
        ("G0 X1 X2", "error:25", "X"),
        ("G0 G1 X1 F1", "error:21", "G"),
        ("G999", "error:20", "G999"),
        ("G2 X1 F10", "error:35", ""),
        ("G0 X", "error:2", ""),
        ("G10 L2 X1", "error:28", "P"),
        ("$110=5", "error:3", "mill-3axis.toml"),
        ("$RST=*", "error:3", "RST"),
        ("$N0=G20", "error:3", "start"),
        ("$H", "error:5", "needs no homing"),
        ("$J=X1", "error:22", "feed"),
        ("$J=X1 F1 M3", "error:16", "M3"),
    ];
    for (line, number, why) in cases {
        let said = format!("{line}\n");
        let Heard { words, .. } = speak(&machine, &[(1000, said.as_bytes())], 1500, vec![]);
        assert_eq!(words.len(), 2, "{line}: {words:?}");
        assert!(
            words[0].starts_with("[MSG:") && words[0].contains(why),
            "{line}: {words:?}"
        );
        assert_eq!(words[1], number, "{line}: {words:?}");
    }
}

#[test]
fn a_sender_that_ends_its_job_with_hold_and_reset_finds_the_machine_where_it_was() {
    let machine = machine("mill-3axis.toml", &[]);
    let says: [(u64, &[u8]); 10] = [
        (1000, b"M3 S1000\nG91 G1 X10 F6000\nM8\n"),
        (2000, b"?"),
        (2100, b"!"),
        (2200, b"?G1 X5\n"),
        (3100, b"\x18\n"),
        (3500, b"$G\n?"),
        (4000, b"G1 X20 F1000\n"),
        (4500, b"\x18"),
        (6000, b"?"),
        (6100, b"G0 X0\n"),
    ];
    let Heard { words, told, .. } = speak(&machine, &says, 9000, vec![]);
    let reports = beginning(&words, "<");
    let seen: Vec<_> = reports
        .iter()
        .map(|report| (state(report), field(report, "MPos").unwrap()))
        .collect();
    assert_eq!(seen[0], ("Idle", "10.000,0.000,0.000"));
    assert_eq!(seen[1], ("Hold:0", "10.000,0.000,0.000"));
    assert_eq!(
        seen[2],
        ("Idle", "10.000,0.000,0.000"),
        "a hold at rest, a reset: it stands where it stood"
    );
    assert_eq!(seen[3].0, "Idle", "no alarm: the place is known");
    let x: f64 = seen[3].1.split(',').next().unwrap().parse().unwrap();
    assert!(x > 15.0 && x < 20.0, "it came to rest on its path: {x}");
    assert_eq!(beginning(&words, "Grbl 1.1h").len(), 2);
    let modes = words.iter().find(|word| word.starts_with("[GC:")).unwrap();
    assert!(modes.contains("G90") && modes.contains("M5 M9"), "{modes}");
    assert!(
        !words.iter().any(|word| word.starts_with("ALARM")),
        "{words:?}"
    );
    assert!(
        told.iter()
            .all(|told| told["told"]["job"]["outcome"] != "fault")
    );
}

#[test]
fn an_alarm_is_told_once_and_locks_until_it_is_taken_back() {
    let machine = machine("mill-3axis.toml", &[]);
    let stop = ScriptLine {
        tick: 1500,
        client: 1,
        line: json!({ "id": 1, "request": "emergency-stop" }).to_string(),
    };
    let says: [(u64, &[u8]); 7] = [
        (1000, b"G1 X100 F3000\n"),
        (2500, b"?G0 X1\n$J=X1F1\n"),
        (2600, b"$X\n"),
        (4000, b"?"),
        (4100, b"G0 X0\n"),
        (7000, b"?"),
        (7100, b"$SLP\n?"),
    ];
    let Heard { words, .. } = speak(&machine, &says, 8000, vec![stop]);
    assert_eq!(beginning(&words, "ALARM:").len(), 1, "{words:?}");
    assert!(
        words
            .iter()
            .any(|word| word.starts_with("[MSG:") && word.contains("emergency stop")),
        "{words:?}"
    );
    let reports = states(&words);
    assert_eq!(&reports[..3], ["Alarm", "Idle", "Idle"]);
    assert_eq!(
        words.iter().filter(|word| *word == "error:9").count(),
        2,
        "{words:?}"
    );
    assert!(words.iter().any(|word| word.contains("Caution: Unlocked")));
    assert!(
        words.iter().any(|word| word == "[MSG:Sleeping]"),
        "{words:?}"
    );
}

#[test]
fn a_machine_that_is_to_be_homed_says_so_and_homes() {
    let machine = machine("mill-homing.toml", &[]);
    let says: [(u64, &[u8]); 5] = [
        (1500, b"?G0 X1\n$J=G91 X1 F100\n"),
        (1600, b"$X\n$J=G91 X1 F100\nG0 X1\n"),
        (4000, b"$H\n"),
        (4500, b"?"),
        (95_000, b"?G0 X1\n"),
    ];
    let Heard { words, .. } = speak(&machine, &says, 97_000, vec![]);
    let reports = states(&words);
    assert_eq!(reports, ["Alarm", "Home", "Idle"], "{words:?}");
    let answers: Vec<&String> = words
        .iter()
        .filter(|word| *word == "ok" || word.starts_with("error"))
        .collect();
    assert_eq!(
        answers,
        ["error:9", "error:9", "ok", "ok", "error:9", "ok", "ok"],
        "{words:?}"
    );
}

#[test]
fn check_mode_judges_and_moves_nothing() {
    let machine = machine("mill-3axis.toml", &[]);
    let says: [(u64, &[u8]); 5] = [
        (1000, b"$C\n"),
        (1005, b"?"),
        (1010, b"G91 G1 X10 F100\nX9999\nG55\n$G\n$J=X1F1\n"),
        (2000, b"$C\n"),
        (2500, b"?$G\n"),
    ];
    let Heard { words, told, .. } = speak(&machine, &says, 3000, vec![]);
    let reports = beginning(&words, "<");
    assert_eq!((state(reports[0]), state(reports[1])), ("Check", "Idle"));
    assert_eq!(field(reports[1], "MPos"), Some("0.000,0.000,0.000"));
    assert!(
        words.contains(&"error:15".to_string()) && words.contains(&"error:8".to_string()),
        "{words:?}"
    );
    let modes = beginning(&words, "[GC:");
    assert!(
        modes[0].contains("G55 ") && modes[0].contains("G91"),
        "{modes:?}"
    );
    assert!(
        modes[1].contains("G54 ") && modes[1].contains("G90"),
        "nothing stays of it: {modes:?}"
    );
    assert_eq!(jobs(&told).len(), 0);
}

#[test]
fn reports_are_in_inches_where_that_is_asked_for_and_offsets_are_told_when_the_path_has_reached_them()
 {
    let machine = machine("mill-3axis.toml", &[]);
    let says: [(u64, &[u8]); 7] = [
        (1000, b"G21 G1 X25.4 F6000\nG10 L20 P1 X10\n"),
        (3000, b"?"),
        (3010, b"$13=1\n$10=0\n"),
        (3015, b"?"),
        (3020, b"?$#\n$$\n$I\n$N\n$\n"),
        (3030, b"$13=2\n"),
        (3040, b"$10=3\n$13=0\n"),
    ];
    let Heard { words, .. } = speak(&machine, &says, 3500, vec![]);
    let reports = beginning(&words, "<");
    assert_eq!(field(reports[0], "MPos"), Some("25.400,0.000,0.000"));
    assert_eq!(field(reports[0], "WCO"), Some("15.400,0.000,0.000"));
    assert_eq!(
        field(reports[1], "WPos"),
        Some("0.3937,0.0000,0.0000"),
        "{reports:?}"
    );
    assert_eq!(
        (field(reports[1], "MPos"), field(reports[1], "Bf")),
        (None, None)
    );
    assert_eq!(field(reports[1], "WCO"), Some("0.6063,0.0000,0.0000"));
    assert_eq!(field(reports[2], "Ov"), Some("100,100,100"));
    for line in [
        "[G54:0.6063,0.0000,0.0000]",
        "[G92:0.0000,0.0000,0.0000]",
        "[TLO:0.0000]",
        "$13=1",
        "$110=15000",
        "$130=500",
        "[AXS:3:XYZ]",
    ] {
        assert!(words.iter().any(|word| word == line), "{line}: {words:?}");
    }
    assert!(
        words
            .iter()
            .any(|word| word.starts_with("[OPT:") && word.ends_with(",128,1024]")),
        "{words:?}"
    );
    assert!(words.iter().any(|word| word.starts_with("[HLP:")));
}

#[test]
fn whoever_holds_the_machine_is_named_to_whoever_does_not() {
    let machine = machine("mill-3axis.toml", &[]);
    let ask = |tick, id, request: Value| {
        let mut line = request;
        line["id"] = json!(id);
        ScriptLine {
            tick,
            client: 1,
            line: line.to_string(),
        }
    };
    let script = vec![
        ask(500, 1, json!({ "request": "lease", "how": "take" })),
        ask(2000, 2, json!({ "request": "lease", "how": "release" })),
        ask(3500, 3, json!({ "request": "mdi", "line": "G0 X9" })),
        ask(9000, 4, json!({ "request": "lease", "how": "take" })),
    ];
    let says: [(u64, &[u8]); 3] = [
        (1000, b"G1 X5 F6000\n$H\n?"),
        (3000, b"G1 X50 F3000\n"),
        (3600, b"?"),
    ];
    let Heard { words, told, .. } = speak(&machine, &says, 9500, script);
    assert_eq!(
        &words[1..3],
        ["[MSG:client 1 holds the machine]", "error:9"],
        "{words:?}"
    );
    let why = told.iter().find(|told| told["told"]["id"] == 3).unwrap();
    let why = why["told"]["error"]["why"].as_str().unwrap();
    assert!(
        why.contains("the sender at the virtual clock") && why.contains("holds it"),
        "{why}"
    );
    let last = told.iter().find(|told| told["told"]["id"] == 4).unwrap();
    assert_eq!(
        last["told"]["ok"]["lease"], "take",
        "a sender that has nothing to do lets go"
    );
}

/// M3 rests on the path and keeps nobody waiting; a dwell of no time is how senders wait.
#[test]
fn what_rests_to_switch_is_answered_at_once_and_a_dwell_of_no_time_when_it_is_reached() {
    let machine = machine("mill-3axis.toml", &[]);
    let says: [(u64, &[u8]); 1] = [(1000, b"G1 X10 F3000\nM3 S1000\nG1 X20\nG4 P0\n")];
    let Heard { log, told, .. } = speak(&machine, &says, 3000, vec![]);
    let oks = ticks_of(&log, "ok");
    assert!(oks[2] < 1010, "{oks:?}");
    // Each of the two ways takes 0.25 s at the least.
    assert!(oks[3] > 1450, "{oks:?}");
    assert_eq!(jobs(&told).len(), 1);
}

#[test]
fn dwells_stops_and_the_end_are_answered_when_the_machine_has_come_there() {
    let machine = machine("mill-3axis.toml", &[]);
    let says: [(u64, &[u8]); 5] = [
        (1000, b"G1 X10 F3000\nG4 P0.5\nG91\n"),
        (4000, b"G1 X10\nM0\nG1 X10\nM30\n"),
        (6000, b"?"),
        (6100, b"~"),
        (8000, b"?$G\n"),
    ];
    let Heard { log, .. } = speak(&machine, &says, 8500, vec![]);
    let oks = ticks_of(&log, "ok");
    // The way takes 0.25 s at the least, and the dwell 0.5 s.
    assert!(oks[0] < 1010 && oks[1] > 1700 && oks[1] < 2000, "{oks:?}");
    let at = |text: &str| {
        log.iter()
            .find(|(_, line)| line.contains(text))
            .map(|(tick, _)| *tick)
    };
    assert!(at("waits for the operator").unwrap() < 5000);
    assert!(
        oks[4] > 6100,
        "the stop is answered behind the resume: {oks:?}"
    );
    assert!(at("Pgm End").is_some());
    let reports: Vec<&str> = log
        .iter()
        .filter(|(_, line)| line.starts_with('<'))
        .map(|(_, line)| line.as_str())
        .collect();
    assert_eq!(state(reports[0]), "Hold:0");
    assert_eq!(field(reports[1], "MPos"), Some("30.000,0.000,0.000"));
    let modes = log
        .iter()
        .find(|(_, line)| line.starts_with("[GC:"))
        .unwrap();
    assert!(
        modes.1.contains("G90"),
        "the end puts modes back: {modes:?}"
    );
}

#[test]
fn probes_tell_where_they_touched() {
    let machine = machine("mill-probe.toml", &[]);
    let says: [(u64, &[u8]); 4] = [
        (1500, b"G0 X-20\nG21 G91 G38.2 Z-20 F1200\nG0 Z5\n$#\n"),
        (12_000, b"?G38.3 Z2 F600\n"),
        (15_000, b"G38.2 Z1 F600\n"),
        (17_000, b"?"),
    ];
    let Heard { words, .. } = speak(&machine, &says, 18_000, vec![]);
    let found = beginning(&words, "[PRB:");
    assert!(
        found[0].ends_with(":1]") && found[1].ends_with(":1]"),
        "{words:?}"
    );
    assert_eq!(found[0], found[1], "$# repeats it");
    assert!(found[2].ends_with(":0]"), "{words:?}");
    assert!(words.iter().any(|word| word == "ALARM:5"), "{words:?}");
    let at = words.iter().position(|word| word == found[0]).unwrap();
    assert_eq!(words[at + 1], "ok", "the place comes before the answer");
}

/// Random bytes, among them all that act at once, but no line that moves: nothing moves, nothing panics, and each line that was
/// not forgotten has its answer.
struct Noise {
    rng: TestRng,
    streams: usize,
}

impl VirtualSender for Noise {
    fn period(&mut self, _tick: u64, _heard: &str, say: &mut Vec<u8>) -> bool {
        for _ in 0..100 {
            let length = self.rng.next_u32() % 24;
            for _ in 0..length {
                say.push(self.rng.next_u32() as u8);
            }
            self.streams -= 1;
        }
        self.streams > 0
    }
}

#[test]
fn no_bytes_move_the_machine_without_a_line_that_does() {
    let machine = machine("mill-3axis.toml", &[]);
    let mut seed = [0; 32];
    seed[0] = std::env::var("TANDEM_SEED").map_or(1, |seed| seed.parse().unwrap());
    println!("TANDEM_SEED={}", seed[0]);
    let noise = Noise {
        rng: TestRng::from_seed(RngAlgorithm::ChaCha, &seed),
        streams: 100_000,
    };
    let status = ScriptLine {
        tick: 20_000,
        client: 1,
        line: json!({ "id": 1, "request": "status" }).to_string(),
    };
    let (speaker, log) = Speaker::new(&[(19_000, b"\x18"), (19_500, b"?")], 20_000);
    let told = serve(&machine, vec![Box::new(noise), speaker], vec![status]);
    let status = told.iter().find(|told| told["told"]["id"] == 1).unwrap();
    for axis in ["x_mm", "y_mm", "z_mm"] {
        assert_eq!(status["told"]["ok"]["position"][axis], 0.0);
    }
    let words = words(&log);
    assert_eq!(state(words.last().unwrap()), "Idle", "{words:?}");
}
