//! Writes a demonstration: `cargo run -p tandem-report --example demo -- FILE.html [TURNS] [broken]`.

mod run;

use std::fs::File;
use std::io::{self, BufWriter};

fn main() -> io::Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let file = arguments.first().map_or("report.html", String::as_str);
    let turns = arguments
        .get(1)
        .and_then(|turns| turns.parse().ok())
        .unwrap_or(6);
    let broken = arguments.iter().any(|argument| argument == "broken");
    run::report(turns, broken).write(&mut BufWriter::new(File::create(file)?))
}
