//! Controls that bound jerk or round corners: calibrated as planners, from times that are read badly.

use std::path::Path;

use tandem_estimate::diagnose::{Fitted, fit_all};
use tandem_estimate::experiment::Experiment;
use tandem_estimate::measurements;
use tandem_estimate::planned::{Bench, Planned, PlannerKind, fit};
use tandem_estimate::polygon::{PlaneAxis, Polygon, Timed};
use tandem_estimate::{Choice, estimate, model_file};
use tandem_gcode::Program;
use tandem_host::{Clock, Registry, Switches};
use tandem_machine::Machine;
use tandem_rig::Random;

use crate::tie::registry;

/// Blocks to each polygon: as many as `tandem calibrate` drives.
const BLOCKS: u32 = 400;

/// Everything, and not a part of it.
fn every() -> bool {
    std::env::var_os("TANDEM_EVERY").is_some()
}

fn machine(overrides: &[(&str, String)]) -> Machine {
    let file =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/machines/mill-3axis.toml");
    let pairs = overrides
        .iter()
        .map(|(key, value)| ((*key).to_string(), value.clone()));
    Machine::read(&file, &pairs.collect::<Vec<_>>()).unwrap()
}

fn with_planners() -> Registry {
    let mut registry = registry();
    registry.register(tandem_smooth::PLUGIN).unwrap();
    registry
}

/// A control that is not known to who calibrates it.
struct Control {
    name: &'static str,
    machine: Machine,
}

/// Limits of an axis as a machine file states them: acceleration, mm/s², and jerk, mm/s³.
type Limits = [f64; 2];

/// Four controls with limits, a tolerance and a time constant that are drawn. An axis that no polygon moves has the lesser limits, as a
/// calibration takes them to be.
fn controls(random: &mut Random) -> Vec<Control> {
    let mut drawn = || {
        let acceleration = random.length(200.0, 4000.0);
        [acceleration, acceleration * random.length(6.0, 80.0)]
    };
    let (first, second): (Limits, Limits) = (drawn(), drawn());
    let least = [0, 1].map(|n| first[n].min(second[n]));
    let tolerance_mm = random.length(0.003, 0.05);
    let constant_ms = random.length(10.0, 80.0);
    let control = |name, plugin: &str, y: Limits, z: Limits| {
        let mut keys = vec![
            ("planner.plugin", plugin.to_string()),
            ("motion.path_tolerance_mm", format!("{tolerance_mm:.4}")),
            ("motion.time_constant_ms", format!("{constant_ms:.1}")),
        ];
        if plugin == "smooth" {
            keys.push(("motion.jerk", "limit".to_string()));
        }
        for (acceleration, jerk, limits) in [
            (
                "axes.x.max_acceleration_mm_per_s2",
                "axes.x.max_jerk_mm_per_s3",
                first,
            ),
            (
                "axes.y.max_acceleration_mm_per_s2",
                "axes.y.max_jerk_mm_per_s3",
                y,
            ),
            (
                "axes.z.max_acceleration_mm_per_s2",
                "axes.z.max_jerk_mm_per_s3",
                z,
            ),
        ] {
            keys.push((acceleration, format!("{:.1}", limits[0])));
            keys.push((jerk, format!("{:.1}", limits[1])));
        }
        Control {
            name,
            machine: machine(&keys),
        }
    };
    vec![
        control("smooth", "smooth", first, first),
        control("smooth, unequal axes", "smooth", second, least),
        control("block-overlap", "block-overlap", first, first),
        control(
            "block-overlap, unequal axes",
            "block-overlap",
            second,
            least,
        ),
    ]
}

/// Programs that no polygon is like: name and text. They state no tolerance, so that the control's own counts.
fn programs() -> Vec<(String, String)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/programs");
    let names: &[&str] = if every() {
        &["raster", "serpentine", "spiral", "square", "two-step-arcs"]
    } else {
        &["serpentine", "two-step-arcs", "square"]
    };
    let feeds: &[u32] = if every() {
        &[1000, 3000, 5000]
    } else {
        &[3000, 5000]
    };
    let mut all = vec![];
    for name in names {
        let text = std::fs::read_to_string(folder.join(format!("{name}.ngc"))).unwrap();
        for feed in feeds {
            let lines = text.lines().map(|line| match line {
                line if line.starts_with("G64") => "G64".to_string(),
                line if line.starts_with('F') => format!("F{feed}"),
                line => line.to_string(),
            });
            let text: String = lines.map(|line| line + "\n").collect();
            all.push((format!("{name} F{feed}"), text));
        }
    }
    all
}

fn takes_s(machine: &Machine, registry: &Registry, text: &str, choice: &Choice) -> f64 {
    let program = Program::spool("fresh", text.as_bytes()).unwrap();
    let found = estimate(machine, registry, program, Switches::default(), choice);
    found.unwrap().estimated_s
}

/// A fit plans for a minute: `TANDEM_FITS=1 cargo test -p tandem-estimate --test suite planned -- --nocapture` drives one control,
/// another in each run, `TANDEM_EVERY=1` all of them, and with `TANDEM_FITS="smooth, unequal axes"` as well that one.
#[test]
fn a_control_that_bounds_jerk_is_found_from_noisy_readings() {
    if !every() && std::env::var_os("TANDEM_FITS").is_none() {
        return;
    }
    let (mut random, registry) = (Random::from_the_clock(), with_planners());
    let mut controls = controls(&mut random);
    let named = std::env::var("TANDEM_FITS").unwrap_or_default();
    if controls.iter().any(|control| control.name == named) {
        controls.retain(|control| control.name == named);
    } else if !every() {
        // One of them, another in each run.
        let one = random.below(controls.len() as u64) as usize;
        controls = vec![controls.swap_remove(one)];
    }
    for Control {
        name,
        machine: real,
    } in &controls
    {
        for noise in if every() {
            vec![0.005, 0.02]
        } else {
            vec![0.01]
        } {
            let mut experiment = Experiment::new(real, BLOCKS).unwrap();
            if !every() {
                experiment
                    .polygons
                    .retain(|p| p.is_stroke() || p.corners <= 36 && p.side_mm <= 2.0);
            }
            let measured = experiment.run(real, &registry, Clock::Virtual).unwrap();
            let read = |timed: &Timed| Timed {
                time_s: timed.time_s * (1.0 + noise * random.between(-1.0, 1.0)),
                ..*timed
            };
            let timed: Vec<_> = measured.timed.iter().map(read).collect();
            let closed = fit_all(&timed, None);
            assert!(closed.iter().all(Fitted::is_loose), "{name}: {closed:?}");
            // Who calibrates has a machine file with other limits.
            let own = machine(&[]);
            let fits = PlannerKind::ALL.map(|kind| {
                let (planned, times_s) = fit(&own, &registry, &timed, kind).unwrap();
                Fitted::with_times(Choice::Planned(planned), &times_s, &timed)
            });
            for fitted in &fits {
                println!(
                    "{name}, {noise}: rms {:.4}, {}",
                    fitted.rms,
                    fitted.constants()
                );
            }
            let best = fits
                .into_iter()
                .min_by(|a, b| a.rms.total_cmp(&b.rms))
                .unwrap();
            assert!(best.is_good(), "{name}: {best:?}");
            // As it is written and read again.
            let text = model_file::write(&best.choice, "here").unwrap();
            let choice = model_file::parse("model.toml", &text).unwrap();
            assert_eq!(choice, best.choice, "{text}");
            let mut errors = vec![];
            for (program, text) in programs() {
                let real_s = takes_s(real, &registry, &text, &Choice::Simulate);
                let found_s = takes_s(&own, &registry, &text, &choice);
                let error = found_s / real_s - 1.0;
                println!(
                    "| {name} | {noise} | {program} | {real_s:.3} | {:+.2} |",
                    100.0 * error
                );
                errors.push(error.abs());
            }
            errors.sort_by(f64::total_cmp);
            let (median, worst) = (errors[errors.len() / 2], errors[errors.len() - 1]);
            println!("{name}, {noise}: median {median:.4}, worst {worst:.4}");
            assert!(median <= 0.01 && worst <= 0.02, "{name}: {median} {worst}");
        }
    }
}

/// Block-overlap, which plans fast: two axes of unequal acceleration are told apart from readings that are 1 % off.
#[test]
fn axes_of_unequal_acceleration_are_told_apart() {
    let (mut random, own, registry) = (Random::from_the_clock(), machine(&[]), with_planners());
    let polygon = |(corners, side_mm)| Timed {
        polygon: Polygon {
            corners,
            side_mm,
            rounds: 120 / corners,
            along: PlaneAxis::X,
            feed_mm_per_s: 5000.0 / 60.0,
            exact_stop: false,
        },
        time_s: 1.0,
        reading_error_s: 0.0,
    };
    let each = [3, 4, 5, 6, 8, 9, 12, 18].map(|n| [1.0, 2.0, 4.0].map(|side_mm| (n, side_mm)));
    let mut timed: Vec<Timed> = each.into_iter().flatten().map(polygon).collect();
    let mut real = Planned::of(&own, PlannerKind::BlockOverlap);
    let weaker = random.length(150.0, 300.0);
    real.acceleration_mm_per_s2[..2].copy_from_slice(&[3.0 * weaker, weaker]);
    let bench = Bench::new(&own, &registry, &timed, 120).unwrap();
    for (timed, time_s) in timed.iter_mut().zip(bench.times_s(&real).unwrap()) {
        timed.time_s = time_s * (1.0 + 0.01 * random.between(-1.0, 1.0));
    }
    let (found, _) = fit(&own, &registry, &timed, PlannerKind::BlockOverlap).unwrap();
    println!("of {}: {}", real.constants(), found.constants());
    for (found, real) in found.acceleration_mm_per_s2[..2]
        .iter()
        .zip(real.acceleration_mm_per_s2)
    {
        assert!((found / real - 1.0).abs() < 0.1, "{found} {real}");
    }
}

/// Where a search begins at an acceleration that no line reaches, it sees nothing of it: for these axes one that begins at 1000 mm/s² ends
/// there.
#[test]
fn an_acceleration_that_only_long_lines_reach_is_found() {
    let (own, registry) = (machine(&[]), with_planners());
    let experiment = Experiment::new(&own, 24).unwrap();
    let polygons = experiment.polygons.iter().filter(|p| p.is_stroke());
    let mut timed: Vec<Timed> = polygons
        .map(|polygon| Timed {
            polygon: *polygon,
            time_s: 1.0,
            reading_error_s: 0.0,
        })
        .collect();
    let mut real = Planned::of(&own, PlannerKind::Smooth);
    real.acceleration_mm_per_s2[..2].copy_from_slice(&[250.0, 1600.0]);
    real.jerk_mm_per_s3[..2].copy_from_slice(&[3145.0, 32_000.0]);
    let bench = Bench::new(&own, &registry, &timed, 24).unwrap();
    for (timed, time_s) in timed.iter_mut().zip(bench.times_s(&real).unwrap()) {
        timed.time_s = time_s;
    }
    let (found, _) = fit(&own, &registry, &timed, PlannerKind::Smooth).unwrap();
    println!("of {}: {}", real.constants(), found.constants());
    let pairs = [
        (found.acceleration_mm_per_s2, real.acceleration_mm_per_s2),
        (found.jerk_mm_per_s3, real.jerk_mm_per_s3),
    ];
    for (found, real) in pairs {
        for axis in 0..2 {
            assert!((found[axis] / real[axis] - 1.0).abs() < 0.03, "axis {axis}");
        }
    }
}

/// In lines of a low acceleration no time constant shows: it is that of the polygons, and whole periods of it are told apart.
#[test]
fn a_time_constant_that_no_line_shows_is_found() {
    let (own, registry) = (machine(&[]), with_planners());
    let experiment = Experiment::new(&own, 120).unwrap();
    let few = |p: &&Polygon| p.is_stroke() || p.corners <= 36 && p.side_mm <= 2.0;
    let polygons = experiment.polygons.iter().filter(few);
    let mut timed: Vec<Timed> = polygons
        .map(|polygon| Timed {
            polygon: *polygon,
            time_s: 1.0,
            reading_error_s: 0.0,
        })
        .collect();
    let mut real = Planned::of(&own, PlannerKind::BlockOverlap);
    real.acceleration_mm_per_s2 = [234.0; tandem_sdk::MAX_AXES];
    real.path_tolerance_mm = 0.0147;
    real.time_constant_s = 0.036;
    let bench = Bench::new(&own, &registry, &timed, 120).unwrap();
    for (timed, time_s) in timed.iter_mut().zip(bench.times_s(&real).unwrap()) {
        timed.time_s = time_s;
    }
    let (found, _) = fit(&own, &registry, &timed, PlannerKind::BlockOverlap).unwrap();
    println!("of {}: {}", real.constants(), found.constants());
    assert!((found.time_constant_s / real.time_constant_s - 1.0).abs() < 0.1);
    assert!((found.acceleration_mm_per_s2[0] / 234.0 - 1.0).abs() < 0.02);
}

/// Two unequal axes that are exchanged leave the times of polygons nearly as they are, and not those of strokes.
#[test]
fn strokes_tell_which_axis_is_the_weaker_one() {
    let (own, registry) = (machine(&[]), with_planners());
    let experiment = Experiment::new(&own, 24).unwrap();
    let round = |p: &&Polygon| p.corners >= 8 && p.corners <= 18 && p.side_mm >= 1.0;
    let fast = |p: &&Polygon| p.is_stroke() && p.feed_mm_per_s > 50.0;
    let (strokes, rounds): (Vec<_>, Vec<_>) = experiment
        .polygons
        .iter()
        .filter(|p| fast(p) || round(p))
        .map(|polygon| Timed {
            polygon: *polygon,
            time_s: 1.0,
            reading_error_s: 0.0,
        })
        .partition(|timed| timed.polygon.is_stroke());
    let mut real = Planned::of(&own, PlannerKind::Smooth);
    real.acceleration_mm_per_s2[..2].copy_from_slice(&[500.0, 1500.0]);
    real.jerk_mm_per_s3[..2].copy_from_slice(&[10_000.0, 30_000.0]);
    let mut exchanged = real.clone();
    exchanged.acceleration_mm_per_s2.swap(0, 1);
    exchanged.jerk_mm_per_s3.swap(0, 1);
    let ratios = |timed: &[Timed]| -> Vec<f64> {
        let bench = Bench::new(&own, &registry, timed, 24).unwrap();
        let times = [&real, &exchanged].map(|planned| bench.times_s(planned).unwrap());
        let pairs = times[0].iter().zip(&times[1]);
        pairs.map(|(one, other)| one / other).collect()
    };
    let (strokes, rounds) = (ratios(&strokes), ratios(&rounds));
    println!("{strokes:?} {rounds:?}");
    assert_eq!((strokes.len(), rounds.len()), (12, 12));
    for along in strokes.chunks(2) {
        assert!(along[0] > 1.1 && along[1] < 0.9);
    }
    assert!(rounds.iter().all(|ratio| (ratio - 1.0).abs() < 0.1));
}

#[test]
fn readings_say_how_far_they_may_be_off() {
    let text = "n,side_mm,repetitions,seconds,reading_error_s\n3,0.1,10,1,0.1\n4,0.1,10,1,\n5,0.1,10,1,0.001\n\
                6,0.1,10,1,0.1\n8,0.1,10,1,0.1\n9,0.1,10,1,0.1\n";
    let timed = measurements::parse("readings.csv", text.as_bytes()).unwrap();
    assert_eq!(
        (timed[0].reading_error_s, timed[1].reading_error_s),
        (0.1, 0.0)
    );
    assert_eq!(
        (timed[0].weight(), timed[1].weight(), timed[2].weight()),
        (0.02, 1.0, 1.0)
    );
    let wrong = text.replacen("0.1,10,1,0.1", "0.1,10,1,2", 1);
    let refused = measurements::parse("readings.csv", wrong.as_bytes()).unwrap_err();
    assert!(
        refused.starts_with("readings.csv:2: reading_error_s: 2"),
        "{refused}"
    );
    let strokes = "n,side_mm,repetitions,seconds,axis\n3,0.1,10,1,\n4,0.1,10,1,\n5,0.1,10,1,\n6,0.1,10,1,\n2,8,10,1,X\n2,8,10,1,y\n";
    let timed = measurements::parse("strokes.csv", strokes.as_bytes()).unwrap();
    assert_eq!(timed[4].polygon.along, PlaneAxis::X);
    assert_eq!(timed[5].polygon.along, PlaneAxis::Y);
    for (from, to, words) in [
        ("1,y", "1,", "strokes.csv:7: axis: \"\" is neither"),
        (
            "axis\n3,0.1,10,1,",
            "exact_stop\n3,0.1,10,1,2",
            "strokes.csv:2: exact_stop: 2 is neither",
        ),
        (
            "3,0.1,10,1,",
            "3,0.1,10,1,Y",
            "strokes.csv:2: axis: \"Y\" belongs to",
        ),
        (
            "2,8,10,1,X",
            "1,8,10,1,X",
            "strokes.csv:6: n: a polygon has 2 corners",
        ),
    ] {
        let refused = measurements::parse("strokes.csv", strokes.replace(from, to).as_bytes());
        let refused = refused.unwrap_err();
        assert!(refused.starts_with(words), "{refused}");
    }
    let rows =
        "turn_deg,feed_mm_per_min,min_feed_mm_per_min,reading_error_mm_per_min\n60,2000,1755,20\n";
    let corner = measurements::parse_corners("corners.csv", rows.as_bytes()).unwrap()[0];
    assert!((corner.min_mm_per_s - 29.25).abs() < 1e-12);
    assert!((corner.reading_error_mm_per_s * 60.0 - 20.0).abs() < 1e-12);
    let refused = measurements::parse_corners("c.csv", rows.replace("1755", "2755").as_bytes());
    assert!(
        refused
            .unwrap_err()
            .starts_with("c.csv:2: min_feed_mm_per_min: 2755")
    );
}

#[test]
fn a_model_file_of_a_planner_is_read_key_by_key() {
    let good = "format = 1\nmodel = \"smooth\"\n[smooth]\nacceleration_mm_per_s2 = [300, 900, 500]\n\
                jerk_mm_per_s3 = 1e4\npath_tolerance_mm = 0.01\n";
    let Ok(Choice::Planned(planned)) = model_file::parse("m.toml", good) else {
        panic!("refused")
    };
    assert_eq!(
        planned.acceleration_mm_per_s2[..4],
        [300.0, 900.0, 500.0, 300.0]
    );
    for (from, to, words) in [
        (
            "jerk_mm_per_s3 = 1e4",
            "time_constant_ms = 3",
            "smooth.jerk_mm_per_s3: missing",
        ),
        ("jerk_mm_per_s3 = 1e4", "jerk_mm_per_s3 = 0", "m.toml:5:"),
        (
            "path_tolerance_mm = 0.01",
            "path_tolerance_mm = -1",
            "is not above zero",
        ),
        (
            "[smooth]",
            "rapid_acceleration_mm_per_s2 = 5\n[smooth]",
            "one acceleration for all",
        ),
        (
            "model = \"smooth\"",
            "model = \"block-overlap\"",
            "names another form",
        ),
    ] {
        let refused = model_file::parse("m.toml", &good.replace(from, to)).unwrap_err();
        assert!(refused.to_string().contains(words), "{refused}");
    }
}
