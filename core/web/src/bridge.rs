//! One page: lines between its WebSocket and the controller's socket, each way by itself, so that a page that reads slowly can
//! still say *hold*.

use std::path::Path;

use axum::extract::ws::{Message, WebSocket};
use futures_util::stream::{SplitSink, SplitStream};
use futures_util::{SinkExt, StreamExt};
use tokio::io::{AsyncBufReadExt, AsyncWriteExt, BufReader, Lines};
use tokio::net::UnixStream;
use tokio::net::unix::{OwnedReadHalf, OwnedWriteHalf};

use crate::access::Entry;

/// Lines that the page does not hear where something is said in its name: the greeting before it, and its answer.
const UNHEARD: usize = 2;

/// Carries lines until one side ends; then both do.
pub async fn carry(page: WebSocket, controller: &Path, entry: Entry) {
    let Ok(stream) = UnixStream::connect(controller).await else {
        return;
    };
    let (from_controller, mut to_controller) = stream.into_split();
    let mut from_controller = BufReader::new(from_controller).lines();
    if let Some(opening) = entry.opening {
        let line = opening + "\n";
        if to_controller.write_all(line.as_bytes()).await.is_err() {
            return;
        }
        for _ in 0..UNHEARD {
            if !matches!(from_controller.next_line().await, Ok(Some(_))) {
                return;
            }
        }
    }
    let (to_page, from_page) = page.split();
    tokio::select! {
        () = say(from_page, to_controller) => {}
        () = tell(from_controller, to_page) => {}
    }
}

/// What the page says. A message is one line: a page cannot smuggle a second one past its answer.
async fn say(mut page: SplitStream<WebSocket>, mut controller: OwnedWriteHalf) {
    while let Some(Ok(message)) = page.next().await {
        let line = match message {
            Message::Text(line) if !line.contains('\n') => line,
            Message::Ping(_) | Message::Pong(_) => continue,
            Message::Text(_) | Message::Binary(_) | Message::Close(_) => return,
        };
        let mut bytes = Vec::with_capacity(line.len() + 1);
        bytes.extend_from_slice(line.as_bytes());
        bytes.push(b'\n');
        if controller.write_all(&bytes).await.is_err() {
            return;
        }
    }
}

/// What the page is told. While it takes nothing, nothing is read of the controller, which then leaves status lines out and
/// counts them: what waits here is one line.
async fn tell(mut lines: Lines<BufReader<OwnedReadHalf>>, mut page: SplitSink<WebSocket, Message>) {
    while let Ok(Some(line)) = lines.next_line().await {
        if page.send(Message::Text(line.into())).await.is_err() {
            return;
        }
    }
    // Where the page is gone already, it need not be told.
    let _ = page.close().await;
}
