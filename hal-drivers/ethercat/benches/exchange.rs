//! What an exchange takes: `cargo bench -p tandem-ethercat`. An item is a fine period of 1 ms on virtual time, the emulated devices'
//! own loops and all, so that thousands of items a second are × real time.
//!
//! Behind its table it prints how long an exchange takes beside a bare frame of the same bytes, one after the other in one run: on
//! the emulator in this process, or at the interface that `TANDEM_BENCH_INTERFACE` names, with four drives behind it
//! (and nothing else).

#![allow(clippy::format_push_string, reason = "options in pieces, once a rig")]

use std::time::{Duration, Instant};

use divan::Bencher;
use divan::counter::ItemsCount;
use tandem_ethercat::{EthercatDrives, Options};
use tandem_sdk::{Driver, DriverContext, Feedback, Name, PluginOptions, Setpoint};

const CALLS: u32 = 1000;
const PERIOD_S: f64 = 0.001;
/// Exchanges that are timed beside a bare frame, and the pause before each.
const PAIRS: usize = 20_000;
const PAUSE: Duration = Duration::from_micros(200);

fn main() {
    divan::main();
    beside_a_bare_frame();
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
        let setpoint = Setpoint {
            position: attached.position,
            enable: 1,
            ..Setpoint::default()
        };
        let feedback = Feedback {
            position: attached.position,
            state: attached.state,
            ..Feedback::default()
        };
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
fn beside_a_bare_frame() {
    let interface =
        std::env::var("TANDEM_BENCH_INTERFACE").unwrap_or_else(|_| "emulated".to_string());
    let mut rig = Rig::new(&interface, "free-run", 4, 0, true);
    let mut times = [vec![], vec![]];
    for n in 0..2 * PAIRS {
        std::thread::sleep(PAUSE);
        let begun = Instant::now();
        if n % 2 == 0 {
            rig.exchange();
        } else {
            rig.driver.send_again();
        }
        times[n % 2].push(begun.elapsed());
    }
    for times in &mut times {
        times.sort_unstable();
    }
    for share in [0.5, 0.99] {
        let [exchange_us, frame_us] = times
            .each_ref()
            .map(|times| times[(times.len() as f64 * share) as usize].as_secs_f64() * 1e6);
        println!(
            "{interface}, p{:.0}: exchange {exchange_us:.1} µs, bare frame {frame_us:.1} µs, {:.2} of it",
            share * 100.0,
            exchange_us / frame_us
        );
    }
}
