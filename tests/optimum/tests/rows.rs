//! A few programs of each row: every limit kept, and no farther from the shortest time than the table says.

use tandem_optimum::table::{median, rows};

/// Programs of a row.
const COUNT: usize = 6;

/// Largest median and largest ratio of times.
fn ratios(name: &str) -> (f64, f64) {
    let folder = tempfile::tempdir().unwrap();
    let row = rows().into_iter().find(|row| row.name == name).unwrap();
    let results: Vec<_> = (1000..1100)
        .filter_map(|seed| row.run(seed, folder.path()))
        .take(COUNT)
        .collect();
    assert_eq!(results.len(), COUNT);
    for result in &results {
        assert_eq!(result.verdict, "clean", "{name} {}", result.seed);
        println!(
            "{name} {}: {:.4}",
            result.seed,
            result.time_s / result.best_s
        );
    }
    let mut ratios: Vec<f64> = results.iter().map(|r| r.time_s / r.best_s).collect();
    ratios.sort_by(f64::total_cmp);
    (median(&ratios), ratios[COUNT - 1])
}

#[test]
fn smooth_at_a_micrometre_is_near_the_exact_curve() {
    let (middle, worst) = ratios("smooth-curves-1um");
    // The worst is one curve, which takes 1.237 or 1.253 by where its windows happen to begin.
    assert!(middle < 1.08 && worst < 1.27, "{middle} {worst}");
}

/// At a jump of curvature what is over the jerk limit goes with the square of the speed: taken from the jerk beside it, no try kept
/// the limits of these curves, and they were driven by ramps.
#[test]
fn curves_are_not_left_to_ramps_for_a_jump_of_curvature() {
    let folder = tempfile::tempdir().unwrap();
    for (name, seeds) in [
        ("scan-jumps-gentle", [1016, 1018]),
        ("scan-jumps-paper", [1014, 1036]),
    ] {
        let row = rows().into_iter().find(|row| row.name == name).unwrap();
        for seed in seeds {
            let result = row.run(seed, folder.path()).unwrap();
            let ratio = result.time_s / result.best_s;
            assert_eq!(result.verdict, "clean", "{name} {seed}");
            assert!(ratio < 1.05, "{name} {seed}: {ratio}");
        }
    }
}

#[test]
fn scan_is_near_the_shortest_time() {
    for (name, most, greatest) in [
        ("scan-paper", 1.01, 1.03),
        ("scan-gentle", 1.012, 1.02),
        ("scan-jumps-gentle", 1.03, 1.05),
    ] {
        let (middle, worst) = ratios(name);
        assert!(
            middle < most && worst < greatest,
            "{name}: {middle} {worst}"
        );
    }
}
