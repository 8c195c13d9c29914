//! Surfaces of revolution and spheres.

use std::collections::BTreeMap;
use std::f64::consts::TAU;

use nalgebra::Point3;

use super::super::TriMesh;
use super::{halves, made};

/// An open tube around the z axis: `rows` cells from `z = 0` to `height`, `sides` cells around. Vertices ring by ring.
pub fn tube(sides: usize, rows: usize, radius: f64, height: f64) -> TriMesh {
    let (positions, triangles) = wall(sides.max(3), rows.max(1), radius, height);
    made(positions, triangles)
}

/// [`tube`] closed by two triangle fans, whose centers are the last two vertices: bottom, top.
pub fn cylinder(sides: usize, rows: usize, radius: f64, height: f64) -> TriMesh {
    let (sides, rows) = (sides.max(3), rows.max(1));
    let (mut positions, mut triangles) = wall(sides, rows, radius, height);
    let bottom = positions.len() as u32;
    positions.extend([Point3::origin(), Point3::new(0.0, 0.0, height)]);
    let (n, last) = (sides as u32, (rows * sides) as u32);
    for i in 0..n {
        let next = (i + 1) % n;
        triangles.extend([[bottom, next, i], [bottom + 1, last + i, last + next]]);
    }
    made(positions, triangles)
}

/// Positions and triangles of the lateral surface.
fn wall(sides: usize, rows: usize, radius: f64, height: f64) -> (Vec<Point3<f64>>, Vec<[u32; 3]>) {
    let vertex = |k: usize| {
        let (angle, z) = (TAU * (k % sides) as f64 / sides as f64, height * (k / sides) as f64 / rows as f64);
        Point3::new(radius * angle.cos(), radius * angle.sin(), z)
    };
    let cell = |k: usize| {
        let (i, row) = (k % sides, k / sides);
        let at = |i: usize, row: usize| (row * sides + i % sides) as u32;
        halves([at(i, row), at(i + 1, row), at(i + 1, row + 1), at(i, row + 1)], (i + row) % 2 == 1)
    };
    ((0..sides * (rows + 1)).map(vertex).collect(), (0..sides * rows).flat_map(cell).collect())
}

/// The unit sphere as an icosahedron with `levels` 1-to-4 subdivisions, `10·4^levels + 2` vertices.
pub fn icosphere(levels: u32) -> TriMesh {
    let (mut positions, mut triangles) = icosahedron();
    for _ in 0..levels {
        let mut middles = BTreeMap::new();
        let mut middle = |a: u32, b: u32| {
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                let sum = positions[a as usize].coords + positions[b as usize].coords;
                positions.push(Point3::from(sum.normalize()));
                positions.len() as u32 - 1
            })
        };
        let quarters = |&[a, b, c]: &[u32; 3]| {
            let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
            [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
        };
        triangles = triangles.iter().flat_map(quarters).collect();
    }
    made(positions, triangles)
}

/// The regular icosahedron: poles at ±z and two rings of five vertices at `z = ±1/√5`, of radius `2/√5`.
fn icosahedron() -> (Vec<Point3<f64>>, Vec<[u32; 3]>) {
    let z = 0.2_f64.sqrt();
    let ring = |up: bool| {
        (0..5).map(move |k| {
            let angle = TAU * (k as f64 + if up { 0.5 } else { 0.0 }) / 5.0;
            Point3::new(2.0 * z * angle.cos(), 2.0 * z * angle.sin(), if up { z } else { -z })
        })
    };
    let poles = [Point3::new(0.0, 0.0, -1.0), Point3::new(0.0, 0.0, 1.0)];
    let positions = poles.into_iter().chain(ring(false)).chain(ring(true)).collect();
    let fifth = |k: u32| {
        let (low, next, up, up_next) = (2 + k, 2 + (k + 1) % 5, 7 + k, 7 + (k + 1) % 5);
        [[0, next, low], [low, next, up], [next, up_next, up], [1, up, up_next]]
    };
    (positions, (0..5).flat_map(fifth).collect())
}
