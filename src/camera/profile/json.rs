//! Our own lens files, and the plain form that calibration scripts write.

use nalgebra::Matrix2;
use serde::{Deserialize, Serialize};

use super::tree::At;
use super::{Pinhole, Profile, ProfileError};
use crate::{
    AnglePolynomial, BrownConrady, DistortedPlane, DistortionTerms, Lens, Ocam, Projection, RadialPolynomial, Unified,
};
use plumbline_num::math::{Point2, Vec2};

const FORMAT: &str = "lens JSON";
const KNOWN: &str = "rectilinear, equidistant, equisolid, stereographic, orthographic, kannala-brandt (kb), angle-polynomial, \
                     division, field-of-view, unified, ocam, brown-conrady, radial-polynomial, equirectangular, cylindrical, \
                     mercator, panini";

/// A lens file, version 1.
///
/// `model` names the projection; the other keys are its parameters, in the letters of the formulas:
///
/// | model | parameters |
/// | --- | --- |
/// | `rectilinear` `equidistant` `equisolid` `stereographic` `orthographic` `equirectangular` `cylindrical` `mercator` | none |
/// | `kannala-brandt` | `k`: r = θ (1 + k₁ θ² + k₂ θ⁴ + k₃ θ⁶ + k₄ θ⁸) |
/// | `angle-polynomial` | `k`: r = θ (1 + k₁ θ + k₂ θ² + k₃ θ³) |
/// | `division` | `lambda`: ray ∝ (x, y, 1 + λ r²) |
/// | `field-of-view` (`arc-tangent`) | `t`: tan(t r) = t tan θ |
/// | `unified` | `alpha`, `beta` (1), `xi` (0); focal lengths with slope 1 on the axis |
/// | `ocam` | `k`: ray ∝ (x, y, 1 + k₁ r + k₂ r² + …), `affine`: four numbers by rows |
/// | `brown-conrady` | `k`: 1 + k₁ s + … above, `q`: 1 + q₁ s + … below the line, `p`: p₁ p₂, `s`: s₁ … s₄, `plane`, `xi` |
/// | `radial-polynomial` | `base`, `unit`, `c`: r = u ρ (c₀ + c₁ ρ + …), ρ = r_base/u |
/// | `panini` | `d` |
///
/// A file without `version` is read as the plain form that scripts around OpenCV write: `model`, `fx fy cx cy`, `k`, `width`,
/// `height`, further keys ignored, and **pixel centers at integers** unless `pixel_center` says otherwise. With `version`,
/// unknown keys are refused and the centers are at integer + 0.5 unless `pixel_center` says otherwise.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct LensFile {
    /// Always `plumbline.lens`.
    #[serde(default = "format")]
    pub format: String,
    /// Version of this format: 1.
    pub version: u32,
    /// Name of the lens or the camera.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub name: String,
    /// Coordinate of the center of the first pixel: 0.5 (the picture is [0, W] × [0, H]) or 0 (as in OpenCV).
    #[serde(default = "half", alias = "pixel_centre")]
    pub pixel_center: f64,
    /// Width of the picture, px.
    pub width: f64,
    /// Height of the picture, px.
    pub height: f64,
    /// Focal length along x, px.
    pub fx: f64,
    /// Focal length along y, px; that along x unless given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fy: Option<f64>,
    /// x of the pixel on the axis; the middle of the picture unless given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cx: Option<f64>,
    /// y of the pixel on the axis.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cy: Option<f64>,
    /// Error of the calibration, px.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rms_px: Option<f64>,
    /// Name of the projection.
    pub model: String,
    /// Coefficients of the angle, of the ray or of the radius.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub k: Vec<f64>,
    /// Radial coefficients below the line, at most three.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub q: Vec<f64>,
    /// Decentering, `p₁ p₂`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub p: Vec<f64>,
    /// Thin prism, `s₁ … s₄`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub s: Vec<f64>,
    /// `c₀ … c₄`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub c: Vec<f64>,
    /// The plane of the sensor from that of the lens, four numbers by rows; the identity unless given.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub affine: Vec<f64>,
    /// `λ`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lambda: Option<f64>,
    /// `t`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub t: Option<f64>,
    /// `α`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub alpha: Option<f64>,
    /// `β`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub beta: Option<f64>,
    /// `ξ`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub xi: Option<f64>,
    /// `d`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub d: Option<f64>,
    /// Unit of the radius, focal lengths.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unit: Option<f64>,
    /// The projection that a polynomial bends: one of the first five.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub base: Option<String>,
    /// The plane that is distorted: `tangent` (unless given), `angle`, or `sphere` with `xi`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub plane: Option<String>,
}

fn format() -> String {
    "plumbline.lens".to_owned()
}

fn half() -> f64 {
    0.5
}

/// JSON Schema of a lens file.
#[cfg(feature = "schema")]
pub fn lens_file_schema() -> serde_json::Value {
    schemars::schema_for!(LensFile).to_value()
}

/// A lens with a `version`, or the plain form.
pub(super) fn lens(root: &At<'_>, text: &str) -> Result<Profile, ProfileError> {
    if root.get("version").is_none() {
        return plain(root);
    }
    // From the text, for the line and the column of what is wrong.
    let file: LensFile = serde_json::from_str(text).map_err(|e| ProfileError::syntax(FORMAT, e))?;
    if file.format != format() {
        return Err(ProfileError::value("format", &file.format, "plumbline.lens"));
    }
    if file.version != 1 {
        return Err(ProfileError::value("version", file.version, "1: a newer file needs a newer program"));
    }
    file.profile()
}

impl LensFile {
    /// The file that describes a lens.
    pub fn of(lens: &Lens, name: &str) -> Self {
        let file = Self {
            format: format(),
            version: 1,
            name: name.to_owned(),
            pixel_center: 0.5,
            width: lens.size.0,
            height: lens.size.1,
            fx: lens.focal.x,
            fy: Some(lens.focal.y),
            cx: Some(lens.center.x),
            cy: Some(lens.center.y),
            model: lens.projection.name().to_owned(),
            ..Self::default()
        };
        file.with_parameters(&lens.projection)
    }

    fn with_parameters(mut self, projection: &Projection) -> Self {
        match projection {
            Projection::KannalaBrandt(model) => self.k = model.coefficients().to_vec(),
            Projection::AnglePolynomial(model) => self.k = model.coefficients().to_vec(),
            Projection::Division(lambda) => self.lambda = Some(*lambda),
            Projection::FieldOfView(t) => self.t = Some(*t),
            Projection::Unified(model) => {
                let (xi, alpha, beta) = model.parameters();
                (self.xi, self.alpha, self.beta) = (Some(xi), Some(alpha), Some(beta));
            }
            Projection::Ocam(model) => {
                self.k = model.coefficients().to_vec();
                self.affine = model.affine().transpose().as_slice().to_vec();
            }
            Projection::BrownConrady(model) => {
                let (plane, terms) = model.parameters();
                (self.k, self.q) = (terms.radial.to_vec(), terms.rational.to_vec());
                (self.p, self.s) = (terms.tangential.to_vec(), terms.thin_prism.to_vec());
                let (name, xi) = match plane {
                    DistortedPlane::Tangent => ("tangent", None),
                    DistortedPlane::Angle => ("angle", None),
                    DistortedPlane::Sphere(xi) => ("sphere", Some(xi)),
                };
                (self.plane, self.xi) = (Some(name.to_owned()), xi);
            }
            Projection::RadialPolynomial(model) => {
                let (base, unit, c) = model.parameters();
                (self.base, self.unit, self.c) = (Some(base.name().to_owned()), Some(unit), c.to_vec());
            }
            Projection::Panini(d) => self.d = Some(*d),
            _ => {}
        }
        self
    }

    /// The lens that the file describes.
    ///
    /// # Errors
    /// [`ProfileError`] with the key.
    pub fn profile(&self) -> Result<Profile, ProfileError> {
        let projection = self.projection()?;
        if !(self.pixel_center == 0.0 || self.pixel_center == 0.5) {
            return Err(ProfileError::value("pixel_center", self.pixel_center, "0 or 0.5"));
        }
        let shift = 0.5 - self.pixel_center;
        let pinhole = Pinhole {
            focal: Vec2::new(self.fx, self.fy.unwrap_or(self.fx)),
            center: Point2::new(
                self.cx.unwrap_or(0.5 * self.width - shift),
                self.cy.unwrap_or(0.5 * self.height - shift),
            ),
            size: (self.width, self.height),
        };
        Ok(Profile {
            name: self.name.clone(),
            format: FORMAT,
            lens: pinhole.lens(projection, shift)?,
            rms_px: self.rms_px,
            notes: Vec::new(),
        })
    }

    fn projection(&self) -> Result<Projection, ProfileError> {
        let need = |key: &str, value: Option<f64>| {
            value.ok_or_else(|| ProfileError::Missing { key: key.to_owned(), expected: "a number" })
        };
        let (projection, allowed): (_, &[&str]) = match self.model.as_str() {
            "kannala-brandt" | "kb" => (Projection::kannala_brandt(list("k", &self.k)?), &["k"]),
            "angle-polynomial" => (Projection::AnglePolynomial(AnglePolynomial::new(list("k", &self.k)?)), &["k"]),
            "division" => (Projection::Division(need("lambda", self.lambda)?), &["lambda"]),
            "field-of-view" | "arc-tangent" => (Projection::FieldOfView(need("t", self.t)?), &["t"]),
            "unified" => (self.unified(need("alpha", self.alpha)?)?, &["alpha", "beta", "xi"]),
            "ocam" => (self.ocam()?, &["k", "affine"]),
            "brown-conrady" => (self.brown_conrady()?, &["k", "q", "p", "s", "plane", "xi"]),
            "radial-polynomial" => (self.radial_polynomial()?, &["base", "unit", "c"]),
            "panini" => (Projection::Panini(need("d", self.d)?), &["d"]),
            name => (without_parameters(name)?, &[]),
        };
        match self.given().into_iter().find(|key| !allowed.contains(key)) {
            Some(key) => {
                let expected = format!("only parameters of {}: {}", self.model, allowed.join(", "));
                Err(ProfileError::value(key, "a parameter", expected))
            }
            None => Ok(projection),
        }
    }

    /// Keys of the parameters that are there.
    fn given(&self) -> Vec<&'static str> {
        let lists =
            [("k", &self.k), ("q", &self.q), ("p", &self.p), ("s", &self.s), ("c", &self.c), ("affine", &self.affine)];
        let numbers = [
            ("lambda", self.lambda),
            ("t", self.t),
            ("alpha", self.alpha),
            ("beta", self.beta),
            ("xi", self.xi),
            ("d", self.d),
            ("unit", self.unit),
        ];
        let names = [("base", &self.base), ("plane", &self.plane)];
        let lists = lists.iter().filter(|(_, v)| !v.is_empty()).map(|(key, _)| *key);
        let numbers = numbers.iter().filter(|(_, v)| v.is_some()).map(|(key, _)| *key);
        lists.chain(numbers).chain(names.iter().filter(|(_, v)| v.is_some()).map(|(key, _)| *key)).collect()
    }

    fn unified(&self, alpha: f64) -> Result<Projection, ProfileError> {
        let (xi, beta) = (self.xi.unwrap_or(0.0), self.beta.unwrap_or(1.0));
        if xi != 0.0 && beta != 1.0 {
            return Err(ProfileError::value("beta", beta, "1 beside a xi that is not 0"));
        }
        let model = if xi == 0.0 { Unified::extended(alpha, beta)? } else { Unified::double_sphere(xi, alpha)? };
        Ok(Projection::Unified(model))
    }

    fn ocam(&self) -> Result<Projection, ProfileError> {
        let affine = if self.affine.is_empty() {
            Matrix2::identity()
        } else if let [a, b, c, d] = self.affine[..] {
            Matrix2::new(a, b, c, d)
        } else {
            return Err(ProfileError::value("affine", format!("{} numbers", self.affine.len()), "4 numbers"));
        };
        if self.k.len() > 24 {
            return Err(ProfileError::value("k", format!("{} numbers", self.k.len()), "at most 24"));
        }
        Ok(Projection::Ocam(Ocam::new(&self.k, affine)?))
    }

    fn brown_conrady(&self) -> Result<Projection, ProfileError> {
        let plane = match (self.plane.as_deref().unwrap_or("tangent"), self.xi) {
            ("tangent", None) => DistortedPlane::Tangent,
            ("angle", None) => DistortedPlane::Angle,
            ("sphere", Some(xi)) => DistortedPlane::Sphere(xi),
            (plane, _) => {
                return Err(ProfileError::value("plane", plane, "tangent, angle, or sphere together with xi"));
            }
        };
        let terms = DistortionTerms {
            radial: list("k", &self.k)?,
            rational: list("q", &self.q)?,
            tangential: list("p", &self.p)?,
            thin_prism: list("s", &self.s)?,
        };
        Ok(Projection::BrownConrady(BrownConrady::new(plane, terms)?))
    }

    fn radial_polynomial(&self) -> Result<Projection, ProfileError> {
        let base = without_parameters(self.base.as_deref().unwrap_or("rectilinear"))?;
        let missing = || ProfileError::Missing { key: "unit".to_owned(), expected: "a number" };
        let model = RadialPolynomial::new(&base, self.unit.ok_or_else(missing)?, list("c", &self.c)?)?;
        Ok(Projection::RadialPolynomial(model))
    }
}

/// At most `N` finite numbers, the missing ones 0.
fn list<const N: usize>(key: &str, numbers: &[f64]) -> Result<[f64; N], ProfileError> {
    if numbers.len() > N {
        return Err(ProfileError::value(key, format!("{} numbers", numbers.len()), format!("at most {N}")));
    }
    let mut all = [0.0; N];
    all[..numbers.len()].copy_from_slice(numbers);
    Ok(all)
}

fn without_parameters(name: &str) -> Result<Projection, ProfileError> {
    let name = if name == "pinhole" { "rectilinear" } else { name };
    let unknown = || ProfileError::Model { format: FORMAT, model: name.to_owned(), known: KNOWN };
    Projection::named(name).ok_or_else(unknown)
}

/// The form without a version.
fn plain(root: &At<'_>) -> Result<Profile, ProfileError> {
    let numbers = |key: &str| root.get(key).map_or(Ok(Vec::new()), |at| at.numbers());
    let number = |key: &str| root.get(key).map(|at| at.number()).transpose();
    let name = root.need("model", "the name of the camera model")?.text().unwrap_or("").to_owned();
    let mut file = LensFile {
        name: root.get("name").and_then(|n| n.text()).unwrap_or("").to_owned(),
        pixel_center: number("pixel_center")?.or(number("pixel_centre")?).unwrap_or(0.0),
        width: root.need_number("width")?,
        height: root.need_number("height")?,
        fx: root.need_number("fx")?,
        fy: number("fy")?,
        cx: number("cx")?,
        cy: number("cy")?,
        rms_px: number("rms_px")?,
        ..LensFile::default()
    };
    let k = numbers("k")?;
    match name.to_lowercase().replace('_', "-").as_str() {
        "kb" | "kannala-brandt" | "fisheye" | "opencv-fisheye" | "kb4" => (file.model, file.k) = ("kb".to_owned(), k),
        "radtan" | "opencv" | "opencv-standard" | "brown" => {
            // In the order of OpenCV: k1 k2 p1 p2 k3.
            let [k1, k2, p1, p2, k3] = list("k", &k)?;
            "brown-conrady".clone_into(&mut file.model);
            (file.k, file.p) = (vec![k1, k2, k3], vec![p1, p2]);
        }
        own => {
            own.clone_into(&mut file.model);
            (file.k, file.lambda, file.alpha) = (k, number("lambda")?, number("alpha")?);
            (file.beta, file.xi, file.d) = (number("beta")?, number("xi")?, number("d")?);
        }
    }
    file.profile()
}
