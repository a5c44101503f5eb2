//! The table: `cargo run --release -p tandem-optimum -- --count 40`.

use clap::Parser;
use tandem_optimum::table::{median, rows};

/// Compares planners with the shortest time, on fresh programs.
#[derive(Parser)]
struct Arguments {
    /// Programs a row.
    #[arg(long, default_value_t = 40)]
    count: u64,
    /// Seed of the first one.
    #[arg(long, default_value_t = 1000)]
    seed: u64,
    /// Only rows whose name has this in it.
    #[arg(long, default_value = "")]
    row: String,
    /// An option of the planner, as `grid_ms=3`; may be repeated.
    #[arg(long = "option", value_parser = key_and_value)]
    options: Vec<(String, String)>,
    /// A line for each program.
    #[arg(long)]
    each: bool,
}

fn key_and_value(text: &str) -> Result<(String, String), String> {
    let (key, value) = text.split_once('=').ok_or("key=value is expected")?;
    Ok((key.to_string(), value.to_string()))
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments = Arguments::parse();
    let folder = tempfile::tempdir()?;
    println!(
        "| row | asked | median | nine tenths | worst | its seed | × real time, median | least | clean |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    for mut row in rows() {
        row.mill.options.clone_from(&arguments.options);
        if !row.name.contains(&arguments.row) {
            continue;
        }
        let mut results = vec![];
        let mut speeds = vec![];
        let mut seed = arguments.seed;
        while results.len() < arguments.count as usize
            && seed < arguments.seed + 3 * arguments.count
        {
            if let Some(result) = row.run(seed, folder.path()) {
                let speed = row.speed(seed, folder.path());
                if arguments.each {
                    println!(
                        "{} {:9} {:8.3} s, best {:8.3}, ratio {:.4}, {:5.0} × real time, {}",
                        result.seed,
                        result.kind,
                        result.time_s,
                        result.best_s,
                        result.time_s / result.best_s,
                        speed,
                        result.verdict
                    );
                }
                speeds.push(speed);
                results.push(result);
            }
            seed += 1;
        }
        results.sort_by(|a, b| (a.time_s / a.best_s).total_cmp(&(b.time_s / b.best_s)));
        let ratios: Vec<f64> = results.iter().map(|r| r.time_s / r.best_s).collect();
        speeds.sort_by(f64::total_cmp);
        let clean = results.iter().filter(|r| r.verdict == "clean").count();
        println!(
            "| {} | {} | {:.4} | {:.4} | {:.4} | {} | {:.0} | {:.0} | {clean} of {} |",
            row.name,
            row.asked,
            median(&ratios),
            ratios.get(9 * ratios.len() / 10).unwrap_or(&f64::NAN),
            ratios.last().unwrap_or(&f64::NAN),
            results.last().map_or(0, |r| r.seed),
            median(&speeds),
            speeds.first().unwrap_or(&f64::NAN),
            results.len(),
        );
    }
    Ok(())
}
