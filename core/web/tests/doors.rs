//! Who gets through the server to the controller, over real sockets. The controller here is a listener that counts who comes.

use std::fmt::Write as _;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::Path;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, channel};
use std::thread;
use std::time::Duration;

use tandem_web::{Entry, Options, Server};
use tungstenite::client::IntoClientRequest;
use tungstenite::http::HeaderValue;
use tungstenite::{Message, WebSocket};

const TOKEN: &str = "a token of sixteen";
/// Whoever names it may do less.
const WATCHING: &str = "a token to look with";
const PATIENCE: Duration = Duration::from_secs(20);

struct TestServer {
    _folder: tempfile::TempDir,
    server: Server,
    /// Everybody who came to the controller.
    connections: Receiver<UnixStream>,
}

impl TestServer {
    fn open() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("controller");
        let controller = UnixListener::bind(&path).unwrap();
        let (tell, connections) = channel();
        thread::spawn(move || {
            for connection in controller.incoming().map_while(Result::ok) {
                if tell.send(connection).is_err() {
                    return;
                }
            }
        });
        Self {
            server: start("127.0.0.1:0", &path).unwrap(),
            _folder: folder,
            connections,
        }
    }

    fn address(&self) -> SocketAddr {
        self.server.address
    }

    /// The status of a plain request, and its headers and body.
    fn ask(&self, request: &str) -> (u16, String) {
        let mut stream = TcpStream::connect(self.address()).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        stream.write_all(request.as_bytes()).unwrap();
        let (mut answer, mut bytes) = (String::new(), [0; 4096]);
        // A server that closes with unread bytes resets the connection behind its answer, and one that would go on keeps it open.
        while let Ok(count @ 1..) = stream.read(&mut bytes) {
            answer += &String::from_utf8_lossy(&bytes[..count]);
            if is_whole(&answer) {
                break;
            }
        }
        let status = answer.split(' ').nth(1).and_then(|code| code.parse().ok());
        (
            status.unwrap_or_else(|| panic!("{request}: {answer}")),
            answer,
        )
    }

    fn get(&self, path: &str, headers: &str) -> (u16, String) {
        let host = self.address();
        self.ask(&format!(
            "GET {path} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n{headers}\r\n"
        ))
    }

    fn page(&self, origin: &str, offered: &str) -> Result<WebSocket<TcpStream>, u16> {
        let stream = TcpStream::connect(self.address()).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        let mut request = format!("ws://{}/socket", self.address())
            .into_client_request()
            .unwrap();
        let headers = request.headers_mut();
        headers.insert("Origin", HeaderValue::from_str(origin).unwrap());
        headers.insert(
            "Sec-WebSocket-Protocol",
            HeaderValue::from_str(offered).unwrap(),
        );
        match tungstenite::client(request, stream) {
            Ok((page, _)) => Ok(page),
            Err(tungstenite::HandshakeError::Failure(tungstenite::Error::Http(answer))) => {
                Err(answer.status().as_u16())
            }
            Err(error) => panic!("{error}"),
        }
    }

    fn own(&self) -> String {
        format!("http://{}", self.address())
    }
}

/// Whether the answer has as many bytes as it says; one that says nothing ends with its connection.
fn is_whole(answer: &str) -> bool {
    let Some((head, body)) = answer.split_once("\r\n\r\n") else {
        return false;
    };
    let length = head.lines().find_map(|line| {
        let (name, value) = line.split_once(':')?;
        let is_length = name.eq_ignore_ascii_case("content-length");
        is_length.then(|| value.trim().parse::<usize>().unwrap())
    });
    length.is_some_and(|length| body.len() >= length)
}

fn start(address: &str, controller: &Path) -> Result<Server, String> {
    Server::start(Options {
        address: address.parse().unwrap(),
        names: vec![],
        tokens: Arc::new(|token| {
            let opening = (token == WATCHING).then(|| "{\"less\":true}".to_string());
            [TOKEN, WATCHING]
                .contains(&token)
                .then_some(Entry { opening })
        }),
        controller: controller.to_path_buf(),
    })
}

/// The hexadecimal digits of the token's bytes.
fn digits(token: &str) -> String {
    token.bytes().fold(String::new(), |mut digits, byte| {
        let _ = write!(digits, "{byte:02x}");
        digits
    })
}

fn offered(token: &str) -> String {
    format!("tandem.2, token.{}", digits(token))
}

#[test]
fn strangers_are_refused_and_the_controller_never_hears_of_them() {
    let server = TestServer::open();
    let own = server.own();
    for (origin, token) in [
        ("http://evil.example", TOKEN),
        ("http://evil.example:8080", TOKEN),
        ("null", TOKEN),
        (own.as_str(), "another token, as long"),
        (own.as_str(), ""),
    ] {
        assert_eq!(
            server.page(origin, &offered(token)).err(),
            Some(403),
            "{origin} {token}"
        );
    }
    assert_eq!(server.page(&own, "tandem.2").err(), Some(403));
    let (host, upgrade) = (
        server.address(),
        "Connection: Upgrade\r\nUpgrade: websocket\r\n\
        Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n",
    );
    let known = format!("Sec-WebSocket-Protocol: {}\r\n", offered(TOKEN));
    // A name that was bound to this computer: the browser calls the origin by the same name.
    let rebound = format!(
        "GET /socket HTTP/1.1\r\nHost: evil.example:{0}\r\nOrigin: http://evil.example:{0}\r\n{upgrade}{known}\r\n",
        host.port()
    );
    assert_eq!(server.ask(&rebound).0, 403);
    let without = format!("GET /socket HTTP/1.1\r\nHost: {host}\r\n{upgrade}{known}\r\n");
    assert_eq!(server.ask(&without).0, 403);
    for path in ["/", "/main.js", "/token", "/nothing"] {
        let named =
            format!("GET {path} HTTP/1.1\r\nHost: evil.example\r\nConnection: close\r\n\r\n");
        let (status, answer) = server.ask(&named);
        assert!(
            status == 403 && !answer.contains("<html"),
            "{path}: {answer}"
        );
    }
    assert!(
        server.connections.try_recv().is_err(),
        "somebody came to the controller"
    );
    // What was refused above is not refused to everybody.
    assert!(server.page(&own, &offered(TOKEN)).is_ok());
    assert!(server.connections.recv_timeout(PATIENCE).is_ok());
}

#[test]
fn the_token_is_asked_by_a_page_that_was_refused() {
    let server = TestServer::open();
    let bearer = |token: &str| {
        let header = format!("Authorization: Bearer {}\r\n", digits(token));
        server.get("/token", &header).0
    };
    assert_eq!(
        [bearer(TOKEN), bearer("another"), bearer("")],
        [200, 403, 403]
    );
    assert_eq!(server.get("/token", "").0, 403);
}

#[test]
fn what_is_said_in_a_page_s_name_comes_before_what_the_page_says() {
    let server = TestServer::open();
    let mut page = server.page(&server.own(), &offered(WATCHING)).unwrap();
    page.send(Message::text("{\"id\":1}")).unwrap();
    let mut controller = server.connections.recv_timeout(PATIENCE).unwrap();
    controller.set_read_timeout(Some(PATIENCE)).unwrap();
    controller
        .write_all(b"{\"greeting\":1}\n{\"answer\":0}\n{\"greeting\":2}\n")
        .unwrap();
    let mut lines = BufReader::new(controller).lines();
    assert_eq!(lines.next().unwrap().unwrap(), "{\"less\":true}");
    assert_eq!(lines.next().unwrap().unwrap(), "{\"id\":1}");
    assert_eq!(page.read().unwrap(), Message::text("{\"greeting\":2}"));
}

#[test]
fn lines_go_both_ways_as_messages_and_both_ends_close_together() {
    let server = TestServer::open();
    let mut page = server.page(&server.own(), &offered(TOKEN)).unwrap();
    let mut controller = server.connections.recv_timeout(PATIENCE).unwrap();
    controller.set_read_timeout(Some(PATIENCE)).unwrap();
    controller
        .write_all(b"{\"tandem\":1}\n{\"event\":\"x\"}\n")
        .unwrap();
    assert_eq!(page.read().unwrap(), Message::text("{\"tandem\":1}"));
    assert_eq!(page.read().unwrap(), Message::text("{\"event\":\"x\"}"));
    page.send(Message::text("{\"id\":1}")).unwrap();
    let mut line = String::new();
    let mut lines = BufReader::new(controller.try_clone().unwrap());
    lines.read_line(&mut line).unwrap();
    assert_eq!(line, "{\"id\":1}\n");
    drop(page);
    assert_eq!(lines.read_line(&mut line).unwrap(), 0, "the page is gone");

    let mut page = server.page(&server.own(), &offered(TOKEN)).unwrap();
    drop(server.connections.recv_timeout(PATIENCE).unwrap());
    assert!(page.read().map_or(true, |message| message.is_close()));
}

#[test]
fn a_message_is_one_line_and_none_is_larger_than_a_program() {
    let server = TestServer::open();
    for message in [
        Message::text("{\"id\":1}\n{\"id\":2}"),
        Message::binary(vec![0; 4]),
        Message::text("x".repeat((8 << 20) + 1)),
    ] {
        let mut page = server.page(&server.own(), &offered(TOKEN)).unwrap();
        let mut controller = server.connections.recv_timeout(PATIENCE).unwrap();
        controller.set_read_timeout(Some(PATIENCE)).unwrap();
        // The server may close while the rest is on its way.
        let _ = page.send(message);
        let mut heard = vec![];
        controller.read_to_end(&mut heard).unwrap();
        assert!(heard.is_empty(), "{}", String::from_utf8_lossy(&heard));
    }
}

/// Nothing that changes anything has a way in but the socket: what is sent along with a request is not read.
#[test]
fn bodies_and_paths_of_others_are_refused() {
    let server = TestServer::open();
    let host = server.address();
    for (method, path, length) in [
        ("POST", "/programs/../x", "1000000000"),
        ("PUT", "/x.ngc", "10"),
        ("POST", "/socket", "10"),
        ("DELETE", "/main.js", "0"),
    ] {
        let request = format!(
            "{method} {path} HTTP/1.1\r\nHost: {host}\r\nContent-Encoding: gzip\r\nContent-Length: {length}\r\nConnection: close\r\n\r\n"
        );
        assert_eq!(server.ask(&request).0, 405, "{method} {path}");
    }
    for path in [
        "/../Cargo.toml",
        "/%2e%2e/Cargo.toml",
        "/..%2fsrc/lib.rs",
        "//etc/passwd",
        "/vendor/../../src/lib.rs",
    ] {
        let (status, answer) = server.get(path, "");
        assert!(
            [400, 404].contains(&status) && !answer.contains("root:"),
            "{path}: {answer}"
        );
    }
    assert!(server.connections.try_recv().is_err());
}

#[test]
fn the_page_may_load_nothing_of_others_and_is_shown_in_no_frame() {
    let server = TestServer::open();
    let (status, answer) = server.get("/", "");
    assert_eq!(status, 200);
    for words in [
        "frame-ancestors 'none'",
        "default-src 'none'",
        "x-content-type-options: nosniff",
        "<html",
    ] {
        assert!(answer.contains(words), "{words}: {answer}");
    }
    assert!(!answer.contains("access-control"), "{answer}");
    let tag = answer
        .lines()
        .find_map(|line| line.strip_prefix("etag: "))
        .unwrap();
    assert_eq!(server.get("/", &format!("If-None-Match: {tag}\r\n")).0, 304);
}

#[test]
fn only_this_computer_is_served() {
    let nowhere = Path::new("/nowhere");
    for elsewhere in ["0.0.0.0:0", "[::]:0", "192.0.2.1:8080"] {
        let why = start(elsewhere, nowhere).unwrap_err();
        assert!(why.contains("this computer alone"), "{elsewhere}: {why}");
    }
}

/// One page more than there are places is told so, and finds one when another has gone.
#[test]
fn there_are_places_for_a_number_of_pages() {
    let server = TestServer::open();
    let mut pages: Vec<_> = (0..12)
        .map(|_| server.page(&server.own(), &offered(TOKEN)).unwrap())
        .collect();
    assert_eq!(server.page(&server.own(), &offered(TOKEN)).err(), Some(503));
    let mut gone = pages.pop().unwrap();
    gone.close(None).unwrap();
    while gone.read().is_ok() {}
    let again = (0..2000).find_map(|_| {
        thread::sleep(Duration::from_millis(10));
        server.page(&server.own(), &offered(TOKEN)).ok()
    });
    assert!(again.is_some());
}

#[test]
fn the_files_of_the_page_are_small() {
    fn bytes(folder: &Path) -> u64 {
        let entries = std::fs::read_dir(folder).unwrap().map(Result::unwrap);
        entries
            .map(|entry| {
                let path = entry.path();
                if path.is_dir() {
                    bytes(&path)
                } else {
                    entry.metadata().unwrap().len()
                }
            })
            .sum()
    }
    let own = Path::new(env!("CARGO_MANIFEST_DIR"));
    let all = bytes(&own.join("assets")) + bytes(&own.join("../view/assets"));
    assert!(all <= 600_000, "{all} bytes");
}
