//! Who may give commands.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

/// How long a holder may say nothing after another client has asked for the lease.
pub const ANSWER_WITHIN: Duration = Duration::from_secs(5);

/// The control lease: at most one client holds it.
#[derive(Debug, Default)]
pub struct Lease {
    holder: Option<u64>,
    /// Until when the holder must say something, since another client has asked for the lease.
    answer_by: Option<Instant>,
    news: Vec<(u64, News)>,
    /// Who clients are, in words.
    names: BTreeMap<u64, String>,
}

/// What a holder is told without having asked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum News {
    /// This client asks for the lease: whoever holds it loses it unless it says something.
    AskedBy(u64),
    /// This client holds it now.
    LostTo(u64),
}

impl Lease {
    /// Takes the lease for `client`; taking it twice is no error. A holder that has said nothing for [`ANSWER_WITHIN`]
    /// since the first refusal loses it: it hangs, or nobody is there.
    ///
    /// # Errors
    /// The client that holds it, which is told that it is asked for.
    pub fn take(&mut self, client: u64, now: Instant) -> Result<(), u64> {
        let Some(other) = self.holder.filter(|holder| *holder != client) else {
            self.holder = Some(client);
            return Ok(());
        };
        match self.answer_by {
            Some(answer_by) if answer_by <= now => self.take_over(client),
            Some(_) => return Err(other),
            None => {
                self.answer_by = Some(now + ANSWER_WITHIN);
                self.news.push((other, News::AskedBy(client)));
                return Err(other);
            }
        }
        Ok(())
    }

    /// Takes the lease for `client` whoever holds it; who held it is told.
    pub fn take_over(&mut self, client: u64) {
        if let Some(other) = self.holder.filter(|holder| *holder != client) {
            self.news.push((other, News::LostTo(client)));
        }
        self.holder = Some(client);
        self.answer_by = None;
    }

    /// `client` has said something: it is there.
    pub fn hears(&mut self, client: u64) {
        if self.is_held_by(client) {
            self.answer_by = None;
        }
    }

    /// Gives the lease back; `false` where `client` did not hold it. Also at the end of its connection.
    pub fn release(&mut self, client: u64) -> bool {
        let held = self.is_held_by(client);
        if held {
            self.holder = None;
            self.answer_by = None;
        }
        held
    }

    /// What clients have to be told, with their numbers.
    pub fn news(&mut self) -> Vec<(u64, News)> {
        std::mem::take(&mut self.news)
    }

    /// Whether `client` may give commands.
    pub fn is_held_by(&self, client: u64) -> bool {
        self.holder == Some(client)
    }

    /// The client that may.
    pub fn holder(&self) -> Option<u64> {
        self.holder
    }

    /// Somebody has come, who is called so.
    pub fn introduce(&mut self, client: u64, name: String) {
        self.names.insert(client, name);
    }

    /// A client has gone.
    pub fn forget(&mut self, client: u64) {
        self.names.remove(&client);
    }

    /// Who a client is, in words. Allocates.
    pub fn name_of(&self, client: u64) -> String {
        let number = || format!("client {client}");
        self.names.get(&client).cloned().unwrap_or_else(number)
    }
}
