//! Commands of the machine's own (M100 to M199): each runs at rest, in a thread of its own, while the loops go on.

use std::collections::BTreeMap;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use tandem_gcode::{Item, UserCommand};
use tandem_machine::Machine;
use tandem_rings::{Rest, RestCause};
use tandem_rough::Source;

use crate::plugins::registry::{Registry, moves_metal};
use crate::switches::Switches;

/// How often a running command is looked at.
const LOOK_EVERY: Duration = Duration::from_millis(10);
/// What a command has said last is waited for so long once it is over: what it has started may hold its output open.
const LAST_WORDS: Duration = Duration::from_millis(200);
/// Longest last line that a message shows, bytes.
const MAX_LAST_LINE: usize = 200;
/// Times in a row that the rough loop finds everything driven before it is believed, as in manual input.
const STANDING: u32 = 2;
/// What a command gets for P or Q where the line has none, as in `LinuxCNC`.
const NOT_GIVEN: f64 = -1.0;

/// Source with the commands of the machine run where they stand. On simulated drives and in a dry run they are passed over.
/// Host; allocates.
pub fn with_user_commands(
    machine: &Machine,
    registry: &Registry,
    switches: Switches,
    source: Box<dyn Source + Send>,
) -> Box<dyn Source + Send> {
    let rules = &machine.program;
    if rules.user_commands.is_empty() || switches.dry_run || !moves_metal(machine, registry) {
        return source;
    }
    let limit =
        Duration::try_from_secs_f64(rules.user_command_time_limit_s).unwrap_or(Duration::MAX);
    Box::new(Commands {
        source,
        programs: rules.user_commands.clone(),
        limit,
        held: vec![],
        state: State::Idle,
    })
}

struct Commands {
    source: Box<dyn Source + Send>,
    programs: BTreeMap<u32, PathBuf>,
    limit: Duration,
    /// What comes behind the command that is awaited.
    held: Vec<Item>,
    state: State,
}

enum State {
    Idle,
    /// It runs once the machine stands; how often in a row it did.
    Due(UserCommand, u32),
    Running(Running),
    Over(Result<(), String>),
}

impl Commands {
    /// Keeps back the first command of `items` from `from` on, and what follows it.
    fn cut(&mut self, items: &mut Vec<Item>, from: usize) {
        let found = items[from..]
            .iter()
            .position(|item| matches!(item, Item::Command(_)));
        let Some(at) = found.map(|at| from + at) else {
            return;
        };
        let mut rest = items.split_off(at).into_iter();
        if let Some(Item::Command(command)) = rest.next() {
            self.state = State::Due(command, 0);
        }
        self.held = rest.collect();
    }

    fn start(&self, command: &UserCommand) -> State {
        let Some(program) = self.programs.get(&command.number) else {
            return State::Over(Err(format!(
                "line {}: M{} is not listed",
                command.line, command.number
            )));
        };
        State::Running(Running::start(*command, program.clone(), self.limit))
    }
}

impl Source for Commands {
    fn next_items(&mut self, items: &mut Vec<Item>) -> Result<bool, String> {
        let before = items.len();
        if let State::Over(done) = std::mem::replace(&mut self.state, State::Idle) {
            done?;
            items.append(&mut self.held);
            self.cut(items, before);
            // Also where that is nothing: the source is asked first whether it may go on.
            return Ok(true);
        }
        let more = self.source.next_items(items)?;
        self.cut(items, before);
        Ok(more || !matches!(self.state, State::Idle))
    }

    fn may_go_on(&mut self, driven: bool) -> bool {
        match &mut self.state {
            State::Idle => self.source.may_go_on(driven),
            State::Due(command, standing) => {
                *standing = if driven { *standing + 1 } else { 0 };
                if *standing >= STANDING {
                    let command = *command;
                    self.state = self.start(&command);
                }
                false
            }
            State::Running(running) => {
                let Some(done) = running.done() else {
                    return false;
                };
                self.state = State::Over(done);
                true
            }
            State::Over(_) => true,
        }
    }

    fn streams(&self) -> bool {
        // In front of a command the machine comes to rest at once.
        matches!(self.state, State::Idle) && self.source.streams()
    }

    fn period(&mut self) {
        self.source.period();
    }

    fn is_waiting(&self) -> bool {
        !matches!(self.state, State::Idle) || self.source.is_waiting()
    }

    fn provide_input(&mut self, value: f64) {
        self.source.provide_input(value);
    }

    fn provide_rest(&mut self, rest: &Rest) -> bool {
        if rest.cause == RestCause::Abort {
            // What is dropped is ended.
            self.state = State::Idle;
            self.held.clear();
        }
        self.source.provide_rest(rest)
    }
}

/// A command that runs. Where it is dropped, it is ended.
struct Running {
    done: Receiver<Result<(), String>>,
    stop: Arc<AtomicBool>,
}

impl Running {
    fn start(command: UserCommand, program: PathBuf, limit: Duration) -> Self {
        let (tell, done) = channel();
        let stop = Arc::new(AtomicBool::new(false));
        let asked = Arc::clone(&stop);
        thread::spawn(move || {
            let said = run(&command, &program, limit, &asked);
            let place = format!(
                "line {}: M{} ({})",
                command.line,
                command.number,
                program.display()
            );
            let _ = tell.send(said.map_err(|why| format!("{place} {why}")));
        });
        Self { done, stop }
    }

    fn done(&self) -> Option<Result<(), String>> {
        match self.done.try_recv() {
            Ok(done) => Some(done),
            Err(TryRecvError::Empty) => None,
            Err(TryRecvError::Disconnected) => {
                Some(Err("a command was given up without a word".into()))
            }
        }
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
    }
}

/// Runs a program to its end.
fn run(
    command: &UserCommand,
    program: &Path,
    limit: Duration,
    stop: &AtomicBool,
) -> Result<(), String> {
    let arguments =
        [command.p, command.q].map(|value| format!("{:.6}", value.unwrap_or(NOT_GIVEN)));
    let mut started = Command::new(program);
    started
        .args(arguments)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    let mut child = started
        .spawn()
        .map_err(|error| format!("cannot be started: {error}"))?;
    let tails = [(); 2].map(|()| Arc::new(Mutex::new(Vec::new())));
    let err = child.stderr.take().map(|pipe| follow(pipe, &tails[0]));
    let out = child.stdout.take().map(|pipe| follow(pipe, &tails[1]));
    let status = wait(&mut child, limit, stop)?;
    let until = Instant::now() + LAST_WORDS;
    while Instant::now() < until
        && [&out, &err]
            .into_iter()
            .flatten()
            .any(|reader| !reader.is_finished())
    {
        thread::sleep(LOOK_EVERY);
    }
    if status.success() {
        return Ok(());
    }
    // What it says of errors comes first.
    let said = tails
        .iter()
        .map(|tail| last_line(&tail.lock().unwrap_or_else(PoisonError::into_inner)));
    let said = said
        .into_iter()
        .find(|said| !said.is_empty())
        .unwrap_or_default();
    Err(if said.is_empty() {
        format!("ended with {status}")
    } else {
        format!("ended with {status}: {said}")
    })
}

fn wait(
    child: &mut Child,
    limit: Duration,
    stop: &AtomicBool,
) -> Result<std::process::ExitStatus, String> {
    let begun = Instant::now();
    loop {
        if let Some(status) = child
            .try_wait()
            .map_err(|error| format!("cannot be watched: {error}"))?
        {
            return Ok(status);
        }
        let late = begun.elapsed() > limit;
        if late || stop.load(Ordering::Relaxed) {
            let _ = child.kill();
            let _ = child.wait();
            let why = format!(
                "had not ended after {} s ([user_commands] time_limit_s)",
                limit.as_secs_f64()
            );
            return Err(if late {
                why
            } else {
                "was ended with the program".into()
            });
        }
        thread::sleep(LOOK_EVERY);
    }
}

/// Keeps the end of what a program says.
fn follow(mut pipe: impl Read + Send + 'static, tail: &Arc<Mutex<Vec<u8>>>) -> JoinHandle<()> {
    let tail = Arc::clone(tail);
    thread::spawn(move || {
        let mut chunk = [0; 1024];
        while let Ok(count @ 1..) = pipe.read(&mut chunk) {
            let mut tail = tail.lock().unwrap_or_else(PoisonError::into_inner);
            tail.extend_from_slice(&chunk[..count]);
            let surplus = tail.len().saturating_sub(2 * chunk.len());
            tail.drain(..surplus);
        }
    })
}

fn last_line(tail: &[u8]) -> String {
    let text = String::from_utf8_lossy(tail);
    let line = text
        .lines()
        .rev()
        .find(|line| !line.trim().is_empty())
        .unwrap_or_default()
        .trim();
    line.chars()
        .filter(|c| !c.is_control())
        .take(MAX_LAST_LINE)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::PermissionsExt;

    const LIMIT: Duration = Duration::from_mins(1);

    /// Hands out a command between two ends.
    struct Two(u32);

    impl Source for Two {
        fn next_items(&mut self, items: &mut Vec<Item>) -> Result<bool, String> {
            let command = UserCommand {
                line: 7,
                before_block: 0,
                number: 101,
                p: Some(2.5),
                q: None,
            };
            items.extend([
                Item::Command(command),
                Item::Command(UserCommand {
                    q: Some(1.0),
                    ..command
                }),
                Item::End,
            ]);
            self.0 += 1;
            Ok(true)
        }

        fn provide_input(&mut self, _value: f64) {}

        fn provide_rest(&mut self, _rest: &Rest) -> bool {
            false
        }
    }

    /// Items up to the end, or the message, of a program whose command is the shell script `script`.
    fn driven(script: &str, limit: Duration, folder: &Path) -> Result<Vec<Item>, String> {
        let program = folder.join("command");
        std::fs::write(&program, format!("#!/bin/sh\n{script}\n")).unwrap();
        std::fs::set_permissions(&program, std::fs::Permissions::from_mode(0o755)).unwrap();
        let programs = BTreeMap::from([(101, program)]);
        let mut source = Commands {
            source: Box::new(Two(0)),
            programs,
            limit,
            held: vec![],
            state: State::Idle,
        };
        let mut items = Vec::new();
        while !items.iter().any(|item| matches!(item, Item::End)) {
            if source.may_go_on(true) {
                assert!(source.next_items(&mut items)?);
            }
            assert!(!items.iter().any(|item| matches!(item, Item::Command(_))));
            thread::sleep(Duration::from_millis(1));
        }
        Ok(items)
    }

    #[test]
    fn a_command_gets_its_arguments_and_what_follows_waits_for_it() {
        let folder = tempfile::tempdir().unwrap();
        let said = folder.path().join("said");
        let script = format!("echo \"$1 $2\" >> {}", said.display());
        assert_eq!(driven(&script, LIMIT, folder.path()).unwrap().len(), 1);
        assert_eq!(
            std::fs::read_to_string(said).unwrap(),
            "2.500000 -1.000000\n2.500000 1.000000\n"
        );
    }

    #[test]
    fn a_command_that_fails_or_hangs_ends_the_run_with_its_last_line() {
        let folder = tempfile::tempdir().unwrap();
        let why = driven("echo first\necho no air >&2\nexit 3", LIMIT, folder.path()).unwrap_err();
        assert!(
            why.starts_with("line 7: M101 (") && why.ends_with("ended with exit status: 3: no air"),
            "{why}"
        );
        let why = driven("exec sleep 100", Duration::from_millis(50), folder.path()).unwrap_err();
        assert!(
            why.contains("had not ended after 0.05 s ([user_commands] time_limit_s)"),
            "{why}"
        );
    }

    #[test]
    fn nothing_starts_before_the_machine_stands() {
        let programs = BTreeMap::from([(101, PathBuf::from("/nonexistent"))]);
        let limit = Duration::from_secs(1);
        let mut source = Commands {
            source: Box::new(Two(0)),
            programs,
            limit,
            held: vec![],
            state: State::Idle,
        };
        source.next_items(&mut Vec::new()).unwrap();
        for driven in [false, true, false, true, false] {
            assert!(!source.may_go_on(driven));
            assert!(matches!(source.state, State::Due(..)));
        }
    }
}
