//! `tandem bus`.

use std::path::PathBuf;

use clap::{Args as Group, Subcommand};

/// Which bus.
#[derive(Group)]
#[group(required = true, multiple = false)]
pub struct Which {
    /// A machine file with a driver `ethercat`
    #[arg(long, value_name = "M.toml")]
    pub machine: Option<PathBuf>,
    /// A network interface, as `ip link` lists them
    #[arg(long, value_name = "NAME")]
    pub interface: Option<String>,
    /// An emulated bus, as tandem-ethercat-emulator takes it
    #[arg(long, value_name = "B.toml")]
    pub emulated: Option<PathBuf>,
}

/// What is done with a bus.
#[derive(Subcommand)]
pub enum Bus {
    /// List the devices, and print their sections for a machine file; they go to PRE-OP and back to INIT
    Scan {
        #[command(flatten)]
        which: Which,
    },
    /// Read or write an object of a device
    #[command(subcommand)]
    Sdo(Sdo),
    /// Say in which state each device is, and why; nothing changes
    State {
        #[command(flatten)]
        which: Which,
    },
    /// Bring the bus to OP with all drives disabled, and show states, status words, lost frames and phase
    Watch {
        /// The machine file with a driver `ethercat`
        #[arg(long, value_name = "M.toml")]
        machine: PathBuf,
        /// For so many seconds
        #[arg(long = "for", value_name = "SECONDS", default_value_t = 10.0)]
        seconds: f64,
        /// Reads an object of a device meanwhile, as `2:0x6079` or `2:0x6099:1`; may be repeated
        #[arg(long = "object", value_name = "DEVICE:OBJECT")]
        objects: Vec<String>,
    },
    /// The same, and write every frame from power-on into a file that Wireshark opens
    Pcap {
        /// The file to write
        file: PathBuf,
        /// The machine file with a driver `ethercat`
        #[arg(long, value_name = "M.toml")]
        machine: PathBuf,
        /// For so many seconds
        #[arg(long = "for", value_name = "SECONDS", default_value_t = 2.0)]
        seconds: f64,
    },
}

/// What is done with an object.
#[derive(Subcommand)]
pub enum Sdo {
    /// Read it
    Read {
        /// Place of the device, from 0
        device: usize,
        /// The object: 0x6085, or 0x6099:1 with a sub-index
        object: String,
        #[command(flatten)]
        which: Which,
    },
    /// Write it, and read it back; drives forget it at power-off unless they are told to store it
    Write {
        /// Place of the device, from 0
        device: usize,
        /// The object: 0x6085, or 0x6099:1 with a sub-index
        object: String,
        /// Its bits: 8, 16 or 32
        bits: u8,
        /// The number, 0x402 or 1026; below 0 as well
        #[arg(allow_negative_numbers = true)]
        value: String,
        #[command(flatten)]
        which: Which,
    },
}
