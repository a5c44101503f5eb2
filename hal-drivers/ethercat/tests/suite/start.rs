//! What goes wrong with any frame on the way up.

use tandem_ethercat_emulator::{BusFault, What, When};
use tandem_sdk::{Driver, JointState};

use crate::bus::{Rig, drive, emulated};

/// Of the frames of a start so many are tried with each kind of trouble; all where `TANDEM_EVERY` is set.
const TRIED: u64 = 5;

/// A start with a fault at this frame: how many frames it took, or its words.
fn start(sync: &str, fault: Option<(u64, What)>) -> (Rig, Result<u64, String>) {
    let text = format!(
        "sync = \"{sync}\"\n{}{}{}{}",
        drive(0, "x", ""),
        drive(1, "y", ""),
        emulated("drift_ppm = 40.0"),
        emulated("drive = { brake_open_ms = 20.0 }")
    );
    let (mut driver, context) = Rig::open(&text, &["x", "y"]);
    driver.open(&context).unwrap();
    if let Some((frame, what)) = fault {
        let fault = BusFault {
            at: When::Frame(frame),
            lasts: None,
            what,
        };
        driver.with_emulator(|wire| wire.add(fault).unwrap());
    }
    let started = driver.start();
    let frames = driver.with_emulator(|wire| wire.frames_and_cycles().0);
    let told = started.as_ref().map(|_| frames.unwrap());
    let told = told.map_err(|error| error.message().to_string());
    (Rig::started(driver, started.unwrap_or_default()), told)
}

#[test]
fn one_frame_that_goes_wrong_on_the_way_up_keeps_no_bus_down() {
    for sync in ["free-run", "dc"] {
        let frames = start(sync, None).1.unwrap();
        println!("{sync}: {frames} frames");
        let every = std::env::var_os("TANDEM_EVERY").is_some();
        let step = if every {
            1
        } else {
            frames as usize / TRIED as usize
        };
        for what in [
            What::LostRequest,
            What::LostReply,
            What::Late { by_us: 900.0 },
            What::Late { by_us: 150_000.0 },
            What::Duplicate { after_us: 300.0 },
            What::Swapped,
            What::Corrupt {
                byte: 20,
                mask: 0xff,
            },
            What::Truncated { bytes: 40 },
            What::Foreign,
            What::Stray,
        ] {
            // Each kind begins elsewhere.
            let offset = format!("{what:?}").len();
            for frame in (1 + offset as u64..frames).step_by(step) {
                let case = format!("{sync}: {what:?} at frame {frame}");
                let (mut rig, told) = start(sync, Some((frame, what.clone())));
                told.unwrap_or_else(|why| panic!("{case}: {why}"));
                rig.setpoint.enable = 1;
                (0..60).for_each(|_| rig.exchange());
                assert_eq!(rig.feedback.state[..2], [JointState::Enabled; 2], "{case}");
            }
        }
    }
}
