//! Connectivity surgery: collapses edges of the contracted surface until no triangle is left.
//!
//! The half-edge collapse `i → j` of least cost goes first,
//!
//! ```text
//! F(i, j) = w_a (p_jᵀ Q_i p_j + p_jᵀ Q_j p_j) + w_b ‖v_i − v_j‖ Σ_{k ∈ N(i)} ‖v_i − v_k‖
//! ```
//!
//! The shape term measures the distance of `p_j = (v_j, 1)` from the lines of edges that collapsed into both ends: with the unit direction `a`
//! of an edge and `b = a × v_i`, `K = ([a]ₓ | −b)` gives the offset of a point from its line, and `Q_i = Σ Kᵀ K` over the edges at `i`; `Q_j`
//! accumulates `Q_i`. The sampling term penalizes long edges. Only edges of triangles collapse, so that the result is a graph.
//!
//! Collapses that violate the link condition close a triangle of edges that is not a face. At the neck of a branch this is desired; around a
//! hole of the shape it would fill the hole. [`super::homology`] distinguishes the two: edges carry their homology class inside the shape,
//! and a triangle may close only if its classes sum to zero.
//!
//! # Reference
//! O. K.-C. Au et al., *Skeleton extraction by mesh contraction*, SIGGRAPH 2008, section 5.

use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashMap, HashSet, VecDeque};

use nalgebra::{Matrix4, Vector4};

use super::budget::Budget;
use super::complex::{Complex, NONE};
use super::curve_graph::CurveGraph;
use super::homology::{Classes, ZERO};
use super::order::Cost;
use crate::character::CharacterError;
use plumbline_num::run::{Run, Stopped};
use plumbline_num::spatial::UnionFind;

/// Weight of the shape term, as in the paper.
const SHAPE: f64 = 1.0;
/// Weight of the sampling term, as in the paper.
const SAMPLING: f64 = 0.1;

/// Smallest number of queued collapses at which outdated ones are removed: 30 MB. Every collapse into a vertex queues all of its edges again;
/// a hub of six thousand edges would queue tens of millions.
const MIN_CROWDED: usize = 1 << 20;
/// Largest number of pairs of vertex and class that searches for bounding loops visit, together: about ten seconds. A surface with twenty
/// handles visits a million. Loops that are found no more stay in the curve.
const MAX_VISITS: usize = 20_000_000;

/// An edge at a vertex.
#[derive(Clone, Copy, Debug)]
struct Spoke {
    to: u32,
    /// Class of the edge from the vertex to `to`.
    class: u32,
}

/// Cost of a collapse of the first vertex into the second, and the versions of both for which it is valid.
type Collapse = (Cost, u32, u32, u32, u32);

struct Surgery<'c> {
    complex: Complex,
    spokes: Vec<Vec<Spoke>>,
    quadrics: Vec<Matrix4<f64>>,
    /// Sum of the lengths of the edges at each vertex; `None` where its edges have changed.
    around: Vec<Option<f64>>,
    version: Vec<u32>,
    pinned: &'c [bool],
    classes: &'c mut Classes,
    heap: BinaryHeap<Reverse<Collapse>>,
    /// Number of queued collapses at which outdated ones are removed.
    crowded: usize,
    /// Visits left to searches for bounding loops.
    visits: usize,
}

/// The curve that is left if all triangles of a complex collapse.
///
/// # Errors
/// [`CharacterError::Input`] where too many triangles meet at single vertices: the budget of the collapses is used up before none is left.
pub(super) fn collapse_to_curve(
    mut complex: Complex,
    pinned: &[bool],
    classes: &mut Classes,
    run: &Run,
) -> Result<CurveGraph, CharacterError> {
    complex.budget = Budget::new(complex.faces().count());
    collapse_within(complex, pinned, classes, run)
}

/// [`collapse_to_curve`] within the budget of the complex.
fn collapse_within(
    complex: Complex,
    pinned: &[bool],
    classes: &mut Classes,
    run: &Run,
) -> Result<CurveGraph, CharacterError> {
    let alive: Vec<u32> = complex.vertices().collect();
    let mut surgery = Surgery::new(complex, pinned, classes);
    for v in alive {
        surgery.offer(v);
    }
    surgery.run(run)?;
    surgery.close_trivial_loops(run)?;
    Ok(surgery.graph())
}

fn entangled(left: usize) -> CharacterError {
    CharacterError::Input(format!(
        "a component cannot be collapsed to a curve: after the work of its size {left} triangles are left, of which too many meet at single \
         vertices; remesh it, or leave it out"
    ))
}

impl<'c> Surgery<'c> {
    fn new(complex: Complex, pinned: &'c [bool], classes: &'c mut Classes) -> Self {
        let n = complex.positions.len();
        let mut spokes: Vec<Vec<Spoke>> = vec![Vec::new(); n];
        for (t, corners) in complex.triangles.iter().enumerate().filter(|(_, c)| c[0] != NONE) {
            for k in 0..3 {
                for to in [(k + 1) % 3, (k + 2) % 3] {
                    if spokes[corners[k] as usize].iter().all(|s| s.to != corners[to]) {
                        let class = classes.between(t, k, to);
                        spokes[corners[k] as usize].push(Spoke { to: corners[to], class });
                    }
                }
            }
        }
        let mut this = Self {
            complex,
            spokes,
            quadrics: vec![Matrix4::zeros(); n],
            around: vec![None; n],
            version: vec![0; n],
            pinned,
            classes,
            heap: BinaryHeap::new(),
            crowded: MIN_CROWDED,
            visits: MAX_VISITS,
        };
        for v in 0..n {
            this.quadrics[v] = this.spokes[v].iter().map(|s| this.line_quadric(v as u32, s.to)).sum();
        }
        this
    }

    /// `Kᵀ K` of the line through an edge; zero for a degenerate edge.
    fn line_quadric(&self, i: u32, j: u32) -> Matrix4<f64> {
        let [p, q] = [i, j].map(|v| self.complex.positions[v as usize].coords);
        let Some(a) = (q - p).try_normalize(1e-12) else { return Matrix4::zeros() };
        let b = a.cross(&p);
        let mut k = nalgebra::Matrix3x4::zeros();
        k.fixed_columns_mut::<3>(0).copy_from(&a.cross_matrix());
        k.set_column(3, &-b);
        k.transpose() * k
    }

    /// Sum of the lengths of the edges at a vertex.
    fn around(&mut self, i: u32) -> f64 {
        if let Some(known) = self.around[i as usize] {
            return known;
        }
        let spokes = &self.spokes[i as usize];
        self.complex.budget.visit(spokes.len());
        let sum = spokes.iter().map(|s| self.length(i, s.to)).sum();
        self.around[i as usize] = Some(sum);
        sum
    }

    /// Cost of the collapse of `i` into `j`, with the sum of the lengths of the edges at `i`.
    fn cost(&self, i: u32, j: u32, around: f64) -> f64 {
        let p = self.complex.positions[j as usize];
        let h = Vector4::new(p.x, p.y, p.z, 1.0);
        let quadric = self.quadrics[i as usize] + self.quadrics[j as usize];
        SHAPE * h.dot(&(quadric * h)).max(0.0) + SAMPLING * self.length(i, j) * around
    }

    fn length(&self, i: u32, j: u32) -> f64 {
        nalgebra::distance(&self.complex.positions[i as usize], &self.complex.positions[j as usize])
    }

    /// Pushes all collapses of edges at `v`.
    fn offer(&mut self, v: u32) {
        let around = self.around(v);
        self.complex.budget.queue(2 * self.spokes[v as usize].len());
        for k in 0..self.spokes[v as usize].len() {
            let u = self.spokes[v as usize][k].to;
            for (i, j) in [(v, u), (u, v)] {
                if !self.pinned[i as usize] {
                    let around = if i == v { around } else { self.around(i) };
                    let entry =
                        (Cost::new(self.cost(i, j, around)), i, j, self.version[i as usize], self.version[j as usize]);
                    self.heap.push(Reverse(entry));
                }
            }
        }
        if self.heap.len() >= self.crowded {
            let version = &self.version;
            self.heap.retain(|Reverse((_, i, j, at_i, at_j))| {
                version[*i as usize] == *at_i && version[*j as usize] == *at_j
            });
            self.crowded = MIN_CROWDED.max(2 * self.heap.len());
        }
    }

    fn run(&mut self, run: &Run) -> Result<(), CharacterError> {
        while let Some(Reverse((_, i, j, at_i, at_j))) = self.heap.pop() {
            run.check()?;
            if self.complex.budget.is_spent() {
                return Err(entangled(self.complex.faces().count()));
            }
            if self.version[i as usize] == at_i
                && self.version[j as usize] == at_j
                && self.has_face(i, j)
                && self.keeps_holes(i, j)
            {
                self.collapse(i, j);
            }
        }
        Ok(())
    }

    fn has_face(&self, i: u32, j: u32) -> bool {
        self.complex.budget.visit(self.complex.valence(i));
        self.complex.fan(i).any(|t| t.contains(&j))
    }

    fn spoke(&self, i: u32, j: u32) -> Option<Spoke> {
        self.spokes[i as usize].iter().copied().find(|s| s.to == j)
    }

    /// Whether each triangle of edges that would close bounds inside the shape.
    fn keeps_holes(&mut self, i: u32, j: u32) -> bool {
        let Some(across) = self.spoke(i, j) else { return false };
        let [of_i, of_j] = [i, j].map(|v| self.spokes[v as usize].len());
        self.complex.budget.visit(of_j);
        if self.classes.is_trivial() {
            return true;
        }
        self.complex.budget.visit(of_i * of_j);
        for k in 0..of_i {
            let s = self.spokes[i as usize][k];
            if let Some(other) = self.spoke(j, s.to).filter(|_| s.to != j) {
                let there = self.classes.sum(across.class, other.class);
                if there != s.class {
                    return false;
                }
            }
        }
        true
    }

    fn collapse(&mut self, i: u32, j: u32) {
        self.complex.collapse_without_doubles(i, j);
        let back = self.spoke(j, i).expect("edges are known at both ends").class;
        let spokes = std::mem::take(&mut self.spokes[i as usize]);
        self.complex.budget.visit(spokes.len() * self.spokes[j as usize].len());
        for s in spokes {
            let k = s.to as usize;
            self.around[k] = None;
            self.complex.budget.visit(self.spokes[k].len());
            self.spokes[k].retain(|s| s.to != i);
            if s.to != j && self.spoke(j, s.to).is_none() {
                let class = self.classes.sum(back, s.class);
                self.spokes[j as usize].push(Spoke { to: s.to, class });
                let reverse = self.classes.negative(class);
                self.spokes[k].push(Spoke { to: j, class: reverse });
            }
        }
        let quadric = self.quadrics[i as usize];
        self.quadrics[j as usize] += quadric;
        self.version[i as usize] += 1;
        self.version[j as usize] += 1;
        // Costs at the neighbors changed only in their sampling term; they are pushed again with the edges of `j`.
        self.offer(j);
    }

    /// Contracts remaining loops that bound inside the shape, which arise where faces of several branches vanished between them: the shortest
    /// edge of a shortest such loop collapses until there is none.
    fn close_trivial_loops(&mut self, run: &Run) -> Result<(), Stopped> {
        while let Some(cycle) = self.trivial_cycle(run)? {
            let edge = |k: usize| (cycle[k], cycle[(k + 1) % cycle.len()]);
            let length = |(a, b): (u32, u32)| Cost::new(self.length(a, b));
            let shortest = (0..cycle.len()).map(edge).min_by_key(|e| (length(*e), *e)).expect("a cycle has edges");
            let (i, j) = if self.pinned[shortest.0 as usize] { (shortest.1, shortest.0) } else { shortest };
            self.collapse(i, j);
        }
        Ok(())
    }

    /// The simple cycle with the fewest edges and zero class, by searches from every junction.
    fn trivial_cycle(&mut self, run: &Run) -> Result<Option<Vec<u32>>, Stopped> {
        if self.loop_count() <= self.classes.rank() {
            return Ok(None);
        }
        let degree = |v: &u32| self.spokes[*v as usize].len();
        let mut starts: Vec<u32> = (0..self.spokes.len() as u32).filter(|v| degree(v) > 2).collect();
        if starts.is_empty() {
            starts = (0..self.spokes.len() as u32).filter(|v| degree(v) == 2).collect();
        }
        let mut best: Option<Vec<u32>> = None;
        for v in starts {
            run.check()?;
            if let Some(cycle) = self.trivial_cycle_through(v, best.as_ref().map_or(usize::MAX, Vec::len)) {
                best = Some(cycle);
            }
        }
        Ok(best)
    }

    fn loop_count(&self) -> usize {
        let mut pieces = UnionFind::new(self.spokes.len());
        let edges = self.spokes.iter().zip(0..).flat_map(|(spokes, v)| spokes.iter().map(move |s| (v, s.to)));
        edges.filter(|(v, u)| v < u && !pieces.join(*v, *u)).count()
    }

    /// Breadth-first search from `v` over pairs of vertex and class: two paths of equal class to a vertex with different first edges close a
    /// bounding cycle.
    fn trivial_cycle_through(&mut self, v: u32, shorter_than: usize) -> Option<Vec<u32>> {
        let mut reached: HashMap<(u32, u32), (u32, u32, u32, u32)> = HashMap::new();
        reached.insert((v, ZERO), (v, ZERO, v, 0));
        let mut queue = VecDeque::from([(v, ZERO)]);
        let bound = self.spokes.len().min(shorter_than);
        while let Some((at, class)) = queue.pop_front() {
            let (from, _, branch, depth) = reached[&(at, class)];
            if 2 * depth as usize + 1 >= bound {
                return None;
            }
            for k in 0..self.spokes[at as usize].len() {
                let s = self.spokes[at as usize][k];
                if s.to == from && at != v {
                    continue;
                }
                let next = (s.to, self.classes.sum(class, s.class));
                let own = if at == v { s.to } else { branch };
                match reached.get(&next) {
                    None if reached.len() < 64 * self.spokes.len() && self.visits > 0 => {
                        self.visits -= 1;
                        reached.insert(next, (at, class, own, depth + 1));
                        queue.push_back(next);
                    }
                    Some(&(_, _, other, there)) if other != own && s.to != v => {
                        if (depth + 1 + there) as usize >= shorter_than {
                            return None;
                        }
                        let trace = |mut key: (u32, u32)| {
                            let mut path = vec![key.0];
                            while key != (v, ZERO) {
                                let (from, class, ..) = reached[&key];
                                key = (from, class);
                                path.push(key.0);
                            }
                            path
                        };
                        let mut cycle = trace((at, class));
                        let mut back = trace(next);
                        back.pop();
                        cycle.reverse();
                        cycle.extend(back);
                        if cycle.iter().collect::<HashSet<_>>().len() == cycle.len() {
                            return Some(cycle);
                        }
                    }
                    _ => {}
                }
            }
        }
        None
    }

    fn graph(&self) -> CurveGraph {
        let n = self.spokes.len();
        let roots: Vec<u32> = (0..n as u32).map(|v| self.complex.root(v)).collect();
        let mut number = vec![NONE; n];
        let mut nodes = Vec::new();
        for &v in &roots {
            if number[v as usize] == NONE {
                number[v as usize] = nodes.len() as u32;
                nodes.push(self.complex.positions[v as usize]);
            }
        }
        let spokes =
            (0..n).filter(|v| number[*v] != NONE).flat_map(|v| self.spokes[v].iter().map(move |s| (v, s.to as usize)));
        let edges: Vec<[u32; 2]> = spokes.filter(|(v, u)| v < u).map(|(v, u)| [number[v], number[u]]).collect();
        let node_of_vertex = roots.iter().map(|v| number[*v as usize]).collect();
        CurveGraph::new(nodes, &edges, node_of_vertex)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;

    #[test]
    fn a_component_whose_budget_is_used_up_is_refused_with_a_remedy() {
        let ball = shapes::icosphere(2);
        let collapsed = |units: u64| {
            let mut complex = Complex::new(ball.positions().to_vec(), ball.triangles().to_vec());
            complex.budget = Budget::of(units);
            let pinned = vec![false; ball.vertex_count()];
            collapse_within(complex, &pinned, &mut Classes::default(), &Run::default())
        };
        assert!(collapsed(u64::MAX).expect("a ball").alive().count() < 10);
        let refused = collapsed(10_000).expect_err("a fraction of the work").to_string();
        assert!(refused.contains("triangles are left") && refused.contains("remesh it"), "{refused}");
    }
}
