//! What a document sends to its windows.
//!
//! A buffer is a binary message: four little-endian `u32` (kind, item, number of the last edit that it includes, bytes of payload),
//! then the payload. Of each kind and item only the newest waits for a window, so that a slow window gets fewer pictures and nothing
//! piles up.

use std::sync::Arc;

/// A binary message for the windows.
#[derive(Clone, Debug)]
pub struct Buffer {
    /// What it is: a number of the workspace's own list, the same in `ui/src`.
    pub kind: u32,
    /// Which one of that kind.
    pub item: u32,
    /// Payload, little-endian.
    pub bytes: Arc<[u8]>,
}

/// Buffers and notices of one slice of work, in order.
#[derive(Debug, Default)]
pub struct Outbox {
    /// Buffers.
    pub buffers: Vec<Buffer>,
    /// Texts for the user: warnings of a method.
    pub notices: Vec<String>,
}

impl Outbox {
    /// Adds a buffer of numbers (`f32`, `u32`, `u8`).
    pub fn buffer<T: bytemuck::NoUninit>(&mut self, kind: u32, item: u32, values: &[T]) {
        self.buffers.push(Buffer { kind, item, bytes: bytemuck::cast_slice::<T, u8>(values).into() });
    }

    /// Adds a text for the user.
    pub fn notice(&mut self, text: impl Into<String>) {
        self.notices.push(text.into());
    }
}
