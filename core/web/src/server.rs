//! The server: one thread of ordinary priority.

use std::net::{SocketAddr, TcpListener};
use std::path::PathBuf;
use std::sync::Arc;
use std::thread::{self, JoinHandle};

use axum::Router;
use axum::body::Body;
use axum::extract::ws::WebSocketUpgrade;
use axum::extract::{Request, State};
use axum::http::header::AUTHORIZATION;
use axum::http::{HeaderMap, Response, StatusCode, Uri};
use axum::middleware::{self, Next};
use axum::routing::get;
use axum::serve::ListenerExt;
use tokio::sync::{Semaphore, oneshot};

use crate::access::{AccessCheck, PROTOCOL, TokenCheck};
use crate::assets;
use crate::bridge;

/// Pages that are served at a time: the controller has more places than these, so that its other clients find one.
const MAX_PAGES: usize = 12;
/// Longest message of a page, bytes: a program may be in it.
const MAX_MESSAGE_BYTES: usize = 8 << 20;
/// Bytes that the system keeps for a page: telemetry that waits longer is old. A packed answer with a part of a path fits: where it
/// does not, its end waits until the browser has said that the beginning is there, which it puts off for 40 ms.
const SEND_BUFFER_BYTES: usize = 64 * 1024;
/// Stack of the thread, bytes: it is locked into memory with the rest.
const STACK_BYTES: usize = 512 * 1024;

/// What a server is asked for.
pub struct Options {
    /// Loopback address and port; port 0 lets the system choose.
    pub address: SocketAddr,
    /// Names beside the loopback ones by which this computer is asked for, through a proxy of the user's.
    pub names: Vec<String>,
    /// Says whether a token is accepted.
    pub tokens: TokenCheck,
    /// The controller's socket.
    pub controller: PathBuf,
}

/// Serves the page while it lives.
#[derive(Debug)]
pub struct Server {
    /// Where it is reached, with the port that the system chose for port 0.
    pub address: SocketAddr,
    over: Option<oneshot::Sender<()>>,
    handle: Option<JoinHandle<()>>,
}

struct ServerState {
    access: AccessCheck,
    controller: PathBuf,
    places: Arc<Semaphore>,
}

impl Server {
    /// Opens the port and starts the thread. Host; allocates.
    ///
    /// # Errors
    /// The address with the cause: it is taken, or not one of this computer alone.
    pub fn start(options: Options) -> Result<Self, String> {
        let asked = options.address;
        let at = |why: std::io::Error| format!("{asked}: {why}");
        if !asked.ip().is_loopback() {
            return Err(format!(
                "{asked}: the page is for this computer alone, 127.0.0.1 or [::1]; from elsewhere it is reached through a tunnel \
                 or a proxy of yours, by a name that --http-host adds"
            ));
        }
        let listener = TcpListener::bind(asked).map_err(at)?;
        listener.set_nonblocking(true).map_err(at)?;
        // What is accepted here inherits it from the listener.
        let _ = rustix::net::sockopt::set_socket_send_buffer_size(&listener, SEND_BUFFER_BYTES);
        let address = listener.local_addr().map_err(at)?;
        let state = Arc::new(ServerState {
            access: AccessCheck::new(address, &options.names, options.tokens),
            controller: options.controller,
            places: Arc::new(Semaphore::new(MAX_PAGES)),
        });
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_io()
            .build()
            .map_err(at)?;
        let (over, ends) = oneshot::channel();
        let serve = move || runtime.block_on(serve(listener, state, ends));
        let handle = thread::Builder::new()
            .name("tandem-web".to_string())
            .stack_size(STACK_BYTES)
            .spawn(serve)
            .map_err(at)?;
        Ok(Self {
            address,
            over: Some(over),
            handle: Some(handle),
        })
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        // The sender that goes away ends the thread, and with it every connection.
        drop(self.over.take());
        if let Some(handle) = self.handle.take() {
            let _ = handle.join();
        }
    }
}

async fn serve(listener: TcpListener, state: Arc<ServerState>, ends: oneshot::Receiver<()>) {
    let Ok(listener) = tokio::net::TcpListener::from_std(listener) else {
        return;
    };
    // Answers are short and wait for nothing.
    let listener = listener.tap_io(|stream| drop(stream.set_nodelay(true)));
    let router = Router::new()
        .route("/socket", get(socket))
        .route("/token", get(token))
        .fallback(get(file))
        .layer(middleware::from_fn_with_state(Arc::clone(&state), judge))
        .with_state(state);
    tokio::select! {
        _ = axum::serve(listener, router) => {}
        _ = ends => {}
    }
}

/// Judges every request by its host before anything else looks at it.
async fn judge(
    State(state): State<Arc<ServerState>>,
    request: Request,
    next: Next,
) -> Response<Body> {
    let mut response = match state.access.host(request.uri(), request.headers()) {
        Ok(()) => next.run(request).await,
        Err(why) => assets::plain(StatusCode::FORBIDDEN, why),
    };
    assets::guard(&mut response);
    response
}

async fn file(uri: Uri, headers: HeaderMap) -> Response<Body> {
    assets::answer(uri.path(), &headers)
}

/// Whether a token is accepted: a page is not told why its WebSocket was refused, and asks here.
async fn token(State(state): State<Arc<ServerState>>, headers: HeaderMap) -> Response<Body> {
    let named = headers
        .get(AUTHORIZATION)
        .and_then(|value| value.to_str().ok());
    let token = named
        .and_then(|named| named.strip_prefix("Bearer "))
        .unwrap_or_default();
    match state.access.token(token) {
        Ok(_) => assets::plain(StatusCode::OK, "the token opens"),
        Err(why) => assets::plain(StatusCode::FORBIDDEN, why),
    }
}

async fn socket(
    State(state): State<Arc<ServerState>>,
    headers: HeaderMap,
    upgrade: Result<WebSocketUpgrade, axum::extract::ws::rejection::WebSocketUpgradeRejection>,
) -> Response<Body> {
    let entry = match state.access.socket(&headers) {
        Ok(entry) => entry,
        Err(why) => return assets::plain(StatusCode::FORBIDDEN, why),
    };
    let Ok(upgrade) = upgrade else {
        return assets::plain(StatusCode::BAD_REQUEST, "this is the place of a WebSocket");
    };
    let Ok(place) = Arc::clone(&state.places).try_acquire_owned() else {
        return assets::plain(
            StatusCode::SERVICE_UNAVAILABLE,
            "as many pages as can be are open already",
        );
    };
    upgrade
        .protocols([PROTOCOL])
        .max_message_size(MAX_MESSAGE_BYTES)
        .max_frame_size(MAX_MESSAGE_BYTES)
        .on_upgrade(async move |page| {
            bridge::carry(page, &state.controller, entry).await;
            drop(place);
        })
}
