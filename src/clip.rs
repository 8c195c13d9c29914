//! Clip files as a source of frames for the stabilizer, and as its result.
//!
//! [`ClipFile`] reads a video file through FFmpeg as often as the stabilizer asks; [`ClipFile::render`] writes the clip under the maps of
//! a plan, with its audio, subtitles, chapters and tags as they were.

use std::path::Path;

use crate::image::Frame;
use crate::image::render::{Border, Interpolation, RenderError, RenderOptions, Renderer};
use crate::image::warp::Lattice;
use crate::media::{Input, MediaError, Output, Ratio, ReadOptions, VideoInfo, VideoReader, VideoWriter};
use crate::media::{WriteOptions, WriteReport, probe};
use crate::num::run::{Run, Stopped};
use crate::video::stabilize::{ClipInfo, FrameSource, Plan, StabilizeError};

/// A clip file that can be read any number of times.
///
/// ```
/// use plumbline::prelude::*;
///
/// let clip = ClipFile::open("media/street-walk.mp4")?.trimmed(0.0, 0.2)?;
/// assert_eq!((clip.info().width, clip.frames()?.count()), (960, 6));
/// # Ok::<(), plumbline::clip::ClipFileError>(())
/// ```
#[derive(Clone, Debug)]
pub struct ClipFile {
    input: Input,
    video: VideoInfo,
    focal_px: Option<f64>,
}

/// Why a clip file cannot be stabilized.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ClipFileError {
    /// The file that is read, or the one that is written.
    #[error(transparent)]
    Media(MediaError),
    /// The maps of its frames.
    #[error(transparent)]
    Stabilize(#[from] StabilizeError),
    /// Its rendering.
    #[error(transparent)]
    Render(#[from] RenderError),
    /// The run was interrupted, or its time is used up.
    #[error(transparent)]
    Interrupted(#[from] Stopped),
}

impl From<MediaError> for ClipFileError {
    fn from(error: MediaError) -> Self {
        match error {
            MediaError::Interrupted(stopped) => Self::Interrupted(stopped),
            other => Self::Media(other),
        }
    }
}

impl ClipFile {
    /// Opens a video file, or the pictures of a pattern such as `frames/%05d.png`.
    ///
    /// # Errors
    /// [`ClipFileError::Media`]: a file that is missing or no video.
    pub fn open(path: impl AsRef<Path>) -> Result<Self, ClipFileError> {
        Self::of(Input::parse(path.as_ref())?)
    }

    /// A clip of any input.
    ///
    /// # Errors
    /// As for [`Self::open`].
    pub fn of(input: Input) -> Result<Self, ClipFileError> {
        let video = VideoReader::open(&input, &ReadOptions::default())?.info().clone();
        let focal_px = probe(&input).ok().and_then(|found| found.focal_px());
        Ok(Self { input, video, focal_px })
    }

    /// The part of the clip in `[start, end)`, seconds from its beginning.
    ///
    /// # Errors
    /// [`ClipFileError::Media`]: an empty part.
    pub fn trimmed(self, start: f64, end: f64) -> Result<Self, ClipFileError> {
        Self::of(self.input.trimmed(Some(start), Some(end))?)
    }

    /// The file.
    pub fn input(&self) -> &Input {
        &self.input
    }

    /// The video stream: its format, rate and color.
    pub fn video(&self) -> &VideoInfo {
        &self.video
    }

    /// Writes the clip under the maps of `plan`, in the container of the name's extension: H.264 without visible loss. A file of
    /// that name is replaced, unless it is the clip itself.
    ///
    /// # Errors
    /// As for [`Self::render_with`].
    pub fn render(&self, plan: &Plan, path: impl AsRef<Path>, run: &Run) -> Result<WriteReport, ClipFileError> {
        let output = Output::parse(path.as_ref());
        self.render_with(plan, &output, &WriteOptions { overwrite: true, ..WriteOptions::default() }, run)
    }

    /// Writes the clip under the maps of `plan`, with a choice of codec and quality. Every frame is sampled once, by bicubic
    /// interpolation; edges are replicated where a map shows what the frame does not.
    ///
    /// # Errors
    /// [`ClipFileError`]: the clip cannot be read or not be written, the plan is of another clip, an interruption. Nothing is
    /// written then.
    pub fn render_with(
        &self,
        plan: &Plan,
        output: &Output,
        options: &WriteOptions,
        run: &Run,
    ) -> Result<WriteReport, ClipFileError> {
        let renderer =
            Renderer::new(RenderOptions { interpolation: Interpolation::Bicubic, border: Border::Replicate });
        let mut writer = VideoWriter::create(output, &self.input, &self.video, options)?;
        let mut maps = plan.maps()?;
        for (done, frame) in self.frames()?.enumerate() {
            run.check()?;
            let frame = frame?;
            let src_from_out = maps.next(&frame)?;
            let mut stabilized = writer.new_frame()?;
            renderer.render(&frame, &Lattice::new(&src_from_out, frame.width, frame.height), &mut stabilized)?;
            writer.write(stabilized)?;
            if let Some(frames) = self.video.frames_estimate {
                run.progress.report((done + 1) as f64 / frames.max(1) as f64);
            }
        }
        Ok(writer.finish()?)
    }
}

impl FrameSource for ClipFile {
    type Error = MediaError;

    fn info(&self) -> ClipInfo {
        let video = &self.video;
        ClipInfo {
            rotation: (video.rotation_deg.round() as i64).rem_euclid(360) as u16,
            pixel_aspect: video.sample_aspect.map_or((1, 1), |aspect| (aspect.num as u32, aspect.den as u32)),
            frame_rate: video.frame_rate.map(Ratio::value),
            frames: video.frames_estimate,
            focal_px: self.focal_px,
            ..ClipInfo::new(video.width, video.height, video.timebase)
        }
    }

    fn frames(&self) -> Result<impl Iterator<Item = Result<Frame, MediaError>>, MediaError> {
        let mut reader = VideoReader::open(&self.input, &ReadOptions::default())?;
        Ok(std::iter::from_fn(move || reader.next_frame().transpose()))
    }
}
