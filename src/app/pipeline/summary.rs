//! The result of a finished instance: filled by the stages, printed by the command.

use std::collections::BTreeMap;
use std::fmt;
use std::ops::Range;
use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use super::estimate::WorkSize;
use super::paths::as_texts;
use crate::report::Segment;
use plumbline_media::{Input, VideoInfo};
pub use plumbline_video::stabilize::{Shake, ShakeSummary};

/// What was read.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct InputSummary {
    /// As the user named it.
    pub name: String,
    /// Width and height, px.
    pub size: (u32, u32),
    /// Mean frame rate, 1/s, where it is known.
    pub fps: Option<f64>,
    /// The rate was not given: pictures have none of their own.
    pub fps_assumed: bool,
    /// Index of the video stream that was processed, where there are several.
    pub stream: Option<usize>,
    /// The other video streams, in words, that the result has as they are.
    pub copied_videos: Vec<String>,
}

impl InputSummary {
    /// Of a clip and what its decoder reports.
    pub fn of(input: &Input, video: &VideoInfo) -> Self {
        Self {
            name: input.name().to_owned(),
            size: (video.width as u32, video.height as u32),
            fps: video.frame_rate.map(plumbline_media::Ratio::value),
            fps_assumed: input.assumed_rate().is_some(),
            stream: (!video.other_videos.is_empty()).then_some(video.stream),
            copied_videos: Vec::new(),
        }
    }
}

/// What was done.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// The results were there, made from the same inputs, settings and version: nothing was done.
    pub up_to_date: bool,
    /// The clip that was read.
    pub input: Option<InputSummary>,
    /// Files written.
    #[serde(with = "as_texts")]
    pub outputs: Vec<PathBuf>,
    /// Frames written.
    pub frames: u64,
    /// Width and height of the output, px.
    pub size: Option<(u32, u32)>,
    /// FFmpeg's name of the encoder.
    pub encoder: Option<String>,
    /// Mode per segment.
    pub segments: Vec<Segment>,
    /// Shake before and after, over the whole clip.
    pub shake: Option<ShakeSummary>,
    /// Part of the picture's width and height that was kept, mean over the frames; 1 = all.
    pub crop: Option<f64>,
    /// Least part kept in any frame.
    pub least_crop: Option<f64>,
    /// How much of the pictures was filled at their borders.
    #[serde(default)]
    pub filled: Option<FillSummary>,
    /// Readout time of the sensor that was corrected for, seconds.
    pub readout_s: Option<f64>,
    /// A clip ended before its container says: the result is a part of what there should be.
    pub cut_short: bool,
    /// Stages whose results came from the cache.
    #[serde(default)]
    pub cached: Vec<String>,
    /// What the user should know: concealed packets, streams left out, a clip that passed unchanged.
    pub warnings: Vec<String>,
    /// The window that a clip's new shape shows of its pictures.
    pub window: Option<WindowSummary>,
    /// Which lens a still picture was taken with, how that is known and how exactly.
    pub lens: Option<String>,
    /// Part of a still picture's area that the result shows.
    pub source_shown: Option<f64>,
    /// How straight the lines of a still picture became.
    pub lines: Option<LinesSummary>,
    /// The mesh that was read, and what became of it.
    pub surface: Option<SurfaceSummary>,
    /// Wall time, seconds; filled by the executor.
    pub seconds: f64,
    /// Wall time by kind of stage, seconds. A stage that pulls frames through others has their time.
    #[serde(default)]
    pub stage_seconds: BTreeMap<String, f64>,
    /// How much there was to do, where times are noted.
    #[serde(default)]
    pub work: WorkSize,
}

/// The window that a clip's new shape shows of its pictures, before they are warped.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct WindowSummary {
    /// Part of width and height kept.
    pub kept: [f64; 2],
    /// First and last position of its left (or upper) side, px.
    pub range_px: [f64; 2],
}

impl fmt::Display for WindowSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ([across, down], [first, last]) = (self.kept, self.range_px);
        let (fraction, side, from) = if across < 1.0 { (across, "width", "left") } else { (down, "height", "top") };
        write!(f, "{:.1} % of the {side} shown, from {first:.0} to {last:.0} px off the {from}", 100.0 * fraction)
    }
}

/// How much of a clip's pictures lies outside the source and was filled, as fractions of their area.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FillSummary {
    /// Mean over the frames.
    pub mean: f64,
    /// Most in a frame, and which one, from 0.
    pub most: (f64, usize),
    /// What no other frame shows, so that it was mirrored: mean over the frames.
    pub mirrored_mean: f64,
    /// The most of it, and in which frame, from 0.
    pub mirrored_most: (f64, usize),
}

impl fmt::Display for FillSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { mean, most, mirrored_mean, mirrored_most } = self;
        write!(f, "{:.1} % of the picture filled, at most {:.1} % (frame {})", 100.0 * mean, 100.0 * most.0, most.1)?;
        let (mirrored, greatest, frame) = (100.0 * mirrored_mean, 100.0 * mirrored_most.0, mirrored_most.1);
        write!(f, "; mirrored {mirrored:.2} %, at most {greatest:.1} % (frame {frame})")
    }
}

/// How straight the lines of a still picture became.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LinesSummary {
    /// How many there are.
    pub count: usize,
    /// Those whose edges were found and measured in the result.
    pub measured: usize,
    /// Name of the least straight of the measured ones, and how far it is off, px of the output; where none was measured, what the
    /// map itself says of the least straight of all.
    pub worst: Option<(String, f64)>,
}

/// A mesh, and what was done to it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SurfaceSummary {
    /// The file, as the user named it.
    pub name: String,
    /// Number of vertices.
    pub vertices: usize,
    /// Number of polygons.
    pub faces: usize,
    /// Low and high corner of its box, in its own units.
    pub bounds: [[f64; 3]; 2],
    /// What was mended before it was deformed.
    pub repairs: Vec<String>,
    /// How it was deformed.
    pub deformation: Option<String>,
    /// Its modes and parts.
    pub modes: Option<String>,
    /// How it follows a skeleton.
    pub weights: Option<String>,
    /// What was learnt of how it follows a skeleton.
    pub training: Option<String>,
    /// Joints of the skeleton that was found in it.
    pub joints: Option<usize>,
    /// Its skeleton.
    pub skeleton: Option<String>,
    /// What became of it and another.
    pub morph: Vec<String>,
    /// Movements that it took from another skeleton.
    pub retargeted: Vec<String>,
}

impl SurfaceSummary {
    fn write(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [low, high] = self.bounds;
        let point = |p: [f64; 3]| format!("({})", p.map(short).join(", "));
        let (low, high) = (point(low), point(high));
        let Self { name, vertices, faces, .. } = self;
        writeln!(f, "  read      {name}, {vertices} vertices, {faces} faces, from {low} to {high}")?;
        self.repairs.iter().try_for_each(|repair| writeln!(f, "  repair    {repair}"))?;
        self.deformation.iter().try_for_each(|line| writeln!(f, "  deform    {line}"))?;
        self.modes.iter().try_for_each(|line| writeln!(f, "  modes     {line}"))?;
        self.weights.iter().try_for_each(|line| writeln!(f, "  weights   {line}"))?;
        self.training.iter().try_for_each(|line| writeln!(f, "  train     {line}"))?;
        self.skeleton.iter().try_for_each(|line| writeln!(f, "  skeleton  {line}"))?;
        self.morph.iter().try_for_each(|line| writeln!(f, "  morph     {line}"))?;
        self.retargeted.iter().try_for_each(|line| writeln!(f, "  motion    {line}"))
    }
}

/// Five digits at most.
fn short(v: f64) -> String {
    format!("{v:.4e}").parse::<f64>().unwrap_or(v).to_string()
}

impl fmt::Display for LinesSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.worst {
            None => f.write_str("none"),
            Some((name, px)) => {
                let Self { count, measured, .. } = self;
                write!(f, "{count}, off straight by at most {px:.2} px (`{name}`), ")?;
                match measured {
                    0 => f.write_str("not measured: no edge of them is clear in the result"),
                    n if n == count => f.write_str("measured on their edges in the result"),
                    n => write!(f, "measured on the edges of {n} in the result"),
                }
            }
        }
    }
}

impl Summary {
    /// Of an item whose results were there.
    pub fn of_up_to_date(outputs: Vec<PathBuf>) -> Self {
        Self { up_to_date: true, outputs, ..Self::default() }
    }

    /// Adds to the time of a kind of stage.
    pub fn note_seconds(&mut self, kind: &str, seconds: f64) {
        *self.stage_seconds.entry(kind.to_owned()).or_default() += seconds.max(0.0);
    }

    /// Frames written per second of wall time.
    pub fn fps(&self) -> f64 {
        if self.seconds > 0.0 { self.frames as f64 / self.seconds } else { 0.0 }
    }
}

/// Files that the line of a result names one by one; of more, such as the frames of an animation, the first and the last.
const MAX_LISTED: usize = 4;

impl Summary {
    /// The result in one line, and a line for each warning.
    pub fn brief(&self) -> String {
        let outputs: Vec<String> = self.outputs.iter().map(|p| p.display().to_string()).collect();
        let mut facts = Vec::new();
        let pixels = self.size.map(|(w, h)| format!("{w}×{h} px"));
        facts.extend((self.frames > 0).then(|| format!("{} frames", self.frames)));
        facts.extend(pixels);
        if let (None, Some(surface)) = (self.size, &self.surface) {
            facts.extend(surface.joints.map(|count| format!("{count} joints")));
            facts.push(format!("{} vertices", surface.vertices));
        }
        if let Some(ShakeSummary { before, after }) = self.shake {
            facts.push(format!("shake {:.2} to {:.2} px", before.px, after.px));
        }
        facts.extend(self.crop.map(|crop| format!("{:.1} % kept", 100.0 * crop)));
        facts.extend(self.source_shown.map(|shown| format!("shows {:.0} % of the source", 100.0 * shown)));
        facts.extend(self.lines.as_ref().map(|lines| format!("lines {lines}")));
        facts.extend(self.lens.as_ref().map(|lens| format!("lens {lens}")));
        facts.extend((!self.cached.is_empty()).then(|| format!("{} cached", self.cached.join(", "))));
        let files = match outputs.as_slice() {
            [] => "no file".to_owned(),
            [first, .., last] if outputs.len() > MAX_LISTED => format!("{first} to {last} ({} files)", outputs.len()),
            all => all.join(", "),
        };
        let mut text = format!("wrote {files}: {} ({:.1} s)\n", facts.join(", "), self.seconds);
        if facts.is_empty() {
            text = format!("wrote {files} ({:.1} s)\n", self.seconds);
        }
        if let Some(streams) = self.input.as_ref().and_then(InputSummary::streams) {
            text.extend(["read ", &streams, "\n"]);
        }
        for warning in &self.warnings {
            text.extend(["warning: ", warning, "\n"]);
        }
        text
    }
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(input) = &self.input {
            writeln!(f, "  read      {input}")?;
        }
        self.surface.iter().try_for_each(|surface| surface.write(f))?;
        let outputs: Vec<String> = self.outputs.iter().map(|p| p.display().to_string()).collect();
        writeln!(f, "  wrote     {}", outputs.join(", "))?;
        let size = self.size.map(|(w, h)| format!(", {w}×{h}")).unwrap_or_default();
        let encoder = self.encoder.as_ref().map(|e| format!(", {e}")).unwrap_or_default();
        if self.frames > 0 {
            writeln!(
                f,
                "  frames    {}{size}{encoder}, in {:.1} s ({:.1} fps)",
                self.frames,
                self.seconds,
                self.fps()
            )?;
        } else if let Some((width, height)) = self.size {
            writeln!(f, "  picture   {width}×{height} px, in {:.2} s", self.seconds)?;
        } else if self.surface.is_some() {
            writeln!(f, "  took      {:.2} s", self.seconds)?;
        }
        if !self.cached.is_empty() {
            writeln!(f, "  cached    {}", self.cached.join(", "))?;
        }
        if let Some(window) = &self.window {
            writeln!(f, "  window    {window}")?;
        }
        if let Some(shown) = self.source_shown {
            writeln!(f, "  shows     {:.0} % of the source", 100.0 * shown)?;
        }
        if let Some(lens) = &self.lens {
            writeln!(f, "  lens      {lens}")?;
        }
        if let Some(lines) = &self.lines {
            writeln!(f, "  lines     {lines}")?;
        }
        if let Some(ShakeSummary { before, after }) = self.shake {
            writeln!(f, "  shake     before {before}, after {after} (RMS, against the mean over 0.5 s)")?;
        }
        if let Some(crop) = self.crop {
            let least = self.least_crop.map(|c| format!(", least {:.1} %", 100.0 * c)).unwrap_or_default();
            writeln!(f, "  crop      {:.1} % of width and height kept{least}", 100.0 * crop)?;
        }
        if let Some(filled) = &self.filled {
            writeln!(f, "  fill      {filled}")?;
        }
        for segment in &self.segments {
            write!(f, "  {segment}")?;
            // One segment alone has the figures of the whole.
            match segment.figures().filter(|_| self.segments.len() > 1) {
                Some(figures) => writeln!(f, " ({figures})")?,
                None => writeln!(f)?,
            }
        }
        if let Some(readout) = self.readout_s {
            writeln!(f, "  rolling shutter corrected, readout {:.1} ms", 1e3 * readout)?;
        }
        self.warnings.iter().try_for_each(|w| writeln!(f, "  warning   {w}"))
    }
}

impl fmt::Display for InputSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (width, height) = self.size;
        write!(f, "{}, {width}×{height}", self.name)?;
        if let Some(fps) = self.fps {
            let text = format!("{fps:.3}");
            write!(f, ", {} fps", text.trim_end_matches('0').trim_end_matches('.'))?;
        }
        if self.fps_assumed {
            f.write_str(" (assumed; --fps sets another)")?;
        }
        self.streams().map_or(Ok(()), |streams| write!(f, ", {streams}"))
    }
}

impl InputSummary {
    /// Which of several video streams was processed, and what became of the others.
    fn streams(&self) -> Option<String> {
        let stream = self.stream?;
        let copied = match self.copied_videos.as_slice() {
            [] => String::new(),
            others => format!("; copied as it was: {}", others.join(", ")),
        };
        Some(format!("video stream {stream} of several (--stream takes another){copied}"))
    }
}

impl fmt::Display for Segment {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Range { start, end } = self.frames;
        write!(f, "{:<9} frames {start} to {}: {}", self.mode, end.saturating_sub(1).max(start), self.reason)
    }
}

impl Segment {
    /// Its crop and shake in short.
    fn figures(&self) -> Option<String> {
        let crop = self.crop.map(|c| format!("crop {:.1} %", 100.0 * c));
        let shake = self.shake.map(|s| format!("shake {:.2} to {:.2} px", s.before.px, s.after.px));
        let figures: Vec<String> = crop.into_iter().chain(shake).collect();
        (!figures.is_empty()).then(|| figures.join(", "))
    }
}
