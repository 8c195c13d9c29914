//! How to read a clip, and what became of it.

use serde::Serialize;

use super::FieldOrder;

/// What to do with interlaced pictures.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Deinterlace {
    /// Rebuild the missing lines of the earlier field (module `deinterlace`) in pictures flagged as interlaced.
    #[default]
    Auto,
    /// The same in all pictures, which have the top field first.
    Top,
    /// The same in all pictures, which have the bottom field first.
    Bottom,
    /// Stop with [`super::MediaError::Interlaced`].
    Refuse,
    /// Deliver the woven lines as they are.
    Off,
}

/// Options of [`super::VideoReader::open`].
#[derive(Clone, Copy, Debug, Default)]
pub struct ReadOptions {
    /// Threads of the decoder; 0: as many as there are processors.
    pub threads: usize,
    /// What to do with interlaced pictures.
    pub deinterlace: Deinterlace,
}

/// What became of a clip that was read to its end.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct ReadReport {
    /// Frames delivered.
    pub frames: u64,
    /// Of these: with concealed errors, or repeated in place of a lost one.
    pub corrupt: u64,
    /// Of these: repetitions in place of pictures that could not be decoded at all.
    pub concealed: u64,
    /// Packets that the demuxer or decoder rejected.
    pub bad_packets: u64,
    /// Pictures lost at the very end, where nothing stands in for them.
    pub lost: u64,
    /// Frames whose time was missing or did not increase, and was set from its neighbors.
    pub retimed: u64,
    /// Frames that were deinterlaced.
    pub deinterlaced: u64,
    /// Pictures without a flag look interlaced, in this order.
    pub unflagged_fields: Option<FieldOrder>,
    /// The file ended before its own index says.
    pub truncated: bool,
}
