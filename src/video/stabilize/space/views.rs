//! The motion of the views of virtual cameras, input of the planner, and the windows that it returns.

use std::ops::Range;

use super::fit::{Fit, TrackSpans};
use super::scene_points::ScenePoints;
use crate::path::{Clip, InterFrame, VirtualCamera, VirtualPath};
use crate::stabilize::crop_correction::covering_zoom;
use crate::stabilize::error::StabilizeError;
use crate::stabilize::tracks::Tracks;
use plumbline_camera::{CameraPose, Intrinsics, Point3};
use plumbline_num::math::{Homography, Point2, Similarity2, Vec2};
use plumbline_num::run::Run;

/// Greatest zoom for steadied windows: within one percent, the default margin of the mesh, the mesh need not bend the border.
const MAX_ZOOM: f64 = 1.01;

/// The pose of a virtual camera, before the planner chooses its window.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::stabilize) struct TargetPose {
    /// `cam_from_world`; in the world's origin where it only rotates.
    pub(in crate::stabilize) pose: CameraPose,
    /// It only rotates: its position is that of the real camera.
    pub(in crate::stabilize) rotation_only: bool,
}

impl TargetPose {
    fn show(&self, lens: &Intrinsics, point: &Point3) -> Option<Point2> {
        lens.project(&self.pose.apply(point))
    }
}

/// The frames of a clip under their virtual cameras.
pub(in crate::stabilize) struct Views {
    frames: Vec<Option<View>>,
}

/// One frame under its virtual camera.
struct View {
    target: TargetPose,
    intrinsics: Intrinsics,
    /// `G_t`.
    shown_from_src: Similarity2,
    /// `P_t`, where the frame before has a view of the same points.
    step: Option<Similarity2>,
}

impl Views {
    /// The views of the cameras at `targets`, one per frame of a clip that is shown at `times_s`.
    pub(in crate::stabilize) fn new(
        tracks: &Tracks,
        scene: &ScenePoints<'_>,
        targets: &[Option<TargetPose>],
        times_s: &[f64],
        run: &Run,
    ) -> Result<Self, StabilizeError> {
        let spans = TrackSpans::of(tracks)?;
        let mut frames = Vec::with_capacity(targets.len());
        let mut before: Option<(TargetPose, Intrinsics)> = None;
        for (frame, target) in targets.iter().enumerate() {
            run.check()?;
            let Some((target, camera)) = target.zip(scene.camera(frame)) else {
                before = None;
                frames.push(None);
                continue;
            };
            if scene.starts_at(frame) {
                before = None;
            }
            let seen = tracks.store.read(frame)?.observations;
            let intrinsics = camera.intrinsics;
            let (mut shown, mut moved) = (Fit::default(), Fit::default());
            for o in &seen {
                let Some(point) = scene.of(frame, o, target.rotation_only) else { continue };
                let Some(now) = target.show(&intrinsics, &point) else { continue };
                let weight = spans.weight(o.id, frame, times_s);
                shown.add(Point2::new(f64::from(o.x), f64::from(o.y)), now, weight);
                if let Some(then) = before.and_then(|(camera, lens)| camera.show(&lens, &point)) {
                    moved.add(then, now, weight);
                }
            }
            let step = moved.similarity();
            let view = |shown_from_src| View { target, intrinsics, shown_from_src, step };
            frames.push(shown.similarity().map(view));
            before = Some((target, intrinsics));
        }
        Ok(Self { frames })
    }

    /// Number of frames with a view.
    pub(in crate::stabilize) fn known(&self) -> usize {
        self.frames.iter().flatten().count()
    }

    /// Replaces the measured motion by `F_t` wherever it is known.
    pub(in crate::stabilize) fn retarget(&self, steps: &mut [InterFrame]) {
        for (t, pair) in self.frames.windows(2).enumerate() {
            let [Some(before), Some(now)] = pair else { continue };
            if let Some((step, back)) = now.step.zip(now.shown_from_src.inverse()) {
                let similarity = back * step * before.shown_from_src;
                steps[t + 1] = InterFrame { similarity, homography: similarity.to_homography(), reliable: true };
            }
        }
    }

    /// `G_t` of the frames that have a view.
    pub(in crate::stabilize) fn shown_from_src(&self) -> Vec<Option<Similarity2>> {
        self.frames.iter().map(|view| view.as_ref().map(|v| v.shown_from_src)).collect()
    }

    /// `G_t` of every frame; where there is none, that of the frame before, or of the first that has one.
    pub(in crate::stabilize) fn out_from_src(&self) -> Vec<Similarity2> {
        let mut last = self.frames.iter().flatten().next().map_or(Similarity2::IDENTITY, |v| v.shown_from_src);
        let extended = self.frames.iter().map(|view| {
            last = view.as_ref().map_or(last, |v| v.shown_from_src);
            last
        });
        extended.collect()
    }

    /// Gives the path of one shot its virtual cameras, and the windows that follow from their corrections: under a slow zoom
    /// where those leave the frame and what its neighbors show beside it and `min_crop` is given, so that no border may show.
    pub(in crate::stabilize) fn show(
        &self,
        path: &mut VirtualPath,
        cameras: &[Option<VirtualCamera>],
        shot: &Range<usize>,
        clip: &Clip<'_>,
        min_crop: Option<f64>,
    ) {
        let window = |t: usize| {
            let shown = self.frames[t].as_ref().zip(cameras[t].as_ref());
            shown.map_or_else(|| similarity_of(&path.out_from_src[t]), |(view, c)| c.correction * view.shown_from_src)
        };
        let windows: Vec<Similarity2> = shot.clone().map(window).collect();
        let size = (f64::from(clip.width), f64::from(clip.height));
        let zoom = min_crop.map_or_else(
            || vec![1.0; windows.len()],
            |min_crop| {
                let room = windows.iter().map(|w| 1.0 / (w.scale() * min_crop)).fold(MAX_ZOOM, f64::min);
                covering_zoom(
                    &windows,
                    clip.beyond.get(shot.clone()).unwrap_or(&[]),
                    size,
                    clip.period_s(shot),
                    room.max(1.0),
                )
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

    /// The virtual cameras with the corrections by which the planned path shows their pictures.
    pub(in crate::stabilize) fn cameras(&self, path: &VirtualPath) -> Vec<Option<VirtualCamera>> {
        let camera = |(view, out_from_src): (&Option<View>, &Homography)| {
            let view = view.as_ref()?;
            let correction = similarity_of(out_from_src) * view.shown_from_src.inverse()?;
            let TargetPose { pose, rotation_only } = view.target;
            Some(VirtualCamera { pose, intrinsics: view.intrinsics, correction, rotation_only })
        };
        self.frames.iter().zip(&path.out_from_src).map(camera).collect()
    }
}

/// The map of a planned path, which is a similarity, as one.
fn similarity_of(h: &Homography) -> Similarity2 {
    let m = h.matrix();
    Similarity2 { a: m[(0, 0)], b: m[(1, 0)], t: Vec2::new(m[(0, 2)], m[(1, 2)]) }
}
