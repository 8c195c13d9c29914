//! Keyframe selection: frames with sufficient parallax between them.
//!
//! Rotation moves every point independently of its depth, so it is removed first: the rotation `R` minimizes the
//! robust `Σ ρ(∠(R m₁, m₂))` between the rays of a pair; the remaining displacement in the image is *parallax*. A new
//! keyframe starts when the median parallax exceeds 1.5 % of the width, when too few points of the last keyframe
//! survive, or after 20 frames.

use nalgebra::{Matrix3, Rotation3};

use super::mapper::MIN_INLIERS;
use super::{Match, TrackTable};
use plumbline_camera::rotation::nearest_rotation;
use plumbline_camera::{Intrinsics, Vec3};
use plumbline_num::math::median;

/// Median parallax, as a fraction of the image width, that starts a new keyframe: 10 px at 640 px across, by which the depth
/// of a point observed to 0.5 px in both views is known to 7 %.
const MIN_PARALLAX: f64 = 0.015;
/// Fraction of surviving points of the last keyframe below which a new keyframe starts: of a thousand points 78 survive five
/// keyframes, enough for a pair.
const MIN_SURVIVORS: f64 = 0.6;
/// Maximum number of frames between keyframes: a window of 600 frames has at least 30, whatever the motion.
const MAX_GAP: usize = 20;
/// Iterations of reweighting: four suffice to reject a mover with a third of the points.
const ITERATIONS: usize = 6;

/// Indices of the keyframes of a shot, ascending; the first and the last usable frame are among them.
pub(super) fn keyframes(table: &TrackTable, camera: &Intrinsics) -> Vec<usize> {
    let usable = |f: &usize| table.in_frame(*f).len() >= MIN_INLIERS;
    let Some(first) = (0..table.frames()).find(usable) else { return Vec::new() };
    let mut keys = vec![first];
    let mut last_usable = first;
    for frame in (first + 1..table.frames()).filter(usable) {
        let key = keys[keys.len() - 1];
        let shared = table.shared(key, frame);
        let alive = shared.len() as f64 / table.in_frame(key).len() as f64;
        // At an abrupt loss of points the previous frame is the last one with points from both sides.
        if alive < 0.5 * MIN_SURVIVORS && last_usable > key {
            keys.push(last_usable);
        }
        if alive < MIN_SURVIVORS
            || frame - key >= MAX_GAP
            || parallax(&shared, camera) > MIN_PARALLAX * f64::from(table.width)
        {
            keys.push(frame);
        }
        last_usable = frame;
    }
    if keys[keys.len() - 1] != last_usable {
        keys.push(last_usable);
    }
    keys
}

/// Median displacement, px, after removal of the camera rotation.
pub(super) fn parallax(matches: &[Match], camera: &Intrinsics) -> f64 {
    let rays: Vec<(Vec3, Vec3)> = matches
        .iter()
        .filter_map(|m| Some((camera.ray(m.first)?.normalize(), camera.ray(m.second)?.normalize())))
        .collect();
    let rotation = rotation_between(&rays);
    let mut apart: Vec<f64> = rays.iter().map(|(a, b)| camera.focal * (rotation * a - b).norm()).collect();
    median(&mut apart).unwrap_or(0.0)
}

/// The rotation from the first to the second ray of each pair, by Geman–McClure reweighting at the scale of the
/// median.
pub(super) fn rotation_between(rays: &[(Vec3, Vec3)]) -> Rotation3<f64> {
    let mut weights = vec![1.0; rays.len()];
    let mut rotation = Rotation3::identity();
    let mut squared = vec![0.0; rays.len()];
    for _ in 0..ITERATIONS {
        let moment: Matrix3<f64> = rays.iter().zip(&weights).map(|((a, b), w)| *w * b * a.transpose()).sum();
        rotation = nearest_rotation(&moment).unwrap_or(rotation);
        for (s, (a, b)) in squared.iter_mut().zip(rays) {
            *s = (rotation * a - b).norm_squared();
        }
        let scale = median(&mut squared.clone()).unwrap_or(0.0).max(1e-12);
        for (w, s) in weights.iter_mut().zip(&squared) {
            *w = (scale / (scale + s)).powi(2);
        }
    }
    rotation
}

#[cfg(test)]
mod tests {
    use super::*;
    use plumbline_num::math::Point2;

    fn camera() -> Intrinsics {
        Intrinsics::centered(576.0, 640, 360)
    }

    /// Points at depth 4 to 8 seen by a camera at `x` with rotation `yaw`; every third point moves independently.
    fn view(x: f64, yaw: f64, movers: bool) -> Vec<(u32, Point2)> {
        let turn = Rotation3::new(Vec3::new(0.0, yaw, 0.0));
        let mut random = fastrand::Rng::with_seed(3);
        (0..300)
            .filter_map(|id| {
                let place = Vec3::new(8.0 * random.f64() - 4.0, 4.0 * random.f64() - 2.0, 4.0 + 4.0 * random.f64());
                let own = if movers && id % 3 == 0 { Vec3::new(0.0, 3.0 * x + 2.0 * yaw, 0.0) } else { Vec3::zeros() };
                let seen = turn * (place + own - Vec3::new(x, 0.0, 0.0));
                camera().project(&seen.into()).map(|p| (id, p))
            })
            .filter(|(_, p)| (0.0..640.0).contains(&p.x) && (0.0..360.0).contains(&p.y))
            .collect()
    }

    #[test]
    fn a_rotation_has_no_parallax_despite_moving_points_and_a_translation_has() {
        let table =
            TrackTable::new(640, 360, [(0.0, 0.0), (0.0, 0.1), (0.0, 0.1), (0.2, 0.1)].map(|(x, a)| view(x, a, true)));
        assert!(parallax(&table.shared(0, 1), &camera()) < 0.01);
        assert!(parallax(&table.shared(0, 3), &camera()) > 2.0);
    }

    #[test]
    fn keyframes_come_with_parallax_and_not_with_rotation() {
        let walk = TrackTable::new(640, 360, (0..15).map(|t| view(0.3 * f64::from(t), 0.0, false)));
        let turn = TrackTable::new(640, 360, (0..15).map(|t| view(0.0, 0.004 * f64::from(t), false)));
        assert!(keyframes(&walk, &camera()).len() >= 4, "{:?}", keyframes(&walk, &camera()));
        assert_eq!(keyframes(&turn, &camera()), [0, 14]);
    }

    #[test]
    fn a_shot_without_points_has_no_keyframes() {
        assert!(keyframes(&TrackTable::new(640, 360, vec![Vec::new(); 5]), &camera()).is_empty());
    }
}
