//! Global mapping: rotation averaging, then global positioning of all keyframes, without an initial pair.
//!
//! The relative rotations of all pairs are averaged ([`super::average_rotations`]), the centers are estimated from the
//! directions of the observations ([`super::positioning`]), and the resulting map is bundle-adjusted as any other. It
//! is the fallback if no incrementally grown map ([`super::mapper`]) is accepted: `nus-regular-2` has cameras in space
//! (RMS 0.54 px), without it a rotation only (1.17 px). It is not sufficient alone: of synthetic shots with more than
//! a fifth of wrong observations it loses four (`docs/ABLATIONS.md`).
//!
//! # Reference
//! L. Pan, D. Baráth, M. Pollefeys, J. Schönberger, *Global structure-from-motion revisited*, ECCV 2024.

use super::mapper::{GROWN, Mapper};
use super::positioning::{Bearing, centers_of_bearings};
use super::rotation_averaging::{RotationEdge, average_rotations};
use super::view_graph::Edge;
use super::{AveragedRotations, Observation, TrackTable};
use plumbline_camera::{CameraPose, Point3};
use plumbline_num::run::{Run, Stopped};

/// Minimum number of keyframes that observe a point for it to constrain their centers: two only determine the point
/// itself.
const MIN_VIEWS: usize = 3;

/// Rotations of the keyframes, averaged over the pairs.
fn averaged(keys: &[usize], edges: &[Edge], run: &Run) -> Result<AveragedRotations, Stopped> {
    let row = |frame: usize| keys.binary_search(&frame).ok();
    let measured = edges.iter().filter_map(|e| {
        Some(RotationEdge {
            first: row(e.first)?,
            second: row(e.second)?,
            second_from_first: e.view.poses.first()?.rotation,
            weight: e.inliers() as f64,
        })
    });
    average_rotations(keys.len(), &measured.collect::<Vec<_>>(), run)
}

/// Adds all keyframe cameras to the empty `mapper` at once; false if the pairs do not connect them.
pub(super) fn map_globally(
    table: &TrackTable,
    mapper: &mut Mapper<'_>,
    keys: &[usize],
    edges: &[Edge],
    run: &Run,
) -> Result<bool, Stopped> {
    let averaged = averaged(keys, edges, run)?;
    let lens = mapper.scene.intrinsics;
    let oriented: Vec<_> = keys.iter().zip(averaged.rotations).filter_map(|(&k, r)| Some((k, r?))).collect();
    let seen = |point: usize| -> Vec<Bearing> {
        let bearing = |o: &Observation| {
            let camera = oriented.binary_search_by_key(&(o.frame as usize), |t| t.0).ok()?;
            let ray = lens.undistorted(o.pixel)?.push(1.0).normalize();
            Some(Bearing { camera, direction: oriented[camera].1.inverse() * ray })
        };
        table.of_point(point).filter_map(bearing).collect()
    };
    let points: Vec<Vec<Bearing>> = (0..table.points()).map(seen).filter(|p| p.len() >= MIN_VIEWS).collect();
    if oriented.len() < 2 || points.is_empty() {
        return Ok(false);
    }
    let Some(centers) = centers_of_bearings(oriented.len(), &points, run)? else { return Ok(false) };
    for ((frame, rotation), center) in oriented.into_iter().zip(centers) {
        mapper.scene.poses[frame] = Some(CameraPose::looking_from(Point3::from(center), rotation));
    }
    mapper.triangulate_new()?;
    mapper.adjust_all(false, GROWN)?;
    mapper.discard_wrong();
    mapper.triangulate_new()?;
    Ok(mapper.adjust_all(true, GROWN)?.is_some())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::sfm::keyframes::keyframes;
    use crate::motion::sfm::mapper::LensPrior;
    use crate::motion::sfm::tests::synthetic::{Course, Shot, ShotOptions, path_error};
    use crate::motion::sfm::view_graph::view_graph;
    use plumbline_camera::Intrinsics;

    fn shot(course: Course) -> (Shot, TrackTable) {
        let options =
            ShotOptions { seed: 8, frames: 60, course, noise_px: 0.2, outliers: 0.03, ..ShotOptions::default() };
        let shot = Shot::new(&options);
        let table = shot.table();
        (shot, table)
    }

    #[test]
    fn a_walk_is_mapped_without_a_seed() {
        for course in [Course::Walk, Course::Side] {
            let (shot, table) = shot(course);
            let camera = Intrinsics::centered(576.0, 640, 360);
            let keys = keyframes(&table, &camera);
            let edges = view_graph(&table, &keys, &camera, 1.05, &Run::default()).expect("a run that never stops");
            let lens = LensPrior { sigma_ln_focal: 0.02, sigma_k1: 0.01 };
            let run = Run::default();
            let mut mapper = Mapper::new(&table, &keys, camera, lens, &run);
            assert!(map_globally(&table, &mut mapper, &keys, &edges, &run).expect("a run that never stops"));
            let known: Vec<Option<CameraPose>> = keys.iter().map(|&k| mapper.scene.poses[k]).collect();
            let truth: Vec<Option<CameraPose>> = keys.iter().map(|&k| shot.truth.poses[k]).collect();
            let error = path_error(&known, &truth);
            assert!(known.iter().all(Option::is_some) && error.position < 0.02, "{course:?}: {error:?}");
        }
    }

    #[test]
    fn keyframes_that_no_pair_connects_are_not_placed() {
        let (_, table) = shot(Course::Walk);
        let camera = Intrinsics::centered(576.0, 640, 360);
        let lens = LensPrior { sigma_ln_focal: 0.02, sigma_k1: 0.01 };
        let run = Run::default();
        let mut mapper = Mapper::new(&table, &[0, 20], camera, lens, &run);
        assert!(!map_globally(&table, &mut mapper, &[0, 20], &[], &run).expect("a run that never stops"));
    }
}
