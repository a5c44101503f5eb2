//! `tandem serve`: the controller that stays.

use std::error::Error;
use std::io::{self, Write};
use std::os::linux::net::SocketAddrExt as _;
use std::os::unix::ffi::OsStrExt as _;
use std::os::unix::net::{SocketAddr, UnixDatagram};
use std::path::{Path, PathBuf};
use std::thread;

use rustix::process::Signal;
use signal_hook::iterator::Signals;
use tandem_host::moves_metal;
use tandem_machine::Machine;
use tandem_session::controller::{Controller, NoPersistence, Options, Persistence, ScriptLine};
use tandem_session::operator::Listen;
#[cfg(feature = "web")]
use tandem_session::operator::Role;
use tandem_state::{Owner, Store, default_path};

use crate::{args, built_in};

/// Serves until it is told to end.
pub fn serve(options: &args::Serve) -> Result<u8, Box<dyn Error>> {
    let machine = Machine::read(&options.machine.path, &options.machine.overrides)?;
    let registry = built_in::registry()?;
    let replays = options.clock == args::Clock::Virtual;
    let script = match &options.requests {
        Some(path) => script(path)?,
        None if replays => {
            return Err(
                "--clock virtual goes with --requests F: nobody else can say anything there".into(),
            );
        }
        None => vec![],
    };
    let listen = if replays {
        Listen::default()
    } else {
        doors(options, &machine)
    };
    #[cfg(feature = "web")]
    let has_page = options.http.is_some();
    #[cfg(not(feature = "web"))]
    let has_page = false;
    options.operator.check_tokens(has_page)?;
    let store = store(options, &machine, replays)?;
    let persistent = store
        .as_ref()
        .map(|store| store.load().to_program(&machine.home));
    let kept_in = store.as_ref().map(|store| store.path().to_owned());
    let persistence: Box<dyn Persistence> = match store {
        Some(store) => Box::new(store),
        None => Box::new(NoPersistence),
    };
    let simulated = !moves_metal(&machine, &registry);
    let asked = Options {
        clock: options.clock.into(),
        listen: listen.clone(),
        programs: options.programs.clone(),
        record: options.record.clone(),
        arrivals: options.arrivals.clone(),
        enable: !options.disabled && (options.enable || simulated),
        script,
        uptime_periods: options.uptime_periods,
        persistent,
    };
    let enabled = asked.enable;
    let controller = Controller::open(&machine, &registry, asked, persistence)?;
    end_by_signals(controller.ender())?;
    #[cfg(feature = "web")]
    let page = crate::web::open(options, &listen)?;
    if !replays {
        explain(
            &machine,
            &listen,
            [controller.address(), controller.grbl_address()],
            kept_in.as_deref(),
            enabled,
        );
        #[cfg(feature = "web")]
        for (link, role) in page.iter().flat_map(|page| &page.links) {
            match role {
                Role::SetUp => say!("the operator's page: {link}"),
                role => say!("  who may {} alone: {link}", role.name()),
            }
        }
        notify("READY=1");
    }
    let mut out = io::stdout().lock();
    controller.run(&mut |line| {
        // A reader that has gone away is no reason to fail.
        let _ = if replays {
            writeln!(out, "{line}")
        } else {
            writeln!(io::stderr(), "{line}")
        };
    })?;
    #[cfg(feature = "web")]
    drop(page);
    Ok(0)
}

/// The state file: the one that is named, else that of the machine; a replay keeps nothing unless it is told to.
fn store(
    options: &args::Serve,
    machine: &Machine,
    replays: bool,
) -> Result<Option<Store>, Box<dyn Error>> {
    let path = match &options.state {
        Some(path) => path.clone(),
        None if replays || options.no_state => return Ok(None),
        None => default_path(&machine.name)?,
    };
    if let Some(folder) = path
        .parent()
        .filter(|folder| !folder.as_os_str().is_empty())
    {
        std::fs::create_dir_all(folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    }
    let mut store = Store::open(&path, Owner::of(machine))?;
    store.fill(machine)?;
    Ok(Some(store))
}

/// Where the unix socket of a machine lies, where nobody names one.
pub fn default_socket(machine: &str) -> PathBuf {
    let plain = |c: char| {
        if c.is_alphanumeric() || "-_.".contains(c) {
            c
        } else {
            '-'
        }
    };
    let name: String = machine.chars().map(plain).take(40).collect();
    let folder = socket_folders().swap_remove(0);
    folder.join(format!("tandem-{name}.socket"))
}

/// The folders in which controllers put their sockets: the first is where one of this process does; the last is that of a
/// service.
pub fn socket_folders() -> Vec<PathBuf> {
    let named = ["RUNTIME_DIRECTORY", "XDG_RUNTIME_DIR"];
    let mut folders: Vec<PathBuf> = named
        .iter()
        .filter_map(|name| std::env::var_os(name).map(PathBuf::from))
        .filter(|folder| folder.is_absolute())
        .collect();
    if folders.is_empty() {
        folders.push(PathBuf::from("/tmp"));
    }
    folders.push(PathBuf::from("/run/tandem"));
    folders
}

fn doors(options: &args::Serve, machine: &Machine) -> Listen {
    let operator = &options.operator;
    let unix = operator
        .listen
        .clone()
        .unwrap_or_else(|| default_socket(&machine.name));
    Listen {
        unix: Some(unix),
        tcp: operator.listen_tcp,
        token_file: operator.token_file.clone(),
        role_token_files: operator.role_token_files(),
        grbl_tcp: options.grbl_tcp,
        grbl_pty: options.grbl_pty.clone(),
    }
}

/// Lines of clients by fine periods; those that are empty or begin with # are left out.
fn script(path: &Path) -> Result<Vec<ScriptLine>, Box<dyn Error>> {
    let text = std::fs::read_to_string(path).map_err(|e| format!("{}: {e}", path.display()))?;
    let mut lines: Vec<ScriptLine> = vec![];
    for (number, line) in (1..)
        .zip(text.lines())
        .filter(|(_, line)| !line.trim().is_empty() && !line.starts_with('#'))
    {
        let at = |why: String| format!("{}:{number}: {why}", path.display());
        let line = ScriptLine::parse(line).map_err(at)?;
        if lines.last().is_some_and(|last| line.tick < last.tick) {
            return Err(at(format!("tick {} comes after a later one", line.tick)).into());
        }
        lines.push(line);
    }
    Ok(lines)
}

/// Says where the doors are, and what to type next.
fn explain(
    machine: &Machine,
    listen: &Listen,
    [address, grbl_address]: [Option<std::net::SocketAddr>; 2],
    state: Option<&Path>,
    enabled: bool,
) {
    let socket = listen
        .unix
        .as_ref()
        .map_or_else(String::new, |path| path.display().to_string());
    say!(
        "{}: the controller stays until Ctrl-C or SIGTERM",
        machine.name
    );
    say!("  socket  {socket}");
    if let Some(address) = address {
        say!("  tcp     {address}");
    }
    if let Some(address) = grbl_address {
        say!("  grbl    {address}");
    }
    if let Some(path) = &listen.grbl_pty {
        say!("  grbl    {}", path.display());
    }
    if let Some(path) = state {
        say!("  state   {}", path.display());
    } else {
        say!("  state   none: what lasts ends with this process");
    }
    if !enabled {
        say!("  the drives are not enabled: the request \"enable\" does");
    }
    say!("next, in another terminal:");
    // Where its socket lies where one is looked for, nobody has to name it.
    let (connect, at) = if listen.unix.as_ref() == Some(&default_socket(&machine.name)) {
        (String::new(), String::new())
    } else {
        (format!(" --connect {socket}"), format!(" {socket}"))
    };
    say!("  tandem status --watch{connect}");
    say!("  tandem mdi --connect{at}");
    say!("  tandem jog --connect{at}");
    say!("  tandem run PROGRAM --connect{at}");
}

/// The first signal ends the controller: to rest on the path, drives let go, state written.
fn end_by_signals(end: impl Fn() + Send + 'static) -> Result<(), String> {
    let named = [Signal::INT, Signal::TERM, Signal::HUP].map(Signal::as_raw);
    let mut received = Signals::new(named).map_err(|e| format!("signals: {e}"))?;
    thread::spawn(move || {
        for _ in received.forever() {
            notify("STOPPING=1");
            end();
        }
    });
    Ok(())
}

/// Tells systemd, where it has started this process (sd_notify: one datagram, to a path or an abstract name behind @).
fn notify(state: &str) {
    let Some(place) = std::env::var_os("NOTIFY_SOCKET") else {
        return;
    };
    let address = match place.as_bytes().strip_prefix(b"@") {
        Some(name) => SocketAddr::from_abstract_name(name),
        None => SocketAddr::from_pathname(&place),
    };
    // Nobody listens where it fails, and the machine does not depend on it.
    let _ = address
        .and_then(|address| UnixDatagram::unbound()?.send_to_addr(state.as_bytes(), &address));
}
