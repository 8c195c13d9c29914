use nalgebra::{Matrix4, Point3, UnitQuaternion, Vector3};

use super::*;
use plumbline_num::math::Trs;

fn joint(name: &str, parent: Option<u32>, at: [f64; 3]) -> Joint {
    Joint { name: name.into(), parent, rest: Trs::from_translation(at.into()), limits: None }
}

fn message<T: std::fmt::Debug>(result: Result<T, CharacterError>) -> String {
    result.expect_err("refused").to_string()
}

#[test]
fn frames_chain_from_parents_in_any_joint_order() {
    let mut arm = vec![
        joint("hand", Some(2), [1.0, 0.0, 0.0]),
        joint("root", None, [5.0, 0.0, 0.0]),
        joint("elbow", Some(1), [2.0, 0.0, 0.0]),
    ];
    arm[2].rest.rotation = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), std::f64::consts::FRAC_PI_2);
    let skeleton = Skeleton::new(arm).expect("a tree");
    let at = skeleton.rest_positions();
    assert!((at[0] - Point3::new(7.0, 1.0, 0.0)).norm() < 1e-14);
    assert_eq!((skeleton.children(1), skeleton.children(2), skeleton.children(0)), (&[2][..], &[0][..], &[][..]));
    assert_eq!(skeleton.parents_first(), [1, 2, 0]);
    let bones = skeleton.bones();
    assert_eq!(bones.iter().map(|b| (b.joint, b.child)).collect::<Vec<_>>(), [(1, Some(2)), (2, Some(0))]);
    assert_eq!((bones[1].from, bones[1].to), (at[2], at[0]));
}

#[test]
fn a_forest_is_a_skeleton_and_a_lone_root_has_a_zero_length_bone() {
    let skeleton =
        Skeleton::new(vec![joint("a", None, [1.0, 0.0, 0.0]), joint("b", None, [2.0, 0.0, 0.0])]).expect("a forest");
    assert_eq!(skeleton.roots().collect::<Vec<_>>(), [0, 1]);
    assert!(skeleton.bones().iter().all(|b| b.child.is_none() && b.from == b.to));
}

#[test]
fn joints_that_are_no_forest_are_rejected_by_name() {
    let at = [0.0; 3];
    let ring = vec![
        joint("r", None, at),
        joint("a", Some(3), at),
        joint("b", Some(1), at),
        joint("c", Some(2), at),
        joint("d", Some(2), at),
    ];
    assert!(message(Skeleton::new(ring)).contains("a → c → b → a"));
    assert!(message(Skeleton::new(vec![])).contains("no joint"));
    assert!(message(Skeleton::new(vec![joint("a", Some(1), at)])).contains("joint \"a\" has the parent 1"));
    let twins = vec![joint("a", None, at), joint("b", None, at), joint("a", None, at)];
    assert!(message(Skeleton::new(twins)).contains("joints 0 and 2 are both named \"a\""));
    assert!(
        message(Skeleton::new(vec![joint("a", None, [f64::NAN, 0.0, 0.0])]))
            .contains("rest frame of joint \"a\" is not finite")
    );
}

#[test]
fn unknown_joints_are_reported_with_the_nearest_name() {
    let skeleton =
        Skeleton::new(vec![joint("l_wrist", None, [0.0; 3]), joint("skull", Some(0), [0.0; 3])]).expect("a tree");
    assert_eq!(skeleton.named("skull"), Ok(1));
    assert!(message(skeleton.named("l_wirst")).contains("did you mean \"l_wrist\"?"));
    assert_eq!(message(skeleton.named("qqqqqq")), "there is no joint \"qqqqqq\"");
}

#[test]
fn poses_must_fit_and_be_finite() {
    let skeleton = Skeleton::new(vec![joint("a", None, [0.0; 3])]).expect("a tree");
    assert!(message(skeleton.globals(&Pose::default())).contains("a pose of 0 joints"));
    let bad = Pose { locals: vec![Trs::from_translation(Vector3::repeat(f64::NAN))] };
    assert!(message(skeleton.globals(&bad)).contains("pose of joint \"a\" is not finite"));
}

#[test]
fn skin_matrices_at_rest_are_identities() {
    let mut joints = vec![joint("a", None, [1.0, 2.0, 3.0]), joint("b", Some(0), [0.0, 1.0, 0.0])];
    joints[0].rest.rotation = UnitQuaternion::from_euler_angles(1.0, 2.0, 3.0);
    joints[0].rest.scale = Vector3::new(1.0, 2.0, 0.5);
    let skeleton = Skeleton::new(joints.clone()).expect("a tree");
    let skin = Skin::bound(SkinWeights::rigid(2, &[0, 1]).expect("joints"), &skeleton).expect("not flat");
    for m in skin.joint_matrices(&skeleton.rest_globals()).expect("fits") {
        assert!((m - Matrix4::identity()).amax() < 1e-14);
    }
    joints[0].rest.scale.y = 0.0;
    let flat = Skeleton::new(joints).expect("a tree");
    assert!(message(Skin::bound(skin.weights().clone(), &flat)).contains("joint \"a\" has a scale of 0"));
}

#[test]
fn a_skin_needs_a_matrix_for_each_joint() {
    let weights = SkinWeights::rigid(3, &[0, 2]).expect("joints");
    assert!(
        message(Skin::new(weights.clone(), vec![Matrix4::identity(); 2]))
            .contains("weights for 3 joints but 2 matrices")
    );
    let mut matrices = vec![Matrix4::identity(); 3];
    matrices[1][(0, 0)] = f64::NAN;
    assert!(message(Skin::new(weights.clone(), matrices)).contains("matrix of joint 1 is not finite"));
    let mut matrices = vec![Matrix4::identity(); 3];
    matrices[2][(3, 0)] = 1.0;
    assert!(message(Skin::new(weights, matrices)).contains("matrix of joint 2 is projective"));
}

#[test]
fn weights_are_stored_sorted_merged_and_without_zeros() {
    let rows = [vec![(3, 0.25), (1, 0.5), (0, 0.0), (3, 0.25)], vec![(2, 1.0)]];
    let weights = SkinWeights::new(4, rows).expect("sums are 1");
    assert_eq!(weights.row(0), [Influence { joint: 1, weight: 0.5 }, Influence { joint: 3, weight: 0.5 }]);
    assert_eq!((weights.weight(0, 3), weights.weight(0, 0), weights.most_influences()), (0.5, 0.0, 2));
}

#[test]
fn weights_that_are_no_partition_are_rejected_or_normalized() {
    let new = |rows: Vec<Vec<(u32, f64)>>| SkinWeights::new(2, rows);
    assert!(message(new(vec![vec![(0, 1.0)], vec![(0, 0.5), (1, 0.4)]])).contains("vertex 1 sum to 0.9"));
    assert!(message(new(vec![vec![(0, 1.5), (1, -0.5)]])).contains("weight -0.5 of vertex 0 for joint 1"));
    assert!(message(new(vec![vec![(1, f64::NAN)]])).contains("weight NaN"));
    assert!(message(new(vec![vec![(2, 1.0)]])).contains("follows joint 2, but the skin has 2"));
    assert!(
        message(new(vec![vec![(0, 1.0)], vec![], vec![(1, 0.0)]]))
            .contains("2 vertices have no weight, the first is vertex 1")
    );

    let rows = vec![vec![(0, 3.0), (1, 1.0)], vec![], vec![(1, 1.0)]];
    assert!(SkinWeights::normalized(2, rows.clone(), None).is_err());
    let (weights, report) = SkinWeights::normalized(2, rows, Some(1)).expect("normalized");
    assert_eq!((weights.weight(0, 0), weights.weight(1, 1)), (0.75, 1.0));
    assert_eq!(report, Normalization { changed: 1, max_deviation: 3.0, weightless: 1 });
}

#[test]
fn limited_weights_are_continuous_where_influences_change_rank() {
    let limited = |second: f64| {
        let row = vec![(0, 0.5), (1, second), (2, 0.5 - second)];
        SkinWeights::new(3, [row]).and_then(|w| w.limited(2)).expect("sums are 1")
    };
    let steps: Vec<SkinWeights> = (0..=1000).map(|k| limited(0.15 + 1e-4 * f64::from(k))).collect();
    for joint in 0..3 {
        let jump = |pair: &[SkinWeights]| (pair[0].weight(0, joint) - pair[1].weight(0, joint)).abs();
        assert!(steps.windows(2).map(jump).fold(0.0, f64::max) < 1e-3, "joint {joint}");
    }
    let even =
        SkinWeights::new(3, [[0, 1, 2].map(|j| (j, 1.0 / 3.0)).to_vec()]).and_then(|w| w.limited(2)).expect("two");
    assert_eq!(even.row(0).len(), 2, "where none leads, as many as there may be");
}

#[test]
fn pruning_and_limits_keep_the_strongest_and_the_sum() {
    let row = vec![(0, 0.5), (1, 0.3), (2, 0.1504), (3, 0.0496)];
    let weights = SkinWeights::new(5, [row, vec![(4, 1.0)]]).expect("sums are 1");
    let limited = weights.limited(2).expect("two");
    assert_eq!(limited.row(0).iter().map(|i| i.joint).collect::<Vec<_>>(), [0, 1]);
    let second = 0.3 * (0.3 / 0.1504 - 1.0);
    assert!((limited.weight(0, 0) - 0.5 / (0.5 + second)).abs() < 1e-15);
    let pruned = weights.pruned(0.05).expect("in range");
    assert_eq!((pruned.row(0).len(), pruned.row(1).len()), (3, 1));
    assert!(pruned.sums().all(|s| (s - 1.0).abs() < 1e-15));
    assert_eq!(weights.pruned(0.99).expect("in range").row(0), [Influence { joint: 0, weight: 1.0 }]);
    assert!(message(weights.limited(0)).contains("influences 0"));
    assert!(message(weights.pruned(1.0)).contains("min_weight 1"));
}
