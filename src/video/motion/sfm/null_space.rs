//! Orthonormal null space of a few rows, by the Gram–Schmidt process with reorthogonalization.
//!
//! A decomposition of the squared matrix `AᵀA` would lose half of the digits. Here the rows themselves are
//! orthonormalized, and the remaining dimensions are filled from the coordinate axes with the largest perpendicular
//! component.
//!
//! # Reference
//! L. Giraud, J. Langou, M. Rozložník, *The loss of orthogonality in the Gram–Schmidt process*, 2005 ("twice is enough").

use nalgebra::SVector;

/// A row is linearly dependent on the previous ones if its perpendicular component is below this fraction of its
/// length.
const DEPENDENT: f64 = 1e-9;

/// An orthonormal basis of `{x ∈ ℝ⁹ : rᵢ·x = 0}`, `K = 9 − rows` vectors; `None` if the rows are linearly dependent.
pub(super) fn null_space<const ROWS: usize, const K: usize>(
    rows: &[SVector<f64, 9>; ROWS],
) -> Option<[SVector<f64, 9>; K]> {
    const { assert!(ROWS + K == 9) };
    let mut basis = [SVector::<f64, 9>::zeros(); 9];
    for (k, row) in rows.iter().enumerate() {
        let length = row.norm();
        let rest = perpendicular(row, &basis[..k]);
        if !(rest.norm() > DEPENDENT * length) {
            return None;
        }
        basis[k] = perpendicular(&(rest / rest.norm()), &basis[..k]).normalize();
    }
    for k in ROWS..9 {
        // The axis with the largest perpendicular component, of squared length 1 − Σ bᵢ²: at least K/9 at first.
        let covered = |axis: usize| basis[..k].iter().map(|b| b[axis] * b[axis]).sum::<f64>();
        let axis = (0..9).min_by(|&a, &b| covered(a).total_cmp(&covered(b))).expect("nine axes");
        let mut unit = SVector::<f64, 9>::zeros();
        unit[axis] = 1.0;
        let rest = perpendicular(&unit, &basis[..k]).normalize();
        basis[k] = perpendicular(&rest, &basis[..k]).normalize();
    }
    Some(std::array::from_fn(|k| basis[ROWS + k]))
}

fn perpendicular(v: &SVector<f64, 9>, basis: &[SVector<f64, 9>]) -> SVector<f64, 9> {
    basis.iter().fold(*v, |rest, b| rest - b * b.dot(&rest))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_basis_is_orthonormal_and_perpendicular_to_every_row() {
        let mut rng = fastrand::Rng::with_seed(2);
        let mut rows = [SVector::<f64, 9>::zeros(); 5];
        for value in rows.iter_mut().flat_map(|r| r.iter_mut()) {
            *value = rng.f64() - 0.5;
        }
        // For two nearly parallel rows a single Gram–Schmidt pass would fail.
        rows[1] = rows[0] + 1e-6 * rows[1];
        let basis: [SVector<f64, 9>; 4] = null_space(&rows).expect("independent");
        for (i, b) in basis.iter().enumerate() {
            assert!(rows.iter().all(|r| r.dot(b).abs() < 1e-15 * 10.0), "row times basis vector {i}");
            assert!(basis.iter().enumerate().all(|(j, c)| (b.dot(c) - f64::from(i == j)).abs() < 1e-14));
        }
    }

    #[test]
    fn dependent_rows_are_refused() {
        let mut rows = [SVector::<f64, 9>::zeros(); 7];
        rows.iter_mut().enumerate().for_each(|(k, r)| r[k] = 1.0);
        assert!(null_space::<7, 2>(&rows).is_some());
        rows[3] = rows[1] * 2.0;
        assert!(null_space::<7, 2>(&rows).is_none());
    }
}
