use nalgebra::{UnitQuaternion, Vector3};

use super::*;
use crate::character::Joint;
use plumbline_num::math::Trs;

fn keys(interpolation: Interpolation<3>) -> Keys<3> {
    let values = vec![[0.0, 1.0, 2.0], [1.0, -1.0, 2.0], [4.0, 0.0, 3.0], [0.0, 0.0, 0.0]];
    Keys::new(vec![0.0, 0.5, 2.0, 2.25], values, interpolation).expect("valid")
}

fn turns() -> Vec<UnitQuaternion<f64>> {
    [[0.1, 0.2, 0.3], [1.2, -0.5, 0.1], [2.0, 0.4, -0.7], [0.0, 0.0, 3.0]]
        .map(|v| UnitQuaternion::from_scaled_axis(Vector3::from(v)))
        .to_vec()
}

fn chain() -> Skeleton {
    let joint = |name: &str, parent| Joint {
        name: name.into(),
        parent,
        rest: Trs::from_translation(Vector3::x()),
        limits: None,
    };
    Skeleton::new(vec![joint("a", None), joint("b", Some(0))]).expect("valid")
}

#[test]
fn every_curve_passes_through_its_keys_and_extrapolates_constantly() {
    let tangents = vec![[0.3, -1.0, 2.0]; 4];
    let cubic = Interpolation::Cubic { arriving: tangents.clone(), leaving: tangents };
    for interpolation in [Interpolation::Step, Interpolation::Linear, Interpolation::Smooth, cubic] {
        let curve = keys(interpolation);
        for (k, &t) in curve.times().iter().enumerate() {
            assert_eq!(curve.at(t), curve.values()[k]);
        }
        assert_eq!((curve.at(-1.0), curve.at(9.0)), (curve.values()[0], curve.values()[3]));
    }
    for interpolation in [Interpolation::Step, Interpolation::Linear, Interpolation::Smooth] {
        let curve = rotations(vec![0.0, 0.5, 2.0, 2.25], &turns(), interpolation).expect("valid");
        for (k, &t) in curve.keys().times().iter().enumerate() {
            assert!(curve.at(t).angle_to(&turns()[k]) < 1e-14);
        }
    }
}

#[test]
fn a_step_keeps_the_value_before_and_a_line_is_straight() {
    assert_eq!(keys(Interpolation::Step).at(1.999), [1.0, -1.0, 2.0]);
    let half = keys(Interpolation::Linear).at(1.25);
    assert_eq!(half, [2.5, -0.5, 2.5]);
}

#[test]
fn smooth_curves_have_equal_velocities_on_both_sides_of_a_key() {
    let (vectors, h) = (keys(Interpolation::Smooth), 1e-6);
    let turning = rotations(vec![0.0, 0.5, 2.0, 2.25], &turns(), Interpolation::Smooth).expect("valid");
    for t in [0.5, 2.0] {
        let at = |t| Vector3::from(vectors.at(t));
        let (left, right) = ((at(t) - at(t - h)) / h, (at(t + h) - at(t)) / h);
        assert!((left - right).norm() < 1e-3, "{left} {right}");
        let rate = |a: f64, b: f64| (turning.at(a).inverse() * turning.at(b)).scaled_axis() / h;
        let (left, right) = (rate(t - h, t), rate(t, t + h));
        assert!((left - right).norm() < 1e-3, "{left} {right}");
    }
}

#[test]
fn motion_at_constant_velocity_is_reproduced_for_any_key_spacing() {
    let times = vec![0.0, 0.1, 1.0, 1.4, 3.0];
    let rate = Vector3::new(0.5, -0.3, 0.6);
    let turn = |t: f64| UnitQuaternion::from_scaled_axis(rate * t);
    let turns: Vec<_> = times.iter().map(|&t| turn(t)).collect();
    let values: Vec<[f64; 3]> = times.iter().map(|&t| (rate * t).into()).collect();
    for (turning, moving) in
        [(Interpolation::Linear, Interpolation::Linear), (Interpolation::Smooth, Interpolation::Smooth)]
    {
        let turning = rotations(times.clone(), &turns, turning).expect("valid");
        let moving = Keys::new(times.clone(), values.clone(), moving).expect("valid");
        for t in (0..=300).map(|k| f64::from(k) * 0.01) {
            assert!(turning.at(t).angle_to(&turn(t)) < 1e-7);
            assert!((Vector3::from(moving.at(t)) - rate * t).norm() < 1e-13);
        }
    }
}

#[test]
fn rotations_interpolate_on_the_shortest_path_for_any_quaternion_signs() {
    let flip = |q: &UnitQuaternion<f64>| UnitQuaternion::new_unchecked(-q.into_inner());
    let plain = turns();
    let mixed: Vec<_> = plain.iter().enumerate().map(|(k, q)| if k % 2 == 0 { *q } else { flip(q) }).collect();
    for interpolation in [Interpolation::Linear, Interpolation::Smooth] {
        let [a, b] =
            [&plain, &mixed].map(|q| rotations(vec![0.0, 1.0, 2.0, 3.0], q, interpolation.clone()).expect("valid"));
        for t in (0..30).map(|k| f64::from(k) * 0.1) {
            assert!(a.at(t).angle_to(&b.at(t)) < 1e-7);
        }
    }
    let close = [UnitQuaternion::identity(), UnitQuaternion::from_scaled_axis(Vector3::z() * 3.0)];
    let half = rotations(vec![0.0, 1.0], &close, Interpolation::Linear).expect("valid").at(0.5);
    assert!((half.scaled_axis() - Vector3::z() * 1.5).norm() < 1e-12);
}

#[test]
fn extrapolation_repeats_or_is_constant() {
    let clip = Clip::new("c", vec![Track { joint: 1, curve: Curve::Scale(keys(Interpolation::Linear)) }], vec![])
        .expect("valid");
    let at = |t, extrapolation| clip.pose(&chain(), t, extrapolation).expect("valid");
    assert_eq!(at(0.75, Extrapolation::Repeat), at(0.75, Extrapolation::Constant));
    for t in [-4.0, 5.0, 100.0] {
        let within = f64::rem_euclid(t, 2.25);
        let (a, b) = (at(t, Extrapolation::Repeat), at(within, Extrapolation::Constant));
        assert!((a.locals[1].scale - b.locals[1].scale).norm() < 1e-9);
    }
    assert_eq!(clip.pose(&chain(), 0.0, Extrapolation::Constant).expect("valid").locals[0], chain().joints()[0].rest);
}

#[test]
fn errors_name_the_key_and_the_value() {
    let told = |times: Vec<f64>, x: f64| {
        let values = times.iter().map(|_| [x]).collect();
        Keys::<1>::new(times, values, Interpolation::Linear).expect_err("to be refused").to_string()
    };
    assert!(told(vec![], 0.0).starts_with("0 key times and 0 values"));
    assert_eq!(
        told(vec![0.0, 2.0, 1.0], 0.0),
        "key 2 is at 1 s, after one at 2 s; times of keys must be finite and ascend"
    );
    assert!(told(vec![0.0, f64::NAN], 0.0).starts_with("key 1 is at NaN s"));
    assert!(told(vec![0.0, 0.0], 0.0).starts_with("key 1 is at 0 s, after one at 0 s"));
    assert_eq!(told(vec![0.0], f64::NAN), "the value of key 0 is not finite");
    let none = Keys::new(vec![0.0], vec![[0.0; 4]], Interpolation::Linear).and_then(RotationKeys::new);
    assert!(none.expect_err("to be refused").to_string().contains("no length"));
    let track = |joint| Track { joint, curve: Curve::Scale(keys(Interpolation::Linear)) };
    let twice = Clip::new("c", vec![track(1), track(1)], vec![]).expect_err("to be refused");
    assert_eq!(twice.to_string(), "clip \"c\" has two tracks for the scale 1");
    let far = Clip::new("c", vec![track(7)], vec![]).expect("valid").pose(&chain(), 0.0, Extrapolation::Constant);
    assert_eq!(
        far.expect_err("to be refused").to_string(),
        "clip \"c\" moves joint 7, but there are 2, numbered from 0"
    );
}
