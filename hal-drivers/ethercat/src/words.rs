//! States and codes in words.

/// Codes of a joint beyond those that a drive has itself (603F has 16 bits): why it does not answer as it should.
pub(crate) mod own {
    /// The drive left its bus state; the low 16 bits are the code of its register 0x0134.
    pub(crate) const LEFT_STATE: u32 = 0x1_0000;
    /// No frame came back.
    pub(crate) const NO_ANSWER: u32 = 0x2_0001;
    /// Frames come back, but the drive did not take part in them.
    pub(crate) const WORKING_COUNTER: u32 = 0x2_0002;
    /// The drive let go by itself.
    pub(crate) const LET_GO: u32 = 0x2_0003;
    /// The drive shows another mode than it was asked for.
    pub(crate) const MODE: u32 = 0x2_0004;
    /// The drive says that its homing failed.
    pub(crate) const HOMING: u32 = 0x2_0005;
    /// The host fell silent while the joint moved.
    pub(crate) const SILENT_HOST: u32 = 0x2_0006;
    /// The clock that leads the others does not answer.
    pub(crate) const NO_CLOCK: u32 = 0x2_0007;
    /// The drive was told to enable and does not; the low 8 bits are of its status word.
    pub(crate) const NEVER_ENABLED: u32 = 0x3_0000;
    /// Added to a code of the spindle's drive, which no joint has.
    pub(crate) const SPINDLE: u32 = 0x10_0000;
    /// Bit of the code by which a device is lost that moves no joint; its number in the options and why are in the others.
    const DEVICE: u32 = 0x4000_0000;
    /// Bits of why.
    const WHY_BITS: u32 = 20;

    /// Why the device of this number in the options is lost, as the code of a joint.
    pub(crate) fn of_device(number: usize, why: u32) -> u32 {
        DEVICE | (number as u32) << WHY_BITS | why & ((1 << WHY_BITS) - 1)
    }

    /// The number of the device in the options, and why it is lost, where a code says so.
    pub(crate) fn device(code: u32) -> Option<(usize, u32)> {
        let number = (code & !DEVICE) >> WHY_BITS;
        (code & DEVICE != 0).then_some((number as usize, code & ((1 << WHY_BITS) - 1)))
    }
}

/// What a state of the bus is called.
pub(crate) fn al_state(state: u16) -> &'static str {
    match state & 0x0f {
        1 => "INIT",
        2 => "PRE-OP",
        3 => "BOOT",
        4 => "SAFE-OP",
        8 => "OP",
        _ => "no state that there is",
    }
}

/// Why a device is in an error, by its register 0x0134.
pub(crate) fn al_code(code: u16) -> &'static str {
    match code {
        0x0000 => "no error",
        0x0001 => "unspecified error",
        0x0002 => "no memory",
        0x0003 => "invalid device setup",
        0x0011 => "invalid requested state change",
        0x0012 => "unknown requested state",
        0x0013 => "the boot state is not supported",
        0x0014 => "no valid firmware",
        0x0015 | 0x0016 => "invalid mailbox configuration",
        0x0017 => "invalid sync manager configuration",
        0x0018 => "no valid inputs available",
        0x0019 => "no valid outputs",
        0x001A => "synchronization error: sync events or setpoints are missing",
        0x001B => "sync manager watchdog: no process data for too long",
        0x001C => "invalid types of sync managers",
        0x001D => "invalid output configuration: what is mapped does not fit",
        0x001E => "invalid input configuration: what is mapped does not fit",
        0x001F => "invalid watchdog configuration",
        0x0020 => "the device needs a cold start",
        0x0021 => "the device needs INIT",
        0x0022 => "the device needs PRE-OP",
        0x0023 => "the device needs SAFE-OP",
        0x0024 => "invalid input mapping",
        0x0025 => "invalid output mapping",
        0x0026 => "inconsistent settings",
        0x0027 => "free-run is not supported: use sync = \"dc\"",
        0x0028 => "this kind of synchronization is not supported",
        0x0029 => "free-run needs three buffers",
        0x002A => "background watchdog",
        0x002B => "no valid inputs and outputs",
        0x002C => "fatal synchronization error: SYNC0 does not come any more",
        0x002D => "no SYNC0 was seen",
        0x002E => "the cycle time is too short",
        0x0030 => "invalid configuration of distributed clocks",
        0x0031 => "invalid latch configuration",
        0x0032 => "the device's clock does not follow (PLL)",
        0x0033 => "error of inputs and outputs in distributed clocks",
        0x0034 => "timeout of distributed clocks",
        0x0035 => "the cycle time of SYNC0 is none that the device can follow",
        0x0036 => "invalid cycle time of SYNC1",
        0x0041..=0x0045 => "mailbox protocol error",
        0x0050 | 0x0051 => "the SII cannot be accessed",
        0x0060 => "the device was restarted locally",
        0x0061 => "the device's identification has changed",
        _ => "a code that only the device's manual knows",
    }
}

/// Codes of 603F that have one meaning for all drives.
const DRIVE_CODES: &[(u16, &str)] = &[
    (0x1000, "generic error"),
    (0x2110, "short circuit or earth leakage at the input"),
    (0x2130, "short circuit at the input"),
    (0x2220, "continuous overcurrent inside the drive"),
    (0x2240, "short circuit inside the drive"),
    (0x2310, "continuous overcurrent"),
    (0x2320, "short circuit or earth leakage at the motor"),
    (0x2330, "earth leakage"),
    (0x2340, "short circuit at the motor"),
    (0x2350, "the motor was loaded too long (I2t)"),
    (0x3110, "mains overvoltage"),
    (0x3120, "mains undervoltage"),
    (0x3130, "a mains phase is missing"),
    (0x3210, "overvoltage in the DC link"),
    (0x3220, "undervoltage in the DC link"),
    (0x4110, "too hot around the drive"),
    (0x4210, "the drive is too hot"),
    (0x4310, "the motor is too hot"),
    (0x5112, "the 24 V supply is too low"),
    (0x5400, "power section"),
    (0x5441, "safe torque off"),
    (0x5530, "the drive's parameters cannot be read"),
    (0x6010, "the drive's own watchdog"),
    (0x6100, "internal software"),
    (0x6320, "a parameter is wrong"),
    (0x7110, "brake chopper"),
    (0x7120, "motor"),
    (0x7121, "the motor is blocked"),
    (0x7300, "sensor"),
    (0x7305, "encoder 1"),
    (0x7306, "encoder 2"),
    (0x7320, "position sensor"),
    (0x7380, "no velocity sensor"),
    (0x7500, "communication"),
    (0x8100, "communication"),
    (0x8110, "messages were lost on the bus"),
    (0x8130, "the master's heartbeat is missing"),
    (0x8180, "the bus watchdog"),
    (0x8400, "velocity control"),
    (0x8500, "position control"),
    (0x8600, "positioning"),
    (0x8611, "following error"),
    (0x8612, "a limit of the travel was reached"),
    (0x8700, "synchronization"),
    (0x9000, "an error from outside"),
    (0xFF00, "an error of the drive's maker"),
];

/// What a code of 603F means for any drive; none where it is a maker's own.
pub(crate) fn drive_code(code: u16) -> Option<&'static str> {
    let known = |code: u16| {
        DRIVE_CODES
            .iter()
            .find(|(known, _)| *known == code)
            .map(|(_, words)| *words)
    };
    known(code).or_else(|| known(code & 0xff00))
}

/// What a code of a joint's means.
pub(crate) fn joint_code(code: u32) -> String {
    match code {
        0 => String::new(),
        own::NO_ANSWER => "no frame comes back: is the cable plugged in, has the bus its power?".to_string(),
        own::WORKING_COUNTER => {
            "the working counter says that it takes no part: is the cable behind the device before it plugged in, has it its \
             power?"
                .to_string()
        }
        own::LET_GO => "it let go by itself, without a fault: safe torque off, or its enable input".to_string(),
        own::MODE => "it shows another mode of operation (6061) than it was asked for (6060)".to_string(),
        own::HOMING => "it says that its homing failed (6041 bit 13)".to_string(),
        own::SILENT_HOST => "it was stopped, because the computer told it nothing while it moved".to_string(),
        own::NO_CLOCK => {
            "the clock that leads the others (0910 of the first device that has one) does not answer any more".to_string()
        }
        0x3_0000..=0x3_ffff => {
            format!("it was told to enable, and its status (6041) stays at \"{}\"", status((code & 0xffff) as u16))
        }
        own::SPINDLE.. => match joint_code(code - own::SPINDLE) {
            words if words.is_empty() => format!("the spindle's drive has the fault {:#06x}", code - own::SPINDLE),
            words => format!("the spindle's drive: {words}"),
        },
        0x1_0000..=0x1_ffff => {
            let code = (code & 0xffff) as u16;
            format!("it left OP: {code:04X}, {}", al_code(code))
        }
        _ => u16::try_from(code).ok().and_then(drive_code).unwrap_or_default().to_string(),
    }
}

/// A status word (6041) in words.
pub(crate) fn status(word: u16) -> &'static str {
    match (word & 0x4f, word & 0x6f) {
        (0x00, _) => "not ready to switch on",
        (0x40, _) => "switch on disabled",
        (0x0f, _) => "fault reaction active",
        (0x08, _) => "fault",
        (_, 0x21) => "ready to switch on",
        (_, 0x23) => "switched on",
        (_, 0x27) => "operation enabled",
        (_, 0x07) => "quick stop active",
        _ => "no state that there is",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_are_words() {
        assert_eq!(
            joint_code(0x1_001B),
            "it left OP: 001B, sync manager watchdog: no process data for too long"
        );
        assert_eq!(joint_code(0x7305), "encoder 1");
        assert_eq!(joint_code(0x73FE), "sensor");
        assert_eq!(
            own::device(own::of_device(31, 0x1_002C)),
            Some((31, 0x1_002C))
        );
        assert_eq!(own::device(own::SPINDLE + own::NO_ANSWER), None);
        assert_eq!(joint_code(0x0815), "");
        assert_eq!(
            (status(0x1637), status(0x1208)),
            ("operation enabled", "fault")
        );
    }
}
