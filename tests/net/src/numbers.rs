//! Numbers in what is compared: those that differ from run to run, and texts without them.

use serde_json::Value;

/// Keys of the summary that depend on the computer and not on the run, and those below them.
const OF_THE_COMPUTER: [&str; 6] = [
    "wall_time_s",
    "planning_ns_per_block",
    "planning_us",
    "lateness_us",
    "exchange_us",
    "page_faults",
];
/// Keys of the summary that say whether limits were kept and motion was disturbed.
pub const COUNTS: [&str; 8] = [
    "limit_violations",
    "guard_stops",
    "governed_samples",
    "jerk_relaxed_samples",
    "starvations",
    "lost_samples",
    "stop_count",
    "blocks",
];

/// Keys and values that are no tables, by their paths, without those of the computer.
pub fn leaves(value: &Value) -> Vec<(String, String)> {
    let mut found = Vec::new();
    collect("", value, &mut found);
    found
}

fn collect(path: &str, value: &Value, found: &mut Vec<(String, String)>) {
    match value {
        Value::Object(map) => {
            for (key, value) in map
                .iter()
                .filter(|(key, _)| !OF_THE_COMPUTER.contains(&key.as_str()))
            {
                collect(&format!("{path}.{key}"), value, found);
            }
        }
        Value::Array(values) => {
            for (index, value) in values.iter().enumerate() {
                collect(&format!("{path}.{index}"), value, found);
            }
        }
        value => found.push((path.to_string(), value.to_string())),
    }
}

/// The text with `#` for every number.
pub fn without_numbers(text: &str) -> String {
    let mut masked = String::new();
    let mut inside = false;
    for letter in text.chars() {
        let part = letter.is_ascii_digit() || (inside && letter == '.');
        if !part {
            masked.push(letter);
        } else if !inside {
            masked.push('#');
        }
        inside = part;
    }
    masked
}

#[cfg(test)]
mod tests {
    use super::{leaves, without_numbers};

    #[test]
    fn numbers_are_masked_and_words_are_not() {
        assert_eq!(
            without_numbers("81 blocks, 170.237 mm in 2.775 s."),
            "# blocks, # mm in # s."
        );
    }

    #[test]
    fn what_depends_on_the_computer_is_left_out() {
        let summary = serde_json::json!({"a": {"b": 1}, "planning_us": {"max": 3}, "c": [2, null]});
        let expected = [(".a.b", "1"), (".c.0", "2"), (".c.1", "null")];
        assert_eq!(
            leaves(&summary),
            expected.map(|(path, value)| (path.to_string(), value.to_string()))
        );
    }
}
