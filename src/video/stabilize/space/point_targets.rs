//! Targets of a frame's points under a virtual camera.
//!
//! The recovered real camera of a frame projects the point `X_k` of a track to `e_k`; the track was observed at `s_k`. The
//! residual has two parts: the error of the camera, common to neighbors, and the noise of the track. With `A` the homography
//! fitted to all pairs `e_k → s_k`, the virtual camera that projects the points to `q_k` moves the pixel at `s_k` by
//! `q_k − A(e_k)`, which is free of the noise, so that the mesh may follow it closely:
//!
//! ```text
//! s_k  goes to  q_k + (s_k − A(e_k))
//! ```
//!
//! This is for given paths, which are followed exactly. A smoothed path is better with `q_k` itself: part of the apparent noise is
//! distortion of the frame (by a rolling shutter, for example), which should be removed (wobble on nus-regular-1 .79 with `q_k`,
//! .91 without that part).

use super::scene_points::ScenePoints;
use crate::motion::{self, FrameScale, Pair};
use crate::path::VirtualCamera;
use crate::track::Observation;
use plumbline_num::math::{Homography, Point2, Vec2};

/// Weight of keeping `A` a similarity, per observation: as for the homography of the anchors.
const HOMOGRAPHY_PRIOR: f64 = 0.01;

/// Least number of points for `A`; with fewer the observations are used directly, since a homography through a few points absorbs
/// their noise.
const MIN_POINTS: usize = 20;

/// Output position, px, of each observation of a frame in `camera`, where its point is known. `center_time` maps an observation
/// to the frame's own time.
pub(in crate::stabilize) fn point_targets(
    scene: &ScenePoints<'_>,
    frame: usize,
    camera: &VirtualCamera,
    observations: &[Observation],
    center_time: impl Fn(Point2) -> Point2,
) -> Vec<Option<Point2>> {
    let point = |o: &Observation| scene.of(frame, o, camera.rotation_only);
    let found: Vec<_> = observations.iter().map(point).collect();
    let mut targets: Vec<_> = found.iter().map(|point| camera.show(point.as_ref()?)).collect();
    let Some(real) = scene.camera(frame).filter(|_| !camera.rotation_only) else { return targets };
    let predicted = |k: usize| real.intrinsics.project(&real.pose.apply(found[k].as_ref()?));
    let seen = |k: usize| center_time(Point2::new(f64::from(observations[k].x), f64::from(observations[k].y)));
    let pair = |k: usize| Some((k, Pair { previous: predicted(k)?, this: seen(k) }));
    let pairs: Vec<_> = (0..observations.len()).filter_map(pair).collect();
    let noise = noise_of(&pairs.iter().map(|&(_, pair)| pair).collect::<Vec<_>>(), &scene.scale());
    for ((k, _), noise) in pairs.iter().zip(noise) {
        targets[*k] = targets[*k].map(|shown| shown + noise);
    }
    targets
}

/// `s_k − A(e_k)`.
fn noise_of(pairs: &[Pair], scale: &FrameScale) -> Vec<Vec2> {
    let weights = vec![1.0; pairs.len()];
    let prior = HOMOGRAPHY_PRIOR * pairs.len() as f64;
    let fit = || motion::homography(pairs, &weights, &Homography::identity(), prior, scale, 2);
    let Some(shared) = (pairs.len() >= MIN_POINTS).then(fit).flatten() else {
        return vec![Vec2::zeros(); pairs.len()];
    };
    pairs.iter().map(|p| shared.apply(p.previous).map_or_else(Vec2::zeros, |a| p.this - a)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Pairs on a lattice, each moved by a map that all share and by a vector of its own.
    fn pairs(shared: impl Fn(Point2) -> Point2, own: impl Fn(usize) -> Vec2) -> Vec<Pair> {
        let at = |k: usize| Point2::new(40.0 * (k % 15) as f64 + 20.0, 40.0 * (k / 15) as f64 + 20.0);
        (0..120).map(|k| Pair { previous: at(k), this: shared(at(k)) + own(k) }).collect()
    }

    #[test]
    fn camera_errors_are_kept_and_track_noise_is_removed() {
        let drift = |p: Point2| Point2::new(p.x * 1.001 + 0.3, p.y * 1.001 - 0.2);
        let own = |k: usize| {
            Vec2::new(if k.is_multiple_of(2) { 0.1 } else { -0.1 }, if k.is_multiple_of(3) { 0.1 } else { -0.05 })
        };
        for (k, noise) in noise_of(&pairs(drift, own), &FrameScale::new(640, 360)).iter().enumerate() {
            assert!((noise - own(k)).norm() < 0.03, "{k}: {noise} for {}", own(k));
        }
    }

    #[test]
    fn few_points_are_used_as_observed() {
        let few = &pairs(|p| p, |_| Vec2::new(0.5, 0.5))[..MIN_POINTS - 1];
        assert!(noise_of(few, &FrameScale::new(640, 360)).iter().all(|n| *n == Vec2::zeros()));
    }
}
