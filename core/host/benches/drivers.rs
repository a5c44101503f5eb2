//! What several drivers on one machine cost the fine loop: `cargo bench -p tandem-host --bench drivers`. An item is an exchange
//! with drives that do what they are told at once; what two drivers take beyond one is the composing of their parts.

use divan::counter::ItemsCount;
use divan::{Bencher, black_box};
use tandem_host::{Registry, attached_driver};
use tandem_machine::Machine;
use tandem_sdk::{
    Attached, AxisVector, Driver, DriverContext, DriverDescription, Feedback, JointState, MAX_AXES,
    NoOptions, PluginError, Setpoint, local_plugin,
};

const CALLS: u32 = 1000;
const COUNTS_PER_MM: f64 = 4096.0;

fn main() {
    divan::main();
}

/// Drives that are where they are told to be, to a count: each joint is told and answers by itself, as on a bus.
#[derive(Default)]
struct Counts([i32; MAX_AXES], usize);

impl Driver for Counts {
    fn describe(&self) -> DriverDescription {
        DriverDescription::simulated()
    }
    fn open(&mut self, context: &DriverContext) -> Result<(), PluginError> {
        self.1 = context.joint_count as usize;
        Ok(())
    }
    fn start(&mut self) -> Result<Attached, PluginError> {
        Ok(Attached::at(AxisVector::ZERO))
    }
    fn exchange(
        &mut self,
        setpoint: &Setpoint,
        feedback: &mut Feedback,
    ) -> Result<(), PluginError> {
        for joint in 0..self.1.min(MAX_AXES) {
            self.0[joint] = (setpoint.position[joint] * COUNTS_PER_MM) as i32;
            feedback.position[joint] = f64::from(self.0[joint]) / COUNTS_PER_MM;
            feedback.speed[joint] = setpoint.velocity[joint];
            feedback.state[joint] = if setpoint.enable == 0 {
                JointState::Disabled
            } else {
                JointState::Enabled
            };
        }
        Ok(())
    }
    fn quick_stop(&mut self) {}
    fn stop(&mut self) -> Result<(), PluginError> {
        Ok(())
    }
}

fn exchanges(bencher: Bencher, drivers: &str) {
    let mut text = "format = 1\n[planner]\nplugin = \"look-ahead\"\n".to_string();
    for axis in ["x", "y", "z", "u"] {
        let keys = "travel_mm = [-250, 250]\nmax_feed_mm_per_min = 6000\nmax_acceleration_mm_per_s2 = 800\n";
        text.extend(["[axes.", axis, "]\n", keys]);
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("machine.toml");
    std::fs::write(&path, text + drivers).unwrap();
    let machine = Machine::read(&path, &[]).unwrap();
    let mut registry = Registry::default();
    registry
        .register(local_plugin!(driver "counts" = |_: &NoOptions| Ok(Counts::default())))
        .unwrap();
    let (mut driver, _) = attached_driver(&machine, &registry).unwrap();
    let (mut setpoint, mut feedback) = (
        Setpoint {
            enable: 1,
            ..Setpoint::default()
        },
        Feedback::default(),
    );
    bencher.counter(ItemsCount::new(CALLS)).bench_local(|| {
        for tick in 0..CALLS {
            setpoint.tick = u64::from(tick);
            let _ = black_box(driver.exchange(black_box(&setpoint), black_box(&mut feedback)));
        }
    });
}

/// One driver that has everything: the fine loop calls it itself.
#[divan::bench]
fn one(bencher: Bencher) {
    exchanges(bencher, "[driver]\nplugin = \"counts\"\n");
}

/// Three joints and one, each with its own driver.
#[divan::bench]
fn two(bencher: Bencher) {
    exchanges(
        bencher,
        "[drivers.bus]\nplugin = \"counts\"\njoints = [\"x\", \"y\", \"z\"]\nspindle = true\n\
         [drivers.arm]\nplugin = \"counts\"\njoints = [\"u\"]\n",
    );
}
