//! `EtherCAT` over a cable: the command and the emulator as programs of their own, on raw sockets, on the wall clock. What has to
//! be exact is tested on virtual time; here it is seen that each side comes to rest by itself when the other one is gone.
//!
//! An ordinary kernel may keep any of these programs waiting for longer than a bus is patient, so the machine here is, and nothing
//! is judged by the time that something took: only by what each side counted in its own clock.

use std::path::Path;

use tandem_rig::{BUS_END, MASTER_END, program_beside, with_cable};

/// How fast the drives stop by themselves, mm/s²: slowly, so that it is seen that they moved.
const STOP_MM_PER_S2: f64 = 20.0;
/// How long the drives wait for a frame where that is what is tried, ms: by then an axis that is told nothing more still moves.
const SHORT_WATCHDOG_MS: f64 = 20.0;
/// How long they wait elsewhere, ms: longer than a busy computer keeps the command waiting.
const WATCHDOG_MS: f64 = 2000.0;
/// A program that goes on for longer than any of these tests, the first way for 5 s.
const LONG: &str = "G21 G90 G94 F2500\nO1 repeat [100]\nG1 X-200\nG1 X0\nO1 endrepeat\nM2\n";

/// The example machine at an interface, and the bus that its emulator has otherwise, as two files in `folder`.
fn write_machine(folder: &Path, watchdog_ms: f64) {
    let example =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/machines/ethercat.toml");
    let text = std::fs::read_to_string(example).unwrap();
    let mut machine: toml::Table = text.parse().unwrap();
    let options = machine["drivers"]["bus"]["options"].as_table_mut().unwrap();
    let bus = options.remove("emulated").unwrap();
    options.insert("interface".to_string(), MASTER_END.into());
    options.insert("watchdog_ms".to_string(), watchdog_ms.into());
    options.insert("max_lost_frames".to_string(), 50.into());
    for device in options["devices"].as_array_mut().unwrap() {
        let device = device.as_table_mut().unwrap();
        let is_joint = device.contains_key("joint");
        let counts_per_mm = device
            .get("counts_per_turn")
            .and_then(toml::Value::as_float);
        if let Some(counts) = counts_per_mm.filter(|_| is_joint) {
            let counts_per_s2 = (counts / 10.0 * STOP_MM_PER_S2).round() as i64;
            let stop: toml::Table = format!("sdo = \"0x6085\"\nu32 = {counts_per_s2}")
                .parse()
                .unwrap();
            let startup = device
                .entry("startup")
                .or_insert(toml::Value::Array(vec![]));
            let startup = startup.as_array_mut().unwrap();
            startup.retain(|object| object["sdo"].as_str() != Some("0x6085"));
            startup.push(stop.into());
        }
    }
    for input in machine["inputs"].as_table_mut().unwrap().iter_mut() {
        let input = input.1.as_table_mut().unwrap();
        input.insert("max_age_ms".to_string(), 300.0.into());
    }
    // At a rapid feed the distance is as large as this computer is late.
    for axis in machine["axes"].as_table_mut().unwrap().iter_mut() {
        let axis = axis.1.as_table_mut().unwrap();
        axis.insert("max_following_error_mm".to_string(), 50.0.into());
    }
    let loops = machine["loops"].as_table_mut().unwrap();
    loops.insert("max_missed_periods".to_string(), 250.into());
    loops.insert("max_missed_share".to_string(), 1.0.into());
    std::fs::write(folder.join("machine.toml"), machine.to_string()).unwrap();
    std::fs::write(folder.join("bus.toml"), toml::to_string(&bus).unwrap()).unwrap();
    std::fs::write(folder.join("long.ngc"), LONG).unwrap();
}

/// What became of a run over the cable.
struct Ran {
    /// What the command ended with; none where it was killed.
    status: Option<i32>,
    told: String,
    /// What the emulator told, a line for each change of a device.
    bus: String,
    /// What other commands told that the script ran meanwhile.
    beside: String,
    /// Rows of the trace, with the names of the columns first.
    trace: Vec<Vec<String>>,
}

/// Runs `tandem` with these arguments behind the cable, does `script` to both of the programs `$tandem` and `$emulator`, and
/// waits for the command's end. None, and a word on why, where that cannot be.
fn ran(arguments: &str, script: &str, watchdog_ms: f64) -> Option<Ran> {
    let folder = tempfile::tempdir().unwrap();
    write_machine(folder.path(), watchdog_ms);
    let run = program_beside("tandem-ethercat-emulator").and_then(|emulator| {
        let script = format!(
            "cd {folder}\n\
             $fast {emulator} bus.toml --interface {BUS_END} --for 120 > bus.txt & emulator=$!\n\
             n=0; until grep -q devices bus.txt || [ $n -gt 100 ]; do sleep 0.1; n=$((n+1)); done\n\
             {tandem} {arguments} --machine machine.toml > told.txt 2>&1 & tandem=$!\n\
             soon() {{ n=0; until grep -q \"$1\" $2 || [ $n -gt 400 ] || ! kill -0 $tandem; do sleep 0.1; n=$((n+1)); done; }}\n\
             {script}\n\
             wait $tandem; status=$?; sleep 0.5\n\
             kill -CONT $emulator; kill -KILL $emulator; exit $status",
            folder = folder.path().display(),
            emulator = emulator.display(),
            tandem = env!("CARGO_BIN_EXE_tandem"),
        );
        with_cable(&script)
    });
    let output = match run {
        Ok(output) => output,
        Err(why) => {
            println!("skipped: {why}");
            return None;
        }
    };
    let file = |name: &str| std::fs::read_to_string(folder.path().join(name)).unwrap_or_default();
    let told = file("told.txt");
    if told.contains("CAP_NET_RAW") {
        println!("skipped: {told}");
        return None;
    }
    let row = |line: &str| line.split(',').map(str::to_string).collect();
    Some(Ran {
        status: output.status.code(),
        told,
        bus: file("bus.txt"),
        beside: file("beside.txt"),
        trace: file("trace.csv").lines().map(row).collect(),
    })
}

impl Ran {
    /// Seconds by the emulator's clock at which a device was told to be in a state for the first time.
    fn first_s(&self, device: &str, state: &str) -> Option<f64> {
        let line = self
            .bus
            .lines()
            .find(|line| line.contains(device) && line.ends_with(state))?;
        line.split(' ').next()?.parse().ok()
    }

    fn column(&self, name: &str) -> Vec<&str> {
        let place = self.trace[0].iter().position(|column| column == name);
        let place = place.unwrap_or_else(|| panic!("{name}: {:?}", self.trace[0]));
        self.trace[1..]
            .iter()
            .map(|row| row[place].as_str())
            .collect()
    }

    fn everything(&self) -> String {
        format!("{:?}\n{}\nthe bus:\n{}", self.status, self.told, self.bus)
    }
}

/// A whole program: homed by the drives, run, and the bus left in INIT.
#[test]
fn a_program_runs_over_a_cable() {
    let square = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/programs/square.ngc");
    let arguments = format!("run {} --home --clock wall", square.display());
    let Some(ran) = ran(&arguments, "", WATCHDOG_MS) else {
        return;
    };
    assert_eq!(ran.status, Some(0), "{}", ran.everything());
    assert!(
        ran.told.contains("limit violations 0, guard stops 0"),
        "{}",
        ran.everything()
    );
    for (number, drive) in ["x", "y", "z"].iter().enumerate() {
        let device = format!("device {number} {drive}:");
        let last = ran.bus.lines().rfind(|line| line.contains(&device));
        assert!(
            last.is_some_and(|line| line.contains("Init")),
            "{}",
            ran.everything()
        );
    }
}

/// Objects of the drives are read and written by another command while the program runs: the process that drives the bus does it.
#[test]
fn objects_are_read_and_written_while_a_program_runs() {
    let sdo = format!("{} bus sdo", env!("CARGO_BIN_EXE_tandem"));
    let script = format!(
        "soon 'device 2 z: Op, OperationEnabled' bus.txt; sleep 1\n\
         ({sdo} write 1 0x6085 32 9876543 --interface {MASTER_END}; {sdo} read 1 0x6085 --machine machine.toml\n\
         {sdo} write 0 0x607a 32 5 --interface {MASTER_END}; {sdo} read 9 0x6085 --interface {MASTER_END}\n\
         {sdo} read 1 0x5fff --interface {MASTER_END}) > beside.txt 2>&1\n\
         echo \"and it runs: $(kill -0 $tandem && echo yes)\" >> beside.txt; kill -INT $tandem"
    );
    let arguments = "run long.ngc --clock wall --set machine.require_homing=false";
    let Some(ran) = ran(arguments, &script, WATCHDOG_MS) else {
        return;
    };
    for words in [
        "6085:00 = 0x96b43f, read back",
        "6085:00 = 0x0096b43f, 9876543, 9876543 with a sign, 32 bits",
        "device 0 (x): 607A is the driver's own, which writes it in every period",
        "there is no device 9: 7 are on the bus, from 0",
        "device 1 (y): reading 5FFF:00: it refuses",
        "and it runs: yes",
    ] {
        assert!(
            ran.beside.contains(words),
            "{words}: {}\n{}",
            ran.beside,
            ran.everything()
        );
    }
    assert!(!ran.told.contains("fault"), "{}", ran.everything());
}

/// A run whose master is killed or stopped in mid-motion. A busy computer may keep the command waiting for as long as the short
/// watchdog before that, and then it faults by itself: such a run shows nothing, and another one is made.
fn ran_until_the_master_was_gone(signal: &str) -> Option<Ran> {
    let script = format!(
        "soon 'device 2 z: Op, OperationEnabled' bus.txt; sleep 1.5\n\
         kill -{signal} $tandem; sleep 3; kill -CONT $tandem 2>/dev/null"
    );
    let arguments = "run long.ngc --clock wall --set machine.require_homing=false";
    for _ in 0..8 {
        let ran = ran(arguments, &script, SHORT_WATCHDOG_MS)?;
        if ran.first_s("device 0 x:", "QuickStopActive").is_none() {
            return Some(ran);
        }
    }
    println!(
        "skipped: this computer kept the command waiting for {SHORT_WATCHDOG_MS} ms eight times"
    );
    None
}

/// The master dies, or falls silent, in mid-motion: the drives stop by their own watchdog, on their own ramp.
#[test]
fn the_drives_stop_by_their_own_watchdog_when_the_master_is_gone() {
    for signal in ["KILL", "STOP"] {
        let Some(ran) = ran_until_the_master_was_gone(signal) else {
            return;
        };
        let stops = ran.first_s("device 0 x:", "SafeOp, error 0x001B, FaultReactionActive");
        let rests = ran.first_s("device 0 x:", "SafeOp, error 0x001B, Fault");
        let (Some(stops), Some(rests)) = (stops, rests) else {
            panic!("{signal}: the drive did not stop: {}", ran.everything());
        };
        assert!(
            rests - stops > 0.01,
            "{signal}: it stood already: {}",
            ran.everything()
        );
        for device in ["device 1 y:", "device 2 z:", "device 3 spindle:"] {
            let left = ran
                .bus
                .lines()
                .any(|line| line.contains(device) && line.contains("SafeOp, error 0x001B"));
            assert!(left, "{signal}: {device} {}", ran.everything());
        }
        if signal == "STOP" {
            // It comes back, finds its drives gone, and does not go on.
            assert_eq!(ran.status, Some(3), "{}", ran.everything());
        }
    }
}

/// The bus dies in mid-motion, or its cable is pulled: the machine faults as soon as its patience with lost frames is over, and says
/// why.
#[test]
fn the_machine_faults_by_name_when_the_bus_is_gone() {
    for end in [
        "kill -KILL $emulator",
        "kill -STOP $emulator",
        "ip link set dev veth-bus down",
    ] {
        let script = format!("soon 'device 2 z: Op, OperationEnabled' bus.txt; sleep 1.5; {end}");
        let arguments =
            "run long.ngc --clock wall --set machine.require_homing=false --trace trace.csv";
        let Some(ran) = ran(arguments, &script, WATCHDOG_MS) else {
            return;
        };
        assert_eq!(ran.status, Some(3), "{end}: {}", ran.everything());
        assert!(
            ran.told.contains("no frame comes back"),
            "{end}: {}",
            ran.everything()
        );
        let (state, seen, sent) = (
            ran.column("state"),
            ran.column("x_fb_mm"),
            ran.column("x_cmd_mm"),
        );
        let faulted = state
            .iter()
            .position(|state| *state == "stopping" || *state == "fault");
        let faulted = faulted.unwrap_or_else(|| panic!("{end}: {:?}", state.last()));
        let fresh = (1..faulted)
            .rfind(|tick| seen[*tick] != seen[tick - 1])
            .unwrap_or_default();
        // 50 frames may be lost; with the next the joint is.
        assert!(
            faulted - fresh <= 52,
            "{end}: {fresh} {faulted} {}",
            ran.everything()
        );
        assert_ne!(sent[fresh], sent[0], "{end}: it did not move");
        assert_eq!(
            sent[sent.len() - 1],
            sent[sent.len() - 2],
            "{end}: it comes to rest"
        );
    }
}

/// The adapter goes and comes back, with another number: a reset says what is missing, and then opens it again.
#[test]
fn an_interface_that_went_and_came_back_is_opened_again_by_a_reset() {
    let script = format!(
        "ask=\"{tandem} ask --connect s.socket\"\n\
         until_state() {{ n=0; until $ask status | grep -q '\"state\":\"'$1'\"' || [ $n -gt 400 ]; do sleep 0.05; n=$((n+1)); done; }}\n\
         until_state ready\n\
         ip link del {BUS_END}; until_state fault\n\
         $ask reset > beside.txt 2>&1; until_state fault\n\
         kill -KILL $emulator\n\
         ip link add {BUS_END} type veth peer name {MASTER_END}\n\
         for end in {BUS_END} {MASTER_END}; do echo 1 > /proc/sys/net/ipv6/conf/$end/disable_ipv6; ip link set dev $end up; done\n\
         $fast {emulator} bus.toml --interface {BUS_END} --for 120 > bus.txt & emulator=$!\n\
         n=0; until grep -q devices bus.txt || [ $n -gt 100 ]; do sleep 0.1; n=$((n+1)); done\n\
         ($ask reset; until_state ready; $ask mdi line='G1 X0.5 F600'; $ask status) >> beside.txt 2>&1\n\
         kill -INT $tandem",
        tandem = env!("CARGO_BIN_EXE_tandem"),
        emulator = program_beside("tandem-ethercat-emulator")
            .unwrap_or_default()
            .display(),
    );
    let arguments =
        "serve --no-state --enable --listen s.socket --set machine.require_homing=false";
    let Some(ran) = ran(arguments, &script, WATCHDOG_MS) else {
        return;
    };
    let told = format!("{}\n{}", ran.beside, ran.everything());
    let missing = format!("there is no network interface {MASTER_END}");
    for words in [
        missing.as_str(),
        "\"outcome\":\"done\"",
        "\"old_feedback_periods\"",
    ] {
        assert!(ran.beside.contains(words), "{words}: {told}");
    }
}
