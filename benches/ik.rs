//! Inverse kinematics: a person of 60 joints with limits, three to six targets that random poses within the limits reach, from rest, one
//! thread.
//!
//! Prints the median and the 99th percentile of a solve. The limit is arithmetic: a step evaluates 60 frames and about 60 blocks of the
//! Jacobian, some 30 000 operations or 20 µs, and a solve takes ten to twenty steps.

#![allow(clippy::print_stdout)] // figures are its result

use std::hint::black_box;
use std::time::Instant;

use criterion::{Criterion, criterion_group, criterion_main};
use nalgebra::{Unit, Vector2, Vector3};
use plumbline::num::math::Trs;
use plumbline::num::run::Run;
use plumbline::shape::character::ik::{IkOptions, Target, solve};
use plumbline::shape::character::{Joint, Limits, Pose, Skeleton, SwingTwist};

/// Random poses.
const POSES: usize = 5000;

/// Largest distance from a target that counts as reached, of a person 1.75 units high.
const REACHED: f64 = 1e-5;

/// Adds a joint and returns its number.
fn add(joints: &mut Vec<Joint>, parent: Option<u32>, offset: [f64; 3], limits: Option<Limits>) -> u32 {
    let number = joints.len() as u32;
    joints.push(Joint { name: format!("joint {number}"), parent, rest: Trs::from_translation(offset.into()), limits });
    number
}

fn cone(axis: [f64; 3], swing: [f64; 2], twist: f64) -> Limits {
    Limits { swing, ..Limits::cone(Unit::new_normalize(axis.into()), 0.0, twist) }
}

fn hinge(axis: [f64; 3], largest: f64) -> Limits {
    Limits { twist: [0.0, largest], ..Limits::cone(Unit::new_normalize(axis.into()), 0.0, 0.0) }
}

/// Hips, five of the spine, neck, head, jaw and eyes; clavicles, arms with fifteen finger joints each; legs with toes. And the joints whose
/// positions are sought: hands, feet, head, elbows, knees, a finger on each side.
fn person() -> (Skeleton, Vec<u32>) {
    let mut joints = Vec::new();
    let hips = add(&mut joints, None, [0.0, 0.95, 0.0], None);
    let mut spine = hips;
    for _ in 0..5 {
        spine = add(&mut joints, Some(spine), [0.0, 0.09, 0.0], Some(cone([0.0, 1.0, 0.0], [0.25, 0.2], 0.2)));
    }
    let neck = add(&mut joints, Some(spine), [0.0, 0.07, 0.0], Some(cone([0.0, 1.0, 0.0], [0.5, 0.4], 0.6)));
    let head = add(&mut joints, Some(neck), [0.0, 0.1, 0.0], Some(cone([0.0, 1.0, 0.0], [0.5, 0.4], 0.6)));
    for offset in [[0.0, 0.02, 0.06], [0.03, 0.08, 0.08], [-0.03, 0.08, 0.08]] {
        add(&mut joints, Some(head), offset, Some(cone([0.0, 0.0, 1.0], [0.4, 0.4], 0.1)));
    }
    let mut sought = vec![head];
    for side in [1.0, -1.0] {
        let along = [side, 0.0, 0.0];
        let clavicle = add(&mut joints, Some(spine), [0.04 * side, 0.0, 0.0], Some(cone(along, [0.2, 0.2], 0.1)));
        let arm = add(&mut joints, Some(clavicle), [0.14 * side, 0.0, 0.0], Some(cone(along, [1.6, 1.3], 1.0)));
        let elbow = add(&mut joints, Some(arm), [0.27 * side, 0.0, 0.0], Some(hinge([0.0, -side, 0.0], 2.4)));
        let hand = add(&mut joints, Some(elbow), [0.25 * side, 0.0, 0.0], Some(cone(along, [1.0, 0.5], 0.9)));
        for finger in 0..5 {
            let mut knuckle = hand;
            for k in 0..3 {
                let offset =
                    if k == 0 { [0.09 * side, 0.0, 0.02 * f64::from(finger) - 0.04] } else { [0.03 * side, 0.0, 0.0] };
                knuckle = add(&mut joints, Some(knuckle), offset, Some(hinge([0.0, 0.0, -side], 1.4)));
            }
            if finger == 1 {
                sought.push(knuckle);
            }
        }
        let leg = add(&mut joints, Some(hips), [0.1 * side, -0.05, 0.0], Some(cone([0.0, -1.0, 0.0], [1.6, 0.7], 0.6)));
        let knee = add(&mut joints, Some(leg), [0.0, -0.4, 0.0], Some(hinge([1.0, 0.0, 0.0], 2.4)));
        let foot = add(&mut joints, Some(knee), [0.0, -0.41, -0.02], Some(cone([0.0, -1.0, 0.0], [0.7, 0.3], 0.3)));
        let toes = add(&mut joints, Some(foot), [0.0, -0.06, 0.12], Some(hinge([1.0, 0.0, 0.0], 0.6)));
        add(&mut joints, Some(toes), [0.0, 0.0, 0.06], None);
        sought.extend([hand, elbow, knee, foot]);
    }
    while joints.len() < 60 {
        let last = joints.len() as u32 - 1;
        add(&mut joints, Some(last), [0.0, 0.0, 0.01], None);
    }
    (Skeleton::new(joints).expect("a tree with limits"), sought)
}

/// A pose that is uniform in the limits; joints without limits are at rest.
fn random_pose(skeleton: &Skeleton, rng: &mut fastrand::Rng) -> Pose {
    let mut pose = skeleton.rest_pose();
    for (joint, local) in skeleton.joints().iter().zip(&mut pose.locals) {
        let Some(limits) = joint.limits else { continue };
        let (radius, angle) = (rng.f64().sqrt(), rng.f64() * std::f64::consts::TAU);
        let swing = Vector2::new(limits.swing[0] * angle.cos(), limits.swing[1] * angle.sin()) * radius;
        let twist = limits.twist[0] + (limits.twist[1] - limits.twist[0]) * rng.f64();
        local.rotation = joint.rest.rotation * limits.rotation(&SwingTwist { swing, twist });
    }
    pose
}

fn positions(skeleton: &Skeleton, pose: &Pose) -> Vec<Vector3<f64>> {
    skeleton
        .globals(pose)
        .expect("a pose of the skeleton")
        .iter()
        .map(|g| g.fixed_view::<3, 1>(0, 3).into_owned())
        .collect()
}

/// Targets that a random pose reaches.
fn reachable(skeleton: &Skeleton, sought: &[u32], rng: &mut fastrand::Rng) -> Vec<Target> {
    let at = positions(skeleton, &random_pose(skeleton, rng));
    let mut joints = sought.to_vec();
    rng.shuffle(&mut joints);
    joints.truncate(3 + rng.usize(..4));
    joints.iter().map(|&j| Target::position(j, at[j as usize].into())).collect()
}

fn within_limits(skeleton: &Skeleton, pose: &Pose) -> bool {
    skeleton.joints().iter().zip(&pose.locals).all(|(joint, local)| {
        joint.limits.is_none_or(|limits| limits.allows(&(joint.rest.rotation.inverse() * local.rotation), 1e-9))
    })
}

fn inverse_kinematics(c: &mut Criterion) {
    let (skeleton, sought) = person();
    assert_eq!(skeleton.joint_count(), 60);
    let mut rng = fastrand::Rng::with_seed(1);
    let all: Vec<Vec<Target>> = (0..POSES).map(|_| reachable(&skeleton, &sought, &mut rng)).collect();
    let (rest, options, run) = (skeleton.rest_pose(), IkOptions::default(), Run::default());
    let (mut times, mut reached, mut steps) = (Vec::new(), 0, 0);
    for targets in &all {
        let begun = Instant::now();
        let found = solve(&skeleton, &rest, targets, &options, &run).expect("valid targets");
        times.push(begun.elapsed().as_secs_f64() * 1e3);
        reached += usize::from(found.residuals.iter().all(|residual| *residual <= REACHED));
        steps += found.iterations;
        assert!(within_limits(&skeleton, &found.pose));
    }
    times.sort_by(f64::total_cmp);
    let (median, slow) = (times[POSES / 2], times[POSES * 99 / 100]);
    println!(
        "{reached} of {POSES} reached; median {median:.2} ms, 99 % within {slow:.2} ms; {:.1} steps",
        steps as f64 / POSES as f64
    );
    assert!(reached * 100 >= POSES * 99, "{reached} of {POSES}");
    let mut next = all.iter().cycle();
    c.bench_function("inverse kinematics, 60 joints, 3 to 6 targets", |b| {
        b.iter(|| solve(&skeleton, &rest, black_box(next.next().expect("cyclic")), &options, &run));
    });
}

criterion_group!(benches, inverse_kinematics);
criterion_main!(benches);
