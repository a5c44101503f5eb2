//! What the border of a plugin costs: the same call as a function of the program, through `dyn`, and through the plugin's
//! table. The method is compiled into that function, as it is into the plugin's entry.
//! `cargo bench -p tandem-sdk --bench border`.

use divan::{Bencher, black_box};
use tandem_sdk::{
    Attached, AxisVector, Driver, DriverContext, DriverDescription, Feedback, Kinematics,
    KinematicsContext, NoOptions, PluginError, Setpoint,
};

fn main() {
    divan::main();
}

/// A driver whose exchange does next to nothing.
#[derive(Default)]
struct Counter(u64);

impl Driver for Counter {
    fn describe(&self) -> DriverDescription {
        DriverDescription::simulated()
    }
    fn open(&mut self, _context: &DriverContext) -> Result<(), PluginError> {
        Ok(())
    }
    fn start(&mut self) -> Result<Attached, PluginError> {
        Ok(Attached::default())
    }
    #[inline]
    fn exchange(
        &mut self,
        setpoint: &Setpoint,
        feedback: &mut Feedback,
    ) -> Result<(), PluginError> {
        self.0 += setpoint.tick;
        feedback.inputs = self.0;
        Ok(())
    }
    fn quick_stop(&mut self) {}
    fn stop(&mut self) -> Result<(), PluginError> {
        Ok(())
    }
}

/// Calls of one measurement.
const CALLS: u32 = 1000;

fn exchange(bencher: Bencher, driver: &mut dyn Driver) {
    let (setpoint, mut feedback) = (
        Setpoint {
            tick: 1,
            ..Setpoint::default()
        },
        Feedback::default(),
    );
    bencher
        .counter(divan::counter::ItemsCount::new(CALLS))
        .bench_local(|| {
            for _ in 0..CALLS {
                let _ = black_box(
                    black_box(&mut *driver)
                        .exchange(black_box(&setpoint), black_box(&mut feedback)),
                );
            }
        });
}

/// The static call.
struct Called<T>(T);

impl Called<Counter> {
    #[inline(never)]
    fn exchange(
        &mut self,
        setpoint: &Setpoint,
        feedback: &mut Feedback,
    ) -> Result<(), PluginError> {
        self.0.exchange(setpoint, feedback)
    }
}

#[divan::bench]
fn exchange_static(bencher: Bencher) {
    let (setpoint, mut feedback) = (
        Setpoint {
            tick: 1,
            ..Setpoint::default()
        },
        Feedback::default(),
    );
    let mut driver = Called(Counter::default());
    bencher
        .counter(divan::counter::ItemsCount::new(CALLS))
        .bench_local(|| {
            for _ in 0..CALLS {
                let _ = black_box(
                    black_box(&mut driver).exchange(black_box(&setpoint), black_box(&mut feedback)),
                );
            }
        });
}

#[divan::bench]
fn exchange_dyn(bencher: Bencher) {
    let mut driver: Box<dyn Driver> = Box::new(Counter::default());
    exchange(bencher, driver.as_mut());
}

#[divan::bench]
fn exchange_plugin(bencher: Bencher) {
    let plugin =
        tandem_sdk::local_plugin!(driver "counter" = |_: &NoOptions| Ok(Counter::default()));
    let mut driver = plugin.driver("").unwrap_or_else(|e| panic!("{e}"));
    exchange(bencher, driver.as_mut());
}

/// A kinematics that swaps two axes.
struct Swap;

impl Kinematics for Swap {
    #[inline]
    fn to_joints(&self, axes: &AxisVector) -> AxisVector {
        let mut joints = *axes;
        joints.0.swap(0, 1);
        joints
    }
    fn to_axes(&self, joints: &AxisVector) -> AxisVector {
        self.to_joints(joints)
    }
}

impl Called<Swap> {
    #[inline(never)]
    fn to_joints(&self, axes: &AxisVector) -> AxisVector {
        self.0.to_joints(axes)
    }
}

fn to_joints(bencher: Bencher, kinematics: &dyn Kinematics) {
    let axes = AxisVector::from_slice(&[1.0, 2.0, 3.0]);
    bencher
        .counter(divan::counter::ItemsCount::new(CALLS))
        .bench_local(|| {
            for _ in 0..CALLS {
                black_box(black_box(kinematics).to_joints(black_box(&axes)));
            }
        });
}

#[divan::bench]
fn to_joints_static(bencher: Bencher) {
    let (kinematics, axes) = (Called(Swap), AxisVector::from_slice(&[1.0, 2.0, 3.0]));
    bencher
        .counter(divan::counter::ItemsCount::new(CALLS))
        .bench_local(|| {
            for _ in 0..CALLS {
                black_box(black_box(&kinematics).to_joints(black_box(&axes)));
            }
        });
}

#[divan::bench]
fn to_joints_dyn(bencher: Bencher) {
    to_joints(bencher, &Swap);
}

#[divan::bench]
fn to_joints_plugin(bencher: Bencher) {
    let plugin = tandem_sdk::local_plugin!(kinematics "swap" = |_: &NoOptions, _: &KinematicsContext| Ok(Swap));
    let axes =
        tandem_sdk::Axes::new(&[('X', false), ('Y', false)]).unwrap_or_else(|e| panic!("{e}"));
    let kinematics = plugin
        .kinematics("", &KinematicsContext::new(axes))
        .unwrap_or_else(|e| panic!("{e}"));
    to_joints(bencher, kinematics.as_ref());
}

/// A panic that is caught, as it is in a library: with the quiet hook.
#[divan::bench(sample_size = 1)]
fn a_panic_that_is_caught() {
    struct Panics;
    impl Kinematics for Panics {
        fn to_joints(&self, _axes: &AxisVector) -> AxisVector {
            panic!("no joints there")
        }
        fn to_axes(&self, joints: &AxisVector) -> AxisVector {
            *joints
        }
    }
    let plugin = tandem_sdk::local_plugin!(kinematics "panics" = |_: &NoOptions, _: &KinematicsContext| Ok(Panics));
    std::panic::set_hook(Box::new(|_| {}));
    let axes = tandem_sdk::Axes::new(&[('X', false)]).unwrap_or_else(|e| panic!("{e}"));
    let kinematics = plugin
        .kinematics("", &KinematicsContext::new(axes))
        .unwrap_or_else(|e| panic!("{e}"));
    black_box(kinematics.to_joints(&AxisVector::ZERO));
    let _ = std::panic::take_hook();
}
