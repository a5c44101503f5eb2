//! How many clients may be there: each kind at each listener has places of its own, so that who is not known takes none of
//! those of whoever is.

use std::time::{Duration, Instant};

use super::client::{Client, ClientKind};
use super::reply::Problem;
use super::session::MAX_OWNERS;

/// Most clients of other users, at one listener.
const MAX_GUESTS: usize = 4;
/// Most clients that have not said who they are, at one listener. Each costs a socket and a few hundred bytes.
const MAX_STRANGERS: usize = 32;
/// How long a stranger keeps its place, though others wait for it. A client that knows the token sends it right after it
/// has connected; on a computer that is short of processor time that may take some tens of milliseconds.
const GRACE: Duration = Duration::from_millis(100);

/// Whether `listener` has a place for one more of a kind.
pub fn has_place(clients: &[Client], listener: usize, kind: ClientKind) -> bool {
    count(clients, listener, kind) < most(kind)
}

/// What a client is told for which there is no place.
pub fn crowded(kind: ClientKind) -> Problem {
    Problem::crowded(most(kind))
}

/// Makes a place for one more stranger at `listener`: the oldest goes, unless it has only just come. `false` where there is
/// none: whoever comes now waits to be accepted, after those who came before.
pub fn make_place_for_stranger(clients: &mut [Client], listener: usize, now: Instant) -> bool {
    if has_place(clients, listener, ClientKind::Stranger) {
        return true;
    }
    let strangers = clients
        .iter_mut()
        .filter(|client| is(client, listener, ClientKind::Stranger));
    let Some(oldest) = strangers
        .max_by_key(|client| client.age(now))
        .filter(|oldest| oldest.age(now) >= GRACE)
    else {
        return false;
    };
    let why =
        "its place is needed: the first line over TCP is {\"token\":\"…\"}, at once".to_string();
    oldest.turn_away(&Problem::refused("the connection", why), now);
    oldest.drop_now();
    true
}

fn most(kind: ClientKind) -> usize {
    match kind {
        ClientKind::Owner => MAX_OWNERS,
        ClientKind::Guest => MAX_GUESTS,
        ClientKind::Stranger => MAX_STRANGERS,
    }
}

fn count(clients: &[Client], listener: usize, kind: ClientKind) -> usize {
    clients
        .iter()
        .filter(|client| is(client, listener, kind))
        .count()
}

fn is(client: &Client, listener: usize, kind: ClientKind) -> bool {
    !client.is_gone() && client.listener == listener && client.kind() == kind
}
