//! What of a surface is free to move: vertices joined to a handle that are not held exactly themselves.

use serde::{Deserialize, Serialize};

use super::{Handles, Hold, SurfaceError};
use crate::mesh::TriMesh;
pub(super) use plumbline_num::energy::FIXED;
use plumbline_num::spatial::components;

/// What happens to a part of the surface that no handle is on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum Unheld {
    /// They stay where they are, and the summary names them.
    ///
    /// The report lists them.
    #[default]
    Still,
    /// The mesh is refused.
    Refused,
}

/// A connected part of a surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Part {
    /// Its lowest vertex.
    pub vertex: u32,
    /// Number of its vertices.
    pub vertices: usize,
}

/// The vertices of a mesh, sorted by what may move them.
#[derive(Clone, Debug)]
pub(super) struct Held {
    pub(super) handles: Handles,
    /// Vertices that are unknowns, ascending.
    pub(super) free: Vec<u32>,
    /// Number of each vertex among the free, or [`FIXED`].
    pub(super) unknown: Vec<u32>,
    /// Soft handles: number among the handles, and weight.
    pub(super) soft: Vec<(usize, f64)>,
    /// Parts without a handle; vertices of no triangle are not listed.
    pub(super) still: Vec<Part>,
    /// Lowest vertex of the part that each vertex belongs to.
    pub(super) part: Vec<u32>,
}

impl Held {
    pub(super) fn new(mesh: &TriMesh, handles: &Handles, unheld: Unheld) -> Result<Self, SurfaceError> {
        let vertices = mesh.vertex_count();
        if let Some(&vertex) = handles.vertices().iter().find(|&&v| v as usize >= vertices) {
            return Err(SurfaceError::NoSuchVertex { vertex, vertices });
        }
        if handles.is_empty() {
            return Err(SurfaceError::NoHandle);
        }
        let part = components(vertices, mesh.triangles());
        let still = still_parts(mesh, handles, &part);
        if let (Unheld::Refused, Some(p)) = (unheld, still.first()) {
            return Err(SurfaceError::Unheld { vertex: p.vertex, vertices: p.vertices });
        }
        let mut moves = vec![false; vertices];
        handles.vertices().iter().for_each(|&v| moves[part[v as usize] as usize] = true);
        let mut unknown: Vec<u32> = part.iter().map(|&p| if moves[p as usize] { 0 } else { FIXED }).collect();
        for (&v, hold) in handles.vertices().iter().zip(handles.holds()) {
            if *hold == Hold::Exact {
                unknown[v as usize] = FIXED;
            }
        }
        let free: Vec<u32> = (0..vertices as u32).filter(|&v| unknown[v as usize] != FIXED).collect();
        free.iter().enumerate().for_each(|(k, &v)| unknown[v as usize] = k as u32);
        let soft = handles.holds().iter().enumerate().filter_map(|(k, hold)| match *hold {
            Hold::Soft(weight) => Some((k, weight)),
            Hold::Exact => None,
        });
        Ok(Self { soft: soft.collect(), handles: handles.clone(), free, unknown, still, part })
    }
}

fn still_parts(mesh: &TriMesh, handles: &Handles, part: &[u32]) -> Vec<Part> {
    let mut size = vec![0_usize; part.len()];
    for &p in part {
        size[p as usize] += 1;
    }
    let mut named = vec![false; part.len()];
    mesh.triangles().iter().for_each(|t| named[part[t[0] as usize] as usize] = true);
    handles.vertices().iter().for_each(|&v| named[part[v as usize] as usize] = false);
    let still = (0..part.len()).filter(|&p| named[p]);
    still.map(|p| Part { vertex: p as u32, vertices: size[p] }).collect()
}
