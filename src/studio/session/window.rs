//! What waits to be sent to one window.
//!
//! Texts keep their order, and of state, history and activity only the newest waits. Buffers wait in two batches: one that is being
//! sent, and the newest of each kind and item since. The second takes over when the first is sent, so that a slow window gets
//! fewer pictures, no kind waits forever behind another, and memory is bounded by two sets of buffers, which windows share.

use std::collections::VecDeque;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tokio::sync::Notify;

use crate::outbox::Buffer;
use crate::protocol::{Reply, ToPage, text};

/// Texts that may wait. A window sends as many messages at most before it reads; one that does not read is closed.
const MAX_TEXTS: usize = 4096;

/// Bytes before the payload of a buffer.
const HEADER_BYTES: usize = 16;

/// A window, by its number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WindowId(u64);

/// A text of which only the newest waits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Slot {
    State,
    History,
    Working,
    ChangedOnDisk,
}

impl Slot {
    fn of(message: &ToPage) -> Option<Self> {
        match message {
            ToPage::State(_) => Some(Self::State),
            ToPage::History(_) => Some(Self::History),
            ToPage::Working(_) => Some(Self::Working),
            ToPage::ChangedOnDisk(_) => Some(Self::ChangedOnDisk),
            ToPage::Hello(_) | ToPage::Notice(_) | ToPage::Closed(_) => None,
        }
    }
}

#[derive(Debug)]
struct Waiting {
    buffer: Buffer,
    edit: u32,
}

impl Waiting {
    /// Header and payload.
    fn message(&self) -> Vec<u8> {
        let payload = &self.buffer.bytes;
        let mut bytes = Vec::with_capacity(HEADER_BYTES + payload.len());
        for word in [self.buffer.kind, self.buffer.item, self.edit, payload.len() as u32] {
            bytes.extend(word.to_le_bytes());
        }
        bytes.extend_from_slice(payload);
        bytes
    }
}

#[derive(Debug, Default)]
struct Queue {
    texts: VecDeque<(Option<Slot>, Arc<str>)>,
    sending: VecDeque<Waiting>,
    newest: Vec<Waiting>,
    /// Number of the last message of this window that was applied.
    edit: u32,
    closed: bool,
}

/// What is sent next.
#[derive(Debug, PartialEq, Eq)]
pub enum Outgoing {
    /// A message.
    Text(Arc<str>),
    /// A buffer with its header.
    Buffer(Vec<u8>),
}

/// A window of a document.
#[derive(Debug)]
pub struct Window {
    /// Its number.
    pub id: WindowId,
    queue: Mutex<Queue>,
    ready: Notify,
}

impl Window {
    /// A window to which nothing was sent yet.
    pub fn new() -> Arc<Self> {
        static NEXT: AtomicU64 = AtomicU64::new(1);
        let id = WindowId(NEXT.fetch_add(1, Ordering::Relaxed));
        Arc::new(Self { id, queue: Mutex::default(), ready: Notify::new() })
    }

    fn queue(&self) -> MutexGuard<'_, Queue> {
        // Nothing in here panics while it holds the lock.
        self.queue.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Puts a message into the queue.
    pub fn send(&self, message: &ToPage) {
        self.push(Slot::of(message), text(message).into());
    }

    /// Puts a reply into the queue.
    pub fn reply(&self, reply: &Reply) {
        self.push(None, text(reply).into());
    }

    fn push(&self, slot: Option<Slot>, text: Arc<str>) {
        let mut queue = self.queue();
        let same = slot.and_then(|slot| queue.texts.iter().position(|(waiting, _)| *waiting == Some(slot)));
        match same {
            Some(k) => queue.texts[k].1 = text,
            None => queue.texts.push_back((slot, text)),
        }
        queue.closed |= queue.texts.len() > MAX_TEXTS;
        drop(queue);
        self.ready.notify_one();
    }

    /// Puts the buffers of one slice into the queue.
    pub fn buffers(&self, batch: &[Buffer]) {
        if batch.is_empty() {
            return;
        }
        let mut queue = self.queue();
        let edit = queue.edit;
        queue.newest.retain(|old| !batch.iter().any(|b| (b.kind, b.item) == (old.buffer.kind, old.buffer.item)));
        queue.newest.extend(batch.iter().map(|buffer| Waiting { buffer: buffer.clone(), edit }));
        drop(queue);
        self.ready.notify_one();
    }

    /// The message with this number of this window was applied: buffers from now on include it.
    pub fn applied(&self, id: u32) {
        self.queue().edit = id;
    }

    /// What is sent next, where something waits. No buffer is sent before a text that was put before it.
    pub fn try_next(&self) -> Option<Outgoing> {
        let mut queue = self.queue();
        if let Some((_, text)) = queue.texts.pop_front() {
            return Some(Outgoing::Text(text));
        }
        if queue.sending.is_empty() {
            queue.sending = std::mem::take(&mut queue.newest).into();
        }
        let waiting = queue.sending.pop_front()?;
        drop(queue);
        Some(Outgoing::Buffer(waiting.message()))
    }

    /// What is sent next; `None` once the window is closed and everything is sent.
    pub async fn next(&self) -> Option<Outgoing> {
        loop {
            if let Some(outgoing) = self.try_next() {
                return Some(outgoing);
            }
            if self.is_closed() {
                return None;
            }
            self.ready.notified().await;
        }
    }

    /// Nothing more is sent but what waits.
    pub fn close(&self) {
        self.queue().closed = true;
        self.ready.notify_one();
    }

    /// Whether it was closed.
    pub fn is_closed(&self) -> bool {
        self.queue().closed
    }
}

#[cfg(test)]
#[path = "window_tests.rs"]
mod tests;
