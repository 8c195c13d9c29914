use nalgebra::{Point3, Unit, Vector3};

use super::super::skinning::tests::tube;
use super::super::{Joint, Skeleton};
use super::*;
use plumbline_num::math::Trs;
use plumbline_num::run::Run;

const METHODS: [WeightMethod; 3] = [WeightMethod::Heat, WeightMethod::BoundedBiharmonic, WeightMethod::Distance];

fn options(method: WeightMethod) -> WeightOptions {
    WeightOptions { method, ..Default::default() }
}

fn chain(points: &[[f64; 3]]) -> Skeleton {
    let joint = |(j, p): (usize, &[f64; 3])| {
        let from = if j == 0 { [0.0; 3] } else { points[j - 1] };
        let at = Vector3::from(*p) - Vector3::from(from);
        Joint {
            name: format!("j{j}"),
            parent: j.checked_sub(1).map(|p| p as u32),
            rest: Trs::from_translation(at),
            limits: None,
        }
    };
    Skeleton::new(points.iter().enumerate().map(joint).collect()).expect("a chain")
}

/// A tube of radius ½ along x from 0 to 9, and a chain of bones in it: 0 to 3, to 6, to 9.
fn limb() -> (TriMesh, Skeleton) {
    let (mesh, _, _) = tube(3, 24, 54);
    let thin = mesh.positions().iter().map(|p| Point3::new(p.x, 0.5 * p.y, 0.5 * p.z)).collect();
    let mesh = mesh.with_positions(thin).expect("finite");
    (mesh, chain(&[[0.0, 0.0, 0.0], [3.0, 0.0, 0.0], [6.0, 0.0, 0.0], [9.0, 0.0, 0.0]]))
}

#[test]
fn weights_are_a_partition_that_follows_the_bones() {
    let (mesh, skeleton) = limb();
    for method in METHODS {
        let (weights, report) = bone_weights(&mesh, &skeleton, &options(method), &Run::default()).expect("found");
        assert!(weights.sums().all(|s| (s - 1.0).abs() < 1e-12) && weights.most_influences() <= 4);
        assert!(weights.rows().flatten().all(|i| i.weight > 0.0 && i.weight <= 1.0 + 1e-12));
        assert_eq!((report.borrowed_vertices, report.by_distance), (0, false));
        for (v, p) in mesh.positions().iter().enumerate() {
            // The vertex nearest to the middle of a bone follows it; a leaf joint has no bone.
            let bone = (p.x / 3.0).min(2.9).floor() as u32;
            if (p.x - 3.0 * f64::from(bone) - 1.5).abs() < 0.2 {
                assert!(weights.weight(v, bone) > 0.9, "{method:?} at {}: {:?}", p.x, weights.row(v));
            }
            assert_eq!(weights.weight(v, 3), 0.0);
        }
    }
}

#[test]
fn a_symmetric_rig_gives_symmetric_weights() {
    let (mesh, skeleton) = limb();
    for method in METHODS {
        let all = WeightOptions { influences: 8, min_weight: 0.0, ..options(method) };
        let (weights, _) = bone_weights(&mesh, &skeleton, &all, &Run::default()).expect("found");
        let rings = mesh.vertex_count() / 24;
        for v in 0..mesh.vertex_count() {
            // The ring at the other end, and the other bone; turned over in y, so that diagonals fall on diagonals.
            let image = (rings - 1 - v / 24) * 24 + (24 - v % 24) % 24;
            for j in 0..3 {
                let apart = weights.weight(v, j) - weights.weight(image, 2 - j);
                assert!(
                    apart.abs() < if method == WeightMethod::BoundedBiharmonic { 1e-3 } else { 1e-9 },
                    "{method:?} {v} {apart:e}"
                );
            }
        }
    }
}

#[test]
fn occluded_bones_do_not_heat_the_surface() {
    // Two tubes side by side, closer to each other's bones at their walls than to their own.
    let (one, _, _) = tube(1, 24, 30);
    let mut positions = one.positions().to_vec();
    positions.extend(one.positions().iter().map(|p| p + Vector3::new(0.0, 2.1, 0.0)));
    let n = one.vertex_count() as u32;
    let mut triangles = one.triangles().to_vec();
    triangles.extend(one.triangles().iter().map(|t| t.map(|v| v + n)));
    let mesh = TriMesh::new(positions, triangles).expect("valid");
    let joint = |name: &str, parent, at: [f64; 3]| Joint {
        name: name.into(),
        parent,
        rest: Trs::from_translation(at.into()),
        limits: None,
    };
    // The first bone lies off the middle, nearer to the wall of the second tube than that tube's own bone.
    let skeleton = Skeleton::new(vec![
        joint("a", None, [0.0, 0.8, 0.0]),
        joint("a end", Some(0), [3.0, 0.0, 0.0]),
        joint("b", None, [0.0, 2.1, 0.0]),
        joint("b end", Some(2), [3.0, 0.0, 0.0]),
    ])
    .expect("a forest");
    let (heat, _) = bone_weights(&mesh, &skeleton, &options(WeightMethod::Heat), &Run::default()).expect("found");
    assert!(
        (0..n as usize).all(|v| heat.weight(v, 0) > 0.999)
            && (n as usize..2 * n as usize).all(|v| heat.weight(v, 2) > 0.999)
    );
    let (near, _) = bone_weights(&mesh, &skeleton, &options(WeightMethod::Distance), &Run::default()).expect("found");
    assert!((n as usize..2 * n as usize).any(|v| near.weight(v, 0) > 0.5), "by distance it leaks");
}

#[test]
fn components_that_see_no_bone_copy_weights_and_change_nothing_else() {
    let (mesh, skeleton) = limb();
    for method in [WeightMethod::Heat, WeightMethod::BoundedBiharmonic] {
        let (alone, _) = bone_weights(&mesh, &skeleton, &options(method), &Run::default()).expect("found");
        let mut positions = mesh.positions().to_vec();
        let n = positions.len() as u32;
        // A closed speck outside, and an isolated vertex; both within the bounding box of the tube, whose size rounding depends on.
        let speck = [[4.0, 0.42, 0.42], [4.05, 0.42, 0.42], [4.0, 0.47, 0.42], [4.0, 0.42, 0.47], [8.5, 0.4, 0.4]];
        positions.extend(speck.map(Point3::from));
        let mut triangles = mesh.triangles().to_vec();
        triangles.extend([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]].map(|t| t.map(|v| v + n)));
        let with = TriMesh::new(positions, triangles).expect("valid");
        let (weights, report) = bone_weights(&with, &skeleton, &options(method), &Run::default()).expect("found");
        assert_eq!((report.components, report.borrowed_components, report.borrowed_vertices), (2, 2, 5), "{method:?}");
        for v in 0..n as usize {
            for i in alone.row(v) {
                assert!((weights.weight(v, i.joint) - i.weight).abs() < 1e-9, "{method:?}");
            }
        }
        assert!(weights.weight(n as usize, 1) > 0.9 && weights.weight(n as usize + 4, 2) > 0.9);
    }
}

#[test]
fn duplicates_of_a_vertex_share_its_weights() {
    let (mesh, skeleton) = limb();
    let (whole, _) = bone_weights(&mesh, &skeleton, &options(WeightMethod::Heat), &Run::default()).expect("found");
    let positions = mesh.triangles().iter().flatten().map(|&v| mesh.positions()[v as usize]).collect();
    let soup =
        TriMesh::new(positions, (0..mesh.triangle_count() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect());
    let (weights, report) =
        bone_weights(&soup.expect("valid"), &skeleton, &options(WeightMethod::Heat), &Run::default()).expect("found");
    assert_eq!(report.components, 1);
    for (c, &v) in mesh.triangles().iter().flatten().enumerate() {
        for i in whole.row(v as usize) {
            assert!((weights.weight(c, i.joint) - i.weight).abs() < 1e-12);
        }
    }
}

#[test]
fn without_visibility_distance_decides_and_idle_joints_are_reported() {
    let (mesh, _) = limb();
    // A second, tight tube about the bones hides them from the first.
    let inner = mesh.positions().iter().map(|p| Point3::new(p.x, 0.0, 0.0) + Vector3::new(0.0, p.y, p.z) * 0.1);
    let lonely = TriMesh::new(mesh.positions().to_vec(), vec![]).expect("valid");
    let skeleton = chain(&[
        [0.0, 0.0, 0.0],
        [3.0, 0.0, 0.0],
        [6.0, 0.0, 0.0],
        [9.0, 0.0, 0.0],
        [9.0, 100.0, 0.0],
        [9.0, 200.0, 0.0],
    ]);
    let (_, report) = bone_weights(&lonely, &skeleton, &options(WeightMethod::Heat), &Run::default()).expect("found");
    assert_eq!(report.components, 0);
    let mut positions = mesh.positions().to_vec();
    positions.extend(inner);
    let n = mesh.vertex_count() as u32;
    let mut triangles = mesh.triangles().to_vec();
    triangles.extend(mesh.triangles().iter().map(|t| t.map(|v| v + n)));
    let nested = TriMesh::new(positions, triangles).expect("valid");
    let (weights, report) =
        bone_weights(&nested, &skeleton, &options(WeightMethod::Heat), &Run::default()).expect("found");
    assert_eq!((report.components, report.borrowed_components), (2, 0), "its ends are open: it sees bones there");
    assert!(weights.sums().all(|s| (s - 1.0).abs() < 1e-12));
    assert_eq!(report.unused_joints, [4]);
}

#[test]
fn smoothing_keeps_the_sum_and_lowers_the_slope() {
    let (mesh, skeleton) = limb();
    let rigid: Vec<u32> = mesh.positions().iter().map(|p| u32::from(p.x > 4.5)).collect();
    let weights = SkinWeights::rigid(skeleton.joint_count(), &rigid).expect("joints");
    let steepest = |w: &SkinWeights| {
        let across = |t: &[u32; 3]| (w.weight(t[0] as usize, 0) - w.weight(t[1] as usize, 0)).abs();
        mesh.triangles().iter().map(across).fold(0.0, f64::max)
    };
    let smooth = weights.smoothed(&mesh, 10, &Run::default()).expect("fits");
    assert!(smooth.sums().all(|s| (s - 1.0).abs() < 1e-12));
    assert!(steepest(&weights) == 1.0 && steepest(&smooth) < 0.3, "{}", steepest(&smooth));
    assert!(weights.smoothed(&TriMesh::default(), 1, &Run::default()).is_err());
}

#[test]
fn mirroring_carries_weights_to_the_joints_of_the_other_side() {
    let joint = |name: &str, x: f64| Joint {
        name: name.into(),
        parent: None,
        rest: Trs::from_translation(Vector3::new(x, 0.0, 0.0)),
        limits: None,
    };
    let skeleton =
        Skeleton::new(vec![joint("arm.L", 1.0), joint("spine", 0.0), joint("arm.R", -1.0)]).expect("a forest");
    let joints = mirror_joints_by_name(&skeleton).expect("pairs");
    assert_eq!(joints, [2, 1, 0]);
    let positions = [[1.0, 0.0, 0.0], [0.0, 0.0, 0.0], [-1.01, 0.0, 0.0]].map(Point3::from);
    let mesh = TriMesh::new(positions.to_vec(), vec![[0, 1, 2]]).expect("valid");
    let rows = [vec![(0, 0.7), (1, 0.3)], vec![(0, 0.5), (1, 0.5)], vec![(1, 1.0)]];
    let weights = SkinWeights::new(3, rows).expect("sums to 1");
    let mirroring = Mirroring { point: Point3::origin(), normal: Unit::new_unchecked(Vector3::x()), joints };
    let (even, report) = weights.mirrored(&mesh, &mirroring).expect("fits");
    assert_eq!((even.weight(2, 2), even.weight(2, 1), even.weight(0, 0)), (0.7, 0.3, 0.7));
    assert_eq!((even.weight(1, 0), even.weight(1, 1), even.weight(1, 2)), (0.25, 0.5, 0.25));
    assert!(report.changed == 1 && report.evened == 1 && (report.max_deviation - 0.01).abs() < 1e-12);
    for (name, other) in
        [("LeftHand", "RightHand"), ("hand_r", "hand_l"), ("r_wrist", "l_wrist"), ("thighRight", "thighLeft")]
    {
        let pair = Skeleton::new(vec![joint(name, 0.0), joint(other, 1.0)]).expect("two");
        assert_eq!(mirror_joints_by_name(&pair), Ok(vec![1, 0]), "{name}");
    }
    let alone = Skeleton::new(vec![joint("l_wrist", 0.0), joint("skull", 1.0)]).expect("two");
    assert!(mirror_joints_by_name(&alone).expect_err("no other").to_string().contains("r_wrist"));
}

#[test]
fn biharmonic_weights_are_bounded_without_constraints_and_smoother_than_heat() {
    let (mesh, skeleton) = limb();
    let all = |method| WeightOptions { influences: 8, min_weight: 0.0, ..options(method) };
    let along = |method| -> Vec<f64> {
        let (weights, _) = bone_weights(&mesh, &skeleton, &all(method), &Run::default()).expect("found");
        assert!(weights.rows().flatten().all(|i| i.weight >= 0.0 && i.weight <= 1.0));
        (0..mesh.vertex_count()).step_by(24).map(|v| weights.weight(v, 0)).collect()
    };
    let (heat, biharmonic) = (along(WeightMethod::Heat), along(WeightMethod::BoundedBiharmonic));
    // No dip: along the tube the first joint's weight falls from 1 to 0 and never rises.
    assert!(biharmonic.windows(2).all(|w| w[1] <= w[0] + 1e-9), "{biharmonic:?}");
    // The jump of heat's second derivative at the joint is gone, and the blend is as wide.
    let third = |w: &[f64]| w.windows(4).map(|w| (w[3] - 3.0 * w[2] + 3.0 * w[1] - w[0]).abs()).fold(0.0, f64::max);
    assert!(third(&biharmonic) < 0.5 * third(&heat), "{} {}", third(&biharmonic), third(&heat));
    let blended = |w: &[f64]| w.iter().map(|w| w * (1.0 - w)).sum::<f64>();
    let ratio = blended(&biharmonic) / blended(&heat);
    assert!((0.8..1.25).contains(&ratio), "{ratio}");
}

#[test]
fn options_out_of_range_are_rejected() {
    let (mesh, skeleton) = limb();
    let refused =
        |o: WeightOptions| bone_weights(&mesh, &skeleton, &o, &Run::default()).expect_err("refused").to_string();
    assert!(refused(WeightOptions { influences: 0, ..Default::default() }).contains("influences 0"));
    assert!(refused(WeightOptions { min_weight: f64::NAN, ..Default::default() }).contains("min_weight NaN"));
}
