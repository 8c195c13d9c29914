//! A map without a seed: the rotations of all keyframes at once, then all centers at once.
//!
//! Where no pair of keyframes carries a map that grows over the shot, the relative rotations of all pairs are averaged
//! ([`super::average_rotations`]), the centers found from the directions in which points are seen
//! ([`super::positioning`]), and the map that follows is adjusted as any other. The averaged rotations, which know nothing of
//! a map, also tell where a map that grew from a seed has turned away from what the pairs say.

use super::mapper::{GROWN, Mapper};
use super::positioning::{Bearing, centers_of_bearings};
use super::rotation_averaging::{RotationEdge, average_rotations};
use super::view_graph::Edge;
use super::{AveragedRotations, TrackTable};
use plumbline_camera::{CameraPose, Point3, align};
use plumbline_num::run::{Run, Stopped};

/// Keyframes that must see a point for it to say where they stand: two say nothing that their baseline has not used up.
const MIN_VIEWS: usize = 3;
/// Angle, rad, RMS over the keyframes, by which a map may differ from averaged rotations: those of single pairs are good to
/// half a degree, and add up over a shot.
const MAX_DISTANCE: f64 = 0.1;

/// The rotations on which most pairs of the keyframes agree.
pub(super) fn averaged(keys: &[usize], edges: &[Edge], run: &Run) -> Result<AveragedRotations, Stopped> {
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

/// Whether the cameras of a map turn as the pairs of keyframes say.
pub(super) fn agrees(mapper: &Mapper<'_>, keys: &[usize], averaged: &AveragedRotations) -> bool {
    let turned = |rotation| CameraPose::looking_from(Point3::origin(), rotation);
    let pair = |(&frame, rotation): (&usize, &Option<_>)| {
        Some((turned((*rotation)?), turned(mapper.scene.poses[frame]?.rotation)))
    };
    let pairs: Vec<_> = keys.iter().zip(&averaged.rotations).filter_map(pair).collect();
    let Some((similarity, _)) = align(&pairs) else { return true };
    let apart = |(a, b): &(CameraPose, CameraPose)| similarity.camera(a).rotation.angle_to(&b.rotation).powi(2);
    (pairs.iter().map(apart).sum::<f64>() / pairs.len() as f64).sqrt() <= MAX_DISTANCE
}

/// Places the cameras of the empty `mapper` at once; false where the pairs do not connect them.
pub(super) fn place_all(
    table: &TrackTable,
    mapper: &mut Mapper<'_>,
    keys: &[usize],
    averaged: &AveragedRotations,
    run: &Run,
) -> Result<bool, Stopped> {
    let lens = mapper.scene.intrinsics;
    let turned: Vec<_> = keys.iter().zip(&averaged.rotations).filter_map(|(&k, r)| Some((k, (*r)?))).collect();
    let seen = |point: usize| -> Vec<Bearing> {
        let bearing = |o: &super::Observation| {
            let camera = turned.binary_search_by_key(&(o.frame as usize), |t| t.0).ok()?;
            let ray = lens.undistorted(o.pixel)?.push(1.0).normalize();
            Some(Bearing { camera, direction: turned[camera].1.inverse() * ray })
        };
        table.of_point(point).filter_map(bearing).collect()
    };
    let points: Vec<Vec<Bearing>> = (0..table.points()).map(seen).filter(|p| p.len() >= MIN_VIEWS).collect();
    if turned.len() < 2 || points.is_empty() {
        return Ok(false);
    }
    let Some(centers) = centers_of_bearings(turned.len(), &points, run)? else { return Ok(false) };
    for ((frame, rotation), center) in turned.into_iter().zip(centers) {
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
    use crate::motion::sfm::synthetic::{Course, Shot, ShotOptions, path_error};
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
    fn a_walk_is_mapped_without_a_seed_and_the_map_agrees_with_the_pairs() {
        for course in [Course::Walk, Course::Side] {
            let (shot, table) = shot(course);
            let camera = Intrinsics::centered(576.0, 640, 360);
            let keys = keyframes(&table, &camera);
            let edges = view_graph(&table, &keys, &camera, 1.05, &Run::default()).expect("a run that never stops");
            let averaged = averaged(&keys, &edges, &Run::default()).expect("a run that never stops");
            let lens = LensPrior { sigma_ln_focal: 0.02, sigma_k1: 0.01 };
            let run = Run::default();
            let mut mapper = Mapper::new(&table, &keys, camera, lens, &run);
            assert!(place_all(&table, &mut mapper, &keys, &averaged, &Run::default()).expect("a run that never stops"));
            let known: Vec<Option<CameraPose>> = keys.iter().map(|&k| mapper.scene.poses[k]).collect();
            let truth: Vec<Option<CameraPose>> = keys.iter().map(|&k| shot.truth.poses[k]).collect();
            let error = path_error(&known, &truth);
            assert!(known.iter().all(Option::is_some) && error.position < 0.02, "{course:?}: {error:?}");
            assert!(agrees(&mapper, &keys, &averaged));
            let turn = nalgebra::UnitQuaternion::from_scaled_axis(plumbline_camera::Vec3::new(0.0, 1.0, 0.0));
            let last = mapper.scene.poses[keys[keys.len() - 1]].as_mut().expect("known");
            last.rotation = turn * last.rotation;
            assert!(!agrees(&mapper, &keys, &averaged), "one camera of {} looks elsewhere", keys.len());
        }
    }

    #[test]
    fn keyframes_that_no_pair_connects_are_not_placed() {
        let (_, table) = shot(Course::Walk);
        let camera = Intrinsics::centered(576.0, 640, 360);
        let lens = LensPrior { sigma_ln_focal: 0.02, sigma_k1: 0.01 };
        let run = Run::default();
        let mut mapper = Mapper::new(&table, &[0, 20], camera, lens, &run);
        assert!(
            !place_all(
                &table,
                &mut mapper,
                &[0, 20],
                &averaged(&[0, 20], &[], &Run::default()).expect("a run that never stops"),
                &Run::default()
            )
            .expect("a run that never stops")
        );
    }
}
