//! What a drive does by itself on a stop, a fault or a lost bus: objects 605A to 605E and 6007, in words.

use crate::coe::Objects;
use crate::options::ReactionOptions;

/// One of the objects that say what a drive does by itself.
pub(crate) struct Reaction {
    index: u16,
    /// Key of the machine file.
    key: &'static str,
    /// On what.
    meaning: &'static str,
    stated: fn(&ReactionOptions) -> Option<i16>,
    /// Numbers that bring the axis to rest on a ramp; of others the machine file has to say that they are meant. Empty where the
    /// axis stands already when it happens.
    ramps: &'static [i16],
}

/// All of them, in the order of their objects.
pub(crate) const REACTIONS: [Reaction; 6] = [
    Reaction {
        index: 0x6007,
        key: "bus_lost",
        meaning: "when the bus is lost",
        stated: |options| options.bus_lost,
        ramps: &[1, 3],
    },
    Reaction {
        index: 0x605A,
        key: "quick_stop",
        meaning: "on a quick stop",
        stated: |options| options.quick_stop,
        ramps: &[1, 2, 3, 4, 5, 6, 7, 8],
    },
    Reaction {
        index: 0x605B,
        key: "shutdown",
        meaning: "on a shutdown",
        stated: |options| options.shutdown,
        ramps: &[],
    },
    Reaction {
        index: 0x605C,
        key: "disable",
        meaning: "when its operation is disabled",
        stated: |options| options.disable,
        ramps: &[],
    },
    Reaction {
        index: 0x605D,
        key: "halt",
        meaning: "on a halt",
        stated: |options| options.halt,
        ramps: &[],
    },
    Reaction {
        index: 0x605E,
        key: "fault",
        meaning: "on a fault",
        stated: |options| options.fault,
        ramps: &[1, 2, 3, 4],
    },
];

impl Reaction {
    /// What a number of this object means.
    fn words(&self, number: i16) -> &'static str {
        match (self.index, number) {
            (_, ..0) => "what the drive's maker says",
            (0x6007, 0) => "nothing",
            (0x6007, 1) => "a fault, and what the drive does on faults",
            (0x6007, 2) | (_, 0) => "no torque, so that the axis runs out",
            (0x6007, 3) => "a quick stop",
            (_, 1) => "its ramp (6084)",
            (0x605A | 0x605D | 0x605E, 2) => "the ramp of a quick stop (6085)",
            (0x605A | 0x605D | 0x605E, 3) => "a stop at the limit of the current",
            (0x605A | 0x605D | 0x605E, 4) => "a stop at the limit of the voltage",
            (0x605A, 5) => "its ramp (6084), and it holds",
            (0x605A, 6) => "the ramp of a quick stop (6085), and it holds",
            (0x605A, 7) => "a stop at the limit of the current, and it holds",
            (0x605A, 8) => "a stop at the limit of the voltage, and it holds",
            _ => "nothing that CiA 402 knows",
        }
    }

    /// What the drive does, as people read it; none where it has no such object.
    ///
    /// # Errors
    /// The drive does not answer.
    pub(crate) async fn told(&self, objects: &Objects<'_, '_>) -> Result<Option<String>, String> {
        let number = self.read(objects).await?;
        Ok(number.map(|number| {
            let Self { index, meaning, .. } = self;
            format!("{meaning}: {} ({index:04X} = {number})", self.words(number))
        }))
    }

    async fn read(&self, objects: &Objects<'_, '_>) -> Result<Option<i16>, String> {
        let value = objects.read_if_there(self.index, 0, 2).await?;
        Ok(value.map(|value| (value as u16).cast_signed()))
    }

    /// Compares what the drive does with what the machine file states, or with what a machine counts on where it states nothing.
    ///
    /// # Errors
    /// It does something else, or does not answer.
    pub(crate) async fn judge(
        &self,
        objects: &Objects<'_, '_>,
        options: &ReactionOptions,
    ) -> Result<(), String> {
        let stated = (self.stated)(options);
        if stated.is_none() && self.ramps.is_empty() {
            return Ok(());
        }
        let Self {
            index,
            key,
            meaning,
            ramps,
            ..
        } = self;
        let (called, number) = (objects.called, self.read(objects).await?);
        match (stated, number) {
            (Some(stated), Some(number)) if stated != number => Err(format!(
                "{called}: what it does {meaning} ({index:04X}) is {number}, {}; the machine file wants {stated}, {}: set it with \
                 startup = [{{ sdo = \"0x{index:04X}\", i16 = {stated} }}]",
                self.words(number),
                self.words(stated)
            )),
            (Some(stated), None) => Err(format!(
                "{called}: reactions.{key} = {stated}: it has no object {index:04X}, and does not say what it does {meaning}"
            )),
            (None, Some(number)) if !ramps.contains(&number) => Err(format!(
                "{called}: what it does {meaning} ({index:04X}) is {number}, {}; set it with startup = [{{ sdo = \
                 \"0x{index:04X}\", i16 = … }}], or state reactions.{key} = {number} where that is meant",
                self.words(number)
            )),
            _ => Ok(()),
        }
    }
}
