//! Simplification of a closed surface to a tetrahedron by vertex removals.
//!
//! A vertex `v` may collapse to its neighbor `u` if both have exactly two common neighbors (the link condition): the topology is then
//! preserved. Vertices of low valence with short edges are removed first.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use crate::mesh::{HalfEdges, TriMesh};
use plumbline_num::run::{Run, Stopped};

/// A removed vertex.
#[derive(Clone, Debug)]
pub(super) struct Removed {
    pub(super) vertex: u32,
    /// Its neighbors at removal, counterclockwise; the first is the collapse target.
    pub(super) ring: Vec<u32>,
}

/// The removals down to four vertices.
#[derive(Clone, Debug)]
pub(super) struct Removals {
    pub(super) vertices: Vec<Removed>,
    /// The four remaining vertices, with their neighbors counterclockwise.
    pub(super) left: Vec<(u32, Vec<u32>)>,
}

/// Removes vertices of a closed surface of genus 0, those of `late` last; `None` if no vertex can be removed before four remain.
pub(super) fn removals(mesh: &TriMesh, late: &[bool], run: &Run) -> Result<Option<Removals>, Stopped> {
    let Ok(half_edges) = HalfEdges::new(mesh) else { return Ok(None) };
    let n = mesh.vertex_count();
    let mut rings: Vec<Vec<u32>> = (0..n as u32).map(|v| half_edges.neighbors(v).collect()).collect();
    let mut version = vec![0_u32; n];
    let mut queue: BinaryHeap<_> = (0..n as u32).map(|v| Reverse((cost(mesh, &rings, v, late), v, 0))).collect();
    let (mut vertices, mut left) = (Vec::with_capacity(n), n);
    // Vertices that cannot be removed are tried again when their neighbors have changed.
    while left > 4 {
        run.check()?;
        let Some(Reverse((_, v, seen))) = queue.pop() else { return Ok(None) };
        if version[v as usize] != seen || rings[v as usize].is_empty() {
            continue;
        }
        let Some(k) = best_neighbor(mesh, &rings, v) else { continue };
        let mut ring = std::mem::take(&mut rings[v as usize]);
        ring.rotate_left(k);
        close(&mut rings, v, &ring);
        for &w in &ring {
            version[w as usize] += 1;
            queue.push(Reverse((cost(mesh, &rings, w, late), w, version[w as usize])));
        }
        vertices.push(Removed { vertex: v, ring });
        left -= 1;
    }
    let left = (0..n as u32).filter(|v| !rings[*v as usize].is_empty()).map(|v| (v, rings[v as usize].clone()));
    Ok(Some(Removals { vertices, left: left.collect() }))
}

/// Removal cost: valence squared times the shortest edge. The bits of non-negative numbers have the order of the numbers.
fn cost(mesh: &TriMesh, rings: &[Vec<u32>], v: u32, late: &[bool]) -> (bool, u64) {
    let p = mesh.positions();
    let shortest =
        rings[v as usize].iter().map(|w| (p[v as usize] - p[*w as usize]).norm()).fold(f64::INFINITY, f64::min);
    let degree = rings[v as usize].len() as f64;
    (late.get(v as usize) == Some(&true), (shortest * degree * degree).to_bits())
}

/// The nearest valid collapse target of a vertex, as an index of its ring.
fn best_neighbor(mesh: &TriMesh, rings: &[Vec<u32>], v: u32) -> Option<usize> {
    let ring = &rings[v as usize];
    let common = |u: u32| rings[u as usize].iter().filter(|w| ring.contains(w)).count();
    let distance = |k: &usize| (mesh.positions()[v as usize] - mesh.positions()[ring[*k] as usize]).norm();
    (0..ring.len()).filter(|&k| common(ring[k]) == 2).min_by(|a, b| distance(a).total_cmp(&distance(b)))
}

/// Replaces the removed vertex by a fan from the first vertex of its ring.
fn close(rings: &mut [Vec<u32>], v: u32, ring: &[u32]) {
    let (into, inner) = (ring[0], &ring[2..ring.len() - 1]);
    for w in inner {
        let of = &mut rings[*w as usize];
        let index = of.iter().position(|x| *x == v).expect("adjacency is symmetric");
        of[index] = into;
    }
    for w in [ring[1], ring[ring.len() - 1]] {
        rings[w as usize].retain(|x| *x != v);
    }
    let of = &mut rings[into as usize];
    let index = of.iter().position(|x| *x == v).expect("adjacency is symmetric");
    of.splice(index..=index, inner.iter().copied());
}
