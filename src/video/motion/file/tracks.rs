//! The block of a motion file with the tracked points.
//!
//! ```json
//! "tracks": { "unit_px": 0.00390625, "frames": [
//! { "ids": [3,7,12], "x": [81920,5034,160001], "y": [46080,911,70333], "moving": [12] },
//! …
//! ] }
//! ```
//!
//! One entry per frame: ids in ascending order, positions in `unit_px` px, and the ids that do not move with the background. An
//! id in two frames is the same point of the scene. We write whole steps of [`RESOLUTION_PX`], to which a store rounds anyway, so
//! that the tracks are read back bit for bit. A point takes about 20 bytes.

use std::fmt;
use std::io::{self, Write};

use serde::de::{DeserializeSeed, Error, MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};

use super::MotionFileError;
use crate::track::{FrameQuality, FrameTracks, Observation, RESOLUTION_PX, TrackStore};
use plumbline_num::time::Timestamp;

/// Greatest distance of a point outside the picture, px: trackers follow points whose window is half outside.
const MARGIN_PX: f64 = 1.0;

/// The block, as the schema describes it.
#[cfg(feature = "schema")]
#[derive(schemars::JsonSchema)]
#[expect(dead_code, reason = "read frame by frame into a store, never into this")]
pub(super) struct TracksBlock {
    /// Unit of the positions, px.
    unit_px: f64,
    /// Per frame its points.
    frames: Vec<FrameEntry>,
}

/// The points of a frame.
#[derive(Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
struct FrameEntry {
    /// Identities, ascending.
    ids: Vec<u32>,
    /// Positions, right, in `unit_px`.
    x: Vec<f64>,
    /// Positions, down, in `unit_px`.
    y: Vec<f64>,
    /// Ids of those that move by themselves.
    moving: Vec<u32>,
}

/// An entry in whole steps, for writing.
#[derive(Serialize)]
struct WrittenEntry {
    ids: Vec<u32>,
    x: Vec<u32>,
    y: Vec<u32>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    moving: Vec<u32>,
}

/// Writes the block.
pub(super) fn write(out: &mut impl Write, tracks: &TrackStore) -> Result<(), MotionFileError> {
    write!(out, ",\n\"tracks\": {{ \"unit_px\": {RESOLUTION_PX}, \"frames\": [")?;
    let steps = |v: f32| (v / RESOLUTION_PX).round() as u32;
    for k in 0..tracks.frames() {
        let seen = tracks.read(k)?.observations;
        let entry = WrittenEntry {
            ids: seen.iter().map(|o| o.id).collect(),
            x: seen.iter().map(|o| steps(o.x)).collect(),
            y: seen.iter().map(|o| steps(o.y)).collect(),
            moving: seen.iter().filter(|o| !o.background).map(|o| o.id).collect(),
        };
        out.write_all(if k == 0 { b"\n" } else { b",\n" })?;
        serde_json::to_writer(&mut *out, &entry).map_err(io::Error::from)?;
    }
    Ok(write!(out, "\n] }}")?)
}

/// Reads the block into a store, one frame at a time.
pub(super) struct TracksSeed {
    /// Times of the frames.
    times: Vec<Timestamp>,
    /// Width and height of the picture, px.
    size: (u32, u32),
    /// What is added to positions, px.
    shift: f64,
}

impl TracksSeed {
    /// For a clip whose frames are shown at `times`.
    pub(super) fn new(times: Vec<Timestamp>, size: (u32, u32), shift: f64) -> Self {
        Self { times, size, shift }
    }

    /// The observations of an entry, or what is wrong with it.
    fn observations(&self, entry: &FrameEntry, unit: f64) -> Result<Vec<Observation>, String> {
        let (n, x, y) = (entry.ids.len(), entry.x.len(), entry.y.len());
        if (x, y) != (n, n) {
            return Err(format!("{n} ids, {x} x and {y} y (expected as many of each)"));
        }
        let mut seen = Vec::with_capacity(n);
        for (k, &id) in entry.ids.iter().enumerate() {
            if k > 0 && id <= entry.ids[k - 1] {
                return Err(format!("ids[{k}] is {id} (expected more than the id before)"));
            }
            let coordinate = |v: f64, size: u32, name: &str| {
                let px = v * unit + self.shift;
                let size = f64::from(size);
                let inside = px >= -MARGIN_PX && px <= size + MARGIN_PX;
                let wrong = || format!("{name}[{k}] is {v}, or {px} px (expected 0 to {size} px)");
                if inside { Ok(px.clamp(0.0, size) as f32) } else { Err(wrong()) }
            };
            let (x, y) = (coordinate(entry.x[k], self.size.0, "x")?, coordinate(entry.y[k], self.size.1, "y")?);
            seen.push(Observation { id, x, y, background: true });
        }
        for id in &entry.moving {
            let at = entry.ids.binary_search(id);
            let at = at.map_err(|_| format!("moving contains {id} (expected one of the ids)"))?;
            seen[at].background = false;
        }
        Ok(seen)
    }
}

impl<'de> DeserializeSeed<'de> for TracksSeed {
    type Value = Option<TrackStore>;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Self::Value, D::Error> {
        deserializer.deserialize_option(self)
    }
}

impl<'de> Visitor<'de> for TracksSeed {
    type Value = Option<TrackStore>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("tracks with unit_px and frames")
    }

    fn visit_none<E: Error>(self) -> Result<Self::Value, E> {
        Ok(None)
    }

    fn visit_unit<E: Error>(self) -> Result<Self::Value, E> {
        Ok(None)
    }

    fn visit_some<D: Deserializer<'de>>(self, deserializer: D) -> Result<Self::Value, D::Error> {
        deserializer.deserialize_map(self)
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Self::Value, A::Error> {
        let (mut unit, mut store, mut waiting) = (None, None, None);
        while let Some(key) = map.next_key::<String>()? {
            match (key.as_str(), unit) {
                ("unit_px", _) => unit = Some(checked_unit(map.next_value()?)?),
                ("frames", Some(unit)) => store = Some(map.next_value_seed(Frames { tracks: &self, unit })?),
                // Another program wrote the unit behind them.
                ("frames", None) => waiting = Some(map.next_value::<Vec<FrameEntry>>()?),
                _ => return Err(A::Error::unknown_field(&key, &["unit_px", "frames"])),
            }
        }
        if let Some(entries) = waiting {
            let mut filling = Filling::new(&self, unit.ok_or_else(|| A::Error::missing_field("unit_px"))?)?;
            entries.iter().try_for_each(|entry| filling.push(entry))?;
            store = Some(filling.finish()?);
        }
        store.map(Some).ok_or_else(|| A::Error::missing_field("frames"))
    }
}

fn checked_unit<E: Error>(unit: f64) -> Result<f64, E> {
    let wrong = || E::custom(format!("tracks.unit_px is {unit} (expected above 0 up to 1)"));
    (unit > 0.0 && unit <= 1.0).then_some(unit).ok_or_else(wrong)
}

/// A store in the making.
struct Filling<'t> {
    tracks: &'t TracksSeed,
    unit: f64,
    store: TrackStore,
}

impl<'t> Filling<'t> {
    fn new<E: Error>(tracks: &'t TracksSeed, unit: f64) -> Result<Self, E> {
        Ok(Self { tracks, unit, store: TrackStore::new().map_err(E::custom)? })
    }

    fn push<E: Error>(&mut self, entry: &FrameEntry) -> Result<(), E> {
        let (k, times) = (self.store.frames(), &self.tracks.times);
        let wrong = |what: String| E::custom(format!("tracks.frames[{k}]: {what}"));
        let pts = times.get(k).ok_or_else(|| wrong(format!("one frame too many (expected {})", times.len())))?;
        let observations = self.tracks.observations(entry, self.unit).map_err(wrong)?;
        let frame = FrameTracks { pts: *pts, observations, quality: FrameQuality::default() };
        self.store.push(&frame).map_err(E::custom)
    }

    fn finish<E: Error>(self) -> Result<TrackStore, E> {
        let (found, frames) = (self.store.frames(), self.tracks.times.len());
        let wrong = || E::custom(format!("tracks.frames has {found} entries for {frames} frames"));
        if found == frames { Ok(self.store) } else { Err(wrong()) }
    }
}

/// Reads the list of frames.
struct Frames<'t> {
    tracks: &'t TracksSeed,
    unit: f64,
}

impl<'de> DeserializeSeed<'de> for Frames<'_> {
    type Value = TrackStore;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<TrackStore, D::Error> {
        deserializer.deserialize_seq(self)
    }
}

impl<'de> Visitor<'de> for Frames<'_> {
    type Value = TrackStore;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a list of frames")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<TrackStore, A::Error> {
        let mut filling = Filling::new(self.tracks, self.unit)?;
        while let Some(entry) = list.next_element::<FrameEntry>()? {
            filling.push(&entry)?;
        }
        filling.finish()
    }
}
