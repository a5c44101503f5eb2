//! `tandem completions` and `tandem man`: what shells and `man` know of the command, made from its own options.

use std::io::{self, Write};

use clap::CommandFactory;
use clap_complete::Shell;
use clap_mangen::Man;

use crate::args::Args;

/// Prints the completions for a shell.
pub fn completions(shell: Shell) -> u8 {
    let mut text = Vec::new();
    clap_complete::generate(shell, &mut Args::command(), "tandem", &mut text);
    // A reader that has gone away is no reason to fail.
    let _ = io::stdout().write_all(&text);
    0
}

/// Prints the manual page: the command, then each subcommand.
pub fn man() -> io::Result<u8> {
    let mut command = Args::command();
    command.build();
    let mut text = Vec::new();
    Man::new(command.clone()).render(&mut text)?;
    let mut path = String::from("tandem");
    of_subcommands(&command, &mut path, &mut text)?;
    let _ = io::stdout().write_all(&text);
    Ok(0)
}

fn of_subcommands(
    command: &clap::Command,
    path: &mut String,
    text: &mut Vec<u8>,
) -> io::Result<()> {
    for sub in command
        .get_subcommands()
        .filter(|sub| sub.get_name() != "help")
    {
        let parent = path.len();
        path.push(' ');
        path.push_str(sub.get_name());
        writeln!(text, ".SH \"{}\"", path.to_uppercase())?;
        writeln!(
            text,
            "{}",
            sub.get_about().map(ToString::to_string).unwrap_or_default()
        )?;
        let man = Man::new(sub.clone());
        // A page of its own would begin with its title; here it is a part of one.
        for part in [Man::render_synopsis_section, Man::render_options_section] {
            let mut section = Vec::new();
            part(&man, &mut section)?;
            let section = String::from_utf8_lossy(&section).replace(".SH", ".SS");
            text.extend_from_slice(section.as_bytes());
        }
        of_subcommands(sub, path, text)?;
        path.truncate(parent);
    }
    Ok(())
}
