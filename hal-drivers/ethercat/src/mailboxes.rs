//! Objects of devices in operation: they are asked for between two exchanges, whose times stay as they are.

use ethercrab::subdevice_group::{HasDc, NoDc, PreOpPdi};
use ethercrab::{DefaultLock, MainDevice, SubDeviceGroup};

use crate::bring_up::MAX_BYTES;
use crate::check::MAX_DEVICES;
use crate::coe::Objects;
use crate::requests::Request;
use crate::survey::Value;

/// Devices whose process data are mapped, in one of `ethercrab`'s types, with a clock or without.
type Mapped<C> = SubDeviceGroup<MAX_DEVICES, MAX_BYTES, DefaultLock, PreOpPdi, C>;

/// The devices as `ethercrab` knows them: by them their mailboxes are reached.
pub(crate) enum Mailboxes {
    /// Frames lead.
    FreeRun(Box<Mapped<NoDc>>),
    /// Distributed clocks lead.
    Clocks(Box<Mapped<HasDc>>),
}

impl std::fmt::Debug for Mailboxes {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Mailboxes")
    }
}

impl Mailboxes {
    /// Reads an object, as many bytes as it has, or writes it and reads it back.
    pub(crate) async fn ask(
        &self,
        main: &MainDevice<'static>,
        called: &str,
        request: &Request,
    ) -> Result<Value, String> {
        let refused = |error: ethercrab::error::Error| format!("{called}: {error}");
        let place = request.object.place;
        match self {
            Self::FreeRun(group) => {
                let device = &group.subdevice(main, place).map_err(refused)?;
                Objects { device, called }.ask(request).await
            }
            Self::Clocks(group) => {
                let device = &group.subdevice(main, place).map_err(refused)?;
                Objects { device, called }.ask(request).await
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::bus::Bus;
    use crate::options::Options;
    use crate::survey::{Object, context_of};
    use tandem_ethercat_emulator::What;
    use tandem_sdk::PluginOptions;

    fn object(place: usize, index: u16) -> Object {
        Object {
            place,
            index,
            sub: 0,
        }
    }

    /// Objects are read in operation within ten periods, while every exchange has its time and its reply.
    #[test]
    fn objects_are_read_within_ten_periods_and_no_exchange_is_late() {
        for sync in ["free-run", "dc"] {
            let drive = |n: usize| {
                format!(
                    "[[devices]]\nposition = {n}\nproduct = \"0x0e1a:0x0402\"\njoint = \"{n}\"\ncounts_per_mm = 1000\n"
                )
            };
            let drives: String = (0..4).map(drive).collect();
            let options = format!("interface = \"emulated\"\nsync = \"{sync}\"\n{drives}");
            let options = Options::read(&options).unwrap();
            let mut bus = Bus::open(&options, &context_of(&options, 0.001, false)).unwrap();
            bus.start().unwrap();
            (0..50).for_each(|_| bus.turn());
            let mut worst = 0;
            for n in 0..200_u64 {
                let (begun, before_ns) = (bus.counters.exchanges, bus.link_mut().now_ns());
                let place = (n % 4) as usize;
                let value = bus.read_object(object(place, 0x6502)).unwrap();
                assert_eq!((value.number, value.bits), (0b1_1010_0100, 32));
                let took = bus.counters.exchanges - begun;
                worst = worst.max(took);
                let passed = (bus.link_mut().now_ns() - before_ns) / 1_000_000;
                assert!(
                    took.abs_diff(passed) <= 1,
                    "{took} exchanges in {passed} ms"
                );
                (0..n % 3).for_each(|_| bus.turn());
            }
            assert!(worst <= 10, "{sync}: {worst} periods");
            println!("{sync}: an object is read within {worst} periods");
            let refused = bus.read_object(object(2, 0x5FFF)).unwrap_err();
            assert!(
                refused.contains("device 2 (2): reading 5FFF:00: it refuses"),
                "{refused}"
            );
            // A mailbox that does not answer is waited for, and the exchanges go on meanwhile.
            let silent = What::SilentMailbox { device: 1 };
            let wire = bus.link_mut().wire_mut().unwrap();
            wire.inject(silent, None).unwrap();
            let (begun, before_ns) = (bus.counters.exchanges, bus.link_mut().now_ns());
            let refused = bus.read_object(object(1, 0x6502)).unwrap_err();
            assert!(refused.contains("its mailbox does not answer"), "{refused}");
            let took = bus.counters.exchanges - begun;
            let passed = (bus.link_mut().now_ns() - before_ns) / 1_000_000;
            assert!(
                passed > 500 && took.abs_diff(passed) <= 1,
                "{took} exchanges in {passed} ms"
            );
            let counters = bus.counters;
            assert_eq!((counters.lost, counters.short, counters.strays), (0, 0, 0));
            for device in bus.link_mut().wire_mut().unwrap().bus().devices() {
                assert_eq!(device.counters().sync0_without_outputs, 0);
            }
        }
    }
}
