//! A connected graph in space; lengths relative to the total edge length, positions relative to the mean of all points.

use nalgebra::{Point3, Vector3};

use crate::character::{CharacterError, CurveSkeleton, Skeleton};
use plumbline_num::spatial::{ShortestPaths, UnionFind};

/// Missing node.
pub(super) const NONE: u32 = u32::MAX;

/// A skeleton (joints and bones) or a curve (nodes and edges).
#[derive(Clone, Debug)]
pub(super) struct Graph {
    /// `(x − center) / size`.
    pub(super) points: Vec<Vector3<f64>>,
    /// Total edge length, units of the model.
    pub(super) size: f64,
    /// Thickness of the shape around each point, any unit.
    thickness: Vec<f64>,
    center: Point3<f64>,
    neighbors: Vec<Vec<u32>>,
}

impl Graph {
    /// Joints at rest and their bones; `None` if all coincide.
    pub(super) fn of_skeleton(skeleton: &Skeleton) -> Option<Self> {
        let bones = skeleton.joints().iter().zip(0..).filter_map(|(joint, j)| Some([joint.parent?, j]));
        Self::new(&skeleton.rest_positions(), &bones.collect::<Vec<_>>(), &[])
    }

    /// Nodes and edges of a curve.
    pub(super) fn of_curve(curve: &CurveSkeleton) -> Result<Self, CharacterError> {
        let nodes = curve.nodes.len();
        if let Some(node) = curve.nodes.iter().position(|p| !p.iter().all(|x| x.is_finite())) {
            return Err(CharacterError::Input(format!("node {node} of the curve is not finite")));
        }
        if let Some(node) = curve.edges.iter().flatten().find(|n| **n as usize >= nodes) {
            let there = format!("but there are {nodes}, numbered from 0");
            return Err(CharacterError::Input(format!("an edge of the curve ends at node {node}, {there}")));
        }
        let graph = Self::new(&curve.nodes, &curve.edges, &curve.radius).ok_or_else(|| no_limbs(nodes))?;
        // The curve of a ball degenerates to a short segment.
        let thickest = curve.radius.iter().copied().fold(0.0, f64::max);
        if graph.size < thickest { Err(no_limbs(nodes)) } else { Ok(graph) }
    }

    fn new(points: &[Point3<f64>], edges: &[[u32; 2]], radius: &[f64]) -> Option<Self> {
        let first = *points.first()?;
        let mut edges = edges.to_vec();
        edges.extend(bridges(points, &edges));
        let center = first + points.iter().map(|p| p - first).sum::<Vector3<f64>>() / points.len() as f64;
        let length = |[a, b]: &[u32; 2]| nalgebra::distance(&points[*a as usize], &points[*b as usize]);
        let size: f64 = edges.iter().map(length).sum();
        if !(size > 0.0 && size.is_finite()) {
            return None;
        }
        let mut neighbors = vec![Vec::new(); points.len()];
        for &[a, b] in &edges {
            neighbors[a as usize].push(b);
            neighbors[b as usize].push(a);
        }
        // Curves made by hand have no radii.
        let known = radius.len() == points.len() && radius.iter().all(|r| *r > 0.0 && r.is_finite());
        let thickness = if known { radius.to_vec() } else { vec![1.0; points.len()] };
        Some(Self { points: points.iter().map(|p| (p - center) / size).collect(), size, thickness, center, neighbors })
    }

    /// A position in units of the model.
    pub(super) fn of_model(&self, x: &Vector3<f64>) -> Point3<f64> {
        self.center + x * self.size
    }

    pub(super) fn neighbors(&self, v: u32) -> &[u32] {
        &self.neighbors[v as usize]
    }

    pub(super) fn length(&self, a: u32, b: u32) -> f64 {
        (self.points[a as usize] - self.points[b as usize]).norm()
    }

    /// Fraction of the total surface area around some edges: cylinders with the mean thickness of their ends.
    pub(super) fn surface_fraction_around(&self, edges: impl Iterator<Item = [u32; 2]>) -> f64 {
        let around = |[a, b]: [u32; 2]| self.length(a, b) * (self.thickness[a as usize] + self.thickness[b as usize]);
        let each = |a: u32| self.neighbors(a).iter().filter(move |b| a < **b).map(move |b| [a, *b]);
        let all: f64 = (0..self.points.len() as u32).flat_map(each).map(around).sum();
        edges.map(around).sum::<f64>() / all
    }

    /// Leaves.
    pub(super) fn ends(&self) -> Vec<u32> {
        (0..self.points.len() as u32).filter(|v| self.neighbors(*v).len() == 1).collect()
    }

    /// Shortest paths from a node to all.
    pub(super) fn paths(&self, from: u32) -> ShortestPaths {
        let edges = |v: u32| self.neighbors(v).iter().map(move |&u| (u, self.length(v, u)));
        ShortestPaths::new(self.points.len(), [from], edges)
    }
}

/// Reports a curve of this many nodes without limbs.
pub(super) fn no_limbs(nodes: usize) -> CharacterError {
    let remedy = "a template needs a surface with limbs; omit the template, or fit it to another mesh";
    CharacterError::Input(format!("the curve skeleton has {nodes} nodes and no limb longer than its radius: {remedy}"))
}

/// Edges that connect all components, each between the nearest nodes of a component and the rest (Prim).
fn bridges(points: &[Point3<f64>], edges: &[[u32; 2]]) -> Vec<[u32; 2]> {
    let mut pieces = UnionFind::new(points.len());
    for &[a, b] in edges {
        pieces.join(a, b);
    }
    let mut bridges = Vec::new();
    // Grows the component of node 0: the nearest outside node is connected, together with its component.
    let mut nearest = vec![(f64::INFINITY, NONE); points.len()];
    let mut fresh: Vec<u32> = (0..points.len() as u32).filter(|v| pieces.root(*v) == pieces.root(0)).collect();
    loop {
        let home = pieces.root(0);
        let outside: Vec<u32> = (0..points.len() as u32).filter(|v| pieces.root(*v) != home).collect();
        for (&v, &u) in outside.iter().flat_map(|v| fresh.iter().map(move |u| (v, u))) {
            let d = nalgebra::distance_squared(&points[v as usize], &points[u as usize]);
            if d < nearest[v as usize].0 {
                nearest[v as usize] = (d, u);
            }
        }
        let closest = |a: &&u32, b: &&u32| nearest[**a as usize].0.total_cmp(&nearest[**b as usize].0);
        let Some(&v) = outside.iter().min_by(closest) else { return bridges };
        let piece = pieces.root(v);
        fresh = outside.into_iter().filter(|u| pieces.root(*u) == piece).collect();
        bridges.push([nearest[v as usize].1, v]);
        pieces.join(nearest[v as usize].1, v);
    }
}
