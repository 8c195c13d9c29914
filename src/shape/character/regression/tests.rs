use nalgebra::{Point3, Vector3};

use super::super::humanoid::humanoid;
use super::super::skinning::tests::{matrices, tube, turn};
use super::super::skinning::{Skinner, SkinningMethod};
use super::super::{Extrapolation, Skin, SkinWeights};
use super::*;
use plumbline_num::math::Trs;
use plumbline_num::run::Run;

/// An elbow with a muscle: twist distributes over the forearm, the upper arm bulges with the bend. Linear blending can do neither.
pub(super) fn arm(around: usize, along: usize) -> (TriMesh, Skeleton, Skin, impl Fn(f64, f64) -> Example) {
    let (mesh, skeleton, skin) = tube(2, around, along);
    let (rest, bones, weights) = (mesh.clone(), skeleton.clone(), skin.clone());
    let example = move |bend: f64, twist: f64| {
        let rotation = turn([0.0, 0.0, 1.0], bend) * turn([1.0, 0.0, 0.0], twist);
        let m = matrices(&bones, &weights, |p| p.locals[1].rotation = rotation);
        let place = |p: &Point3<f64>| {
            let swell = 1.0 + 0.3 * bend / 1.5 * (-(p.x - 1.8).powi(2) / 0.5).exp();
            let q = Vector3::new(p.x, p.y * swell, p.z * swell);
            // Fraction of the rotation at this position: the bend happens within one unit, the twist over three.
            let part = |width: f64| ((p.x - 3.0) / width + 0.5).clamp(0.0, 1.0);
            let (b, t) = (bend * part(1.6), twist * part(3.0));
            let local = turn([0.0, 0.0, 1.0], b) * turn([1.0, 0.0, 0.0], t);
            Point3::new(3.0, 0.0, 0.0) + local * (q - Vector3::new(3.0, 0.0, 0.0))
        };
        Example { matrices: m, positions: rest.positions().iter().map(place).collect() }
    };
    (mesh, skeleton, skin, example)
}

fn rms(a: &[Point3<f64>], b: &[Point3<f64>]) -> f64 {
    (a.iter().zip(b).map(|(a, b)| (a - b).norm_squared()).sum::<f64>() / a.len() as f64).sqrt()
}

#[test]
fn the_model_learns_what_linear_blending_cannot_and_generalizes_between_examples() {
    let (mesh, skeleton, skin, example) = arm(16, 40);
    let angle = |k: usize| (1.5 * k as f64 / 29.0, 1.2 * ((k * 7) % 30) as f64 / 29.0);
    let all: Vec<Example> = (0..30).map(|k| example(angle(k).0, angle(k).1)).collect();
    let (train, held): (Vec<_>, Vec<_>) = all.into_iter().enumerate().partition(|(k, _)| k % 2 == 0);
    let (train, held): (Vec<_>, Vec<_>) =
        (train.into_iter().map(|e| e.1).collect(), held.into_iter().map(|e| e.1).collect());
    let options = tuned(&mesh, &skeleton, skin.weights(), &train, &Run::default()).expect("tuned");
    let (mut model, report) =
        RegressionModel::train(&mesh, &skeleton, skin.weights(), &train, &options, &Run::default()).expect("trained");
    // The best linear blend with these joints.
    let fitted = Skin::bound(fit_weights(&mesh, skin.weights(), &train, &Run::default()).expect("fitted"), &skeleton)
        .expect("not flat");
    let linear =
        Skinner::new(&mesh, None, &skeleton, &fitted, SkinningMethod::LinearBlend, &Run::default()).expect("fits");
    let errors = |examples: &[Example], model: &mut RegressionModel| {
        let mine =
            examples.iter().map(|e| rms(&model.positions(&e.matrices).expect("fits"), &e.positions)).sum::<f64>();
        let theirs =
            examples.iter().map(|e| rms(&linear.positions(&e.matrices).expect("fits"), &e.positions)).sum::<f64>();
        (mine / examples.len() as f64, theirs / examples.len() as f64)
    };
    let (on_train, on_held) = (errors(&train, &mut model), errors(&held, &mut model));
    assert!(on_train.0 < 0.3 * on_train.1, "{on_train:?}");
    assert!(on_held.0 < 0.3 * on_held.1, "{on_held:?}");
    assert!(report.error < report.linear_error, "{report:?}");
}

#[test]
fn a_rigid_motion_of_all_joints_moves_the_surface_rigidly() {
    let (mesh, skeleton, skin, example) = arm(12, 24);
    let train: Vec<Example> = (0..6).map(|k| example(0.3 * k as f64, 0.2 * k as f64)).collect();
    let (mut model, _) = RegressionModel::train(
        &mesh,
        &skeleton,
        skin.weights(),
        &train,
        &RegressionOptions::default(),
        &Run::default(),
    )
    .expect("trained");
    let pose = example(0.8, 0.3).matrices;
    let motion = Trs::rigid(turn([1.0, 2.0, -0.5], 2.5), Vector3::new(100.0, -3.0, 7.0));
    let there: Vec<_> = pose.iter().map(|m| motion.matrix() * m).collect();
    let reduced =
        model.reduced(&train.iter().map(|e| e.matrices.clone()).collect::<Vec<_>>(), 4, &Run::default()).expect("fits");
    // The product of the reduced model is in single precision.
    let pairs = [
        (model.positions(&pose).expect("fits"), model.positions(&there).expect("fits"), 1e-9),
        (reduced.positions(&pose).expect("fits"), reduced.positions(&there).expect("fits"), 1e-6 * mesh.diagonal()),
    ];
    for (a, b, allowed) in &pairs {
        assert!(a.iter().zip(b).all(|(a, b)| (motion.transform(a) - b).norm() < *allowed));
    }
}

#[test]
fn rigid_examples_are_reproduced_exactly() {
    let (mesh, skeleton, skin, _) = arm(10, 12);
    let rigid = |angle: f64| {
        let motion = Trs::rigid(turn([0.2, 1.0, 0.3], angle), Vector3::new(angle, 0.0, 1.0));
        let positions = mesh.positions().iter().map(|p| motion.transform(p)).collect();
        Example { matrices: vec![motion.matrix(); 2], positions }
    };
    let train = [rigid(0.0), rigid(1.0), rigid(2.5)];
    let (mut model, report) = RegressionModel::train(
        &mesh,
        &skeleton,
        skin.weights(),
        &train,
        &RegressionOptions::default(),
        &Run::default(),
    )
    .expect("trained");
    assert!(report.error < 1e-12, "{report:?}");
    let new = rigid(-1.7);
    assert!(rms(&model.positions(&new.matrices).expect("fits"), &new.positions) < 1e-10);
    let reduced = model.reduced(std::slice::from_ref(&new.matrices), 3, &Run::default()).expect("fits");
    assert!(rms(&reduced.positions(&new.matrices).expect("fits"), &new.positions) < 1e-6 * mesh.diagonal());
}

#[test]
fn a_few_shapes_reproduce_the_full_model() {
    let mut counts = Vec::new();
    for (around, along) in [(12, 24), (24, 60)] {
        let (mesh, skeleton, skin, example) = arm(around, along);
        let train: Vec<Example> = (0..10).map(|k| example(0.15 * k as f64, 0.1 * ((3 * k) % 10) as f64)).collect();
        let (mut model, _) = RegressionModel::train(
            &mesh,
            &skeleton,
            skin.weights(),
            &train,
            &RegressionOptions::default(),
            &Run::default(),
        )
        .expect("trained");
        let samples: Vec<_> = train.iter().map(|e| e.matrices.clone()).collect();
        let new = example(0.7, 0.5).matrices;
        let full = model.positions(&new).expect("fits");
        let error = |most| {
            let reduced = model.reduced(&samples, most, &Run::default()).expect("fits");
            (rms(&reduced.positions(&new).expect("fits"), &full) / mesh.diagonal(), reduced.shape_count())
        };
        let (rigid, few, many) = (error(0), error(2), error(8));
        assert!(many.0 < 3e-5 && many.0 < 0.1 * few.0 && few.0 < 0.3 * rigid.0, "{rigid:?} {few:?} {many:?}");
        counts.push((few.1, many.1));
    }
    assert!(counts[0] == counts[1], "the same number for a surface five times as fine: {counts:?}");
}

#[test]
fn truncation_of_a_reduced_model_moves_no_vertex_by_more_than_reported() {
    let (mesh, skeleton, skin, example) = arm(16, 40);
    let train: Vec<Example> = (0..8).map(|k| example(0.2 * k as f64, 0.15 * ((3 * k) % 8) as f64)).collect();
    for hold in [10.0, 1e4] {
        let options = RegressionOptions { hold, ..RegressionOptions::default() };
        let (mut model, _) =
            RegressionModel::train(&mesh, &skeleton, skin.weights(), &train, &options, &Run::default())
                .expect("trained");
        let samples: Vec<_> = train.iter().map(|e| e.matrices.clone()).collect();
        // All shapes: nothing else is missing in the training poses.
        let reduced = model.reduced(&samples, 32, &Run::default()).expect("fits");
        for e in &train {
            let (few, all) =
                (reduced.positions(&e.matrices).expect("fits"), model.positions(&e.matrices).expect("fits"));
            let most = few.iter().zip(&all).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
            assert!(most < 4e-4 * mesh.diagonal(), "hold {hold}: {most}");
        }
    }
}

#[test]
fn reduced_models_scale_as_full_ones() {
    let (mesh, skeleton, skin, example) = arm(12, 24);
    let train: Vec<Example> = (0..6).map(|k| example(0.3 * k as f64, 0.2 * k as f64)).collect();
    let (mut model, _) = RegressionModel::train(
        &mesh,
        &skeleton,
        skin.weights(),
        &train,
        &RegressionOptions::default(),
        &Run::default(),
    )
    .expect("trained");
    let samples: Vec<_> = train.iter().map(|e| e.matrices.clone()).collect();
    let reduced = model.reduced(&samples, 8, &Run::default()).expect("fits");
    let mut pose = train[2].matrices.clone();
    pose[1] *= Matrix4::new_nonuniform_scaling(&Vector3::new(1.3, 0.8, 1.1));
    let (few, all) = (reduced.positions(&pose).expect("fits"), model.positions(&pose).expect("fits"));
    assert!(rms(&few, &all) < 1e-4 * mesh.diagonal(), "{}", rms(&few, &all));
}

#[test]
fn joints_are_recovered_from_vertices_and_weights_from_joints() {
    let (mesh, skeleton, skin) = tube(3, 12, 36);
    let posed = |a: f64| {
        matrices(&skeleton, &skin, |p| {
            p.locals[0].rotation = turn([1.0, 1.0, 0.0], a);
            p.locals[1].rotation = turn([0.0, 0.3, 1.0], 1.1 - a);
            p.locals[2].rotation = turn([1.0, 0.0, 0.5], 0.7 * a);
        })
    };
    let linear =
        Skinner::new(&mesh, None, &skeleton, &skin, SkinningMethod::LinearBlend, &Run::default()).expect("fits");
    let examples: Vec<Example> = [0.0, 0.4, 0.9, -0.8]
        .map(posed)
        .into_iter()
        .map(|matrices| {
            let positions = linear.positions(&matrices).expect("fits");
            Example { matrices, positions }
        })
        .collect();
    let found = fit_weights(&mesh, skin.weights(), &examples, &Run::default()).expect("fitted");
    // Where examples do not distinguish joints the weights may differ, with the same effect.
    let fitted = Skin::bound(found, &skeleton).expect("not flat");
    let again =
        Skinner::new(&mesh, None, &skeleton, &fitted, SkinningMethod::LinearBlend, &Run::default()).expect("fits");
    for example in &examples {
        assert!(rms(&again.positions(&example.matrices).expect("fits"), &example.positions) < 1e-3);
    }
    // Joints of a rigid skin are recovered exactly.
    let rigid =
        SkinWeights::rigid(3, &mesh.positions().iter().map(|p| ((p.x / 3.0) as u32).min(2)).collect::<Vec<_>>())
            .expect("joints");
    let moved = Skinner::new(
        &mesh,
        None,
        &skeleton,
        &Skin::bound(rigid.clone(), &skeleton).expect("fits"),
        SkinningMethod::LinearBlend,
        &Run::default(),
    );
    let m = posed(0.6);
    let fitted =
        fit_joints(&mesh, &skeleton, &rigid, &moved.expect("fits").positions(&m).expect("fits")).expect("fits");
    for (a, b) in m.iter().zip(&fitted) {
        assert!((a - b).amax() < 1e-10);
    }
}

#[test]
fn invalid_training_data_is_rejected() {
    let (mesh, skeleton, skin, example) = arm(6, 6);
    let train = |e: &[Example], ridge| {
        RegressionModel::train(
            &mesh,
            &skeleton,
            skin.weights(),
            e,
            &RegressionOptions { ridge, ..RegressionOptions::default() },
            &Run::default(),
        )
        .expect_err("refused")
        .to_string()
    };
    assert!(train(&[], 1e-2).contains("no example"));
    assert!(train(&[example(0.1, 0.0)], 0.0).contains("ridge 0"));
    let mut short = example(0.1, 0.0);
    short.positions.pop();
    assert!(train(&[short], 1e-2).contains("positions of an example do not fit"));
    let mut other = example(0.1, 0.0);
    other.matrices.pop();
    assert!(train(&[other], 1e-2).contains("2 joints but 1 matrices"));
}

#[test]
fn a_joint_without_influence_follows_its_parent_or_its_descendants() {
    let (mesh, skeleton, _) = tube(4, 10, 30);
    // The root and the leaf have no influence.
    let weights = SkinWeights::rigid(4, &mesh.positions().iter().map(|p| 1 + u32::from(p.x > 3.0)).collect::<Vec<_>>());
    let weights = weights.expect("joints");
    let motion = |j: usize| Trs::rigid(turn([0.3, 1.0, 0.2], 0.5 * j as f64), Vector3::new(j as f64, 0.0, 2.0));
    let place = |p: &Point3<f64>| motion(1 + usize::from(p.x > 3.0)).transform(p);
    let positions: Vec<_> = mesh.positions().iter().map(place).collect();
    let found = fit_joints(&mesh, &skeleton, &weights, &positions).expect("fits");
    for (found, expected) in found.iter().zip([1, 1, 2, 2]) {
        assert!((found - motion(expected).matrix()).amax() < 1e-9, "{found} {expected}");
    }
}

#[test]
fn cross_validated_options_predict_unseen_poses_well() {
    let (mesh, skeleton, skin, example) = arm(10, 24);
    let angle = |k: usize| (1.5 * k as f64 / 19.0, 1.2 * ((k * 7) % 20) as f64 / 19.0);
    let all: Vec<Example> = (0..20).map(|k| example(angle(k).0, angle(k).1)).collect();
    let (train, held): (Vec<_>, Vec<_>) = all.into_iter().enumerate().partition(|(k, _)| k % 3 != 0);
    let (train, held): (Vec<_>, Vec<_>) =
        (train.into_iter().map(|e| e.1).collect(), held.into_iter().map(|e| e.1).collect());
    let error = |options: &RegressionOptions| {
        let trained = RegressionModel::train(&mesh, &skeleton, skin.weights(), &train, options, &Run::default());
        let mut model = trained.expect("trained").0;
        let errors = held.iter().map(|e| rms(&model.positions(&e.matrices).expect("fits"), &e.positions));
        errors.sum::<f64>()
    };
    let found = tuned(&mesh, &skeleton, skin.weights(), &train, &Run::default()).expect("tuned");
    // These poses are explained by gradients and not by blends: small ridge, small position weight.
    assert!(found.hold <= 100.0 && found.ridge <= 1e-2, "{found:?}");
    let best = error(&found);
    for (ridge, hold) in [(1.0, found.hold), (found.ridge, 1e5), (1.0, 1e5)] {
        assert!(best < 0.8 * error(&RegressionOptions { ridge, hold }), "{found:?} {ridge} {hold}");
    }
}

#[test]
fn poses_are_recovered_from_vertices_alone_better_than_by_the_best_linear_blend() {
    let person = humanoid(0.07).expect("its own data");
    let (mesh, skeleton, skin) = (person.model.mesh(), &person.skeleton, &person.skin);
    let curved =
        Skinner::new(mesh, None, skeleton, skin, SkinningMethod::DualQuaternion, &Run::default()).expect("its own");
    let mut shown = Vec::new();
    for clip in &person.clips {
        let (first, last) = clip.span().expect("keys");
        for k in 0..6 {
            let time = first + (last - first) * f64::from(k) / 6.0;
            let pose = clip.pose(skeleton, time, Extrapolation::Constant).expect("valid");
            let m = skin.joint_matrices(&skeleton.globals(&pose).expect("valid")).expect("valid");
            let positions = curved.positions(&m).expect("fits");
            // Only the vertices of a pose are known.
            let matrices = fit_joints(mesh, skeleton, skin.weights(), &positions).expect("fits");
            shown.push(Example { matrices, positions });
        }
    }
    let (held, train): (Vec<_>, Vec<_>) = shown.into_iter().enumerate().partition(|(k, _)| k % 4 == 1);
    let [held, train] = [held, train].map(|set| set.into_iter().map(|e| e.1).collect::<Vec<_>>());
    let options = tuned(mesh, skeleton, skin.weights(), &train, &Run::default()).expect("tuned");
    let (mut model, report) =
        RegressionModel::train(mesh, skeleton, skin.weights(), &train, &options, &Run::default()).expect("trained");
    assert!(report.error < 0.8 * report.linear_error, "{report:?}");
    let (mut mine, mut linear) = (0.0, 0.0);
    for e in &held {
        mine += rms(&model.positions(&e.matrices).expect("fits"), &e.positions);
        linear += rms(&model.linear_positions(&e.matrices).expect("fits"), &e.positions);
    }
    assert!(mine < linear, "{mine} {linear}");
}

#[test]
fn undetermined_weights_stay_at_their_prior() {
    let (mesh, skeleton, skin) = tube(3, 10, 30);
    // The last two joints move together in all examples, and at rest all do.
    let posed = |a: f64| matrices(&skeleton, &skin, |p| p.locals[1].rotation = turn([0.0, 0.3, 1.0], a));
    let linear =
        Skinner::new(&mesh, None, &skeleton, &skin, SkinningMethod::LinearBlend, &Run::default()).expect("fits");
    for angles in [&[0.0][..], &[0.0, 0.7, -1.2]] {
        let example = |&a: &f64| Example { positions: linear.positions(&posed(a)).expect("fits"), matrices: posed(a) };
        let examples: Vec<Example> = angles.iter().map(example).collect();
        let found = fit_weights(&mesh, skin.weights(), &examples, &Run::default()).expect("fitted");
        for v in 0..mesh.vertex_count() {
            for j in 0..3 {
                let (found, given) = (found.weight(v, j), skin.weights().weight(v, j));
                assert!((found - given).abs() < 1e-6, "{angles:?}, vertex {v}, joint {j}: {found} {given}");
            }
        }
    }
}

#[test]
fn a_morphed_rest_surface_deforms_from_there() {
    let (mesh, skeleton, skin, example) = arm(12, 30);
    let train: Vec<Example> = (0..6).map(|k| example(0.25 * k as f64, 0.2 * k as f64)).collect();
    let (mut model, _) = RegressionModel::train(
        &mesh,
        &skeleton,
        skin.weights(),
        &train,
        &RegressionOptions::default(),
        &Run::default(),
    )
    .expect("trained");
    let samples: Vec<_> = train.iter().map(|e| e.matrices.clone()).collect();
    let file = SkinModel::of_reduced(&mesh, &skeleton, &model.reduced(&samples, 8, &Run::default()).expect("fits"))
        .expect("its own");
    let mut few = file.bound(&mesh, &skeleton, &Run::default()).expect("its own");
    // A bump on the upper arm, which is far from the elbow.
    let bump = |p: &Point3<f64>| Vector3::y() * (0.4 * (-(p.x - 0.7).powi(2) / 0.05).exp());
    let morphed: Vec<_> = mesh.positions().iter().map(|p| p + bump(p)).collect();
    let motion = Trs::rigid(turn([1.0, -0.5, 0.3], 1.3), Vector3::new(2.0, 0.0, -1.0)).matrix();
    let pose: Vec<_> = train[4].matrices.iter().map(|m| motion * m).collect();
    let before = (model.positions(&pose).expect("fits"), few.positions(&pose).expect("fits"));
    model.set_rest(&morphed).expect("as many");
    few.set_rest(&morphed, &Run::default()).expect("as many");
    let after = (model.positions(&pose).expect("fits"), few.positions(&pose).expect("fits"));
    let turned = pose[0].fixed_view::<3, 3>(0, 0).into_owned();
    for (v, p) in mesh.positions().iter().enumerate().filter(|(_, p)| p.x < 1.5) {
        let full = after.0[v] - before.0[v];
        assert!((full - turned * bump(p)).norm() < 0.04, "{p}: {full} {}", turned * bump(p));
        assert!((after.1[v] - before.1[v] - full).norm() < 2e-4 * mesh.diagonal(), "{p}: {full}");
    }
    // And back.
    few.set_rest(mesh.positions(), &Run::default()).expect("as many");
    assert_eq!(few.positions(&pose).expect("fits"), before.1);
    assert!(model.set_rest(&morphed[1..]).expect_err("one less").to_string().contains("positions at rest do not fit"));
}
