//! Results that are kept in the cache, and how a stage takes them from there.
//!
//! | result | kind | decided by |
//! | --- | --- | --- |
//! | tracks | `video.track` | the clip, the part of it and the stream, the mask, the number of points |
//! | cameras | `video.motion` | the tracks as they are, after any lens; the focal length that is known; the rolling shutter |
//! | importance | `video.importance` | the clip and its part, the mask, whether faces are looked for, the tracker that finds its cuts |
//! | skeleton | `skeleton.extract` | the surface as it is; the options of the contraction, not how many joints are made of the curve |
//! | weights | `skin.weights` | the surface and the skeleton as they are; the options |
//!
//! Clips are known by the content of their files, since their frames are never all in memory; all else by its content in memory, from
//! whichever file and through whichever stages it came. What a clip is decoded from in several files is not kept.
//!
//! The importance of a photo is not: of 12 megapixels it takes 0.04 s, of the 0.7 s of a new shape for the photo.

mod cameras;
mod curve;
mod importance;
mod surface;
mod tracks;
mod weights;

use std::io;
use std::path::{Path, PathBuf};
use std::time::UNIX_EPOCH;

use serde_json::Value as Json;

use super::context::Context;
use super::video_decode::DecodeSettings;
use crate::pipeline::RunError;
use crate::pipeline::batch::Instance;
use crate::pipeline::cache::{Cache, Entry, Key, Made, NewEntry, source_name};
use crate::pipeline::graph::Stage;
use crate::pipeline::kind::Settings;
use crate::pipeline::paths::to_path;
use crate::stages::{MotionSettings, TrackSettings};

pub(crate) use cameras::with_cameras;
pub(crate) use curve::curve_of;
pub(crate) use importance::importance_slot;
pub(crate) use tracks::{CachedTracks, Recording};
pub(crate) use weights::weights_of;

/// A kind of result that is kept.
#[derive(Debug)]
pub(crate) struct ResultKind {
    /// What the summary calls it, and `--force`.
    pub(crate) name: &'static str,
    /// The kind of stage that makes it.
    pub(crate) stage: &'static str,
    /// To be raised whenever the same inputs and settings give other bits.
    version: u32,
}

/// All kinds of results that are kept.
pub(crate) const RESULTS: [&ResultKind; 5] = [&TRACKS, &CAMERAS, &IMPORTANCE, &SKELETON, &WEIGHTS];

static TRACKS: ResultKind = ResultKind { name: "tracks", stage: "video.track", version: 1 };
static CAMERAS: ResultKind = ResultKind { name: "cameras", stage: "video.motion", version: 1 };
static IMPORTANCE: ResultKind = ResultKind { name: "importance", stage: "video.importance", version: 1 };
static SKELETON: ResultKind = ResultKind { name: "skeleton", stage: "skeleton.extract", version: 1 };
static WEIGHTS: ResultKind = ResultKind { name: "weights", stage: "skin.weights", version: 1 };

/// Where a result is, or will be.
pub(crate) struct Slot {
    cache: Cache,
    key: Key,
    of: &'static ResultKind,
    /// It is computed anew though it is there.
    is_forced: bool,
}

impl Slot {
    /// That of a result of stage number `stage`, which `parts` decide; `None` where there is no cache. One that cannot be used is a
    /// warning, if the user named it.
    pub(crate) fn of<P>(
        context: &mut Context<'_, '_>,
        stage: usize,
        of: &'static ResultKind,
        parts: impl FnOnce(&Cache) -> io::Result<P>,
    ) -> Option<Self>
    where
        P: IntoIterator<Item = (&'static str, Json)>,
    {
        let used = context.job.cache?;
        let opened = used.open().and_then(|cache| {
            let parts = parts(&cache)?.into_iter().chain([("build", cache.program()?.into())]);
            let key = Key::new(of.stage, of.version, parts);
            Ok((cache, key))
        });
        match opened {
            Ok((cache, key)) => {
                let stage = context.stage(stage);
                let names = [of.name, of.stage, stage.kind.name, stage.name.as_str()];
                let is_forced = used.force.iter().any(|forced| names.contains(&forced.as_str()));
                Some(Self { cache, key, of, is_forced })
            }
            Err(error) => {
                let text = format!("the cache `{}` is not used: {error}", to_path(&used.folder).display());
                if used.named {
                    context.warn(text);
                } else {
                    tracing::info!("{text}");
                }
                None
            }
        }
    }

    /// The result, read from its entry; `None` where it is not there, or is to be computed anew. Damage is a warning.
    pub(crate) fn find<T>(
        &self,
        context: &mut Context<'_, '_>,
        read: impl FnOnce(&Entry) -> Result<T, String>,
    ) -> Option<T> {
        if self.is_forced {
            return None;
        }
        let found = self.cache.find(&self.key).map_err(|e| e.to_string()).transpose()?;
        match found.and_then(|entry| read(&entry)) {
            Ok(result) => {
                let name = self.of.name.to_owned();
                if !context.summary.cached.contains(&name) {
                    context.summary.cached.push(name);
                }
                Some(result)
            }
            Err(error) => {
                let removed = self.cache.remove(&self.key);
                let removed =
                    removed.map_or_else(|e| format!("; it cannot be removed: {e}"), |()| "; it was removed".to_owned());
                context.warn(format!("{} in the cache: {error}{removed}", self.of.name));
                None
            }
        }
    }

    /// Begins to store the result.
    fn begin(&self, context: &Context<'_, '_>) -> io::Result<NewEntry> {
        /// Files of an item that its results are found by, at most: the examples of a training may be thousands.
        const MAX_SOURCES: usize = 8;
        let mut sources: Vec<PathBuf> = context.job.instance.inputs();
        sources.truncate(MAX_SOURCES);
        self.cache.begin(&self.key, &sources)
    }

    /// Reports that a result was not stored: a warning, if the user named the cache.
    fn report(&self, context: &mut Context<'_, '_>, stored: io::Result<()>) {
        let Err(error) = stored else { return };
        let text = format!("{} not stored in the cache: {error}", self.of.name);
        if context.job.cache.is_some_and(|used| used.named) {
            context.warn(text);
        } else {
            tracing::info!("{text}");
        }
    }
}

/// A result in files of its own.
pub(crate) trait Kept: Sized + PartialEq {
    /// Names of the files.
    const FILES: &'static [&'static str];

    /// The content of each; `None` for a result that they do not hold.
    fn to_files(&self) -> Option<Vec<Vec<u8>>>;

    /// The result in the content of each, which may be anything.
    fn of_files(files: &[Vec<u8>]) -> Result<Self, String>;
}

/// The result of a slot; computed where it is not there, or `fits` not what it is of.
pub(crate) fn kept<T: Kept>(
    slot: Option<&Slot>,
    context: &mut Context<'_, '_>,
    fits: impl FnOnce(&T) -> bool,
    compute: impl FnOnce(&mut Context<'_, '_>) -> Result<T, RunError>,
) -> Result<T, RunError> {
    if let Some(known) = slot.and_then(|slot| slot.take(context, fits)) {
        return Ok(known);
    }
    let result = compute(context)?;
    if let Some(slot) = slot {
        slot.keep(context, &result);
    }
    Ok(result)
}

impl Slot {
    /// The result, if it is there and `fits` what it is of.
    pub(crate) fn take<T: Kept>(&self, context: &mut Context<'_, '_>, fits: impl FnOnce(&T) -> bool) -> Option<T> {
        self.find(context, |entry| {
            if entry.len() != T::FILES.len() {
                return Err("damaged: the list of its files".to_owned());
            }
            let files = (0..entry.len()).map(|index| entry.read(index).map_err(|e| e.to_string()));
            let result = T::of_files(&files.collect::<Result<Vec<_>, _>>()?).map_err(|e| format!("damaged: {e}"))?;
            if fits(&result) { Ok(result) } else { Err("damaged: it is of something else".to_owned()) }
        })
    }

    /// Stores a result, unless its files would give another: a run with the cache has the results of a run without.
    pub(crate) fn keep<T: Kept>(&self, context: &mut Context<'_, '_>, result: &T) {
        let files = result.to_files().filter(|files| T::of_files(files).is_ok_and(|again| again == *result));
        let Some(files) = files else {
            tracing::info!("{} not stored in the cache: its files do not hold it", self.of.name);
            return;
        };
        let stored = self.begin(context).and_then(|mut entry| {
            T::FILES.iter().zip(&files).try_for_each(|(name, bytes)| entry.write(name, bytes))?;
            entry.publish()
        });
        self.report(context, stored);
    }
}

/// The results of an instance that are expected in the cache, of which `index` lists what is there and `build` is the program that runs.
///
/// Tracks are known by their key. What follows from a result in memory has a key that only the run knows: it is expected where a run of
/// this program on the same file stored one of its kind, and the file is older.
pub(crate) fn expected(instance: &Instance, cache: &Cache, index: &[Made], build: &str) -> Vec<&'static ResultKind> {
    let stages = &instance.graph.stages;
    let inputs: Vec<(String, u64)> =
        instance.inputs().iter().map(|path| (source_name(path), modified_ms(path))).collect();
    let is_made = |kind: &str| {
        let of_inputs = |made: &Made| {
            let is_source = |(name, modified): &(String, u64)| made.sources.contains(name) && *modified <= made.made_ms;
            made.kind == kind && made.build == build && inputs.iter().any(is_source)
        };
        index.iter().any(of_inputs)
    };
    let are_tracks = |stage: &Stage, options: &TrackSettings| {
        let decode = stage.edges.iter().find(|e| e.port.name == "frames").and_then(|e| stages.get(e.from));
        let clip = decode.and_then(|decode| clip_of(decode.settings.as_ref()));
        clip.is_some_and(|(path, decoded)| tracks::are_kept(cache, build, &path, &decoded, options))
    };
    let is_expected = |result: &&ResultKind| {
        stages.iter().filter(|stage| stage.kind.name == result.stage).any(|stage| {
            let (tracks, motion) = (stage.settings.get::<TrackSettings>(), stage.settings.get::<MotionSettings>());
            match (tracks, motion) {
                (Some(options), _) => are_tracks(stage, options),
                // Planar motion is measured each time.
                (_, Some(motion)) => motion.cameras && is_made(result.stage),
                _ => is_made(result.stage),
            }
        })
    };
    RESULTS.into_iter().filter(is_expected).collect()
}

/// When a file was changed, milliseconds since 1970; never, of one that cannot be looked at.
fn modified_ms(path: &Path) -> u64 {
    let modified = path.metadata().and_then(|meta| meta.modified()).ok();
    let since = modified.and_then(|time| time.duration_since(UNIX_EPOCH).ok());
    since.map_or(u64::MAX, |time| u64::try_from(time.as_millis()).unwrap_or(u64::MAX))
}

/// The parts of a key that say which frames stage number `decode` gives; `None` for a clip that is not one file: a playlist names
/// others, and a pattern means them.
fn clip(context: &Context<'_, '_>, decode: usize) -> Option<(PathBuf, DecodeSettings)> {
    clip_of(context.stage(decode).settings.as_ref())
}

/// The same by the settings of the stage.
fn clip_of(decode: &dyn Settings) -> Option<(PathBuf, DecodeSettings)> {
    let settings = decode.get::<DecodeSettings>()?.clone();
    let path = to_path(&settings.path);
    let is_one = path.is_file() && !settings.allow_playlist;
    is_one.then(|| (path, DecodeSettings { path: String::new(), ..settings }))
}
