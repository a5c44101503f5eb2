//! A controller on the computer's clock, and its clients over real sockets: what waits for a disk keeps nobody waiting who stops the
//! machine, and clients that hang, lie or flood hurt nobody.

use std::io::{BufRead, BufReader, Read, Write};
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::process::{Child, ChildStdout, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Arc, Condvar, Mutex};
use std::time::Duration;

use serde_json::{Value, json};
use tandem_host::{Clock, Registry};
use tandem_machine::Machine;
use tandem_sdk::{
    Attached, Driver, DriverContext, DriverDescription, Feedback, NoOptions, PluginError, Setpoint,
    local_plugin,
};
use tandem_session::controller::{Controller, NoPersistence, Options, Persistence, ScriptLine};
use tandem_state::Change;

use crate::support::{machine, machine_with, registry};

/// An answer that does not come is a failure after this; nothing else depends on it.
pub const NEVER: Duration = Duration::from_mins(1);

/// A disk that takes nothing until it is let go.
#[derive(Clone, Default)]
struct SlowDisk(Arc<(Mutex<Disk>, Condvar)>);

#[derive(Default)]
struct Disk {
    hangs: bool,
    waits: usize,
}

impl SlowDisk {
    fn hang(&self, hangs: bool) {
        self.0.0.lock().unwrap().hangs = hangs;
        self.0.1.notify_all();
    }

    /// Returns when somebody waits for it.
    fn is_waited_for(&self) {
        let disk = self.0.0.lock().unwrap();
        let (_disk, over) = self
            .0
            .1
            .wait_timeout_while(disk, NEVER, |disk| disk.waits == 0)
            .unwrap();
        assert!(!over.timed_out(), "nobody has asked for the disk");
    }
}

impl Persistence for SlowDisk {
    fn commit(&self, _changes: Vec<Change>) -> Result<(), String> {
        let mut disk = self.0.0.lock().unwrap();
        disk.waits += 1;
        self.0.1.notify_all();
        let mut disk = self.0.1.wait_while(disk, |disk| disk.hangs).unwrap();
        disk.waits -= 1;
        Ok(())
    }

    fn record(&self, _change: Change) {}
}

/// What `clients` do at a controller of `machine`, which runs until they are done.
pub fn with_controller(
    machine: &Machine,
    persistence: Box<dyn Persistence>,
    options: impl FnOnce(&mut Options),
    clients: impl FnOnce(&Path, Option<std::net::SocketAddr>) + Send,
) {
    with_controller_of(&registry(), machine, persistence, options, clients);
}

/// The same, with these plugins.
fn with_controller_of(
    registry: &Registry,
    machine: &Machine,
    persistence: Box<dyn Persistence>,
    options: impl FnOnce(&mut Options),
    clients: impl FnOnce(&Path, Option<std::net::SocketAddr>) + Send,
) {
    let folder = tempfile::tempdir().unwrap();
    let socket = folder.path().join("socket");
    let mut asked = Options::of_script(vec![]);
    asked.clock = Clock::Wall;
    asked.listen.unix = Some(socket.clone());
    options(&mut asked);
    // How late a busy computer wakes the loop is asked by other tests.
    let mut machine = machine.clone();
    (machine.max_missed_periods, machine.max_missed_share) = (u32::MAX, 1.0);
    let controller = Controller::open(&machine, registry, asked, persistence).unwrap();
    let (end, address) = (controller.ender(), controller.address());
    std::thread::scope(|scope| {
        scope.spawn(move || {
            // However they end, the controller does.
            let _ender = Ender(end);
            clients(&socket, address);
        });
        controller.run(&mut |_| ()).unwrap();
    });
}

struct Ender<F: Fn()>(F);

impl<F: Fn()> Drop for Ender<F> {
    fn drop(&mut self) {
        (self.0)();
    }
}

/// A client, and what it was told that it has not looked at.
pub struct Client<S> {
    lines: BufReader<S>,
    next: u64,
    pub aside: Vec<Value>,
}

impl Client<UnixStream> {
    pub fn at(socket: &Path) -> Self {
        let stream = UnixStream::connect(socket).unwrap();
        stream.set_read_timeout(Some(NEVER)).unwrap();
        let mut client = Self::over(stream);
        assert_eq!(client.hear()["tandem"]["protocol"], 2);
        client
    }

    /// One that holds the lease of a machine that is ready.
    pub fn in_control(socket: &Path) -> Self {
        let mut client = Self::at(socket);
        client.ok("lease", json!({ "how": "take" }));
        client.until_state("ready");
        client
    }
}

impl<S: Read + Write> Client<S> {
    pub fn over(stream: S) -> Self {
        Self {
            lines: BufReader::new(stream),
            next: 1,
            aside: vec![],
        }
    }

    pub fn until_state(&mut self, state: &str) {
        while self.ok("status", json!({}))["state"] != state {
            std::thread::yield_now();
        }
    }

    pub fn hear(&mut self) -> Value {
        let mut line = String::new();
        self.lines.read_line(&mut line).unwrap();
        serde_json::from_str(&line).unwrap_or_else(|e| panic!("{line:?}: {e}"))
    }

    /// Says it, and goes on; the id.
    pub fn say(&mut self, request: &str, mut with: Value) -> u64 {
        let id = self.next;
        self.next += 1;
        (with["id"], with["request"]) = (json!(id), json!(request));
        writeln!(self.lines.get_mut(), "{with}").unwrap();
        id
    }

    /// The answer to `id`, or the first that `is` it.
    pub fn wait(&mut self, is: impl Fn(&Value) -> bool) -> Value {
        if let Some(at) = self.aside.iter().position(&is) {
            return self.aside.remove(at);
        }
        loop {
            let told = self.hear();
            if is(&told) {
                return told;
            }
            self.aside.push(told);
        }
    }

    pub fn answer(&mut self, id: u64) -> Value {
        self.wait(|told| told["id"] == id && told.get("event").is_none())
    }

    fn ask(&mut self, request: &str, with: Value) -> Value {
        let id = self.say(request, with);
        self.answer(id)
    }

    pub fn ok(&mut self, request: &str, with: Value) -> Value {
        let answer = self.ask(request, with);
        assert!(answer.get("ok").is_some(), "{request}: {answer}");
        answer["ok"].clone()
    }

    pub fn why(&mut self, request: &str, with: Value) -> String {
        let answer = self.ask(request, with);
        let why = answer["error"]["why"].as_str();
        why.unwrap_or_else(|| panic!("{request}: {answer}"))
            .to_string()
    }

    /// A line by hand that is judged; its id.
    fn ask_line(&mut self, line: &str) -> u64 {
        let id = self.say("mdi", json!({ "line": line }));
        let judged = self.answer(id);
        assert_eq!(judged["ok"]["judged"], true, "{line}: {judged}");
        id
    }

    /// Whether nothing has been said to it about `id` so far.
    fn is_waiting_for(&self, id: u64) -> bool {
        !self.aside.iter().any(|told| told["id"] == id)
    }
}

/// Clients of a controller whose disk hangs where that is asked for.
fn with_slow_disk(clients: impl FnOnce(&Path, &SlowDisk) + Send) {
    let disk = SlowDisk::default();
    let persistence = Box::new(disk.clone());
    with_controller(
        &machine("mill-3axis.toml"),
        persistence,
        |_| (),
        |socket, _| clients(socket, &disk),
    );
}

#[test]
fn a_disk_that_hangs_keeps_nobody_waiting_who_stops_the_machine_or_looks_at_it() {
    with_slow_disk(|socket, disk| {
        let mut other = Client::at(socket);
        let mut waiting = Client::in_control(socket);
        disk.hang(true);
        let stuck = waiting.say("touch-off", json!({ "x_mm": 5.0 }));
        disk.is_waited_for();
        let behind = waiting.say("mdi", json!({ "line": "G0 X10" }));
        // Each of these has an answer while the disk hangs, and so has a stop of the one who waits.
        other.ok("subscribe", json!({ "rate_hz": 50.0 }));
        other.ok("status", json!({}));
        other.ok("tables", json!({}));
        other.ok("path", json!({}));
        assert!(
            other.why("hold", json!({})).contains("nothing is driven"),
            "it is judged at once"
        );
        other.ok("emergency-stop", json!({}));
        waiting.ok("emergency-stop", json!({}));
        other.wait(|told| told["event"] == "status");
        other.wait(|told| told["event"] == "state" && told["state"] == "emergency-stop");
        assert!(waiting.is_waiting_for(stuck) && waiting.is_waiting_for(behind));
        disk.hang(false);
        assert_eq!(waiting.answer(stuck)["ok"]["set"], "touch-off");
        let why = waiting.answer(behind);
        assert!(why.get("error").is_some(), "it came before the stop: {why}");
        // A reset does not bring it back.
        waiting.ok("reset", json!({}));
        waiting.until_state("ready");
        let status = waiting.ok("status", json!({}));
        assert_eq!(
            (
                &status["position"]["x_mm"],
                &status["work_position"]["x_mm"]
            ),
            (&json!(0.0), &json!(5.0))
        );
    });
}

/// A client that says no more has its answer all the same.
#[test]
fn who_hangs_up_behind_a_request_that_waits_for_a_disk_is_answered() {
    with_slow_disk(|socket, disk| {
        let mut client = Client::in_control(socket);
        disk.hang(true);
        let set = client.say("set-parameter", json!({ "number": 500, "value": 3.0 }));
        let behind = client.say("status", json!({}));
        let stream = client.lines.get_ref();
        stream.shutdown(std::net::Shutdown::Write).unwrap();
        disk.is_waited_for();
        disk.hang(false);
        assert_eq!(client.answer(set)["ok"]["set"], "set-parameter");
        assert!(client.answer(behind).get("ok").is_some());
        let mut rest = String::new();
        client.lines.read_to_string(&mut rest).unwrap();
    });
}

/// Holds a lease of the system's on a file: until it goes, whoever opens the file waits.
struct Held {
    child: Child,
    says: BufReader<ChildStdout>,
}

impl Held {
    fn on(file: &Path) -> Option<Self> {
        let script = "import fcntl, signal, sys\n\
            signal.signal(signal.SIGIO, lambda *_: print('asked', flush=True))\n\
            file = open(sys.argv[1])\n\
            fcntl.fcntl(file, fcntl.F_SETLEASE, fcntl.F_WRLCK)\n\
            print('held', flush=True)\n\
            sys.stdin.read()\n";
        let mut child = Command::new("python3")
            .args(["-c", script])
            .arg(file)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .ok()?;
        let says = BufReader::new(child.stdout.take()?);
        let mut held = Self { child, says };
        (held.said() == "held\n").then_some(held)
    }

    fn said(&mut self) -> String {
        let mut said = String::new();
        let _ = self.says.read_line(&mut said);
        said
    }

    /// Returns when somebody waits for the file.
    fn is_waited_for(&mut self) {
        assert_eq!(self.said(), "asked\n");
    }
}

impl Drop for Held {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

#[test]
fn files_that_cannot_be_read_yet_keep_nobody_waiting() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        path
    };
    let part = file("part.ngc", "G21 G90\nG1 X5 F600\nM2\n");
    let drill = file(
        "drill.ngc",
        "o<drill> sub\nG91 G0 X7\nG90\no<drill> endsub\nM2\n",
    );
    let place = folder.path().to_str().unwrap().to_string();
    let on = machine_with("mill-3axis.toml", &[("program.subroutine_path", &place)]);
    let programs = folder.path().to_path_buf();
    with_controller(
        &on,
        Box::new(NoPersistence),
        |options| options.programs = Some(programs),
        |socket, _| {
            let (mut waiting, mut other) = (Client::in_control(socket), Client::at(socket));
            for (path, request, with) in [
                (&part, "load", json!({ "path": "part.ngc" })),
                (&drill, "mdi", json!({ "line": "o<drill> call" })),
            ] {
                let Some(mut held) = Held::on(path) else {
                    println!("skipped: python3 cannot hold a lease on a file here");
                    return;
                };
                let id = waiting.say(request, with);
                held.is_waited_for();
                let status = waiting.say("status", json!({}));
                other.ok("status", json!({}));
                other.ok("tables", json!({}));
                other.ok("emergency-stop", json!({}));
                assert!(waiting.is_waiting_for(id) && waiting.is_waiting_for(status));
                if request == "load" {
                    // While the machine is being stopped nothing is loaded.
                    other.until_state("emergency-stop");
                }
                drop(held);
                let answer = waiting.answer(id);
                assert!(waiting.answer(status).get("ok").is_some());
                if request == "load" {
                    assert_eq!(answer["ok"]["program"], "part.ngc", "{answer}");
                } else {
                    assert!(answer.get("error").is_some(), "{answer}");
                }
                waiting.until_state("emergency-stop");
                waiting.ok("reset", json!({}));
                waiting.until_state("ready");
            }
            // The line that was stopped was not begun; the same line is, when it is said again.
            let id = waiting.say("mdi", json!({ "line": "o<drill> call" }));
            assert_eq!(waiting.answer(id)["ok"]["judged"], true);
            waiting.wait(|told| told["event"] == "driven" && told["id"] == id);
            waiting.until_state("ready");
            assert_eq!(waiting.ok("status", json!({}))["position"]["x_mm"], 7.0);
        },
    );
}

/// Tells the others that it is over, also where something is not as it should be.
struct Ends<'a>(&'a AtomicBool);

impl Drop for Ends<'_> {
    fn drop(&mut self) {
        self.0.store(true, Relaxed);
    }
}

/// As many clients as there are places: some never read, some send without end, some send what is none, and some work.
#[test]
fn sixteen_clients_at_once_of_which_most_mean_no_good() {
    with_controller(
        &machine("mill-3axis.toml"),
        Box::new(NoPersistence),
        |_| (),
        |socket, _| {
            let mut operator = Client::in_control(socket);
            let over = AtomicBool::new(false);
            let is_over = || over.load(Relaxed);
            std::thread::scope(|scope| {
                let _end = Ends(&over);
                for nth in 0..12 {
                    let client = Client::at(socket);
                    let is_over = &is_over;
                    scope.spawn(move || {
                        let mut stream = client.lines.into_inner();
                        stream
                            .set_write_timeout(Some(Duration::from_millis(50)))
                            .unwrap();
                        let says: Vec<u8> = match nth % 4 {
                            // Asks for as much as there is, and never reads.
                            0 => b"{\"id\":1,\"request\":\"subscribe\",\"rate_hz\":100}\n".to_vec(),
                            1 => b"{\"id\":2,\"request\":\"status\"}\n".repeat(100),
                            2 => {
                                b"{\"id\":3,\"request\":\"mdi\",\"line\":\"G0 X9\"}\n\xff{{\n[[[[\n"
                                    .repeat(50)
                            }
                            _ => vec![b'x'; 64 * 1024],
                        };
                        while !is_over() {
                            if stream.write_all(&says).is_err() {
                                // It was closed, or nothing more is taken of it: it hangs from here on.
                                std::thread::sleep(Duration::from_millis(5));
                            }
                        }
                    });
                }
                let watchers: Vec<_> = (0..3)
                    .map(|_| {
                        let mut client = Client::at(socket);
                        let is_over = &is_over;
                        scope.spawn(move || {
                            let mut answers = 0;
                            while !is_over() {
                                client.ok("status", json!({}));
                                client.aside.clear();
                                answers += 1;
                            }
                            answers
                        })
                    })
                    .collect();
                for nth in 0..10 {
                    let x = f64::from(nth % 2) * 3.0;
                    let id = operator.say("mdi", json!({ "line": format!("G1 X{x} F6000") }));
                    assert_eq!(operator.answer(id)["ok"]["judged"], true);
                    operator.wait(|told| told["event"] == "driven" && told["id"] == id);
                    operator.aside.clear();
                }
                // Whoever comes now finds no place, and one that is there can stop.
                operator.say("mdi", json!({ "line": "G1 X90 F300" }));
                operator.until_state("mdi");
                operator.ok("emergency-stop", json!({}));
                operator.until_state("emergency-stop");
                over.store(true, Relaxed);
                for watcher in watchers {
                    assert!(watcher.join().unwrap() > 0);
                }
            });
        },
    );
}

/// Drives that say they are real: commands of the machine are run for such alone.
struct Metal(tandem_rig::Echo);

impl Driver for Metal {
    fn describe(&self) -> DriverDescription {
        DriverDescription {
            simulated: 0,
            watches_following: 1,
            ..DriverDescription::simulated()
        }
    }

    fn open(&mut self, context: &DriverContext) -> Result<(), PluginError> {
        self.0.open(context)
    }

    fn start(&mut self) -> Result<Attached, PluginError> {
        let attached = self.0.start()?;
        Ok(Attached {
            known: u32::MAX,
            ..attached
        })
    }

    fn exchange(&mut self, told: &Setpoint, feedback: &mut Feedback) -> Result<(), PluginError> {
        self.0.exchange(told, feedback)
    }

    fn quick_stop(&mut self) {
        self.0.quick_stop();
    }

    fn stop(&mut self) -> Result<(), PluginError> {
        self.0.stop()
    }
}

#[test]
fn commands_of_the_machine_run_where_it_stands_in_lines_by_hand_and_in_programs() {
    use std::os::unix::fs::PermissionsExt as _;
    let folder = tempfile::tempdir().unwrap();
    let (log, script) = (folder.path().join("log"), folder.path().join("command"));
    let text = format!(
        "#!/bin/sh\necho \"$*\" >> {}\n[ \"$2\" != 9.000000 ]\n",
        log.display()
    );
    std::fs::write(&script, text).unwrap();
    std::fs::set_permissions(&script, std::fs::Permissions::from_mode(0o755)).unwrap();
    let command = format!("{:?}", script.to_str().unwrap());
    let on = machine_with(
        "mill-3axis.toml",
        &[("user_commands.M101", &command), ("driver.plugin", "metal")],
    );
    let mut registry = registry();
    registry
        .register(
            local_plugin!(driver "metal" = |_: &NoOptions| Ok(Metal(tandem_rig::Echo::default()))),
        )
        .unwrap();
    let logged = || std::fs::read_to_string(&log).unwrap_or_default();
    with_controller_of(
        &registry,
        &on,
        Box::new(NoPersistence),
        |_| (),
        |socket, _| {
            let mut client = Client::in_control(socket);
            let says = ["G1 X1 F3000", "M101 P3 Q-1", "G1 X2"];
            let ids = says.map(|line| client.say("mdi", json!({ "line": line })));
            for id in ids {
                client.wait(|told| told["event"] == "driven" && told["id"] == id);
            }
            client.until_state("ready");
            assert_eq!(logged(), "3.000000 -1.000000\n");
            let part = "G21 G90\nG1 X4 F3000\nM101 P5\nG1 X6\nM101 P6 Q7\nM2\n";
            client.ok("load", json!({ "text": part }));
            client.ok("start", json!({}));
            let job = client.wait(|told| told["event"] == "job" && told["job"]["job"] == "program");
            assert_eq!(job["job"]["outcome"], "done", "{job}");
            assert_eq!(logged().lines().count(), 3, "{}", logged());
            assert!(
                logged().contains("\n5.000000") && logged().ends_with("6.000000 7.000000\n"),
                "{}",
                logged()
            );
            // One that fails ends the job in a fault that names it, and what follows it is not driven.
            client.until_state("ready");
            let ids = ["M101 P3 Q9", "G1 X9 F3000"].map(|line| client.ask_line(line));
            client.until_state("fault");
            for id in ids {
                let told = client.wait(|told| told["id"] == id && told.get("event").is_some());
                assert_eq!(told["event"], "not-driven");
            }
            let fault = client.ok("status", json!({}));
            assert!(fault["fault"].as_str().unwrap().contains("M101"), "{fault}");
            assert_eq!(fault["position"]["x_mm"], 6.0);
        },
    );
}

/// A pipe at `place`: whoever opens it to write waits until somebody reads.
fn pipe(place: &Path) {
    std::fs::create_dir_all(place.parent().unwrap()).unwrap();
    assert!(
        Command::new("mkfifo")
            .arg(place)
            .status()
            .unwrap()
            .success()
    );
}

#[test]
fn a_disk_that_hangs_under_the_files_of_a_job_holds_no_motion() {
    let folder = tempfile::tempdir().unwrap();
    let trace = |job: &str| folder.path().join(job).join("trace.csv");
    pipe(&trace("000001-mdi"));
    with_controller(
        &machine("mill-3axis.toml"),
        Box::new(NoPersistence),
        |options| options.record = Some(folder.path().to_owned()),
        |socket, _| {
            let mut client = Client::in_control(socket);
            for x in [1, 0] {
                let id = client.ask_line(&format!("G1 X{x} F3000"));
                client.wait(|told| told["event"] == "driven" && told["id"] == id);
                let job = client.wait(|told| told["event"] == "job");
                assert_eq!(job["job"]["outcome"], "done", "{job}");
                client.until_state("ready");
            }
            // The files of the second job are there, and once the pipe is read those of the first one too.
            let rows = |job: &str| std::fs::read_to_string(trace(job)).unwrap().lines().count();
            while !folder.path().join("000002-mdi/summary.json").exists() {
                std::thread::yield_now();
            }
            assert!(rows("000002-mdi") > 10);
            assert!(!folder.path().join("000001-mdi/summary.json").exists());
            assert!(rows("000001-mdi") > 10);
        },
    );
    assert!(folder.path().join("000001-mdi/summary.json").exists());
}

#[test]
fn a_full_disk_under_the_files_of_a_job_holds_the_machine_where_its_file_says_so() {
    for (mode, holds) in [("hold", true), ("continue", false)] {
        let folder = tempfile::tempdir().unwrap();
        let trace = folder.path().join("000001-mdi/trace.csv");
        std::fs::create_dir_all(trace.parent().unwrap()).unwrap();
        std::os::unix::fs::symlink("/dev/full", &trace).unwrap();
        with_controller(
            &machine_with("mill-3axis.toml", &[("recorder.on_error", mode)]),
            Box::new(NoPersistence),
            |options| options.record = Some(folder.path().to_owned()),
            |socket, _| {
                let mut client = Client::in_control(socket);
                let id = client.ask_line("G1 X30 F3000");
                let alarm = client.wait(|told| told["event"] == "alarm");
                let words = alarm["raised"]["text"].as_str().unwrap();
                assert!(
                    words.contains("trace: /dev/full") && words.contains("from tick"),
                    "{words}"
                );
                if holds {
                    client.until_state("held");
                    client.ok("resume", json!({}));
                }
                client.wait(|told| told["event"] == "driven" && told["id"] == id);
                let held = client.aside.iter().any(|told| told["state"] == "held");
                assert_eq!(held, holds, "{mode}");
            },
        );
    }
}

/// What clients have said is written as it comes, and replayed it is the same job, bit for bit, each time.
#[test]
fn what_has_come_is_repeated_to_the_bit() {
    let folder = tempfile::tempdir().unwrap();
    let (file, pause) = (folder.path().join("day.jsonl"), Duration::from_millis(3));
    let on = machine("mill-3axis.toml");
    let lines: Vec<_> = (1..=40)
        .map(|n| format!("G1 X{} Y{} F3000", n % 7, f64::from(n) / 4.0))
        .collect();
    with_controller(
        &on,
        Box::new(NoPersistence),
        |options| options.arrivals = Some(file.clone()),
        |socket, _| {
            let mut client = Client::in_control(socket);
            let ids = lines.iter().map(|line| {
                std::thread::sleep(pause);
                client.say("mdi", json!({ "line": line }))
            });
            let last = ids.last().unwrap();
            client.wait(|told| told["event"] == "driven" && told["id"] == last);
            client.until_state("ready");
        },
    );
    let text = std::fs::read_to_string(&file).unwrap();
    let script: Vec<_> = text
        .lines()
        .map(|line| ScriptLine::parse(line).unwrap())
        .collect();
    let said = script
        .iter()
        .filter(|line| line.line.contains("\"mdi\""))
        .count();
    assert_eq!(
        (said, script.last().unwrap().line.as_str()),
        (40, ""),
        "{text}"
    );
    let replay = |name: &str| {
        let mut options = Options::of_script(script.clone());
        options.record = Some(folder.path().join(name));
        let registry = registry();
        let controller =
            Controller::open(&on, &registry, options, Box::new(NoPersistence)).unwrap();
        let mut driven = 0;
        controller
            .run(&mut |told| driven += usize::from(told.contains("\"event\":\"driven\"")))
            .unwrap();
        assert_eq!(driven, 40, "{name}");
        // Where the computer let the sender wait, the machine came to rest meanwhile: then there is more than one job.
        let jobs = std::fs::read_dir(folder.path().join(name)).unwrap();
        let mut traces: Vec<_> = jobs
            .map(|job| job.unwrap().path().join("trace.csv"))
            .collect();
        traces.sort();
        let read = traces
            .iter()
            .flat_map(|trace| std::fs::read(trace).unwrap());
        read.collect::<Vec<u8>>()
    };
    let (first, second) = (replay("first"), replay("second"));
    assert!(first == second && first.len() > 10_000);
    let last = String::from_utf8(first).unwrap();
    let row: Vec<&str> = last.lines().last().unwrap().split(',').collect();
    let place: Vec<f64> = row[2..4]
        .iter()
        .map(|number| number.parse().unwrap())
        .collect();
    assert_eq!(place, [5.0, 10.0]);
}
