//! A graph in space as marks: branches colored in turn, end points and junctions as dots.
//!
//! A branch is a chain of edges between two nodes of degree other than 2, or a closed chain. Colors follow the order of the
//! branches' first edges, so that they do not depend on the view.

use nalgebra::Point3;

use super::{Mark, Shape};
use plumbline_image::canvas::Rgb;
use plumbline_num::spatial::UnionFind;

/// Branch colors, distinct from the surface color and from each other.
const BRANCHES: [Rgb; 9] = [
    [31, 99, 190],
    [214, 84, 24],
    [30, 140, 74],
    [150, 60, 170],
    [190, 30, 60],
    [0, 140, 160],
    [170, 120, 0],
    [90, 70, 200],
    [110, 110, 30],
];
/// Colors of end points, of inner nodes of a branch, and of junctions.
const END: Rgb = [226, 42, 36];
const BEND: Rgb = [250, 250, 250];
const JUNCTION: Rgb = [36, 46, 66];

/// Segments along the edges, colored by branch. Edges with an invalid node index are skipped.
pub fn branch_marks(nodes: &[Point3<f64>], edges: &[[u32; 2]], width_px: f64) -> Vec<Mark> {
    let degree = degrees(nodes.len(), edges);
    let known = |e: &&[u32; 2]| e.iter().all(|v| (*v as usize) < nodes.len());
    let mut edge_at = vec![u32::MAX; nodes.len()];
    let mut joined = UnionFind::new(edges.len());
    for (i, edge) in edges.iter().enumerate().filter(|(_, e)| known(e)) {
        for v in edge.map(|v| v as usize).into_iter().filter(|v| degree[*v] == 2) {
            if edge_at[v] == u32::MAX {
                edge_at[v] = i as u32;
            } else {
                joined.join(edge_at[v], i as u32);
            }
        }
    }
    let mut branches: Vec<u32> = Vec::new();
    let mut color = |i: usize| {
        let root = joined.root(i as u32);
        let branch = branches.iter().position(|b| *b == root).unwrap_or_else(|| {
            branches.push(root);
            branches.len() - 1
        });
        BRANCHES[branch % BRANCHES.len()]
    };
    let segment = |(i, e): (usize, &[u32; 2])| {
        let [a, b] = e.map(|v| nodes[v as usize]);
        Mark { shape: Shape::Segment(a, b), color: color(i), width_px }
    };
    edges.iter().enumerate().filter(|(_, e)| known(e)).map(segment).collect()
}

/// Dots at the nodes: end points red, junctions dark, others white.
pub fn node_marks(nodes: &[Point3<f64>], edges: &[[u32; 2]], width_px: f64) -> Vec<Mark> {
    let mark = |(p, degree): (&Point3<f64>, usize)| {
        let color = match degree {
            0 | 1 => END,
            2 => BEND,
            _ => JUNCTION,
        };
        Mark { shape: Shape::Point(*p), color, width_px }
    };
    nodes.iter().zip(degrees(nodes.len(), edges)).map(mark).collect()
}

fn degrees(count: usize, edges: &[[u32; 2]]) -> Vec<usize> {
    let mut degree = vec![0; count];
    for v in edges.iter().flatten() {
        if let Some(d) = degree.get_mut(*v as usize) {
            *d += 1;
        }
    }
    degree
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn branches_are_colored_in_turn_and_nodes_by_degree() {
        // A star of three arms of two edges each, and a loop.
        let nodes: Vec<_> = (0..10).map(|k| Point3::new(f64::from(k), 0.0, 0.0)).collect();
        let edges = [[0, 1], [1, 2], [0, 3], [3, 4], [0, 5], [6, 5], [7, 8], [8, 9], [9, 7], [0, 99]];
        let marks = branch_marks(&nodes, &edges, 2.0);
        let colors: Vec<usize> = marks.iter().map(|m| BRANCHES.iter().position(|c| *c == m.color).unwrap()).collect();
        assert_eq!(colors, [0, 0, 1, 1, 2, 2, 3, 3, 3]);
        let dots: Vec<Rgb> = node_marks(&nodes, &edges, 2.0).iter().map(|m| m.color).collect();
        assert_eq!(dots[..4], [JUNCTION, BEND, END, BEND]);
    }
}
