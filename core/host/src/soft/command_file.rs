//! Command files: what the operator does, by tick.

use crate::soft::command::{Command, Timed};

/// Errors of a command file that are told one by one.
const MAX_ERRORS: usize = 100;

/// Reads a command file; lines that are empty or begin with # are left out. `name` is for refusals; `max_feed_ratio` is
/// the highest feed ratio that the machine plans for. Host, before the run; allocates.
///
/// # Errors
/// Every line that is wrong, with file, line and cause: no command, a value out of its range, a tick before that of the
/// line above.
pub fn parse_commands(name: &str, text: &str, max_feed_ratio: f64) -> Result<Vec<Timed>, String> {
    let (mut commands, mut errors): (Vec<Timed>, Vec<String>) = (vec![], vec![]);
    let told = |(_, line): &(usize, &str)| !line.trim().is_empty() && !line.starts_with('#');
    for (number, line) in (1..).zip(text.lines()).filter(told) {
        let at = |cause: String| format!("{name}:{number}: {cause}");
        let allowed = |timed: Timed| match timed.command {
            Command::Reset => Err(
                "a fault ends its run, so there is none to reset in it: run --reset does before it"
                    .into(),
            ),
            command => command.check(max_feed_ratio).map(|()| timed),
        };
        match (Timed::parse(line).and_then(allowed), commands.last()) {
            (Err(cause), _) => errors.push(at(cause)),
            (Ok(now), Some(last)) if now.tick < last.tick => {
                errors.push(at(format!(
                    "tick {} comes after tick {}",
                    now.tick, last.tick
                )));
            }
            (Ok(now), _) => commands.push(now),
        }
    }
    if errors.is_empty() {
        Ok(commands)
    } else {
        Err(listed(&errors))
    }
}

/// The first errors, a line each, and how many more there are.
fn listed(errors: &[String]) -> String {
    let first = errors[..errors.len().min(MAX_ERRORS)].join("\n");
    match errors.len() - errors.len().min(MAX_ERRORS) {
        0 => first,
        more => format!("{first}\nand {more} more"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_wrong_line_is_named() {
        let text = "# by hand\n5,hold\n\n4,resume\n6,feed-override,1.3\n7,hodl\n8,reset\n";
        let errors = parse_commands("c.csv", text, 1.2).unwrap_err();
        let lines: Vec<&str> = errors.lines().collect();
        assert_eq!(lines.len(), 4, "{errors}");
        assert!(
            lines[3].starts_with("c.csv:7: a fault ends its run"),
            "{errors}"
        );
        assert!(
            lines[0].starts_with("c.csv:4: tick 4 comes after tick 5"),
            "{errors}"
        );
        assert!(
            lines[1].starts_with("c.csv:5: a feed override of 1.3"),
            "{errors}"
        );
        assert!(
            lines[2].starts_with("c.csv:6: no command is called"),
            "{errors}"
        );
    }
}
