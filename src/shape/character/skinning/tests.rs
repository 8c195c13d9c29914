use std::f64::consts::{FRAC_PI_2, PI};

use nalgebra::{Matrix4, Point3, Rotation3, UnitQuaternion, Vector3};

use super::super::{CharacterError, Joint, Pose, Skeleton, Skin, SkinWeights};
use super::*;
use crate::mesh::TriMesh;
use plumbline_num::math::Trs;
use plumbline_num::run::Run;

pub(super) const METHODS: [SkinningMethod; 4] = [
    SkinningMethod::LinearBlend,
    SkinningMethod::DualQuaternion,
    SkinningMethod::CentersOfRotation,
    SkinningMethod::TwistSwing,
];

/// Length of each bone of the tube.
const BONE: f64 = 3.0;

/// An open tube of radius 1 along x with joints at 0, 3, 6 …, and weights that blend smoothly between bones.
pub(in super::super) fn tube(joints: usize, around: usize, along: usize) -> (TriMesh, Skeleton, Skin) {
    let length = BONE * joints as f64;
    let mut positions = Vec::new();
    for i in 0..=along {
        let x = length * i as f64 / along as f64;
        positions.extend((0..around).map(|k| {
            let (s, c) = (2.0 * PI * k as f64 / around as f64).sin_cos();
            Point3::new(x, c, s)
        }));
    }
    let (a, mut triangles) = (around as u32, Vec::new());
    for i in 0..along as u32 {
        for k in 0..a {
            let (p, q) = (i * a + k, i * a + (k + 1) % a);
            triangles.extend([[p, q, q + a], [p, q + a, p + a]]);
        }
    }
    let mesh = TriMesh::new(positions, triangles).expect("valid");
    let joint = |j: usize| Joint {
        name: format!("j{j}"),
        parent: j.checked_sub(1).map(|p| p as u32),
        rest: Trs::from_translation(Vector3::new(if j == 0 { 0.0 } else { BONE }, 0.0, 0.0)),
        limits: None,
    };
    let skeleton = Skeleton::new((0..joints).map(joint).collect()).expect("a chain");
    let row = |p: &Point3<f64>| -> Vec<(u32, f64)> {
        // A smoothstep over two units around each joint.
        let step = |j: usize| {
            let t = (0.5 * (p.x - BONE * j as f64 + 1.0)).clamp(0.0, 1.0);
            if j == 0 { 1.0 } else { t * t * (3.0 - 2.0 * t) }
        };
        let weight = |j: usize| step(j) - if j + 1 < joints { step(j + 1) } else { 0.0 };
        (0..joints).map(|j| (j as u32, weight(j))).collect()
    };
    let weights = SkinWeights::new(joints, mesh.positions().iter().map(row)).expect("a partition");
    let skin = Skin::bound(weights, &skeleton).expect("not flat");
    (mesh, skeleton, skin)
}

pub(in super::super) fn matrices(skeleton: &Skeleton, skin: &Skin, change: impl Fn(&mut Pose)) -> Vec<Matrix4<f64>> {
    let mut pose = skeleton.rest_pose();
    change(&mut pose);
    skin.joint_matrices(&skeleton.globals(&pose).expect("fits")).expect("fits")
}

pub(in super::super) fn turn(axis: [f64; 3], angle: f64) -> UnitQuaternion<f64> {
    UnitQuaternion::new(Vector3::from(axis).normalize() * angle)
}

fn skinner(tube: &(TriMesh, Skeleton, Skin), method: SkinningMethod) -> Skinner {
    Skinner::new(&tube.0, None, &tube.1, &tube.2, method, &Run::default()).expect("fits")
}

#[test]
fn at_rest_nothing_moves_and_normals_are_unchanged() {
    let tube = tube(3, 12, 24);
    for method in METHODS {
        let skinned = skinner(&tube, method).skin(&matrices(&tube.1, &tube.2, |_| ())).expect("fits");
        for (v, (p, n)) in skinned.positions.iter().zip(&skinned.normals).enumerate() {
            assert!((p - tube.0.positions()[v]).norm() < 1e-14, "{method:?}");
            assert!((n - tube.0.vertex_normals()[v]).norm() < 1e-12, "{method:?}");
        }
    }
}

#[test]
fn a_rigid_motion_of_all_joints_moves_the_surface_rigidly_at_any_position() {
    let tube = tube(3, 12, 24);
    let (rotation, shift) = (turn([1.0, -2.0, 0.5], 2.9), Vector3::new(1e3, -20.0, 3.0));
    for method in METHODS {
        let posed = skinner(&tube, method);
        let bent = |p: &mut Pose| {
            p.locals[1].rotation = turn([0.3, 1.0, 0.2], 1.9);
            p.locals[2].rotation = turn([1.0, 0.1, 0.0], -2.0);
        };
        let here = matrices(&tube.1, &tube.2, bent);
        let motion = Trs::rigid(rotation, shift).matrix();
        let there: Vec<_> = here.iter().map(|m| motion * m).collect();
        let (here, there) = (posed.skin(&here).expect("fits"), posed.skin(&there).expect("fits"));
        for v in 0..tube.0.vertex_count() {
            let expected = rotation * here.positions[v] + shift;
            assert!((there.positions[v] - expected).norm() < 1e-11, "{method:?}");
            assert!((there.normals[v] - rotation * here.normals[v]).norm() < 1e-10, "{method:?}");
            assert!((here.normals[v].norm() - 1.0).abs() < 1e-14);
        }
    }
}

#[test]
fn one_bone_moves_scales_and_shears_its_surface_exactly_and_normals_by_the_inverse_transpose() {
    let tube = tube(1, 12, 8);
    let stretch = Trs { scale: Vector3::new(2.0, 0.5, 1.5), ..Trs::rigid(turn([1.0, 2.0, 3.0], 1.0), Vector3::z()) };
    let shear = stretch.matrix()
        * Trs { scale: Vector3::new(1.0, 3.0, 1.0), ..Trs::rigid(turn([0.0, 1.0, 1.0], 0.6), Vector3::y()) }.matrix();
    for method in METHODS {
        for m in [stretch.matrix(), shear] {
            let skinned = skinner(&tube, method).skin(&[m]).expect("fits");
            let by = m.fixed_view::<3, 3>(0, 0).try_inverse().expect("regular").transpose();
            for (v, p) in tube.0.positions().iter().enumerate() {
                assert!((skinned.positions[v] - m.transform_point(p)).norm() < 1e-12, "{method:?}");
                let normal = (by * tube.0.vertex_normals()[v]).normalize();
                assert!((skinned.normals[v] - normal).norm() < 1e-12, "{method:?}");
            }
        }
    }
}

/// Radius of the ring midway between the bones, for a joint twisted by `angle`.
fn waist(method: SkinningMethod, angle: f64) -> f64 {
    let tube = tube(2, 16, 60);
    let m = matrices(&tube.1, &tube.2, |p| p.locals[1].rotation = turn([1.0, 0.0, 0.0], angle));
    let x = skinner(&tube, method).positions(&m).expect("fits");
    let middle = |p: &&Point3<f64>| (p.x - BONE).abs() < 1e-9;
    x.iter().filter(middle).map(|p| p.y.hypot(p.z)).fold(f64::INFINITY, f64::min)
}

#[test]
fn a_twist_narrows_linear_blends_by_the_cosine_of_half_its_angle_and_the_others_not_at_all() {
    for angle in [0.5, FRAC_PI_2, 2.5, PI - 1e-9, PI] {
        assert!((waist(SkinningMethod::LinearBlend, angle) - (angle / 2.0).cos().abs()).abs() < 1e-12);
        for method in [SkinningMethod::DualQuaternion, SkinningMethod::TwistSwing, SkinningMethod::CentersOfRotation] {
            assert!((waist(method, angle) - 1.0).abs() < 1e-3, "{method:?} {angle} {}", waist(method, angle));
        }
    }
}

#[test]
fn twist_swing_is_linear_for_a_swing_and_dual_for_a_twist() {
    use SkinningMethod::{DualQuaternion, LinearBlend, TwistSwing};
    let tube = tube(2, 16, 30);
    let positions = |method, rotation| {
        let m = matrices(&tube.1, &tube.2, |p| p.locals[1].rotation = rotation);
        skinner(&tube, method).positions(&m).expect("fits")
    };
    let farthest =
        |a: Vec<Point3<f64>>, b: Vec<Point3<f64>>| a.iter().zip(&b).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
    let (swing, twist) = (turn([0.0, 0.3, 1.0], 1.5), turn([1.0, 0.0, 0.0], 1.5));
    assert!(farthest(positions(TwistSwing, swing), positions(LinearBlend, swing)) < 1e-12);
    assert!(farthest(positions(TwistSwing, twist), positions(DualQuaternion, twist)) < 1e-12);
    assert!(farthest(positions(LinearBlend, swing), positions(DualQuaternion, swing)) > 0.1);
}

#[test]
fn normals_are_those_of_the_deformed_surface() {
    // The second derivative of the weights jumps: normals from triangles err by the triangle size, and the difference may, too.
    let change = |p: &mut Pose| {
        p.locals[0].scale = Vector3::new(1.2, 1.0, 0.8);
        // Below the angle at which the inside of a bend folds, where no normal exists.
        p.locals[1].rotation = turn([0.8, 0.4, 0.4], 0.9);
        p.locals[2].rotation = turn([1.0, 0.2, 0.3], 1.1);
        p.locals[2].scale = Vector3::new(1.3, 0.9, 1.0);
    };
    for method in METHODS {
        let farthest = [(24, 54), (48, 108), (96, 216)].map(|(around, along)| {
            let tube = tube(3, around, along);
            let skinned = skinner(&tube, method).skin(&matrices(&tube.1, &tube.2, change)).expect("fits");
            let bent = tube.0.with_positions(skinned.positions).expect("finite").vertex_normals();
            // Away from the open ends, where triangles lie on one side only.
            let inner = (2 * around)..(bent.len() - 2 * around);
            inner.map(|v| (bent[v] - skinned.normals[v]).norm()).fold(0.0, f64::max)
        });
        assert!(farthest[2] < 0.02, "{method:?} {farthest:?}");
        assert!(farthest[0] / farthest[2] > 3.0, "{method:?} {farthest:?}");
    }
}

#[test]
fn signs_of_quaternions_do_not_matter() {
    // Rotations by θ and by θ − 2π are the same matrix, but their quaternion paths differ.
    let tube = tube(3, 12, 24);
    for method in METHODS {
        let posed = |angle: f64| {
            let m = matrices(&tube.1, &tube.2, |p| {
                p.locals[1].rotation = turn([1.0, 0.0, 0.2], angle);
                p.locals[2].rotation = turn([1.0, 0.3, 0.0], 2.0);
            });
            skinner(&tube, method).positions(&m).expect("fits")
        };
        for (a, b) in posed(3.5).iter().zip(posed(3.5 - 2.0 * PI)) {
            assert!((a - b).norm() < 1e-12, "{method:?}");
        }
    }
}

#[test]
fn scales_are_about_the_joint_so_that_the_position_of_the_model_does_not_matter() {
    let (mesh, skeleton, skin) = tube(2, 12, 24);
    let at = Vector3::new(100.0, -50.0, 30.0);
    let mut joints = skeleton.joints().to_vec();
    joints[0].rest.translation += at;
    let skeleton_there = Skeleton::new(joints).expect("a chain");
    let mesh_there = mesh.with_positions(mesh.positions().iter().map(|p| p + at).collect()).expect("finite");
    let skin_there = Skin::bound(skin.weights().clone(), &skeleton_there).expect("not flat");
    let change = |p: &mut Pose| {
        p.locals[1].scale = Vector3::new(1.5, 2.0, 0.7);
        p.locals[1].rotation = turn([0.1, 1.0, 0.4], 1.3);
    };
    for method in METHODS {
        let here = Skinner::new(&mesh, None, &skeleton, &skin, method, &Run::default()).expect("fits");
        let there =
            Skinner::new(&mesh_there, None, &skeleton_there, &skin_there, method, &Run::default()).expect("fits");
        let here = here.positions(&matrices(&skeleton, &skin, change)).expect("fits");
        let there = there.positions(&matrices(&skeleton_there, &skin_there, change)).expect("fits");
        for (a, b) in here.iter().zip(&there) {
            assert!((b - a - at).norm() < 1e-10, "{method:?}");
        }
    }
}

#[test]
fn single_precision_rounding_of_a_motion_does_not_scale_the_surface() {
    let tube = tube(1, 12, 8);
    let motion = Trs::rigid(turn([0.3, -1.0, 0.7], 2.1), Vector3::new(3.0, 0.1, -0.7)).matrix();
    // The rounding of a chain of joints.
    let stored = motion.map(|x| f64::from(x as f32)) * Matrix4::new_scaling(1.0 + 1e-6);
    let x = skinner(&tube, SkinningMethod::DualQuaternion).positions(&[stored]).expect("fits");
    for (p, q) in x.iter().zip(tube.0.positions()) {
        let (there, here) = ((p - x[0]).norm(), (q - tube.0.positions()[0]).norm());
        assert!((there - here).abs() < 1e-12, "{there} {here}");
    }
}

#[test]
fn a_bend_bulges_with_dual_quaternions_and_less_so_about_centers() {
    let tube = tube(2, 32, 60);
    let m = matrices(&tube.1, &tube.2, |p| p.locals[1].rotation = turn([0.0, 0.0, 1.0], FRAC_PI_2));
    // Inside and outside of the elbow: distance from the joint, 1 at rest.
    let outer = |method| {
        let x = skinner(&tube, method).positions(&m).expect("fits");
        let elbow = x.iter().map(|p| (p - Point3::new(BONE, 0.0, 0.0)).norm());
        let outside = |(v, _): &(usize, f64)| {
            let p = tube.0.positions()[*v];
            (p.x - BONE).abs() < 1e-9 && p.y < -0.99
        };
        elbow.enumerate().find(outside).expect("there").1
    };
    let (linear, dual) = (outer(SkinningMethod::LinearBlend), outer(SkinningMethod::DualQuaternion));
    assert!((linear - (PI / 4.0).cos()).abs() < 1e-12 && (dual - 1.0).abs() < 1e-12, "{linear} {dual}");
}

#[test]
fn mismatched_inputs_are_rejected_by_name() {
    let (mesh, skeleton, skin) = tube(2, 6, 4);
    let message = |e: CharacterError| e.to_string();
    let posed = Skinner::new(&mesh, None, &skeleton, &skin, SkinningMethod::default(), &Run::default()).expect("fits");
    assert!(message(posed.positions(&[Matrix4::identity()]).expect_err("one")).contains("2 joints but 1 matrices"));
    let nan = Matrix4::repeat(f64::NAN);
    assert!(message(posed.positions(&[nan, nan]).expect_err("NaN")).contains("matrix of joint 0 is not finite"));
    let (other, chain, _) = tube(3, 6, 5);
    let refused = Skinner::new(&other, None, &skeleton, &skin, SkinningMethod::default(), &Run::default())
        .expect_err("other mesh");
    assert!(message(refused).contains("rows of weights do not fit a mesh of 36 vertices"));
    let refused =
        Skinner::new(&mesh, None, &chain, &skin, SkinningMethod::default(), &Run::default()).expect_err("other chain");
    assert!(message(refused).contains("weights for 3 joints but 2 matrices"));
    let refused = Skinner::new(&mesh, Some(&[]), &skeleton, &skin, SkinningMethod::default(), &Run::default())
        .expect_err("no normals");
    assert!(message(refused).contains("0 normals do not fit"));
}

#[test]
fn a_mirrored_joint_keeps_the_orientation_of_its_surface() {
    let tube = tube(1, 12, 8);
    let mirror = Rotation3::new(Vector3::new(0.1, 0.2, 0.3)).to_homogeneous()
        * Matrix4::new_nonuniform_scaling(&Vector3::new(-1.0, 1.0, 1.0));
    for method in METHODS {
        let skinned = skinner(&tube, method).skin(&[mirror]).expect("fits");
        let normals = tube.0.with_positions(skinned.positions).expect("finite").vertex_normals();
        for (a, b) in normals.iter().zip(&skinned.normals) {
            assert!((a - b).norm() < 1e-12, "{method:?}");
        }
    }
}
