//! `GET /ws?document=ID`: messages between a window and its document.

use std::sync::Arc;

use axum::extract::ws::{CloseFrame, Message, WebSocket, WebSocketUpgrade, close_code};
use axum::extract::{Query, State};
use axum::http::StatusCode;
use axum::response::Response;
use futures_util::SinkExt as _;
use futures_util::stream::{SplitSink, StreamExt as _};
use serde::Deserialize;

use super::Studio;
use super::api::refusal;
use crate::protocol::Reply;
use crate::session::{Document, Outgoing, Window};

/// Maximum size of a message of a page, bytes: a selection of 100,000 vertices has 0.7 MB.
pub(super) const MAX_MESSAGE: usize = 4 << 20;

/// The subprotocol that is answered; the other one carries the token.
const PROTOCOL: &str = "plumbline";

#[derive(Deserialize)]
pub(super) struct Wanted {
    document: String,
}

/// Connects a window.
pub(super) async fn connect(
    State(studio): State<Arc<Studio>>,
    Query(wanted): Query<Wanted>,
    upgrade: WebSocketUpgrade,
) -> Response {
    let Some(document) = studio.documents.find(&wanted.document) else {
        return refusal(StatusCode::NOT_FOUND, "there is no such document");
    };
    if let Err(why) = document.opened().await {
        return refusal(StatusCode::GONE, &why);
    }
    upgrade
        .protocols([PROTOCOL])
        .max_message_size(MAX_MESSAGE)
        .max_frame_size(MAX_MESSAGE)
        .on_upgrade(move |socket| converse(document, socket))
}

async fn converse(document: Arc<Document>, socket: WebSocket) {
    let (sink, mut stream) = socket.split();
    let window = document.attach();
    let sending = tokio::spawn(send(Arc::clone(&window), sink));
    while let Some(Ok(message)) = stream.next().await {
        match message {
            Message::Text(text) => document.message(&window, &text),
            Message::Binary(_) => window.reply(&Reply::failed(None, "malformed message: it is binary")),
            Message::Close(_) => break,
            Message::Ping(_) | Message::Pong(_) => {}
        }
        if window.is_closed() {
            break;
        }
    }
    document.detach(&window);
    // It ends after what waits is sent, or the page is gone.
    let _ = sending.await;
}

async fn send(window: Arc<Window>, mut sink: SplitSink<WebSocket, Message>) {
    while let Some(outgoing) = window.next().await {
        let message = match outgoing {
            Outgoing::Text(text) => Message::Text(text.as_ref().into()),
            Outgoing::Buffer(bytes) => Message::Binary(bytes.into()),
        };
        if sink.send(message).await.is_err() {
            window.close();
            return;
        }
    }
    let goodbye = CloseFrame { code: close_code::NORMAL, reason: "".into() };
    let _ = sink.send(Message::Close(Some(goodbye))).await;
}
