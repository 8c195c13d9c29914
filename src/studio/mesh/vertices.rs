//! Sets of vertices: combined, checked, followed along edges of the surface.
//!
//! Rings and components are those of the surface that is solved for, where copies of a vertex at one position are one: a seam of texture
//! coordinates is no border.

use nalgebra::{Point3, Vector3};
use serde::Deserialize;

use crate::error::StudioError;
use plumbline_shape::mesh::VertexGraph;
use plumbline_shape::surface::SolvableMesh;

/// What a set of vertices does to the selection.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[serde(rename_all = "snake_case")]
pub enum Combine {
    /// It is the selection.
    #[default]
    Replace,
    /// It is added.
    Add,
    /// It is removed.
    Remove,
    /// The selection stays where it is in the set.
    Intersect,
}

/// The set of ascending vertices that a page named.
///
/// # Errors
/// [`StudioError::Request`] for a vertex that does not exist, or more vertices than the mesh has.
pub fn checked(mut vertices: Vec<u32>, count: usize) -> Result<Vec<u32>, StudioError> {
    vertices.sort_unstable();
    vertices.dedup();
    match vertices.last() {
        Some(&last) if last as usize >= count => {
            Err(StudioError::request(format!("there is no vertex {last} (expected 0 to {})", count.saturating_sub(1))))
        }
        _ => Ok(vertices),
    }
}

/// The selection after a set was combined with it; both ascending.
pub fn combined(selection: &[u32], set: Vec<u32>, how: Combine) -> Vec<u32> {
    let inside = |all: &[u32], v: &u32| all.binary_search(v).is_ok();
    match how {
        Combine::Replace => set,
        Combine::Add => {
            let mut all = [selection, &set].concat();
            all.sort_unstable();
            all.dedup();
            all
        }
        Combine::Remove => selection.iter().copied().filter(|v| !inside(&set, v)).collect(),
        Combine::Intersect => selection.iter().copied().filter(|v| inside(&set, v)).collect(),
    }
}

/// All vertices but these.
pub fn inverted(vertices: &[u32], count: usize) -> Vec<u32> {
    let mut outside = vec![true; count];
    for v in vertices {
        outside[*v as usize] = false;
    }
    (0..count as u32).filter(|v| outside[*v as usize]).collect()
}

/// The vertices on one side of a plane, the plane included.
///
/// # Errors
/// [`StudioError::Request`] for a normal that is no direction.
pub fn half_space(rest: &[Point3<f64>], point: [f64; 3], normal: [f64; 3]) -> Result<Vec<u32>, StudioError> {
    let normal = Vector3::from(normal).try_normalize(0.0).filter(|n| n.iter().all(|c| c.is_finite()));
    let normal =
        normal.ok_or_else(|| StudioError::request("the normal is no direction: give a vector that is not zero"))?;
    let point = Point3::from(point);
    if !point.coords.iter().all(|c| c.is_finite()) {
        return Err(StudioError::request("the point of the plane is not finite"));
    }
    let inside = |v: &usize| (rest[*v] - point).dot(&normal) >= 0.0;
    Ok((0..rest.len()).filter(inside).map(|v| v as u32).collect())
}

/// How far a set is followed along edges.
#[derive(Clone, Copy, Debug)]
pub enum Follow {
    /// This many rings more.
    Grow(usize),
    /// This many rings less.
    Shrink(usize),
    /// To the ends of the connected components.
    Component,
}

/// A set of vertices of the file, followed along the edges of the surface.
pub fn followed(vertices: &[u32], how: Follow, solvable: &SolvableMesh, graph: &VertexGraph) -> Vec<u32> {
    let on_surface: Vec<u32> = vertices.iter().filter_map(|v| solvable.vertex_of_source[*v as usize]).collect();
    let found = match how {
        Follow::Grow(rings) => graph.grown(&on_surface, rings),
        Follow::Shrink(rings) => graph.shrunk(&on_surface, rings),
        Follow::Component => graph.connected(&on_surface),
    };
    let mut inside = vec![false; solvable.mesh.vertex_count()];
    for v in &found {
        inside[*v as usize] = true;
    }
    let is_inside = |(v, at): (usize, &Option<u32>)| at.is_some_and(|at| inside[at as usize]).then_some(v as u32);
    solvable.vertex_of_source.iter().enumerate().filter_map(is_inside).collect()
}
