//! The projections by name.

use super::division::{Division, FovModel};
use super::panoramic::Panoramic;
use super::radial::Radial;
use super::{AnglePolynomial, BrownConrady, KannalaBrandt, Ocam, PlaneModel, RadialPolynomial, Unified};

/// How directions lie in the plane of unit focal length.
#[derive(Clone, Debug, PartialEq)]
pub enum Projection {
    /// `r = tan θ`.
    Rectilinear,
    /// `r = θ`.
    Equidistant,
    /// `r = 2 sin(θ/2)`.
    Equisolid,
    /// `r = 2 tan(θ/2)`.
    Stereographic,
    /// `r = sin θ`.
    Orthographic,
    /// Odd polynomial of the angle.
    KannalaBrandt(KannalaBrandt),
    /// Polynomial of the angle with all powers.
    AnglePolynomial(AnglePolynomial),
    /// One division parameter `λ`, dimensionless (in focal lengths).
    Division(f64),
    /// The field-of-view (FOV) model of Devernay and Faugeras: `tan(t r) = t tan θ`, `t = 2 tan(ω/2)`, slope 1 on the axis.
    FieldOfView(f64),
    /// Sphere models.
    Unified(Unified),
    /// Polynomial along the ray.
    Ocam(Ocam),
    /// Radial, decentering and prism distortion of a plane.
    BrownConrady(BrownConrady),
    /// A classical projection with a polynomial of its radius.
    RadialPolynomial(RadialPolynomial),
    /// Longitude and latitude.
    Equirectangular,
    /// Longitude and height on a cylinder.
    Cylindrical,
    /// Longitude and conformal latitude.
    Mercator,
    /// A cylinder seen from the distance `d ≥ 0` behind its axis: 0 is rectilinear, 1 the classical one.
    Panini(f64),
}

impl Projection {
    /// Kannala and Brandt's with coefficients `k₁ … k₄`.
    pub fn kannala_brandt(k: [f64; 4]) -> Self {
        Self::KannalaBrandt(KannalaBrandt::new(k))
    }

    /// The name in lens files and messages.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Rectilinear => "rectilinear",
            Self::Equidistant => "equidistant",
            Self::Equisolid => "equisolid",
            Self::Stereographic => "stereographic",
            Self::Orthographic => "orthographic",
            Self::KannalaBrandt(_) => "kannala-brandt",
            Self::AnglePolynomial(_) => "angle-polynomial",
            Self::Division(_) => "division",
            Self::FieldOfView(_) => "field-of-view",
            Self::Unified(_) => "unified",
            Self::Ocam(_) => "ocam",
            Self::BrownConrady(_) => "brown-conrady",
            Self::RadialPolynomial(_) => "radial-polynomial",
            Self::Equirectangular => "equirectangular",
            Self::Cylindrical => "cylindrical",
            Self::Mercator => "mercator",
            Self::Panini(_) => "panini",
        }
    }

    /// The projection without parameters that has this [`Self::name`].
    pub fn named(name: &str) -> Option<Self> {
        let plain = [
            Self::Rectilinear,
            Self::Equidistant,
            Self::Equisolid,
            Self::Stereographic,
            Self::Orthographic,
            Self::Equirectangular,
            Self::Cylindrical,
            Self::Mercator,
        ];
        plain.into_iter().find(|projection| projection.name() == name)
    }

    /// Whether longitude and latitude are drawn, rather than the angle off an axis.
    pub fn is_panoramic(&self) -> bool {
        self.panoramic().is_some()
    }

    /// One of the five without parameters.
    pub(super) fn classical(&self) -> Option<Radial> {
        match self {
            Self::Rectilinear => Some(Radial::Rectilinear),
            Self::Equidistant => Some(Radial::Equidistant),
            Self::Equisolid => Some(Radial::Equisolid),
            Self::Stereographic => Some(Radial::Stereographic),
            Self::Orthographic => Some(Radial::Orthographic),
            _ => None,
        }
    }

    pub(super) fn panoramic(&self) -> Option<Panoramic> {
        match self {
            Self::Equirectangular => Some(Panoramic::Equirectangular),
            Self::Cylindrical => Some(Panoramic::Cylindrical),
            Self::Mercator => Some(Panoramic::Mercator),
            Self::Panini(d) => Some(Panoramic::Panini(*d)),
            _ => None,
        }
    }

    /// Calls `with` on the formulas.
    #[inline]
    pub(super) fn with<T>(&self, with: impl FnOnce(&dyn PlaneModel) -> T) -> T {
        match self {
            Self::Rectilinear => with(&Radial::Rectilinear),
            Self::Equidistant => with(&Radial::Equidistant),
            Self::Equisolid => with(&Radial::Equisolid),
            Self::Stereographic => with(&Radial::Stereographic),
            Self::Orthographic => with(&Radial::Orthographic),
            Self::KannalaBrandt(model) => with(model),
            Self::AnglePolynomial(model) => with(model),
            Self::Division(lambda) => with(&Division(*lambda)),
            Self::FieldOfView(t) => with(&FovModel(*t)),
            Self::Unified(model) => with(model),
            Self::Ocam(model) => with(model),
            Self::BrownConrady(model) => with(model),
            Self::RadialPolynomial(model) => with(model),
            Self::Equirectangular => with(&Panoramic::Equirectangular),
            Self::Cylindrical => with(&Panoramic::Cylindrical),
            Self::Mercator => with(&Panoramic::Mercator),
            Self::Panini(d) => with(&Panoramic::Panini(*d)),
        }
    }
}

impl From<Radial> for Projection {
    fn from(radial: Radial) -> Self {
        match radial {
            Radial::Rectilinear => Self::Rectilinear,
            Radial::Equidistant => Self::Equidistant,
            Radial::Equisolid => Self::Equisolid,
            Radial::Stereographic => Self::Stereographic,
            Radial::Orthographic => Self::Orthographic,
        }
    }
}
