//! Result of the tracker for one frame.

use plumbline_num::time::Timestamp;

/// A tracked point in one frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observation {
    /// Track, unique in the clip; the same point has the same id in every frame.
    pub id: u32,
    /// Position, px of the source frame, pixel centers at integer + 0.5.
    pub x: f32,
    /// Position, likewise; y down.
    pub y: f32,
    /// The point belongs to the background. The tracker sets `true`; motion estimation refines it.
    pub background: bool,
}

/// Classification of a frame.
#[allow(clippy::struct_excessive_bools)] // four independent findings, not the states of one machine
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FrameQuality {
    /// Contrast of the analysis picture at half size relative to that at an eighth, in the direction where it is least,
    /// dimensionless: blur lowers it, largely independent of the scene. About 0.05 to 1; lower is softer.
    pub sharpness: f32,
    /// Nothing to track: black, or of one flat tone.
    pub black: bool,
    /// The same picture as the frame before; positions are repeated exactly.
    pub duplicate: bool,
    /// Much softer than the frames around it. [`super::TrackJoiner`] judges it; a tracker alone sets `false`.
    pub blurred: bool,
    /// A new shot begins here.
    pub cut_before: bool,
    /// Frames that the tracks skip: they continue from the frame `bridged + 1` before this one. 0 in the normal case; above
    /// it, the frames between were black or a flash, and a `cut_before` among them is void.
    pub bridged: u32,
}

impl FrameQuality {
    /// Whether a new shot begins here; a cut among the frames that the tracks skip does not count.
    pub fn starts_shot(&self) -> bool {
        self.cut_before && self.bridged == 0
    }

    /// The findings as bits, as files contain them.
    pub(super) fn flags(&self) -> u32 {
        let flags = [self.black, self.duplicate, self.blurred, self.cut_before];
        flags.iter().enumerate().fold(0, |bits, (i, set)| bits | u32::from(*set) << i)
    }

    /// The findings of [`Self::flags`]; the other fields are those of the default.
    pub(super) fn from_flags(bits: u32) -> Self {
        let flag = |i: u32| bits >> i & 1 == 1;
        Self { black: flag(0), duplicate: flag(1), blurred: flag(2), cut_before: flag(3), ..Self::default() }
    }
}

/// The tracked points of one frame, in the order of their ids.
#[derive(Clone, Debug, PartialEq)]
pub struct FrameTracks {
    /// Display time of the frame.
    pub pts: Timestamp,
    /// The points, ids ascending.
    pub observations: Vec<Observation>,
    /// Classification.
    pub quality: FrameQuality,
}
