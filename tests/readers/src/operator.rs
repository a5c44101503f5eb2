//! Any bytes from a client at the operator's socket: they are answered or end that client, and the next client is served.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::Shutdown;
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::sync::{Arc, LazyLock};
use std::time::Duration;

use tandem_machine::Machine;
use tandem_session::operator::{Listen, OperatorHub, Server};

struct Open {
    path: PathBuf,
    _server: Server,
}

static OPEN: LazyLock<Open> = LazyLock::new(|| {
    let machine =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/machines/mill-3axis.toml");
    let machine = Machine::read(&machine, &[]).expect("the example");
    let hub = Arc::new(OperatorHub::new(&machine, Arc::default(), Arc::default()));
    let path = std::env::temp_dir().join(format!("tandem-fuzz-operator-{}", std::process::id()));
    let server = Server::start(
        hub,
        &Listen {
            unix: Some(path.clone()),
            ..Listen::default()
        },
    )
    .expect("a socket");
    Open {
        path,
        _server: server,
    }
});

/// A client with patience: what takes longer is a defect.
fn client() -> UnixStream {
    let stream = UnixStream::connect(&OPEN.path).expect("the door is open");
    stream
        .set_read_timeout(Some(Duration::from_secs(20)))
        .expect("a time-out");
    stream
        .set_write_timeout(Some(Duration::from_secs(20)))
        .expect("a time-out");
    stream
}

/// Judges one input.
///
/// # Panics
/// The reader broke what it promises.
pub fn judge(bytes: &[u8]) {
    let mut stranger = client();
    // The server may close while we still write, which is its right.
    let _ = stranger.write_all(bytes);
    let _ = stranger.shutdown(Shutdown::Write);
    let mut said = Vec::new();
    let _ = stranger.read_to_end(&mut said);
    for line in said
        .split(|byte| *byte == b'\n')
        .filter(|line| !line.is_empty())
    {
        let line = std::str::from_utf8(line).expect("the server speaks UTF-8");
        assert!(line.starts_with('{') && line.ends_with('}'), "{line}");
    }
    let mut next = client();
    next.write_all(b"{\"command\":\"hold\"}\n")
        .expect("the door is open");
    let mut answer = String::new();
    BufReader::new(&next)
        .read_line(&mut answer)
        .expect("an answer");
    assert!(answer.starts_with("{\"ok\":"), "{answer}");
}
