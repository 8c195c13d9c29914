//! Meshes: the regular grid laid over an image, the same grid after its vertices have moved, and surfaces of triangles with
//! their files, neighborhoods and repair.

mod error;
mod half_edges;
pub mod io;
pub mod model;
pub mod operators;
pub mod repair;
pub mod shapes;
mod tri_mesh;
mod vertex_ref;

pub use error::{MeshError, Position};
pub use half_edges::HalfEdges;
pub(crate) use half_edges::edge_groups;
pub use io::{MeshFormat, ReadLimits, read_model, write_model};
pub use model::{CornerData, Faces, GltfAssets, Group, Labels, Material, Model, ModelBuilder, NO_VALUE};
pub use repair::{MeshFacts, RepairOptions, RepairReport, Repaired, Weld, repair};
pub use tri_mesh::{TriMesh, neighbors_of_vertices};
pub use vertex_ref::VertexRef;
