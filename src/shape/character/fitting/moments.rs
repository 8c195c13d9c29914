//! Best similarity between weighted point sets, from running sums.
//!
//! ```text
//! min over s, R, t of  Σ w |b − s R a − t|²  =  B − tr(Rᵀ H)² / A
//! ```
//!
//! with `H = Σ w b aᵀ`, `A = Σ w |a|²`, `B = Σ w |b|²` about the centroids, and `R` the proper rotation nearest to `H`: reflected points
//! have a residual.
//!
//! # Reference
//! S. Umeyama, *Least-squares estimation of transformation parameters between two point patterns*, PAMI 13 (1991).

use nalgebra::{Matrix3, Vector3};

use plumbline_num::math::nearest_rotation;

/// Weighted sums over pairs of points.
#[derive(Clone, Copy, Debug)]
pub(super) struct Moments {
    weight: f64,
    a: Vector3<f64>,
    b: Vector3<f64>,
    ba: Matrix3<f64>,
    aa: f64,
    bb: f64,
}

/// Residual of `b ≈ s R a + t`, and its `R`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Alignment {
    /// `R`.
    pub(super) rotation: Matrix3<f64>,
    /// The minimum as a fraction of `B`, 0 to 1.
    pub(super) residual: f64,
}

impl Default for Moments {
    fn default() -> Self {
        let (zero, none) = (Vector3::zeros(), Matrix3::zeros());
        Self { weight: 0.0, a: zero, b: zero, ba: none, aa: 0.0, bb: 0.0 }
    }
}

impl Moments {
    /// Adds a pair.
    pub(super) fn add(&mut self, weight: f64, a: &Vector3<f64>, b: &Vector3<f64>) {
        self.weight += weight;
        self.a += a * weight;
        self.b += b * weight;
        self.ba += b * a.transpose() * weight;
        self.aa += a.norm_squared() * weight;
        self.bb += b.norm_squared() * weight;
    }

    /// The best similarity; the identity if the points have no extent.
    pub(super) fn alignment(&self) -> Alignment {
        let w = self.weight.max(f64::MIN_POSITIVE);
        let (a, b) = (self.a / w, self.b / w);
        let h = self.ba - b * self.a.transpose();
        let (aa, bb) = (self.aa - self.a.dot(&a), self.bb - self.b.dot(&b));
        if !(aa > 0.0 && bb > 0.0) {
            return Alignment { rotation: Matrix3::identity(), residual: 0.0 };
        }
        let rotation = nearest_rotation(&h);
        let along = rotation.dot(&h);
        let residual = (1.0 - along * along / (aa * bb)).clamp(0.0, 1.0);
        Alignment { rotation, residual }
    }
}
