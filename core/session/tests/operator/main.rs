//! Operators over real sockets, without a machine that moves: what hostile clients do to the others.

mod crowd;
mod requests;

use std::io::{BufRead, BufReader, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use serde_json::Value;
use tandem_host::{Registry, Switches};
use tandem_machine::Machine;
use tandem_session::jog::{JogController, JogInput, JogRest, JogSession};
use tandem_session::operator::{Listen, OperatorHub, Server};

/// An answer that does not come is a failure after this; nothing else depends on it.
const NEVER: Duration = Duration::from_mins(1);

/// Nobody at the machine.
struct Nobody;

impl JogInput for Nobody {
    fn period(&mut self, _: &JogController) {}

    fn is_waiting(&self) -> bool {
        false
    }

    fn rested(&mut self, _: &JogController, _: &JogRest) {}

    fn refused(&mut self, _: &str) {}
}

/// A hub with both doors, for programs and for jogs.
struct TestServer {
    folder: tempfile::TempDir,
    server: Server,
    token: String,
}

impl TestServer {
    fn open() -> Self {
        let machine =
            Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/machines/mill-4axis.toml");
        let machine = Machine::read(&machine, &[]).unwrap();
        let mut registry = Registry::default();
        for plugin in [tandem_look_ahead::PLUGIN, tandem_sim::PLUGIN] {
            registry.register(plugin).unwrap();
        }
        let session = JogSession::new(
            machine.clone(),
            &registry,
            Switches::default(),
            Box::new(Nobody),
        )
        .unwrap();
        let run = session.enable().unwrap();
        let hub = OperatorHub::new(&machine, run.controls(), run.status())
            .with_jogs(Arc::clone(session.jogs()));
        let folder = tempfile::tempdir().unwrap();
        let listen = Listen {
            unix: Some(folder.path().join("s")),
            tcp: Some("127.0.0.1:0".parse().unwrap()),
            token_file: Some(folder.path().join("token")),
            ..Listen::default()
        };
        let server = Server::start(Arc::new(hub), &listen).unwrap();
        let token = std::fs::read_to_string(folder.path().join("token"))
            .unwrap()
            .trim()
            .to_string();
        Self {
            folder,
            server,
            token,
        }
    }

    fn socket(&self) -> PathBuf {
        self.folder.path().join("s")
    }

    fn address(&self) -> SocketAddr {
        self.server.address.unwrap()
    }

    fn over_unix(&self) -> Client<UnixStream> {
        let stream = UnixStream::connect(self.socket()).unwrap();
        stream.set_read_timeout(Some(NEVER)).unwrap();
        Client(BufReader::new(stream))
    }

    /// A client that names the token.
    fn over_tcp(&self) -> Client<TcpStream> {
        let stream = TcpStream::connect(self.address()).unwrap();
        stream.set_read_timeout(Some(NEVER)).unwrap();
        let mut client = Client(BufReader::new(stream));
        let answer = client.ask(&format!("{{\"token\":\"{}\"}}", self.token));
        assert!(answer["ok"].is_object(), "{answer}");
        client
    }
}

struct Client<S>(BufReader<S>);

impl<S: Read + Write> Client<S> {
    fn ask(&mut self, line: &str) -> Value {
        writeln!(self.0.get_mut(), "{line}").unwrap();
        let mut answer = String::new();
        self.0.read_line(&mut answer).unwrap();
        serde_json::from_str(&answer).unwrap_or_else(|error| panic!("{line}: {answer:?}: {error}"))
    }

    fn holds(&mut self) -> bool {
        self.ask(r#"{"command":"hold"}"#)["ok"].is_object()
    }
}
