//! What an exchange takes: `cargo bench -p tandem-ethercat`. An item is a fine period of 1 ms on virtual time, the emulated devices'
//! own loops and all, so that thousands of items a second are × real time.
//!
//! Behind its table it prints how long an exchange takes beside a bare frame of the same bytes, in turn in one run: over a pair of
//! virtual network interfaces with the emulator's command at its other end, which `cargo build --release -p
//! tandem-ethercat-emulator` makes, and on the emulator in this process, where nothing is left of a frame but what devices do with
//! it. `TANDEM_BENCH_INTERFACE` names another interface, with four drives behind it and nothing else.

#![allow(clippy::format_push_string, reason = "options in pieces, once a rig")]

#[path = "../tests/common/mod.rs"]
mod common;

use std::time::{Duration, Instant};

use divan::Bencher;
use divan::counter::ItemsCount;
use tandem_ethercat::{EthercatDrives, Options};
use tandem_rig::{BUS_END, MASTER_END, program_beside, with_cable};
use tandem_sdk::{Driver, DriverContext, Feedback, Name, PluginOptions, Setpoint};

const CALLS: u32 = 1000;
const PERIOD_S: f64 = 0.001;
/// Drives of the bus on which an exchange is timed beside a bare frame, how often, and the pause before each.
const DRIVES: usize = 4;
const PAIRS: usize = 20_000;
const PAUSE: Duration = Duration::from_micros(200);
/// Names the interface at which that is done.
const INTERFACE: &str = "TANDEM_BENCH_INTERFACE";

fn main() {
    if let Ok(interface) = std::env::var(INTERFACE) {
        beside_a_bare_frame(&interface);
        return;
    }
    divan::main();
    beside_a_bare_frame("emulated");
    match over_a_cable() {
        Ok(told) => print!("{told}"),
        Err(why) => println!("over a cable: skipped: {why}"),
    }
}

/// This bench once more, at one end of a cable with the emulator at the other.
fn over_a_cable() -> Result<String, String> {
    let emulator = program_beside("tandem-ethercat-emulator")?;
    let bench = std::env::current_exe().map_err(|error| error.to_string())?;
    let bus = std::env::temp_dir().join(format!("tandem-bench-{}.toml", std::process::id()));
    std::fs::write(&bus, "[[devices]]\nkind = \"drive\"\n".repeat(DRIVES))
        .map_err(|error| error.to_string())?;
    let output = with_cable(&format!(
        "$fast {emulator} {bus} --interface {BUS_END} > /dev/null & emulator=$!\n\
         sleep 1; {INTERFACE}={MASTER_END} $fast {bench}; status=$?; kill $emulator; exit $status",
        emulator = emulator.display(),
        bus = bus.display(),
        bench = bench.display(),
    ));
    // It is read by then.
    let _ = std::fs::remove_file(&bus);
    let output = output?;
    if output.status.success() {
        Ok(String::from_utf8_lossy(&output.stdout).into_owned())
    } else {
        Err(String::from_utf8_lossy(&output.stderr).into_owned())
    }
}

/// A bus of so many drives in operation, all of them moving.
struct Rig {
    driver: EthercatDrives,
    setpoint: Setpoint,
    feedback: Feedback,
}

impl Rig {
    fn new(interface: &str, sync: &str, drives: usize, terminals: usize, real_time: bool) -> Self {
        let names = ["a", "b", "c", "d", "e", "f", "g", "h"];
        let mut text =
            format!("interface = \"{interface}\"\nsync = \"{sync}\"\nwatchdog_ms = 1000\n");
        for (position, name) in names[..drives].iter().enumerate() {
            text += &format!(
                "[[devices]]\nposition = {position}\nproduct = \"0x0e1a:0x0402\"\njoint = \"{name}\"\ncounts_per_mm = 8388.608\n"
            );
        }
        for (position, (product, lines)) in [
            ("0x044c2c52", ""),
            ("0x03f03052", "inputs = [0, 1, 2, 3]"),
            ("0x07d83052", "outputs = [0, 1, 2]"),
        ]
        .iter()
        .enumerate()
        .take(terminals)
        {
            text += &format!(
                "[[devices]]\nposition = {}\nproduct = \"2:{product}\"\n{lines}\n",
                drives + position
            );
        }
        let mut driver = EthercatDrives::new(&Options::read(&text).unwrap()).unwrap();
        let mut context = DriverContext::new(drives, PERIOD_S);
        for (joint, name) in context.joints.iter_mut().zip(names) {
            joint.name = Name::new(name);
        }
        context.real_time = u32::from(real_time);
        driver.open(&context).unwrap();
        let attached = driver.start().unwrap();
        let (mut setpoint, feedback) = common::begin(&attached);
        setpoint.enable = 1;
        let mut rig = Self {
            driver,
            setpoint,
            feedback,
        };
        while rig.feedback.state[..drives]
            .iter()
            .any(|state| *state != tandem_sdk::JointState::Enabled)
        {
            rig.exchange();
            if real_time {
                std::thread::sleep(Duration::from_micros(500));
            }
        }
        rig
    }

    fn exchange(&mut self) {
        self.setpoint.tick += 1;
        self.driver
            .exchange(&self.setpoint, &mut self.feedback)
            .unwrap();
    }

    /// Moves all joints back and forth by a little in each period.
    fn go(&mut self) {
        let step = if (self.setpoint.tick / 1000).is_multiple_of(2) {
            0.05
        } else {
            -0.05
        };
        for joint in 0..8 {
            self.setpoint.position[joint] += step;
            self.setpoint.velocity[joint] = step / PERIOD_S;
        }
        self.exchange();
    }
}

fn periods(bencher: Bencher, sync: &str, drives: usize, terminals: usize) {
    let mut rig = Rig::new("emulated", sync, drives, terminals, false);
    bencher
        .counter(ItemsCount::new(CALLS))
        .bench_local(|| (0..CALLS).for_each(|_| rig.go()));
}

#[divan::bench(args = ["free-run", "dc"])]
fn three_drives(bencher: Bencher, sync: &str) {
    periods(bencher, sync, 3, 0);
}

#[divan::bench(args = ["free-run", "dc"])]
fn four_drives_and_three_terminals(bencher: Bencher, sync: &str) {
    periods(bencher, sync, 4, 3);
}

#[divan::bench(args = ["free-run", "dc"])]
fn eight_drives(bencher: Bencher, sync: &str) {
    periods(bencher, sync, 8, 0);
}

/// An exchange and a bare frame, in turn, each behind the same pause; the times of each, sorted.
fn beside_a_bare_frame(interface: &str) {
    let mut rig = Rig::new(interface, "free-run", DRIVES, 0, true);
    let (mut times, mut lost) = ([vec![], vec![]], 0);
    for n in 0..2 * PAIRS {
        std::thread::sleep(PAUSE);
        let (before, begun) = (rig.driver.counters().lost, Instant::now());
        let came = if n % 2 == 0 {
            rig.exchange();
            true
        } else {
            rig.driver.send_again()
        };
        let took = begun.elapsed();
        let came = came && rig.driver.counters().lost == before;
        // How long each waits for a frame that does not come says nothing of a frame.
        if came {
            times[n % 2].push(took);
        } else {
            lost += 1;
        }
    }
    for times in &mut times {
        times.sort_unstable();
    }
    for share in [0.5, 0.9, 0.99] {
        let [exchange_us, frame_us] = times
            .each_ref()
            .map(|times| times[(times.len() as f64 * share) as usize].as_secs_f64() * 1e6);
        println!(
            "{interface}, p{:.0}: exchange {exchange_us:.1} µs, bare frame {frame_us:.1} µs, {:.2} of it; {lost} lost",
            share * 100.0,
            exchange_us / frame_us
        );
    }
}
