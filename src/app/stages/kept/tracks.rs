//! The tracks of a clip: window by window, before any lens is applied and any path is planned.

use std::io;
use std::path::Path;

use serde_json::{Value as Json, json};

use super::{Slot, TRACKS, clip};
use crate::pipeline::RunError;
use crate::pipeline::cache::{Cache, Entry, Key, NewEntry};
use crate::pipeline::paths::unescaped;
use crate::stages::context::Context;
use crate::stages::{DecodeSettings, TrackSettings};
use plumbline_video::motion::ClipMotion;
use plumbline_video::stabilize::{StabilizeError, Tracks, WindowJoiner};
use plumbline_video::track::{AnalysisWindows, FrameTracks, WindowTracks};

/// Where the tracks of a clip are, or will be.
pub(crate) struct CachedTracks(Slot);

impl CachedTracks {
    /// Those of stage number `stage` on the clip that stage number `decode` opens; `None` where they are not kept.
    pub(crate) fn of(
        context: &mut Context<'_, '_>,
        stage: usize,
        decode: usize,
        options: &TrackSettings,
    ) -> Option<Self> {
        let (path, decoded) = clip(context, decode)?;
        let slot = Slot::of(context, stage, &TRACKS, |cache| {
            key_parts(&path, &decoded, options, |path| cache.digest_of(path))
        });
        slot.map(Self)
    }

    /// The tracks, joined from the windows; `None` where they are not there.
    ///
    /// # Errors
    /// Faults that have nothing to do with the cache.
    pub(crate) fn find(
        &self,
        joiner: WindowJoiner<'_>,
        context: &mut Context<'_, '_>,
    ) -> Result<Option<KnownTracks>, RunError> {
        Ok(self.0.find(context, |entry| joined(entry, joiner)).transpose()?)
    }

    /// Begins to store them.
    pub(crate) fn begin(self, size: (usize, usize), context: &mut Context<'_, '_>) -> Option<Recording> {
        match self.0.begin(context) {
            Ok(entry) => Some(Recording { slot: self.0, entry, size, open: Vec::new(), failed: None }),
            Err(error) => {
                self.0.report(context, Err(error));
                None
            }
        }
    }
}

/// What decides the tracks of a clip.
fn key_parts<E>(
    path: &Path,
    decoded: &DecodeSettings,
    options: &TrackSettings,
    digest: impl Fn(&Path) -> Result<String, E>,
) -> Result<[(&'static str, Json); 4], E> {
    let mask = options.mask.as_deref().map(&digest).transpose()?;
    Ok([
        ("clip", json!(digest(path)?)),
        ("decode", json!(decoded)),
        ("mask", json!(mask)),
        ("points", json!(options.points)),
    ])
}

/// Whether the tracks of a clip are there; no file is read whose digest is not known.
pub(super) fn are_kept(
    cache: &Cache,
    build: &str,
    path: &Path,
    decoded: &DecodeSettings,
    options: &TrackSettings,
) -> bool {
    let options = TrackSettings { mask: options.mask.as_deref().map(unescaped), ..options.clone() };
    let Ok(parts) = key_parts(path, decoded, &options, |path| cache.known_digest_of(path).ok_or(())) else {
        return false;
    };
    let key = Key::new(TRACKS.stage, TRACKS.version, parts.into_iter().chain([("build", build.into())]));
    cache.has(&key)
}

/// The tracks of a clip from the cache.
pub(crate) struct KnownTracks {
    pub(crate) motion: ClipMotion,
    pub(crate) tracks: Tracks,
    /// Of each frame, whether the tracker took it for the first of a shot.
    pub(crate) cuts: Vec<bool>,
}

/// The tracks of the windows of an entry, or a fault of the clip; otherwise the fault of the entry.
fn joined(entry: &Entry, mut joiner: WindowJoiner<'_>) -> Result<Result<KnownTracks, StabilizeError>, String> {
    if entry.is_empty() {
        return Err("damaged: no window".to_owned());
    }
    let windows = AnalysisWindows::default();
    let mut cuts = Vec::new();
    for index in 0..entry.len() {
        let bytes = entry.read(index).map_err(|e| e.to_string())?;
        let window = WindowTracks::read(bytes.as_slice()).map_err(|e| format!("damaged: {e}"))?;
        // The window that owns a frame decides.
        let warm_up = windows.owned(index).start - windows.read(index).start;
        cuts.extend(window.frames.iter().skip(warm_up).map(|frame| frame.quality.starts_shot()));
        match joiner.push(window) {
            Err(StabilizeError::Input(fault)) => return Err(format!("damaged: {fault}")),
            Err(other) => return Ok(Err(other)),
            Ok(()) => {}
        }
    }
    Ok(joiner.finish().map(|(motion, tracks)| KnownTracks { motion, tracks, cuts }))
}

/// Tracks on their way into the cache.
pub(crate) struct Recording {
    slot: Slot,
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
        self.slot.report(context, published);
    }
}
