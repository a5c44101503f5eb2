//! Tests over many seeds or ticks: a failing one says with which command it is replayed.

/// Tries each of `values`, or the one that the environment `variable` names, and gives how many were tried. `test` is the name of the
/// calling test.
pub fn for_each<T: std::fmt::Display + std::str::FromStr>(
    variable: &str,
    test: &str,
    values: impl Iterator<Item = T>,
    mut attempt: impl FnMut(&T) -> Result<(), String>,
) -> usize {
    let chosen = std::env::var(variable)
        .ok()
        .map(|text| text.parse().ok().expect("it is one of the test's values"));
    let values: Vec<T> = chosen.map_or_else(|| values.collect(), |value| vec![value]);
    for value in &values {
        attempt(value).unwrap_or_else(|cause| {
            let replay = format!("{variable}={value} cargo test -p tandem --test scenarios {test}");
            panic!("{variable} {value}: {cause}\nreplay with: {replay}")
        });
    }
    println!("{test}: {} runs", values.len());
    values.len()
}

/// Every `n`-th of `values`, beginning with one that is drawn and told; all of them where `TANDEM_EVERY` is set. The gate has not the
/// time for all in every run, and over its runs it has tried them.
pub fn some_of<T>(
    n: usize,
    test: &str,
    values: impl Iterator<Item = T>,
) -> impl Iterator<Item = T> {
    let is_long = std::env::var_os("TANDEM_EVERY").is_some();
    let drawn = std::time::SystemTime::UNIX_EPOCH
        .elapsed()
        .map_or(0, |now| now.subsec_nanos() as usize / 1000);
    let (n, from) = if is_long { (1, 0) } else { (n, drawn % n) };
    println!("{test}: one of {n}, from number {from} on; TANDEM_EVERY=1 tries all");
    values.skip(from).step_by(n)
}

/// Tries every tick of `ticks`, or the one that `TANDEM_TICK` names.
pub fn for_each_tick(
    test: &str,
    ticks: impl Iterator<Item = usize>,
    mut attempt: impl FnMut(usize) -> Result<(), String>,
) {
    for_each("TANDEM_TICK", test, ticks, |tick| attempt(*tick));
}

/// Seeds of which all are tried in each run.
const FEW_SEEDS: u64 = 10;

/// Tries the seeds 1 to `count`, of many a third; or the one that `TANDEM_SEED` names. `TANDEM_SEEDS` asks for another number of them.
/// Gives how many were tried.
pub fn for_each_seed(
    test: &str,
    count: u64,
    mut attempt: impl FnMut(u64) -> Result<(), String>,
) -> usize {
    let asked = std::env::var("TANDEM_SEEDS");
    let asked = asked.map(|text| text.parse().expect("a number of seeds"));
    let one_of = if asked.is_err() && count > FEW_SEEDS {
        3
    } else {
        1
    };
    let count = asked.unwrap_or(count);
    println!("{test}: seeds 1 to {count}, or TANDEM_SEED");
    let seeds = some_of(one_of, test, 1..=count);
    for_each("TANDEM_SEED", test, seeds, |seed| attempt(*seed))
}
