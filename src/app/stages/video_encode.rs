//! `video.encode`: writes a clip.

use super::clip::encoding;
use super::prelude::*;
use crate::pipeline::paths::to_path;
use crate::pipeline::units::BitRate;
use plumbline_media::{Codec, EncoderChoice, Output, check_encoder};

/// Settings of `video.encode`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct EncodeSettings {
    /// The file to write; its extension chooses the container; an image sequence such as `out/%05d.png`, or `-` for standard output
    #[schemars(extend("format" = "path"))]
    pub path: String,
    /// How the pictures are coded; if left out h264, in WebM av1
    pub codec: Option<Codec>,
    /// Which encoder: software, auto (a device where one works, else software), hardware, or FFmpeg's name of one
    pub encoder: EncoderChoice,
    /// Constant quality, 0 = best; the encoder's own default if left out
    #[schemars(range(min = 0.0, max = 63.0))]
    pub crf: Option<f64>,
    /// The encoder's own name for speed against size, such as veryfast or slow
    pub preset: Option<String>,
    /// Average bit rate instead of constant quality, such as 6M
    pub bitrate: Option<BitRate>,
    /// A stream that the container cannot store is an error, not a warning
    pub strict: bool,
}

impl EncodeSettings {
    /// The codec, where none is given that of the container.
    pub fn codec(&self) -> Codec {
        self.codec.unwrap_or_else(|| self.output().usual_codec())
    }

    fn output(&self) -> Output {
        Output::parse(to_path(&self.path))
    }

    fn crf_conflict(&self) -> Option<Conflict> {
        let crf = self.crf?;
        let codec = self.codec();
        if self.bitrate.is_some() {
            let message = "`crf` and `bitrate` exclude each other".to_owned();
            return Some(Conflict { key: "bitrate", message, help: "give one of them" });
        }
        match codec.crf_max() {
            None => {
                let message = format!("codec `{}` has no `crf`", codec.name());
                Some(Conflict { key: "crf", message, help: "leave `crf` out, or take h264, hevc or av1" })
            }
            Some(max) if crf > max => {
                let message = format!("`crf` = {crf} is out of range for `{}` (expected 0 to {max})", codec.name());
                Some(Conflict { key: "crf", message, help: "18 to 28 is usual" })
            }
            Some(_) => None,
        }
    }
}

impl Stage for EncodeSettings {
    const KIND: &'static str = "video.encode";
    const SUMMARY: &'static str = "writes a clip: as many frames as came in, with their own times";
    const INPUTS: &'static [Port] = &[
        Port::one("frames", PortType::Frames, "the pictures"),
        Port::optional("audio", PortType::Audio, "streams to copy beside the picture"),
        Port::optional("side_by_side", PortType::Frames, "pictures to show on the left of `frames`, for comparison"),
    ];
    const OUTPUTS: &'static [Port] = &[Port::one("file", PortType::File, "the file")];
    const REQUIRED: &'static [&'static str] = &["path"];
    type Input = Wired;
    type Output = HandedOn;

    fn memory(&self) -> Vec<MemoryCost> {
        // Measured with x264 at 640×360 and 1920×1080 as peak memory over bytes of a frame: 58 frames at `veryfast` (10 ahead),
        // 116 at `medium` (40 ahead, and references at four half-pixel positions); the same for joined pictures of twice the size.
        let quick = matches!(self.preset.as_deref(), Some("ultrafast" | "superfast" | "veryfast"));
        let frames = if quick { 60.0 } else { 120.0 };
        vec![MemoryCost { what: "encoder's lookahead", frames, ..MemoryCost::default() }]
    }

    fn conflicts(&self) -> Vec<Conflict> {
        self.crf_conflict().into_iter().collect()
    }

    fn writes(&self) -> Vec<String> {
        vec![self.path.clone()]
    }

    fn run(&self, Wired { stage }: Wired, context: &mut Context<'_, '_>) -> Result<HandedOn, RunError> {
        encoding::run(context, stage)?;
        Ok(HandedOn)
    }

    fn preflight(&self) -> Result<(), RunError> {
        let output = self.output();
        output.preflight()?;
        if output.is_sequence() {
            return Ok(());
        }
        let codec = self.codec();
        output.check_codec(codec)?;
        Ok(check_encoder(codec, &self.encoder)?)
    }
}
