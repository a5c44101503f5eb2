//! The known name nearest to an unknown one.

/// `unknown key; did you mean …` or the list of what there is.
pub fn unknown(what: &str, name: &str, known: &[&str]) -> String {
    let nearest = known.iter().min_by_key(|k| strsim::damerau_levenshtein(name, k));
    let close = |known: &&&str| {
        let edits = strsim::damerau_levenshtein(name, known);
        known.starts_with(name) || edits <= (name.chars().count() / 3).max(2)
    };
    match nearest.filter(close) {
        Some(nearest) => format!("unknown {what} `{name}`; did you mean `{nearest}`?"),
        None => format!("unknown {what} `{name}`; there is {}", known.join(", ")),
    }
}
