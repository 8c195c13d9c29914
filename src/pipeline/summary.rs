//! What a finished instance tells: filled by the stages, printed by the command.

use std::fmt;
use std::ops::Range;
use std::path::PathBuf;

use serde::Serialize;

/// The warp of one stretch of frames.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct SegmentSummary {
    /// Frames, from 0.
    pub frames: Range<u64>,
    /// Mode in use: `mesh`, `homography`, `similarity` or `unchanged`.
    pub mode: String,
    /// Why this mode.
    pub reason: String,
}

/// What was done.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Summary {
    /// Files written.
    pub outputs: Vec<PathBuf>,
    /// Frames written.
    pub frames: u64,
    /// Width and height of the output, px.
    pub size: Option<(u32, u32)>,
    /// Mode per segment.
    pub segments: Vec<SegmentSummary>,
    /// Part of the picture's width and height that was kept, mean over the frames; 1 = all.
    pub crop: Option<f64>,
    /// Least part kept in any frame.
    pub least_crop: Option<f64>,
    /// Readout time of the sensor that was corrected for, seconds.
    pub readout_s: Option<f64>,
    /// What the user should know: concealed packets, streams left out, a clip that passed unchanged.
    pub warnings: Vec<String>,
    /// Wall time, seconds; filled by the executor.
    pub seconds: f64,
}

impl Summary {
    /// Frames written per second of wall time.
    pub fn fps(&self) -> f64 {
        if self.seconds > 0.0 { self.frames as f64 / self.seconds } else { 0.0 }
    }
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let outputs: Vec<String> = self.outputs.iter().map(|p| p.display().to_string()).collect();
        writeln!(f, "  wrote     {}", outputs.join(", "))?;
        let size = self.size.map(|(w, h)| format!(", {w}×{h}")).unwrap_or_default();
        writeln!(f, "  frames    {}{size}, in {:.1} s ({:.1} fps)", self.frames, self.seconds, self.fps())?;
        if let Some(crop) = self.crop {
            let least = self.least_crop.map(|c| format!(", least {:.1} %", 100.0 * c)).unwrap_or_default();
            writeln!(f, "  crop      {:.1} % of width and height kept{least}", 100.0 * crop)?;
        }
        for segment in &self.segments {
            let Range { start, end } = segment.frames;
            writeln!(
                f,
                "  {:<9} frames {start} to {}: {}",
                segment.mode,
                end.saturating_sub(1).max(start),
                segment.reason
            )?;
        }
        if let Some(readout) = self.readout_s {
            writeln!(f, "  rolling shutter corrected, readout {:.1} ms", 1e3 * readout)?;
        }
        self.warnings.iter().try_for_each(|w| writeln!(f, "  warning   {w}"))
    }
}
