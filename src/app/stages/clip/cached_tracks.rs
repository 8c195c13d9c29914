//! The tracks of a clip in the cache: window by window, before any lens is applied and any path is planned.

use std::io;

use serde_json::json;

use crate::pipeline::RunError;
use crate::pipeline::cache::{Cache, Entry, Key, NewEntry};
use crate::pipeline::paths::to_path;
use crate::stages::context::Context;
use crate::stages::{DecodeSettings, TrackSettings};
use plumbline_video::motion::ClipMotion;
use plumbline_video::stabilize::{StabilizeError, Tracks, WindowJoiner};
use plumbline_video::track::{FrameTracks, WindowTracks};

const KIND: &str = "video.track";
/// To be raised whenever the tracker gives other bits for the same frames.
const VERSION: u32 = 1;

/// Where the tracks of a clip are, or will be.
pub(crate) struct CachedTracks {
    cache: Cache,
    key: Key,
}

impl CachedTracks {
    /// Of the clip that stage number `decode` opens; `None` where there is no cache, or the clip is more than one file. A cache
    /// that cannot be used is a warning.
    pub(crate) fn of(context: &mut Context<'_, '_>, decode: usize, options: &TrackSettings) -> Option<Self> {
        let folder = context.job.cache?;
        let settings = context.stage(decode).settings.get::<DecodeSettings>()?.clone();
        let path = to_path(&settings.path);
        // A playlist names other files, and a pattern means them.
        if !path.is_file() || settings.allow_playlist {
            return None;
        }
        let found = Cache::open(folder).and_then(|cache| {
            let mask = options.mask.as_deref().map(|mask| cache.digest_of(mask)).transpose()?;
            let decoded = DecodeSettings { path: String::new(), ..settings };
            let key = Key::new(KIND, VERSION, &json!([cache.digest_of(&path)?, decoded, mask, options.points]));
            Ok(Self { cache, key })
        });
        found.map_err(|e| context.warn(format!("the cache `{}` is not used: {e}", folder.display()))).ok()
    }

    /// The motion and the tracks, joined from the windows; `None` where they are not there. Damage is a warning.
    ///
    /// # Errors
    /// Faults that have nothing to do with the cache.
    pub(crate) fn find(
        &self,
        joiner: WindowJoiner<'_>,
        context: &mut Context<'_, '_>,
    ) -> Result<Option<(ClipMotion, Tracks)>, RunError> {
        let Some(entry) = self.cache.find(&self.key) else { return Ok(None) };
        match joined(&entry, joiner) {
            Ok(found) => Ok(Some(found)),
            Err(Fault::Entry(error)) => {
                let removed =
                    self.cache.remove(&self.key).map_or("; they cannot be removed", |()| "; they were removed");
                context.warn(format!("tracks in the cache: {error}{removed}"));
                Ok(None)
            }
            Err(Fault::Clip(error)) => Err(error.into()),
        }
    }

    /// Begins to store them; a cache that takes nothing is a warning.
    pub(crate) fn begin(&self, size: (usize, usize), context: &mut Context<'_, '_>) -> Option<Recording> {
        match self.cache.begin(KIND, &self.key) {
            Ok(entry) => Some(Recording { entry, size, open: Vec::new(), failed: None }),
            Err(error) => {
                context.warn(not_stored(&error));
                None
            }
        }
    }
}

enum Fault {
    /// The entry is damaged, or cannot be read.
    Entry(String),
    Clip(StabilizeError),
}

fn joined(entry: &Entry, mut joiner: WindowJoiner<'_>) -> Result<(ClipMotion, Tracks), Fault> {
    if entry.is_empty() {
        return Err(Fault::Entry("damaged: no window".to_owned()));
    }
    for index in 0..entry.len() {
        let bytes = entry.read(index).map_err(|e| Fault::Entry(e.to_string()))?;
        let window = WindowTracks::read(bytes.as_slice()).map_err(|e| Fault::Entry(format!("damaged: {e}")))?;
        joiner.push(window).map_err(|e| match e {
            StabilizeError::Input(fault) => Fault::Entry(format!("damaged: {fault}")),
            other => Fault::Clip(other),
        })?;
    }
    joiner.finish().map_err(Fault::Clip)
}

/// Tracks on their way into the cache.
pub(crate) struct Recording {
    entry: NewEntry,
    size: (usize, usize),
    /// Windows that read the present frame.
    open: Vec<WindowTracks>,
    failed: Option<io::Error>,
}

impl Recording {
    /// Takes the tracks of a window in the next frame that it reads.
    pub(crate) fn note(&mut self, window: usize, tracks: &FrameTracks) {
        match self.open.iter_mut().find(|open| open.window == window) {
            Some(open) => open.frames.push(tracks.clone()),
            None => self.open.push(WindowTracks { size: self.size, window, frames: vec![tracks.clone()] }),
        }
    }

    /// After each frame, of which `owner` is the first window that read it: those before are whole.
    pub(crate) fn flush(&mut self, owner: usize) {
        while self.open.first().is_some_and(|open| open.window < owner) {
            let window = self.open.remove(0);
            self.write(&window);
        }
    }

    fn write(&mut self, window: &WindowTracks) {
        if self.failed.is_some() {
            return;
        }
        let mut bytes = Vec::new();
        let written = window.write(&mut bytes).map_err(io::Error::other);
        let name = format!("{:05}.window", window.window);
        self.failed = written.and_then(|()| self.entry.write(&name, &bytes)).err();
    }

    /// Makes the tracks known.
    pub(crate) fn publish(mut self, context: &mut Context<'_, '_>) {
        self.flush(usize::MAX);
        let published = self.failed.take().map_or_else(|| self.entry.publish(), Err);
        if let Err(error) = published {
            context.warn(not_stored(&error));
        }
    }
}

fn not_stored(error: &io::Error) -> String {
    format!("the tracks were not stored in the cache: {error}")
}
