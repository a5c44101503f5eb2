//! Drives in OPERATIONAL, exchanged once a period by `ethercrab`.

use std::cell::Cell;

use ethercrab::error::Error;
use ethercrab::subdevice_group::{Op, PreOp};
use ethercrab::{MainDevice, SubDeviceGroup};
use tandem_ethercat_emulator::DriveState;

use crate::rig::{MAX_BYTES, MAX_DEVICES, Rig, now_ns};

/// Period of the process data.
pub const PERIOD_NS: u64 = 1_000_000;
pub const PERIOD_S: f64 = 0.001;

type InPreOp = SubDeviceGroup<MAX_DEVICES, MAX_BYTES, ethercrab::DefaultLock, PreOp>;
type InOp = SubDeviceGroup<MAX_DEVICES, MAX_BYTES, ethercrab::DefaultLock, Op>;

/// A group of drives in OPERATIONAL, exchanged once a period.
pub struct Cyclic<'a> {
    rig: &'a Rig,
    master: &'a MainDevice<'static>,
    group: InOp,
    next_ns: Cell<u64>,
}

/// What a drive is sent with the mapping that it has from the start.
#[derive(Clone, Copy, Default)]
pub struct Command {
    pub control: u16,
    pub mode: i8,
    pub target: i32,
    pub velocity: i32,
    pub probe: u16,
}

/// What it answers.
#[derive(Clone, Copy, Debug, Default)]
pub struct Answer {
    pub status: u16,
    pub position: i32,
    pub error: u16,
    pub probe_status: u16,
    pub probe_position: i32,
    pub inputs: u32,
}

impl<'a> Cyclic<'a> {
    pub async fn bring_up(rig: &'a Rig, master: &'a MainDevice<'static>) -> Result<Self, Error> {
        let group = master
            .init_single_group::<MAX_DEVICES, MAX_BYTES>(now_ns)
            .await?;
        Self::of(rig, master, group).await
    }

    pub async fn of(
        rig: &'a Rig,
        master: &'a MainDevice<'static>,
        group: InPreOp,
    ) -> Result<Self, Error> {
        let group = group.into_safe_op(master).await?;
        let group = group.request_into_op(master).await?;
        while !group.tx_rx(master).await?.all_op() {}
        Ok(Self {
            rig,
            master,
            group,
            next_ns: Cell::new(now_ns()),
        })
    }

    /// Waits for the next period and exchanges; what a device answers is what it was in the last exchange.
    pub async fn exchange(&self, device: usize, command: Command) -> Answer {
        self.next_ns.set(self.next_ns.get() + PERIOD_NS);
        self.rig.until(self.next_ns.get()).await;
        let drive = self.group.subdevice(self.master, device).unwrap();
        let mut outputs = drive.outputs_raw_mut();
        outputs[0..2].copy_from_slice(&command.control.to_le_bytes());
        outputs[2] = command.mode.cast_unsigned();
        outputs[4..8].copy_from_slice(&command.target.to_le_bytes());
        outputs[8..12].copy_from_slice(&command.velocity.to_le_bytes());
        outputs[12..14].copy_from_slice(&command.probe.to_le_bytes());
        drop(outputs);
        self.group.tx_rx(self.master).await.unwrap();
        let inputs = drive.inputs_raw();
        let long = |at: usize| i32::from_le_bytes(inputs[at..at + 4].try_into().unwrap());
        let word = |at: usize| u16::from_le_bytes([inputs[at], inputs[at + 1]]);
        Answer {
            status: word(0),
            position: long(4),
            error: word(14),
            probe_status: word(16),
            probe_position: long(18),
            inputs: long(22).cast_unsigned(),
        }
    }

    /// Sends a command until the status is as wanted; fails after so many periods.
    pub async fn until(
        &self,
        device: usize,
        command: Command,
        periods: u32,
        wanted: impl Fn(&Answer) -> bool,
    ) -> Answer {
        let mut answer = Answer::default();
        for _ in 0..periods {
            answer = self.exchange(device, command).await;
            if wanted(&answer) {
                return answer;
            }
        }
        panic!("not within {periods} periods: {answer:x?}");
    }

    /// Through the states to *Operation enabled*, where the drive stands.
    pub async fn enable(&self, device: usize, mode: i8) -> Answer {
        let mut command = Command {
            mode,
            ..Command::default()
        };
        for (control, status) in [(0x80, 0x40), (0x06, 0x21), (0x07, 0x23), (0x0f, 0x27)] {
            command.target = self
                .exchange(device, Command { control, ..command })
                .await
                .position;
            let state = |answer: &Answer| answer.status & 0x6f == status;
            self.until(device, Command { control, ..command }, 500, state)
                .await;
        }
        self.exchange(
            device,
            Command {
                control: 0x0f,
                ..command
            },
        )
        .await
    }

    /// Sets the first outputs of a terminal.
    pub fn switch(&self, device: usize, outputs: u8) {
        self.group
            .subdevice(self.master, device)
            .unwrap()
            .outputs_raw_mut()[0] = outputs;
    }

    /// The state that a drive is really in.
    pub fn drive_state(&self, device: usize) -> DriveState {
        self.rig.wire.borrow().bus().devices()[device]
            .drive_state()
            .unwrap()
    }
}
