//! One file being written: the shape of its pictures, and its encoder on a thread of its own.

use std::path::Path;

use crossbeam::channel::{Receiver, Sender};

use super::sampling::Sampled;
use super::side_by_side::{SideBySide, paste};
use super::stream::hand_on;
use crate::pipeline::job::Job;
use crate::pipeline::paths::to_path;
use crate::pipeline::run_error::RunError;
use crate::stages::EncodeSettings;
use plumbline_image::Frame;
use plumbline_media::{
    FramePool, FrameSpan, Input, Output, PassthroughStreams, VideoInfo, VideoWriter, WriteOptions, WriteReport,
};

/// A file being written.
pub(crate) struct Sink {
    pub(crate) output: Output,
    /// Width and height of its pictures, px.
    pub(crate) size: (usize, usize),
    beside: Option<SideBySide>,
    writer: VideoWriter,
}

/// The path to a sink's encoder.
pub(crate) struct Branch {
    beside: Option<SideBySide>,
    pool: FramePool,
    queue: Sender<Frame>,
}

impl Sink {
    /// Starts the file that `settings` ask for, with `passthrough` beside the pictures; `beside`: with the original at the
    /// result's side.
    pub(crate) fn create(
        settings: &EncodeSettings,
        job: &Job<'_>,
        source: &Input,
        video: &VideoInfo,
        passthrough: PassthroughStreams,
        beside: bool,
    ) -> Result<Self, RunError> {
        let output = Output::parse(to_path(&settings.path));
        let beside = beside.then(|| SideBySide::of(video));
        let video = beside.map_or_else(|| video.clone(), |b| b.video(video));
        let options = WriteOptions { passthrough, ..write_options(settings, job) };
        let writer = VideoWriter::create(&output, source, &video, &options)?;
        Ok(Self { output, size: (video.width, video.height), beside, writer })
    }

    /// Starts a part of the file that `settings` ask for, in the file `part`.
    pub(crate) fn of_part(
        settings: &EncodeSettings,
        job: &Job<'_>,
        video: &VideoInfo,
        part: &Path,
    ) -> Result<Self, RunError> {
        let output = Output::parse(to_path(&settings.path));
        let writer = VideoWriter::create_part(part, &output, video, &write_options(settings, job))?;
        Ok(Self { output, size: (video.width, video.height), beside: None, writer })
    }

    /// Appends an encoded part, of the frames `span`.
    pub(crate) fn append(&mut self, part: &Path, span: &FrameSpan) -> Result<(), RunError> {
        Ok(self.writer.append(part, span)?)
    }

    /// The path to this sink through `queue`.
    pub(crate) fn branch(&self, queue: Sender<Frame>) -> Branch {
        Branch { beside: self.beside, pool: self.writer.frame_pool(), queue }
    }

    /// Encodes what comes; the file stays unfinished.
    pub(crate) fn encode(mut self, job: &Job<'_>, frames: &Receiver<Frame>) -> Result<Self, RunError> {
        for frame in frames {
            job.check_cancel()?;
            self.writer.write(frame)?;
        }
        Ok(self)
    }

    /// Finishes the file, has it put on record, and gives it its name.
    pub(crate) fn finish(self, job: &Job<'_>) -> Result<(Output, (usize, usize), WriteReport), RunError> {
        job.check_cancel()?;
        let sealed = self.writer.seal()?;
        if let Some((unfinished, target)) = sealed.names() {
            job.publishing(unfinished, target)?;
        }
        Ok((self.output, self.size, sealed.publish()?))
    }
}

impl Branch {
    /// True where the result goes to the file as it is.
    fn takes_result(&self) -> bool {
        self.beside.is_none()
    }

    /// A picture for this sink, which leaves `sampled` to the others.
    fn picture(&self, sampled: &Sampled) -> Result<Frame, RunError> {
        let mut picture = self.pool.get()?;
        let result = &sampled.result;
        let made = if let Some(beside) = self.beside {
            beside.join(sampled.original(), result, &mut picture)
        } else {
            picture.copy_properties(result);
            paste(result, &mut picture, (0, 0), (result.width, result.height))
        };
        if made { Ok(picture) } else { Err(RunError::Internal("a frame of the pool is shared".to_owned())) }
    }
}

/// Gives every branch its picture; the first that takes the result as it is gets it without a copy.
pub(crate) fn distribute(sampled: Sampled, branches: &[Branch]) -> Result<(), RunError> {
    let owner = branches.iter().position(Branch::takes_result);
    for (_, branch) in branches.iter().enumerate().filter(|(i, _)| Some(*i) != owner) {
        hand_on(&branch.queue, branch.picture(&sampled)?)?;
    }
    owner.map_or(Ok(()), |i| hand_on(&branches[i].queue, sampled.result))
}

fn write_options(settings: &EncodeSettings, job: &Job<'_>) -> WriteOptions {
    WriteOptions {
        codec: settings.codec(),
        encoder: settings.encoder.clone(),
        crf: settings.crf,
        preset: settings.preset.clone(),
        bitrate: settings.bitrate.map(|b| b.0),
        threads: job.threads,
        overwrite: job.overwrite,
        strict: job.strict,
        passthrough: PassthroughStreams::None,
    }
}
