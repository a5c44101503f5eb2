//! Whether the options go with the machine: everything that can be told without hardware.

use tandem_ethercat_emulator::{BusDescription, DeviceDescription, DriveDescription, Kind};
use tandem_sdk::{
    DriverContext, MAX_ANALOG, MAX_AXES, MAX_DELAY_PERIODS, MAX_DIGITAL, PluginError,
};

use crate::options::{DeviceOptions, EMULATED, Options, number, object, pair};

/// Most devices of a bus.
pub(crate) const MAX_DEVICES: usize = 32;

/// A screw's turn where only counts per mm are known, mm: what an emulated drive has between two index pulses.
const ORDINARY_TURN_MM: f64 = 10.0;

/// How much more than its limit an emulated drive made of options accelerates.
const EMULATED_RESERVE: f64 = 4.0;

/// Travel that an emulated drive made of options lags by before it faults, mm or rad.
const EMULATED_WINDOW: f64 = 5.0;

/// Behind the last number of a line.
const MAX_LINE: i32 = 64;
const _: () = assert!(MAX_LINE as usize == MAX_DIGITAL);

fn wrong(key: impl Into<String>, words: impl Into<String>) -> PluginError {
    PluginError::of_option(key, words)
}

/// Refuses options that go with no machine.
pub(crate) fn judge_alone(options: &Options) -> Result<(), PluginError> {
    if options.interface.is_empty() {
        return Err(wrong(
            "interface",
            "state a network interface, as `ip link` lists them, or \"emulated\"",
        ));
    }
    if options.emulated.is_some() && options.interface != EMULATED {
        return Err(wrong(
            "emulated",
            "it goes with interface = \"emulated\" only",
        ));
    }
    for (key, value, most) in [
        ("watchdog_ms", options.watchdog_ms, 6000.0),
        ("enable_s", options.enable_s, tandem_sdk::MAX_ENABLE_S),
        ("disable_s", options.disable_s, tandem_sdk::MAX_ENABLE_S),
    ] {
        if !(value > 0.0 && value <= most) {
            return Err(wrong(
                key,
                format!("{value}: it is more than 0 and at most {most}"),
            ));
        }
    }
    if options.max_lost_frames > 100 {
        return Err(wrong(
            "max_lost_frames",
            format!("{}: at most 100", options.max_lost_frames),
        ));
    }
    if options
        .delay_periods
        .is_some_and(|delay| delay > MAX_DELAY_PERIODS)
    {
        return Err(wrong("delay_periods", format!("0 to {MAX_DELAY_PERIODS}")));
    }
    if options.devices.is_empty() || options.devices.len() > MAX_DEVICES {
        let words = format!(
            "1 to {MAX_DEVICES} devices, one [[devices]] for each that is on the bus, couplers too: `tandem bus scan` prints them"
        );
        return Err(wrong("devices", words));
    }
    for (index, device) in options.devices.iter().enumerate() {
        judge_device(device)
            .map_err(|(key, words)| wrong(format!("devices[{index}]{key}"), words))?;
    }
    judge_places(options)?;
    let spindles = options
        .devices
        .iter()
        .filter(|device| device.spindle.is_some())
        .count();
    if spindles > 1 {
        return Err(wrong(
            "devices",
            format!("{spindles} of them turn the spindle; one may"),
        ));
    }
    emulated_description(options).map(|_| ())
}

fn judge_device(device: &DeviceOptions) -> Result<(), (String, String)> {
    let refuse = |key: &str, words: String| Err((format!(".{key}"), words));
    if pair(&device.product).is_none() {
        return refuse(
            "product",
            format!(
                "{:?}: vendor and product, as \"0x0e1a:0x0402\"",
                device.product
            ),
        );
    }
    if device.position.is_some() == device.alias.is_some() {
        return Err((
            String::new(),
            "state its position, or its alias".to_string(),
        ));
    }
    if device.joint.is_some() && device.spindle.is_some() {
        return refuse(
            "spindle",
            "a drive moves a joint or turns the spindle".to_string(),
        );
    }
    let numbers = [
        ("counts_per_mm", device.counts_per_mm),
        ("counts_per_turn", device.counts_per_turn),
        ("mm_per_turn", device.mm_per_turn),
        ("velocity_scale", Some(device.velocity_scale)),
        ("rated_current_a", device.rated_current_a),
        (
            "homing.fast_per_s",
            device.homing.map(|homing| homing.fast_per_s),
        ),
        (
            "homing.slow_per_s",
            device.homing.map(|homing| homing.slow_per_s),
        ),
        (
            "homing.acceleration_per_s2",
            device.homing.map(|homing| homing.acceleration_per_s2),
        ),
        (
            "spindle.at_speed_percent",
            device.spindle.map(|spindle| spindle.at_speed_percent),
        ),
    ];
    for (key, value) in numbers {
        if value.is_some_and(|value| !(value > 0.0 && value.is_finite())) {
            return refuse(key, "it is more than 0".to_string());
        }
    }
    if !device.torque_permille_per_acceleration.is_finite() {
        return refuse(
            "torque_permille_per_acceleration",
            "it is a number".to_string(),
        );
    }
    if device.spindle.is_some() && device.counts_per_turn.is_none() {
        return refuse("counts_per_turn", "a spindle needs it".to_string());
    }
    if let Some(probe) = device.probe
        && (!(1..=2).contains(&probe.latch)
            || probe.input as usize >= MAX_DIGITAL
            || device.joint.is_none())
    {
        return refuse(
            "probe",
            "latch is 1 or 2, input 0 to 63, of a drive that moves a joint".to_string(),
        );
    }
    for (key, lines) in [("inputs", &device.inputs), ("outputs", &device.outputs)] {
        if lines.iter().any(|line| *line < -1 || *line >= MAX_LINE) || lines.len() > MAX_DIGITAL {
            return refuse(
                key,
                "numbers of the driver's lines, 0 to 63, or -1 for a bit that is none".to_string(),
            );
        }
    }
    if device.is_drive() && !device.outputs.is_empty() {
        return refuse(
            "outputs",
            "a drive's outputs are not switched by this driver; terminals' are".to_string(),
        );
    }
    if device
        .analog
        .iter()
        .any(|analog| analog.input >= MAX_ANALOG)
    {
        return refuse("analog", format!("input is 0 to {}", MAX_ANALOG - 1));
    }
    for (index, startup) in device.startup.iter().enumerate() {
        let key = |key: &str| format!("startup[{index}]{key}");
        if object(&startup.sdo).is_none() {
            return refuse(
                &key(".sdo"),
                format!("{:?}: an object, \"0x6085\" or \"0x6099:1\"", startup.sdo),
            );
        }
        if startup.bytes().is_none() {
            return refuse(
                &key(""),
                "state one value: u8, i8, u16, i16, u32 or i32".to_string(),
            );
        }
    }
    for (index, code) in device.codes.iter().enumerate() {
        if number(&code.code).is_none() {
            return refuse(
                &format!("codes[{index}].code"),
                format!("{:?}: a number, as \"0x7305\"", code.code),
            );
        }
    }
    Ok(())
}

/// Every place is stated once, and where places are stated, they are those that there are.
fn judge_places(options: &Options) -> Result<(), PluginError> {
    for (index, device) in options.devices.iter().enumerate() {
        let before = &options.devices[..index];
        let twice = before.iter().any(|other| {
            device.position.is_some() && other.position == device.position
                || device.alias.is_some() && other.alias == device.alias
        });
        if twice {
            let key = if device.position.is_some() {
                "position"
            } else {
                "alias"
            };
            return Err(wrong(
                format!("devices[{index}].{key}"),
                "another device is at the same place",
            ));
        }
        if device
            .position
            .is_some_and(|position| usize::from(position) >= options.devices.len())
        {
            let words = format!(
                "positions count from 0, and there are {} [[devices]]: every device of the bus needs one, couplers too",
                options.devices.len()
            );
            return Err(wrong(format!("devices[{index}].position"), words));
        }
    }
    Ok(())
}

/// Refuses options that do not go with this machine.
pub(crate) fn judge(options: &Options, context: &DriverContext) -> Result<(), PluginError> {
    let count = context.joint_count as usize;
    if count > MAX_AXES {
        return Err(PluginError::new(format!(
            "a machine has at most {MAX_AXES} joints, not {count}"
        )));
    }
    let period_s = context.fine_period_s;
    if !(period_s > 0.0 && period_s.is_finite()) {
        return Err(PluginError::new(format!("no fine period: {period_s} s")));
    }
    if !(50e-6..=0.02).contains(&period_s) {
        return Err(PluginError::new(format!(
            "a fine period of {period_s} s: EtherCAT drives take 50 µs to 20 ms"
        )));
    }
    if options.watchdog_ms < 2e3 * period_s {
        let words = format!(
            "{} ms: at least two fine periods, {} ms",
            options.watchdog_ms,
            2e3 * period_s
        );
        return Err(wrong("watchdog_ms", words));
    }
    if options
        .phase_us
        .is_some_and(|phase| !(0.0..period_s * 1e6).contains(&phase))
    {
        return Err(wrong(
            "phase_us",
            format!("it is 0 to less than a fine period, {} µs", period_s * 1e6),
        ));
    }
    if !context.start_position.is_finite() {
        return Err(PluginError::fixed(
            "the start position is not a finite number",
        ));
    }
    let joints = &context.joints[..count];
    for (index, device) in options.devices.iter().enumerate() {
        let Some(name) = &device.joint else { continue };
        let key = |key: &str| format!("devices[{index}].{key}");
        let Some(joint) = joints.iter().find(|joint| joint.name.as_str() == name) else {
            let names: Vec<&str> = joints.iter().map(|joint| joint.name.as_str()).collect();
            let words = format!("{name:?}: this driver's joints are {}", names.join(", "));
            return Err(wrong(key("joint"), words));
        };
        if options.devices[..index]
            .iter()
            .any(|other| other.joint.as_ref() == Some(name))
        {
            return Err(wrong(
                key("joint"),
                format!("another device moves {name:?} already"),
            ));
        }
        if device.counts_per_unit(joint.rotary != 0).is_none() {
            let words = if joint.rotary != 0 {
                "a rotary joint needs counts_per_turn"
            } else {
                "a linear joint needs counts_per_mm, or counts_per_turn and mm_per_turn"
            };
            return Err(wrong(format!("devices[{index}]"), words));
        }
    }
    if let Some(joint) = joints.iter().find(|joint| {
        !options
            .devices
            .iter()
            .any(|d| d.joint.as_deref() == Some(joint.name.as_str()))
    }) {
        return Err(wrong(
            "devices",
            format!("no device moves the joint {}", joint.name.as_str()),
        ));
    }
    if context.spindle != 0
        && !options
            .devices
            .iter()
            .any(|device| device.spindle.is_some())
        && joints.is_empty()
    {
        return Err(wrong(
            "devices",
            "no device turns the spindle, which the machine file gives to this driver",
        ));
    }
    Ok(())
}

/// The emulated bus: as described, or made of the devices.
pub(crate) fn emulated(
    options: &Options,
    context: &DriverContext,
) -> Result<BusDescription, PluginError> {
    if let Some(described) = emulated_description(options)? {
        return Ok(described);
    }
    let mut devices: Vec<Option<DeviceDescription>> = vec![None; options.devices.len()];
    let by_alias = options
        .devices
        .iter()
        .filter(|device| device.position.is_none());
    for device in options
        .devices
        .iter()
        .filter(|device| device.position.is_some())
        .chain(by_alias)
    {
        let stated = device.position.map(usize::from);
        let place = stated
            .or_else(|| devices.iter().position(Option::is_none))
            .unwrap_or_default();
        devices[place] = Some(emulated_device(device, context));
    }
    Ok(BusDescription {
        devices: devices.into_iter().flatten().collect(),
        ..BusDescription::default()
    })
}

fn emulated_description(options: &Options) -> Result<Option<BusDescription>, PluginError> {
    let Some(table) = &options.emulated else {
        return Ok(None);
    };
    let description: BusDescription = table
        .clone()
        .try_into()
        .map_err(|error: toml::de::Error| wrong("emulated", error.message()))?;
    tandem_ethercat_emulator::Wire::new(&description)
        .map_err(|error| wrong("emulated", error.to_string()))?;
    Ok(Some(description))
}

fn emulated_device(device: &DeviceOptions, context: &DriverContext) -> DeviceDescription {
    let channels = |lines: &[i32]| u8::try_from(lines.len()).ok();
    let (kind, channels) = match (
        device.is_drive(),
        device.analog.is_empty(),
        &device.inputs[..],
        &device.outputs[..],
    ) {
        (true, ..) => (Kind::Drive, None),
        (false, false, ..) => (Kind::AnalogInputs, None),
        (false, true, [], []) => (Kind::Coupler, None),
        (false, true, [], outputs) => (Kind::DigitalOutputs, channels(outputs)),
        (false, true, inputs, _) => (Kind::DigitalInputs, channels(inputs)),
    };
    let (vendor, product) = pair(&device.product).unwrap_or_default();
    let joints = context.joints[..context.joint_count as usize]
        .iter()
        .enumerate();
    let joint = joints
        .into_iter()
        .find(|(_, joint)| device.joint.as_deref() == Some(joint.name.as_str()));
    let drive = match joint {
        Some((index, joint)) => {
            let counts = device.counts_per_unit(joint.rotary != 0).unwrap_or(1.0);
            let turn = device
                .counts_per_turn
                .unwrap_or(counts.abs() * ORDINARY_TURN_MM);
            let ordinary = DriveDescription::default();
            let needed = joint.limits.acceleration_mm_per_s2 * counts.abs() * EMULATED_RESERVE;
            let rated = if needed.is_finite() { needed } else { 0.0 };
            DriveDescription {
                position_counts: context.start_position[index] * counts + device.zero_counts as f64,
                counts_per_turn: turn,
                rated_acceleration_counts_per_s2: ordinary
                    .rated_acceleration_counts_per_s2
                    .max(rated),
                following_error_window_counts: (counts.abs() * EMULATED_WINDOW) as u32,
                ..ordinary
            }
        }
        None => DriveDescription::default(),
    };
    DeviceDescription {
        name: device.name.clone(),
        vendor: Some(vendor),
        product: Some(product),
        revision: device.revision,
        alias: device.alias.unwrap_or(0),
        channels,
        drive,
        ..DeviceDescription::new(kind)
    }
}
