//! The operator's page, and the server that hands it to a browser. The page is a client of the resident controller like any
//! other: what it says goes line by line through a WebSocket to the controller's socket, and nothing is done here in between.
//!
//! What is open to a browser is open to every page that the browser shows, so each request is judged before anything is done:
//! its `Host` by a list of names (a foreign name may be bound to 127.0.0.1), the `Origin` of a WebSocket by the same list, and a
//! token that only the address printed at the start carries. Requests that change something have no other way in: the server
//! answers GET alone and reads no body.

mod access;
mod assets;
mod bridge;
mod server;

pub use access::{Entry, TokenCheck};
pub use server::{Options, Server};
