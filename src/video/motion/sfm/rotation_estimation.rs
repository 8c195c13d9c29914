//! Rotation estimation for a shot without parallax: camera rotations, and points at infinity.
//!
//! Between keyframes `i`, `j` the rays `m = K⁻¹ x` of a rotating camera satisfy `m_j ∝ R_ij m_i`. The focal length is
//! estimated from the pairs with the largest rotations ([`super::fit_conjugate_rotation`]). The relative rotations of
//! all pairs at that focal length are averaged ([`super::average_rotations`]), which rejects pairs misled by a moving
//! object. The rotation of every other frame is estimated relative to the keyframe before it. The final adjustment
//! optimizes rotations, rays and lens, without translations: the remaining motion in the image is noise, and
//! translations would only fit it.

use super::keyframes::rotation_between;
use super::mapper::{MIN_INLIERS, Mapper};
use super::rotation_averaging::{RotationEdge, average_rotations};
use super::view_graph::Edge;
use super::{Match, ScenePoint, TrackTable};
use plumbline_camera::{CameraPose, Intrinsics, Vec3};
use plumbline_num::math::median;
use plumbline_num::run::{Run, Stopped};

/// The focal length is estimated from the pairs with the largest rotations: one in this many.
const PAIR_DIVISOR: usize = 3;

/// The focal length of a rotating camera, px; `None` if no pair rotated.
pub(super) fn focal_of_rotations(edges: &[Edge], camera: &Intrinsics) -> Option<f64> {
    let mut rotations: Vec<(f64, f64)> =
        edges.iter().filter_map(|e| e.view.rotation).map(|t| (t.rotation.angle(), t.focal_ratio)).collect();
    rotations.sort_by(|a, b| b.0.total_cmp(&a.0));
    rotations.truncate(rotations.len().div_ceil(PAIR_DIVISOR));
    let mut ratios: Vec<f64> = rotations.into_iter().map(|t| t.1).collect();
    median(&mut ratios).map(|ratio| camera.focal * ratio)
}

/// Estimates the rotations of the cameras of `mapper`, whose keyframes are `keys`, and sets the points to infinity.
pub(super) fn estimate_rotations(
    table: &TrackTable,
    mapper: &mut Mapper<'_>,
    keys: &[usize],
    edges: &[Edge],
    run: &Run,
) -> Result<(), Stopped> {
    let camera = mapper.scene.intrinsics;
    let row = |frame: usize| keys.binary_search(&frame).ok();
    let measured = edges.iter().filter_map(|e| {
        let second_from_first = rotation_pose(&e.matches, &camera)?.rotation;
        Some(RotationEdge {
            first: row(e.first)?,
            second: row(e.second)?,
            second_from_first,
            weight: e.inliers() as f64,
        })
    });
    let averaged = average_rotations(keys.len(), &measured.collect::<Vec<_>>(), run)?;
    for (&frame, rotation) in keys.iter().zip(&averaged.rotations) {
        mapper.scene.poses[frame] = rotation.map(|rotation| CameraPose { rotation, translation: Vec3::zeros() });
    }
    let unknown: Vec<usize> = (0..table.frames()).filter(|&f| mapper.scene.poses[f].is_none()).collect();
    for frame in unknown {
        run.check()?;
        mapper.scene.poses[frame] = rotated_from_known(table, &mapper.scene.poses, frame, keys, &camera);
    }
    place_at_infinity(table, mapper);
    Ok(())
}

/// The pose of a frame relative to the nearest keyframe before it that shares enough points, or else to a neighbor.
fn rotated_from_known(
    table: &TrackTable,
    poses: &[Option<CameraPose>],
    frame: usize,
    keys: &[usize],
    camera: &Intrinsics,
) -> Option<CameraPose> {
    let key = keys.iter().rev().copied().find(|&k| k < frame && poses[k].is_some());
    let neighbor = (0..frame).rev().find(|&f| poses[f].is_some());
    key.into_iter().chain(neighbor).find_map(|from| {
        let shared = table.shared(from, frame);
        (shared.len() >= MIN_INLIERS).then(|| Some(rotation_pose(&shared, camera)? * poses[from]?)).flatten()
    })
}

fn rotation_pose(matches: &[Match], camera: &Intrinsics) -> Option<CameraPose> {
    let ray = |p| camera.ray(p).map(|r: Vec3| r.normalize());
    let rays: Vec<(Vec3, Vec3)> = matches.iter().filter_map(|m| Some((ray(m.first)?, ray(m.second)?))).collect();
    (rays.len() >= MIN_INLIERS)
        .then(|| CameraPose { rotation: rotation_between(&rays).into(), translation: Vec3::zeros() })
}

/// Sets the ray of every point from the first known frame that observes it.
pub(super) fn place_at_infinity(table: &TrackTable, mapper: &mut Mapper<'_>) {
    for point in 0..table.points() {
        let first = table.of_point(point).find(|o| mapper.scene.poses[o.frame as usize].is_some());
        let found = first.and_then(|o| {
            let ray = mapper.scene.intrinsics.undistorted(o.pixel)?;
            Some(ScenePoint { anchor: o.frame, ray, inverse_depth: 0.0 })
        });
        mapper.scene.points[point] = found.filter(|_| !mapper.is_banned(point));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::sfm::keyframes::keyframes;
    use crate::motion::sfm::mapper::LensPrior;
    use crate::motion::sfm::tests::synthetic::{Course, Shot, ShotOptions, path_error};
    use crate::motion::sfm::view_graph::view_graph;

    fn turning(outliers: f64) -> (Shot, TrackTable) {
        let course = Course::Rotation;
        let shot =
            Shot::new(&ShotOptions { seed: 12, frames: 50, course, noise_px: 0.2, outliers, ..ShotOptions::default() });
        let table = shot.table();
        (shot, table)
    }

    #[test]
    fn rotations_determine_the_focal_length_from_any_assumed_one() {
        let (_, table) = turning(0.0);
        for assumed in [480.0, 576.0, 700.0] {
            let camera = Intrinsics::centered(assumed, 640, 360);
            let edges = view_graph(&table, &keyframes(&table, &camera), &camera, 1.5, &Run::default())
                .expect("a run that never stops");
            let focal = focal_of_rotations(&edges, &camera).expect("it turned");
            assert!((focal / 576.0 - 1.0).abs() < 0.05, "{focal} from {assumed}");
        }
        assert_eq!(focal_of_rotations(&[], &Intrinsics::centered(576.0, 640, 360)), None);
    }

    #[test]
    fn every_frame_is_rotated_none_translated_and_points_are_at_infinity() {
        let (shot, table) = turning(0.1);
        let camera = Intrinsics::centered(576.0, 640, 360);
        let keys = keyframes(&table, &camera);
        let edges = view_graph(&table, &keys, &camera, 1.1, &Run::default()).expect("a run that never stops");
        let run = Run::default();
        let mut mapper = Mapper::new(&table, &keys, camera, LensPrior { sigma_ln_focal: 0.1, sigma_k1: 0.1 }, &run);
        estimate_rotations(&table, &mut mapper, &keys, &edges, &Run::default()).expect("a run that never stops");
        assert!(mapper.scene.poses.iter().all(|p| p.is_some_and(|p| p.translation == Vec3::zeros())));
        let error = path_error(&mapper.scene.poses, &shot.truth.poses);
        assert!(error.rotation < 0.2_f64.to_radians(), "{error:?}");
        assert!(mapper.scene.points.iter().flatten().all(|p| p.inverse_depth == 0.0));
    }
}
