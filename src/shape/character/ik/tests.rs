use nalgebra::Translation3;

use super::*;
use crate::character::{Joint, Limits};
use plumbline_num::math::Trs;
use plumbline_num::run::Run;

/// A chain of joints along x with bones of these lengths, rotated frames, and a leaf joint.
fn chain(lengths: &[f64], limits: Option<Limits>) -> Skeleton {
    let mut joints = Vec::new();
    for k in 0..=lengths.len() {
        let turn = UnitQuaternion::from_scaled_axis(Vector3::new(0.1, -0.2, 0.3) * (k as f64).sin());
        let along = if k == 0 { Vector3::new(0.3, -0.2, 0.1) } else { Vector3::x() * lengths[k - 1] };
        let parent = k.checked_sub(1).map(|p| p as u32);
        joints.push(Joint { name: format!("j{k}"), parent, rest: Trs::rigid(turn, along), limits });
    }
    Skeleton::new(joints).expect("valid")
}

fn tip_of(skeleton: &Skeleton, pose: &Pose) -> Point3<f64> {
    Frames::chained(skeleton, pose).at(skeleton.joint_count() as u32 - 1)
}

/// Positions around a chain, at most the fraction `share` of its length away.
fn places(skeleton: &Skeleton, length: f64, share: f64) -> Vec<Point3<f64>> {
    let root = Frames::chained(skeleton, &skeleton.rest_pose()).at(0);
    let place = |k: u32| {
        let k = f64::from(k);
        let direction = Vector3::new((k * 1.3).sin(), (k * 2.1).cos(), (k * 0.7 + 0.4).sin()).normalize();
        root + direction * length * share * (0.35 + 0.65 * (k * 0.41).sin().abs())
    };
    (0..24).map(place).collect()
}

fn bone_lengths(skeleton: &Skeleton, pose: &Pose) -> Vec<f64> {
    let frames = Frames::chained(skeleton, pose);
    (1..skeleton.joint_count() as u32).map(|j| (frames.at(j) - frames.at(j - 1)).norm()).collect()
}

fn within(skeleton: &Skeleton, pose: &Pose) -> bool {
    skeleton.joints().iter().zip(&pose.locals).all(|(joint, local)| {
        joint.limits.is_none_or(|limits| limits.allows(&(joint.rest.rotation.inverse() * local.rotation), 1e-9))
    })
}

#[test]
fn i1_reachable_targets_are_reached_and_a_chain_out_of_reach_is_straight() {
    let lengths = [0.7, 0.5, 0.6, 0.4];
    let skeleton = chain(&lengths, None);
    let (rest, length) = (skeleton.rest_pose(), 2.2);
    for at in places(&skeleton, length, 0.95) {
        let found =
            solve(&skeleton, &rest, &[Target::position(4, at)], &IkOptions::default(), &Run::default()).expect("valid");
        assert!(found.residuals[0] <= 1e-6 * length, "{at}: {} after {}", found.residuals[0], found.iterations);
    }
    let root = Frames::chained(&skeleton, &rest).at(0);
    for at in places(&skeleton, length, 1.0) {
        let far = root + (at - root).normalize() * 1.7 * length;
        let found = solve(&skeleton, &rest, &[Target::position(4, far)], &IkOptions::default(), &Run::default())
            .expect("valid");
        assert!(found.residuals[0] - 0.7 * length <= 1e-6 * length, "{}", found.residuals[0] - 0.7 * length);
    }
}

#[test]
fn i1_a_straight_chain_reaches_inward() {
    let skeleton = chain(&[1.0, 1.0], None);
    let mut straight = skeleton.rest_pose();
    straight.locals.iter_mut().for_each(|l| l.rotation = UnitQuaternion::identity());
    let root = Frames::chained(&skeleton, &straight).at(0);
    let at = root + Vector3::x();
    let found = solve(&skeleton, &straight, &[Target::position(2, at)], &IkOptions::default(), &Run::default());
    assert!(found.expect("valid").residuals[0] < 2e-6);
}

#[test]
fn i2_every_pose_and_interpolated_pose_is_within_the_limits() {
    let limits = Limits { swing: [0.6, 0.25], twist: [-0.1, 0.3], ..Limits::cone(Vector3::x_axis(), 1.0, 1.0) };
    let hinge = Limits { swing: [0.0, 1.2], twist: [0.0, 0.0], ..limits };
    for limits in [limits, hinge] {
        let skeleton = chain(&[0.7, 0.5, 0.6, 0.4], Some(limits));
        let mut pose = skeleton.rest_pose();
        for at in places(&skeleton, 2.2, 1.2) {
            for iterations in [1, 2, 3, 5, 200] {
                let options = IkOptions { iterations, ..Default::default() };
                let found =
                    solve(&skeleton, &pose, &[Target::position(4, at)], &options, &Run::default()).expect("valid");
                assert!(within(&skeleton, &found.pose), "{at} after {iterations}");
            }
            let found = solve(&skeleton, &pose, &[Target::position(4, at)], &IkOptions::default(), &Run::default())
                .expect("valid")
                .pose;
            for k in 0..=10 {
                let on_the_way = interpolate(&skeleton, &pose, &found, f64::from(k) / 10.0).expect("valid");
                assert!(within(&skeleton, &on_the_way));
            }
            let (by_descent, _) = ccd(&skeleton, &pose, (4, 9), &at, (20, 1e-6), &Run::default()).expect("valid");
            assert!(within(&skeleton, &by_descent));
            pose = found;
        }
    }
}

#[test]
fn i2_poses_within_the_limits_are_reached_within_them() {
    let limits = Limits { swing: [0.8, 0.5], twist: [-0.4, 0.4], ..Limits::cone(Vector3::x_axis(), 1.0, 1.0) };
    let skeleton = chain(&[0.7, 0.5, 0.6, 0.4], Some(limits));
    for k in 0..30 {
        // A pose within the limits, or on them, whose tip is the target.
        let k = f64::from(k);
        let mut there = skeleton.rest_pose();
        for (j, (local, joint)) in there.locals.iter_mut().zip(skeleton.joints()).enumerate() {
            let phase = k * 1.7 + j as f64;
            let at = crate::character::SwingTwist {
                swing: nalgebra::Vector2::new(0.95 * phase.sin(), 0.6 * (2.0 * phase).cos()),
                twist: 0.5 * (3.0 * phase).sin(),
            };
            local.rotation = joint.rest.rotation * limits.rotation(&limits.nearest(&at));
        }
        let at = tip_of(&skeleton, &there);
        let found =
            solve(&skeleton, &skeleton.rest_pose(), &[Target::position(4, at)], &IkOptions::default(), &Run::default())
                .expect("valid");
        assert!(found.residuals[0] <= 2e-6 && within(&skeleton, &found.pose), "{k}: {}", found.residuals[0]);
    }
}

#[test]
fn i3_a_chain_bends_toward_its_pole() {
    let skeleton = chain(&[0.7, 0.6], None);
    let rest = skeleton.rest_pose();
    for (at, pole) in places(&skeleton, 1.3, 0.9).into_iter().zip(places(&skeleton, 9.0, 1.0).into_iter().rev()) {
        let position = Target::position(2, at);
        let toward = Target { goal: Goal::Pole { root: 0, middle: 1, at: pole }, ..position.clone() };
        let found =
            solve(&skeleton, &rest, &[position, toward], &IkOptions::default(), &Run::default()).expect("valid");
        assert!(found.residuals[0] < 2e-6 && found.residuals[1] < 0.1_f64.to_radians(), "{:?}", found.residuals);
        let by_hand = two_bone(&skeleton, &rest, [0, 1, 2], &at, Some(&pole)).expect("valid");
        assert!((tip_of(&skeleton, &by_hand) - at).norm() < 1e-12);
        let ([a, b, c], root) = ([0, 1, 2].map(|j| Frames::chained(&skeleton, &by_hand).at(j)), pole);
        let normal = (c - a).cross(&(root - a)).normalize();
        assert!(
            (b - a).dot(&normal).abs() < 1e-12 && (b - a).dot(&(normal.cross(&(c - a)))) > 0.0,
            "in the plane, on its side"
        );
        let middles = [&found.pose, &by_hand].map(|p| Frames::chained(&skeleton, p).at(1));
        assert!((middles[0] - middles[1]).norm() < 1e-5, "both find the one solution");
    }
}

#[test]
fn i4_a_small_motion_of_the_target_moves_joints_a_little() {
    let limits = Limits { swing: [1.2, 1.2], twist: [-0.4, 0.4], ..Limits::cone(Vector3::x_axis(), 1.0, 1.0) };
    for limits in [None, Some(limits)] {
        let skeleton = chain(&[0.7, 0.5, 0.6], limits);
        let root = Frames::chained(&skeleton, &skeleton.rest_pose()).at(0);
        let mut pose = skeleton.rest_pose();
        let mut first = true;
        let step = 0.01;
        for k in 0..400 {
            let t = f64::from(k) * step;
            let at = root + Vector3::new(1.2 + 0.2 * t.cos(), 0.5 * t.sin(), 0.4 * (0.7 * t).sin());
            let found = solve(&skeleton, &pose, &[Target::position(3, at)], &IkOptions::default(), &Run::default())
                .expect("valid")
                .pose;
            let slerp = found.locals.iter().zip(&pose.locals).map(|(a, b)| a.rotation.angle_to(&b.rotation));
            let most = slerp.fold(0.0, f64::max);
            assert!(first || most < 8.0 * step, "{limits:?}: {most} at {k}");
            (pose, first) = (found, false);
        }
    }
}

#[test]
fn i5_bone_lengths_are_constant() {
    let lengths = [0.7, 0.5, 0.6, 0.4];
    let skeleton = chain(&lengths, None);
    let rest = skeleton.rest_pose();
    for at in places(&skeleton, 2.2, 1.3) {
        let found = solve(&skeleton, &rest, &[Target::position(4, at)], &IkOptions::default(), &Run::default())
            .expect("valid")
            .pose;
        let [(a, _), (b, _)] = [
            ccd(&skeleton, &rest, (4, 9), &at, (30, 1e-9), &Run::default()),
            fabrik(&skeleton, &rest, (4, 9), &at, (30, 1e-9), &Run::default()),
        ]
        .map(|r| r.expect("valid"));
        for pose in [found, a, b] {
            for (found, length) in bone_lengths(&skeleton, &pose).iter().zip(lengths) {
                assert!((found - length).abs() < 1e-12 * 2.2);
            }
        }
    }
}

#[test]
fn targets_of_all_kinds_are_met_together() {
    let skeleton = chain(&[0.7, 0.5, 0.6, 0.4, 0.3], None);
    let mut there = skeleton.rest_pose();
    for (k, local) in there.locals.iter_mut().enumerate() {
        local.rotation *= UnitQuaternion::from_scaled_axis(Vector3::new(0.3, 0.8 - k as f64 * 0.3, 0.5));
    }
    let frames = Frames::chained(&skeleton, &there);
    let seen = frames.at(3) + frames.rotation[3] * Vector3::z() * 5.0;
    let target = |joint, goal| Target { joint, goal, weight: 1.0, chain: None };
    let targets = [
        Target::position(5, frames.at(5)),
        target(5, Goal::Orientation(frames.rotation[5])),
        target(3, Goal::LookAt { axis: Vector3::z_axis(), at: seen }),
        target(2, Goal::Pole { root: 0, middle: 1, at: frames.at(1) }),
        target(
            4,
            Goal::Position { point: Point3::new(0.1, 0.2, 0.0), at: frames.point(4, &Point3::new(0.1, 0.2, 0.0)) },
        ),
    ];
    let found =
        solve(&skeleton, &skeleton.rest_pose(), &targets, &IkOptions::default(), &Run::default()).expect("valid");
    for (k, residuals) in found.residuals.iter().enumerate() {
        assert!(*residuals < 1e-5, "target {k}: {residuals} after {}", found.iterations);
    }
}

#[test]
fn jacobians_agree_with_finite_differences_also_under_scaled_frames() {
    let limits = Limits { swing: [2.0, 2.0], twist: [-2.0, 2.0], ..Limits::cone(Vector3::x_axis(), 1.0, 1.0) };
    let mut joints = chain(&[0.7, 0.5, 0.6, 0.4], None).joints().to_vec();
    joints[1].rest.scale = Vector3::new(1.5, 0.8, 1.2);
    joints[2].limits = Some(limits);
    let skeleton = Skeleton::new(joints).expect("valid");
    let mut pose = skeleton.rest_pose();
    for (k, local) in pose.locals.iter_mut().enumerate() {
        local.rotation *= UnitQuaternion::from_scaled_axis(Vector3::new(0.2, 0.5, -0.4) * (1.0 + k as f64 * 0.2));
    }
    let target = |joint, goal| Target { joint, goal, weight: 0.7, chain: None };
    let targets = [
        target(4, Goal::Position { point: Point3::new(0.1, -0.3, 0.2), at: Point3::new(0.5, 0.9, -0.1) }),
        target(3, Goal::Orientation(UnitQuaternion::from_scaled_axis(Vector3::new(1.0, 0.3, 0.1)))),
        target(3, Goal::LookAt { axis: Vector3::y_axis(), at: Point3::new(2.0, 0.1, 0.3) }),
        target(4, Goal::Pole { root: 1, middle: 2, at: Point3::new(-1.0, 2.0, 0.5) }),
    ];
    let (options, pose_at) = (IkOptions::default(), pose.clone());
    let variables = Variables::of(&skeleton, &targets, &options, 1.0);
    let frames = Frames::chained(&skeleton, &pose);
    for each in &targets {
        let cost = |pose: &Pose| {
            let one = std::slice::from_ref(each);
            let of = Variables::of(&skeleton, one, &options, 1.0);
            Problem::new(&skeleton, one, &of, &frames, pose.clone(), 0.3).cost()
        };
        let one = std::slice::from_ref(each);
        let of = Variables::of(&skeleton, one, &options, 1.0);
        let mut problem = Problem::new(&skeleton, one, &of, &frames, pose.clone(), 0.3);
        let gradient = problem.gradient();
        for (k, motion) in of.motions.iter().enumerate() {
            let j = motion.joint();
            for axis in 0..3 {
                let moved = |by: f64| {
                    let mut pose = pose.clone();
                    let local = &mut pose.locals[j as usize];
                    motion.at(&skeleton, &pose_at).stepped(Vector3::ith(axis, by), 1.0, local);
                    pose
                };
                let difference = (cost(&moved(1e-5)) - cost(&moved(-1e-5))) / 2e-5;
                assert!(
                    (gradient[3 * k + axis] - difference).abs() < 1e-7,
                    "{each:?}, joint {j}, {axis}: {} {difference}",
                    gradient[3 * k + axis]
                );
            }
        }
    }
    assert_eq!(variables.motions, [0, 1, 2, 3, 4].map(variables::Motion::Rotation));
}

#[test]
fn the_solution_is_equivariant_under_motion_and_scale() {
    let lengths = [0.7, 0.5, 0.6];
    let skeleton = chain(&lengths, None);
    let world = Translation3::new(5.0, -3.0, 1.0) * UnitQuaternion::from_scaled_axis(Vector3::new(0.4, 1.0, -2.0));
    let mut joints = skeleton.joints().to_vec();
    for joint in &mut joints {
        joint.rest.translation *= 3.0;
    }
    joints[0].rest.translation = world.transform_point(&Point3::from(joints[0].rest.translation)).coords;
    joints[0].rest.rotation = world.rotation * joints[0].rest.rotation;
    let other = Skeleton::new(joints).expect("valid");
    for at in places(&skeleton, 1.8, 0.9) {
        let a =
            solve(&skeleton, &skeleton.rest_pose(), &[Target::position(3, at)], &IkOptions::default(), &Run::default())
                .expect("valid");
        let moved = world.transform_point(&(at * 3.0));
        let b =
            solve(&other, &other.rest_pose(), &[Target::position(3, moved)], &IkOptions::default(), &Run::default())
                .expect("valid");
        for (k, (a, b)) in a.pose.locals.iter().zip(&b.pose.locals).enumerate().skip(1) {
            assert!(a.rotation.angle_to(&b.rotation) < 1e-4, "joint {k}");
        }
    }
}

#[test]
fn locked_joints_and_joints_beyond_the_chain_do_not_move() {
    let skeleton = chain(&[0.7, 0.5, 0.6, 0.4], None);
    let rest = skeleton.rest_pose();
    let target = Target { chain: Some(3), ..Target::position(4, Point3::new(1.2, 0.9, 0.2)) };
    let options = IkOptions { locked: vec![2], ..Default::default() };
    let found = solve(&skeleton, &rest, &[target], &options, &Run::default()).expect("valid").pose;
    assert_eq!([0, 2].map(|j| found.locals[j]), [0, 2].map(|j| rest.locals[j]));
    assert!([1, 3].iter().all(|&j| found.locals[j] != rest.locals[j]));
}

#[test]
fn errors_name_the_target_and_the_value() {
    let skeleton = chain(&[1.0, 1.0], None);
    let told = |target: Target| {
        let e = solve(&skeleton, &skeleton.rest_pose(), &[target], &IkOptions::default(), &Run::default());
        e.expect_err("to be refused").to_string()
    };
    let at = Target::position(2, Point3::origin());
    assert_eq!(told(Target { joint: 7, ..at.clone() }), "target 0 names joint 7, but there are 3, numbered from 0");
    assert_eq!(told(Target::position(2, Point3::new(f64::NAN, 0.0, 0.0))), "target 0 is not finite");
    assert!(told(Target { weight: 0.0, ..at.clone() }).starts_with("the weight 0 of target 0 is invalid"));
    let pole = Goal::Pole { root: 1, middle: 0, at: Point3::origin() };
    assert!(told(Target { goal: pole, ..at }).starts_with("the joints of target 0 are not a chain"));
}

#[test]
fn methods_of_single_chains_meet_positions_and_refuse_other_goals() {
    let skeleton = chain(&[0.7, 0.5, 0.6], None);
    let rest = skeleton.rest_pose();
    let solve_by = |method, targets: &[Target], locked| {
        let options = IkOptions { method, locked, ..IkOptions::default() };
        solve(&skeleton, &rest, targets, &options, &Run::default())
    };
    let two = Target { chain: Some(2), ..Target::position(3, Point3::new(1.2, 0.4, 0.5)) };
    let pole = Goal::Pole { root: 1, middle: 2, at: Point3::new(0.9, -3.0, 0.2) };
    let toward = Target { goal: pole, ..two.clone() };
    for method in [IkMethod::Ccd, IkMethod::Fabrik, IkMethod::TwoBone] {
        let found = solve_by(method, std::slice::from_ref(&two), Vec::new()).expect("valid");
        assert!(found.residuals[0] < 1e-5 && found.converged, "{method:?}: {}", found.residuals[0]);
        assert_eq!(found.pose.locals[0], rest.locals[0], "{method:?}: beyond the chain");
        let turned = Target { goal: Goal::Orientation(UnitQuaternion::identity()), ..two.clone() };
        let refused = solve_by(method, &[turned], Vec::new()).expect_err("an orientation").to_string();
        assert!(refused.starts_with(&format!("target 0 is not for the method {}: ", method.name())), "{refused}");
        let locked = solve_by(method, std::slice::from_ref(&two), vec![2]).expect_err("locked").to_string();
        assert!(locked.contains("a joint of the chain is locked"), "{locked}");
    }
    let both = solve_by(IkMethod::TwoBone, &[two, toward], Vec::new()).expect("valid");
    assert!(both.residuals.iter().all(|residual| *residual < 1e-5), "{:?}", both.residuals);
}

fn person() -> Skeleton {
    crate::character::humanoid::humanoid(0.15).expect("made").skeleton
}

#[test]
fn the_root_stays_unless_a_target_is_on_it() {
    let skeleton = person();
    let (rest, named) = (skeleton.rest_pose(), |name: &str| skeleton.named(name).expect("there"));
    let (hips, hand) = (named("hips"), named("hand.L"));
    let frames = Frames::chained(&skeleton, &rest);
    let solved = |targets: &[Target], options: &IkOptions| {
        solve(&skeleton, &rest, targets, options, &Run::default()).expect("valid")
    };
    let forward = Target::position(hand, Point3::new(0.2, 1.0, 0.45));
    for method in [IkMethod::LeastSquares, IkMethod::Ccd, IkMethod::Fabrik] {
        let found = solved(std::slice::from_ref(&forward), &IkOptions { method, ..IkOptions::default() });
        assert_eq!(found.pose.locals[hips as usize], rest.locals[hips as usize], "{method:?}");
    }
    let rotates =
        solved(std::slice::from_ref(&forward), &IkOptions { root: RootMotion::Rotates, ..IkOptions::default() });
    assert!(rotates.pose.locals[hips as usize].rotation.angle() > 0.01);
    assert_eq!(rotates.pose.locals[hips as usize].translation, rest.locals[hips as usize].translation);
    // A crouch: the hips go down, and the knees bend over feet that stay.
    let mut targets = vec![Target::position(hips, frames.at(hips) + Vector3::new(0.02, -0.1, 0.0)), forward];
    for foot in ["foot.L", "foot.R"].map(named) {
        targets.push(Target::position(foot, frames.at(foot)));
        let goal = Goal::Orientation(frames.rotation[foot as usize]);
        targets.push(Target { goal, ..Target::position(foot, Point3::origin()) });
    }
    let found = solved(&targets, &IkOptions::default());
    assert!(found.residuals.iter().all(|r| *r < 1e-5), "{:?}", found.residuals);
    assert!(within(&skeleton, &found.pose));
    let knee = found.pose.locals[named("shin.L") as usize].rotation.angle();
    assert!(knee > 0.5, "the knee bends by {knee} rad");
}

#[test]
fn poses_of_a_person_within_the_limits_are_reached_within_them() {
    let skeleton = person();
    let sought =
        ["hand.L", "hand.R", "foot.L", "toes.R", "head end", "forearm.L"].map(|n| skeleton.named(n).expect("there"));
    let mut rng = fastrand::Rng::with_seed(7);
    let mut reached = 0;
    for _ in 0..200 {
        let mut pose = skeleton.rest_pose();
        for (joint, local) in skeleton.joints().iter().zip(&mut pose.locals) {
            let Some(limits) = joint.limits else { continue };
            let swing = nalgebra::Vector2::new(rng.f64() * 2.0 - 1.0, rng.f64() * 2.0 - 1.0) * limits.swing[0];
            let twist = limits.twist[0] + (limits.twist[1] - limits.twist[0]) * rng.f64();
            let at = limits.nearest(&crate::character::SwingTwist { swing, twist });
            local.rotation = joint.rest.rotation * limits.rotation(&at);
        }
        let at = Frames::chained(&skeleton, &pose);
        let targets = sought.map(|j| Target::position(j, at.at(j)));
        let found = solve(&skeleton, &skeleton.rest_pose(), &targets, &IkOptions::default(), &Run::default());
        let found = found.expect("valid");
        assert!(within(&skeleton, &found.pose));
        reached += usize::from(found.residuals.iter().all(|r| *r < 1e-5));
    }
    assert!(reached >= 196, "{reached} of 200");
}

#[test]
fn targets_beyond_the_bounds_are_refused() {
    let skeleton = chain(&[1.0, 1.0], None);
    let many = vec![Target::position(2, Point3::origin()); MAX_TARGETS + 1];
    let refused = solve(&skeleton, &skeleton.rest_pose(), &many, &IkOptions::default(), &Run::default());
    assert_eq!(refused.expect_err("too many").to_string(), "257 targets are too many (at most 256)");
    let long = chain(&vec![1.0; 5000], None);
    let many = vec![Target::position(5000, Point3::origin()); MAX_TARGETS];
    let refused = solve(&long, &long.rest_pose(), &many, &IkOptions::default(), &Run::default());
    assert!(refused.expect_err("too many").to_string().starts_with("256 targets move 1280256 joints in all"));
}
