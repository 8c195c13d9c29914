//! Curve skeletons.

use nalgebra::Point3;

/// A curve skeleton: nodes and edges along the medial axis of a surface, with the correspondence from vertices to nodes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CurveSkeleton {
    /// Node positions.
    pub nodes: Vec<Point3<f64>>,
    /// Pairs of adjacent nodes.
    pub edges: Vec<[u32; 2]>,
    /// Radius of the surface about each node, units of the model; one per node, or empty.
    pub radius: Vec<f64>,
    /// Node that each vertex of the surface contracts to; one per vertex, or empty.
    pub node_of_vertex: Vec<u32>,
}
