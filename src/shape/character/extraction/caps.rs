//! Closes the holes of a surface that bounds a volume.
//!
//! Scans have holes; busts and cut limbs have openings. Inside tests, ends and handles require a closed surface: every boundary loop is
//! triangulated with a new vertex at its centroid. Unpaired half-edges enter and leave each vertex equally often, so they decompose into
//! closed walks on every oriented surface.

use std::collections::{BTreeMap, HashMap};
use std::ops::Bound::{Excluded, Unbounded};

use nalgebra::{Point3, Vector3};

use super::order::Cost;
use crate::mesh::{TriMesh, edge_groups};

/// The closed surface; vertices and triangles of `open` come first, unchanged.
pub(super) fn closed(open: &TriMesh) -> TriMesh {
    let mut positions = open.positions().to_vec();
    let mut triangles = open.triangles().to_vec();
    for walk in walks(&boundary(open.triangles()), &positions, &open.vertex_normals()) {
        let first = positions[walk[0] as usize];
        let sum = walk.iter().map(|v| positions[*v as usize] - first).sum::<Vector3<f64>>();
        let middle = positions.len() as u32;
        positions.push(Point3::from(first + sum / walk.len() as f64));
        let next = walk.iter().cycle().skip(1);
        triangles.extend(walk.iter().zip(next).map(|(a, b)| [*b, *a, middle]));
    }
    TriMesh::new(positions, triangles).expect("means of finite positions")
}

/// Half-edges `(a, b)` that outnumber `(b, a)`, repeated by the excess, sorted.
pub(super) fn boundary(triangles: &[[u32; 3]]) -> Vec<(u32, u32)> {
    let origins = triangles.as_flattened();
    let excess = |edge: &[(u64, u32)]| {
        let (low, high) = ((edge[0].0 >> 32) as u32, edge[0].0 as u32);
        let upward = edge.iter().filter(|(_, h)| origins[*h as usize] == low).count();
        let downward = edge.len() - upward;
        let half = if upward > downward { (low, high) } else { (high, low) };
        std::iter::repeat_n(half, upward.abs_diff(downward))
    };
    let mut halves: Vec<(u32, u32)> = edge_groups(origins).iter().flat_map(excess).collect();
    halves.sort_unstable();
    halves
}

/// Decomposes half-edges into closed walks without repeated vertices; each half-edge is used once. Where several holes meet at a vertex, the
/// walk goes on along the next half-edge around its normal: the other side of the same hole.
fn walks(halves: &[(u32, u32)], positions: &[Point3<f64>], normals: &[Vector3<f64>]) -> Vec<Vec<u32>> {
    let angle = |v: u32, u: u32| {
        let [x, y] = axes_across(&normals[v as usize]);
        let toward = positions[u as usize] - positions[v as usize];
        Cost::new(y.dot(&toward).atan2(x.dot(&toward)))
    };
    // The half-edges that leave each vertex, by their angle around its normal, each with how often.
    let mut left: BTreeMap<u32, BTreeMap<(Cost, u32), usize>> = BTreeMap::new();
    for &(a, b) in halves {
        *left.entry(a).or_default().entry((angle(a, b), b)).or_default() += 1;
    }
    let mut walks = Vec::new();
    let starts: Vec<u32> = left.keys().copied().collect();
    // Where each vertex is in the walk.
    let mut place: HashMap<u32, usize> = HashMap::new();
    for start in starts {
        let mut walk: Vec<u32> = vec![start];
        place.insert(start, 0);
        while let Some(&v) = walk.last() {
            let Some(ahead) = left.get_mut(&v) else { break };
            let after = walk.len().checked_sub(2).map_or(Unbounded, |k| Excluded((angle(v, walk[k]), u32::MAX)));
            let Some((&half, _)) = ahead.range((after, Unbounded)).next().or_else(|| ahead.iter().next()) else {
                break;
            };
            let times = ahead.get_mut(&half).expect("found");
            *times -= 1;
            if *times == 0 {
                ahead.remove(&half);
            }
            let next = half.1;
            if let Some(&at) = place.get(&next) {
                let round = walk.split_off(at);
                for v in &round {
                    place.remove(v);
                }
                walks.push(round);
            }
            place.insert(next, walk.len());
            walk.push(next);
        }
        for v in walk {
            place.remove(&v);
        }
    }
    walks
}

/// Two unit vectors across a unit normal, the second a quarter turn counterclockwise of the first around it.
fn axes_across(normal: &Vector3<f64>) -> [Vector3<f64>; 2] {
    let x = normal.cross(&Vector3::ith(normal.iamin(), 1.0)).try_normalize(0.0).unwrap_or_else(Vector3::x);
    [x, normal.cross(&x)]
}

#[cfg(test)]
mod tests {
    use super::super::parts;
    use super::*;
    use crate::mesh::shapes;

    #[test]
    fn holes_are_closed_and_handles_are_kept() {
        let torus = shapes::holed_torus(1, 16);
        let kept = |t: usize| ![3, 4, 5, 90, 200, 201].contains(&t);
        let left = (0..torus.triangle_count()).filter(|t| kept(*t)).map(|t| torus.triangles()[t]).collect();
        let open = TriMesh::new(torus.positions().to_vec(), left).unwrap();
        assert!(!parts::is_closed(&open));
        let whole = closed(&open);
        assert!(parts::is_closed(&whole));
        assert_eq!(parts::handles(&whole), Some(1));
        assert_eq!(whole.positions()[..open.vertex_count()], *open.positions());
        assert_eq!(whole.triangles()[..open.triangle_count()], *open.triangles());
    }

    #[test]
    fn walks_that_meet_at_a_vertex_are_separate() {
        let eight = [(0, 1), (1, 2), (2, 0), (0, 3), (3, 4), (4, 0)];
        let mut halves = eight.to_vec();
        halves.sort_unstable();
        let positions =
            [[0, 0], [1, 1], [1, -1], [-1, -1], [-1, 1]].map(|[x, y]| Point3::from([x, y, 0].map(f64::from)));
        let mut found: Vec<Vec<u32>> = walks(&halves, &positions, &[Vector3::z(); 5]);
        for walk in &mut found {
            walk.sort_unstable();
        }
        found.sort();
        assert_eq!(found, [vec![0, 1, 2], vec![0, 3, 4]]);
    }

    #[test]
    fn holes_that_meet_at_vertices_are_closed_one_by_one() {
        let ball = shapes::icosphere(3);
        let mut random = fastrand::Rng::with_seed(3);
        let left = ball.triangles().iter().copied().filter(|_| random.bool()).collect();
        let open = TriMesh::new(ball.positions().to_vec(), left).unwrap();
        let whole = closed(&open);
        assert!(parts::is_closed(&whole));
        assert!((whole.volume() / ball.volume() - 1.0).abs() < 0.05, "{} of {}", whole.volume(), ball.volume());
    }

    #[test]
    fn a_closed_surface_is_unchanged() {
        let ball = shapes::icosphere(2);
        assert_eq!(closed(&ball), ball);
    }
}
