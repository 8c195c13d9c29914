//! Triangle meshes: indexed face set ([`TriMesh`]), half-edge connectivity ([`HalfEdges`]), discrete differential operators,
//! repair to an oriented manifold, procedural test shapes, and readers and writers of mesh files.

mod error;
mod half_edges;
pub mod io;
pub mod model;
pub mod operators;
mod outliers;
pub(crate) mod region;
pub mod repair;
pub mod shapes;
mod tri_mesh;
mod vertex_graph;
mod vertex_ref;

pub use error::{MeshError, Position};
pub use half_edges::HalfEdges;
pub(crate) use half_edges::edge_groups;
pub use io::{MeshFormat, ReadLimits, read_model, write_model};
pub use model::{CornerData, Faces, GltfAssets, Group, Labels, Material, Model, ModelBuilder, NO_VALUE};
pub use repair::{MeshFacts, RepairOptions, RepairReport, Repaired, Weld, repair};
pub use tri_mesh::{TriMesh, neighbors_of_vertices};
pub use vertex_graph::VertexGraph;
pub use vertex_ref::VertexRef;
