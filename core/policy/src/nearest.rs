//! The name that is nearest to one that does not exist, for messages. Machine files have the same with a threshold
//! (`tandem_machine::meant`): there a key far from every other gets no hint, here every name does.

use strsim::damerau_levenshtein;

/// Says which of `names` is nearest to `name`; `none` where there are no names.
pub fn nearest<'a>(name: &str, names: impl Iterator<Item = &'a str>, none: &str) -> String {
    let nearest = names.min_by_key(|known| damerau_levenshtein(known, name));
    nearest.map_or(none.to_string(), |nearest| {
        format!("the nearest is {nearest}")
    })
}
