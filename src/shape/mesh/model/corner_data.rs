//! Values at the corners of faces: a vertex may have another value in each face around it (seams, hard edges).

/// What a corner without a value points to.
pub const NO_VALUE: u32 = u32::MAX;

/// `N` numbers at each corner, stored once where corners share them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CornerData<const N: usize> {
    /// The values.
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

    /// One value per vertex, if no vertex has two; zero for vertices without. `vertex_of_corner` maps corners to vertices.
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

    /// The values of these corners, in their order.
    pub(super) fn of(&self, corners: &[u32]) -> Self {
        let of_corner = corners.iter().map(|&corner| self.of_corner[corner as usize]).collect();
        Self { values: self.values.clone(), of_corner }
    }
}
