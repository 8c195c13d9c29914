//! Virtual cameras in space, joined to the planner that thinks in the picture.
//!
//! A virtual camera `V_t` shows the scene's points at `q = V_t X`. In the picture that is, near enough for planning, a
//! similarity `G_t` (`shown_from_src`), fitted over the points a frame sees. The planner gets the motion that a film of these
//! views would show,
//!
//! ```text
//! F_t = G_t⁻¹ P_t G_{t−1},      P_t: similarity from the views of frame t − 1 to those of frame t,
//! ```
//!
//! and answers with windows `W_t` (`out_from_src`) inside the frames. What turns a view into the output is then the
//! correction `D_t = W_t G_t⁻¹`: it holds crop and zoom, and is as smooth as the planned path.

use std::collections::HashMap;

use super::analysis::{Tracks, store_error};
use crate::camera::{CameraPose, Intrinsics, Point3};
use crate::math::{Homography, Point2, Similarity2};
use crate::motion::{self, ClipCameras, ClipMotion, FrameCamera, Pair};
use crate::path::{InterFrame, VirtualCamera, VirtualPath};
use crate::pipeline::run_error::RunError;
use crate::track::Observation;

/// Sightings that a similarity is fitted to, at least.
const LEAST_SIGHTINGS: usize = 12;

/// Distance, px at 640 px across, at which a sighting is not one of the point that its track stands for.
const WRONG_PX: f64 = 3.0;

/// Points in space by their tracks.
pub(super) struct Places<'a> {
    cameras: &'a ClipCameras,
    by_track: HashMap<u32, Point3>,
    wrong_px: f64,
}

impl<'a> Places<'a> {
    pub(super) fn new(cameras: &'a ClipCameras, motion: &ClipMotion) -> Self {
        let by_track = cameras.points.iter().map(|p| (p.id, p.place)).collect();
        Self { cameras, by_track, wrong_px: WRONG_PX * f64::from(motion.width.max(motion.height)) / 640.0 }
    }

    /// Where the point of a sighting is; `None` where that is not known, or the frame's camera sees it elsewhere.
    pub(super) fn of(&self, frame: usize, seen: &Observation) -> Option<Point3> {
        let place = *self.by_track.get(&seen.id)?;
        let camera = self.cameras.frames.get(frame).copied().flatten()?;
        let expected = camera.intrinsics.project(&camera.pose.apply(&place))?;
        let miss = expected - Point2::new(f64::from(seen.x), f64::from(seen.y));
        (miss.norm() <= self.wrong_px).then_some(place)
    }
}

/// What virtual cameras make of the frames of a clip.
pub(super) struct Views {
    frames: Vec<Option<View>>,
}

/// One frame under its virtual camera.
struct View {
    pose: CameraPose,
    intrinsics: Intrinsics,
    /// `G_t`.
    shown_from_src: Similarity2,
    /// `P_t`, where the frame before has a view of the same points.
    step: Option<Similarity2>,
}

impl Views {
    /// The views of `virtual_poses`, one per frame.
    pub(super) fn new(
        tracks: &Tracks,
        places: &Places<'_>,
        virtual_poses: &[Option<CameraPose>],
    ) -> Result<Self, RunError> {
        let mut before: HashMap<u32, Point2> = HashMap::new();
        let mut frames = Vec::with_capacity(virtual_poses.len());
        for (frame, pose) in virtual_poses.iter().enumerate() {
            let camera = places.cameras.frames.get(frame).copied().flatten();
            let Some((pose, camera)) = pose.zip(camera) else {
                before.clear();
                frames.push(None);
                continue;
            };
            let seen = tracks.store.read(frame).map_err(store_error)?.observations;
            let shown = shown(&seen, places, frame, &FrameCamera { pose, ..camera });
            let steps = shown.iter().filter_map(|(id, _, now)| Some(Pair { previous: *before.get(id)?, this: *now }));
            let step = fitted(&steps.collect::<Vec<_>>());
            let pairs: Vec<Pair> = shown.iter().map(|(_, src, now)| Pair { previous: *src, this: *now }).collect();
            let view = |shown_from_src| View { pose, intrinsics: camera.intrinsics, shown_from_src, step };
            frames.push(fitted(&pairs).map(view));
            before = shown.into_iter().map(|(id, _, now)| (id, now)).collect();
        }
        Ok(Self { frames })
    }

    /// Number of frames with a view.
    pub(super) fn known(&self) -> usize {
        self.frames.iter().flatten().count()
    }

    /// Replaces the measured motion by `F_t` wherever it is known.
    pub(super) fn retarget(&self, steps: &mut [InterFrame]) {
        for (t, pair) in self.frames.windows(2).enumerate() {
            let [Some(before), Some(now)] = pair else { continue };
            if let Some((step, back)) = now.step.zip(now.shown_from_src.inverse()) {
                let similarity = back * step * before.shown_from_src;
                steps[t + 1] = InterFrame { similarity, homography: similarity.to_homography(), reliable: true };
            }
        }
    }

    /// `G_t` of every frame; where there is none, that of the frame before, or of the first that has one.
    pub(super) fn out_from_src(&self) -> Vec<Similarity2> {
        let mut last = self.frames.iter().flatten().next().map_or(Similarity2::IDENTITY, |v| v.shown_from_src);
        let held = self.frames.iter().map(|view| {
            last = view.as_ref().map_or(last, |v| v.shown_from_src);
            last
        });
        held.collect()
    }

    /// The virtual cameras with what the planned path makes of their pictures.
    pub(super) fn cameras(&self, path: &VirtualPath) -> Vec<Option<VirtualCamera>> {
        let camera = |(view, out_from_src): (&Option<View>, &Homography)| {
            let view = view.as_ref()?;
            let correction = similarity_of(out_from_src) * view.shown_from_src.inverse()?;
            Some(VirtualCamera { pose: view.pose, intrinsics: view.intrinsics, correction })
        };
        self.frames.iter().zip(&path.out_from_src).map(camera).collect()
    }
}

/// Tracks with a place: id, where the frame sees it, where the view shows it.
fn shown(seen: &[Observation], places: &Places<'_>, frame: usize, view: &FrameCamera) -> Vec<(u32, Point2, Point2)> {
    let shown = |o: &Observation| {
        let place = places.of(frame, o)?;
        let now = view.intrinsics.project(&view.pose.apply(&place))?;
        Some((o.id, Point2::new(f64::from(o.x), f64::from(o.y)), now))
    };
    seen.iter().filter_map(shown).collect()
}

fn fitted(pairs: &[Pair]) -> Option<Similarity2> {
    let enough = pairs.len() >= LEAST_SIGHTINGS;
    enough.then(|| motion::similarity(pairs, &vec![1.0; pairs.len()])).flatten()
}

/// The map of a planned path, which is a similarity, as one.
fn similarity_of(h: &Homography) -> Similarity2 {
    let m = h.matrix();
    Similarity2 { a: m[(0, 0)], b: m[(1, 0)], t: crate::math::Vec2::new(m[(0, 2)], m[(1, 2)]) }
}
