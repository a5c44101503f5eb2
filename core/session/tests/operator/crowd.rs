//! Those who are not known take no place of those who are.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering::Relaxed};
use std::thread;

use super::TestServer;

/// Strangers that come at the same time, and come again whenever they are sent away.
const STRANGERS: usize = 40;
/// Commands of the owner meanwhile.
const HOLDS: usize = 60;

#[test]
fn forty_strangers_who_come_again_and_again_do_not_keep_the_owner_out() {
    let server = TestServer::open();
    let (over, came) = (AtomicBool::new(false), AtomicUsize::new(0));
    let address = server.address();
    thread::scope(|scope| {
        for stranger in 0..STRANGERS {
            let (over, came) = (&over, &came);
            scope.spawn(move || {
                while !over.load(Relaxed) {
                    let Ok(mut stream) = TcpStream::connect(address) else {
                        continue;
                    };
                    came.fetch_add(1, Relaxed);
                    stream
                        .set_read_timeout(Some(std::time::Duration::from_secs(1)))
                        .unwrap();
                    // Some wait and some guess.
                    if stranger % 4 == 0 {
                        let _ =
                            stream.write_all(b"{\"token\":\"0123456789abcdef0123456789abcdef\"}\n");
                    }
                    // Until it is sent away, or hears nothing for a while.
                    let _ = stream.read(&mut [0; 256]);
                }
            });
        }
        while came.load(Relaxed) < STRANGERS {
            thread::yield_now();
        }
        let unix = (0..HOLDS).filter(|_| server.over_unix().holds()).count();
        let tcp = (0..HOLDS).filter(|_| server.over_tcp().holds()).count();
        over.store(true, Relaxed);
        assert_eq!(
            (unix, tcp),
            (HOLDS, HOLDS),
            "{} strangers came",
            came.load(Relaxed)
        );
    });
}

#[test]
fn whoever_is_known_has_sixteen_places_at_each_door() {
    let server = TestServer::open();
    let mut unix: Vec<_> = (0..16).map(|_| server.over_unix()).collect();
    assert!(unix.iter_mut().all(super::Client::holds));
    let mut tcp: Vec<_> = (0..16).map(|_| server.over_tcp()).collect();
    assert!(
        tcp.iter_mut().all(super::Client::holds),
        "the other door has its own"
    );
    let mut late = String::new();
    let mut stream = TcpStream::connect(server.address()).unwrap();
    writeln!(stream, "{{\"token\":\"{}\"}}", server.token).unwrap();
    stream.read_to_string(&mut late).unwrap();
    assert!(late.contains("16 clients are here already"), "{late}");
    drop(tcp.pop());
    // The server sees that a moment later.
    while !server.try_tcp() {
        thread::yield_now();
    }
}

impl TestServer {
    fn try_tcp(&self) -> bool {
        let mut answer = [0; 256];
        let mut stream = TcpStream::connect(self.address()).unwrap();
        writeln!(stream, "{{\"token\":\"{}\"}}", self.token).unwrap();
        let count = stream.read(&mut answer).unwrap_or(0);
        answer[..count].starts_with(b"{\"ok\"")
    }
}
