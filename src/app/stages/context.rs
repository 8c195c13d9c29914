//! What every body needs: the job, its values, and the path from a stage to the clip it works on.

use std::time::SystemTime;

use super::video_decode::DecodeSettings;
use crate::pipeline::graph::{Edge, Stage};
use crate::pipeline::items::pictures;
use crate::pipeline::job::{ArtifactStore, Job};
use crate::pipeline::paths::to_path;
use crate::pipeline::plan::Pass;
use crate::pipeline::run_error::RunError;
use crate::pipeline::summary::{InputSummary, Summary};
use crate::pipeline::units::{ClipTime, FrameRate};
use plumbline_media::{FieldOrder, Input, MediaError, ReadOptions, ReadReport, SpoolOptions, VideoReader};
use plumbline_num::run::Interrupt;

/// One pass at work.
pub struct Context<'c, 'j> {
    pub(crate) job: &'c Job<'j>,
    pub(crate) pass: &'c Pass,
    pub(crate) values: &'c mut ArtifactStore,
    pub(crate) summary: &'c mut Summary,
    /// The number of the stage at work.
    pub(crate) at: usize,
}

impl Context<'_, '_> {
    /// The stage with this index.
    pub(crate) fn stage(&self, stage: usize) -> &Stage {
        &self.job.graph().stages[stage]
    }

    /// The name of the stage at work.
    pub(crate) fn name(&self) -> &str {
        &self.stage(self.at).name
    }

    /// The edge into input port `port` of a stage, if it is connected.
    pub(crate) fn edge(&self, stage: usize, port: &str) -> Option<&Edge> {
        self.stage(stage).edges.iter().find(|e| e.port.name == port)
    }

    /// The edge into an input port that must be connected.
    pub(crate) fn required(&self, stage: usize, port: &str) -> Result<&Edge, RunError> {
        let missing = || RunError::Internal(format!("`{}` has no {port}", self.stage(stage).name));
        self.edge(stage, port).ok_or_else(missing)
    }

    /// The input of a `video.decode` stage. Standard input is read into a temporary file once; later passes read that.
    pub(crate) fn input(&mut self, decode: usize) -> Result<Input, RunError> {
        if let Some(source) = self.values.at::<Source>(decode, "input") {
            source.check()?;
            return Ok(source.input.clone());
        }
        let settings = self.decode_settings(decode)?;
        let (start, end) = (settings.start.map(ClipTime::seconds), settings.end.map(ClipTime::seconds));
        let rate = settings.fps.map(FrameRate::ratio);
        let (stream, playlists) = (settings.stream.map(|n| n as usize), settings.allow_playlist);
        let interrupt = self.job.run().interrupt;
        let input = open_input(&settings.path, &interrupt)
            .and_then(|i| if let Some(rate) = rate { i.at_rate(rate) } else { Ok(i) })
            .and_then(|i| i.trimmed(start, end))?;
        let input = input.with_stream(stream).allowing_playlists(playlists).with_interrupt(&interrupt);
        let seen = Seen::of(&input);
        self.values.put(decode, "input", Source { input: input.clone(), seen });
        Ok(input)
    }

    /// Opens the clip of a `video.decode` stage anew.
    pub(crate) fn open(&mut self, decode: usize) -> Result<(Input, VideoReader), RunError> {
        let input = self.input(decode)?;
        let deinterlace = self.decode_settings(decode)?.deinterlace;
        let options = ReadOptions { threads: self.job.threads, deinterlace, strict: self.job.strict };
        let reader = VideoReader::open(&input, &options)?;
        self.summary.input.get_or_insert_with(|| InputSummary::of(&input, reader.info()));
        Ok((input, reader))
    }

    fn decode_settings(&self, stage: usize) -> Result<&DecodeSettings, RunError> {
        let none = || RunError::Internal(format!("`{}` is no source of pictures", self.stage(stage).name));
        self.stage(stage).settings.get::<DecodeSettings>().ok_or_else(none)
    }

    /// Adds a warning that is not there yet.
    pub(crate) fn warn(&mut self, warning: String) {
        if !self.summary.warnings.contains(&warning) {
            self.summary.warnings.push(warning);
        }
    }

    /// Reports damage that was found while reading; whether there was none, nor anything else to report.
    pub(crate) fn report_damage(&mut self, report: &ReadReport) -> bool {
        let mut whole = true;
        let found = [
            (report.bad_packets, "damaged packets", "skipped"),
            (report.corrupt, "frames with damage", "concealed"),
            (report.concealed, "frames that could not be decoded", "replaced by the next one that could"),
            (report.lost, "frames at the end that could not be decoded", "left out"),
            (report.retimed, "frames without a usable time", "given one between their neighbors"),
            (report.deinterlaced, "interlaced frames", "deinterlaced"),
        ];
        for (count, what, done) in found.into_iter().filter(|(count, ..)| *count > 0) {
            whole = false;
            self.warn(format!("{what}: {count}, {done}"));
        }
        if let Some(order) = report.unflagged_fields {
            whole = false;
            let word = if order == FieldOrder::BottomFirst { "bottom" } else { "top" };
            self.warn(format!(
                "the pictures look interlaced, the {word} field first, though the file does not say so; if they show combs, \
                 give --deinterlace {word} (`deinterlace = \"{word}\"`)"
            ));
        }
        if let Some(shortfall) = report.shortfall() {
            whole = false;
            self.warn(shortfall);
            self.summary.cut_short = true;
        }
        whole
    }
}

/// A clip by its name: a file, a pattern, standard input, or a folder or glob of pictures.
pub(crate) fn open_input(text: &str, interrupt: &Interrupt) -> Result<Input, MediaError> {
    match pictures(text) {
        Some(files) => Input::pictures(text, files),
        None if text == "-" => {
            Input::standard_input(&SpoolOptions { interrupt: interrupt.clone(), ..SpoolOptions::default() })
        }
        None => Input::parse(to_path(text)),
    }
}

/// An input, and what its file looked like when it was opened first: every pass must see the same clip.
struct Source {
    input: Input,
    seen: Option<Seen>,
}

/// What shows that a file was written to.
#[derive(Clone, Copy, PartialEq)]
struct Seen {
    bytes: u64,
    modified: Option<SystemTime>,
}

impl Seen {
    /// `None` where the file is gone.
    fn of(input: &Input) -> Option<Self> {
        let meta = std::fs::metadata(input.path()).ok()?;
        Some(Self { bytes: meta.len(), modified: meta.modified().ok() })
    }
}

impl Source {
    fn check(&self) -> Result<(), RunError> {
        let size = |seen: Option<Seen>| seen.map_or_else(|| "gone".to_owned(), |s| format!("{} bytes", s.bytes));
        let now = Seen::of(&self.input);
        if now == self.seen {
            return Ok(());
        }
        Err(changed(self.input.name(), &format!("{}, then {}", size(self.seen), size(now))))
    }
}

/// The clip is not what it was in the pass before.
pub(crate) fn changed(name: &str, how: &str) -> RunError {
    RunError::Input(format!("{name}: the file changed while it was at work ({how}); start again when it is complete"))
}
