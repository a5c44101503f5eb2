//! `tandem script bench`.

use std::error::Error;
use std::io::Write;
use std::path::Path;
use std::time::Instant;

use tandem_policy::{Bounds, Budget, Engine, Facts, Instance, Policy};
use tandem_sdk::Block;

use super::sample;

/// Measures compiling, starting and calling a script, and prints the times as a histogram.
pub fn bench(path: &Path, calls: usize) -> Result<u8, Box<dyn Error>> {
    let bytes = std::fs::read(path).map_err(|e| format!("{}: {e}", path.display()))?;
    let mut out = std::io::stdout().lock();
    let engine = Engine::new()?;
    let (script, compile_us) = timed(|| engine.compile(&bytes));
    let script = script.map_err(|e| format!("{}: {e}", path.display()))?;
    let (_, cached_us) = timed(|| engine.compile(&bytes));
    let facts = Facts {
        signals: sample::signals(&Instance::new(&script, &Budget::default(), &[])?),
        ..Facts::default()
    };
    let (policy, start_us) = timed(|| {
        Policy::new(
            script.clone(),
            vec![],
            Budget::default(),
            Bounds::default(),
            &facts,
        )
    });
    let mut policy = policy.map_err(|e| format!("{}: {e}", path.display()))?;
    writeln!(
        out,
        "compile {compile_us:.0} us, again from the cache {cached_us:.1} us, start {start_us:.0} us"
    )?;
    let window = sample::window();
    if script.tunes_blocks {
        let mut one = histogram(calls, |_| decide(&mut policy, &window[1..2]));
        print(
            &mut out,
            "a window of 1 block",
            &mut one,
            policy.counters().max_window_fuel,
        )?;
        let mut full = histogram(calls, |_| decide(&mut policy, &window));
        print(
            &mut out,
            "a window of 64 blocks",
            &mut full,
            policy.counters().max_window_fuel,
        )?;
    }
    if script.answers_periods {
        let mut periods = histogram(calls, |index| {
            policy.period(&sample::period(index as u64));
        });
        print(
            &mut out,
            "a rough period",
            &mut periods,
            policy.counters().max_period_fuel,
        )?;
    }
    for note in policy
        .take_notes()
        .iter()
        .filter(|note| note.contains("strike"))
    {
        writeln!(out, "{note}")?;
    }
    Ok(u8::from(policy.counters().troubles() > 0))
}

fn decide(policy: &mut Policy, blocks: &[Block]) {
    for block in blocks {
        policy.offer(block, None);
    }
    policy.decide(None);
}

/// A value and the time, us, that it took.
fn timed<T>(work: impl FnOnce() -> T) -> (T, f64) {
    let started = Instant::now();
    let value = work();
    (value, started.elapsed().as_secs_f64() * 1e6)
}

/// Times of `calls` calls, ns.
fn histogram(calls: usize, mut call: impl FnMut(usize)) -> Vec<u64> {
    let mut one = |index| {
        let started = Instant::now();
        call(index);
        started.elapsed().as_nanos() as u64
    };
    (0..calls).map(&mut one).collect()
}

fn print(out: &mut impl Write, what: &str, times_ns: &mut [u64], fuel: u64) -> std::io::Result<()> {
    times_ns.sort_unstable();
    let at = |share: f64| times_ns[((times_ns.len() - 1) as f64 * share) as usize];
    let (p50, p99, p999) = (at(0.5), at(0.99), at(0.999));
    writeln!(
        out,
        "{what}: p50 {p50} ns, p99 {p99}, p99.9 {p999}, max {}; most fuel {fuel}",
        at(1.0)
    )?;
    let mut bound_ns = 16;
    let mut rest = &times_ns[..];
    while !rest.is_empty() {
        let below = rest.partition_point(|time| *time < bound_ns);
        if below > 0 {
            let share = below as f64 / times_ns.len() as f64;
            writeln!(
                out,
                "  below {bound_ns:>9} ns {below:>9} {}",
                "#".repeat((share * 50.0).ceil() as usize)
            )?;
        }
        rest = &rest[below..];
        bound_ns *= 2;
    }
    Ok(())
}
