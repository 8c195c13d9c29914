use super::super::tests::arm;
use super::super::{Example, RegressionOptions};
use super::*;
use crate::character::Joint;
use plumbline_num::run::Run;

/// A model of each form, with its mesh and skeleton.
fn trained() -> (TriMesh, Skeleton, Vec<Example>, RegressionModel, Reduced) {
    let (mesh, skeleton, skin, example) = arm(8, 12);
    let train: Vec<Example> = (0..5).map(|k| example(0.3 * f64::from(k), 0.2 * f64::from((3 * k) % 5))).collect();
    let options = RegressionOptions::default();
    let (model, _) =
        RegressionModel::train(&mesh, &skeleton, skin.weights(), &train, &options, &Run::default()).expect("trained");
    let samples: Vec<_> = train.iter().map(|e| e.matrices.clone()).collect();
    let reduced = model.reduced(&samples, 3, &Run::default()).expect("of the same joints");
    (mesh, skeleton, train, model, reduced)
}

fn files() -> (TriMesh, Skeleton, [SkinModel; 2]) {
    let (mesh, skeleton, _, model, reduced) = trained();
    let full = SkinModel::of(&mesh, &skeleton, &model).expect("its own");
    let few = SkinModel::of_reduced(&mesh, &skeleton, &reduced).expect("its own");
    (mesh, skeleton, [full, few])
}

#[test]
fn a_round_trip_is_bit_exact_and_poses_as_the_model() {
    let (mesh, skeleton, examples, mut model, reduced) = trained();
    let full = SkinModel::of(&mesh, &skeleton, &model).expect("its own");
    let few = SkinModel::of_reduced(&mesh, &skeleton, &reduced).expect("its own");
    for file in [&full, &few] {
        let again = SkinModel::from_bytes(&file.to_bytes()).expect("own files are read");
        assert_eq!(&again, file);
        assert_eq!(again.to_bytes(), file.to_bytes());
        let mut bound = again.bound(&mesh, &skeleton, &Run::default()).expect("its own");
        for example in &examples {
            let m = &example.matrices;
            let before = if file.is_reduced() { reduced.positions(m) } else { model.positions(m) };
            assert_eq!(bound.positions(m).expect("fits"), before.expect("fits"));
        }
    }
}

#[test]
fn a_truncated_file_is_rejected_with_the_position() {
    let (.., files) = files();
    for file in &files {
        let bytes = file.to_bytes();
        for end in 0..bytes.len() {
            let message = SkinModel::from_bytes(&bytes[..end]).expect_err("cut short").to_string();
            if end < MAGIC.len() {
                assert!(message.starts_with("not a trained skin"), "cut at {end}: {message}");
            } else {
                let missing =
                    message.split_once("at least ").and_then(|(_, rest)| rest.split(' ').next()?.parse().ok());
                assert!(missing.is_some_and(|missing: usize| missing <= bytes.len() - end), "cut at {end}: {message}");
            }
        }
        let message = SkinModel::from_bytes(&[&bytes[..], b"xyz"].concat()).expect_err("longer").to_string();
        assert!(message.contains("3 bytes follow the end"), "{message}");
    }
}

/// Offsets of the numbers in the header.
const VERSION: usize = 16;
const FORM: usize = 20;
const VERTICES: usize = 24;
const TRIANGLES: usize = 32;
const HOLD: usize = 48;
const JOINTS: usize = 56;
const FIRST_NAME: usize = 64;

#[test]
fn hostile_numbers_are_rejected_before_allocation() {
    let (.., [full, few]) = files();
    let (name, weights) = (full.joints[0].len(), FIRST_NAME + full.joints.iter().map(|n| n.len() + 8).sum::<usize>());
    let after = weights + full.weights.rows().map(|r| 4 + 12 * r.len()).sum::<usize>();
    let (most, many) = (u64::MAX.to_le_bytes(), u32::MAX.to_le_bytes());
    let (nan, zero) = (f64::NAN.to_le_bytes(), 0_u64.to_le_bytes());
    let cases: &[(&SkinModel, usize, &[u8], &str)] = &[
        (&full, 0, b"P", "not a trained skin"),
        (&full, VERSION, &[7], "version 7"),
        (&full, FORM, &[2], "the form is 2 (expected 0 to 1)"),
        (&full, VERTICES, &most, "ends within the weights"),
        (&full, TRIANGLES, &most, "ends within the triangles"),
        (&full, HOLD, &nan, "the hold is NaN"),
        (&full, HOLD, &zero, "the hold is 0 (expected above 0)"),
        (&full, JOINTS, &most, "ends within the joints"),
        (&full, JOINTS, &zero, "the number of joints is 0"),
        (&full, FIRST_NAME, &many, "ends within the name of joint 0"),
        (&full, FIRST_NAME + 4, &[0xff], "the name of joint 0 is invalid utf-8"),
        (&full, FIRST_NAME + 4 + name, &[9, 0, 0, 0], "the parent of joint 0 is 9 (expected 0 to 1"),
        (&full, weights, &many, "the weights of vertex 0 is 4294967295 (expected 0 to 2)"),
        (&full, weights + 4, &[5], "the weights of vertex 0 is 5 (expected 0 to 1)"),
        (&full, weights + 8, &nan, "the weights of vertex 0 is NaN"),
        (&full, weights + 8, &0.25_f64.to_le_bytes(), "the weights of vertex 0 sum to"),
        (&full, after, &[3], "the regressor of triangle 0 is 3 (expected 0 to 1)"),
        (&full, after + 8, &nan, "the regressor of triangle 0 is NaN"),
        (&few, after, &most, "ends within the groups"),
        (&few, after + 8, &[4], "group 0 is 4 (expected 0 to 1)"),
        (&few, after + 16, &[9], "the number of key triangles of group 0 is 9 (expected 0 to 8)"),
        (&few, after + 20, &many, "the number of shapes of group 0 is 4294967295"),
        (&few, after + 24, &nan, "group 0 is NaN"),
        (&few, few.to_bytes().len() - 4, &f32::NAN.to_le_bytes(), "the maps of triangle"),
    ];
    for (file, at, patch, expected) in cases {
        let mut bytes = file.to_bytes();
        bytes[*at..*at + patch.len()].copy_from_slice(patch);
        let message = SkinModel::from_bytes(&bytes).expect_err(expected).to_string();
        assert!(message.contains(expected), "{expected}: {message}");
    }
}

#[test]
fn a_model_is_rejected_for_another_mesh_or_skeleton_and_matches_joints_by_name() {
    let (mesh, skeleton, [full, _]) = files();
    let told = |mesh: &TriMesh, skeleton: &Skeleton| {
        full.bound(mesh, skeleton, &Run::default()).expect_err("refused").to_string()
    };
    let (other, ..) = arm(6, 6);
    assert!(told(&other, &skeleton).contains("the mesh has"));
    let mut triangles = mesh.triangles().to_vec();
    triangles[0].rotate_left(1);
    let turned = TriMesh::new(mesh.positions().to_vec(), triangles).expect("the same vertices");
    assert!(told(&turned, &skeleton).contains("differ from those of the training mesh"));
    let joints = |change: &dyn Fn(&mut Vec<Joint>)| {
        let mut joints = skeleton.joints().to_vec();
        change(&mut joints);
        Skeleton::new(joints).expect("a forest")
    };
    let name = skeleton.joints()[1].name.clone();
    assert!(told(&mesh, &joints(&|j| j[1].name = format!("{name}x"))).contains(&format!("no joint {name:?}")));
    assert!(told(&mesh, &joints(&|j| j[1].parent = None)).contains("and none in the skeleton"));
    // In reverse order: the same pose.
    let swapped = joints(&|j| {
        j.swap(0, 1);
        j[0].parent = Some(1);
    });
    let pose = |turned: usize| {
        let mut m = vec![Matrix4::identity(); 2];
        m[turned] = nalgebra::Rotation3::from_axis_angle(&nalgebra::Vector3::z_axis(), 0.4).to_homogeneous();
        m
    };
    let here = full.bound(&mesh, &skeleton, &Run::default()).expect("its own").positions(&pose(1)).expect("fits");
    let there =
        full.bound(&mesh, &swapped, &Run::default()).expect("the same joints").positions(&pose(0)).expect("fits");
    assert_eq!(here, there);
}
