//! Laws of the adjustment as a whole, on synthetic shots.

use super::*;
use crate::motion::sfm::tests::synthetic::{Course, Disturbance, PathError, Shot, ShotOptions, path_error};
use plumbline_camera::CameraPose;
use plumbline_num::energy::Loss;
use plumbline_num::run::Run;

/// Worst supported initial guess: 1°, 5 % of the path, depths by a factor of 1.5, focal length 20 % too long.
const ROUGH: Disturbance = Disturbance { rotation: 0.0175, shift: 0.05, depth_factor: 1.5, focal_factor: 1.2 };

fn free_lens() -> BundleOptions {
    let k1 = Freedom::Near { value: 0.0, sigma: 0.1 };
    BundleOptions { focal: Freedom::Free, k1, ..BundleOptions::default() }
}

fn solved(shot: &Shot, options: &BundleOptions) -> (Scene, BundleReport, PathError) {
    let mut scene = shot.start(&ROUGH, 5);
    let report = adjust(&mut scene, &shot.observations, options, &Run::default()).expect("a sound problem");
    let error = path_error(&scene.poses, &shot.truth.poses);
    (scene, report, error)
}

fn focal_error(scene: &Scene, shot: &Shot) -> f64 {
    scene.intrinsics.focal / shot.truth.intrinsics.focal - 1.0
}

#[test]
fn exact_tracks_give_the_exact_cameras_from_a_rough_start() {
    for (seed, course) in [(1, Course::Walk), (2, Course::Walk), (3, Course::Side)] {
        let shot = Shot::new(&ShotOptions { seed, course, ..ShotOptions::default() });
        let (scene, report, error) = solved(&shot, &free_lens());
        assert!(report.converged, "{report:?}");
        assert!(error.position < 1e-5, "seed {seed}: {error:?}");
        assert!(focal_error(&scene, &shot).abs() < 1e-4, "seed {seed}: f {}", scene.intrinsics.focal);
    }
}

#[test]
fn the_radial_term_is_found() {
    let shot = Shot::new(&ShotOptions { seed: 4, k1: -0.08, ..ShotOptions::default() });
    let (scene, _, error) = solved(&shot, &free_lens());
    assert!((scene.intrinsics.k1 + 0.08).abs() < 1e-4, "{}", scene.intrinsics.k1);
    assert!(error.position < 1e-5, "{error:?}");
}

#[test]
fn the_readout_is_found_and_straightens_what_it_bent() {
    let shot = Shot::new(&ShotOptions { seed: 5, readout: 0.6, ..ShotOptions::default() });
    let (scene, _, error) = solved(&shot, &BundleOptions { readout: Freedom::Free, ..free_lens() });
    let (_, _, unaware) = solved(&shot, &free_lens());
    assert!((scene.readout - 0.6).abs() < 0.012, "{}", scene.readout);
    assert!(error.position < 1e-3 && error.frame_to_frame < 2e-4, "{error:?}");
    assert!(error.frame_to_frame < 0.1 * unaware.frame_to_frame, "{error:?} {unaware:?}");
}

#[test]
fn noise_and_outliers_leave_an_error_of_the_size_that_is_reported() {
    let shot = Shot::new(&ShotOptions { seed: 6, noise_px: 0.3, outliers: 0.05, ..ShotOptions::default() });
    let (scene, report, error) = solved(&shot, &free_lens());
    let sigma = report.sigma_ln_focal.expect("the focal length is free");
    assert!(error.position < 2e-3 && error.rotation < 1e-3, "{error:?}");
    assert!(sigma > 1e-4 && sigma < 1e-2 && focal_error(&scene, &shot).abs() < 4.0 * sigma, "{sigma}");
    assert!(report.median_px > 0.3 && report.median_px < 0.45 && report.rms_px > 3.0, "{report:?}");
}

#[test]
fn the_reported_deviation_of_the_focal_length_is_its_spread_over_noise() {
    let (mut squares, mut reported, runs) = (0.0, 0.0, 24);
    let make = |seed, noise_px| ShotOptions { seed, frames: 30, per_frame: 60, noise_px, ..ShotOptions::default() };
    for seed in 0..runs {
        let shot = Shot::new(&make(seed, 0.3));
        let mut scene = shot.truth.clone();
        let options = BundleOptions { focal: Freedom::Free, ..BundleOptions::default() };
        let report = adjust(&mut scene, &shot.observations, &options, &Run::default()).expect("sound");
        let sigma = report.sigma_ln_focal.expect("free");
        squares += ((1.0 + focal_error(&scene, &shot)).ln() / sigma).powi(2);
        reported += sigma;
    }
    // χ² with 24 degrees of freedom: 99.9 % are between 8.1 and 51.2 on either side.
    assert!(squares > 8.0 && squares < 52.0, "{squares}, mean σ {}", reported / runs as f64);
}

#[test]
fn fixed_poses_do_not_move_and_fix_the_scale() {
    let shot = Shot::new(&ShotOptions { seed: 7, frames: 24, ..ShotOptions::default() });
    let mut scene = shot.start(&Disturbance { focal_factor: 1.0, ..ROUGH }, 2);
    let fixed = [0, 1, 2, 11];
    for &f in &fixed {
        scene.poses[f as usize] = shot.truth.poses[f as usize];
    }
    let options = BundleOptions { fixed_frames: fixed.to_vec(), ..BundleOptions::default() };
    adjust(&mut scene, &shot.observations, &options, &Run::default()).expect("sound");
    for (f, (found, truth)) in scene.poses.iter().flatten().zip(shot.truth.poses.iter().flatten()).enumerate() {
        assert!(!fixed.contains(&(f as u32)) || found == truth);
        assert!((found.center() - truth.center()).norm() < 1e-6, "frame {f}, without any alignment");
    }
    assert_eq!(scene.intrinsics, shot.truth.intrinsics);
}

#[test]
fn without_fixed_poses_the_first_stays_and_the_scale_with_it() {
    let shot = Shot::new(&ShotOptions { seed: 8, frames: 24, ..ShotOptions::default() });
    let mut scene = shot.start(&ROUGH, 3);
    let (first, extent) = (scene.poses[0], farthest(&scene));
    adjust(&mut scene, &shot.observations, &free_lens(), &Run::default()).expect("sound");
    assert_eq!(scene.poses[0], first);
    assert!((farthest(&scene) / extent - 1.0).abs() < 0.3);
}

fn farthest(scene: &Scene) -> f64 {
    let centers: Vec<_> = scene.poses.iter().flatten().map(CameraPose::center).collect();
    centers.iter().map(|c| (c - centers[0]).norm()).fold(0.0, f64::max)
}

#[test]
fn a_rotating_camera_gets_its_rotations_and_finite_points() {
    let shot = Shot::new(&ShotOptions { seed: 9, course: Course::Rotation, frames: 30, ..ShotOptions::default() });
    let mut scene = shot.start(&Disturbance { shift: 0.0, focal_factor: 1.0, ..ROUGH }, 1);
    scene.points.iter_mut().flatten().for_each(|p| p.inverse_depth = 0.0);
    let report = adjust(&mut scene, &shot.observations, &BundleOptions::default(), &Run::default()).expect("sound");
    assert!(report.median_px < 1e-3, "{report:?}");
    assert!(path_error(&scene.poses, &shot.truth.poses).frame_to_frame < 1e-5);
    assert!(scene.points.iter().flatten().all(|p| p.inverse_depth.is_finite()));
}

#[test]
fn points_beyond_infinity_come_back() {
    let shot = Shot::new(&ShotOptions { seed: 10, frames: 24, ..ShotOptions::default() });
    let mut scene = shot.truth.clone();
    scene.points.iter_mut().flatten().step_by(7).for_each(|p| p.inverse_depth = -0.01);
    adjust(&mut scene, &shot.observations, &BundleOptions::default(), &Run::default()).expect("sound");
    for (found, truth) in scene.points.iter().flatten().zip(shot.truth.points.iter().flatten()) {
        let seen = shot.observations.iter().filter(|o| shot.truth.points[o.point as usize] == Some(*truth)).count();
        assert!(seen < 4 || (found.inverse_depth - truth.inverse_depth).abs() < 1e-5, "{found:?} {truth:?}");
    }
}

#[test]
fn the_result_does_not_depend_on_the_order_of_observations() {
    let shot = Shot::new(&ShotOptions { seed: 11, frames: 20, noise_px: 0.3, ..ShotOptions::default() });
    let mut shuffled = shot.observations.clone();
    fastrand::Rng::with_seed(1).shuffle(&mut shuffled);
    let (mut one, mut other) = (shot.start(&ROUGH, 1), shot.start(&ROUGH, 1));
    adjust(&mut one, &shot.observations, &free_lens(), &Run::default()).expect("sound");
    adjust(&mut other, &shuffled, &free_lens(), &Run::default()).expect("sound");
    assert_eq!(one, other);
}

#[test]
fn points_alone_return_to_their_positions() {
    let shot = Shot::new(&ShotOptions { seed: 13, frames: 24, k1: -0.05, ..ShotOptions::default() });
    let mut scene = shot.truth.clone();
    scene
        .points
        .iter_mut()
        .flatten()
        .for_each(|p| (p.inverse_depth, p.ray.x) = (0.6 * p.inverse_depth, p.ray.x + 0.01));
    let refined = refine_points(&mut scene, &shot.observations, &RobustFit::default(), &Run::default()).expect("sound");
    assert!(refined > 200 && scene.poses == shot.truth.poses);
    let apart = |o: &Observation| scene.project(o.frame, o.point).map_or(f64::INFINITY, |p| (p - o.pixel).norm());
    let mut twice = shot.observations.iter().filter(|o| o.frame + 3 < 24);
    let seen_again = |o: &&Observation| shot.observations.iter().any(|p| p.point == o.point && p.frame != o.frame);
    assert!(twice.clone().filter(seen_again).all(|o| apart(o) < 1e-3), "{:?}", twice.find(|o| apart(o) > 1e-3));
}

#[test]
fn bad_input_is_refused_and_the_scene_left_alone() {
    let shot = Shot::new(&ShotOptions { seed: 14, frames: 4, per_frame: 20, ..ShotOptions::default() });
    let refused = |scene: &Scene, observations: &[Observation], options: &BundleOptions| {
        let mut copy = scene.clone();
        let error = adjust(&mut copy, observations, options, &Run::default()).expect_err("bad input");
        assert_eq!(format!("{copy:?}"), format!("{scene:?}"));
        error.to_string()
    };
    let (scene, seen, plain) = (&shot.truth, &shot.observations, BundleOptions::default());
    let fit = |fit: RobustFit| BundleOptions { fit, ..plain.clone() };
    let sigma = fit(RobustFit { sigma_px: f64::NAN, ..RobustFit::default() });
    assert_eq!(refused(scene, seen, &sigma), "sigma_px NaN is invalid (expected above 0, finite)");
    let loss = fit(RobustFit { losses: vec![Loss::Cauchy(0.0)], ..RobustFit::default() });
    assert_eq!(refused(scene, seen, &loss), "loss scale 0 is invalid (expected above 0, finite)");
    let none = fit(RobustFit { losses: Vec::new(), ..RobustFit::default() });
    assert_eq!(refused(scene, seen, &none), "number of losses 0 is invalid (expected at least 1)");
    let prior = BundleOptions { k1: Freedom::Near { value: 0.0, sigma: -1.0 }, ..plain.clone() };
    assert_eq!(refused(scene, seen, &prior), "sigma of k1 -1 is invalid (expected above 0, finite)");
    let unseen = "0 points are seen by two known frames (expected at least 1); triangulate first";
    assert_eq!(refused(scene, &seen[..1], &plain), unseen);
    let mut far = seen.clone();
    far[0].pixel.x = f64::NAN;
    let not_finite = "is not finite or not valid; leave it out or set it to none";
    assert_eq!(refused(scene, &far, &plain), format!("observation of point {} in frame 0 {not_finite}", far[0].point));
    let mut bad = scene.clone();
    bad.points[3].as_mut().expect("known").inverse_depth = f64::INFINITY;
    assert_eq!(refused(&bad, seen, &plain), format!("point 3 {not_finite}"));
}
