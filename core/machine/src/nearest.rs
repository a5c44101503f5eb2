//! The known key nearest to an unknown one.

use strsim::damerau_levenshtein;

use crate::keys::{Key, agree, is_open, is_placeholder};
use crate::shown::dotted;

/// What a key in another table costs more than one in the same, in edits.
const OTHER_TABLE: usize = 2;

/// What it costs to take a key for one that a plugin reads: less than a guess, more than a slip.
const PLUGINS_OWN: usize = 4;

/// Longer keys are not compared to their end.
const LONGEST: usize = 64;

/// The nearest known key.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Nearest {
    /// Its dotted path.
    pub path: String,
    /// Whether it stands in the table of the unknown key.
    pub same_table: bool,
    /// Whether it is so near that it was probably meant.
    pub close: bool,
}

impl Nearest {
    /// How it is written where the unknown key stands.
    pub fn name(&self) -> &str {
        match self.path.rsplit_once('.') {
            Some((_, name)) if self.same_table => name,
            _ => &self.path,
        }
    }
}

/// The name among `known` that `name` was probably meant to be; none where no one is near.
pub fn meant<'a>(name: &str, known: &[&'a str]) -> Option<&'a str> {
    let nearest = known
        .iter()
        .map(|known| (distance(name, known), *known))
        .min_by_key(|(edits, _)| *edits);
    nearest
        .filter(|(edits, _)| is_close(name, *edits))
        .map(|(_, known)| known)
}

/// Whether a name so many edits away was probably meant: a third of its letters may be wrong, two always.
fn is_close(name: &str, edits: usize) -> bool {
    edits <= (name.chars().count() / 3).max(2)
}

struct Candidate {
    cost: usize,
    nearest: Nearest,
}

/// The key or table nearest to `path`; `rotary` says whether the table it stands in is that of a rotary axis.
pub fn nearest(keys: &[Key], path: &[&str], rotary: bool) -> Option<Nearest> {
    let (name, table) = path.split_last()?;
    let name: String = name.chars().take(LONGEST).collect();
    let usable = keys.iter().filter(|key| fits(key.path, path, rotary));
    let candidates =
        usable.flat_map(|key| prefixes(key.path).map(|prefix| candidate(prefix, &name, table)));
    candidates.min_by_key(|c| c.cost).map(|c| c.nearest)
}

/// A key of the other kind of axis is never meant.
fn fits(pattern: &str, path: &[&str], rotary: bool) -> bool {
    let other = if rotary { "_mm" } else { "_deg" };
    !(path.first() == Some(&"axes") && pattern.starts_with("axes.") && pattern.contains(other))
}

/// The path of a key and of every table around it that has a fixed name.
fn prefixes(pattern: &str) -> impl Iterator<Item = &str> {
    let ends = pattern
        .match_indices('.')
        .map(|(i, _)| i)
        .chain([pattern.len()]);
    let named = |p: &&str| is_open(p) || !p.rsplit('.').next().is_some_and(is_placeholder);
    ends.map(|end| &pattern[..end]).filter(named)
}

fn candidate(pattern: &str, name: &str, table: &[&str]) -> Candidate {
    let parts: Vec<_> = pattern.split('.').collect();
    let (last, parents) = parts.split_last().unwrap_or((&"", &[]));
    let same_table = parents.len() == table.len() && agree(pattern, table);
    if is_open(pattern) {
        // Meant only where the key stands beside the plugin's name.
        let beside = parents.len() == table.len() + 1 && !table.is_empty() && agree(pattern, table);
        let cost = if beside { PLUGINS_OWN } else { usize::MAX };
        let path = written(parents, name, table);
        return Candidate {
            cost,
            nearest: Nearest {
                path,
                same_table,
                close: true,
            },
        };
    }
    let edits = distance(name, last);
    let cost = if same_table {
        edits
    } else {
        edits + OTHER_TABLE
    };
    let nearest = Nearest {
        path: written(parents, last, table),
        same_table,
        close: is_close(name, edits),
    };
    Candidate { cost, nearest }
}

/// The path as it would be written: placeholders take the names of the table in which the unknown key stands.
fn written(parents: &[&str], last: &str, table: &[&str]) -> String {
    let pattern = parents.join(".");
    let part = |(index, part): (usize, &&str)| {
        let same = index < table.len() && agree(&pattern, &table[..=index]);
        if same {
            dotted(&table[index..=index])
        } else {
            (*part).to_owned()
        }
    };
    let mut path: Vec<_> = parents.iter().enumerate().map(part).collect();
    path.push(dotted(&[last]));
    path.join(".")
}

/// Edits from one name to the other. A name without its end, as in `max_feed`, is one edit away; one that is part of
/// the other, as in `speed_difference`, two.
fn distance(name: &str, known: &str) -> usize {
    let part = name.len() >= 3 && known.contains(name);
    match part {
        true if known == name => 0,
        true if known.starts_with(name) => 1,
        true => 2,
        false => damerau_levenshtein(name, known),
    }
}
