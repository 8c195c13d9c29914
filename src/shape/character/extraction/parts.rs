//! Connected components of a surface.
//!
//! Repair welds vertices in the same place and across gaps, removes degenerate and duplicate triangles and orients the rest, but separates sheets
//! at non-manifold edges. The curve should pass there: duplicate vertices are welded again, and triangles that share a vertex belong to one
//! component.

use std::collections::HashMap;

use crate::mesh::{RepairOptions, TriMesh, Weld, edge_groups, repair};
use plumbline_num::run::{Run, Stopped};
use plumbline_num::spatial::numbered_components;

/// A connected component.
pub(super) struct Part {
    pub(super) mesh: TriMesh,
    /// Input vertices of each vertex.
    pub(super) sources: Vec<Vec<u32>>,
}

/// Number of handles; `None` if the surface is not a closed manifold.
pub(super) fn handles(mesh: &TriMesh) -> Option<usize> {
    let origins = mesh.triangles().as_flattened();
    let mut edges = 0;
    for edge in edge_groups(origins).iter() {
        match *edge {
            [(_, g), (_, h)] if origins[g as usize] != origins[h as usize] => edges += 1,
            _ => return None,
        }
    }
    let euler = mesh.vertex_count() as i64 - edges + mesh.triangle_count() as i64;
    usize::try_from(2 - euler).ok().map(|twice| twice / 2)
}

/// Whether a surface has an inside: it need not be manifold, but no edge may be a boundary edge.
pub(super) fn is_closed(mesh: &TriMesh) -> bool {
    edge_groups(mesh.triangles().as_flattened()).iter().all(|edge| edge.len().is_multiple_of(2))
}

/// Largest ratio of the areas of a speck and of the largest component: a speck is a hundredth as large, a quarter of the distance of
/// the nodes, and would be a point between two of them. Each would cost as much as a limb: at a tenth of the area eyes are specks.
const MAX_SPECK_AREA: f64 = 1e-4;

/// The components of a surface, and what was left out.
pub(super) struct Parts {
    /// In the order of their first vertices.
    pub(super) kept: Vec<Part>,
    /// Repairs made, in words.
    pub(super) repairs: Vec<String>,
    pub(super) outliers: Vec<u32>,
    pub(super) specks: usize,
    pub(super) speck_vertices: usize,
}

/// The components of a surface without its outliers and specks.
pub(super) fn of(mesh: &TriMesh, run: &Run) -> Result<Parts, Stopped> {
    let outliers = mesh.outliers();
    let welded = RepairOptions { weld: Weld::GAPS, ..RepairOptions::default() };
    let repaired = if outliers.is_empty() {
        repair(mesh, &welded, run)?
    } else {
        repair(&mesh.without_triangles_at(&outliers), &welded, run)?
    };
    let mut number: HashMap<[u64; 3], u32> = HashMap::new();
    let mut positions = Vec::new();
    let key = |p: &nalgebra::Point3<f64>| -> [u64; 3] { p.coords.map(|c| (c + 0.0).to_bits()).into() };
    let joined: Vec<u32> = repaired
        .mesh
        .positions()
        .iter()
        .map(|p| {
            let next = positions.len() as u32;
            let v = *number.entry(key(p)).or_insert(next);
            if v == next {
                positions.push(*p);
            }
            v
        })
        .collect();
    let triangles: Vec<[u32; 3]> = repaired.mesh.triangles().iter().map(|t| t.map(|v| joined[v as usize])).collect();
    let mut sources = vec![Vec::new(); positions.len()];
    for (source, v) in repaired.vertex_of_source.iter().enumerate() {
        if let Some(v) = v {
            sources[joined[*v as usize] as usize].push(source as u32);
        }
    }
    run.check()?;
    let (component, count) = numbered_components(positions.len(), &triangles);
    let mut own = vec![0_u32; positions.len()];
    let mut parts = vec![(Vec::new(), Vec::new(), Vec::new()); count];
    for (v, &c) in component.iter().enumerate() {
        let (points, from, _) = &mut parts[c as usize];
        own[v] = points.len() as u32;
        points.push(positions[v]);
        from.push(std::mem::take(&mut sources[v]));
    }
    for t in triangles {
        parts[component[t[0] as usize] as usize].2.push(t.map(|v| own[v as usize]));
    }
    let made = |(points, sources, triangles): (_, _, Vec<[u32; 3]>)| {
        let mesh = TriMesh::new(points, triangles).expect("corners exist and positions are those of a mesh");
        Part { mesh, sources }
    };
    let mut parts: Vec<Part> = parts.into_iter().map(made).collect();
    let repairs = repaired.report.changes().collect();
    let areas: Vec<f64> = parts.iter().map(|part| part.mesh.area()).collect();
    let largest = areas.iter().copied().fold(0.0, f64::max);
    let (mut areas, before) = (areas.into_iter(), parts.len());
    let mut speck_vertices = 0;
    parts.retain(|part| {
        let is_speck = areas.next().is_some_and(|area| area < MAX_SPECK_AREA * largest);
        speck_vertices += if is_speck { part.mesh.vertex_count() } else { 0 };
        !is_speck
    });
    Ok(Parts { specks: before - parts.len(), kept: parts, repairs, outliers, speck_vertices })
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;

    use super::*;
    use crate::mesh::shapes;

    #[test]
    fn surfaces_with_an_inside_are_closed_manifold_or_not() {
        let places = [[0, 0, 0], [0, 0, 1], [1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0]];
        let positions: Vec<_> = places.iter().map(|p| Point3::from(p.map(f64::from))).collect();
        let tetrahedron = |[a, b, c, d]: [u32; 4]| [[a, c, b], [a, b, d], [b, c, d], [c, a, d]];
        let both = [tetrahedron([0, 1, 2, 3]), tetrahedron([0, 1, 4, 5])].concat();
        let hinged = TriMesh::new(positions.clone(), both.clone()).unwrap();
        assert!(is_closed(&hinged) && handles(&hinged).is_none());
        let open = TriMesh::new(positions, both[1..].to_vec()).unwrap();
        assert!(!is_closed(&open) && !is_closed(&shapes::plane(3)));
        assert!(is_closed(&shapes::icosphere(1)) && handles(&shapes::icosphere(1)) == Some(0));
    }
}
