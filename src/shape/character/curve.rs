//! The curve that a skeleton was made of.

use nalgebra::Point3;

/// Nodes and edges in the middle of a surface, and which part of the surface each node stands for.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CurveSkeleton {
    /// Where the nodes are.
    pub nodes: Vec<Point3<f64>>,
    /// Pairs of nodes that are joined.
    pub edges: Vec<[u32; 2]>,
    /// Radius of the surface about each node, in units of the model; one per node, or empty.
    pub radius: Vec<f64>,
    /// The node of each vertex of the surface; or empty.
    pub node_of_vertex: Vec<u32>,
}
