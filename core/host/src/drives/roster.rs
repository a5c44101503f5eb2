//! Who is who among the drivers, for the host while the fine loop has them.

use std::sync::Arc;
use std::sync::atomic::AtomicUsize;
use std::sync::atomic::Ordering::Relaxed;

use tandem_sdk::DriverDescription;

use super::slow::Switch;

/// One driver.
#[derive(Clone, Debug)]
pub struct Entry {
    /// What people call it.
    pub title: String,
    /// The dotted path of its table in the machine file.
    pub section: String,
    /// What it says of itself.
    pub description: DriverDescription,
    /// The joints that it moves; none where it moves all.
    pub joints: Option<Vec<usize>>,
    /// Whether it turns the spindle.
    pub spindle: bool,
}

/// All drivers of a machine; at least one.
#[derive(Clone, Debug)]
pub struct Roster {
    first: Entry,
    others: Vec<Entry>,
    /// Which of them was the first whose exchange failed.
    pub(super) failed: Arc<AtomicUsize>,
    /// What gives slow drivers their threads.
    pub(super) slow: Vec<Switch>,
    /// Fine periods by which feedback is behind the command, of the joint where they are most; 0 until the drives are claimed.
    pub delay_periods: u32,
}

impl Roster {
    /// `first` and `others`.
    pub(super) fn new(first: Entry, others: Vec<Entry>) -> Self {
        Self {
            first,
            others,
            failed: Arc::default(),
            slow: vec![],
            delay_periods: 0,
        }
    }

    /// The same, told how far feedback is behind the command.
    #[must_use]
    pub fn behind_by(self, delay_periods: u32) -> Self {
        Self {
            delay_periods,
            ..self
        }
    }

    /// One driver that has the whole machine and describes itself so, without a name.
    pub fn of_one(description: DriverDescription) -> Self {
        let (title, section) = ("driver".to_string(), "driver".to_string());
        Self::new(
            Entry {
                title,
                section,
                description,
                joints: None,
                spindle: true,
            },
            vec![],
        )
    }

    /// Each of them.
    pub fn all(&self) -> impl Iterator<Item = &Entry> {
        std::iter::once(&self.first).chain(&self.others)
    }

    /// The first driver with real drives behind it, if there is one.
    pub fn real(&self) -> Option<&Entry> {
        self.all().find(|entry| entry.description.simulated == 0)
    }

    /// The driver that moves `joint`.
    pub fn of_joint(&self, joint: usize) -> &Entry {
        let moves = |entry: &&Entry| {
            entry
                .joints
                .as_ref()
                .is_none_or(|joints| joints.contains(&joint))
        };
        self.all().find(moves).unwrap_or(&self.first)
    }

    /// The driver that turns the spindle.
    pub fn of_spindle(&self) -> &Entry {
        self.all()
            .find(|entry| entry.spindle)
            .unwrap_or(&self.first)
    }

    /// The driver whose exchange failed first; asked only where one did.
    pub fn failed(&self) -> &Entry {
        self.all()
            .nth(self.failed.load(Relaxed))
            .unwrap_or(&self.first)
    }

    /// What people call them all.
    pub fn titles(&self) -> String {
        self.all()
            .map(|entry| entry.title.as_str())
            .collect::<Vec<_>>()
            .join(", ")
    }

    /// The drivers as one: simulated where all are, and with the longest times of any.
    pub fn describe(&self) -> DriverDescription {
        self.others
            .iter()
            .fold(self.first.description, |all, entry| {
                let one = entry.description;
                DriverDescription {
                    simulated: all.simulated.min(one.simulated),
                    watches_following: all.watches_following.min(one.watches_following),
                    slow: all.slow.max(one.slow),
                    hexadecimal_codes: all.hexadecimal_codes.min(one.hexadecimal_codes),
                    gives_phase: all.gives_phase.max(one.gives_phase),
                    enable_s: all.enable_s.max(one.enable_s),
                    disable_s: all.disable_s.max(one.disable_s),
                }
            })
    }

    /// Gives slow drivers their threads: on the wall clock nobody waits for them. Host; allocates.
    ///
    /// # Errors
    /// The computer gives no thread.
    pub fn begin_threads(&self) -> std::io::Result<()> {
        self.slow.iter().try_for_each(Switch::begin)
    }

    /// Those whose feedback paces the loop.
    pub fn with_phase(&self) -> Vec<&Entry> {
        self.all()
            .filter(|entry| entry.description.gives_phase != 0)
            .collect()
    }
}
