//! Laws of extraction on procedural shapes.

use std::ops::ControlFlow;

use nalgebra::{Point3, Rotation3, Vector3};

use super::*;
use crate::mesh::shapes;
use plumbline_num::run::{Run, Stopped};

mod curve;
mod ends;
mod steps;

fn curve_of(mesh: &TriMesh) -> (CurveSkeleton, ExtractionReport) {
    extract(mesh, &ExtractionOptions::default(), &mut |_| ControlFlow::Continue(()), &Run::default()).unwrap()
}

fn moved(mesh: &TriMesh, place: impl Fn(&Point3<f64>) -> Point3<f64>) -> TriMesh {
    mesh.with_positions(mesh.positions().iter().map(place).collect()).unwrap()
}

/// A capsule of radius 1 about a curve of unit speed in the plane `z = 0`, `length` long.
fn capsule(length: f64, along: impl Fn(f64) -> (Point3<f64>, Vector3<f64>)) -> TriMesh {
    let (around, rings, caps) = (32, 60, 10);
    let mut profile: Vec<(f64, f64)> = Vec::new();
    let quarter = std::f64::consts::FRAC_PI_2;
    profile.extend((1..caps).map(|k| {
        let a = quarter * f64::from(k) / f64::from(caps);
        (-a.cos(), a.sin())
    }));
    profile.extend((0..=rings).map(|k| (length * f64::from(k) / f64::from(rings), 1.0)));
    profile.extend((1..caps).rev().map(|k| {
        let a = quarter * f64::from(k) / f64::from(caps);
        (length + a.cos(), a.sin())
    }));
    let frame = |s: f64| {
        let (p, t) = along(s.clamp(0.0, length));
        (p + t * (s - s.clamp(0.0, length)), Vector3::new(-t.y, t.x, 0.0), Vector3::z())
    };
    let mut positions = vec![frame(-1.0).0];
    for &(s, r) in &profile {
        let (p, u, v) = frame(s);
        positions.extend((0..around).map(|k| {
            let a = std::f64::consts::TAU * f64::from(k) / f64::from(around);
            p + (u * a.cos() + v * a.sin()) * r
        }));
    }
    positions.push(frame(length + 1.0).0);
    let last = positions.len() as u32 - 1;
    let n = around as u32;
    let mut triangles = Vec::new();
    for k in 0..n {
        let next = (k + 1) % n;
        triangles.push([0, 1 + next, 1 + k]);
        for ring in 0..profile.len() as u32 - 1 {
            let (a, b) = (1 + ring * n + k, 1 + ring * n + next);
            triangles.extend([[a, b, b + n], [a, b + n, a + n]]);
        }
        let ring = 1 + (profile.len() as u32 - 1) * n;
        triangles.push([last, ring + k, ring + next]);
    }
    TriMesh::new(positions, triangles).unwrap()
}

/// A row of nodes beside the axis of a capsule, and a side branch of one node from its middle.
fn comb(from: f64, to: f64, side: f64) -> curve_graph::CurveGraph {
    let along = |k: usize| from + (to - from) * k as f64 / 20.0;
    let mut nodes: Vec<_> = (0..=20).map(|k| Point3::new(along(k), 0.02, 0.01)).collect();
    let mut edges: Vec<[u32; 2]> = (0..20).map(|k| [k, k + 1]).collect();
    nodes.push(Point3::new(along(10), side, 0.0));
    edges.push([10, 21]);
    curve_graph::CurveGraph::new(nodes, &edges, Vec::new())
}

/// A row of nodes through the points, with edges about a twentieth long.
fn row(places: &[[f64; 3]]) -> curve_graph::CurveGraph {
    let mut nodes = vec![Point3::from(places[0])];
    for pair in places.windows(2) {
        let [p, q] = [pair[0], pair[1]].map(Point3::from);
        let parts = (nalgebra::distance(&p, &q) / 0.05).ceil();
        nodes.extend((1..=parts as usize).map(|k| p + (q - p) * (k as f64 / parts)));
    }
    let edges: Vec<[u32; 2]> = (1..nodes.len() as u32).map(|k| [k - 1, k]).collect();
    curve_graph::CurveGraph::new(nodes, &edges, Vec::new())
}
