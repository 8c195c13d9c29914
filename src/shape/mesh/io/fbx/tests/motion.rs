//! Skins, blend shapes and animations against closed forms.

use super::*;
use crate::mesh::model::articulation::{Articulation, Channel, ChannelInterpolation, NodeTransform, Property};

fn articulation(model: &Model) -> &Articulation {
    model.articulation().expect("something that moves")
}

/// The value of a channel at a time: linear, spherical linear, or stepped.
fn at(channel: &Channel, time: f64) -> Vec<f64> {
    let width = channel.values.len() / channel.times.len();
    let value = |k: usize| channel.values[k * width..(k + 1) * width].to_vec();
    let passed = channel.times.partition_point(|&t| t <= time);
    if passed == 0 || passed == channel.times.len() {
        return value(passed.saturating_sub(1));
    }
    let (a, b) = (value(passed - 1), value(passed));
    let u = (time - channel.times[passed - 1]) / (channel.times[passed] - channel.times[passed - 1]);
    match (channel.interpolation, channel.property) {
        (ChannelInterpolation::Step, _) => a,
        (_, Property::Rotation) => {
            let unit = |v: &[f64]| UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(v[3], v[0], v[1], v[2]));
            unit(&a).slerp(&unit(&b), u).coords.as_slice().to_vec()
        }
        _ => a.iter().zip(&b).map(|(a, b)| a * (1.0 - u) + b * u).collect(),
    }
}

/// The local matrix of a node in an animation.
fn local(articulation: &Articulation, node: usize, time: f64) -> Matrix4<f64> {
    let mut transform = articulation.nodes[node].transform.clone();
    for channel in articulation.animations[0].channels.iter().filter(|c| c.node as usize == node) {
        let v = at(channel, time);
        let NodeTransform::Trs { translation, rotation, scale } = &mut transform else { panic!("no matrix") };
        match channel.property {
            Property::Translation => translation.copy_from_slice(&v),
            Property::Rotation => rotation.copy_from_slice(&v),
            Property::Scale => scale.copy_from_slice(&v),
            Property::Weights => {}
        }
    }
    transform.matrix()
}

fn columns(matrix: &Matrix4<f64>) -> [f64; 16] {
    matrix.as_slice().try_into().expect("sixteen")
}

#[test]
fn a_skin_in_its_bind_pose_is_the_mesh_where_it_was_bound() {
    // The mesh was bound at M, with the joint at B, and both have moved since.
    let (m, b) = (moved([1.0, 0.0, 0.0]) * about(2, 30.0) * scaled([2.0; 3]), moved([0.0, 4.0, 1.0]) * about(0, 50.0));
    let geometric = vec![p("GeometricTranslation", &[0.0, 0.5, 0.0]), p("Lcl Translation", &[9.0, 9.0, 9.0])];
    let mut scene = triangle_at(geometric);
    let (mesh, joint) = (1001, scene.model("joint", 0, vec![p("Lcl Rotation", &[0.0, 90.0, 0.0])]));
    let skin = scene.skin(mesh);
    let transform = b.try_inverse().expect("rigid") * m;
    scene.cluster(skin, joint, &[(0, 0.5), (1, 2.0), (0, 0.5)], [columns(&transform), columns(&b)]);
    let model = read_scene(&scene);
    assert_positions(&model, &TRIANGLE, &(m * moved([0.0, 0.5, 0.0])));
    let moving = articulation(&model);
    let inverse = &moving.skins[0].inverse_binds[0];
    assert!((inverse - b.try_inverse().expect("rigid")).amax() < 1e-12);
    // Weights of one joint are summed, and normalized; the last vertex has none.
    let rows: Vec<Vec<_>> = (0..3).map(|v| moving.influences.row(v).collect()).collect();
    assert_eq!(rows, [vec![(0, 1.0)], vec![(0, 1.0)], vec![]]);
    assert_eq!(model.warnings(), ["weights that do not sum to one are scaled so that they do (vertices) (1)"]);
}

#[test]
fn matrices_that_a_cluster_lacks_are_those_of_the_bind_pose() {
    let bind = moved([0.0, 3.0, 0.0]) * about(1, 20.0);
    let mut scene = triangle_at(Vec::new());
    let joint = scene.model("joint", 0, Vec::new());
    let skin = scene.skin(1001);
    let cluster = scene.object(
        "Deformer",
        "",
        "Cluster",
        vec![leaf("Indexes", Value::Ints(vec![0])), leaf("Weights", Value::Doubles(vec![1.0]))],
    );
    scene.connect(cluster, skin);
    scene.connect(joint, cluster);
    let pose = |object: i64, matrix: &Matrix4<f64>| {
        let all = vec![leaf("Node", Value::Long(object)), leaf("Matrix", Value::Doubles(columns(matrix).to_vec()))];
        node("PoseNode", Vec::new(), all)
    };
    scene.object("Pose", "", "BindPose", vec![pose(joint, &bind), pose(1000, &moved([1.0, 0.0, 0.0]))]);
    let model = read_scene(&scene);
    assert_positions(&model, &TRIANGLE, &moved([1.0, 0.0, 0.0]));
    let inverse = &articulation(&model).skins[0].inverse_binds[0];
    assert!((inverse - bind.try_inverse().expect("rigid")).amax() < 1e-12);
}

#[test]
fn blend_shapes_become_morph_targets() {
    let model = read_scene(&character());
    let target = &articulation(&model).instances[0].targets[0];
    assert_eq!((target.name.as_deref(), target.weight), (Some("bulge"), 0.25));
    assert_eq!((&target.vertices[..], &target.offsets[..]), (&[1, 4][..], &[[0.0, 0.0, 2.0], [0.0, 0.0, 1.0]][..]));
    let weights = articulation(&model).animations[0].channels.iter().find(|c| c.property == Property::Weights);
    assert_eq!(weights.map(|c| (&c.times[..], &c.values[..])), Some((&[0.0, 1.0][..], &[0.0, 1.0][..])));
}

#[test]
fn animated_frames_follow_euler_angles_and_pivots_between_the_keys() {
    let cubic = |time: f64, value: f32, slopes: [f32; 2]| Key { time, value, flags: 0x408, slopes, weights: 0 };
    for order in 0..6 {
        let pre = [25.0, -70.0, 10.0];
        let mut scene = triangle_at(vec![
            p("PreRotation", &pre),
            p("RotationPivot", &[0.3, 0.2, -0.1]),
            p("ScalingPivot", &[0.0, 0.0, 0.4]),
            whole("RotationOrder", order),
        ]);
        let layer = scene.animation("move");
        let turns = [
            ("d|X", vec![linear(0.0, 0.0), linear(2.0, 720.0)]),
            ("d|Y", vec![linear(0.5, -40.0), linear(1.5, 80.0)]),
            ("d|Z", vec![cubic(0.0, 0.0, [100.0, 50.0]), cubic(2.0, 30.0, [0.0; 2])]),
        ];
        scene.curves(layer, (1000, "Lcl Rotation"), &turns);
        scene.curves(layer, (1000, "Lcl Translation"), &[("d|X", vec![linear(0.0, 1.0), linear(2.0, 3.0)])]);
        scene.curves(layer, (1000, "Lcl Scaling"), &[("d|Y", vec![linear(0.0, 1.0), linear(2.0, 2.0)])]);
        let model = read_scene(&scene);
        let moving = articulation(&model);
        let keys: usize = moving.animations[0].channels.iter().map(|c| c.times.len()).sum();
        assert!(keys < 900, "{keys}");
        let hermite = |t: f64| {
            let (u, d) = (0.5 * t, 2.0);
            u * u * (3.0 - 2.0 * u) * 30.0 + d * u * (1.0 - u) * (1.0 - u) * 100.0 - d * u * u * (1.0 - u) * 50.0
        };
        for t in (0..=200).map(|k| 0.01 * f64::from(k)) {
            let angles = [360.0 * t, (-40.0 + 120.0 * (t - 0.5)).clamp(-40.0, 80.0), hermite(t)];
            let axes = [[0, 1, 2], [0, 2, 1], [1, 2, 0], [1, 0, 2], [2, 0, 1], [2, 1, 0]][order as usize];
            let rotation = axes.iter().fold(Matrix4::identity(), |m, &axis| about(axis, angles[axis]) * m);
            let xyz = about(2, pre[2]) * about(1, pre[1]) * about(0, pre[0]);
            let expected = moved([1.0 + t, 0.0, 0.0])
                * moved([0.3, 0.2, -0.1])
                * xyz
                * rotation
                * moved([-0.3, -0.2, 0.1])
                * moved([0.0, 0.0, 0.4])
                * scaled([1.0, 1.0 + 0.5 * t, 1.0])
                * moved([0.0, 0.0, -0.4]);
            let found = local(moving, 0, t);
            assert!((found - expected).amax() < 2e-3, "order {order}, {t} s: {}", (found - expected).amax());
        }
    }
}

#[test]
fn animated_nodes_are_in_our_units_and_axes() {
    let build = |settings: Vec<Node>| {
        let mut scene = triangle_at(vec![p("Lcl Rotation", &[0.0, 0.0, 20.0])]);
        scene.settings = settings;
        let layer = scene.animation("move");
        scene.curves(layer, (1000, "Lcl Translation"), &[("d|Z", vec![linear(0.0, 100.0), linear(1.0, 300.0)])]);
        scene.curves(layer, (1000, "Lcl Rotation"), &[("d|Y", vec![linear(0.0, 0.0), linear(1.0, 60.0)])]);
        read_scene(&scene)
    };
    let native = build(vec![p("UnitScaleFactor", &[100.0])]);
    // z up in centimeters, and the same left-handed.
    for (sign, front) in [(1.0, -1), (-1.0, 1)] {
        let changed = build(vec![whole("UpAxis", 2), whole("FrontAxis", 1), whole("FrontAxisSign", front)]);
        let to: Matrix3<f64> = 0.01 * Matrix3::new(1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, -sign, 0.0);
        let (to, back) = (to.to_homogeneous(), to.try_inverse().expect("a similarity").to_homogeneous());
        for t in [0.0, 0.3, 1.0] {
            let expected = to * local(articulation(&native), 0, t) * back;
            assert!((local(articulation(&changed), 0, t) - expected).amax() < 1e-12, "{front} {t}");
        }
    }
}

#[test]
fn constant_curves_are_steps_and_jumps_among_others_are_short() {
    let mut scene = triangle_at(Vec::new());
    let layer = scene.animation("move");
    let held = |time: f64, value: f32| Key { time, value, flags: 0x2, ..Key::default() };
    scene.curves(layer, (1000, "Lcl Translation"), &[("d|X", vec![held(0.0, 1.0), held(1.0, 2.0)])]);
    let curves = [("d|X", vec![held(0.0, 1.0), held(1.0, 2.0)]), ("d|Y", vec![linear(0.0, 1.0), linear(2.0, 3.0)])];
    scene.curves(layer, (1000, "Lcl Scaling"), &curves);
    let model = read_scene(&scene);
    let [translation, scale] = &articulation(&model).animations[0].channels[..] else { panic!("two channels") };
    assert_eq!((translation.interpolation, &translation.times[..]), (ChannelInterpolation::Step, &[0.0, 1.0][..]));
    assert_eq!(at(translation, 0.999)[0], 1.0);
    assert_eq!(scale.times.len(), 4);
    let (before, after) = (at(scale, 0.999), at(scale, 1.0));
    assert!((before[0] - 1.0).abs() < 1e-12 && after[0] == 2.0 && (before[1] - 1.999).abs() < 1e-3);
}

#[test]
fn every_stack_is_an_animation_and_further_layers_are_left_out() {
    let mut scene = triangle_at(Vec::new());
    for (name, value) in [("walk", 1.0), ("run", 2.0)] {
        let layer = scene.animation(name);
        scene.curves(layer, (1000, "Lcl Translation"), &[("d|X", vec![linear(0.0, value)])]);
    }
    scene.animation("nothing");
    let further = scene.object("AnimationLayer", "", "", Vec::new());
    scene.connect(further, 1002);
    scene.curves(further, (1000, "Lcl Translation"), &[("d|X", vec![linear(0.0, 9.0)])]);
    let model = read_scene(&scene);
    let found: Vec<_> = articulation(&model)
        .animations
        .iter()
        .map(|a| (a.name.as_deref().unwrap_or_default(), a.channels[0].values.clone()))
        .collect();
    assert_eq!(found, [("walk", vec![1.0, 0.0, 0.0]), ("run", vec![2.0, 0.0, 0.0])]);
    assert_eq!(model.warnings(), ["animation layers after the first are left out (properties) (1)"]);
}

#[test]
fn scale_that_is_not_inherited_is_divided_out_of_rest_and_animation() {
    let mut scene = triangle_at(vec![p("Lcl Scaling", &[4.0, 4.0, 4.0])]);
    let child = scene.model("child", 1000, vec![whole("InheritType", 2), p("Lcl Translation", &[0.0, 1.0, 0.0])]);
    scene.mesh(child, &TRIANGLE, &[&[0, 1, 2]], Vec::new());
    let layer = scene.animation("move");
    scene.curves(layer, (child, "Lcl Scaling"), &[("d|X", vec![linear(0.0, 3.0)])]);
    let model = read_scene(&scene);
    let world = moved([0.0, 4.0, 0.0]);
    for (p, q) in model.mesh().positions()[3..].iter().zip(TRIANGLE) {
        assert!((p - world.transform_point(&q.into())).norm() < 1e-12);
    }
    assert_eq!(articulation(&model).animations[0].channels[0].values, [0.75, 0.25, 0.25]);
    // Stretched, it becomes a matrix with shear.
    let mut scene = triangle_at(vec![p("Lcl Scaling", &[4.0, 1.0, 1.0])]);
    let child = scene.model("child", 1000, vec![whole("InheritType", 0), p("Lcl Rotation", &[0.0, 0.0, 45.0])]);
    scene.mesh(child, &TRIANGLE, &[&[0, 1, 2]], Vec::new());
    let model = read_scene(&scene);
    let world =
        Rotation3::from_axis_angle(&Vector3::z_axis(), 45_f64.to_radians()).to_homogeneous() * scaled([4.0, 1.0, 1.0]);
    for (p, q) in model.mesh().positions()[3..].iter().zip(TRIANGLE) {
        assert!((p - world.transform_point(&q.into())).norm() < 1e-12);
    }
    assert!(model.warnings()[0].contains("inherit scale"), "{:?}", model.warnings());
}
