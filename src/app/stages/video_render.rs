//! `video.render`: the only stage that samples pixels.

use super::prelude::*;
use crate::pipeline::units::ByteSize;

/// How pixels are interpolated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Interpolation {
    /// 4×4 pixels: sharp and fast
    #[default]
    Bicubic,
    /// 6×6 pixels: sharpest, slower
    Lanczos3,
}

/// Fill of pixels that the source does not cover.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Border {
    /// Nothing of it shows: the picture is enlarged
    #[default]
    Crop,
    /// The picture mirrored at its edge
    Mirror,
    /// The edge's pixels drawn out
    Replicate,
    /// Black
    Black,
    /// Picture from neighboring frames
    Fill,
}

/// Settings of `video.render`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct RenderSettings {
    /// How pixels are interpolated
    pub interpolation: Interpolation,
    /// Fill of pixels that the source does not cover
    pub border: Border,
    /// Memory limit of the neighboring frames of the border fill
    pub fill_memory: ByteSize,
}

impl Default for RenderSettings {
    fn default() -> Self {
        let (interpolation, border) = (Interpolation::default(), Border::default());
        Self { interpolation, border, fill_memory: ByteSize(256 << 20) }
    }
}

impl RenderSettings {
    /// Most neighboring frames that `border = "fill"` looks at, on both sides together.
    pub const FILL_WINDOW: u32 = 60;
}

impl Stage for RenderSettings {
    const KIND: &'static str = "video.render";
    const SUMMARY: &'static str = "samples each frame once through its maps";
    const INPUTS: &'static [Port] = &[
        Port::one("frames", PortType::Frames, "the pictures"),
        Port::many("warps", PortType::Warp, "maps, applied in this order and composed"),
    ];
    const OUTPUTS: &'static [Port] = &[Port::one("frames", PortType::Frames, "the sampled pictures")];
    const RESAMPLES: bool = true;
    type Input = Wired;
    type Output = HandedOn;

    fn over_time(&self) -> TemporalScope {
        match self.border {
            Border::Fill => TemporalScope::Window(Self::FILL_WINDOW),
            _ => TemporalScope::Map,
        }
    }

    fn memory(&self) -> Vec<MemoryCost> {
        let mut costs = vec![MemoryCost { what: "frames at work", frames: 4.0, ..MemoryCost::default() }];
        if self.border == Border::Fill {
            costs.push(MemoryCost { what: "neighboring frames", bytes: self.fill_memory.0, ..MemoryCost::default() });
        }
        costs
    }

    // Only describes a stream: the stage at its end pulls frames through it.
    fn run(&self, _input: Wired, _context: &mut Context<'_, '_>) -> Result<HandedOn, RunError> {
        Ok(HandedOn)
    }
}
