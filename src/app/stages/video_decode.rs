//! `video.decode`: opens a clip.

use super::prelude::*;
use crate::pipeline::units::{ClipTime, FrameRate};
use plumbline_media::Deinterlace;

/// Settings of `video.decode`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct DecodeSettings {
    /// The clip: a file, an image sequence (`frames/%05d.png`, a folder or a glob of pictures), or `-` for standard input
    #[schemars(extend("format" = "path"))]
    pub path: String,
    /// First position to read, seconds, MM:SS or HH:MM:SS; the clip's start if left out
    pub start: Option<ClipTime>,
    /// Position to stop before; the clip's end if left out
    pub end: Option<ClipTime>,
    /// Frames per second of an image sequence, such as 24 or 30000/1001; 25 if left out
    pub fps: Option<FrameRate>,
    /// Deinterlacing
    pub deinterlace: Deinterlace,
    /// Video stream to process, by its index in `plumbline probe`; the one that FFmpeg prefers if left out
    #[schemars(range(min = 0, max = 1023))]
    pub stream: Option<u32>,
    /// Read a playlist (HLS, ffconcat) of files in its own folder; refused otherwise, since it names other files
    pub allow_playlist: bool,
}

impl Stage for DecodeSettings {
    const KIND: &'static str = "video.decode";
    const SUMMARY: &'static str = "opens a clip: its pictures, and everything else in it";
    const INPUTS: &'static [Port] = &[];
    const OUTPUTS: &'static [Port] = &[
        Port::one("frames", PortType::Frames, "the pictures in display order, with their own times"),
        Port::one("audio", PortType::Audio, "audio, subtitles, data, chapters and tags, untouched"),
    ];
    const REQUIRED: &'static [&'static str] = &["path"];
    type Input = Wired;
    type Output = HandedOn;

    fn memory(&self) -> Vec<MemoryCost> {
        // A decoder keeps up to 16 reference frames and one per thread in flight; 4 wait in the queue to the next stage.
        vec![MemoryCost { what: "decoder and queue", frames: 22.0, ..MemoryCost::default() }]
    }

    fn conflicts(&self) -> Vec<Conflict> {
        let start = self.start.map_or(0.0, ClipTime::seconds);
        let message = |end| format!("`end` = {end} s is not after `start` = {start} s");
        let help = "give an end later than the start, or leave it out";
        let end = self.end.filter(|end| end.seconds() <= start);
        end.map(|end| Conflict { key: "end", message: message(end), help }).into_iter().collect()
    }

    fn reads(&self) -> Vec<&str> {
        vec![&self.path]
    }

    // Only describes a stream: the stage at its end pulls frames through it.
    fn run(&self, _input: Wired, _context: &mut Context<'_, '_>) -> Result<HandedOn, RunError> {
        Ok(HandedOn)
    }
}
