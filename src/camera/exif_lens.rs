//! The lens of a photo from its EXIF data.
//!
//! ```text
//! f_px = f_35 · d_px / 43.267 mm,     d_px = √(W² + H²)
//! ```
//!
//! The 35 mm equivalent compares diagonals (CIPA DCG-001), so that the formula needs no sensor size. Without it, the focal length over the
//! size of a pixel. A projection is not in EXIF: names of lenses that say fisheye are taken as equisolid, as most are,
//! action cameras at their widest as equidistant, everything else as rectilinear.

use super::{Lens, Projection};
use plumbline_num::math::{Point2, Vec2};

/// Diagonal of a 36 × 24 mm picture, mm.
pub(super) const DIAGONAL_35_MM: f64 = 43.266_615_305_567_87;
/// Plausible equivalent focal lengths, mm, with a margin: the widest fisheyes have 4, the longest telescopes 3000.
const PLAUSIBLE_EQUIVALENT_MM: (f64, f64) = (2.0, 5000.0);
/// Plausible focal lengths, mm, with a margin: phones have 1.5.
const PLAUSIBLE_FOCAL_MM: (f64, f64) = (0.3, 5000.0);
/// Plausible crop factors, with a margin: medium format 0.5, phones' front cameras 12, endoscopes 30.
const PLAUSIBLE_CROP: (f64, f64) = (0.2, 50.0);
/// Longest equivalent focal length, mm, at which action cameras do not rectify the picture.
const ACTION_WIDE_MM: f64 = 21.0;

/// Metadata of a picture; `None` where the file has none.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ExifFacts {
    /// Width and height of the picture, px, before any rotation for display.
    pub size: Option<(f64, f64)>,
    /// Maker of the camera.
    pub make: Option<String>,
    /// Model of the camera.
    pub model: Option<String>,
    /// Name of the lens.
    pub lens: Option<String>,
    /// Focal length, mm.
    pub focal_mm: Option<f64>,
    /// Focal length in 35 mm film, mm; 0 is "unknown" in EXIF and treated so.
    pub focal_35_mm: Option<f64>,
    /// Size of a pixel on the sensor at the size above, µm along x and y.
    pub pixel_um: Option<(f64, f64)>,
}

/// Why the data do not give a lens, and what to give instead.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{0}")]
pub struct ExifLensError(String);

/// A lens that EXIF data suggest.
#[derive(Clone, Debug, PartialEq)]
pub struct ExifLens {
    /// The lens, its axis through the middle of the picture.
    pub lens: Lens,
    /// What it was concluded from.
    pub reason: String,
}

impl ExifFacts {
    /// The lens that the data suggest.
    ///
    /// # Errors
    /// [`ExifLensError`] where data are missing or contradict themselves.
    pub fn lens(&self) -> Result<ExifLens, ExifLensError> {
        let size = self.size.filter(|s| s.0 > 0.0 && s.1 > 0.0 && s.0.is_finite() && s.1.is_finite());
        let (w, h) = size.ok_or_else(|| ExifLensError("the picture's size is not known".to_owned()))?;
        let (focal, source) = self.focal_px(w.hypot(h))?;
        let (projection, kind) = self.projection();
        let lens = Lens { projection, focal, center: Point2::new(0.5 * w, 0.5 * h), size: (w, h) };
        Ok(ExifLens { lens, reason: format!("{source}; {kind}") })
    }

    /// The factor from this camera's focal lengths to those of 35 mm film; `None` where it does not follow from the data.
    pub fn crop_factor(&self) -> Option<f64> {
        let (equivalent, real) = (self.focal_35_mm?, self.focal_mm?);
        let crop = equivalent / real;
        (equivalent > 0.0 && crop >= PLAUSIBLE_CROP.0 && crop <= PLAUSIBLE_CROP.1).then_some(crop)
    }

    fn focal_px(&self, diagonal: f64) -> Result<(Vec2, String), ExifLensError> {
        let known = |value: Option<f64>| value.filter(|v| *v != 0.0);
        let (equivalent, real) = (known(self.focal_35_mm), known(self.focal_mm));
        if let Some(f) = real {
            check_plausible("the focal length", f, "mm", PLAUSIBLE_FOCAL_MM)?;
        }
        if let Some(f) = equivalent {
            check_plausible("the focal length in 35 mm film", f, "mm", PLAUSIBLE_EQUIVALENT_MM)?;
            if let Some(real) = real {
                check_plausible("the ratio of the two focal lengths", f / real, "", PLAUSIBLE_CROP)?;
            }
            let px = f * diagonal / DIAGONAL_35_MM;
            return Ok((Vec2::new(px, px), format!("{f} mm in 35 mm film")));
        }
        let why = if real.is_some() { "a focal length, but not the size of its sensor" } else { "no focal length" };
        let (Some(f), Some((x, y))) = (real, self.pixel_um) else {
            let lack = format!("the picture's metadata do not give its field of view ({why})");
            return Err(ExifLensError(format!("{lack}: give --fov, a lens file, or mark lines")));
        };
        for side in [x, y] {
            check_plausible("the size of a pixel", side, "µm", (0.3, 100.0))?;
        }
        Ok((Vec2::new(1000.0 * f / x, 1000.0 * f / y), format!("{f} mm on pixels of {x:.2} µm")))
    }

    fn projection(&self) -> (Projection, &'static str) {
        let text = |field: &Option<String>| field.as_deref().unwrap_or("").to_lowercase();
        let (lens, make, model) = (text(&self.lens), text(&self.make), text(&self.model));
        if ["fisheye", "fish-eye", "fish eye"].iter().any(|word| lens.contains(word)) {
            return (Projection::Equisolid, "the lens's name says fisheye: equisolid assumed");
        }
        let action = make.contains("gopro") || model.contains("osmo action") || model.starts_with("hero");
        let wide = self.focal_35_mm.is_some_and(|f| f > 0.0 && f <= ACTION_WIDE_MM);
        if action && wide {
            return (Projection::Equidistant, "an action camera at its widest: equidistant fisheye assumed");
        }
        (Projection::Rectilinear, "rectilinear")
    }
}

/// Refuses implausible values, NaN included.
fn check_plausible(
    name: &'static str,
    value: f64,
    unit: &'static str,
    (low, high): (f64, f64),
) -> Result<(), ExifLensError> {
    if value >= low && value <= high {
        return Ok(());
    }
    let absurd = format!("EXIF says {name} = {value} {unit}, which no camera has ({low} to {high})");
    Err(ExifLensError(format!("{absurd}: give --fov or a lens file")))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::FieldAxis;

    fn phone() -> ExifFacts {
        ExifFacts {
            size: Some((4032.0, 3024.0)),
            focal_mm: Some(4.25),
            focal_35_mm: Some(26.0),
            ..ExifFacts::default()
        }
    }

    #[test]
    fn the_diagonal_field_of_view_is_that_of_35_mm_film() {
        let found = phone().lens().expect("a phone");
        let fov = found.lens.field_of_view(FieldAxis::Diagonal).expect("rectilinear").radians;
        assert!((fov - 2.0 * (DIAGONAL_35_MM / 52.0).atan()).abs() < 1e-12);
        assert_eq!(found.lens.projection, Projection::Rectilinear);
        assert!((phone().crop_factor().expect("both") - 26.0 / 4.25).abs() < 1e-12);
    }

    #[test]
    fn zero_means_unknown_and_the_pixel_size_helps() {
        let facts = ExifFacts { focal_35_mm: Some(0.0), pixel_um: Some((1.22, 1.22)), ..phone() };
        assert!((facts.lens().expect("pixels").lens.focal.x - 4250.0 / 1.22).abs() < 1e-9);
        let none = ExifFacts { focal_35_mm: Some(0.0), ..phone() };
        assert!(none.lens().expect_err("no sensor").to_string().contains("size of its sensor"));
        let nothing = ExifFacts { size: Some((400.0, 300.0)), ..ExifFacts::default() };
        assert!(nothing.lens().expect_err("nothing").to_string().contains("no focal length"));
        let sizeless = ExifFacts { size: None, ..phone() };
        assert_eq!(sizeless.lens().expect_err("no size").to_string(), "the picture's size is not known");
    }

    #[test]
    fn false_headers_are_refused_with_the_reason() {
        for facts in [
            ExifFacts { focal_35_mm: Some(65535.0), ..phone() },
            ExifFacts { focal_35_mm: Some(-1.0), ..phone() },
            ExifFacts { focal_35_mm: Some(f64::NAN), ..phone() },
            ExifFacts { focal_35_mm: Some(f64::INFINITY), ..phone() },
            ExifFacts { focal_mm: Some(1e9), ..phone() },
            ExifFacts { focal_mm: Some(400.0), ..phone() },
            ExifFacts { focal_35_mm: None, pixel_um: Some((0.0, 1.0)), ..phone() },
        ] {
            let error = facts.lens().expect_err("a lie");
            assert!(error.to_string().contains("which no camera has"), "{error}");
        }
        let ratio = ExifFacts { focal_mm: Some(400.0), ..phone() }.lens().expect_err("a lie").to_string();
        assert_eq!(
            ratio,
            "EXIF says the ratio of the two focal lengths = 0.065 , which no camera has (0.2 to 50): give --fov or a lens file"
        );
    }

    #[test]
    fn fisheyes_are_known_by_their_names_and_action_cameras_by_their_makers() {
        let lens = |f: ExifFacts| f.lens().expect("valid").lens.projection;
        let fisheye = ExifFacts { lens: Some("AF DX Fisheye-Nikkor 10.5mm f/2.8G ED".into()), ..phone() };
        assert_eq!(lens(fisheye), Projection::Equisolid);
        let gopro = ExifFacts { make: Some("GoPro".into()), focal_mm: Some(3.0), focal_35_mm: Some(15.0), ..phone() };
        assert_eq!(lens(gopro.clone()), Projection::Equidistant);
        assert_eq!(lens(ExifFacts { focal_35_mm: Some(24.0), ..gopro }), Projection::Rectilinear);
    }
}
