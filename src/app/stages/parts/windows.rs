//! Tracks of some analysis windows of a clip.

use std::ops::Range;

use super::PartName;
use crate::pipeline::paths::unescaped;
use crate::stages::clip::stream::for_each_frame;
use crate::stages::prelude::*;
use crate::stages::video_track::{TrackSettings, clip_info};
use plumbline_media::FrameSpan;
use plumbline_video::stabilize::WindowTracker;
use plumbline_video::track::AnalysisWindows;

/// Settings of the task of some analysis windows.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct WindowsSettings {
    /// The folder of parts
    #[schemars(extend("format" = "path"))]
    pub(crate) folder: String,
    /// Indices of the windows
    #[serde(deserialize_with = "countable")]
    pub(crate) windows: Range<usize>,
    /// The frames that they are tracked through
    pub(crate) span: FrameSpan,
    /// How points are tracked
    pub(crate) track: TrackSettings,
}

/// Most analysis windows of a clip: of a week at 60 frames/s.
const MAX_WINDOWS: usize = 1 << 16;

/// Reads indices of windows. Plans come from other machines: the names of what a task writes are made before anything is opened.
fn countable<'de, D: serde::Deserializer<'de>>(deserializer: D) -> Result<Range<usize>, D::Error> {
    let windows = Range::<usize>::deserialize(deserializer)?;
    if windows.start < windows.end && windows.end <= MAX_WINDOWS {
        return Ok(windows);
    }
    Err(serde::de::Error::custom(format!("windows {windows:?} (expected some of the first {MAX_WINDOWS})")))
}

impl Stage for WindowsSettings {
    const KIND: &'static str = "part.windows";
    const SUMMARY: &'static str = "follows points through some analysis windows of a clip";
    const INPUTS: &'static [Port] = &[Port::one("frames", PortType::Frames, "the clip to analyze")];
    const OUTPUTS: &'static [Port] = &[Port::one("file", PortType::File, "the tracks of the windows")];
    type Input = Wired;
    type Output = HandedOn;

    fn memory(&self) -> Vec<MemoryCost> {
        self.track.memory()
    }

    fn reads(&self) -> Vec<&str> {
        self.track.reads()
    }

    fn writes(&self) -> Vec<String> {
        self.windows.clone().map(|window| PartName::Window(window).text(&self.folder)).collect()
    }

    fn run(&self, Wired { stage }: Wired, context: &mut Context<'_, '_>) -> Result<HandedOn, RunError> {
        let decode = context.required(stage, "frames")?.from;
        let (_, reader) = context.open_span(decode, &self.span)?;
        let info = clip_info(reader.info());
        let options = TrackSettings { mask: self.track.mask.as_deref().map(unescaped), ..self.track.clone() };
        let tracker = |window| WindowTracker::new(&info, &options, AnalysisWindows::default(), window);
        let mut trackers = self.windows.clone().map(tracker).collect::<Result<Vec<_>, _>>()?;
        context.job.progress.begin(context.pass.index, "analyze", reader.info().frames_estimate);
        let mut index = self.span.frames.start;
        let report = for_each_frame(context.job, reader, |frame| {
            let readers = trackers.iter_mut().filter(|tracker| tracker.frames().contains(&index));
            readers.for_each(|tracker| tracker.push(&frame));
            index += 1;
            Ok(())
        })?;
        context.report_damage(&report);
        for (window, tracker) in self.windows.clone().zip(trackers) {
            let tracks = tracker.finish();
            context.fill_file(&PartName::Window(window).in_folder(&self.folder), |out| tracks.write(out))?;
        }
        context.summary.frames = report.frames;
        Ok(HandedOn)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_that_no_clip_has_are_refused_when_they_are_read() {
        for (start, end, valid) in [(0, 3, true), (3, 3, false), (4, 3, false), (0, usize::MAX, false)] {
            let text = format!(r#"{{"windows": {{"start": {start}, "end": {end}}}}}"#);
            assert_eq!(serde_json::from_str::<WindowsSettings>(&text).is_ok(), valid, "{text}");
        }
    }
}
