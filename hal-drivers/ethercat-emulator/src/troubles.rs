//! Faults of devices, switched on and off.

use crate::bus::Bus;
use crate::drive::Condition;
use crate::esc::Clocking;
use crate::faults::What;

impl Bus {
    /// Lets a fault of a device or of the cables begin, or end.
    pub(crate) fn trouble(&mut self, what: &What, on: bool) {
        let now_ns = self.now_ns();
        match what {
            What::Cut { behind } => self.cut(*behind, on),
            What::PowerCycle { device } if on => self.power_cycle(*device),
            _ => {
                let Some(device) = what.device().and_then(|number| self.device_mut(number)) else {
                    return;
                };
                device.trouble(now_ns, what, on);
            }
        }
    }
}

impl crate::device::Device {
    fn trouble(&mut self, now_ns: u64, what: &What, on: bool) {
        if what.needs_drive() {
            self.drive_trouble(what, on);
            return;
        }
        let trouble = &mut self.firmware.trouble;
        match what {
            What::Deaf { .. } => trouble.deaf = on,
            What::SilentMailbox { .. } => trouble.silent = on,
            What::Emergencies { messages, code, .. } => {
                trouble.emergencies = (if on { *messages } else { 0 }, *code);
            }
            What::AlError { state, code, .. } if on => self.fall(*state, *code),
            What::RefuseState { state, code, .. } => {
                trouble.refused.retain(|(refused, _)| refused != state);
                if on {
                    trouble.refused.push((*state, *code));
                }
            }
            What::HangState { state, .. } => {
                trouble.hanging.retain(|hanging| hanging != state);
                if on {
                    trouble.hanging.push(*state);
                }
            }
            What::SdoAbort(refusal) => {
                trouble.sdos.retain(|other| other != refusal);
                if on {
                    trouble.sdos.push(*refusal);
                }
            }
            What::Drift { ppm, .. } => {
                let ppb = if on {
                    (ppm * 1000.0) as i64
                } else {
                    self.drift_ppb()
                };
                self.esc
                    .clock
                    .set_drift(now_ns, ppb.clamp(-10_000_000, 10_000_000));
            }
            What::ClockJump { by_ns, .. } if on => self.esc.clock.jump(now_ns, *by_ns),
            What::LostClock { .. } => self.esc.set_clocking(if on {
                Clocking::None
            } else {
                self.plan.make.clocking
            }),
            What::MissedSync { pulses, .. } if on => self.esc.clock.sync.swallow = *pulses,
            What::Input { input, .. } => self.set_input(*input, on),
            What::Analog { input, value, .. } => {
                self.set_analog_input(*input, if on { *value } else { 0 });
            }
            _ => {}
        }
    }

    fn drive_trouble(&mut self, what: &What, on: bool) {
        let Some(drive) = &mut self.firmware.drive else {
            return;
        };
        let trouble = &mut drive.trouble;
        match what {
            What::DriveFault { code, stays, .. } => {
                trouble.fault = on.then_some(*code);
                trouble.set(Condition::FaultStays, on && *stays);
            }
            What::NeverEnables { .. } => trouble.set(Condition::NeverEnables, on),
            What::DisablesItself { .. } => trouble.disable = on,
            What::Brake { open_ms, .. } => trouble.brake_ms = on.then_some(*open_ms),
            What::ModeShown { mode, .. } => trouble.mode_shown = on.then_some(*mode),
            What::TorqueOff { .. } => trouble.set(Condition::TorqueOff, on),
            What::Blocked { .. } => trouble.set(Condition::Blocked, on),
            What::Load { share, .. } => drive.set_load(if on { *share } else { 0.0 }),
            _ => {}
        }
    }
}
