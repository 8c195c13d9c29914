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
use std::ops::Range;

use super::analysis::{Tracks, store_error};
use super::covering::covering_zoom;
use crate::camera::{CameraPose, Intrinsics, Point3};
use crate::math::{Homography, Point2, Similarity2, Vec2};
use crate::motion::{self, ClipCameras, ClipMotion, FrameCamera, Pair};
use crate::path::{Clip, InterFrame, SteadyView, TrajectoryOptions, VirtualCamera, VirtualPath};
use crate::pipeline::run_error::RunError;
use crate::track::Observation;

/// Sightings that a similarity is fitted to, at least.
const LEAST_SIGHTINGS: usize = 12;

/// Distance, px at 640 px across, at which a sighting is not one of the point that its track stands for.
const WRONG_PX: f64 = 3.0;

/// Rounds of reweighting, each at the scale of the median miss: three settle a fit that starts from the mean.
const ROUNDS: usize = 3;

/// Zoom that steadied windows may cost: for one part in a hundred of the picture the mesh need not bend the border.
const MOST_ZOOM: f64 = 1.01;

/// Time, s, over which a track comes to count and ceases to.
const FADE_S: f64 = 0.5;

/// Weight of a track at its very ends: all of them together still make a fit where there is nothing else.
const LEAST_FADE: f64 = 1e-3;

/// Points in space by their tracks.
pub(super) struct Places<'a> {
    cameras: &'a ClipCameras,
    /// By segment, which has coordinates of its own, and track.
    by_track: HashMap<(u32, u32), Point3>,
    wrong_px: f64,
}

impl<'a> Places<'a> {
    pub(super) fn new(cameras: &'a ClipCameras, motion: &ClipMotion) -> Self {
        let by_track = cameras.points.iter().map(|p| ((p.shot, p.id), p.place)).collect();
        Self { cameras, by_track, wrong_px: WRONG_PX * f64::from(motion.width.max(motion.height)) / 640.0 }
    }

    /// Where the point of a sighting is; `None` where that is not known, or the frame's camera sees it elsewhere. For a camera
    /// that only `turns`, a point in the direction of the sighting is as good as any other there.
    pub(super) fn of(&self, frame: usize, seen: &Observation, turns: bool) -> Option<Point3> {
        let camera = self.camera(frame)?;
        let src = Point2::new(f64::from(seen.x), f64::from(seen.y));
        if turns {
            return direction(&camera, src);
        }
        let segment = self.cameras.segment_of(frame)? as u32;
        let place = *self.by_track.get(&(segment, seen.id))?;
        let miss = camera.intrinsics.project(&camera.pose.apply(&place))? - src;
        (miss.norm() <= self.wrong_px).then_some(place)
    }

    /// Whether coordinates of their own begin at a frame.
    fn starts_at(&self, frame: usize) -> bool {
        self.cameras.segment_of(frame).is_some_and(|k| self.cameras.shots[k].frames.start == frame)
    }

    /// The real camera of a frame.
    pub(super) fn camera(&self, frame: usize) -> Option<FrameCamera> {
        self.cameras.frames.get(frame).copied().flatten()
    }
}

/// Where a camera in the world's origin looks at a pixel: the point there at unit depth.
pub(super) fn direction(camera: &FrameCamera, pixel: Point2) -> Option<Point3> {
    let ray = camera.intrinsics.ray(pixel)?;
    Some(Point3::from(camera.pose.rotation.inverse() * ray))
}

/// Where a virtual camera is wanted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Wanted {
    /// `cam_from_world`; in the world's origin where it only turns.
    pub(super) pose: CameraPose,
    /// It stands where the real one stood.
    pub(super) turns: bool,
}

impl Wanted {
    fn show(&self, lens: &Intrinsics, place: &Point3) -> Option<Point2> {
        lens.project(&self.pose.apply(place))
    }
}

/// What virtual cameras make of the frames of a clip.
pub(super) struct Views {
    frames: Vec<Option<View>>,
}

/// One frame under its virtual camera.
struct View {
    wanted: Wanted,
    intrinsics: Intrinsics,
    /// `G_t`.
    shown_from_src: Similarity2,
    /// `P_t`, where the frame before has a view of the same points.
    step: Option<Similarity2>,
}

impl Views {
    /// The views of the cameras `wanted`, one per frame of a clip that is shown at `times_s`.
    pub(super) fn new(
        tracks: &Tracks,
        places: &Places<'_>,
        wanted: &[Option<Wanted>],
        times_s: &[f64],
    ) -> Result<Self, RunError> {
        let lives = Lives::of(tracks)?;
        let mut frames = Vec::with_capacity(wanted.len());
        let mut before: Option<(Wanted, Intrinsics)> = None;
        for (frame, wanted) in wanted.iter().enumerate() {
            let Some((wanted, camera)) = wanted.zip(places.camera(frame)) else {
                before = None;
                frames.push(None);
                continue;
            };
            if places.starts_at(frame) {
                before = None;
            }
            let seen = tracks.store.read(frame).map_err(store_error)?.observations;
            let intrinsics = camera.intrinsics;
            let (mut shown, mut moved) = (Fit::default(), Fit::default());
            for o in &seen {
                let Some(place) = places.of(frame, o, wanted.turns) else { continue };
                let Some(now) = wanted.show(&intrinsics, &place) else { continue };
                let weight = lives.weight(o.id, frame, times_s);
                shown.add(Point2::new(f64::from(o.x), f64::from(o.y)), now, weight);
                if let Some(then) = before.and_then(|(camera, lens)| camera.show(&lens, &place)) {
                    moved.add(then, now, weight);
                }
            }
            let step = moved.similarity();
            let view = |shown_from_src| View { wanted, intrinsics, shown_from_src, step };
            frames.push(shown.similarity().map(view));
            before = Some((wanted, intrinsics));
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

    /// `G_t` of the frames that have a view.
    pub(super) fn shown_from_src(&self) -> Vec<Option<Similarity2>> {
        self.frames.iter().map(|view| view.as_ref().map(|v| v.shown_from_src)).collect()
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

    /// Gives the path of one shot its virtual cameras, and the windows that follow from their corrections: under a slow zoom
    /// where those leave the frame and `smallest`, the least crop, forbids it.
    pub(super) fn show(
        &self,
        path: &mut VirtualPath,
        cameras: &[Option<VirtualCamera>],
        shot: &Range<usize>,
        clip: &Clip<'_>,
        smallest: Option<f64>,
    ) {
        let window = |t: usize| {
            let drawn = self.frames[t].as_ref().zip(cameras[t].as_ref());
            drawn.map_or_else(|| similarity_of(&path.out_from_src[t]), |(view, c)| c.correction * view.shown_from_src)
        };
        let windows: Vec<Similarity2> = shot.clone().map(window).collect();
        let size = (f64::from(clip.width), f64::from(clip.height));
        let zoom = smallest.map_or_else(
            || vec![1.0; windows.len()],
            |min_crop| {
                let room = windows.iter().map(|w| 1.0 / (w.scale() * min_crop)).fold(MOST_ZOOM, f64::min);
                covering_zoom(&windows, size, clip.period_s(shot), room.max(1.0))
            },
        );
        for ((t, window), zoom) in shot.clone().zip(windows).zip(zoom) {
            let center = Point2::new(size.0 / 2.0, size.1 / 2.0);
            let zoom = Similarity2::about(center, 0.0, zoom, Vec2::zeros());
            let zoomed = zoom * window;
            path.out_from_src[t] = zoomed.to_homography();
            path.crop[t] = 1.0 / zoomed.scale();
            path.cameras[t] = cameras[t].map(|c| VirtualCamera { correction: zoom * c.correction, ..c });
        }
    }

    /// The virtual cameras with what the planned path makes of their pictures.
    pub(super) fn cameras(&self, path: &VirtualPath) -> Vec<Option<VirtualCamera>> {
        let camera = |(view, out_from_src): (&Option<View>, &Homography)| {
            let view = view.as_ref()?;
            let correction = similarity_of(out_from_src) * view.shown_from_src.inverse()?;
            let Wanted { pose, turns } = view.wanted;
            Some(VirtualCamera { pose, intrinsics: view.intrinsics, correction, turns })
        };
        self.frames.iter().zip(&path.out_from_src).map(camera).collect()
    }
}

/// The virtual cameras of a clip with corrections that let the viewer's picture as a whole move on evenly.
///
/// The planned windows keep inside the frame by turning corners. A mesh that follows trajectories rounds them off
/// ([`crate::path::TrajectorySmoother`]); in space the same is done for all points together, by the similarity from what a
/// camera shows to what a [`SteadyView`] shows, so that each point stays where its depth puts it.
pub(super) fn steadied(
    cameras: &[Option<VirtualCamera>],
    tracks: &Tracks,
    places: &Places<'_>,
    times_s: &[f64],
) -> Result<Vec<Option<VirtualCamera>>, RunError> {
    let sigma_s = TrajectoryOptions::default().sigma_s;
    let mut steady = vec![None; cameras.len()];
    let segments = places.cameras.shots.iter().map(|s| &s.frames);
    for (segment, frame) in segments.flat_map(|segment| segment.clone().map(move |frame| (segment, frame))) {
        let Some(camera) = cameras[frame] else { continue };
        let Some(view) = SteadyView::new(cameras, times_s, segment, frame, sigma_s) else { continue };
        let mut fit = Fit::default();
        for o in &tracks.store.read(frame).map_err(store_error)?.observations {
            let Some(place) = places.of(frame, o, camera.turns) else { continue };
            if let Some((now, even)) = camera.show(&place).zip(view.show(&place)) {
                fit.add(now, even, 1.0);
            }
        }
        let correction = fit.robust_similarity().map_or(camera.correction, |even| even * camera.correction);
        steady[frame] = Some(VirtualCamera { correction, ..camera });
    }
    Ok(steady)
}

/// Pairs of points that a similarity is fitted to.
#[derive(Default)]
struct Fit {
    pairs: Vec<Pair>,
    weights: Vec<f64>,
}

impl Fit {
    fn add(&mut self, previous: Point2, this: Point2, weight: f64) {
        self.pairs.push(Pair { previous, this });
        self.weights.push(weight);
    }

    fn similarity(&self) -> Option<Similarity2> {
        (self.pairs.len() >= LEAST_SIGHTINGS).then(|| motion::similarity(&self.pairs, &self.weights)).flatten()
    }

    /// The similarity of most points: near ones, which move most and on courses of their own, count less.
    fn robust_similarity(mut self) -> Option<Similarity2> {
        let mut found = self.similarity()?;
        for _ in 0..ROUNDS {
            let misses: Vec<f64> =
                self.pairs.iter().map(|p| (found.apply(p.previous) - p.this).norm_squared()).collect();
            let mut sorted = misses.clone();
            let middle = sorted.len() / 2;
            let scale = *sorted.select_nth_unstable_by(middle, f64::total_cmp).1 + f64::MIN_POSITIVE;
            self.weights = misses.iter().map(|m| 1.0 / (1.0 + m / scale)).collect();
            found = self.similarity()?;
        }
        Some(found)
    }
}

/// First and last frame of every track.
struct Lives(HashMap<u32, (usize, usize)>);

impl Lives {
    fn of(tracks: &Tracks) -> Result<Self, RunError> {
        let mut lives = HashMap::new();
        for frame in 0..tracks.store.frames() {
            for o in tracks.store.read(frame).map_err(store_error)?.observations {
                lives.entry(o.id).or_insert((frame, frame)).1 = frame;
            }
        }
        Ok(Self(lives))
    }

    /// How much a track counts at a frame, in (0, 1]: little where it is born and where it dies. Points that came and went
    /// with their full weight, near ones above all, would make a fit to them jump.
    fn weight(&self, id: u32, frame: usize, times_s: &[f64]) -> f64 {
        let Some(&(first, last)) = self.0.get(&id) else { return LEAST_FADE };
        let ramp = |from: usize, to: usize| ((times_s[to] - times_s[from]) / FADE_S).clamp(LEAST_FADE, 1.0);
        ramp(first, frame) * ramp(frame, last)
    }
}

/// The map of a planned path, which is a similarity, as one.
fn similarity_of(h: &Homography) -> Similarity2 {
    let m = h.matrix();
    Similarity2 { a: m[(0, 0)], b: m[(1, 0)], t: Vec2::new(m[(0, 2)], m[(1, 2)]) }
}
