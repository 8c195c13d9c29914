//! Surfaces and skeletons by their content in memory.

use std::io::{self, BufWriter, Write};

use plumbline_shape::character::Skeleton;
use plumbline_shape::character::skeleton_file::SkeletonFile;
use plumbline_shape::mesh::TriMesh;

/// BLAKE3 of positions and triangles.
pub(super) fn digest_of_mesh(mesh: &TriMesh) -> io::Result<String> {
    let mut hasher = BufWriter::with_capacity(1 << 16, blake3::Hasher::new());
    writeln!(hasher, "{} {}", mesh.positions().len(), mesh.triangles().len())?;
    for coordinate in mesh.positions().iter().flat_map(|p| [p.x, p.y, p.z]) {
        hasher.write_all(&coordinate.to_bits().to_le_bytes())?;
    }
    for vertex in mesh.triangles().iter().flatten() {
        hasher.write_all(&vertex.to_le_bytes())?;
    }
    let hasher = hasher.into_inner().map_err(io::IntoInnerError::into_error)?;
    Ok(hasher.finalize().to_hex().to_string())
}

/// BLAKE3 of the file of a skeleton, which has every bit of it.
pub(super) fn digest_of_skeleton(skeleton: &Skeleton) -> String {
    let file = SkeletonFile { skeleton: skeleton.clone(), curve: None, clips: Vec::new(), proposed_names: None };
    blake3::hash(file.to_json().as_bytes()).to_hex().to_string()
}
