//! Laws of template fitting.

use std::ops::ControlFlow;

use nalgebra::{Point3, Rotation3, UnitQuaternion, Vector3};

use super::*;
use crate::character::extraction::{ExtractionOptions, extract};
use crate::character::humanoid::humanoid;
use crate::character::{Joint, Pose};
use plumbline_num::math::Trs;
use plumbline_num::run::Run;

/// A curve along the posed bones of a skeleton, with nodes every hundredth of a unit; bones into `without` are omitted with all descendants.
fn curve_along(skeleton: &Skeleton, pose: &Pose, without: &[&str]) -> CurveSkeleton {
    let at: Vec<Point3<f64>> =
        skeleton.globals(pose).expect("fits").iter().map(|g| Point3::from(g.column(3).xyz())).collect();
    let mut curve = CurveSkeleton::default();
    let mut node = vec![None; at.len()];
    for &j in skeleton.parents_first() {
        let joint = &skeleton.joints()[j as usize];
        let Some(parent) = joint.parent else {
            node[j as usize] = Some(0);
            curve.nodes.push(at[j as usize]);
            continue;
        };
        let Some(mut last) = node[parent as usize].filter(|_| !without.contains(&joint.name.as_str())) else {
            continue;
        };
        let (from, to) = (at[parent as usize], at[j as usize]);
        let steps = ((to - from).norm() / 0.01).ceil().max(1.0) as u32;
        for k in 1..=steps {
            let next = curve.nodes.len() as u32;
            curve.nodes.push(from + (to - from) * (f64::from(k) / f64::from(steps)));
            curve.edges.push([last, next]);
            last = next;
        }
        node[j as usize] = Some(last);
    }
    curve
}

fn person() -> Skeleton {
    humanoid(0.1).expect("made").skeleton
}

/// Arms down, one knee bent, the other leg forward, the head to the side.
fn posed(skeleton: &Skeleton) -> Pose {
    let mut pose = skeleton.rest_pose();
    let turns = [
        ("arm.L", [0.0, 0.0, -1.1]),
        ("arm.R", [0.0, 0.3, 0.9]),
        ("forearm.R", [0.0, 0.9, 0.0]),
        ("shin.L", [1.0, 0.0, 0.0]),
        ("leg.R", [-0.4, 0.0, 0.0]),
        ("neck", [0.0, 0.0, 0.3]),
    ];
    for (name, turn) in turns {
        pose.locals[skeleton.named(name).expect("there") as usize].rotation =
            UnitQuaternion::from_scaled_axis(turn.into());
    }
    pose
}

fn mapped(curve: &CurveSkeleton, map: impl Fn(&Point3<f64>) -> Point3<f64>) -> CurveSkeleton {
    CurveSkeleton { nodes: curve.nodes.iter().map(map).collect(), ..curve.clone() }
}

/// The skeleton with mapped joint positions and axis-aligned frames.
fn moved(skeleton: &Skeleton, map: impl Fn(&Point3<f64>) -> Point3<f64>) -> Skeleton {
    let at: Vec<Point3<f64>> = skeleton.rest_positions().iter().map(map).collect();
    let joint = |(j, joint): (usize, &Joint)| {
        let offset = joint.parent.map_or(at[j].coords, |p| at[j] - at[p as usize]);
        Joint { rest: Trs::from_translation(offset), ..joint.clone() }
    };
    Skeleton::new(skeleton.joints().iter().enumerate().map(joint).collect()).expect("valid")
}

/// Largest distance between joints of equal index.
fn apart(a: &[Point3<f64>], b: &[Point3<f64>]) -> f64 {
    a.iter().zip(b).map(|(p, q)| (p - q).norm()).fold(0.0, f64::max)
}

#[test]
fn a_skeleton_fits_the_curve_of_its_own_bones_exactly() {
    let skeleton = person();
    let fit =
        fit_template(&skeleton, &curve_along(&skeleton, &skeleton.rest_pose(), &[]), &Run::default()).expect("fits");
    let off = apart(&fit.skeleton.rest_positions(), &skeleton.rest_positions());
    assert!(off < 1e-2, "{off}");
    assert!((fit.scale - 1.0).abs() < 1e-2 && fit.residual < 1e-2 && !fit.ambiguous, "{fit:?}");
    assert!(fit.limbs.len() == 6 && fit.limbs.iter().all(|l| l.stretch.is_some_and(|s| (s - 1.0).abs() < 0.02)));
    for (old, new) in skeleton.joints().iter().zip(fit.skeleton.joints()) {
        assert_eq!((&old.name, old.parent, &old.limits), (&new.name, new.parent, &new.limits));
        assert!(old.rest.rotation.angle_to(&new.rest.rotation) < 0.05, "{}", old.name);
        assert!((new.rest.scale - Vector3::repeat(1.0)).amax() < 1e-9);
    }
}

#[test]
fn a_skeleton_fitted_to_the_curve_of_its_pose_takes_that_pose() {
    let skeleton = person();
    let pose = posed(&skeleton);
    let expected: Vec<Point3<f64>> =
        skeleton.globals(&pose).expect("fits").iter().map(|g| Point3::from(g.column(3).xyz())).collect();
    let fit = fit_template(&skeleton, &curve_along(&skeleton, &pose, &[]), &Run::default()).expect("fits");
    let off = apart(&fit.skeleton.rest_positions(), &expected);
    assert!(off < 0.025, "{off}: a tenth of an arm's bone");
    // Frames follow the bones: those of joints in a chain as posed, up to twist.
    for (j, local) in pose.locals.iter().enumerate() {
        let turned = fit.skeleton.joints()[j].rest.rotation.angle_to(&local.rotation);
        assert!(turned < 0.35, "{}: {turned}", skeleton.joints()[j].name);
    }
}

#[test]
fn the_fit_is_equivariant_under_similarities_of_either_input() {
    let skeleton = person();
    let curve = curve_along(&skeleton, &posed(&skeleton), &[]);
    let reference = fit_template(&skeleton, &curve, &Run::default()).expect("fits");
    let turn = Rotation3::from_euler_angles(0.7, -2.0, 1.3);
    let (scale, by) = (37.0, Vector3::new(1e4, -2e4, 500.0));
    let map = |p: &Point3<f64>| turn * (p * scale) + by;
    let theirs = fit_template(&skeleton, &mapped(&curve, map), &Run::default()).expect("fits");
    let expected: Vec<_> = reference.skeleton.rest_positions().iter().map(map).collect();
    let off = apart(&theirs.skeleton.rest_positions(), &expected);
    assert!(off < 1e-6 * scale, "{off}");
    assert!((theirs.scale / reference.scale - scale).abs() < 1e-6 * scale);
    let ours = fit_template(&moved(&skeleton, map), &curve, &Run::default()).expect("fits");
    let off = apart(&ours.skeleton.rest_positions(), &reference.skeleton.rest_positions());
    assert!(off < 1e-6, "{off}");
}

#[test]
fn left_is_left_for_the_template_and_for_its_mirror_image() {
    let skeleton = person();
    let curve = curve_along(&skeleton, &posed(&skeleton), &[]);
    let mirror = |p: &Point3<f64>| Point3::new(-p.x, p.y, p.z);
    let fit = fit_template(&skeleton, &curve, &Run::default()).expect("fits");
    let mirrored = fit_template(&moved(&skeleton, mirror), &mapped(&curve, mirror), &Run::default()).expect("fits");
    let expected: Vec<_> = fit.skeleton.rest_positions().iter().map(mirror).collect();
    let off = apart(&mirrored.skeleton.rest_positions(), &expected);
    assert!(off < 1e-9, "{off}");
    // The mirrored template on the original curve: its left arm is where the right one was.
    let crossed = fit_template(&moved(&skeleton, mirror), &curve, &Run::default()).expect("fits");
    let [left, right] = ["hand.L", "hand.R"].map(|n| skeleton.named(n).expect("there") as usize);
    let [was, is] = [&fit, &crossed].map(|f| f.skeleton.rest_positions());
    assert!((is[left] - was[right]).norm() < 0.05 && (is[right] - was[left]).norm() < 0.05);
}

#[test]
fn limbs_of_the_curve_without_counterpart_are_ignored() {
    let skeleton = person();
    let mut joints = skeleton.joints().to_vec();
    let mut add = |name: &str, parent: &str, offset: [f64; 3]| {
        let parent = joints.iter().position(|j| j.name == parent).map(|p| p as u32);
        joints.push(Joint { name: name.into(), parent, rest: Trs::from_translation(offset.into()), limits: None });
    };
    add("tail", "hips", [0.0, -0.1, -0.3]);
    add("tail end", "tail", [0.0, -0.2, -0.4]);
    for side in ["L", "R"] {
        let x = if side == "L" { 1.0 } else { -1.0 };
        add(&format!("ear.{side}"), "head", [0.15 * x, 0.12, 0.0]);
        add(&format!("thumb.{side}"), &format!("hand.{side}"), [0.05 * x, 0.0, 0.09]);
        add(&format!("pinky.{side}"), &format!("hand.{side}"), [0.1 * x, 0.0, -0.05]);
    }
    let rich = Skeleton::new(joints).expect("valid");
    let mut curve = curve_along(&rich, &rich.rest_pose(), &[]);
    // Ears are as long as the top of the head, but thin.
    let body = curve_along(&skeleton, &skeleton.rest_pose(), &[]).nodes;
    let of_body = |p: &Point3<f64>| body.iter().any(|q| (p - q).norm() < 0.011);
    curve.radius = curve.nodes.iter().map(|p| if of_body(p) { 0.08 } else { 0.03 }).collect();
    let fit = fit_template(&skeleton, &curve, &Run::default()).expect("fits");
    let off = apart(&fit.skeleton.rest_positions(), &skeleton.rest_positions());
    assert!(off < 0.05, "{off}");
    assert_eq!(fit.spare_ends, 7);
}

#[test]
fn limbs_without_image_follow_their_parent_and_are_reported() {
    let skeleton = person();
    for (missing, ends) in
        [("arm.R", ["chest", "hand end.R"]), ("neck", ["chest", "head end"]), ("hand end.L", ["", ""])]
    {
        let fit = fit_template(&skeleton, &curve_along(&skeleton, &skeleton.rest_pose(), &[missing]), &Run::default())
            .expect("fits");
        let off = apart(&fit.skeleton.rest_positions(), &skeleton.rest_positions());
        let without: Vec<_> = fit.limbs.iter().filter(|l| l.stretch.is_none()).collect();
        if missing == "hand end.L" {
            // An arm without a hand is a shorter arm.
            assert!(without.is_empty() && off < 0.14, "{without:?} {off}");
            continue;
        }
        assert!(off < 0.06, "{missing}: {off}");
        let name = |j: u32| skeleton.joints()[j as usize].name.as_str();
        assert_eq!(without.iter().map(|l| [name(l.from), name(l.to)]).collect::<Vec<_>>(), [ends]);
    }
}

#[test]
fn a_retargeted_clip_has_the_templates_world_pose_for_any_rest_pose() {
    let person = humanoid(0.1).expect("made");
    let skeleton = &person.skeleton;
    let map =
        |p: &Point3<f64>| Rotation3::from_euler_angles(0.4, 2.0, -0.6) * (p * 3.0) + Vector3::new(10.0, -4.0, 2.0);
    for pose in [skeleton.rest_pose(), posed(skeleton)] {
        let fit =
            fit_template(skeleton, &mapped(&curve_along(skeleton, &pose, &[]), map), &Run::default()).expect("fits");
        let hips = map(&person.skeleton.rest_positions()[0]);
        for clip in &person.clips {
            let there = fit.retargeted(skeleton, clip).expect("its own");
            assert_eq!((there.name(), there.span()), (clip.name(), clip.span()));
            let (first, last) = clip.span().expect("keys");
            for k in 0..5 {
                let time = first + (last - first) * f64::from(k) / 4.0;
                let at = |skeleton: &Skeleton, clip: &crate::character::Clip| -> Vec<Point3<f64>> {
                    let pose = clip.pose(skeleton, time, crate::character::Extrapolation::Constant).expect("fits");
                    skeleton.globals(&pose).expect("fits").iter().map(|g| Point3::from(g.column(3).xyz())).collect()
                };
                let expected: Vec<_> = at(skeleton, clip).iter().map(map).collect();
                let is = at(&fit.skeleton, &there);
                // A tenth of an arm bone of a template three times as large, minus the offset at rest.
                let by = fit.skeleton.rest_positions()[0] - hips;
                let off = expected.iter().zip(&is).map(|(a, b)| (b - a - by).norm()).fold(0.0, f64::max);
                assert!(off < 0.09, "{} at {time}: {off}", clip.name());
            }
        }
    }
}

#[test]
fn ends_of_limbs_keep_their_rest_rotation_and_morphs_are_dropped() {
    let person = humanoid(0.1).expect("made");
    let skeleton = &person.skeleton;
    let fit = fit_template(skeleton, &curve_along(skeleton, &posed(skeleton), &[]), &Run::default()).expect("fits");
    // A clip of nothing: all joints as in the template except the ends of limbs.
    let morph = crate::character::clip::MorphTrack {
        target: 0,
        keys: crate::character::Keys::new(vec![0.0], vec![[1.0]], crate::character::Interpolation::Step)
            .expect("finite"),
    };
    let still = crate::character::Clip::new("still", Vec::new(), vec![morph]).expect("valid");
    let there = fit.retargeted(skeleton, &still).expect("its own");
    assert!(there.morphs().is_empty());
    let pose = there.pose(&fit.skeleton, 0.0, crate::character::Extrapolation::Constant).expect("fits");
    for (j, joint) in fit.skeleton.joints().iter().enumerate() {
        let template = skeleton.joints()[j].rest.rotation;
        let ends = ["head", "hand.L", "hand.R", "foot.L", "foot.R"].contains(&joint.name.as_str());
        let of_limb = skeleton.children(j as u32).is_empty() || ends;
        let expected =
            if of_limb { joint.rest.rotation } else { fit.rotation.powf(f64::from(joint.parent.is_none())) * template };
        let off = pose.locals[j].rotation.angle_to(&expected);
        assert!(off < 1e-9, "{}: {off}", joint.name);
    }
}

#[test]
fn a_root_on_the_ground_is_no_limb() {
    let skeleton = person();
    let mut joints = skeleton.joints().to_vec();
    joints[0].parent = Some(joints.len() as u32);
    let ground = Trs::identity();
    joints.push(Joint { name: "ground".into(), parent: None, rest: ground, limits: None });
    let grounded = Skeleton::new(joints).expect("valid");
    let fit = fit_template(&grounded, &curve_along(&skeleton, &posed(&skeleton), &[]), &Run::default()).expect("fits");
    let without =
        fit_template(&skeleton, &curve_along(&skeleton, &posed(&skeleton), &[]), &Run::default()).expect("fits");
    let (is, was) = (fit.skeleton.rest_positions(), without.skeleton.rest_positions());
    assert!(apart(&is, &was) < 1e-9, "{}", apart(&is, &was));
    assert!(is[22].y.abs() < 0.1, "below the hips as in the template: {}", is[22]);
}

#[test]
fn a_root_on_the_ground_is_no_tail() {
    let skeleton = person();
    let mut joints = skeleton.joints().to_vec();
    joints[0].parent = Some(joints.len() as u32);
    joints.push(Joint { name: "ground".into(), parent: None, rest: Trs::identity(), limits: None });
    let grounded = Skeleton::new(joints).expect("valid");
    let mut joints = skeleton.joints().to_vec();
    for (name, parent, offset) in [("tail", 0, [0.0, -0.1, -0.4]), ("tail end", joints.len() as u32, [0.0, -0.3, -0.3])]
    {
        joints.push(Joint {
            name: name.into(),
            parent: Some(parent),
            rest: Trs::from_translation(offset.into()),
            limits: None,
        });
    }
    let tailed = Skeleton::new(joints).expect("valid");
    let fit = fit_template(&grounded, &curve_along(&tailed, &tailed.rest_pose(), &[]), &Run::default()).expect("fits");
    let ground = skeleton.joint_count() as u32;
    let limb = fit.limbs.iter().find(|l| l.from == ground || l.to == ground).expect("told");
    assert!(limb.stretch.is_none() && fit.spare_ends == 1, "{:?}", fit.limbs);
    let off = apart(&fit.skeleton.rest_positions()[..ground as usize], &skeleton.rest_positions());
    assert!(off < 0.05, "{off}");
}

#[test]
fn a_limb_ends_where_the_surface_ends_and_not_in_a_spike_along_it() {
    let skeleton = person();
    let mut joints = skeleton.joints().to_vec();
    // Longer arms than the template's, hanging down; a crown of spikes at the elbows, where the template has its hands.
    for (side, x) in [("L", 1.0), ("R", -1.0)] {
        let at = |name: &str| skeleton.named(&format!("{name}.{side}")).expect("there") as usize;
        joints[at("forearm")].rest.rotation = UnitQuaternion::from_scaled_axis([0.0, 0.0, -1.5 * x].into());
        joints[at("hand")].rest.translation *= 1.5;
        for k in 0..8 {
            let offset = Vector3::new(0.25 * x, 0.0, 0.02 * f64::from(k - 4));
            let rest = Trs::from_translation(joints[at("forearm")].rest.translation + offset);
            let parent = Some(at("arm") as u32);
            joints.push(Joint { name: format!("spike {k}.{side}"), parent, rest, limits: None });
        }
    }
    let armored = Skeleton::new(joints).expect("valid");
    let mut curve = curve_along(&armored, &armored.rest_pose(), &[]);
    let of_spike = |p: &Point3<f64>| p.x.abs() > 0.47 && (p.y - 1.4).abs() < 1e-9;
    curve.radius = curve.nodes.iter().map(|p| if of_spike(p) { 0.03 } else { 0.08 }).collect();
    let fit = fit_template(&skeleton, &curve, &Run::default()).expect("fits");
    for side in ["L", "R"] {
        let hand = |s: &Skeleton| s.rest_positions()[s.named(&format!("hand end.{side}")).expect("there") as usize];
        let off = (hand(&fit.skeleton) - hand(&armored)).norm();
        assert!(off < 0.05, "{side}: {off}");
    }
}

#[test]
fn where_four_limbs_meet_lengths_decide_between_two_junctions() {
    let skeleton = person();
    let index = |name: &str| skeleton.named(name).expect("there");
    let at = skeleton.rest_positions();
    // One arm leaves the trunk below the chest, the other above.
    let (chest, neck) = (index("chest"), index("neck"));
    let spine = skeleton.joints()[chest as usize].parent.expect("a spine");
    for (low, high) in [(0.5, 0.6), (0.9, 0.3), (0.3, 0.9)] {
        let mut joints = skeleton.joints().to_vec();
        for (name, of, from, fraction) in [("low", "arm.L", spine, low), ("high", "arm.R", neck, high)] {
            let place = at[chest as usize].lerp(&at[from as usize], fraction);
            let parent = if name == "low" { spine } else { chest };
            let new = joints.len() as u32;
            let offset = place - at[parent as usize];
            joints.push(Joint {
                name: name.into(),
                parent: Some(parent),
                rest: Trs::from_translation(offset),
                limits: None,
            });
            let arm = index(of) as usize;
            joints[arm].parent = Some(new);
            joints[arm].rest = Trs::from_translation(at[arm] - place);
            let next = if name == "low" { chest } else { neck } as usize;
            joints[next].parent = Some(new);
            joints[next].rest = Trs::from_translation(at[next] - place);
        }
        let other = Skeleton::new(joints).expect("valid");
        let fit =
            fit_template(&skeleton, &curve_along(&other, &other.rest_pose(), &[]), &Run::default()).expect("fits");
        let off = (fit.skeleton.rest_positions()[chest as usize] - at[chest as usize]).norm();
        assert!(off < 0.03, "{low} {high}: {off}");
    }
}

#[test]
fn a_template_fits_the_curve_that_is_extracted_from_its_surface() {
    let person = humanoid(0.05).expect("made");
    let (curve, _) = extract(
        person.model.mesh(),
        &ExtractionOptions::default(),
        &mut |_| ControlFlow::Continue(()),
        &Run::default(),
    )
    .expect("a curve");
    let fit = fit_template(&person.skeleton, &curve, &Run::default()).expect("fits");
    let (is, was) = (fit.skeleton.rest_positions(), person.skeleton.rest_positions());
    let off = apart(&is, &was);
    assert!(off < 0.1, "{off}");
}

#[test]
fn a_chain_with_a_bend_fits_a_chain_and_pieces_are_joined() {
    let places = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.8, 0.7, 0.0], [2.0, 0.9, 0.4]];
    let joint = |(j, p): (usize, &[f64; 3])| {
        let before = if j == 0 { Vector3::zeros() } else { Vector3::from(places[j - 1]) };
        let rest = Trs::from_translation(Vector3::from(*p) - before);
        Joint { name: format!("{j}"), parent: j.checked_sub(1).map(|p| p as u32), rest, limits: None }
    };
    let chain = Skeleton::new(places.iter().enumerate().map(joint).collect()).expect("valid");
    let mut curve = curve_along(&chain, &chain.rest_pose(), &[]);
    curve.edges.remove(40);
    let fit = fit_template(&chain, &curve, &Run::default()).expect("fits");
    let off = apart(&fit.skeleton.rest_positions(), &chain.rest_positions());
    assert!(off < 0.05, "{off}");
    // A straight curve fits in both directions: the template's is chosen, and the result is ambiguous.
    let line = CurveSkeleton {
        nodes: (0..50).map(|i| Point3::new(f64::from(50 - i), 0.0, 0.0)).collect(),
        edges: (0..49).map(|i| [i, i + 1]).collect(),
        ..CurveSkeleton::default()
    };
    let straight = moved(&chain, |p| Point3::new(p.x, 0.0, 0.0));
    let fit = fit_template(&straight, &line, &Run::default()).expect("fits");
    let at = fit.skeleton.rest_positions();
    assert!(fit.ambiguous && at[0].x < at[3].x, "{at:?}");
}

#[test]
fn unfittable_inputs_are_rejected_with_the_reason() {
    let skeleton = person();
    let curve = curve_along(&skeleton, &skeleton.rest_pose(), &[]);
    let point = Skeleton::new(vec![skeleton.joints()[0].clone()]).expect("valid");
    let mut broken = curve.clone();
    broken.nodes[3].y = f64::NAN;
    let mut beyond = curve.clone();
    beyond.edges.push([0, 9999]);
    let dash = CurveSkeleton {
        nodes: vec![Point3::origin(), Point3::new(0.3, 0.0, 0.0)],
        edges: vec![[0, 1]],
        radius: vec![1.0, 1.0],
        ..CurveSkeleton::default()
    };
    let dot = CurveSkeleton { nodes: vec![Point3::origin()], ..CurveSkeleton::default() };
    for (template, curve, expected) in [
        (&point, &curve, "the template has 1 joints at one position"),
        (&skeleton, &dot, "the curve skeleton has 1 nodes and no limb"),
        (&skeleton, &dash, "the curve skeleton has 2 nodes"),
        (&skeleton, &CurveSkeleton::default(), "the curve skeleton has 0 nodes"),
        (&skeleton, &broken, "node 3 of the curve is not finite"),
        (&skeleton, &beyond, "ends at node 9999, but there are"),
    ] {
        let message = fit_template(template, curve, &Run::default()).expect_err(expected).to_string();
        assert!(message.contains(expected), "{message}");
    }
}
