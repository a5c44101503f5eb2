//! `tandem bus`: an EtherCAT bus as its people look at it. Nothing is enabled, nothing moves.

use std::error::Error;
use std::io::Write;
use std::path::Path;

use tandem_ethercat::{
    Found, Object, Options, Request, Survey, Value, Watch, Watched, ask_whoever_drives, context_of,
    number, object, watch,
};
use tandem_machine::Machine;
use tandem_sdk::PluginOptions;

use crate::args;
use crate::args::{Sdo, Which};

/// Looks at a bus.
pub fn bus(command: &args::Bus) -> Result<u8, Box<dyn Error>> {
    match command {
        args::Bus::Scan { which } => scan(which),
        args::Bus::Sdo(Sdo::Read {
            device,
            object,
            which,
        }) => read(which, *device, object),
        args::Bus::Sdo(Sdo::Write {
            device,
            object,
            bits,
            value,
            which,
        }) => write(which, *device, object, *bits, value),
        args::Bus::State { which } => state(which),
        args::Bus::Watch {
            machine,
            seconds,
            objects,
        } => watch_bus(machine, None, *seconds, objects),
        args::Bus::Pcap {
            file,
            machine,
            seconds,
        } => watch_bus(machine, Some(file), *seconds, &[]),
    }
}

/// The options of the machine's driver `ethercat`, and its fine period.
fn options_of(path: &Path) -> Result<(Options, f64), Box<dyn Error>> {
    let machine = Machine::read(path, &[])?;
    let drivers = machine.drivers.iter().map(|driver| &driver.choice);
    let choice = drivers
        .into_iter()
        .find(|choice| choice.plugin == tandem_ethercat::PLUGIN.name());
    let choice = choice
        .ok_or_else(|| format!("{}: no driver of this machine is ethercat", path.display()))?;
    let options =
        Options::read(&choice.options).map_err(|error| format!("{}: {error}", path.display()))?;
    Ok((options, machine.fine_period_s))
}

fn survey(which: &Which) -> Result<Survey, Box<dyn Error>> {
    if let Some(path) = &which.machine {
        let (options, fine_period_s) = options_of(path)?;
        return Ok(Survey::of(
            &options,
            &context_of(&options, fine_period_s, false),
        )?);
    }
    if let Some(path) = &which.emulated {
        let text = std::fs::read_to_string(path)
            .map_err(|error| format!("{}: {error}", path.display()))?;
        return Ok(Survey::open("", Some(&text))
            .map_err(|error| format!("{}: {error}", path.display()))?);
    }
    Ok(Survey::open(
        which.interface.as_deref().unwrap_or_default(),
        None,
    )?)
}

fn scan(which: &Which) -> Result<u8, Box<dyn Error>> {
    let found = survey(which)?.scan()?;
    let mut out = std::io::stdout();
    for (place, device) in found.iter().enumerate() {
        let Found {
            identity,
            clock,
            maps,
            modes,
            reactions,
        } = device;
        let clock = if *clock { ", clock" } else { "" };
        let alias = if identity.alias == 0 {
            String::new()
        } else {
            format!(", alias {}", identity.alias)
        };
        writeln!(
            out,
            "# {place}: {}, {:#06x}:{:#06x}, revision {:#x}{alias}{clock}",
            identity.name, identity.vendor, identity.product, identity.revision
        )?;
        for (map, title) in maps
            .iter()
            .zip(["to it", "from it"])
            .filter(|(map, _)| !map.is_empty())
        {
            writeln!(out, "#    {title}: {}", map.join(", "))?;
        }
        if !modes.is_empty() {
            writeln!(out, "#    modes: {}", modes.join(", "))?;
        }
        for reaction in reactions {
            writeln!(out, "#    {reaction}")?;
        }
    }
    for (
        place,
        Found {
            identity, modes, ..
        },
    ) in found.iter().enumerate()
    {
        let place = if identity.alias == 0 {
            format!("position = {place}")
        } else {
            format!("alias = {}", identity.alias)
        };
        writeln!(out, "\n[[drivers.bus.options.devices]]\n{place}")?;
        writeln!(
            out,
            "product = \"{:#06x}:{:#06x}\"",
            identity.vendor, identity.product
        )?;
        if modes.contains(&"csp") {
            writeln!(
                out,
                "joint = \"?\"\ncounts_per_turn = 0              # of the encoder; or counts_per_mm\nmm_per_turn = 0"
            )?;
        }
    }
    Ok(0)
}

/// Has the process do it that drives the bus; none where nobody drives it.
fn ask(
    which: &Which,
    place: usize,
    (index, sub): (u16, u8),
    value: Option<Value>,
) -> Result<Option<Value>, Box<dyn Error>> {
    let interface = match (&which.interface, &which.machine) {
        (Some(interface), _) => interface.clone(),
        (None, Some(path)) => options_of(path)?.0.interface,
        (None, None) => return Ok(None),
    };
    let object = Object { place, index, sub };
    let answer = ask_whoever_drives(&interface, &Request { object, value });
    Ok(answer.transpose()?)
}

fn read(which: &Which, device: usize, text: &str) -> Result<u8, Box<dyn Error>> {
    let (index, sub) =
        object(text).ok_or_else(|| format!("{text:?} is no object: 0x6085, or 0x6099:1"))?;
    let value = match ask(which, device, (index, sub), None)? {
        Some(value) => value,
        None => survey(which)?.read(device, index, sub)?,
    };
    writeln!(std::io::stdout(), "{index:04X}:{sub:02X} = {value}")?;
    Ok(0)
}

fn write(
    which: &Which,
    device: usize,
    text: &str,
    bits: u8,
    value: &str,
) -> Result<u8, Box<dyn Error>> {
    let (index, sub) =
        object(text).ok_or_else(|| format!("{text:?} is no object: 0x6085, or 0x6099:1"))?;
    let signed: Option<i64> = value.parse().ok().or_else(|| number(value).map(i64::from));
    let fits = signed.filter(|signed| {
        matches!(bits, 8 | 16 | 32) && (-(1 << (bits - 1))..1 << bits).contains(signed)
    });
    let signed =
        fits.ok_or_else(|| format!("{value} is no number of {bits} bits; bits are 8, 16 or 32"))?;
    let number = (signed & ((1 << bits) - 1)) as u32;
    let value = Value { number, bits };
    if ask(which, device, (index, sub), Some(value))?.is_none() {
        survey(which)?.write(device, index, sub, value)?;
    }
    writeln!(
        std::io::stdout(),
        "{index:04X}:{sub:02X} = 0x{number:x}, read back"
    )?;
    Ok(0)
}

fn state(which: &Which) -> Result<u8, Box<dyn Error>> {
    for state in survey(which)?.states()? {
        let error = state.error.map_or(String::new(), |(code, words)| {
            format!(", {code:04X}: {words}")
        });
        writeln!(std::io::stdout(), "{}: {}{error}", state.place, state.state)?;
    }
    Ok(0)
}

/// An object of a device, `2:0x6079` or `2:0x6099:1`.
fn object_of(text: &str) -> Result<Object, String> {
    let parts = text.split_once(':');
    let found = parts.and_then(|(place, of)| Some((place.parse().ok()?, object(of)?)));
    let (place, (index, sub)) = found
        .ok_or_else(|| format!("{text:?} is no object of a device: 2:0x6079, or 2:0x6099:1"))?;
    Ok(Object { place, index, sub })
}

fn watch_bus(
    path: &Path,
    record: Option<&Path>,
    time_s: f64,
    objects: &[String],
) -> Result<u8, Box<dyn Error>> {
    let (options, fine_period_s) = options_of(path)?;
    let objects: Result<Vec<_>, _> = objects.iter().map(|text| object_of(text)).collect();
    let what = Watch {
        record,
        time_s,
        objects: &objects?,
    };
    let mut shown: Vec<Watched> = vec![];
    let mut last = None;
    watch(
        &options,
        fine_period_s,
        &what,
        |devices, counters, phase_ns| {
            for device in devices.iter().filter(|device| !shown.contains(device)) {
                let status = device
                    .status
                    .as_ref()
                    .map_or(String::new(), |status| format!(", {status}"));
                let lost = device
                    .lost
                    .as_ref()
                    .map_or(String::new(), |lost| format!(", lost: {lost}"));
                let objects = device
                    .objects
                    .iter()
                    .fold(String::new(), |all, object| all + ", " + object);
                say!("{}: {}{status}{lost}{objects}", device.called, device.state);
            }
            shown = devices.to_vec();
            last = Some((*counters, phase_ns));
        },
    )?;
    if let Some((counters, phase_ns)) = last {
        let phase = phase_ns.map_or(String::new(), |ns| {
            format!(", phase {:.1} µs", ns as f64 / 1000.0)
        });
        let (exchanges, lost) = (counters.exchanges, counters.lost);
        let (short, strays) = (counters.short, counters.strays);
        writeln!(
            std::io::stdout(),
            "{exchanges} exchanges, {lost} lost, {short} with a low working counter, {strays} stray frames{phase}"
        )?;
    }
    Ok(0)
}
