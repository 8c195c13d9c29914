//! The candidate lens models.

use nalgebra::SVector;

use super::middle;
use plumbline_camera::{BrownConrady, DistortedPlane, DistortionTerms, FieldAxis, FieldOfView, Lens, Projection};
use plumbline_num::math::{Point2, Vec2};

/// Maximum number of parameters of a model: focal length, center, two radial terms.
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
    /// `u = m / (1 + λ m²)` for a rectilinear `u`. Lines alone determine only `λ/f²`.
    Division,
    /// `m = u (1 + k₁ u²)` for a rectilinear `u`. Lines alone determine little more than `k₁/f²`.
    BrownConrady1,
    /// `m = u (1 + k₁ u² + k₂ u⁴)` for a rectilinear `u`.
    BrownConrady2,
}

impl LensModel {
    /// All models, the ones with fewest terms first.
    pub fn all() -> Vec<Self> {
        use LensModel::{
            BrownConrady1, BrownConrady2, Division, Equidistant, Equisolid, KannalaBrandt1, KannalaBrandt2,
            Orthographic, Rectilinear, Stereographic,
        };
        let plain = [Rectilinear, Equidistant, Equisolid, Stereographic, Orthographic];
        let one_term = [BrownConrady1, Division, KannalaBrandt1];
        plain.into_iter().chain(one_term).chain([BrownConrady2, KannalaBrandt2]).collect()
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
            Self::Division => "division",
            Self::BrownConrady1 => "brown-conrady, one term",
            Self::BrownConrady2 => "brown-conrady, two terms",
        }
    }

    /// Free parameters.
    pub(super) fn parameters(self) -> usize {
        3 + self.term_sigma().len()
    }

    /// Standard deviation that radial terms have a priori, one per term: makers' lenses keep to their base projection within
    /// a tenth at one radian, or within a tenth of the tangent at 45°. Much larger ones leave the focal length open, much
    /// smaller ones the lines bent.
    pub(super) fn term_sigma(self) -> &'static [f64] {
        match self {
            Self::KannalaBrandt1 | Self::Division | Self::BrownConrady1 => &[0.1],
            Self::KannalaBrandt2 | Self::BrownConrady2 => &[0.1, 0.05],
            _ => &[],
        }
    }

    /// The field of view that lenses of this model usually have, and the relative standard deviation of their focal
    /// lengths: ordinary lenses from 40° to 110° along the diagonal, fisheyes from 130° to more than 200°. Without this
    /// prior, slightly bent lines would be explained by a narrow crop of a fisheye.
    pub fn usual_field(self) -> (FieldOfView, f64) {
        let (degrees, sigma) = match self {
            Self::Rectilinear | Self::Division | Self::BrownConrady1 | Self::BrownConrady2 => (70.0, 0.5),
            _ => (170.0, 0.35),
        };
        (FieldOfView::degrees(degrees, FieldAxis::Diagonal), sigma)
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
            Self::Division => Projection::Division(k[0]),
            Self::BrownConrady1 | Self::BrownConrady2 => {
                let radial = [k[0], k[1], 0.0, 0.0];
                let terms = DistortionTerms { radial, ..DistortionTerms::default() };
                // Terms without a field give a lens that sees nothing, which no fit accepts.
                BrownConrady::new(DistortedPlane::Tangent, terms)
                    .map_or(Projection::Division(f64::NAN), Projection::BrownConrady)
            }
        }
    }

    /// The lens at `x` for a picture of `size`.
    pub(super) fn lens(self, x: &Parameters, size: (f64, f64)) -> Lens {
        let f = x[0].exp();
        let center: Point2 = middle(size) + Vec2::new(x[1], x[2]);
        Lens { projection: self.projection([x[3], x[4]]), focal: Vec2::new(f, f), center, size }
    }
}
