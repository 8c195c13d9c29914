//! A document of the tiny workspace of numbers, and windows that read, for the tests.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use super::{Document, Outgoing, Status, Surroundings, Timing, Window};
use crate::fake::Fake;
use crate::recovery::Recovery;

pub(super) const PATIENCE: Duration = Duration::from_secs(20);

pub(super) fn pause(ms: u64) {
    let until = Instant::now() + Duration::from_millis(ms);
    while Instant::now() < until {
        std::thread::park_timeout(until.saturating_duration_since(Instant::now()));
    }
}

pub(super) fn eventually(what: &str, mut is_so: impl FnMut() -> bool) {
    let end = Instant::now() + PATIENCE;
    while !is_so() {
        assert!(Instant::now() < end, "{what}");
        pause(2);
    }
}

/// A document in a folder of its own.
pub(super) struct Opened {
    pub(super) folder: tempfile::TempDir,
    pub(super) document: Arc<Document>,
}

pub(super) fn surroundings(folder: &Path) -> Surroundings {
    let recovery = Recovery::in_folder(folder.join("state")).expect("a folder");
    let timing = Timing { autosave: Duration::from_millis(20), poll: Duration::from_millis(20) };
    Surroundings { recovery: Some(recovery), timing, ..Surroundings::default() }
}

pub(super) fn open_again(folder: tempfile::TempDir) -> Opened {
    let around = surroundings(folder.path());
    let document = Document::open::<Fake>("1", &file_in(&folder), around).expect("threads");
    eventually("opening", || document.status() != Status::Opening);
    assert_eq!(document.status(), Status::Open);
    Opened { folder, document }
}

pub(super) fn file_in(folder: &tempfile::TempDir) -> PathBuf {
    folder.path().join("a.fake")
}

pub(super) fn opened(text: &str) -> Opened {
    let folder = tempfile::tempdir().expect("a temporary folder");
    std::fs::write(file_in(&folder), text).expect("written");
    open_again(folder)
}

pub(super) fn three() -> Opened {
    opened(r#"{"numbers":[1,2,3]}"#)
}

impl Opened {
    pub(super) fn window(&self) -> Client<'_> {
        let window = self.document.attach();
        let (state, history) = (Value::Null, Value::Null);
        Client { document: &self.document, window, next: 1, state, history, working: false, buffers: Vec::new() }
    }

    /// Ends the document as the end of the program does.
    pub(super) fn end(self) -> tempfile::TempDir {
        self.document.close();
        assert!(self.document.join(Instant::now() + PATIENCE), "the threads end");
        self.folder
    }

    pub(super) fn on_disk(&self) -> String {
        std::fs::read_to_string(file_in(&self.folder)).expect("the file")
    }
}

/// A window that reads.
pub(super) struct Client<'a> {
    pub(super) document: &'a Document,
    pub(super) window: Arc<Window>,
    pub(super) next: u32,
    pub(super) state: Value,
    pub(super) history: Value,
    pub(super) working: bool,
    pub(super) buffers: Vec<Vec<u8>>,
}

impl Client<'_> {
    /// Sends a message; its number.
    pub(super) fn send(&mut self, mut message: Value) -> u32 {
        let id = self.next;
        self.next += 1;
        message["id"] = id.into();
        self.document.message(&self.window, &message.to_string());
        id
    }

    /// The next text, where one comes in time.
    pub(super) fn read(&mut self) -> Value {
        let end = Instant::now() + PATIENCE;
        loop {
            match self.window.try_next() {
                Some(Outgoing::Text(text)) => return self.note(serde_json::from_str(&text).expect("JSON")),
                Some(Outgoing::Buffer(bytes)) => self.buffers.push(bytes),
                None => {
                    assert!(Instant::now() < end, "a message is missing");
                    pause(1);
                }
            }
        }
    }

    pub(super) fn note(&mut self, message: Value) -> Value {
        self.working = message["working"].as_bool().unwrap_or(self.working);
        for (name, kept) in [("state", &mut self.state), ("history", &mut self.history)] {
            if let Some(value) = message.get(name) {
                *kept = value.clone();
            }
        }
        message
    }

    pub(super) fn until(&mut self, is_it: impl Fn(&Value) -> bool) -> Value {
        loop {
            let message = self.read();
            if is_it(&message) {
                return message;
            }
        }
    }

    /// Sends a message and reads up to its reply.
    pub(super) fn ask(&mut self, message: Value) -> Value {
        let id = self.send(message);
        self.until(|m| m["reply"] == id)
    }

    pub(super) fn done(&mut self, message: Value) {
        let reply = self.ask(message);
        assert!(reply.get("error").is_none(), "{reply}");
    }

    pub(super) fn sum(&mut self) -> f64 {
        self.ask(json!({"ask": {"ask": "sum"}}))["result"].as_f64().expect("a sum")
    }

    pub(super) fn labels(&self) -> Vec<String> {
        let steps = self.history["steps"].as_array().expect("steps");
        steps.iter().map(|s| s["label"].as_str().expect("a label").to_owned()).collect()
    }

    pub(super) fn rest(&mut self) {
        self.until(|m| m["working"] == false);
    }

    /// Reads until the document computes.
    pub(super) fn until_it_works(&mut self) {
        while !self.working {
            self.read();
        }
    }
}

pub(super) fn set(at: usize, to: f64) -> Value {
    json!({"edit": {"do": "set", "at": at, "to": to}})
}

pub(super) fn drag(at: usize, to: f64) -> Value {
    json!({"edit": {"do": "set", "at": at, "to": to}, "newest": true})
}
