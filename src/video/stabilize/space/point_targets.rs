//! Where a virtual camera shows the points that a frame saw.
//!
//! The real camera of a frame, as it was recovered, should see the point `X_k` of a track at `e_k`; the track was seen at `s_k`.
//! The difference has two parts: the error of this camera, which neighbors share, and the error of this track, which is noise. With
//! `A` the homography through all pairs `e_k → s_k`, the virtual camera that shows the points at `q_k` moves the pixel at `s_k`
//! by `q_k − A(e_k)`, which is free of the noise, so that the mesh may follow it closely:
//!
//! ```text
//! s_k  goes to  q_k + (s_k − A(e_k))
//! ```
//!
//! This is for paths that were given, which are to be shown as they are. A smoothed path is better off with `q_k` itself: part of
//! the apparent noise is how the frame itself was distorted (by a rolling shutter, say), and should go (wobble on nus-regular-1
//! .79 with `q_k`, .91 without that part).

use super::scene_points::ScenePoints;
use crate::motion::{self, FrameScale, Pair};
use crate::path::VirtualCamera;
use crate::track::Observation;
use plumbline_num::math::{Homography, Point2, Vec2};

/// Weight of keeping `A` a similarity, per observation: as for the homography of the anchors.
const HOMOGRAPHY_PRIOR: f64 = 0.01;

/// Points that `A` is fitted to, at least; fewer are taken as they were seen: a homography through a handful absorbs their noise.
const MIN_POINTS: usize = 20;

/// Where `camera` shows each observation of a frame, output px, where that is known. `center_time` carries an observation to the
/// frame's own time.
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
    fn the_error_of_the_camera_stays_and_the_noise_of_a_track_goes() {
        let drift = |p: Point2| Point2::new(p.x * 1.001 + 0.3, p.y * 1.001 - 0.2);
        let own = |k: usize| {
            Vec2::new(if k.is_multiple_of(2) { 0.1 } else { -0.1 }, if k.is_multiple_of(3) { 0.1 } else { -0.05 })
        };
        for (k, noise) in noise_of(&pairs(drift, own), &FrameScale::new(640, 360)).iter().enumerate() {
            assert!((noise - own(k)).norm() < 0.03, "{k}: {noise} for {}", own(k));
        }
    }

    #[test]
    fn a_handful_of_points_is_taken_as_it_was_seen() {
        let few = &pairs(|p| p, |_| Vec2::new(0.5, 0.5))[..MIN_POINTS - 1];
        assert!(noise_of(few, &FrameScale::new(640, 360)).iter().all(|n| *n == Vec2::zeros()));
    }
}
