//! The lens models that compete.

use nalgebra::SVector;

use super::middle;
use crate::camera::{Lens, Projection};
use crate::math::{Point2, Vec2};

/// Most parameters of a model: focal length, center, two radial terms.
pub(super) const PARAMETERS: usize = 5;
/// `(ln f, c_x − W/2, c_y − H/2, k₁, k₂)`; terms that a model lacks stay zero.
pub(super) type Parameters = SVector<f64, PARAMETERS>;

/// A family of lenses with a focal length, a center and a few radial terms.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum LensModel {
    /// `r = f tan θ`.
    Rectilinear,
    /// `r = f θ`.
    Equidistant,
    /// `r = 2 f sin(θ/2)`.
    Equisolid,
    /// `r = 2 f tan(θ/2)`.
    Stereographic,
    /// `r = f sin θ`.
    Orthographic,
    /// `r = f θ (1 + k₁ θ²)`.
    KannalaBrandt1,
    /// `r = f θ (1 + k₁ θ² + k₂ θ⁴)`.
    KannalaBrandt2,
}

impl LensModel {
    /// All models, the ones with fewest terms first.
    pub fn all() -> Vec<Self> {
        use LensModel::{
            Equidistant, Equisolid, KannalaBrandt1, KannalaBrandt2, Orthographic, Rectilinear, Stereographic,
        };
        vec![Rectilinear, Equidistant, Equisolid, Stereographic, Orthographic, KannalaBrandt1, KannalaBrandt2]
    }

    /// The name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Rectilinear => "rectilinear",
            Self::Equidistant => "equidistant",
            Self::Equisolid => "equisolid",
            Self::Stereographic => "stereographic",
            Self::Orthographic => "orthographic",
            Self::KannalaBrandt1 => "kannala-brandt, one term",
            Self::KannalaBrandt2 => "kannala-brandt, two terms",
        }
    }

    /// Free parameters.
    pub(super) fn parameters(self) -> usize {
        3 + self.term_sigma().len()
    }

    /// Standard deviation that radial terms have a priori, one per term: makers' lenses keep to their base projection within
    /// a tenth at one radian. Much larger ones leave the focal length open, much smaller ones the lines bent.
    pub(super) fn term_sigma(self) -> &'static [f64] {
        match self {
            Self::KannalaBrandt1 => &[0.1],
            Self::KannalaBrandt2 => &[0.1, 0.05],
            _ => &[],
        }
    }

    /// The projection with these radial terms.
    pub(super) fn projection(self, k: [f64; 2]) -> Projection {
        match self {
            Self::Rectilinear => Projection::Rectilinear,
            Self::Equidistant => Projection::Equidistant,
            Self::Equisolid => Projection::Equisolid,
            Self::Stereographic => Projection::Stereographic,
            Self::Orthographic => Projection::Orthographic,
            Self::KannalaBrandt1 | Self::KannalaBrandt2 => Projection::kannala_brandt([k[0], k[1], 0.0, 0.0]),
        }
    }

    /// The lens at `x` for a picture of `size`.
    pub(super) fn lens(self, x: &Parameters, size: (f64, f64)) -> Lens {
        let f = x[0].exp();
        let center: Point2 = middle(size) + Vec2::new(x[1], x[2]);
        Lens { projection: self.projection([x[3], x[4]]), focal: Vec2::new(f, f), center, size }
    }
}
