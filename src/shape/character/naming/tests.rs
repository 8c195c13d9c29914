use std::ops::ControlFlow;

use nalgebra::{Point3, UnitQuaternion, Vector3};

use super::*;
use crate::character::Joint;
use crate::character::extraction::{ExtractionOptions, extract, skeleton_of};
use crate::character::humanoid::humanoid;
use crate::mesh::TriMesh;
use crate::mesh::shapes::level_set;
use plumbline_num::math::Trs;
use plumbline_num::run::Run;

/// A capsule between two points.
type Capsule = ([f64; 3], [f64; 3], f64);

/// A map of positions.
type Map = Box<dyn Fn(&Point3<f64>) -> Point3<f64>>;

fn body(capsules: &[Capsule]) -> TriMesh {
    let distance = |x: &Point3<f64>| {
        let of = |(a, b, r): &Capsule| {
            let (a, b) = (Point3::from(*a), Point3::from(*b));
            let (along, from) = (b - a, x - a);
            let t = (from.dot(&along) / along.norm_squared()).clamp(0.0, 1.0);
            (from - along * t).norm() - r
        };
        capsules.iter().map(of).fold(f64::INFINITY, f64::min)
    };
    level_set(distance, Point3::new(-1.2, -0.2, -1.4), Point3::new(1.2, 2.2, 1.4), 0.035)
}

/// A dog: y up, facing +z, with a head, a thin tail, and one foreleg ahead.
fn dog(tail: bool) -> Vec<Capsule> {
    let mut parts: Vec<Capsule> = vec![
        ([0.0, 0.8, -0.5], [0.0, 0.85, 0.5], 0.16),
        ([0.0, 0.85, 0.5], [0.0, 1.2, 0.75], 0.09),
        ([0.0, 1.2, 0.75], [0.0, 1.15, 1.05], 0.12),
    ];
    for side in [1.0, -1.0] {
        let x = 0.17 * side;
        parts.push(([0.6 * x, 0.75, -0.45], [x, 0.4, -0.5], 0.08));
        parts.push(([x, 0.4, -0.5], [x, 0.05, -0.45], 0.06));
        parts.push(([0.6 * x, 0.75, 0.45], [x, 0.4, 0.45 + 0.1 * side], 0.08));
        parts.push(([x, 0.4, 0.45 + 0.1 * side], [x, 0.05, 0.45 + 0.15 * side], 0.06));
    }
    if tail {
        parts.push(([0.0, 0.85, -0.55], [0.0, 1.15, -1.05], 0.045));
    }
    parts
}

fn extracted(mesh: &TriMesh) -> (Skeleton, ProposedNames) {
    let options = ExtractionOptions::default();
    let (curve, _) = extract(mesh, &options, &mut |_| ControlFlow::Continue(()), &Run::default()).expect("a curve");
    let skeleton = skeleton_of(&curve, None).expect("valid");
    let found = propose_names(&skeleton, &curve).unwrap_or_else(|| panic!("no body: {:?}", skeleton.rest_positions()));
    (found.applied(&skeleton).expect("distinct names"), found)
}

fn at(skeleton: &Skeleton, name: &str) -> Point3<f64> {
    let names = || skeleton.joints().iter().map(|j| j.name.clone()).collect::<Vec<_>>();
    let joint = skeleton.find(name).unwrap_or_else(|| panic!("no {name} in {:?}", names()));
    skeleton.rest_positions()[joint as usize]
}

#[test]
fn an_extracted_person_has_its_sides_however_it_stands() {
    let mesh = humanoid(0.04).expect("made").model.mesh().clone();
    let turn = UnitQuaternion::from_scaled_axis(Vector3::new(0.7, -1.9, 0.4));
    let copies: [(&str, Map, f64); 3] = [
        ("as made", Box::new(|p| *p), 1.0),
        ("rotated", Box::new(move |p| turn * (p * 7.0) + Vector3::new(3.0, 1.0, -2.0)), 1.0),
        ("mirrored", Box::new(|p| Point3::new(-p.x, p.y, p.z)), -1.0),
    ];
    for (how, map, sign) in copies {
        let positions: Vec<_> = mesh.positions().iter().map(&map).collect();
        let faces = mesh.triangles().iter().map(|f| if sign < 0.0 { [f[0], f[2], f[1]] } else { *f }).collect();
        let (skeleton, found) = extracted(&TriMesh::new(positions, faces).expect("valid"));
        assert_eq!((found.body, found.sides), (BodyPlan::Biped, Sides::Feet), "{how}");
        // The left is at +x of the original, also of the mirrored one: it faces +z still.
        let expected = |x: f64, y: f64| map(&Point3::new(sign * x, y, 0.0));
        let size = if how == "rotated" { 7.0 } else { 1.0 };
        for (name, p) in [("hand end.L", expected(0.82, 1.4)), ("hand end.R", expected(-0.82, 1.4))] {
            let (part, side) = (&name[..4], &name[name.len() - 2..]);
            let of = |j: &&Joint| j.name.starts_with(part) && j.name.ends_with(side);
            let outermost = skeleton.joints().iter().rfind(of).unwrap_or_else(|| panic!("{:?}", found.names));
            let distance = nalgebra::distance(&at(&skeleton, &outermost.name), &p);
            assert!(distance < 0.15 * size, "{how}: {name} is {distance} off");
        }
    }
}

#[test]
fn an_extracted_dog_is_a_quadruped_with_and_without_a_tail() {
    for tail in [true, false] {
        for spin in [0.0, 2.1] {
            let mesh = body(&dog(tail));
            let turn = UnitQuaternion::from_scaled_axis(Vector3::new(0.3, 1.0, -0.2).normalize() * spin);
            let positions = mesh.positions().iter().map(|p| turn * p).collect();
            let (skeleton, found) = extracted(&TriMesh::new(positions, mesh.triangles().to_vec()).expect("valid"));
            assert_eq!((found.body, found.sides), (BodyPlan::Quadruped, Sides::Head));
            let back = |name: &str| turn.inverse() * at(&skeleton, name);
            let foot = |part: &str, side: &str| {
                let names = skeleton.joints().iter().map(|j| j.name.as_str());
                let of = |n: &&str| n.starts_with(part) && n.ends_with(side);
                let lowest = |a: &&str, b: &&str| back(a).y.total_cmp(&back(b).y);
                back(names.filter(of).min_by(lowest).unwrap_or_else(|| panic!("{:?}", found.names)))
            };
            let (left, right) = (foot("front", ".L"), foot("front", ".R"));
            assert!(left.x > 0.1 && right.x < -0.1 && left.z > 0.3 && left.y < 0.2, "{left} {right}");
            let left = ["leg", "shin", "foot", "toes"].iter().filter_map(|p| {
                let part = skeleton.joints().iter().find(|j| j.name == format!("{p}.L"))?;
                Some(back(&part.name))
            });
            assert!(left.clone().count() > 0 && left.into_iter().all(|p| p.x > 0.0 && p.z < 0.0));
            let ends = skeleton.joints().iter().filter(|j| j.name.starts_with("head")).map(|j| back(&j.name).z);
            assert!(ends.fold(0.0, f64::max) > 0.8);
            assert_eq!(skeleton.joints().iter().any(|j| j.name.starts_with("tail")), tail);
        }
    }
}

#[test]
fn a_body_without_feet_has_sides_by_convention_and_turned_aside_none() {
    let mut joints: Vec<Joint> = Vec::new();
    let mut add = |name: &str, parent: Option<u32>, p: [f64; 3]| {
        joints.push(Joint { name: name.into(), parent, rest: Trs::from_translation(p.into()), limits: None });
        joints.len() as u32 - 1
    };
    let hips = add("root", None, [0.0, 1.0, 0.0]);
    let chest = add("joint_1", Some(hips), [0.0, 0.5, 0.0]);
    add("joint_2", Some(chest), [0.0, 0.4, 0.0]);
    for side in [1.0, -1.0] {
        let name = |k: u32| format!("joint_{}", 10 + 10 * k + u32::from(side > 0.0));
        let arm = add(&name(0), Some(chest), [0.3 * side, 0.0, 0.0]);
        add(&name(1), Some(arm), [0.4 * side, 0.0, 0.0]);
        let leg = add(&name(2), Some(hips), [0.1 * side, -0.5, 0.0]);
        add(&name(3), Some(leg), [0.0, -0.5, 0.0]);
    }
    let skeleton = Skeleton::new(joints).expect("valid");
    let found = propose_names(&skeleton, &CurveSkeleton::default()).expect("a biped");
    assert_eq!((found.body, found.sides), (BodyPlan::Biped, Sides::Convention));
    assert!(at(&found.applied(&skeleton).expect("valid"), "hand.L").x > 0.0);
    assert!(found.summary().contains("assumed"));
    let mut lying = skeleton.joints().to_vec();
    lying[0].rest.rotation = UnitQuaternion::from_scaled_axis(Vector3::new(0.5, 0.2, 0.9));
    let lying = Skeleton::new(lying).expect("valid");
    let found = propose_names(&lying, &CurveSkeleton::default()).expect("a biped");
    assert_eq!(found.sides, Sides::Unknown);
    assert!(
        found.names.contains(&"hand.1".to_owned()) && found.names.contains(&"hand.2".to_owned()),
        "{:?}",
        found.names
    );
}

#[test]
fn what_has_no_limbs_gets_no_names() {
    let chain = |k: u32| Joint {
        name: format!("joint_{k}"),
        parent: k.checked_sub(1),
        rest: Trs::from_translation(Vector3::x()),
        limits: None,
    };
    for count in [1, 2, 9] {
        let skeleton = Skeleton::new((0..count).map(chain).collect()).expect("valid");
        assert_eq!(propose_names(&skeleton, &CurveSkeleton::default()), None);
    }
    // A star, whose limbs go from one joint.
    let star = |k: u32| Joint { parent: (k > 0).then_some(0), ..chain(k) };
    let mut joints: Vec<Joint> = (0..7).map(star).collect();
    for (k, joint) in joints.iter_mut().enumerate().skip(1) {
        joint.rest.translation = Vector3::new((k as f64).cos(), (k as f64).sin(), 0.1 * k as f64);
    }
    assert_eq!(propose_names(&Skeleton::new(joints).expect("valid"), &CurveSkeleton::default()), None);
}
