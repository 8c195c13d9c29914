//! The unknowns of a deformation: vertices connected to a handle and without a hard constraint.

use serde::{Deserialize, Serialize};

use super::{Constraint, Handles, SurfaceError};
use crate::mesh::TriMesh;
pub(super) use plumbline_num::energy::FIXED;
use plumbline_num::spatial::components;

/// Treatment of connected components without a handle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum Unconstrained {
    /// Keep them fixed; the report lists them.
    #[default]
    Keep,
    /// Reject the mesh.
    Reject,
}

/// A connected component of a surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Component {
    /// Its lowest vertex.
    pub vertex: u32,
    /// Number of its vertices.
    pub vertices: usize,
}

/// The partition of the vertices into unknowns and fixed ones.
#[derive(Clone, Debug)]
pub(super) struct Unknowns {
    pub(super) handles: Handles,
    /// Vertices of the unknowns, ascending.
    pub(super) free: Vec<u32>,
    /// Unknown of each vertex, or [`FIXED`].
    pub(super) unknown: Vec<u32>,
    /// Soft constraints: index of the handle, and weight.
    pub(super) soft: Vec<(usize, f64)>,
    /// Components without a handle; unreferenced vertices are not listed.
    pub(super) unconstrained: Vec<Component>,
    /// Lowest vertex of the connected component of each vertex.
    pub(super) component: Vec<u32>,
}

impl Unknowns {
    pub(super) fn new(mesh: &TriMesh, handles: &Handles, policy: Unconstrained) -> Result<Self, SurfaceError> {
        let vertices = mesh.vertex_count();
        if let Some(&vertex) = handles.vertices().iter().find(|&&v| v as usize >= vertices) {
            return Err(SurfaceError::NoSuchVertex { vertex, vertices });
        }
        if handles.is_empty() {
            return Err(SurfaceError::NoHandle);
        }
        let component = components(vertices, mesh.triangles());
        let unconstrained = unconstrained(mesh, handles, &component);
        if let (Unconstrained::Reject, Some(p)) = (policy, unconstrained.first()) {
            return Err(SurfaceError::Unconstrained { vertex: p.vertex, vertices: p.vertices });
        }
        let mut moves = vec![false; vertices];
        handles.vertices().iter().for_each(|&v| moves[component[v as usize] as usize] = true);
        let mut unknown: Vec<u32> = component.iter().map(|&p| if moves[p as usize] { 0 } else { FIXED }).collect();
        for (&v, constraint) in handles.vertices().iter().zip(handles.constraints()) {
            if *constraint == Constraint::Hard {
                unknown[v as usize] = FIXED;
            }
        }
        let free: Vec<u32> = (0..vertices as u32).filter(|&v| unknown[v as usize] != FIXED).collect();
        free.iter().enumerate().for_each(|(k, &v)| unknown[v as usize] = k as u32);
        let soft = handles.constraints().iter().enumerate().filter_map(|(k, constraint)| match *constraint {
            Constraint::Soft(weight) => Some((k, weight)),
            Constraint::Hard => None,
        });
        Ok(Self { soft: soft.collect(), handles: handles.clone(), free, unknown, unconstrained, component })
    }
}

/// Connected components with triangles and without a handle.
fn unconstrained(mesh: &TriMesh, handles: &Handles, component: &[u32]) -> Vec<Component> {
    let mut size = vec![0_usize; component.len()];
    for &p in component {
        size[p as usize] += 1;
    }
    let mut listed = vec![false; component.len()];
    mesh.triangles().iter().for_each(|t| listed[component[t[0] as usize] as usize] = true);
    handles.vertices().iter().for_each(|&v| listed[component[v as usize] as usize] = false);
    let lowest = (0..component.len()).filter(|&c| listed[c]);
    lowest.map(|c| Component { vertex: c as u32, vertices: size[c] }).collect()
}
