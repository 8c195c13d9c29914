//! More vertices where features of the second mesh would be lost.
//!
//! An edge is halved where the middle of the laid edge lies farther from the second mesh than the tolerance, and all edges of the
//! laid triangle nearest to a vertex of the second that lies farther from the laid surface. Triangles with one, two or three halved
//! edges become two, three or four. The new vertex lies in the middle on the first mesh, and on the second at the place nearest to
//! the middle.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Point3, center};

use super::super::MorphError;
use super::super::bvh::Bvh;
use super::registration::Target;
use crate::mesh::TriMesh;
use plumbline_num::run::{Run, Stopped};

/// Two poses of one mesh, with more vertices than were given.
#[derive(Clone, Debug)]
pub struct Refined {
    /// The first mesh; its surface is the same.
    pub first: TriMesh,
    /// The same triangles laid over the second.
    pub laid: TriMesh,
    /// Vertices added.
    pub added: usize,
}

/// Refines at most `rounds` times, until all of `second` is met within `tolerance`, in its diagonals.
///
/// # Errors
/// [`MorphError::Value`] for a tolerance that is not above 0; [`MorphError::VertexCounts`], [`MorphError::Triangles`] where the
/// first two are not poses of one mesh; [`MorphError::Empty`], [`MorphError::Interrupted`].
pub fn refine(
    first: &TriMesh,
    laid: &TriMesh,
    second: &TriMesh,
    tolerance: f64,
    rounds: usize,
    run: &Run,
) -> Result<Refined, MorphError> {
    super::super::trajectory::same_connectivity(first, laid)?;
    if !(tolerance > 0.0) {
        let (what, value) = ("the tolerance of refinement".to_owned(), tolerance.to_string());
        return Err(MorphError::Value { what, value, expected: "above 0".to_owned() });
    }
    let target = Target::new(second)?;
    let far = (tolerance * second.diagonal()).powi(2);
    let mut refined = Refined { first: first.clone(), laid: laid.clone(), added: 0 };
    for _ in 0..rounds {
        let halved = edges_to_halve(&refined.laid, second, &target, far, run)?;
        if halved.is_empty() {
            break;
        }
        refined = halve(&refined, &halved, &target, run)?;
    }
    Ok(refined)
}

type Edge = (u32, u32);

fn edge(a: u32, b: u32) -> Edge {
    (a.min(b), a.max(b))
}

fn edges_to_halve(
    laid: &TriMesh,
    second: &TriMesh,
    target: &Target<'_>,
    far: f64,
    run: &Run,
) -> Result<BTreeSet<Edge>, Stopped> {
    let p = laid.positions();
    let all: BTreeSet<Edge> =
        laid.triangles().iter().flat_map(|&[a, b, c]| [edge(a, b), edge(b, c), edge(c, a)]).collect();
    let off = |(a, b): Edge| {
        let middle = center(&p[a as usize], &p[b as usize]);
        target.nearest(&middle).is_some_and(|place| place.squared > far)
    };
    let mut halved = BTreeSet::new();
    for edge in all {
        run.check()?;
        halved.extend(off(edge).then_some(edge));
    }
    let cover = Bvh::new(laid);
    let named: BTreeSet<u32> = second.triangles().iter().flatten().copied().collect();
    for v in named {
        run.check()?;
        if let Some(place) = cover.nearest(&second.positions()[v as usize], |_| true)
            && place.squared > far
        {
            let [a, b, c] = laid.triangles()[place.triangle as usize];
            halved.extend([edge(a, b), edge(b, c), edge(c, a)]);
        }
    }
    Ok(halved)
}

fn halve(refined: &Refined, halved: &BTreeSet<Edge>, target: &Target<'_>, run: &Run) -> Result<Refined, MorphError> {
    let (mut first, mut laid) = (refined.first.positions().to_vec(), refined.laid.positions().to_vec());
    let normals = refined.laid.vertex_normals();
    let mut middle_of = BTreeMap::new();
    for &(a, b) in halved {
        run.check()?;
        middle_of.insert((a, b), first.len() as u32);
        let middle = |p: &[Point3<f64>]| center(&p[a as usize], &p[b as usize]);
        first.push(middle(&first));
        laid.push(target.place(&middle(&laid), &(normals[a as usize] + normals[b as usize]))?.point);
    }
    let triangles: Vec<[u32; 3]> = refined.first.triangles().iter().flat_map(|t| divided(t, &middle_of)).collect();
    Ok(Refined {
        first: TriMesh::new(first, triangles.clone())?,
        laid: TriMesh::new(laid, triangles)?,
        added: refined.added + halved.len(),
    })
}

/// The parts of a triangle, oriented as it is.
pub(in crate::morph) fn divided(&[a, b, c]: &[u32; 3], middle_of: &BTreeMap<Edge, u32>) -> Vec<[u32; 3]> {
    let middle = |i: u32, j: u32| middle_of.get(&edge(i, j)).copied();
    let corner = |a: u32, b: u32, c: u32| match (middle(a, b), middle(b, c), middle(c, a)) {
        (Some(p), None, None) => Some(vec![[a, p, c], [p, b, c]]),
        (Some(p), Some(q), None) => Some(vec![[p, b, q], [a, p, q], [a, q, c]]),
        (Some(p), Some(q), Some(r)) => Some(vec![[a, p, r], [p, b, q], [r, q, c], [p, q, r]]),
        _ => None,
    };
    corner(a, b, c).or_else(|| corner(b, c, a)).or_else(|| corner(c, a, b)).unwrap_or_else(|| vec![[a, b, c]])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{HalfEdges, shapes};

    #[test]
    fn a_coarse_sphere_gains_vertices_until_it_meets_a_fine_one() {
        let (coarse, fine) = (shapes::icosphere(1), shapes::icosphere(4));
        let missed =
            |laid: &TriMesh| super::super::measure(laid, laid, &fine, &[], &Run::default()).unwrap().missed_worst;
        let refined = refine(&coarse, &coarse, &fine, 0.002, 6, &Run::default()).unwrap();
        assert!(missed(&coarse) > 0.01 && missed(&refined.laid) <= 0.002, "{}", missed(&refined.laid));
        assert_eq!(refined.first.vertex_count(), coarse.vertex_count() + refined.added);
        let half_edges = HalfEdges::new(&refined.laid).unwrap();
        assert_eq!((half_edges.boundary_edge_count(), refined.first.triangles()), (0, refined.laid.triangles()));
        // The surface of the first is what it was.
        assert!(
            (refined.first.area() - coarse.area()).abs() < 1e-12
                && (refined.first.volume() - coarse.volume()).abs() < 1e-12
        );
    }

    #[test]
    fn nothing_is_added_where_nothing_is_missed_and_bad_tolerances_are_refused() {
        let mesh = shapes::icosphere(2);
        assert_eq!(refine(&mesh, &mesh, &mesh, 1e-6, 3, &Run::default()).unwrap().added, 0);
        for tolerance in [0.0, -1.0, f64::NAN] {
            assert!(matches!(
                refine(&mesh, &mesh, &mesh, tolerance, 3, &Run::default()),
                Err(MorphError::Value { .. })
            ));
        }
    }

    #[test]
    fn every_pattern_of_halved_edges_keeps_orientation_and_area() {
        let middles = [((0, 1), 3), ((1, 2), 4), ((0, 2), 5)];
        let p = [[0.0, 0.0], [4.0, 0.0], [1.0, 3.0], [2.0, 0.0], [2.5, 1.5], [0.5, 1.5]];
        for subset in 0..8 {
            let middle_of = middles.iter().enumerate().filter(|(k, _)| subset >> k & 1 == 1).map(|(_, m)| *m).collect();
            let parts = divided(&[0, 1, 2], &middle_of);
            let area = |t: &[u32; 3]| {
                let [a, b, c] = t.map(|v| p[v as usize]);
                (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
            };
            assert_eq!(parts.len(), 1 + middle_of.len());
            assert!(parts.iter().all(|t| area(t) > 0.0));
            assert!((parts.iter().map(area).sum::<f64>() - 12.0).abs() < 1e-12);
        }
    }
}
