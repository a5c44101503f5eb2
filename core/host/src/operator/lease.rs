//! Who may give commands.

/// The control lease: at most one client holds it.
#[derive(Debug, Default)]
pub struct Lease {
    holder: Option<u64>,
}

impl Lease {
    /// Takes the lease for `client`; taking it twice is no error.
    ///
    /// # Errors
    /// The client that holds it.
    pub fn take(&mut self, client: u64) -> Result<(), u64> {
        match self.holder {
            Some(other) if other != client => Err(other),
            _ => {
                self.holder = Some(client);
                Ok(())
            }
        }
    }

    /// Gives the lease back; `false` where `client` did not hold it. Also at the end of its connection.
    pub fn release(&mut self, client: u64) -> bool {
        let held = self.is_held_by(client);
        if held {
            self.holder = None;
        }
        held
    }

    /// Whether `client` may give commands.
    pub fn is_held_by(&self, client: u64) -> bool {
        self.holder == Some(client)
    }

    /// The client that may.
    pub fn holder(&self) -> Option<u64> {
        self.holder
    }
}
