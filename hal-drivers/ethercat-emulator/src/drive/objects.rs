//! The objects of a drive, and where they lie in its dictionary.

use super::description::DriveDescription;
use crate::blueprint::{Pdo, PdoEntry};
use crate::bytes::number_at;
use crate::firmware::dictionary::{Abort, Access, Dictionary, Kind, Slot};

/// Homing methods that a drive knows.
pub(super) const HOMING_METHODS: [i8; 12] = [1, 2, 3, 5, 17, 18, 19, 21, 33, 34, 35, 37];

/// Makes the table of a drive's objects: name, index, type, access, value at power-on.
macro_rules! objects {
    ($($field:ident = $index:literal, $kind:ident, $access:ident, $value:expr, $name:literal;)*) => {
        /// Where each object lies.
        #[derive(Clone, Copy, Debug)]
        pub(super) struct Slots {
            $(pub(super) $field: Slot,)*
        }

        impl Slots {
            /// Adds all objects.
            pub(super) fn describe(of: &DriveDescription, dictionary: &mut Dictionary) {
                $(
                    let value: fn(&DriveDescription) -> i64 = $value;
                    dictionary.name($index, $name);
                    dictionary.add($index, 0, Kind::$kind, Access::$access, value(of));
                )*
            }

            /// Finds all objects; a dictionary without one of them is not a drive's.
            pub(super) fn find(dictionary: &Dictionary) -> Option<Self> {
                Some(Self { $($field: dictionary.slot($index, 0)?,)* })
            }
        }
    };
}

objects! {
    abort_option = 0x6007, I16, ReadWrite, |_| 1, "abort connection option code";
    error_code = 0x603F, U16, ReadOnly, |_| 0, "error code";
    control = 0x6040, U16, ReadWrite, |_| 0, "controlword";
    status = 0x6041, U16, ReadOnly, |_| 0, "statusword";
    quick_stop_option = 0x605A, I16, ReadWrite, |_| 2, "quick stop option code";
    shutdown_option = 0x605B, I16, ReadWrite, |_| 1, "shutdown option code";
    disable_option = 0x605C, I16, ReadWrite, |_| 1, "disable operation option code";
    fault_option = 0x605E, I16, ReadWrite, |_| 2, "fault reaction option code";
    mode = 0x6060, I8, ReadWrite, |_| 0, "modes of operation";
    mode_display = 0x6061, I8, ReadOnly, |_| 0, "modes of operation display";
    demand = 0x6062, I32, ReadOnly, |_| 0, "position demand value";
    position = 0x6064, I32, ReadOnly, |_| 0, "position actual value";
    window = 0x6065, U32, ReadWrite, |d| i64::from(d.following_error_window_counts), "following error window";
    window_time = 0x6066, U16, ReadWrite, |d| i64::from(d.following_error_time_ms), "following error time out";
    velocity = 0x606C, I32, ReadOnly, |_| 0, "velocity actual value";
    max_torque = 0x6072, U16, ReadWrite, |_| 3000, "max torque";
    torque = 0x6077, I16, ReadOnly, |_| 0, "torque actual value";
    target = 0x607A, I32, ReadWrite, |_| 0, "target position";
    home_offset = 0x607C, I32, ReadWrite, |_| 0, "home offset";
    acceleration = 0x6083, U32, ReadWrite, |_| 10_000_000, "profile acceleration";
    deceleration = 0x6084, U32, ReadWrite, |_| 10_000_000, "profile deceleration";
    quick_stop_deceleration =
        0x6085, U32, ReadWrite, |d| i64::from(d.quick_stop_deceleration_counts_per_s2), "quick stop deceleration";
    homing_method = 0x6098, I8, ReadWrite, |_| 35, "homing method";
    homing_acceleration = 0x609A, U32, ReadWrite, |_| 10_000_000, "homing acceleration";
    velocity_offset = 0x60B1, I32, ReadWrite, |_| 0, "velocity offset";
    probe_function = 0x60B8, U16, ReadWrite, |_| 0, "touch probe function";
    probe_status = 0x60B9, U16, ReadOnly, |_| 0, "touch probe status";
    probe1_rising = 0x60BA, I32, ReadOnly, |_| 0, "touch probe 1 positive edge";
    probe1_falling = 0x60BB, I32, ReadOnly, |_| 0, "touch probe 1 negative edge";
    probe2_rising = 0x60BC, I32, ReadOnly, |_| 0, "touch probe 2 positive edge";
    probe2_falling = 0x60BD, I32, ReadOnly, |_| 0, "touch probe 2 negative edge";
    following_error = 0x60F4, I32, ReadOnly, |_| 0, "following error actual value";
    inputs = 0x60FD, U32, ReadOnly, |_| 0, "digital inputs";
    target_velocity = 0x60FF, I32, ReadWrite, |_| 0, "target velocity";
}

/// Objects with sub-indexes, which are read by address.
pub(super) const HOMING_SPEEDS: u16 = 0x6099;
pub(super) const INTERPOLATION: u16 = 0x60C2;
pub(super) const SYNC_ERROR: u16 = 0x10F1;

/// Adds what has sub-indexes, and the one object of free octets.
pub(super) fn describe_records(of: &DriveDescription, dictionary: &mut Dictionary) {
    let mut record = |index: u16, name: &str, entries: &[(Kind, i64)]| {
        dictionary.name(index, name);
        dictionary.add(
            index,
            0,
            Kind::U8,
            Access::ReadOnly,
            i64::from(entries.len() as u8),
        );
        for (sub, (kind, value)) in (1..).zip(entries) {
            dictionary.add(index, sub, *kind, Access::ReadWrite, *value);
        }
    };
    record(
        HOMING_SPEEDS,
        "homing speeds",
        &[(Kind::U32, 1_000_000), (Kind::U32, 100_000)],
    );
    record(
        INTERPOLATION,
        "interpolation time period",
        &[(Kind::U8, 1), (Kind::I8, -3)],
    );
    record(
        SYNC_ERROR,
        "sync error settings",
        &[(Kind::U32, 1), (Kind::U16, i64::from(of.sync_error_limit))],
    );
    let counts = of.counts_per_turn as i64;
    let modes = of.modes.iter().map(|mode| 1 << (mode - 1)).sum();
    record(
        0x608F,
        "position encoder resolution",
        &[(Kind::U32, counts), (Kind::U32, 1)],
    );
    let sync = [
        (Kind::U16, 2),
        (Kind::U32, 0),
        (Kind::U32, 0),
        (Kind::U16, 0x401F),
    ];
    record(0x1C32, "output sync manager parameter", &sync);
    record(0x1C33, "input sync manager parameter", &sync);
    for (index, kind, access, value, name) in [
        (0x605D, Kind::I16, Access::ReadWrite, 1, "halt option code"),
        (0x6071, Kind::I16, Access::ReadWrite, 0, "target torque"),
        (0x60B2, Kind::I16, Access::ReadWrite, 0, "torque offset"),
        (
            0x6502,
            Kind::U32,
            Access::ReadOnly,
            modes,
            "supported drive modes",
        ),
    ] {
        dictionary.name(index, name);
        dictionary.add(index, 0, kind, access, value);
    }
    dictionary.name(0x60E3, "supported homing methods");
    dictionary.add(
        0x60E3,
        0,
        Kind::U8,
        Access::ReadOnly,
        i64::from(HOMING_METHODS.len() as u8),
    );
    for (sub, method) in (1..).zip(HOMING_METHODS) {
        dictionary.add(0x60E3, sub, Kind::I8, Access::ReadOnly, i64::from(method));
    }
    dictionary.name(0x2000, "notes of the user");
    dictionary.add_bytes(0x2000, (0..200).collect());
}

/// What a drive maps until its master says otherwise.
pub(crate) fn default_pdos() -> Vec<Pdo> {
    let entry = |(index, bits)| PdoEntry {
        index,
        sub: 0,
        bits,
    };
    let pdo = |index, manager, entries: &[(u16, u8)]| Pdo {
        index,
        manager,
        fixed: false,
        entries: entries.iter().copied().map(entry).collect(),
    };
    vec![
        pdo(
            0x1600,
            Some(2),
            &[
                (0x6040, 16),
                (0x6060, 8),
                (0, 8),
                (0x607A, 32),
                (0x60B1, 32),
                (0x60B8, 16),
            ],
        ),
        pdo(
            0x1601,
            None,
            &[(0x6040, 16), (0x6060, 8), (0, 8), (0x60FF, 32)],
        ),
        pdo(
            0x1A00,
            Some(3),
            &[
                (0x6041, 16),
                (0x6061, 8),
                (0, 8),
                (0x6064, 32),
                (0x606C, 32),
                (0x6077, 16),
                (0x603F, 16),
                (0x60B9, 16),
                (0x60BA, 32),
                (0x60FD, 32),
            ],
        ),
        pdo(
            0x1A01,
            None,
            &[
                (0x6041, 16),
                (0x6061, 8),
                (0, 8),
                (0x606C, 32),
                (0x603F, 16),
            ],
        ),
    ]
}

/// Refuses values that a drive cannot take.
pub(crate) fn judge_write(
    dictionary: &Dictionary,
    index: u16,
    sub: u8,
    data: &[u8],
) -> Result<(), Abort> {
    let value = number_at(data, 0, 8);
    let fits = match (index, sub) {
        (0x6060, 0) => {
            let modes = dictionary.number(0x6502, 0);
            value == 0 || (1..=32).contains(&value) && modes >> (value - 1) & 1 == 1
        }
        (0x6098, 0) => HOMING_METHODS.contains(&((value as u8).cast_signed())),
        (0x605A, 0) => [0, 1, 2, 5, 6].contains(&value),
        (0x605B | 0x605C, 0) => value <= 1,
        (0x605E, 0) => value <= 2,
        (0x6007, 0) => value <= 3,
        (INTERPOLATION, 1) => value > 0,
        (INTERPOLATION, 2) => (-6..=-3).contains(&((value as u8).cast_signed())),
        _ => true,
    };
    if fits { Ok(()) } else { Err(Abort::VALUE) }
}
