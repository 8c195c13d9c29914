use nalgebra::Point3;

use super::super::{CorrespondenceMethod, CorrespondenceOptions, correspond};
use super::*;
use crate::mesh::shapes;
use plumbline_num::run::Run;

/// No triangle turned over, and their solid angles make one sphere.
fn assert_bijective(mesh: &TriMesh, at: &[Vector3<f64>]) {
    let mut whole = 0.0;
    for t in mesh.triangles() {
        let [a, b, c] = t.map(|v| at[v as usize]);
        let volume = a.dot(&b.cross(&c));
        assert!(volume > 0.0, "{volume:e}");
        // Van Oosterom and Strackee.
        whole += 2.0 * volume.atan2(1.0 + a.dot(&b) + b.dot(&c) + c.dot(&a));
    }
    assert!((whole - 4.0 * std::f64::consts::PI).abs() < 1e-6, "{whole}");
}

fn shapes_of_genus_0() -> Vec<TriMesh> {
    let stretched = shapes::icosphere(3);
    let position = |p: &Point3<f64>| Point3::new(p.x, p.y * 0.3, 6.0 * p.z + p.x * p.x);
    let stretched = stretched.with_positions(stretched.positions().iter().map(position).collect()).unwrap();
    vec![shapes::icosphere(0), shapes::bar([2, 3, 9], [1.0, 1.0, 6.0]), shapes::cactus(10), stretched]
}

#[test]
fn maps_of_genus_0_surfaces_to_the_sphere_are_bijective() {
    for mesh in shapes_of_genus_0() {
        assert_bijective(&mesh, &sphere_map(&mesh, "first", &Run::default()).unwrap());
    }
}

#[test]
fn the_map_of_a_surface_to_itself_over_the_sphere_is_near_the_identity() {
    for mesh in shapes_of_genus_0() {
        let landmarks: Vec<(u32, u32)> = (0..mesh.vertex_count() as u32).step_by(7).map(|v| (v, v)).collect();
        let method = CorrespondenceOptions::from(CorrespondenceMethod::Sphere);
        let laid = correspond(&mesh, &mesh, &landmarks, &method, &Run::default()).unwrap();
        // Relaxation ends where a sweep decreases the energy little.
        let off = laid.mapped.positions().iter().zip(mesh.positions()).map(|(p, q)| (p - q).norm());
        let off = off.fold(0.0, f64::max) / mesh.diagonal();
        assert!(off < 0.03 && laid.quality.stretch < 1.01 && laid.quality.collapsed == 0, "{off} {:?}", laid.quality);
    }
}

#[test]
fn landmarks_coincide_on_the_sphere_without_inversions() {
    let (first, second) = (shapes::icosphere(3), shapes::bar([4, 5, 12], [1.0, 1.0, 3.0]));
    // The six directions of the axes.
    let extreme = |mesh: &TriMesh, k: usize, sign: f64| {
        let (low, high) = mesh.bounding_box().unwrap();
        let middle = nalgebra::center(&low, &high);
        let along = |v: &u32| {
            let p = mesh.positions()[*v as usize] - middle;
            sign * p[k] - 0.1 * (p.norm() - p[k].abs())
        };
        (0..mesh.vertex_count() as u32).max_by(|a, b| along(a).total_cmp(&along(b))).unwrap()
    };
    let landmarks: Vec<(u32, u32)> = (0..3)
        .flat_map(|k| [(k, 1.0), (k, -1.0)])
        .map(|(k, s)| (extreme(&first, k, s), extreme(&second, k, s)))
        .collect();
    let laid = correspond(&first, &second, &landmarks, &CorrespondenceMethod::Sphere.into(), &Run::default()).unwrap();
    assert!(laid.quality.landmark_error < 1e-12, "{}", laid.quality.landmark_error);
    assert_eq!(laid.quality.collapsed, 0);
    // Every place on its triangle.
    assert!(laid.points.iter().all(|p| p.weights.iter().all(|w| *w >= 0.0)));
}

/// A ball with six limbs, each as long as so many radii, turned a little.
fn with_limbs(levels: u32, length: f64) -> TriMesh {
    let ball = shapes::icosphere(levels);
    let rotation = nalgebra::Rotation3::from_scaled_axis(Vector3::new(0.2, -0.3, 0.1));
    let limb = |p: &Point3<f64>| {
        let q = rotation * p;
        q * (1.0 + length * (-30.0 * (1.0 - q.coords.amax())).exp())
    };
    ball.with_positions(ball.positions().iter().map(limb).collect()).unwrap()
}

/// The vertex farthest in a direction.
fn farthest(mesh: &TriMesh, to: &Vector3<f64>) -> u32 {
    let along = |v: &u32| mesh.positions()[*v as usize].coords.dot(to);
    (0..mesh.vertex_count() as u32).max_by(|a, b| along(a).total_cmp(&along(b))).unwrap()
}

#[test]
fn long_limbs_keep_area_on_the_sphere() {
    let mesh = with_limbs(4, 9.0);
    let at = sphere_map(&mesh, "first", &Run::default()).unwrap();
    assert_bijective(&mesh, &at);
    let share = |t: &[u32; 3], p: &dyn Fn(u32) -> Vector3<f64>| {
        let [a, b, c] = t.map(p);
        0.5 * (b - a).cross(&(c - a)).norm()
    };
    for t in mesh.triangles() {
        let on_surface = share(t, &|v| mesh.positions()[v as usize].coords) / mesh.area();
        let on_sphere = share(t, &|v| at[v as usize]) / (4.0 * std::f64::consts::PI);
        assert!(on_sphere > 0.05 * on_surface, "{on_sphere:e} {on_surface:e}");
    }
}

#[test]
fn landmarks_at_the_tips_map_limbs_to_limbs_without_folds() {
    let (first, second) = (with_limbs(3, 4.0), with_limbs(4, 6.0));
    let axes = (0..3).flat_map(|k| [Vector3::ith(k, 1.0), Vector3::ith(k, -1.0)]);
    let landmarks: Vec<(u32, u32)> = axes.map(|d| (farthest(&first, &d), farthest(&second, &d))).collect();
    let method = CorrespondenceOptions::from(CorrespondenceMethod::Sphere);
    for landmarks in [&landmarks[..], &landmarks[..2]] {
        let laid = correspond(&first, &second, landmarks, &method, &Run::default()).unwrap();
        assert!(laid.quality.landmark_error < 1e-12, "{}", laid.quality.landmark_error);
        assert_eq!(laid.quality.collapsed, 0);
        if landmarks.len() > 2 {
            assert!(laid.quality.flipped == 0 && laid.quality.stretch < 2.0, "{:?}", laid.quality);
        }
    }
}

#[test]
fn the_automatic_method_takes_registration_where_it_passes_and_else_the_map_that_fails_least() {
    let correspond = |first: &TriMesh, second: &TriMesh, landmarks: &[(u32, u32)], method: CorrespondenceMethod| {
        correspond(first, second, landmarks, &method.into(), &Run::default()).unwrap()
    };
    let mesh = shapes::cactus(9);
    let own: Vec<(u32, u32)> = (0..mesh.vertex_count() as u32).step_by(40).map(|v| (v, v)).collect();
    assert_eq!(correspond(&mesh, &mesh, &own, CorrespondenceMethod::Auto).method, CorrespondenceMethod::Registration);
    let (first, second) = (with_limbs(3, 4.0), with_limbs(4, 6.0));
    let axes = (0..3).flat_map(|k| [Vector3::ith(k, 1.0), Vector3::ith(k, -1.0)]);
    let tips: Vec<(u32, u32)> = axes.map(|d| (farthest(&first, &d), farthest(&second, &d))).collect();
    // A limb is laid over another one.
    let crossed: Vec<(u32, u32)> = (0..6).map(|k| (tips[k].0, tips[[0, 1, 3, 2, 5, 4][k]].1)).collect();
    for landmarks in [&tips, &crossed] {
        let [auto, registration, sphere] =
            [CorrespondenceMethod::Auto, CorrespondenceMethod::Registration, CorrespondenceMethod::Sphere]
                .map(|method| correspond(&first, &second, landmarks, method));
        let expected = if registration.excess() <= 1.0 {
            registration.excess()
        } else {
            registration.excess().min(sphere.excess())
        };
        assert_eq!(auto.excess(), expected, "{:?}", auto.quality);
    }
    // An open surface has no map over the sphere.
    let plane = shapes::plane(6);
    let spiked = shapes::spiked_plane(8, 4, 0.5);
    let corners = [0, 6, 48].into_iter().zip([0, 8, 80]).collect::<Vec<_>>();
    let laid = correspond(&plane, &spiked, &corners, CorrespondenceMethod::Auto);
    assert_ne!(laid.method, CorrespondenceMethod::Sphere);
}

#[test]
fn surfaces_of_other_topology_are_rejected() {
    let message = |mesh: &TriMesh| sphere_map(mesh, "second", &Run::default()).unwrap_err().to_string();
    assert!(message(&shapes::plane(3)).contains("the second mesh has a boundary: 12 edges"));
    assert!(message(&shapes::holed_torus(1, 10)).contains("has genus 1"));
    let two = shapes::disjoint(&[shapes::icosphere(1), shapes::icosphere(1)]);
    assert!(message(&two).contains("has 2 connected components"));
    assert!(message(&shapes::book(3)).contains("the second mesh is not an oriented manifold: vertices"));
}
