//! Tests over many seeds or ticks: a failing one says with which command it is replayed.

/// Tries each of `values`, or the one that the environment `variable` names. `test` is the name of the calling test.
pub fn for_each<T: std::fmt::Display + std::str::FromStr>(
    variable: &str,
    test: &str,
    values: impl Iterator<Item = T>,
    mut attempt: impl FnMut(&T) -> Result<(), String>,
) {
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
}

/// Tries every tick of `ticks`, or the one that `TANDEM_TICK` names.
pub fn for_each_tick(
    test: &str,
    ticks: impl Iterator<Item = usize>,
    mut attempt: impl FnMut(usize) -> Result<(), String>,
) {
    for_each("TANDEM_TICK", test, ticks, |tick| attempt(*tick));
}

/// Tries the seeds 1 to `count`, or the one that `TANDEM_SEED` names. `TANDEM_SEEDS` asks for another number of them.
pub fn for_each_seed(test: &str, count: u64, mut attempt: impl FnMut(u64) -> Result<(), String>) {
    let count = std::env::var("TANDEM_SEEDS")
        .map_or(count, |text| text.parse().expect("a number of seeds"));
    println!("{test}: seeds 1 to {count}, or TANDEM_SEED");
    for_each("TANDEM_SEED", test, 1..=count, |seed| attempt(*seed));
}
