//! Jobs: the same wherever they are simulated, each recorded once, whatever happens meanwhile.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering::Relaxed};

use tandem_batch::{Bench, Build, Ended, Inputs, Job, Plugins, Results, Shard, simulate};
use tandem_host::Registry;
use tandem_machine::Machine;
use tandem_rig::files;
use tempfile::TempDir;

const PLUGINS: Plugins<'static> = Plugins {
    registry: &registry,
    ideal_drives: "sim",
};

fn registry() -> Result<Registry, String> {
    let mut registry = Registry::default();
    registry.register(tandem_look_ahead::PLUGIN)?;
    registry.register(tandem_smooth::PLUGIN)?;
    registry.register(tandem_sim::PLUGIN)?;
    Ok(registry)
}

/// A machine that names a tool table and a folder of subroutines, and a program that uses both.
fn write_machine(folder: &Path, rng: &mut fastrand::Rng) -> Machine {
    let planner = if rng.bool() { "smooth" } else { "look-ahead" };
    let mut text = format!(
        "format = 1\n[machine]\nname = \"random\"\n[loops]\nfine_period_ms = {}\n[motion]\npath_tolerance_mm = {}\n\
         allowable_speed_difference_mm_per_min = 0\njerk = \"{}\"\n\
         [tools]\ntable = \"tools.toml\"\n[program]\nsubroutine_path = \"subs\"\n[driver]\nplugin = \"sim\"\n[planner]\nplugin = \"{planner}\"\n",
        [1, 2][rng.usize(..2)],
        0.002 + 0.05 * rng.f64(),
        if planner == "smooth" {
            "limit"
        } else {
            "report"
        },
    );
    for axis in ["x", "y", "z"] {
        let (feed, acceleration, jerk) = (
            2000 + rng.u32(..20_000),
            200 + rng.u32(..3000),
            5000 + rng.u32(..50_000),
        );
        write!(
            text,
            "[axes.{axis}]\ntravel_mm = [-200, 200]\nmax_feed_mm_per_min = {feed}\nmax_rapid_mm_per_min = {feed}\n\
             max_acceleration_mm_per_s2 = {acceleration}\nmax_jerk_mm_per_s3 = {jerk}\n"
        )
        .unwrap();
    }
    fs::create_dir_all(folder.join("subs")).unwrap();
    fs::write(folder.join("machine.toml"), text).unwrap();
    fs::write(
        folder.join("tools.toml"),
        "[[tool]]\nnumber = 1\nlength_mm = 25\n",
    )
    .unwrap();
    fs::write(
        folder.join("subs/side.ngc"),
        "o<side> sub\nG1 X#1 Y#2\no<side> endsub\nM2\n",
    )
    .unwrap();
    Machine::read(&folder.join("machine.toml"), &[]).unwrap()
}

const PROGRAM: &str = "G21 G90 G64\nT1 G43 H1\nF3000\nG1 X10 Y0\no<side> call [20] [5]\nG2 X30 Y15 I0 J10\nG1 X0 Y0\nM2\n";

struct Fixture {
    folder: TempDir,
    inputs: Inputs,
    job: Job,
}

fn fixture(seed: u64) -> Fixture {
    let folder = tempfile::tempdir().unwrap();
    let inputs = Inputs::open(&folder.path().join("inputs")).unwrap();
    let machine = write_machine(folder.path(), &mut fastrand::Rng::with_seed(seed));
    let job = Job {
        program: inputs.put(PROGRAM.as_bytes()).unwrap(),
        machine: inputs.put_machine(&machine).unwrap(),
        set: vec![],
        block_delete: false,
    };
    Fixture {
        folder,
        inputs,
        job,
    }
}

#[test]
fn random_machines_are_the_same_job_in_every_folder_and_give_the_same_bytes() {
    let seed = fastrand::u64(..);
    for case in 0..6 {
        let seed = seed.wrapping_add(case);
        let (here, there) = (fixture(seed), fixture(seed));
        assert_eq!(here.job, there.job, "seed {seed}");
        // The folder that the machine came from is not needed any more.
        fs::remove_dir_all(there.folder.path().join("subs")).unwrap();
        fs::remove_file(there.folder.path().join("tools.toml")).unwrap();
        let [a, b] =
            [&here, &there].map(|fixture| simulate(&fixture.job, &fixture.inputs, &PLUGINS));
        let numbers = a.numbers().unwrap_or_else(|| panic!("seed {seed}: {a:?}"));
        assert!(numbers["motion_time_s"] > 0.3 && numbers["blocks"] >= 4.0);
        assert_eq!(
            serde_json::to_string(&a).unwrap(),
            serde_json::to_string(&b).unwrap(),
            "seed {seed}"
        );
    }
}

#[test]
fn what_is_refused_or_stops_says_why_in_the_same_words_everywhere() {
    let cases = [
        ("G21 G90\nF1000\nG1 X5 Q\nM2\n", vec![]),
        ("G21 G90\nF1000\nG1 X900\nM2\n", vec![]),
        (
            "G21 G90\nF1000\nG1 X5\nM2\n",
            vec![("motion.path_tolerance", "3")],
        ),
        (
            "G21 G90\nF1000\nG1 X5\nM2\n",
            vec![("planner.plugin", "none")],
        ),
    ];
    for (program, set) in cases {
        let ended = [1, 2].map(|_| {
            let fixture = fixture(3);
            let job = Job {
                program: fixture.inputs.put(program.as_bytes()).unwrap(),
                set: set
                    .iter()
                    .map(|(key, value)| (key.to_string(), value.to_string()))
                    .collect(),
                ..fixture.job
            };
            simulate(&job, &fixture.inputs, &PLUGINS)
        });
        assert!(
            matches!(&ended[0], Ended::Refused(cause) if !cause.is_empty()),
            "{:?}",
            ended[0]
        );
        assert_eq!(ended[0], ended[1]);
    }
}

#[test]
fn an_input_that_is_not_what_its_name_says_is_refused() {
    let fixture = fixture(4);
    fs::write(fixture.inputs.path(&fixture.job.program), "G1 X1\nM2\n").unwrap();
    let Ended::Refused(cause) = simulate(&fixture.job, &fixture.inputs, &PLUGINS) else {
        panic!("it was simulated");
    };
    assert!(cause.contains("not what its name says"), "{cause}");
}

/// Jobs that differ in a key.
fn jobs(fixture: &Fixture, count: usize) -> Vec<Job> {
    let set = |i: usize| {
        vec![(
            "motion.path_tolerance_mm".to_string(),
            format!("{}", 0.01 + 0.001 * i as f64),
        )]
    };
    (0..count)
        .map(|i| Job {
            set: set(i),
            ..fixture.job.clone()
        })
        .collect()
}

/// A bench that counts what it simulates and answers with a number of the job.
fn run(
    results: &Results,
    marks: &Path,
    jobs: &[Job],
    threads: usize,
    stop_after: usize,
) -> (Vec<Option<String>>, usize) {
    let (stop, begun) = (AtomicBool::new(false), AtomicUsize::new(0));
    let simulate = |job: &Job| {
        if begun.fetch_add(1, Relaxed) + 1 >= stop_after {
            stop.store(true, Relaxed);
        }
        Ended::Done([("tolerance".to_string(), job.set[0].1.parse().unwrap())].into())
    };
    let bench = Bench {
        results,
        marks,
        simulate: &simulate,
        threads,
        stop: &stop,
        tell: &|_| (),
    };
    let done = bench.run(jobs).unwrap();
    let text = |result: Option<tandem_batch::JobResult>| result.map(|result| result.text());
    (done.into_iter().map(text).collect(), begun.into_inner())
}

#[test]
fn what_was_interrupted_goes_on_where_it_was_and_is_recorded_once() {
    let (fixture, build) = (fixture(5), Build::of_this_process().unwrap());
    let (jobs, root) = (jobs(&fixture, 40), fixture.folder.path());
    let at = |name: &str| Results::open(&root.join(name), build.clone()).unwrap();
    let marks = root.join("begun");
    let (whole, all) = run(&at("whole"), &marks, &jobs, 1, usize::MAX);
    assert_eq!((all, files(&root.join("whole")).len()), (40, 40));
    for threads in [1, 2, 7] {
        let name = format!("results-{threads}");
        let (mut simulated, mut rounds) = (0, 0);
        loop {
            let (done, count) = run(&at(&name), &marks, &jobs, threads, 9);
            simulated += count;
            rounds += 1;
            if done.iter().all(Option::is_some) {
                assert_eq!(done, whole);
                break;
            }
        }
        assert!(rounds > 1);
        assert_eq!(simulated, 40, "nothing is done again");
        assert_eq!(files(&root.join(name)), files(&root.join("whole")));
    }
    assert_eq!(files(&marks).len(), 0);
}

#[test]
fn a_torn_result_is_computed_again() {
    let (fixture, build) = (fixture(6), Build::of_this_process().unwrap());
    let (jobs, root) = (jobs(&fixture, 3), fixture.folder.path());
    let folder = root.join("results");
    let results = Results::open(&folder, build).unwrap();
    let (first, _) = run(&results, &root.join("begun"), &jobs, 1, usize::MAX);
    let whole = files(&folder);
    for length in [0, 20] {
        let name = whole.keys().next().unwrap();
        fs::write(folder.join(name), &whole[name][..length]).unwrap();
        let (again, count) = run(&results, &root.join("begun"), &jobs, 1, usize::MAX);
        assert_eq!((count, &again), (1, &first));
        assert_eq!(files(&folder), whole);
    }
    // One that is whole but of another job, as a copied file would be, is none either.
    let names: Vec<&String> = whole.keys().collect();
    fs::copy(folder.join(names[0]), folder.join(names[1])).unwrap();
    assert_eq!(
        run(&results, &root.join("begun"), &jobs, 1, usize::MAX).1,
        1
    );
    assert_eq!(files(&folder), whole);
}

#[test]
fn a_job_that_ends_its_process_is_listed_after_three_times() {
    let (fixture, build) = (fixture(7), Build::of_this_process().unwrap());
    let (jobs, root) = (jobs(&fixture, 2), fixture.folder.path());
    let (results, marks) = (
        Results::open(&root.join("results"), build).unwrap(),
        root.join("begun"),
    );
    fs::create_dir_all(&marks).unwrap();
    for times in 1..=3 {
        fs::write(marks.join(jobs[0].id()), ".".repeat(times)).unwrap();
        if times < 3 {
            let (_, count) = run(&results, &marks, &jobs[..1], 1, usize::MAX);
            assert_eq!(count, 1);
            fs::remove_dir_all(root.join("results")).unwrap();
            fs::create_dir(root.join("results")).unwrap();
        }
    }
    let (_, count) = run(&results, &marks, &jobs, 1, usize::MAX);
    assert_eq!(count, 1, "only the other one is simulated");
    let lost = results.get(&jobs[0].id()).unwrap().ended;
    assert!(
        matches!(&lost, Ended::Lost(cause) if cause.contains("3 times")),
        "{lost:?}"
    );
}

#[test]
fn parts_of_an_array_are_everything_once() {
    for count in 1..9 {
        let shards: Vec<Shard> = (0..count)
            .map(|i| format!("{i}/{count}").parse().unwrap())
            .collect();
        for place in 0..50 {
            assert_eq!(shards.iter().filter(|shard| shard.has(place)).count(), 1);
        }
    }
    for wrong in ["", "1", "1/1", "2/2", "-1/3", "0/0", "a/b", "1/"] {
        assert!(wrong.parse::<Shard>().is_err(), "{wrong}");
    }
}
