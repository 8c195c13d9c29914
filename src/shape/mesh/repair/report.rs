//! Report of a mesh repair: the changes and the properties of the result.

use std::fmt;

use serde::Serialize;

use crate::mesh::{HalfEdges, TriMesh, edge_groups};
use plumbline_num::spatial::numbered_components;

/// Changes made to a mesh, and properties of the result. Vertex and triangle indices refer to the input unless stated
/// otherwise.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct RepairReport {
    /// Number of vertices of the input.
    pub vertices_before: usize,
    /// Number of vertices of the result.
    pub vertices_after: usize,
    /// Number of triangles of the input.
    pub triangles_before: usize,
    /// Number of triangles of the result.
    pub triangles_after: usize,
    /// Number of vertices welded to another.
    pub welded: usize,
    /// How many of them across a gap.
    pub bridged: usize,
    /// Isolated vertices, referenced by no triangle: removed.
    pub unreferenced: Vec<u32>,
    /// Triangles with a repeated vertex after welding: removed.
    pub collapsed: Vec<u32>,
    /// Duplicates of an earlier triangle: removed.
    pub duplicates: Vec<u32>,
    /// Number of needles (degenerate triangles) removed by collapsing the short edge.
    pub needles_collapsed: usize,
    /// Number of caps (degenerate triangles) removed by flipping the long edge.
    pub caps_flipped: usize,
    /// Degenerate triangles that could neither collapse nor flip: removed.
    pub flat_dropped: Vec<u32>,
    /// Triangles whose orientation was reversed.
    pub flipped: Vec<u32>,
    /// Edges, by their end vertices, with more than two triangles: the sheets are separated there.
    pub non_manifold_edges: Vec<[u32; 2]>,
    /// Vertices that were split, because several sheets met there.
    pub non_manifold_vertices: Vec<u32>,
    /// Number of edges along which a non-orientable surface was cut open.
    pub unorientable_cuts: usize,
    /// Triangles that were disconnected along all edges, because an edge stayed non-manifold after pairing.
    pub detached: Vec<u32>,
    /// Connected components of the result.
    pub components: Vec<Component>,
    /// Boundary loops of the result.
    pub boundary_loops: Vec<BoundaryLoop>,
    /// Number of corners of the result with an angle above 90°, whose cotangent is negative.
    pub obtuse_corners: usize,
    /// Number of edges of the result with a negative cotangent weight.
    pub negative_weights: usize,
}

/// A connected component of a surface.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Component {
    /// Lowest vertex index of the result in the component.
    pub first_vertex: u32,
    /// Number of vertices.
    pub vertices: usize,
    /// Number of triangles.
    pub triangles: usize,
    /// Number of boundary loops; 0 for a closed component.
    pub boundary_loops: usize,
    /// Genus: number of handles.
    pub genus: usize,
    /// Area, squared units of the positions.
    pub area: f64,
    /// Enclosed volume; `None` for an open component.
    pub volume: Option<f64>,
}

/// A boundary loop.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct BoundaryLoop {
    /// Component index.
    pub component: u32,
    /// A vertex index of the result on the loop.
    pub first_vertex: u32,
    /// Number of vertices.
    pub vertices: usize,
    /// Length, units of the positions.
    pub length: f64,
}

impl RepairReport {
    /// Whether nothing had to be changed.
    pub fn is_clean(&self) -> bool {
        self.changes().next().is_none()
    }

    /// The changes, in words.
    pub fn changes(&self) -> impl Iterator<Item = String> {
        let first = |list: &[u32]| list.first().map(|v| format!(" (first: {v})")).unwrap_or_default();
        let edge = self.non_manifold_edges.first().map(|[a, b]| format!(" (first: {a} to {b})")).unwrap_or_default();
        [
            (self.welded - self.bridged, "vertices joined with another in the same place", String::new()),
            (self.bridged, "vertices joined with another across a gap", String::new()),
            (self.unreferenced.len(), "vertices left out that no triangle names", first(&self.unreferenced)),
            (self.collapsed.len(), "triangles left out that name a vertex twice", first(&self.collapsed)),
            (self.duplicates.len(), "triangles left out that stand twice", first(&self.duplicates)),
            (self.needles_collapsed, "triangles without area collapsed", String::new()),
            (self.caps_flipped, "triangles without area removed by flipping an edge", String::new()),
            (self.flat_dropped.len(), "triangles without area left out", first(&self.flat_dropped)),
            (self.flipped.len(), "triangles turned around", first(&self.flipped)),
            (self.non_manifold_edges.len(), "edges with more than two triangles taken apart", edge),
            (
                self.non_manifold_vertices.len(),
                "vertices split where several sheets meet",
                first(&self.non_manifold_vertices),
            ),
            (self.unorientable_cuts, "edges cut open where the surface has only one side", String::new()),
            (self.detached.len(), "triangles cut off where a sheet touches itself", first(&self.detached)),
        ]
        .into_iter()
        .filter(|(count, ..)| *count > 0)
        .map(|(count, what, first)| format!("{count} {what}{first}"))
    }
}

impl fmt::Display for RepairReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.is_clean() {
            writeln!(f, "nothing to repair")?;
        }
        self.changes().try_for_each(|change| writeln!(f, "{change}"))?;
        write!(f, "{} vertices, {} triangles", self.vertices_after, self.triangles_after)?;
        let s = if self.components.len() == 1 { "" } else { "s" };
        writeln!(f, ", {} component{s}, {} boundaries", self.components.len(), self.boundary_loops.len())?;
        write!(f, "{} edges with negative cotangent weight", self.negative_weights)
    }
}

/// Adds the properties of the result to the report; returns it with the component of each vertex.
pub(super) fn describe(mesh: &TriMesh, mut report: RepairReport) -> (RepairReport, Vec<u32>) {
    report.vertices_after = mesh.vertex_count();
    report.triangles_after = mesh.triangle_count();
    (report.obtuse_corners, report.negative_weights) = negative_cotangents(mesh);
    let half_edges = HalfEdges::new(mesh).expect("repair makes oriented manifolds");
    let (component_of, mut components) = components(mesh);
    for line in half_edges.boundary_loops() {
        let component = component_of[line[0] as usize];
        components[component as usize].boundary_loops += 1;
        let point = |k: usize| mesh.positions()[line[k % line.len()] as usize];
        let length = (0..line.len()).map(|k| (point(k + 1) - point(k)).norm()).sum();
        report.boundary_loops.push(BoundaryLoop { component, first_vertex: line[0], vertices: line.len(), length });
    }
    // Genus g from the Euler characteristic: V − E + F = 2 − 2 g − b with b boundary loops.
    let mut edges = vec![0_isize; components.len()];
    half_edges.edges().for_each(|h| edges[component_of[half_edges.origin(h) as usize] as usize] += 1);
    for (component, edges) in components.iter_mut().zip(edges) {
        let euler = component.vertices.cast_signed() - edges + component.triangles.cast_signed();
        component.genus = ((2 - euler - component.boundary_loops.cast_signed()) / 2).max(0) as usize;
        if component.boundary_loops > 0 {
            component.volume = None;
        }
    }
    report.components = components;
    (report, component_of)
}

/// The component of each vertex, numbered by lowest vertex, and the measures of each component. An isolated vertex is a
/// component without triangles. Volumes are computed about the first vertex of the component, to avoid cancellation.
pub(super) fn components(mesh: &TriMesh) -> (Vec<u32>, Vec<Component>) {
    let (component_of, count) = numbered_components(mesh.vertex_count(), mesh.triangles());
    let mut components = vec![Component { volume: Some(0.0), ..Component::default() }; count];
    for (vertex, &number) in component_of.iter().enumerate().rev() {
        let component = &mut components[number as usize];
        component.first_vertex = vertex as u32;
        component.vertices += 1;
    }
    for (t, corners) in mesh.triangles().iter().enumerate() {
        let component = &mut components[component_of[corners[0] as usize] as usize];
        component.triangles += 1;
        component.area += 0.5 * mesh.area_normal(t).norm();
        let origin = mesh.positions()[component.first_vertex as usize];
        let [a, b, c] = mesh.corners(t).map(|p| p - origin);
        *component.volume.get_or_insert(0.0) += a.dot(&b.cross(&c));
    }
    for component in &mut components {
        component.volume = component.volume.map(|six_times| six_times / 6.0);
    }
    (component_of, components)
}

/// Number of corners with a negative cotangent, and of edges at which the cotangents of the opposite corners have a negative
/// sum.
pub(super) fn negative_cotangents(mesh: &TriMesh) -> (usize, usize) {
    let origins = mesh.triangles().as_flattened();
    let cotangent = |h: u32| {
        let corners = mesh.corners(h as usize / 3);
        let tip = corners[HalfEdges::previous(h) as usize % 3];
        let (u, v) = (corners[h as usize % 3] - tip, corners[HalfEdges::next(h) as usize % 3] - tip);
        u.dot(&v) / u.cross(&v).norm()
    };
    let obtuse = (0..origins.len() as u32).filter(|&h| cotangent(h) < 0.0).count();
    let groups = edge_groups(origins);
    let negative = groups.iter().filter(|edge| edge.iter().map(|&(_, h)| cotangent(h)).sum::<f64>() < 0.0).count();
    (obtuse, negative)
}
