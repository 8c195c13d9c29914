//! Triangle meshes: files, repair and operators; deformation, skeletons and skinning, morphing, drawing.

pub mod character;
pub mod draw;
pub mod mesh;
pub mod morph;
pub mod surface;
