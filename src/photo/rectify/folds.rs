//! Folded cells, and the way back from them.

use plumbline_image::grid::{GridMesh, Quad};

/// Halvings of the step towards a folded grid: after 30 the displacement is below 10⁻⁹ of it.
const MAX_HALVINGS: i32 = 30;

/// Which cells of a grid of `cols × rows` are among `cells` or adjacent to one of them.
pub(crate) fn with_neighbors(cells: &[usize], (cols, rows): (usize, usize)) -> Vec<bool> {
    let mut touched = vec![false; cols * rows];
    for cell in cells {
        let (i, j) = (cell % cols, cell / cols);
        for row in j.saturating_sub(1)..(j + 2).min(rows) {
            touched[row * cols + i.saturating_sub(1)..row * cols + (i + 2).min(cols)].fill(true);
        }
    }
    touched
}

pub(super) fn folds(quad: &Quad) -> bool {
    !(quad.min_jacobian() > 0.0)
}

/// The mesh without folds farthest along the straight path from `sound`, which has none, to `found`, by halving the
/// step.
pub(crate) fn drawn_back(sound: &GridMesh, found: &GridMesh) -> GridMesh {
    let mut mesh = sound.clone();
    for k in 1..=MAX_HALVINGS {
        let t = 0.5_f64.powi(k);
        for (i, v) in mesh.vertices.iter_mut().enumerate() {
            *v = sound.vertices[i] + t * (found.vertices[i] - sound.vertices[i]);
        }
        if mesh.folded_cells() == 0 {
            return mesh;
        }
    }
    sound.clone()
}
