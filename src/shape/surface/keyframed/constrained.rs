//! The constrained vertices of the surface that is solved for, and their targets over time.

use nalgebra::{Point3, UnitQuaternion};

use super::solvable::SolvableMesh;
use crate::mesh::{TriMesh, neighbors_of_vertices};
use crate::surface::handle_file::{MeshHandles, Track};
use crate::surface::{Constraint, HandlePose, Handles, SurfaceError};
use plumbline_num::spatial::ShortestPaths;

/// A constrained vertex of the mesh that is deformed.
#[derive(Clone, Copy, Debug)]
struct ConstrainedVertex {
    vertex: u32,
    /// Handle, and which of its vertices this is; `None`: fixed because it is outside the region.
    of: Option<(usize, usize)>,
}

/// Handles on the mesh that is deformed.
#[derive(Debug)]
pub(super) struct Constrained {
    vertices: Vec<ConstrainedVertex>,
    /// What the user should know.
    pub(super) warnings: Vec<String>,
}

impl Constrained {
    /// The constrained vertices of `solvable`. With `reach`, what is farther along edges than that from every handle that moves
    /// is fixed.
    pub(super) fn new(
        handles: &MeshHandles,
        solvable: &SolvableMesh,
        reach: Option<f64>,
    ) -> Result<Self, SurfaceError> {
        let mut constrained = Self { vertices: Vec::new(), warnings: Vec::new() };
        let owner = constrained.owners(handles, solvable)?;
        let mut outside = vec![false; solvable.mesh.vertex_count()];
        for v in &handles.outside {
            solvable.vertex_of_source[*v as usize].iter().for_each(|r| outside[*r as usize] = true);
        }
        if let Some(reach) = reach {
            fix_beyond(reach, handles, &solvable.mesh, &owner, &mut outside);
        }
        for (vertex, (of, outside)) in owner.iter().zip(outside).enumerate() {
            if of.is_some() || outside {
                constrained.vertices.push(ConstrainedVertex { vertex: vertex as u32, of: *of });
            }
        }
        Ok(constrained)
    }

    /// The handle of each vertex of the mesh that is deformed.
    fn owners(
        &mut self,
        handles: &MeshHandles,
        solvable: &SolvableMesh,
    ) -> Result<Vec<Option<(usize, usize)>>, SurfaceError> {
        let mut of_source: Vec<Option<(usize, usize)>> = vec![None; solvable.vertex_of_source.len()];
        for (h, handle) in handles.handles.iter().enumerate() {
            let mut gone = 0;
            for (k, &v) in handle.vertices.iter().enumerate() {
                let Some(result) = solvable.vertex_of_source[v as usize] else {
                    gone += 1;
                    continue;
                };
                let slot = &mut of_source[solvable.source_of_vertex[result as usize] as usize];
                match *slot {
                    None => *slot = Some((h, k)),
                    Some((other, at)) if other != h => {
                        return Err(SurfaceError::JoinedHandles {
                            vertices: [handles.handles[other].vertices[at], v],
                            handles: [handles.handles[other].name.clone(), handle.name.clone()],
                        });
                    }
                    Some(_) => {}
                }
            }
            if gone == handle.vertices.len() {
                return Err(SurfaceError::HandleNotOnSurface { name: handle.name.clone() });
            }
            if gone > 0 {
                self.warnings
                    .push(format!("handle {:?}: {gone} of its vertices are on no triangle and stay", handle.name));
            }
        }
        Ok(solvable.source_of_vertex.iter().map(|source| of_source[*source as usize]).collect())
    }

    /// The set of constrained vertices.
    pub(super) fn set(&self, handles: &MeshHandles) -> Result<Handles, SurfaceError> {
        let constraint = |v: &ConstrainedVertex| {
            let weight = v.of.and_then(|(h, _)| handles.handles[h].weight);
            (v.vertex, weight.map_or(Constraint::Hard, Constraint::Soft))
        };
        Handles::new(self.vertices.iter().map(constraint))
    }

    /// Their targets at a time.
    pub(super) fn pose(&self, handles: &MeshHandles, rest: &[Point3<f64>], mesh: &TriMesh, time: f64) -> HandlePose {
        let all = &handles.handles;
        let targets: Vec<_> = all.iter().map(|h| h.track.positions(&h.vertices, rest, time)).collect();
        let rotations: Vec<Option<UnitQuaternion<f64>>> = all.iter().map(|h| h.track.rotation(time)).collect();
        let position = |v: &ConstrainedVertex| match v.of {
            Some((h, k)) => targets[h][k],
            None => mesh.positions()[v.vertex as usize],
        };
        let pose = HandlePose::new(self.vertices.iter().map(position).collect());
        // Rotations are known of all vertices or of none: handles that move freely have none.
        let rotation = |v: &ConstrainedVertex| v.of.map_or(Some(UnitQuaternion::identity()), |(h, _)| rotations[h]);
        match self.vertices.iter().map(rotation).collect() {
            Some(rotations) => pose.with_rotations(rotations),
            None => pose,
        }
    }
}

/// Fixes what is farther along edges from all handles that move.
fn fix_beyond(
    reach: f64,
    handles: &MeshHandles,
    mesh: &TriMesh,
    owner: &[Option<(usize, usize)>],
    outside: &mut [bool],
) {
    let moves = |of: &Option<(usize, usize)>| of.is_some_and(|(h, _)| handles.handles[h].track.times().is_some());
    let starts = (0..owner.len()).filter(|v| moves(&owner[*v]));
    for (outside, distance) in outside.iter_mut().zip(distances(mesh, starts)) {
        *outside |= !(distance <= reach);
    }
}

/// Largest rotation of a handle between two times, rad.
pub(super) fn max_rotation(handles: &MeshHandles, from: f64, to: f64) -> f64 {
    // Between two samples a handle must rotate by less than π, or the shortest rotation is the wrong one: 32 allow 16 whole
    // rotations between two times.
    const STEPS: u32 = 32;
    let at = |k: u32| from + (to - from) * f64::from(k) / f64::from(STEPS);
    let of = |track: &Track| -> f64 {
        let angle = |k: u32| Some(track.rotation(at(k))?.angle_to(&track.rotation(at(k + 1))?));
        (0..STEPS).filter_map(angle).sum()
    };
    handles.handles.iter().map(|h| of(&h.track)).fold(0.0, f64::max)
}

/// Length of the shortest path along edges from any of `starts`; infinite where there is none.
fn distances(mesh: &TriMesh, starts: impl Iterator<Item = usize>) -> Vec<f64> {
    let (p, neighbors) = (mesh.positions(), neighbors_of_vertices(mesh.vertex_count(), mesh.triangles()));
    let edges =
        |v: u32| neighbors[v as usize].iter().map(move |&w| (w, nalgebra::distance(&p[v as usize], &p[w as usize])));
    ShortestPaths::new(mesh.vertex_count(), starts.map(|v| v as u32), edges).length
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::handle_file::HandleFile;
    use plumbline_num::run::Run;

    /// A strip of unit squares along x, its halves apart: the vertices of its middle are doubled.
    fn strip() -> TriMesh {
        let at = |x: f64| [Point3::new(x, 0.0, 0.0), Point3::new(x, 1.0, 0.0)];
        let positions = [0.0, 1.0, 1.0, 2.0].map(at).concat();
        TriMesh::new(positions, vec![[0, 2, 3], [0, 3, 1], [4, 6, 7], [4, 7, 5]]).unwrap()
    }

    fn handles(entries: &str, mesh: &TriMesh) -> MeshHandles {
        let text = format!("{{\"format\": \"plumbline.handles\", \"version\": 1, \"handles\": [{entries}]}}");
        HandleFile::parse(&text).unwrap().of_mesh(mesh.positions()).unwrap()
    }

    #[test]
    fn vertices_that_repair_joined_are_constrained_once_and_moved_by_their_handle() {
        let mesh = strip();
        let solvable = SolvableMesh::new(&mesh, &Run::default()).unwrap();
        let found = handles("{\"vertices\": {\"indices\": [2, 4]}, \"rigid\": {\"translation\": [0, 0, 3]}}", &mesh);
        let constrained = Constrained::new(&found, &solvable, None).unwrap();
        assert_eq!(constrained.set(&found).unwrap().len(), 1);
        assert_eq!(
            constrained.pose(&found, mesh.positions(), &solvable.mesh, 1.0).positions(),
            [Point3::new(1.0, 0.0, 3.0)]
        );
        let torn = handles(
            "{\"name\": \"a\", \"vertices\": {\"indices\": [2]}}, {\"name\": \"b\", \"vertices\": {\"indices\": [4]}}",
            &mesh,
        );
        let message = Constrained::new(&torn, &solvable, None).expect_err("two targets for one position").to_string();
        assert!(
            message.contains("vertex 2 of handle \"a\" and vertex 4 of handle \"b\" are at the same position"),
            "{message}"
        );
    }

    #[test]
    fn what_is_farther_along_edges_than_the_reach_is_fixed() {
        let mesh = strip();
        let solvable = SolvableMesh::new(&mesh, &Run::default()).unwrap();
        let found = handles("{\"vertices\": {\"indices\": [0, 1]}, \"rigid\": {\"translation\": [0, 0, 1]}}", &mesh);
        let constrained = |roi| Constrained::new(&found, &solvable, roi).unwrap().set(&found).unwrap().len();
        assert_eq!([None, Some(0.5), Some(1.0), Some(2.0)].map(constrained), [2, 6, 4, 2]);
    }
}
