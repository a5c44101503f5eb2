//! From power-on to SAFE-OP: who is there, what each exchanges, how it is set up.

use std::time::Duration;

use ethercrab::subdevice_group::DcConfiguration;
use ethercrab::{Command, DcSync, MainDevice, SubDeviceGroup};
use tandem_sdk::DriverContext;

use crate::check::MAX_DEVICES;
use crate::clock::Leading;
use crate::coe::{MAX_REPEATS, Objects, caught, may_pass};
use crate::cyclic::{Area, Station};
use crate::drive::{self, Constants, Drive, Moves};
use crate::mailboxes::Mailboxes;
use crate::options::{DeviceOptions, MapBy, Options, Sync, object, pair};
use crate::reactions::REACTIONS;
use crate::time;
use crate::words::{al_code, al_state};

/// Most bytes of process data of all devices.
pub(crate) const MAX_BYTES: usize = 1400;

type Group = SubDeviceGroup<MAX_DEVICES, MAX_BYTES>;

/// Registers.
const AL_CONTROL: u16 = 0x0120;
const AL_STATUS: u16 = 0x0130;
const AL_CODE: u16 = 0x0134;
const WATCHDOG_DIVIDER: u16 = 0x0400;
const WATCHDOG_TIME: u16 = 0x0420;
const SYSTEM_TIME: u16 = 0x0910;
const FMMU: u16 = 0x0600;

/// Divider of the watchdogs for counts of 100 µs, which is what devices have at power-on too.
const COUNTS_OF_100_US: u16 = 2498;

/// How long a device may take for SAFE-OP, ns: drives that build up their position loop take seconds.
const STATE_NS: u64 = 10_000_000_000;

/// Pause between two looks at a state, ns.
const LOOK_NS: u64 = 1_000_000;

/// Share of the time for enabling after which a drive that is not enabled says why.
const ENABLE_SHARE: f64 = 0.98;

/// Units of an EtherCAT slave controller that map logical addresses.
const FMMUS: u16 = 8;

/// Time until the first SYNC0, ms: the state machine passes SAFE-OP meanwhile.
const FIRST_SYNC_MS: u64 = 50;

/// What a device says of itself.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Identity {
    /// Vendor in its SII.
    pub vendor: u32,
    /// Product in its SII.
    pub product: u32,
    /// Revision in its SII.
    pub revision: u32,
    /// Alias in its SII; 0 is none.
    pub alias: u16,
    /// Its name in the SII.
    pub name: String,
}

/// A device that is set up.
#[derive(Debug)]
pub(crate) struct Ready {
    /// Its number in the options.
    pub(crate) options: usize,
    pub(crate) called: String,
    pub(crate) station: Station,
    pub(crate) drive: Option<Drive>,
}

/// A bus in SAFE-OP.
#[derive(Debug)]
pub(crate) struct Up {
    /// In the order in which a frame meets them.
    pub(crate) devices: Vec<Ready>,
    /// The station whose clock leads, and that clock.
    pub(crate) reference: Option<(u16, Leading)>,
    /// By which their objects are reached from then on.
    pub(crate) mailboxes: Mailboxes,
}

/// Why a bus does not come up.
enum Refused {
    /// In words.
    For(String),
    /// In words; the next attempt may find it otherwise.
    ForNow(String),
}

impl From<String> for Refused {
    fn from(words: String) -> Self {
        Self::For(words)
    }
}

/// Brings a bus up. What `ethercrab` itself asks the mailboxes cannot be asked again by itself, so all begins anew where a device
/// said something else in between.
pub(crate) async fn bring_up(
    main: &MainDevice<'static>,
    options: &Options,
    context: &DriverContext,
) -> Result<Up, String> {
    let mut left = MAX_REPEATS;
    loop {
        match attempt(main, options, context).await {
            Ok(up) => return Ok(up),
            Err(Refused::ForNow(_)) if left > 0 => left -= 1,
            Err(Refused::For(words) | Refused::ForNow(words)) => return Err(words),
        }
    }
}

async fn attempt(
    main: &MainDevice<'static>,
    options: &Options,
    context: &DriverContext,
) -> Result<Up, Refused> {
    let mut group: Group = main.init_single_group(time::now_ns).await.map_err(|error| {
        format!("the bus cannot be set up ({error}); is it powered, and the first cable at its input port?")
    })?;
    let found: Vec<Identity> = group.iter(main).map(|device| identity(&device)).collect();
    let order = assign(options, &found)?;
    let called: Vec<String> = order
        .iter()
        .enumerate()
        .map(|(place, index)| options.devices[*index].called(place))
        .collect();
    let mut devices = vec![];
    for (place, index) in order.iter().enumerate() {
        let device = &options.devices[*index];
        let station = group
            .subdevice(main, place)
            .map_err(|error| error.to_string())?
            .configured_address();
        set_watchdog(main, station, options.watchdog_ms)
            .await
            .map_err(|error| format!("{}: {error}", called[place]))?;
        let drive = set_up(
            main,
            &group,
            place,
            device,
            &called[place],
            context,
            options,
        )
        .await?;
        devices.push((*index, station, drive));
    }
    let dc = options.sync == Sync::Dc;
    // `ethercrab` has set the others after the first clock that there is.
    let clocks = group.iter(main).find(|device| device.dc_support().any());
    let reference = clocks
        .map(|device| device.configured_address())
        .filter(|_| dc);
    if dc {
        for (mut device, index) in group.iter_mut(main).zip(&order) {
            if options.devices[*index].is_drive() {
                device.set_dc_sync(DcSync::Sync0);
            }
        }
    }
    let mapped = caught(group.into_pre_op_pdi(main)).await.map_err(|error| {
        let words = format!("the process data cannot be mapped: {error}");
        if may_pass(&error) {
            Refused::ForNow(words)
        } else {
            Refused::For(words)
        }
    })?;
    let mut ready = vec![];
    for (place, (index, address, drive)) in devices.into_iter().enumerate() {
        let station = areas(main, address)
            .await
            .map_err(|error| format!("{}: {error}", called[place]))?;
        ready.push(Ready {
            options: index,
            called: called[place].clone(),
            station,
            drive,
        });
    }
    let mut leads = None;
    let mailboxes = if dc {
        let period = Duration::from_secs_f64(context.fine_period_s);
        let start_delay = Duration::from_millis(FIRST_SYNC_MS);
        let configuration = DcConfiguration {
            start_delay,
            sync0_period: period,
            sync0_shift: Duration::ZERO,
        };
        // SYNC0 comes in whole numbers of periods of what the clock shows in between.
        let before_ns = shown_ns(main, reference).await?;
        let configured = mapped.configure_dc_sync(main, configuration).await;
        let mapped = configured.map_err(|error| {
            format!("distributed clocks: {error}; sync = \"free-run\" does without them")
        })?;
        let after_ns = shown_ns(main, reference).await?;
        if after_ns < before_ns {
            let words =
                "distributed clocks: the first of them begins anew each time that SYNC0 is set up";
            return Err(Refused::ForNow(words.to_string()));
        }
        let leading = Leading::new(after_ns, time::now_ns());
        leads = reference.map(|station| (station, leading));
        Mailboxes::Clocks(Box::new(mapped))
    } else {
        Mailboxes::FreeRun(Box::new(mapped))
    };
    for device in &ready {
        step(main, device, 4).await?;
    }
    Ok(Up {
        devices: ready,
        reference: leads,
        mailboxes,
    })
}

/// What the clock that leads shows; 0 where there is none.
async fn shown_ns(main: &MainDevice<'static>, reference: Option<u16>) -> Result<u64, String> {
    let Some(station) = reference else {
        return Ok(0);
    };
    let shown = Command::fprd(station, SYSTEM_TIME)
        .receive::<u64>(main)
        .await;
    shown.map_err(|error| {
        format!("distributed clocks: the first device that has one does not tell its time: {error}")
    })
}

/// What a device says of itself.
pub(crate) fn identity<S: std::ops::Deref<Target = ethercrab::SubDevice>>(
    device: &ethercrab::SubDeviceRef<'_, S>,
) -> Identity {
    let identity = device.identity();
    Identity {
        vendor: identity.vendor_id,
        product: identity.product_id,
        revision: identity.revision,
        alias: device.alias_address(),
        name: device.name().to_string(),
    }
}

/// Which options belong to the device at each place.
fn assign(options: &Options, found: &[Identity]) -> Result<Vec<usize>, String> {
    let list = || {
        let line = |(place, device): (usize, &Identity)| {
            let Identity {
                vendor,
                product,
                revision,
                alias,
                name,
            } = device;
            format!(
                "\n  {place}: {vendor:#06x}:{product:#06x} revision {revision:#x} alias {alias} {name}"
            )
        };
        found.iter().enumerate().map(line).collect::<String>()
    };
    if found.is_empty() {
        return Err(
            "no device answers: is the bus powered, the cable plugged in at the first device's input port?".to_string()
        );
    }
    if found.len() != options.devices.len() {
        return Err(format!(
            "{} devices are on the bus, and the machine file has {}. On the bus are:{}",
            found.len(),
            options.devices.len(),
            list()
        ));
    }
    let mut order = vec![None; found.len()];
    for (index, device) in options.devices.iter().enumerate() {
        let place = match (device.position, device.alias) {
            (Some(position), _) => Some(usize::from(position)),
            (None, Some(alias)) => found.iter().position(|found| found.alias == alias),
            (None, None) => None,
        };
        let Some(slot) = place.and_then(|place| order.get_mut(place)) else {
            let alias = device.alias.unwrap_or_default();
            return Err(format!(
                "devices[{index}]: no device on the bus has the alias {alias}. On the bus are:{}",
                list()
            ));
        };
        if slot.replace(index).is_some() {
            return Err(format!(
                "devices[{index}]: two of the machine file's devices are the same on the bus:{}",
                list()
            ));
        }
    }
    let order: Vec<usize> = order.into_iter().flatten().collect();
    for ((place, index), found) in order.iter().enumerate().zip(found) {
        judge_identity(&options.devices[*index], place, found)?;
    }
    Ok(order)
}

fn judge_identity(device: &DeviceOptions, place: usize, found: &Identity) -> Result<(), String> {
    let called = device.called(place);
    let (vendor, product) = pair(&device.product).unwrap_or_default();
    for (what, wanted, is) in [
        ("vendor", vendor, found.vendor),
        ("product", product, found.product),
    ] {
        if wanted != is {
            return Err(format!(
                "{called}: its {what} is {is:#06x}, and the machine file wants {wanted:#06x}; the device there is {:?} \
                 ({:#06x}:{:#06x}). Were two devices swapped?",
                found.name, found.vendor, found.product
            ));
        }
    }
    match device.revision {
        Some(revision) if revision != found.revision => Err(format!(
            "{called}: its revision is {:#x}, and the machine file wants {revision:#x}; leave `revision` out where any will do",
            found.revision
        )),
        _ => Ok(()),
    }
}

async fn set_watchdog(
    main: &MainDevice<'static>,
    station: u16,
    watchdog_ms: f64,
) -> Result<(), String> {
    let counts = (watchdog_ms * 10.0).round().clamp(1.0, 65535.0) as u16;
    for (register, value) in [
        (WATCHDOG_DIVIDER, COUNTS_OF_100_US),
        (WATCHDOG_TIME, counts),
    ] {
        // A device without outputs may have no watchdog.
        let sent = Command::fpwr(station, register)
            .ignore_wkc()
            .send(main, value)
            .await;
        sent.map_err(|error| format!("register {register:#06x}: {error}"))?;
    }
    Ok(())
}

/// Writes what the device is to be told once, and reads what has to be known of it.
async fn set_up(
    main: &MainDevice<'static>,
    group: &Group,
    place: usize,
    device: &DeviceOptions,
    called: &str,
    context: &DriverContext,
    options: &Options,
) -> Result<Option<Drive>, String> {
    let subdevice = group
        .subdevice(main, place)
        .map_err(|error| error.to_string())?;
    let objects = Objects {
        device: &subdevice,
        called,
    };
    let joint = device.joint.as_ref().and_then(|name| {
        let joints = &context.joints[..context.joint_count as usize];
        joints.iter().position(|joint| joint.name.as_str() == name)
    });
    let description = joint.map(|joint| context.joints[joint]);
    let moves = match (joint, device.spindle) {
        (Some(joint), _) => Some(Moves::Joint(joint)),
        (None, Some(spindle)) => Some(Moves::Spindle {
            mode: drive::spindle_mode(spindle.mode),
            at_speed_share: spindle.at_speed_percent / 100.0,
        }),
        (None, None) => None,
    };
    let drive = match moves {
        None => None,
        Some(moves) => {
            let counts = device
                .counts_per_unit(description.is_none_or(|joint| joint.rotary != 0))
                .unwrap_or(1.0);
            let homing_percent =
                description.map_or(f64::INFINITY, |joint| joint.homing_torque_percent);
            let constants = judge_drive(
                &objects,
                device,
                moves,
                counts,
                homing_percent,
                context.fine_period_s,
            )
            .await?;
            // It says in which state it stays before the host gives up.
            let constants = Constants {
                enable_s: options.enable_s * ENABLE_SHARE,
                ..constants
            };
            if options.drives_watch_following && joint.is_some() {
                judge_window(&objects).await?;
            }
            if let Some(joint) = description.filter(|joint| joint.homing_method != 0) {
                set_homing(&objects, device, joint.homing_method, counts).await?;
            }
            Some((constants, homing_percent.is_finite()))
        }
    };
    for startup in &device.startup {
        let (index, sub) = object(&startup.sdo).unwrap_or_default();
        let bytes = startup.bytes().unwrap_or_default();
        let value = bytes
            .iter()
            .rev()
            .fold(0, |value, byte| value << 8 | u32::from(*byte));
        objects
            .write_and_judge(index, sub, value, bytes.len())
            .await?;
    }
    let Some((constants, limits_torque)) = drive else {
        return Ok(None);
    };
    for reaction in &REACTIONS {
        reaction.judge(&objects, &device.reactions).await?;
    }
    let [out, back] = drive::wanted(device, limits_torque);
    if device.map == MapBy::Driver {
        objects.map(0x1C12, 0x1600, &out).await?;
        objects.map(0x1C13, 0x1A00, &back).await?;
    }
    let (out, back) = (objects.mapped(0x1C12).await?, objects.mapped(0x1C13).await?);
    let drive = Drive::new(constants, device, [&out, &back]);
    match drive.missing(device) {
        None => Ok(Some(drive)),
        Some(index) => Err(format!(
            "{called}: its process data have no {index:04X}, which this machine file needs"
        )),
    }
}

/// Reads what a drive can do, and tells it the period.
async fn judge_drive(
    objects: &Objects<'_, '_>,
    device: &DeviceOptions,
    moves: Moves,
    counts_per_unit: f64,
    homing_percent: f64,
    period_s: f64,
) -> Result<Constants, String> {
    let called = objects.called;
    let mode = match moves {
        Moves::Joint(_) => 8,
        Moves::Spindle { mode, .. } => mode.unsigned_abs(),
    };
    let modes = objects.read_if_there(0x6502, 0, 4).await?;
    if let Some(modes) = modes.filter(|modes| modes >> (mode - 1) & 1 == 0) {
        return Err(format!(
            "{called}: it cannot do mode {mode}: its supported modes (6502) are {modes:#x}"
        ));
    }
    if matches!(moves, Moves::Joint(_)) {
        set_period(objects, period_s).await?;
    }
    let rated = match device.rated_current_a {
        Some(rated) => rated,
        None => f64::from(objects.read_if_there(0x6075, 0, 4).await?.unwrap_or(0)) / 1000.0,
    };
    let max_torque = objects.read_if_there(0x6072, 0, 2).await?.unwrap_or(0) as u16;
    let homing_torque = if homing_percent.is_finite() {
        (homing_percent * 10.0).round() as u16
    } else {
        max_torque
    };
    Ok(Constants {
        moves,
        counts_per_unit,
        zero_counts: device.zero_counts,
        velocity_scale: device.velocity_scale,
        torque_permille_per_acceleration: device.torque_permille_per_acceleration,
        rated_current_a: rated,
        max_torque,
        homing_torque: homing_torque.min(max_torque),
        period_s,
        enable_s: f64::INFINITY,
    })
}

/// The time between two setpoints, 60C2: a number of steps of 10^n s.
async fn set_period(objects: &Objects<'_, '_>, period_s: f64) -> Result<(), String> {
    let period_us = (period_s * 1e6).round();
    let mut steps = period_us as u32;
    let mut exponent = -6_i8;
    while steps.is_multiple_of(10) && steps > 0 {
        steps /= 10;
        exponent += 1;
    }
    if (period_s * 1e6 - period_us).abs() > 1e-6 || !(1..=255).contains(&steps) {
        let words = "a fine period of 1 to 255 steps of 1, 10, 100 or 1000 µs is what 60C2 can say";
        return Err(format!(
            "{}: {words}, and {} µs is none",
            objects.called,
            period_s * 1e6
        ));
    }
    if objects.read_if_there(0x60C2, 1, 1).await?.is_none() {
        return Ok(());
    }
    objects
        .write_and_judge(0x60C2, 2, u32::from(exponent.cast_unsigned()), 1)
        .await?;
    objects.write_and_judge(0x60C2, 1, steps, 1).await
}

/// A drive that is said to watch its following error has a window for it.
async fn judge_window(objects: &Objects<'_, '_>) -> Result<(), String> {
    match objects.read_if_there(0x6065, 0, 4).await? {
        Some(window) if window != u32::MAX && window != 0 => Ok(()),
        _ => Err(format!(
            "{}: drives_watch_following is stated, and its following error window (6065) is switched off",
            objects.called
        )),
    }
}

async fn set_homing(
    objects: &Objects<'_, '_>,
    device: &DeviceOptions,
    method: i32,
    counts: f64,
) -> Result<(), String> {
    let method = i8::try_from(method)
        .map_err(|_| format!("{}: homing method {method}: -128 to 127", objects.called))?;
    objects
        .write_and_judge(0x6098, 0, u32::from(method.cast_unsigned()), 1)
        .await?;
    let Some(speeds) = device.homing else {
        return Ok(());
    };
    let scale = counts.abs() * device.velocity_scale;
    objects
        .write_and_judge(0x6099, 1, (speeds.fast_per_s * scale).round() as u32, 4)
        .await?;
    objects
        .write_and_judge(0x6099, 2, (speeds.slow_per_s * scale).round() as u32, 4)
        .await?;
    objects
        .write_and_judge(
            0x609A,
            0,
            (speeds.acceleration_per_s2 * scale).round() as u32,
            4,
        )
        .await
}

/// Where the process data of a device lie, as its own units say that map logical addresses.
async fn areas(main: &MainDevice<'static>, address: u16) -> Result<Station, String> {
    let mut station = Station {
        address,
        outputs: Area::default(),
        inputs: Area::default(),
    };
    for unit in 0..FMMUS {
        let read = Command::fprd(address, FMMU + 16 * unit)
            .ignore_wkc()
            .receive::<[u8; 16]>(main)
            .await;
        let unit =
            read.map_err(|error| format!("its logical addresses cannot be read: {error}"))?;
        let start = u32::from_le_bytes([unit[0], unit[1], unit[2], unit[3]]);
        let bytes = usize::from(u16::from_le_bytes([unit[4], unit[5]]));
        let (reads, writes, active) = (unit[11] & 1 == 1, unit[11] & 2 == 2, unit[12] & 1 == 1);
        // One byte is mapped of the flags by which a mailbox says that it is full: it is none of the process data.
        if !active || bytes == 0 {
            continue;
        }
        for (counts, area) in [(reads, &mut station.inputs), (writes, &mut station.outputs)] {
            if counts {
                let end = if area.bytes == 0 {
                    start
                } else {
                    area.address + area.bytes as u32
                };
                let first = if area.bytes == 0 {
                    start
                } else {
                    area.address.min(start)
                };
                *area = Area {
                    address: first,
                    bytes: (end.max(start + bytes as u32) - first) as usize,
                    counts: 1,
                };
            }
        }
    }
    Ok(station)
}

/// Brings a device into a state, step by step.
async fn step(main: &MainDevice<'static>, device: &Ready, wanted: u16) -> Result<(), String> {
    let (address, called) = (device.station.address, &device.called);
    let lost = |error: ethercrab::error::Error| format!("{called}: it does not answer: {error}");
    Command::fpwr(address, AL_CONTROL)
        .send(main, wanted)
        .await
        .map_err(lost)?;
    let until_ns = time::now_ns() + STATE_NS;
    loop {
        let status = Command::fprd(address, AL_STATUS)
            .receive::<u16>(main)
            .await
            .map_err(lost)?;
        if status & 0x1f == wanted {
            return Ok(());
        }
        let code = Command::fprd(address, AL_CODE)
            .receive::<u16>(main)
            .await
            .map_err(lost)?;
        if status & 0x10 != 0 {
            return Err(refuses(called, wanted, status, code));
        }
        if time::now_ns() > until_ns {
            let words = (al_state(status), al_state(wanted));
            return Err(format!(
                "{called}: it stays in {} and does not come to {} within {} s",
                words.0,
                words.1,
                STATE_NS / 1_000_000_000
            ));
        }
        time::pass(LOOK_NS).await;
    }
}

/// A device that refuses a state, in words.
pub(crate) fn refuses(called: &str, wanted: u16, status: u16, code: u16) -> String {
    format!(
        "{called}: it refuses {} and is in {}: {code:04X}, {}",
        al_state(wanted),
        al_state(status),
        al_code(code)
    )
}

/// Takes all devices back to INIT: their drives have no torque there.
pub(crate) async fn leave(main: &MainDevice<'static>) {
    // Nobody may be there any more.
    let _ = Command::bwr(AL_CONTROL)
        .ignore_wkc()
        .send(main, 0x11_u16)
        .await;
}
