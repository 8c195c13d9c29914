//! Options for reading a clip, and a report.

use serde::{Deserialize, Serialize};

use super::FieldOrder;

/// Deinterlacing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum Deinterlace {
    /// Pictures flagged as interlaced are deinterlaced by field; others are left alone.
    ///
    /// The missing lines of the earlier field are rebuilt (module `deinterlace`).
    #[default]
    Auto,
    /// All pictures are deinterlaced, the top field being earlier.
    Top,
    /// All pictures are deinterlaced, the bottom field being earlier.
    Bottom,
    /// Pictures are taken as they are.
    ///
    /// The woven lines are delivered.
    Off,
    /// Interlaced input is an error.
    ///
    /// Reading stops with [`super::MediaError::Input`].
    Refuse,
}

/// Options of [`super::VideoReader::open`].
#[derive(Clone, Copy, Debug, Default)]
pub struct ReadOptions {
    /// Threads of the decoder; 0: as many as there are processors.
    pub threads: usize,
    /// What to do with interlaced pictures.
    pub deinterlace: Deinterlace,
    /// A file that ends before its container says is [`super::MediaError::Input`], as early as that shows; without it, it is read
    /// as far as it goes, and [`ReadReport::truncated`] is set.
    pub strict: bool,
}

/// What became of a clip that was read to its end.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct ReadReport {
    /// Frames delivered.
    pub frames: u64,
    /// Of these: with concealed errors, or repeated instead of a lost one.
    pub corrupt: u64,
    /// Of these: repetitions instead of pictures that could not be decoded at all.
    pub concealed: u64,
    /// Packets that the demuxer or decoder rejected.
    pub bad_packets: u64,
    /// Pictures lost at the very end, without replacement.
    pub lost: u64,
    /// Frames whose time was missing or did not increase, and was set from its neighbors.
    pub retimed: u64,
    /// Frames that were deinterlaced.
    pub deinterlaced: u64,
    /// Pictures without a flag look interlaced, in this order.
    pub unflagged_fields: Option<FieldOrder>,
    /// The file ended before its container says, within the wanted span.
    pub truncated: bool,
    /// Frames that the container announces, or that its length and mean rate make; only where `truncated`.
    pub announced: Option<u64>,
}

impl ReadReport {
    /// What a file that is cut short has and should have, in words; `None` for one that is not.
    pub fn shortfall(&self) -> Option<String> {
        let frames = self.frames;
        self.truncated.then(|| match self.announced.filter(|n| *n > frames) {
            Some(announced) => format!("the file is cut short: {frames} of {announced} frames are there"),
            None => format!("the file is cut short after {frames} frames"),
        })
    }
}

impl std::fmt::Display for ReadReport {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} frames", self.frames)?;
        for (n, what) in [
            (self.corrupt, "damaged"),
            (self.concealed, "repeated for lost ones"),
            (self.bad_packets, "bad packets"),
            (self.lost, "lost at the end"),
            (self.retimed, "with a new time"),
            (self.deinterlaced, "deinterlaced"),
        ] {
            if n > 0 {
                write!(f, ", {n} {what}")?;
            }
        }
        self.shortfall().map_or(Ok(()), |text| write!(f, ", {text}"))
    }
}
