//! Any bytes as a command file: what is read is in order, within what the machine plans for, and written as it is read.

use tandem_host::parse_commands;

const MAX_FEED_RATIO: f64 = 1.2;

/// Judges one input; what is no text is none.
///
/// # Panics
/// The reader broke what it promises.
pub fn judge(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else {
        return;
    };

    let commands = match parse_commands("commands.csv", text, MAX_FEED_RATIO) {
        Ok(commands) => commands,
        Err(causes) => {
            assert!(
                causes
                    .lines()
                    .all(|cause| cause.starts_with("commands.csv:") || cause.starts_with("and "))
            );
            return;
        }
    };
    assert!(commands.is_sorted_by_key(|timed| timed.tick));
    assert!(
        commands
            .iter()
            .all(|timed| timed.command.check(MAX_FEED_RATIO).is_ok())
    );
    let written: Vec<String> = commands.iter().map(ToString::to_string).collect();
    assert_eq!(
        parse_commands("written", &written.join("\n"), MAX_FEED_RATIO).as_ref(),
        Ok(&commands)
    );
}
