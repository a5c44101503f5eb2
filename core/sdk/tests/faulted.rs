//! A plugin that has panicked is not called again, by any method, and not dropped: nothing is known of its state.

use std::sync::atomic::{AtomicU32, Ordering::Relaxed};

use tandem_sdk::{
    Attached, Driver, DriverContext, DriverDescription, Feedback, NoOptions, PluginError, Setpoint,
    local_plugin,
};

static CALLS: AtomicU32 = AtomicU32::new(0);

struct Panics;

impl Drop for Panics {
    fn drop(&mut self) {
        CALLS.fetch_add(1, Relaxed);
    }
}

impl Driver for Panics {
    fn describe(&self) -> DriverDescription {
        CALLS.fetch_add(1, Relaxed);
        DriverDescription::simulated()
    }
    fn open(&mut self, _context: &DriverContext) -> Result<(), PluginError> {
        CALLS.fetch_add(1, Relaxed);
        Ok(())
    }
    fn start(&mut self) -> Result<Attached, PluginError> {
        CALLS.fetch_add(1, Relaxed);
        Ok(Attached::default())
    }
    fn exchange(
        &mut self,
        _setpoint: &Setpoint,
        _feedback: &mut Feedback,
    ) -> Result<(), PluginError> {
        CALLS.fetch_add(1, Relaxed);
        panic!("the wire is cut")
    }
    fn quick_stop(&mut self) {
        CALLS.fetch_add(1, Relaxed);
    }
    fn stop(&mut self) -> Result<(), PluginError> {
        CALLS.fetch_add(1, Relaxed);
        Ok(())
    }
}

#[test]
fn nothing_is_called_after_a_panic() {
    let plugin = local_plugin!(driver "panics" = |_: &NoOptions| Ok(Panics));
    let mut driver = plugin.driver("").unwrap();
    driver.open(&DriverContext::new(1, 0.001)).unwrap();
    let panicked = driver
        .exchange(&Setpoint::default(), &mut Feedback::default())
        .unwrap_err();
    assert!(
        panicked.is_panic() && panicked.to_string().contains("panics panicked in exchange"),
        "{panicked}"
    );
    assert_eq!(CALLS.load(Relaxed), 2);
    let later = [
        driver.open(&DriverContext::new(1, 0.001)),
        driver.start().map(|_| ()),
        driver.exchange(&Setpoint::default(), &mut Feedback::default()),
        driver.stop(),
    ];
    for answer in later {
        assert_eq!(answer.unwrap_err().to_string(), panicked.to_string());
    }
    driver.quick_stop();
    assert_eq!(driver.describe(), DriverDescription::real());
    drop(driver);
    assert_eq!(CALLS.load(Relaxed), 2, "it was called again");
}
