//! The memory that stages need, as a formula: `bytes = frames · B + per_px · W·H + fixed + per_clip_frame · N`, with `W×H` the size
//! of the picture, `B` the bytes of one decoded frame and `N` the number of frames of the clip.
//!
//! Known when a stage is planned, so that `plan` can print a bound before any work; symbolic while no clip was probed.

use std::fmt;

use super::units::ByteSize;

/// The figures of a clip that memory depends on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ClipShape {
    /// Width of the coded picture, px.
    pub width: u32,
    /// Height of the coded picture, px.
    pub height: u32,
    /// Bytes of one decoded frame, all planes.
    pub frame_bytes: u64,
    /// Frames of the clip, where the container states it or it was estimated.
    pub frames: Option<u64>,
}

/// One thing that a stage keeps while it runs.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MemoryCost {
    /// What it is.
    pub what: &'static str,
    /// Whole decoded frames.
    pub frames: f64,
    /// Bytes per pixel of the picture.
    pub bytes_per_px: f64,
    /// Bytes whatever the picture.
    pub bytes: u64,
    /// Bytes per frame of the clip.
    pub bytes_per_clip_frame: f64,
    /// It is in a temporary file, not in memory.
    pub on_disk: bool,
}

impl MemoryCost {
    /// Bytes for a clip of this shape; a clip of unknown length counts as 0 frames.
    pub fn evaluate(&self, clip: &ClipShape) -> u64 {
        let px = f64::from(clip.width) * f64::from(clip.height);
        let length = clip.frames.unwrap_or(0) as f64;
        let variable =
            self.frames * clip.frame_bytes as f64 + self.bytes_per_px * px + self.bytes_per_clip_frame * length;
        variable.round() as u64 + self.bytes
    }
}

impl fmt::Display for MemoryCost {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut terms = Vec::new();
        if self.frames > 0.0 {
            terms.push(format!("{} frames", self.frames));
        }
        if self.bytes_per_px > 0.0 {
            terms.push(format!("{:.2} B × W×H", self.bytes_per_px));
        }
        if self.bytes > 0 {
            terms.push(human_bytes(self.bytes));
        }
        if self.bytes_per_clip_frame > 0.0 {
            terms.push(format!("{} B per frame of the clip", self.bytes_per_clip_frame));
        }
        f.write_str(&terms.join(" + "))
    }
}

/// Three digits and a binary unit; what divides evenly is exact.
pub fn human_bytes(bytes: u64) -> String {
    const UNITS: [&str; 4] = ["KiB", "MiB", "GiB", "TiB"];
    if bytes < 1024 {
        return format!("{bytes} B");
    }
    if bytes.is_multiple_of(1 << 20) && bytes < 1 << 30 {
        return ByteSize(bytes).to_string().replace("MiB", " MiB");
    }
    let mut value = bytes as f64;
    let mut unit = "B";
    for next in UNITS {
        if value < 1000.0 {
            break;
        }
        (value, unit) = (value / 1024.0, next);
    }
    let digits = if value < 10.0 { 2 } else { usize::from(value < 100.0) };
    format!("{value:.digits$} {unit}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn terms_add_up_and_print() {
        let cost = MemoryCost {
            what: "x",
            frames: 2.0,
            bytes_per_px: 0.5,
            bytes: 1000,
            bytes_per_clip_frame: 8.0,
            on_disk: false,
        };
        let clip = ClipShape { width: 100, height: 10, frame_bytes: 1500, frames: Some(7) };
        assert_eq!(cost.evaluate(&clip), 3000 + 500 + 1000 + 56);
        assert_eq!(cost.to_string(), "2 frames + 0.50 B × W×H + 1000 B + 8 B per frame of the clip");
        assert_eq!(cost.evaluate(&ClipShape { frames: None, ..clip }), 4500);
    }

    #[test]
    fn sizes_read_well() {
        for (bytes, text) in [
            (0, "0 B"),
            (1023, "1023 B"),
            (1024, "1.00 KiB"),
            (256 << 20, "256 MiB"),
            (3_110_400, "2.97 MiB"),
            (5 << 30, "5.00 GiB"),
        ] {
            assert_eq!(human_bytes(bytes), text);
        }
    }
}
