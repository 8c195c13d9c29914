//! A server that runs, requests byte by byte and WebSockets, for the tests.

use std::io::{Read as _, Write as _};
use std::net::{SocketAddr, TcpStream};
use std::path::Path;
use std::thread::JoinHandle;
use std::time::Duration;

use futures_util::{SinkExt as _, StreamExt as _};
use serde_json::{Value, json};
use tokio::sync::oneshot;
use tokio_tungstenite::tungstenite::client::IntoClientRequest as _;
use tokio_tungstenite::tungstenite::http::HeaderValue;
use tokio_tungstenite::tungstenite::{Error, Message};
use tokio_tungstenite::{MaybeTlsStream, WebSocketStream, connect_async};

use super::{Options, Server};
use crate::session::Timing;

/// A server that runs, and a session with it.
pub(super) struct Running {
    pub(super) folder: tempfile::TempDir,
    pub(super) address: SocketAddr,
    pub(super) session: String,
    pub(super) once: String,
    pub(super) stop: Option<oneshot::Sender<()>>,
    pub(super) thread: Option<JoinHandle<()>>,
}

pub(super) struct Answer {
    pub(super) status: u16,
    pub(super) head: String,
    pub(super) body: Vec<u8>,
}

impl Answer {
    pub(super) fn json(&self) -> Value {
        serde_json::from_slice(&self.body).unwrap_or(Value::Null)
    }
}

/// The number in the file outside the folders: too long to be part of a temporary name by chance.
pub(super) const SECRET: u32 = 987_654_321;

pub(super) fn options(folder: &Path) -> Options {
    let project = folder.join("project");
    std::fs::create_dir_all(project.join("below")).expect("a folder");
    std::fs::write(project.join("a.fake"), r#"{"numbers":[1,2,3]}"#).expect("written");
    std::fs::write(folder.join("secret.fake"), format!(r#"{{"numbers":[{SECRET}]}}"#)).expect("written");
    Options {
        host: "127.0.0.1".to_owned(),
        port: 0,
        tls: None,
        folders: vec![project],
        file: None,
        state_folder: Some(folder.join("state")),
        timing: Timing { autosave: Duration::from_millis(20), poll: Duration::from_millis(20) },
    }
}

pub(super) fn runtime() -> tokio::runtime::Runtime {
    tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build().expect("a runtime")
}

/// Starts a server on a thread of its own: its address, and what ends it.
pub(super) fn serve(options: Options) -> (String, oneshot::Sender<()>, JoinHandle<()>) {
    let (stop, stopped) = oneshot::channel();
    let (give, take) = std::sync::mpsc::channel();
    let thread = std::thread::spawn(move || {
        let runtime = runtime();
        runtime.block_on(async {
            let server = Server::bind(options).await.expect("a server");
            give.send(server.url()).expect("the test waits");
            server.run(async { drop(stopped.await) }).await;
        });
        runtime.shutdown_timeout(Duration::from_millis(100));
    });
    (take.recv().expect("a server"), stop, thread)
}

pub(super) fn running() -> Running {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let options = options(folder.path());
    start_in(folder, options)
}

pub(super) fn start_in(folder: tempfile::TempDir, options: Options) -> Running {
    let (url, stop, thread) = serve(options);
    let (address, once) = url.strip_prefix("http://").and_then(|u| u.split_once("/#token=")).expect("an address");
    let mut running = Running {
        folder,
        address: address.parse().expect("an address"),
        session: String::new(),
        once: once.to_owned(),
        stop: Some(stop),
        thread: Some(thread),
    };
    let answer = running.exchange();
    running.session = answer.json()["session"].as_str().expect("a session").to_owned();
    running
}

impl Drop for Running {
    fn drop(&mut self) {
        self.end();
    }
}

impl Running {
    pub(super) fn end(&mut self) {
        drop(self.stop.take());
        if let Some(thread) = self.thread.take() {
            thread.join().expect("the server ends");
        }
    }

    /// A request, byte for byte, on a connection of its own.
    pub(super) fn raw(&self, text: &str) -> Answer {
        let mut stream = TcpStream::connect(self.address).expect("a connection");
        stream.set_read_timeout(Some(Duration::from_secs(20))).expect("a time limit");
        // What is refused early may end the connection before everything is written.
        let _ = stream.write_all(text.as_bytes());
        let mut bytes = Vec::new();
        let _ = stream.read_to_end(&mut bytes);
        let end = bytes.windows(4).position(|w| w == b"\r\n\r\n").expect("a head");
        let head = String::from_utf8_lossy(&bytes[..end]).to_lowercase();
        let status = head.split(' ').nth(1).and_then(|s| s.parse().ok()).expect("a status");
        Answer { status, head, body: bytes[end + 4..].to_vec() }
    }

    pub(super) fn request(&self, method: &str, path: &str, more: &[(&str, &str)], body: &str) -> Answer {
        let mut text = format!("{method} {path} HTTP/1.1\r\nConnection: close\r\nContent-Length: {}\r\n", body.len());
        let host = self.address.to_string();
        let host = [("Host", host.as_str())];
        let own = if more.iter().any(|(name, _)| *name == "Host") { &[][..] } else { &host[..] };
        for (name, value) in own.iter().chain(more) {
            text.extend([name, ": ", value, "\r\n"]);
        }
        self.raw(&(text + "\r\n" + body))
    }

    pub(super) fn get(&self, path: &str) -> Answer {
        self.request("GET", path, &[("x-plumbline-session", &self.session)], "")
    }

    pub(super) fn post(&self, path: &str, body: &Value) -> Answer {
        let headers = [("x-plumbline-session", self.session.as_str()), ("Content-Type", "application/json")];
        self.request("POST", path, &headers, &body.to_string())
    }

    pub(super) fn exchange(&self) -> Answer {
        let body = json!({ "token": self.once }).to_string();
        self.request("POST", "/api/session", &[("Content-Type", "application/json")], &body)
    }

    /// Opens the file; its id.
    pub(super) fn open(&self, path: &str) -> String {
        let answer = self.post("/api/open", &json!({ "path": path }));
        assert_eq!(answer.status, 200, "{}", answer.json());
        answer.json()["document"].as_str().expect("an id").to_owned()
    }

    pub(super) async fn socket(&self, document: &str, more: &[(&'static str, &str)]) -> Result<Socket, Error> {
        let mut request = format!("ws://{}/ws?document={document}", self.address).into_client_request()?;
        let protocols = format!("plumbline, token.{}", self.session);
        let headers = request.headers_mut();
        headers.insert("sec-websocket-protocol", HeaderValue::from_str(&protocols).expect("a value"));
        for (name, value) in more {
            headers.insert(*name, HeaderValue::from_str(value).expect("a value"));
        }
        connect_async(request).await.map(|(socket, _)| socket)
    }
}

pub(super) type Socket = WebSocketStream<MaybeTlsStream<tokio::net::TcpStream>>;

pub(super) async fn send(socket: &mut Socket, message: Value) {
    socket.send(Message::text(message.to_string())).await.expect("sent");
}

/// The next text for which `is_it` holds.
pub(super) async fn until(socket: &mut Socket, is_it: impl Fn(&Value) -> bool) -> Value {
    loop {
        let message = tokio::time::timeout(Duration::from_secs(20), socket.next()).await.expect("in time");
        if let Message::Text(text) = message.expect("a message").expect("a message") {
            let value: Value = serde_json::from_str(&text).expect("JSON");
            if is_it(&value) {
                return value;
            }
        }
    }
}

pub(super) fn status_of(result: Result<Socket, Error>) -> u16 {
    match result {
        Err(Error::Http(response)) => response.status().as_u16(),
        Err(other) => panic!("{other}"),
        Ok(_) => 101,
    }
}
