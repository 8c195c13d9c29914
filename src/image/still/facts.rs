//! What EXIF says of camera and lens. A claim, not a fact: every number is checked for sense.

use exif::{Exif, In, Reader, Tag, Value};

/// Maximum length of a text, characters: longer ones are garbage.
const MAX_CHARACTERS: usize = 120;

/// What EXIF says of camera and lens.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ExifTags {
    /// Maker of the camera.
    pub make: Option<String>,
    /// Model of the camera.
    pub model: Option<String>,
    /// Maker of the lens.
    pub lens_make: Option<String>,
    /// Model of the lens.
    pub lens_model: Option<String>,
    /// Focal length, mm.
    pub focal_mm: Option<f64>,
    /// Focal length of a full-frame camera with the same field of view, mm.
    pub focal_35mm: Option<f64>,
    /// Pixels per mm of the sensor, x and y, at the size given in EXIF.
    pub sensor_px_per_mm: Option<(f64, f64)>,
    /// Size of the picture when it was taken, px.
    pub size_px: Option<(u32, u32)>,
    /// Digital zoom; 1 = none.
    pub digital_zoom: Option<f64>,
}

impl ExifTags {
    /// What an EXIF block says, from its TIFF header on. Nothing where it cannot be read.
    pub fn of(block: &[u8]) -> Self {
        let mut reader = Reader::new();
        reader.continue_on_error(true);
        let exif = reader.read_raw(block.to_vec()).or_else(|e| e.distill_partial_result(|_| {}));
        exif.map_or_else(|_| Self::default(), |exif| Self::read(&exif))
    }

    fn read(exif: &Exif) -> Self {
        let positive = |tag, most: f64| number(exif, tag).filter(|v| *v > 0.0 && *v <= most);
        let size = uint(exif, Tag::PixelXDimension).zip(uint(exif, Tag::PixelYDimension));
        Self {
            make: text(exif, Tag::Make),
            model: text(exif, Tag::Model),
            lens_make: text(exif, Tag::LensMake),
            lens_model: text(exif, Tag::LensModel),
            focal_mm: positive(Tag::FocalLength, 10_000.0),
            focal_35mm: positive(Tag::FocalLengthIn35mmFilm, 10_000.0),
            sensor_px_per_mm: resolution(exif),
            size_px: size.filter(|(w, h)| *w > 0 && *h > 0),
            digital_zoom: positive(Tag::DigitalZoomRatio, 1000.0),
        }
    }
}

fn text(exif: &Exif, tag: Tag) -> Option<String> {
    let Value::Ascii(parts) = &exif.get_field(tag, In::PRIMARY)?.value else { return None };
    let text = String::from_utf8_lossy(parts.first()?);
    let clean: String = text.chars().filter(|c| !c.is_control() && *c != '\u{fffd}').take(MAX_CHARACTERS).collect();
    let clean = clean.trim();
    (!clean.is_empty()).then(|| clean.to_owned())
}

fn uint(exif: &Exif, tag: Tag) -> Option<u32> {
    exif.get_field(tag, In::PRIMARY)?.value.get_uint(0)
}

fn number(exif: &Exif, tag: Tag) -> Option<f64> {
    let value = match &exif.get_field(tag, In::PRIMARY)?.value {
        Value::Rational(v) => v.first()?.to_f64(),
        Value::SRational(v) => v.first()?.to_f64(),
        Value::Float(v) => f64::from(*v.first()?),
        Value::Double(v) => *v.first()?,
        other => f64::from(other.get_uint(0)?),
    };
    value.is_finite().then_some(value)
}

/// Pixels per mm from the resolution of the focal plane.
fn resolution(exif: &Exif) -> Option<(f64, f64)> {
    let unit_mm = match uint(exif, Tag::FocalPlaneResolutionUnit).unwrap_or(2) {
        2 => 25.4,
        3 => 10.0,
        4 => 1.0,
        5 => 1e-3,
        _ => return None,
    };
    let along = |tag| number(exif, tag).map(|v| v / unit_mm).filter(|v| (1.0..1e5).contains(v));
    along(Tag::FocalPlaneXResolution).zip(along(Tag::FocalPlaneYResolution))
}

#[cfg(test)]
mod tests {
    use super::super::exif::{Order, tests::sample};
    use super::*;

    #[test]
    fn focal_length_make_and_size_are_read_in_either_byte_order() {
        for order in [Order::Little, Order::Big] {
            let tags = ExifTags::of(&sample(order));
            assert_eq!((tags.make.as_deref(), tags.focal_mm), (Some("Cam"), Some(2.8)));
            assert_eq!(tags.size_px, Some((400, 300)));
            assert_eq!(tags.focal_35mm, None);
        }
    }

    #[test]
    fn false_and_invalid_headers_give_nothing_and_never_fail() {
        assert_eq!(ExifTags::of(b"rubbish"), ExifTags::default());
        let mut zero = sample(Order::Little);
        zero[108..112].fill(0);
        assert_eq!(ExifTags::of(&zero).focal_mm, None, "a division by zero is no focal length");
        let mut rng = fastrand::Rng::with_seed(9);
        for _ in 0..5000 {
            let mut wild = sample(Order::Big);
            for _ in 0..rng.usize(1..8) {
                let at = rng.usize(..wild.len());
                wild[at] = rng.u8(..);
            }
            let tags = ExifTags::of(&wild);
            assert!(tags.focal_mm.is_none_or(|f| f > 0.0 && f.is_finite()));
        }
    }
}
