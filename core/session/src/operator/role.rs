//! What a client may do, by the listener or the token by which it came.

/// What a client may do. Each may do what those before it may.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Role {
    /// Look, and stop the machine.
    Watch,
    /// Drive programs, lines by hand and jogs.
    Operate,
    /// Change what lasts.
    SetUp,
}

impl Role {
    /// The role of this name.
    pub fn of_name(name: &str) -> Option<Self> {
        [Self::Watch, Self::Operate, Self::SetUp]
            .into_iter()
            .find(|role| role.name() == name)
    }

    /// As people and programs read it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Watch => "watch",
            Self::Operate => "operate",
            Self::SetUp => "set-up",
        }
    }
}
