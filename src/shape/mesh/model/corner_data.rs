//! Per-corner (face-vertex) attributes: a vertex may have a different value in each incident face (texture seams, hard edges).

/// Null index: the value index of a corner without a value, the label of a face without one. `u32::MAX`, because
/// [`ModelBuilder::finish`](super::ModelBuilder::finish) rejects models with as many corners.
pub const NO_VALUE: u32 = u32::MAX;

/// An attribute of `N` numbers per corner, indexed: corners with a common value refer to one entry.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CornerData<const N: usize> {
    /// The distinct values.
    pub values: Vec<[f64; N]>,
    /// Index of the value of each corner; [`NO_VALUE`] if it has none.
    pub of_corner: Vec<u32>,
}

impl<const N: usize> CornerData<N> {
    /// The value of a corner.
    #[inline]
    pub fn get(&self, corner: usize) -> Option<[f64; N]> {
        self.values.get(self.of_corner[corner] as usize).copied()
    }

    /// The attribute per vertex; `None` if the corners of a vertex differ or a corner has no value. Vertices without a corner
    /// get zero. `vertex_of_corner` maps corners to vertices.
    pub fn per_vertex(&self, vertex_of_corner: &[u32], vertices: usize) -> Option<Vec<[f64; N]>> {
        let mut of_vertex = vec![None; vertices];
        for (corner, &vertex) in vertex_of_corner.iter().enumerate() {
            let value = self.get(corner)?;
            if of_vertex[vertex as usize].is_some_and(|other| other != value) {
                return None;
            }
            of_vertex[vertex as usize] = Some(value);
        }
        Some(of_vertex.into_iter().map(|value| value.unwrap_or([0.0; N])).collect())
    }

    /// The attribute restricted to the given corners, in their order.
    pub(super) fn of(&self, corners: &[u32]) -> Self {
        let of_corner = corners.iter().map(|&corner| self.of_corner[corner as usize]).collect();
        Self { values: self.values.clone(), of_corner }
    }
}
