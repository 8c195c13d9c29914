//! Refinement of a map: adds vertices where features of the second mesh would be lost.
//!
//! An edge is bisected if the midpoint of the mapped edge is farther from the second mesh than the tolerance; so are all edges of
//! the mapped triangle nearest to a vertex of the second mesh that is farther from the mapped surface. Triangles with one, two or
//! three bisected edges become two, three or four. The new vertex is the midpoint on the first mesh, and the closest point to the
//! midpoint on the second.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Point3, center};

use super::super::MorphError;
use super::registration::Target;
use crate::mesh::TriMesh;
use plumbline_num::run::Run;

/// A refined map: two poses of one mesh.
#[derive(Clone, Debug)]
pub struct Refined {
    /// The refined first mesh, with unchanged surface.
    pub first: TriMesh,
    /// The same triangles mapped onto the second mesh.
    pub mapped: TriMesh,
    /// Number of added vertices.
    pub added: usize,
}

/// Refines in at most `iterations` passes, until the distance to `second` is at most `tolerance`, in diagonals of `second`.
///
/// # Errors
/// [`MorphError::Value`] for a tolerance of 0 or less; [`MorphError::VertexCounts`], [`MorphError::Triangles`] where the
/// first two are not poses of one mesh; [`MorphError::Empty`], [`MorphError::Layered`], [`MorphError::Interrupted`].
pub fn refine(
    first: &TriMesh,
    mapped: &TriMesh,
    second: &TriMesh,
    tolerance: f64,
    iterations: usize,
    run: &Run,
) -> Result<Refined, MorphError> {
    super::super::trajectory::same_connectivity(first, mapped)?;
    if !(tolerance > 0.0) {
        let (what, value) = ("the tolerance of refinement".to_owned(), tolerance.to_string());
        return Err(MorphError::Value { what, value, expected: "above 0".to_owned() });
    }
    let target = Target::new(second, "second", first.triangle_count())?;
    let far = (tolerance * second.diagonal()).powi(2);
    let mut refined = Refined { first: first.clone(), mapped: mapped.clone(), added: 0 };
    for _ in 0..iterations {
        let bisected = edges_to_bisect(&refined.mapped, second, &target, far, run)?;
        if bisected.is_empty() {
            break;
        }
        refined = bisect(&refined, &bisected, &target, run)?;
    }
    Ok(refined)
}

/// The ends of an edge, ascending.
pub(super) type Edge = (u32, u32);

fn edge(a: u32, b: u32) -> Edge {
    (a.min(b), a.max(b))
}

/// The edges of a mesh, each once.
pub(super) fn edges(mesh: &TriMesh) -> BTreeSet<Edge> {
    mesh.triangles().iter().flat_map(|&[a, b, c]| [edge(a, b), edge(b, c), edge(c, a)]).collect()
}

fn edges_to_bisect(
    mapped: &TriMesh,
    second: &TriMesh,
    target: &Target<'_>,
    far: f64,
    run: &Run,
) -> Result<BTreeSet<Edge>, MorphError> {
    let p = mapped.positions();
    let mut bisected = BTreeSet::new();
    for (a, b) in edges(mapped) {
        run.check()?;
        let off = target.nearest(&center(&p[a as usize], &p[b as usize]))?.squared > far;
        bisected.extend(off.then_some((a, b)));
    }
    let cover = Target::new(mapped, "mapped", second.triangle_count())?;
    for v in second.referenced_and_isolated().0 {
        run.check()?;
        let nearest = cover.nearest(&second.positions()[v as usize])?;
        if nearest.squared > far {
            let [a, b, c] = mapped.triangles()[nearest.triangle as usize];
            bisected.extend([edge(a, b), edge(b, c), edge(c, a)]);
        }
    }
    Ok(bisected)
}

fn bisect(refined: &Refined, bisected: &BTreeSet<Edge>, target: &Target<'_>, run: &Run) -> Result<Refined, MorphError> {
    let (mut first, mut mapped) = (refined.first.positions().to_vec(), refined.mapped.positions().to_vec());
    let normals = refined.mapped.vertex_normals();
    let mut middle_of = BTreeMap::new();
    for &(a, b) in bisected {
        run.check()?;
        middle_of.insert((a, b), first.len() as u32);
        let middle = |p: &[Point3<f64>]| center(&p[a as usize], &p[b as usize]);
        first.push(middle(&first));
        mapped.push(target.closest_facing(&middle(&mapped), &(normals[a as usize] + normals[b as usize]))?.point);
    }
    let triangles: Vec<[u32; 3]> = refined.first.triangles().iter().flat_map(|t| divided(t, &middle_of)).collect();
    Ok(Refined {
        first: TriMesh::new(first, triangles.clone())?,
        mapped: TriMesh::new(mapped, triangles)?,
        added: refined.added + bisected.len(),
    })
}

/// The parts of a triangle, with its orientation.
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
    fn a_coarse_sphere_is_refined_to_the_tolerance_of_a_fine_one() {
        let (coarse, fine) = (shapes::icosphere(1), shapes::icosphere(4));
        let missed =
            |mapped: &TriMesh| super::super::measure(mapped, mapped, &fine, &[], &Run::default()).unwrap().missed_worst;
        let refined = refine(&coarse, &coarse, &fine, 0.002, 6, &Run::default()).unwrap();
        assert!(missed(&coarse) > 0.01 && missed(&refined.mapped) <= 0.002, "{}", missed(&refined.mapped));
        assert_eq!(refined.first.vertex_count(), coarse.vertex_count() + refined.added);
        let half_edges = HalfEdges::new(&refined.mapped).unwrap();
        assert_eq!((half_edges.boundary_edge_count(), refined.first.triangles()), (0, refined.mapped.triangles()));
        // The surface of the first mesh is unchanged.
        assert!(
            (refined.first.area() - coarse.area()).abs() < 1e-12
                && (refined.first.volume() - coarse.volume()).abs() < 1e-12
        );
    }

    #[test]
    fn a_map_within_the_tolerance_is_unchanged_and_invalid_tolerances_are_rejected() {
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
    fn every_pattern_of_bisected_edges_keeps_orientation_and_area() {
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
