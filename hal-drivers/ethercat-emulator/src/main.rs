//! The command: a bus of emulated devices on a network interface, in real time.

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use clap::Parser;
use tandem_ethercat_emulator::{
    AlCode, AlState, BusDescription, Device, DriveState, MAX_FRAME, RawError, RawSocket, Wire,
};

/// Longest wait for a frame, in ns: at least so often the devices' own time goes on.
const MAX_WAIT_NS: u64 = 500_000;

/// EtherCAT drives and terminals without hardware, on a network interface.
#[derive(Debug, Parser)]
#[command(version)]
struct Arguments {
    /// The bus: devices, switches and faults, as TOML.
    bus: PathBuf,
    /// The network interface; one end of a pair of virtual ones, or one at the other end of a master's cable.
    #[arg(long)]
    interface: String,
    /// End after so many seconds.
    #[arg(long = "for", value_name = "SECONDS")]
    seconds: Option<f64>,
}

fn main() -> ExitCode {
    match run(&Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(cause) => {
            eprintln!("error: {cause}");
            ExitCode::from(1)
        }
    }
}

fn run(arguments: &Arguments) -> Result<(), Box<dyn std::error::Error>> {
    let file = arguments.bus.display();
    let text = std::fs::read_to_string(&arguments.bus).map_err(|e| format!("{file}: {e}"))?;
    let description = BusDescription::from_toml(&text).map_err(|e| format!("{file}: {e}"))?;
    let mut wire = Wire::new(&description).map_err(|e| format!("{file}: {e}"))?;
    wire.set_travel(false);
    let socket = RawSocket::open(&arguments.interface)?;
    let begin = Instant::now();
    let now_ns = || begin.elapsed().as_nanos() as u64;
    let end_ns = arguments
        .seconds
        .map_or(u64::MAX, |seconds| (seconds.max(0.0) * 1e9) as u64);
    let mut seen: Vec<Shown> = wire.bus().devices().iter().map(Shown::of).collect();
    println!("{} devices on {}", seen.len(), arguments.interface);
    while now_ns() < end_ns {
        let next_ns = wire
            .next_reply_ns()
            .map_or(MAX_WAIT_NS, |due_ns| due_ns.saturating_sub(now_ns()));
        if next_ns > 0 {
            socket.wait(next_ns.min(MAX_WAIT_NS));
        }
        exchange(&socket, &mut wire, now_ns)?;
        wire.advance(now_ns());
        tell(&wire, &mut seen, now_ns());
    }
    Ok(())
}

/// Takes what came in and sends what is back.
fn exchange(socket: &RawSocket, wire: &mut Wire, now_ns: impl Fn() -> u64) -> Result<(), RawError> {
    let mut buffer = [0; MAX_FRAME];
    while let Some(frame) = socket.receive(&mut buffer)? {
        wire.send(now_ns(), frame);
        send_replies(socket, wire, now_ns())?;
    }
    send_replies(socket, wire, now_ns())
}

fn send_replies(socket: &RawSocket, wire: &mut Wire, now_ns: u64) -> Result<(), RawError> {
    let mut buffer = [0; MAX_FRAME];
    while let Some(length) = wire.receive(now_ns, &mut buffer) {
        socket.send(&buffer[..length])?;
    }
    Ok(())
}

/// What is told of a device when it changes.
#[derive(Clone, Copy, PartialEq)]
struct Shown {
    state: AlState,
    code: Option<AlCode>,
    drive: Option<DriveState>,
    outputs: u64,
}

impl Shown {
    fn of(device: &Device) -> Self {
        let outputs = (0..64)
            .filter(|output| device.output(*output) == Some(true))
            .fold(0, |sum, bit| sum | 1 << bit);
        Self {
            state: device.al_state(),
            code: device.al_code(),
            drive: device.drive_state(),
            outputs,
        }
    }
}

fn tell(wire: &Wire, seen: &mut [Shown], now_ns: u64) {
    for ((number, device), seen) in wire.bus().devices().iter().enumerate().zip(seen) {
        let now = Shown::of(device);
        if now == *seen {
            continue;
        }
        *seen = now;
        let code = now
            .code
            .map_or(String::new(), |code| format!(", error 0x{:04X}", code.0));
        let drive = now
            .drive
            .map_or(String::new(), |state| format!(", {state:?}"));
        let outputs = if device.output(0).is_some() {
            format!(", outputs 0x{:x}", now.outputs)
        } else {
            String::new()
        };
        let time_s = now_ns as f64 / 1e9;
        println!(
            "{time_s:.4} s, device {number} {}: {:?}{code}{drive}{outputs}",
            device.name(),
            now.state
        );
    }
}
