//! `mesh.load`: opens a mesh.

use super::mesh::mesh_error;
use super::prelude::*;
use super::values::Posed;
use crate::pipeline::paths::to_path;
use crate::pipeline::summary::SurfaceSummary;
use crate::pipeline::units::ByteSize;
use plumbline_shape::mesh::{Model, ReadLimits, read_model};

/// Settings of `mesh.load`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct MeshLoadSettings {
    /// The mesh: OBJ, PLY, OFF, STL, glTF, GLB, FBX or Medit
    #[schemars(extend("format" = "path"))]
    pub path: String,
    /// Most bytes of the file and of what it refers to; larger ones are refused before memory is taken for them
    pub max_bytes: ByteSize,
    /// Set vertices with coordinates that are not finite to the mean of their neighbors, with a warning, instead of refusing the mesh
    pub mend_vertices: bool,
}

impl Default for MeshLoadSettings {
    fn default() -> Self {
        Self { path: String::new(), max_bytes: ByteSize(ReadLimits::default().max_bytes), mend_vertices: false }
    }
}

impl Stage for MeshLoadSettings {
    const KIND: &'static str = "mesh.load";
    const SUMMARY: &'static str =
        "opens a mesh with its polygons, texture coordinates, normals, colors, groups and materials";
    const INPUTS: &'static [Port] = &[];
    const OUTPUTS: &'static [Port] = &[Port::one("mesh", PortType::Mesh, "the mesh")];
    const REQUIRED: &'static [&'static str] = &["path"];
    type Input = ();
    type Output = (Posed,);

    fn reads(&self) -> Vec<&str> {
        vec![&self.path]
    }

    fn run(&self, (): Self::Input, context: &mut Context<'_, '_>) -> Result<Self::Output, RunError> {
        let path = &to_path(&self.path);
        let (max_bytes, mend_vertices) = (self.max_bytes.0, self.mend_vertices);
        let limits = ReadLimits { max_bytes, mend_vertices, ..context.job.read_limits() };
        let model = read_model(path, &limits, &context.job.run()).map_err(|e| mesh_error(path, &e))?;
        for warning in model.warnings() {
            context.warn(format!("{}: {warning}", path.display()));
        }
        context.summary.surface.get_or_insert_with(|| summary(&self.path, &model));
        Ok((Posed::at_rest(model),))
    }
}

fn summary(name: &str, model: &Model) -> SurfaceSummary {
    let bounds = model.mesh().bounding_box().map_or([[0.0; 3]; 2], |(low, high)| [low, high].map(|p| p.coords.into()));
    let (vertices, faces) = (model.mesh().vertex_count(), model.faces().len());
    SurfaceSummary { name: name.to_owned(), vertices, faces, bounds, ..SurfaceSummary::default() }
}
