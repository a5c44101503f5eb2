//! A bus that is attached again and again in one process: behind a fault, behind a cable that was pulled, for ever.

mod common;

use std::sync::{Mutex, PoisonError};

use tandem_ethercat::{EthercatDrives, Options};
use tandem_ethercat_emulator::What;
use tandem_sdk::{Driver, DriverContext, Feedback, JointState, Name, PluginOptions, Setpoint};

use common::begin;

/// Memory is that of the process: one test at a time.
static ALONE: Mutex<()> = Mutex::new(());

/// A drive and a terminal, not attached yet.
fn driver(sync: &str) -> (EthercatDrives, DriverContext) {
    let text = format!(
        "interface = \"emulated\"\nsync = \"{sync}\"\n\
         [[devices]]\nposition = 0\nproduct = \"0x0e1a:0x0402\"\njoint = \"x\"\ncounts_per_mm = 1000\n\
         [[devices]]\nposition = 1\nproduct = \"2:0x03f03052\"\ninputs = [0]\n"
    );
    let mut context = DriverContext::new(1, 0.001);
    context.joints[0].name = Name::new("x");
    let driver = EthercatDrives::new(&Options::read(&text).unwrap()).unwrap();
    (driver, context)
}

/// Exchanges until the joint is in a state; fails after 2 s.
fn until(
    driver: &mut EthercatDrives,
    setpoint: &mut Setpoint,
    feedback: &mut Feedback,
    state: JointState,
) {
    for _ in 0..2000 {
        setpoint.tick += 1;
        driver.exchange(setpoint, feedback).unwrap();
        setpoint.reset = 0;
        if feedback.state[0] == state {
            return;
        }
    }
    panic!(
        "it stays {:?} {:x}",
        feedback.state[0], feedback.fault_code[0]
    );
}

/// What a host does with a joint that is lost: stop and start, as often as it takes, and on from where the drive stands.
#[test]
fn a_lost_bus_comes_back_with_the_next_start() {
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    for sync in ["free-run", "dc"] {
        for behind in [None, Some(0)] {
            let (mut driver, context) = driver(sync);
            driver.open(&context).unwrap();
            let attached = driver.start().unwrap();
            let (mut setpoint, mut feedback) = begin(&attached);
            setpoint.enable = 1;
            until(
                &mut driver,
                &mut setpoint,
                &mut feedback,
                JointState::Enabled,
            );
            for _ in 0..100 {
                setpoint.position[0] += 0.01;
                driver.exchange(&setpoint, &mut feedback).unwrap();
            }
            driver.with_emulator(|wire| wire.inject(What::Cut { behind }, None).unwrap());
            until(&mut driver, &mut setpoint, &mut feedback, JointState::Lost);
            if behind.is_some() {
                // Only the terminal is gone, whose input is used: the machine stops for it, and is told which device it is.
                assert!(feedback.input_age_periods[0] > 0);
                let why = driver.explain(0, feedback.fault_code[0]);
                assert!(why.as_str().contains("device 1"), "{}", why.as_str());
            }
            driver.stop().unwrap();
            for _ in 0..3 {
                let refused = driver.start().unwrap_err().to_string();
                let words = if behind.is_none() {
                    "is it powered, and the first cable at its input port?"
                } else {
                    "1 devices are on the bus, and the machine file has 2"
                };
                assert!(
                    refused.contains(words) || refused.contains("no device answers"),
                    "{refused}"
                );
                // A host that was refused may ask for nothing more.
                assert!(driver.exchange(&setpoint, &mut feedback).is_err());
            }
            driver.with_emulator(tandem_ethercat_emulator::Wire::mend);
            let attached = driver.start().unwrap();
            // It stopped by itself, and says so until it is reset; it stands where it came to rest.
            let stands = attached.position[0];
            assert!((0.5..1.2).contains(&stands), "{sync}: {stands}");
            (setpoint, feedback) = begin(&attached);
            setpoint.reset = 1;
            until(
                &mut driver,
                &mut setpoint,
                &mut feedback,
                JointState::Disabled,
            );
            setpoint.enable = 1;
            until(
                &mut driver,
                &mut setpoint,
                &mut feedback,
                JointState::Enabled,
            );
            setpoint.position = feedback.position;
            for _ in 0..100 {
                setpoint.position[0] += 0.01;
                driver.exchange(&setpoint, &mut feedback).unwrap();
            }
            assert!(
                (feedback.position[0] - stands - 1.0).abs() < 0.1,
                "{sync}: {}",
                feedback.position[0]
            );
            driver.stop().unwrap();
        }
    }
}

/// Resident memory of this process, bytes.
fn resident_bytes() -> usize {
    let pages = std::fs::read_to_string("/proc/self/statm").unwrap();
    let pages: usize = pages.split(' ').nth(1).unwrap().parse().unwrap();
    pages * 4096
}

/// A controller that stays attaches its drives over and over, by the same driver and by new ones, some starts in vain.
#[test]
fn a_thousand_attaches_take_no_more_memory_than_ten() {
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    let mut kept = None;
    let mut attach = |n: usize| {
        let (mut one, context) = driver(if n.is_multiple_of(2) {
            "free-run"
        } else {
            "dc"
        });
        one.open(&context).unwrap();
        if n % 5 == 4 {
            one.with_emulator(|wire| wire.inject(What::Cut { behind: None }, None).unwrap());
            one.start().unwrap_err();
        } else {
            let attached = one.start().unwrap();
            let (setpoint, mut feedback) = begin(&attached);
            one.exchange(&setpoint, &mut feedback).unwrap();
            one.stop().unwrap();
            one.start().unwrap();
        }
        // The one before lives until the next is there, as when a machine file is read anew.
        kept = Some(one);
    };
    (0..20).for_each(&mut attach);
    let before = resident_bytes();
    (20..1000).for_each(&mut attach);
    let grown = resident_bytes().saturating_sub(before);
    assert!(grown < 2_000_000, "{grown} bytes more");
    println!("{grown} bytes more behind 980 attaches");
    drop(kept);
}
