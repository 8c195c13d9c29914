//! Motion and tracks from a motion file or a COLMAP model in place of tracking, checked against the clip.

use std::path::{Path, PathBuf};

use super::error::StabilizeError;
use super::measurement::MotionMeasurement;
use super::source::ClipInfo;
use super::tracks::Tracks;
use crate::motion::ClipMotion;
use crate::motion::exchange::colmap::{ColmapError, ImportedClip, Model};
use crate::track::{FrameQuality, FrameTracks, TrackStore};
use plumbline_num::files::open_regular;
use plumbline_num::time::Timestamp;

/// Relative difference of the mean frame rate of a file and the clip up to which the file is accepted without reading the frames:
/// headers round the rate, and count the duration of the last frame or not.
const MAX_RATE_DIFFERENCE: f64 = 0.1;

/// Limit on the numbered folders that are read: a clip has fewer shots.
const MAX_MODELS: usize = 10_000;

fn refused(path: &Path, reason: impl std::fmt::Display) -> StabilizeError {
    StabilizeError::Input(format!("{}: {reason}", path.display()))
}

/// A motion file (`plumbline.motion`) that was read.
pub struct MotionFile {
    path: PathBuf,
    motion: ClipMotion,
    store: Option<TrackStore>,
}

impl MotionFile {
    /// Reads the file.
    ///
    /// # Errors
    /// [`StabilizeError::Input`]: it cannot be read, or is none.
    pub fn read(path: &Path) -> Result<Self, StabilizeError> {
        let file = open_regular(path).map_err(|e| refused(path, format!("cannot be read: {e}")))?;
        let (motion, store) = ClipMotion::read_json(file).map_err(|e| refused(path, e))?;
        Ok(Self { path: path.to_owned(), motion, store })
    }

    /// Refuses a file of another size than the clip's.
    ///
    /// # Errors
    /// [`StabilizeError::Input`].
    pub fn check_size(&self, info: &ClipInfo) -> Result<(), StabilizeError> {
        let (w, h) = (self.motion.width as usize, self.motion.height as usize);
        let (clip_w, clip_h) = (info.width, info.height);
        if (w, h) == (clip_w, clip_h) {
            return Ok(());
        }
        let reason =
            format!("source is of {w}×{h} px, and the clip of {clip_w}×{clip_h} px; it belongs to another clip");
        Err(refused(&self.path, reason))
    }

    /// Whether number and mean rate of the frames agree with the header of the clip: then the frames need not be read to accept
    /// the file.
    pub fn matches(&self, info: &ClipInfo) -> bool {
        let count = info.frames == Some(self.motion.frames.len() as u64);
        let rates = self.motion.frame_period_s().zip(info.frame_rate);
        count && rates.is_some_and(|(period, rate)| (period * rate - 1.0).abs() <= MAX_RATE_DIFFERENCE)
    }

    /// Refuses motion of other frames than the clip's, which are shown at `times`.
    ///
    /// # Errors
    /// [`StabilizeError::Input`].
    pub fn check_times(&self, times: &[Timestamp], info: &ClipInfo) -> Result<(), StabilizeError> {
        let (found, frames) = (self.motion.frames.len(), times.len());
        if found != frames {
            let reason =
                format!("frames has {found} entries, and the clip {frames} frames; it belongs to another clip or span");
            return Err(refused(&self.path, reason));
        }
        let from_first = |times: Vec<f64>| {
            let first = times.first().copied().unwrap_or(0.0);
            times.into_iter().map(|t| t - first).collect::<Vec<f64>>()
        };
        let timebase = self.motion.timebase;
        let theirs = from_first(self.motion.frames.iter().map(|f| timebase.seconds(f.pts)).collect());
        let ours = from_first(times.iter().map(|t| info.timebase.seconds(*t)).collect());
        // Time bases differ between containers: a difference of half a frame period means another frame.
        let slack = 0.5 * ours.last().copied().unwrap_or(0.0) / (frames.max(2) - 1) as f64;
        let off = theirs.iter().zip(&ours).position(|(a, b)| !((a - b).abs() <= slack));
        off.map_or(Ok(()), |k| {
            let (found, expected) = (theirs[k], ours[k]);
            let reason =
                format!("frames[{k}].pts is {found:.3} s after the first (expected {expected:.3} s, as in the clip)");
            Err(refused(&self.path, reason))
        })
    }

    /// Whether the file has tracks: without them frames follow the planned camera without a mesh warp.
    pub fn has_tracks(&self) -> bool {
        self.store.is_some()
    }

    /// Its motion and tracks.
    ///
    /// # Errors
    /// [`StabilizeError::Store`].
    pub fn into_motion(self) -> Result<(ClipMotion, Tracks), StabilizeError> {
        let Self { motion, store, .. } = self;
        let store = store.map_or_else(|| without_points(&motion), Ok)?;
        let (width, height, timebase) = (motion.width as usize, motion.height as usize, motion.timebase);
        Ok((motion, Tracks { store, width, height, timebase }))
    }
}

/// As many frames as the motion has, and no points.
fn without_points(motion: &ClipMotion) -> Result<TrackStore, StabilizeError> {
    let mut store = TrackStore::new()?;
    for frame in &motion.frames {
        let (pts, quality) = (frame.pts, FrameQuality::default());
        store.push(&FrameTracks { pts, observations: Vec::new(), quality })?;
    }
    Ok(store)
}

/// COLMAP models of a clip's shots.
pub struct ImportedModels {
    folder: PathBuf,
    models: Vec<Model>,
}

/// The motion that models and their points imply.
pub struct ImportedMotion {
    /// Motion of the clip, with its cameras in space.
    pub motion: ClipMotion,
    /// The points of the models.
    pub tracks: Tracks,
    /// Frames that no image of a model is of.
    pub frames_without_image: usize,
}

impl ImportedModels {
    /// Reads the model in `folder`, or those in its numbered folders where it contains none.
    ///
    /// # Errors
    /// [`StabilizeError::Input`]: no model, or one that cannot be used.
    pub fn read(folder: &Path) -> Result<Self, StabilizeError> {
        let models = folders_of(folder).iter().map(|f| Model::read(f)).collect::<Result<Vec<_>, ColmapError>>();
        let models = models.map_err(|source| match source {
            ColmapError::Io { .. } | ColmapError::NoModel { .. } => StabilizeError::Input(source.to_string()),
            _ => refused(folder, source),
        })?;
        Ok(Self { folder: folder.to_owned(), models })
    }

    /// Cameras and points of the models, and the motion that the points imply, for a clip whose frames are shown at `times`.
    ///
    /// # Errors
    /// [`StabilizeError::Input`]: the models are of another clip; [`StabilizeError::Store`].
    pub fn motion(&self, times: &[Timestamp], info: &ClipInfo) -> Result<ImportedMotion, StabilizeError> {
        let size = (info.width as u32, info.height as u32);
        let found = ImportedClip::new(&self.models, times.len(), size).map_err(|e| refused(&self.folder, e))?;
        let images: usize = found.shots.iter().map(|s| s.images).sum();
        let mut measurement = MotionMeasurement::new((info.width, info.height))?;
        for (k, (&pts, observations)) in times.iter().zip(found.tracks).enumerate() {
            let cut_before = found.shots.iter().any(|s| s.frames.start == k);
            let quality = FrameQuality { cut_before, ..FrameQuality::default() };
            measurement.push(FrameTracks { pts, observations, quality })?;
        }
        let (mut motion, tracks) = measurement.finish(info);
        motion.cameras = Some(found.cameras);
        Ok(ImportedMotion { motion, tracks, frames_without_image: times.len().saturating_sub(images) })
    }
}

/// The folders of the models: `folder` itself, or the numbered ones in it where it contains none.
fn folders_of(folder: &Path) -> Vec<PathBuf> {
    let own = ["cameras.bin", "cameras.txt"].iter().any(|name| folder.join(name).is_file());
    let numbered: Vec<PathBuf> =
        (0..MAX_MODELS).map(|k| folder.join(k.to_string())).take_while(|f| f.is_dir()).collect();
    if own || numbered.is_empty() { vec![folder.to_owned()] } else { numbered }
}
