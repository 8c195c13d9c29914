//! Merging of two overlapping segments.
//!
//! The cameras `B_i` of the shared frames, and the points common to both, are aligned with the `A_i` by a similarity
//! `S`:
//! ```text
//! R = argmin Σ ‖A_iᵀ B_i − R‖²,     s = median z_A(X) / z_B(X),     t = mean (c_A − s R c_B)
//! ```
//!
//! The scale comes from depths `z` of common points, not from the baseline of the cameras: over a short overlap of a
//! slow walk the baseline is short, but the depths are as large as ever. Over the inner half of the shared frames the
//! cameras are interpolated from `A_i` to `S B_i`, so that the joined path has no jump.

use std::ops::Range;

use super::mapper::{MIN_INLIERS, WRONG_PX};
use super::{Segment, SfmFigures, SfmVerdict};
use crate::motion::FrameCamera;
use plumbline_camera::{CameraPose, Intrinsics, Point3, Similarity3, Vec3, align};

/// Minimum number of frames with a camera in both segments: their mean rotation is three times as accurate as one (√10).
const MIN_SHARED: usize = 10;
/// Fraction of the shared frames at either end in which the weight of one segment is 1: cameras at the ends of a
/// window are the least accurate.
const SOLO_FRACTION: f64 = 0.25;

/// Alignment of two segments.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Fit {
    /// From the world of the second to the world of the first.
    pub(super) similarity: Similarity3,
    /// Root mean square difference of the shared cameras, px: rotations, and translations at the median depth.
    pub(super) residual_px: f64,
}

/// Aligns `second` with `first`; `None` if they share too little or have different verdicts.
pub(super) fn fit(first: &Segment, second: &Segment) -> Option<Fit> {
    if first.verdict != second.verdict || !first.verdict.has_cameras() {
        return None;
    }
    let shared: Vec<(FrameCamera, FrameCamera)> =
        overlap(first, second).filter_map(|f| Some((first.camera(f)?, second.camera(f)?))).collect();
    let pairs: Vec<(CameraPose, CameraPose)> = shared.iter().map(|(a, b)| (b.pose, a.pose)).collect();
    if pairs.len() < MIN_SHARED {
        return None;
    }
    let (mut similarity, _) = align(&pairs)?;
    let mut depth = f64::INFINITY;
    if first.verdict == SfmVerdict::RotationOnly {
        similarity = Similarity3 { scale: 1.0, translation: Vec3::zeros(), ..similarity };
    } else {
        (similarity.scale, depth) = scale_and_depth(&common_points(first, second), &pairs)?;
        let offset = |(b, a): &(CameraPose, CameraPose)| {
            a.center().coords - similarity.scale * (similarity.rotation * b.center().coords)
        };
        similarity.translation = pairs.iter().map(offset).sum::<Vec3>() / pairs.len() as f64;
    }
    let focal = shared[0].0.intrinsics.focal;
    let apart = |(b, a): &(CameraPose, CameraPose)| {
        let moved = similarity.camera(b);
        let rotation = moved.rotation.angle_to(&a.rotation);
        let shift = (moved.center() - a.center()).norm() / depth;
        (focal * rotation).powi(2) + (focal * shift).powi(2)
    };
    let residual_px = (pairs.iter().map(apart).sum::<f64>() / pairs.len() as f64).sqrt();
    residual_px.is_finite().then_some(Fit { similarity, residual_px })
}

/// Frames in both segments.
pub(super) fn overlap(first: &Segment, second: &Segment) -> Range<usize> {
    first.frames.start.max(second.frames.start)..first.frames.end.min(second.frames.end)
}

/// Positions, in the second and the first world, of the points known to both.
fn common_points(first: &Segment, second: &Segment) -> Vec<(Point3, Point3)> {
    let in_first = |id: u32| first.points.binary_search_by_key(&id, |p| p.0).ok().map(|k| first.points[k].1);
    second.points.iter().filter_map(|(id, position)| Some((*position, in_first(*id)?))).collect()
}

/// The median ratio of depths, and the median depth in the first world, at the middle one of the shared cameras.
fn scale_and_depth(points: &[(Point3, Point3)], pairs: &[(CameraPose, CameraPose)]) -> Option<(f64, f64)> {
    let (second, first) = pairs[pairs.len() / 2];
    let depths =
        points.iter().map(|(b, a)| (second.apply(b).z, first.apply(a).z)).filter(|(b, a)| *b > 0.0 && *a > 0.0);
    let mut ratios: Vec<(f64, f64)> = depths.map(|(b, a)| (a / b, a)).collect();
    if ratios.len() < MIN_INLIERS {
        return None;
    }
    let middle = ratios.len() / 2;
    let scale = ratios.select_nth_unstable_by(middle, |x, y| x.0.total_cmp(&y.0)).1.0;
    Some((scale, ratios.select_nth_unstable_by(middle, |x, y| x.1.total_cmp(&y.1)).1.1))
}

/// Whether the difference is too small to be visible in a picture `unit_px` times 640 px across.
pub(super) fn is_seamless(fit: &Fit, unit_px: f64) -> bool {
    fit.residual_px <= WRONG_PX * unit_px
}

/// Merges two aligned segments.
pub(super) fn joined(first: &Segment, second: &Segment, fit: &Fit) -> Segment {
    let shared = overlap(first, second);
    let frames = first.frames.start..second.frames.end.max(first.frames.end);
    let moved = |c: FrameCamera| FrameCamera { pose: fit.similarity.camera(&c.pose), ..c };
    let camera = |f: usize| match (first.camera(f), second.camera(f).map(moved)) {
        (Some(a), Some(b)) => Some(between(&a, &b, blend_weight(f, &shared))),
        (a, b) => a.or(b),
    };
    let cameras: Vec<Option<FrameCamera>> = frames.clone().map(camera).collect();
    let points = united(&first.points, &second.points, &fit.similarity);
    let mut figures = pooled(&first.figures, &second.figures, shared.len());
    figures.points = points.len();
    let reason = format!("{}; parts joined to {:.2} px", first.reason, fit.residual_px);
    let mut segment = Segment { frames, cameras, points, verdict: first.verdict, reason, figures };
    segment.count();
    segment
}

/// Blend weight of the second camera: 0 for the first camera alone, 1 for the second alone.
fn blend_weight(frame: usize, shared: &Range<usize>) -> f64 {
    let along = (frame as f64 + 0.5 - shared.start as f64) / shared.len() as f64;
    let inner = ((along - SOLO_FRACTION) / (1.0 - 2.0 * SOLO_FRACTION)).clamp(0.0, 1.0);
    inner * inner * (3.0 - 2.0 * inner)
}

fn between(a: &FrameCamera, b: &FrameCamera, weight: f64) -> FrameCamera {
    let mix = |x: f64, y: f64| x + (y - x) * weight;
    let (p, q) = (a.intrinsics, b.intrinsics);
    let intrinsics = Intrinsics { focal: mix(p.focal, q.focal), k1: mix(p.k1, q.k1), ..p };
    FrameCamera { pose: a.pose.toward(&b.pose, weight), intrinsics }
}

/// The points of both, by track; the midpoint for points known to both.
fn united(first: &[(u32, Point3)], second: &[(u32, Point3)], similarity: &Similarity3) -> Vec<(u32, Point3)> {
    let mut all: Vec<(u32, Point3)> = first.to_vec();
    all.extend(second.iter().map(|(id, position)| (*id, similarity.apply(position))));
    all.sort_by_key(|p| p.0);
    all.dedup_by(|b, a| {
        let same = a.0 == b.0;
        if same {
            a.1 = nalgebra::center(&a.1, &b.1);
        }
        same
    });
    all
}

/// Figures of the merged segment from those of its parts, which have `shared` frames in common.
fn pooled(a: &SfmFigures, b: &SfmFigures, shared: usize) -> SfmFigures {
    let own = 1.0 - shared as f64 / b.frames.max(1) as f64;
    let (n, m) = (a.observations as f64, own * b.observations as f64);
    let mean = |x: f64, y: f64, n: f64, m: f64| if n + m > 0.0 { (n * x + m * y) / (n + m) } else { 0.0 };
    let rms = |x: f64, y: f64, n: f64, m: f64| mean(x * x, y * y, n, m).sqrt();
    let (k, l) = (a.predicted as f64, b.predicted as f64);
    SfmFigures {
        registered: a.registered + b.registered,
        frames: a.frames + b.frames - shared,
        points: a.points + b.points,
        observations: (n + m).round() as usize,
        reprojection_px: mean(a.reprojection_px, b.reprojection_px, n, m),
        rms_px: rms(a.rms_px, b.rms_px, n, m),
        angle: mean(a.angle, b.angle, n, m),
        coverage: mean(a.coverage, b.coverage, n, m),
        focal: mean(a.focal, b.focal, n, m),
        sigma_ln_focal: a.sigma_ln_focal.zip(b.sigma_ln_focal).map(|(x, y)| x.max(y)),
        predicted: a.predicted + b.predicted,
        predicted_px: rms(a.predicted_px, b.predicted_px, k, l),
        homography_px: rms(a.homography_px, b.homography_px, k, l),
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::UnitQuaternion;

    use super::*;
    use crate::motion::sfm::tests::synthetic::{Course, Shot, ShotOptions};

    /// A part of a synthetic walk, in a world transformed by a similarity.
    fn part(frames: Range<usize>, world: &Similarity3) -> Segment {
        let shot = Shot::new(&ShotOptions { seed: 3, frames: 60, course: Course::Walk, ..ShotOptions::default() });
        let scene = &shot.truth;
        let camera = |f: usize| {
            let pose = world.camera(&scene.poses[f].expect("true"));
            Some(FrameCamera { pose, intrinsics: scene.intrinsics })
        };
        let place = |(id, p): (usize, &Option<crate::motion::sfm::ScenePoint>)| {
            let p = p.expect("true");
            let place = p.in_world(&scene.poses[p.anchor as usize].expect("true")).expect("in front");
            (id as u32, world.apply(&place))
        };
        let figures = SfmFigures { frames: frames.len(), registered: frames.len(), ..SfmFigures::default() };
        Segment {
            cameras: frames.clone().map(camera).collect(),
            frames,
            points: scene.points.iter().enumerate().map(place).collect(),
            verdict: SfmVerdict::ThreeD,
            reason: "true".to_owned(),
            figures,
        }
    }

    fn here() -> Similarity3 {
        Similarity3 { scale: 1.0, rotation: UnitQuaternion::identity(), translation: Vec3::zeros() }
    }

    fn elsewhere() -> Similarity3 {
        let rotation = UnitQuaternion::from_scaled_axis(Vec3::new(0.4, -1.1, 0.2));
        Similarity3 { scale: 0.4, rotation, translation: Vec3::new(1.0, -3.0, 0.5) }
    }

    #[test]
    fn parts_of_one_walk_in_different_worlds_become_the_walk() {
        let (first, second, whole) = (part(0..40, &here()), part(20..60, &elsewhere()), part(0..60, &here()));
        let fit = fit(&first, &second).expect("twenty frames are shared");
        assert!(fit.residual_px < 1e-8 && is_seamless(&fit, 1.0), "{fit:?}");
        let joined = joined(&first, &second, &fit);
        assert_eq!((joined.frames.clone(), joined.figures.registered, joined.figures.frames), (0..60, 60, 60));
        for (a, b) in joined.cameras.iter().flatten().zip(whole.cameras.iter().flatten()) {
            assert!(
                (a.pose.center() - b.pose.center()).norm() < 1e-9 && a.pose.rotation.angle_to(&b.pose.rotation) < 1e-9
            );
        }
        for (a, b) in joined.points.iter().zip(&whole.points) {
            assert!(a.0 == b.0 && (a.1 - b.1).norm() < 1e-8 * b.1.coords.norm());
        }
    }

    #[test]
    fn a_difference_is_spread_over_the_shared_frames() {
        let (first, mut second) = (part(0..40, &here()), part(20..60, &here()));
        // Half of the shared frames of the second one are rotated, so that no similarity explains them.
        let turn = UnitQuaternion::from_scaled_axis(Vec3::new(0.0, 2e-3, 0.0));
        for camera in second.cameras.iter_mut().skip(10).flatten() {
            camera.pose = CameraPose::looking_from(camera.pose.center(), turn * camera.pose.rotation);
        }
        let fit = fit(&first, &second).expect("twenty frames are shared");
        assert!((0.3..2.0).contains(&fit.residual_px), "{fit:?}");
        let joined = joined(&first, &second, &fit);
        let off = |f: usize, segment: &Segment, world: &Similarity3| {
            let expected = world.camera(&segment.camera(f).expect("known").pose);
            joined.camera(f).expect("known").pose.rotation.angle_to(&expected.rotation)
        };
        assert!(off(20, &first, &here()) < 1e-12 && off(39, &second, &fit.similarity) < 1e-12);
        assert!(off(30, &first, &here()) > 1e-5 && off(30, &second, &fit.similarity) > 1e-5);
    }

    #[test]
    fn too_little_in_common_or_different_kinds_are_no_fit() {
        let (first, second) = (part(0..40, &here()), part(31..60, &elsewhere()));
        assert!(fit(&first, &second).is_none(), "nine frames");
        let turning = Segment { verdict: SfmVerdict::RotationOnly, ..part(20..60, &here()) };
        assert!(fit(&first, &turning).is_none());
        let bare = Segment { points: Vec::new(), ..part(20..60, &here()) };
        assert!(fit(&first, &bare).is_none());
    }

    #[test]
    fn cameras_at_different_positions_are_not_blended() {
        let (first, mut second) = (part(0..40, &here()), part(20..60, &here()));
        for (k, camera) in second.cameras.iter_mut().enumerate() {
            let pose = &mut camera.as_mut().expect("known").pose;
            pose.translation += Vec3::new(0.1 * (k as f64).sin(), 0.0, 0.0);
        }
        assert!(!is_seamless(&fit(&first, &second).expect("twenty frames are shared"), 1.0));
    }
}
