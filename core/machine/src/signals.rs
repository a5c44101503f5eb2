//! `[analog.*]`: what the machine's builder calls the analog inputs of the drivers.

use tandem_sdk::MAX_ANALOG;

use crate::section::Section;

/// An analog input with a name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Analog {
    /// Its name in the file.
    pub name: String,
    /// Its number, 0 to 3.
    pub input: u32,
    /// Unit of its values, where the file states one.
    pub unit: Option<String>,
}

impl Analog {
    /// What trace and report call it: its name, and behind that its unit, as in `force_N`.
    pub fn signal(&self) -> String {
        self.unit
            .as_ref()
            .map_or_else(|| self.name.clone(), |unit| format!("{}_{unit}", self.name))
    }
}

/// Reads `[analog.*]`, or else the names of `driver.analog`, in the order of their numbers; what is wrong is reported and left
/// out.
pub(crate) fn analog(root: &Section<'_>, names: Vec<String>) -> Vec<Analog> {
    if root.has("analog") && !names.is_empty() {
        root.refuse(
            "analog",
            "driver.analog names the analog inputs already: one of the two",
        );
    }
    let section = root.section("analog");
    let unit = |name: &str| section.section(name).text("unit").map(str::to_owned);
    let named = numbered(root, "analog", "input", MAX_ANALOG as u32 - 1);
    let named = named.into_iter().map(|(name, input)| Analog {
        unit: unit(&name),
        name,
        input,
    });
    let in_order = (0..).zip(names).map(|(input, name)| Analog {
        name,
        input,
        unit: None,
    });
    let mut all: Vec<_> = in_order.chain(named).collect();
    all.sort_by_key(|analog| analog.input);
    all
}

/// The names and numbers of the tables `[<table>.<name>]`, each of which states its number under `key`.
fn numbered(root: &Section<'_>, table: &str, key: &str, last: u32) -> Vec<(String, u32)> {
    let section = root.section(table);
    let mut all: Vec<(String, u32)> = vec![];
    for name in section.keys() {
        let own = section.section(name);
        if !is_name(name) {
            own.refuse_whole("a name is lower case with underscores");
        }
        let Some(number) = own.required(key, |own, key| own.whole(key, 0, last)) else {
            continue;
        };
        if let Some((first, _)) = all.iter().find(|(_, other)| *other == number) {
            own.refuse(key, format!("{number} is called {first} already"));
        }
        all.push((name.to_owned(), number));
    }
    all
}

/// Whether `name` may name a signal: lower case with underscores.
pub(crate) fn is_name(name: &str) -> bool {
    !name.is_empty()
        && name
            .bytes()
            .all(|b| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'_')
}
