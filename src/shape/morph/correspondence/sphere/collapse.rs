//! A closed surface reduced to a tetrahedron, vertex by vertex.
//!
//! A vertex `v` may go into its neighbor `u` where both have exactly two neighbors in common (the link condition): the surface then
//! stays a manifold of the same kind. Vertices of few and short edges go first.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use crate::mesh::{HalfEdges, TriMesh};
use plumbline_num::run::{Run, Stopped};

/// A vertex that was taken out.
#[derive(Clone, Debug)]
pub(super) struct Removed {
    pub(super) vertex: u32,
    /// Its neighbors then, counterclockwise; the first is the one into which it went.
    pub(super) ring: Vec<u32>,
}

/// What it took to come down to four vertices.
#[derive(Clone, Debug)]
pub(super) struct Removals {
    pub(super) vertices: Vec<Removed>,
    /// The four that are left, with their neighbors counterclockwise.
    pub(super) left: Vec<(u32, Vec<u32>)>,
}

/// Takes out vertices of a closed surface of genus 0; `None` where none may go before four are left.
pub(super) fn removals(mesh: &TriMesh, late: &[bool], run: &Run) -> Result<Option<Removals>, Stopped> {
    let Ok(half_edges) = HalfEdges::new(mesh) else { return Ok(None) };
    let n = mesh.vertex_count();
    let mut rings: Vec<Vec<u32>> = (0..n as u32).map(|v| half_edges.neighbors(v).collect()).collect();
    let mut version = vec![0_u32; n];
    let mut queue: BinaryHeap<_> = (0..n as u32).map(|v| Reverse((cost(mesh, &rings, v, late), v, 0))).collect();
    let (mut vertices, mut left) = (Vec::with_capacity(n), n);
    // Vertices that could not go are tried again when their neighbors have changed.
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

/// How late a vertex should go: by its number of edges and the shortest. The bits of numbers that are not negative are ordered as
/// they are.
fn cost(mesh: &TriMesh, rings: &[Vec<u32>], v: u32, late: &[bool]) -> (bool, u64) {
    let p = mesh.positions();
    let shortest =
        rings[v as usize].iter().map(|w| (p[v as usize] - p[*w as usize]).norm()).fold(f64::INFINITY, f64::min);
    let degree = rings[v as usize].len() as f64;
    (late.get(v as usize) == Some(&true), (shortest * degree * degree).to_bits())
}

/// Which of its neighbors a vertex may go into; the nearest.
fn best_neighbor(mesh: &TriMesh, rings: &[Vec<u32>], v: u32) -> Option<usize> {
    let ring = &rings[v as usize];
    let common = |u: u32| rings[u as usize].iter().filter(|w| ring.contains(w)).count();
    let distance = |k: &usize| (mesh.positions()[v as usize] - mesh.positions()[ring[*k] as usize]).norm();
    (0..ring.len()).filter(|&k| common(ring[k]) == 2).min_by(|a, b| distance(a).total_cmp(&distance(b)))
}

/// The fan from the first of a ring takes the place of the vertex inside.
fn close(rings: &mut [Vec<u32>], v: u32, ring: &[u32]) {
    let (into, inner) = (ring[0], &ring[2..ring.len() - 1]);
    for w in inner {
        let of = &mut rings[*w as usize];
        let place = of.iter().position(|x| *x == v).expect("neighbors know each other");
        of[place] = into;
    }
    for w in [ring[1], ring[ring.len() - 1]] {
        rings[w as usize].retain(|x| *x != v);
    }
    let of = &mut rings[into as usize];
    let place = of.iter().position(|x| *x == v).expect("neighbors know each other");
    of.splice(place..=place, inner.iter().copied());
}
