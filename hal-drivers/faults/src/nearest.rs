//! The known name nearest to an unknown one.

/// `unknown key; did you mean …` or the list of what there is.
pub fn unknown(what: &str, name: &str, known: &[&str]) -> String {
    match tandem_machine::meant(name, known) {
        Some(nearest) => format!("unknown {what} `{name}`; did you mean `{nearest}`?"),
        None => format!("unknown {what} `{name}`; there is {}", known.join(", ")),
    }
}
