//! Welding of coincident vertices.

use std::cell::Cell;
use std::collections::HashMap;

use nalgebra::{Point3, Vector3};

use super::{TriMesh, Weld};
use crate::mesh::edge_groups;
use plumbline_num::run::{Run, Stopped};
use plumbline_num::spatial::{KdTree, UnionFind};

/// Vertices that are looked at for each open one, on average: six triangles meet at most vertices. Where thousands are within reach of
/// each other, most of their gaps stay.
const LOOKS: usize = 64;

/// Sets of welded vertices of a mesh, and the number of vertices that were not in the same place as another of their set.
pub(super) fn join(mesh: &TriMesh, weld: Weld, unreferenced: &[u32], run: &Run) -> Result<(UnionFind, usize), Stopped> {
    let mut joined = UnionFind::new(mesh.vertex_count());
    if weld != Weld::Never {
        join_equal(mesh.positions(), &mut joined);
    }
    let equal = joined.joined();
    match weld {
        Weld::Never | Weld::Exact => {}
        Weld::Gaps(fraction) => join_across_gaps(mesh, fraction, &mut joined, run)?,
        Weld::Within(fraction) => {
            let distance = fraction * diagonal(mesh, unreferenced);
            if distance > 0.0 && distance.is_finite() {
                join_near(mesh.positions(), distance, &mut joined, run)?;
            }
        }
    }
    let bridged = joined.joined() - equal;
    Ok((joined, bridged))
}

/// Bounding box diagonal of the referenced vertices; isolated ones may be arbitrarily far away.
fn diagonal(mesh: &TriMesh, unreferenced: &[u32]) -> f64 {
    let mut named =
        mesh.positions().iter().enumerate().filter(|(v, _)| unreferenced.binary_search(&(*v as u32)).is_err());
    let Some((_, &first)) = named.next() else { return 0.0 };
    let (low, high) = named.fold((first, first), |(low, high), (_, p)| (low.inf(p), high.sup(p)));
    (high - low).norm()
}

/// Joins vertices with equal coordinates, by hashing their bits.
fn join_equal(positions: &[Point3<f64>], joined: &mut UnionFind) {
    let mut first = HashMap::with_capacity(positions.len());
    for (vertex, p) in positions.iter().enumerate() {
        // Adding +0 maps −0 to +0, so that both have the same bits.
        let bits = [p.x, p.y, p.z].map(|x| (x + 0.0).to_bits());
        let other = *first.entry(bits).or_insert(vertex as u32);
        joined.join(other, vertex as u32);
    }
}

/// Spatial hashing in grid cells whose diagonal is the weld distance: all vertices of a cell are welded, and vertices within
/// the distance are at most two cells apart.
fn join_near(positions: &[Point3<f64>], distance: f64, joined: &mut UnionFind, run: &Run) -> Result<(), Stopped> {
    let side = distance / 3.0_f64.sqrt();
    let origin = positions.iter().fold(Point3::from([f64::INFINITY; 3]), |low, p| low.inf(p));
    let cube = |p: &Point3<f64>| -> [i64; 3] { ((p - origin) / side).map(|x| x.floor() as i64).into() };
    let mut inside: HashMap<[i64; 3], Vec<u32>> = HashMap::new();
    for (vertex, p) in positions.iter().enumerate() {
        if joined.root(vertex as u32) == vertex as u32 {
            inside.entry(cube(p)).or_default().push(vertex as u32);
        }
    }
    // The iteration order of the hash map does not affect the resulting sets.
    for (cube, vertices) in &inside {
        run.check()?;
        for &vertex in vertices {
            joined.join(vertices[0], vertex);
        }
        for offset in forward_offsets() {
            let near = std::array::from_fn(|k| cube[k].saturating_add(offset[k]));
            let Some(others) = inside.get(&near) else { continue };
            let position = |&v: &u32| positions[v as usize];
            let touch = |p: &u32| others.iter().any(|q| Vector3::norm(&(position(p) - position(q))) <= distance);
            if vertices.iter().any(touch) {
                joined.join(vertices[0], others[0]);
            }
        }
    }
    Ok(())
}

/// Joins vertices at open edges whose distance is at most `fraction` of the shortest edge at either.
fn join_across_gaps(mesh: &TriMesh, fraction: f64, joined: &mut UnionFind, run: &Run) -> Result<(), Stopped> {
    let origins: Vec<u32> = mesh.triangles().as_flattened().iter().map(|v| joined.root(*v)).collect();
    let mut reach = vec![f64::INFINITY; mesh.vertex_count()];
    let mut is_open = vec![false; mesh.vertex_count()];
    for edge in edge_groups(&origins).iter() {
        let ends = [(edge[0].0 >> 32) as u32, edge[0].0 as u32].map(|v| v as usize);
        if ends[0] == ends[1] {
            continue;
        }
        let length = nalgebra::distance(&mesh.positions()[ends[0]], &mesh.positions()[ends[1]]);
        for v in ends {
            reach[v] = reach[v].min(fraction * length);
            is_open[v] |= edge.len() == 1;
        }
    }
    run.check()?;
    let open: Vec<u32> = (0..mesh.vertex_count() as u32).filter(|v| is_open[*v as usize]).collect();
    let points: Vec<Point3<f64>> = open.iter().map(|v| mesh.positions()[*v as usize]).collect();
    let tree = KdTree::new(&points);
    let looks = Cell::new(LOOKS * open.len());
    for (&v, p) in open.iter().zip(&points) {
        run.check()?;
        let square = reach[v as usize].powi(2);
        while looks.get() > 0 {
            let is_apart = |k: u32| {
                looks.set(looks.get().saturating_sub(1));
                let u = open[k as usize];
                joined.root(u) != joined.root(v) && nalgebra::distance(p, &points[k as usize]) <= reach[u as usize]
            };
            let Some((k, _)) = tree.nearest_within(p, square, is_apart) else { break };
            joined.join(v, open[k as usize]);
        }
    }
    Ok(())
}

/// One of each pair of opposite offsets to the cells within distance two: 62 of the 124 in a 5 × 5 × 5 block.
fn forward_offsets() -> impl Iterator<Item = [i64; 3]> {
    (1..=62).map(|k: i64| {
        let k = k + 62;
        [k / 25 - 2, k / 5 % 5 - 2, k % 5 - 2]
    })
}
