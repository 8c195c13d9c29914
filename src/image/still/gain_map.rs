//! Gain maps: how much brighter than the picture a display with more range shows each part of it.
//!
//! The map is a smaller picture of its own. It is decoded, so that it can be carried through the same map as the picture, and
//! written behind it again; how it is applied is kept as it was read.

use std::io::Cursor;

use image::ImageDecoder;
use image::codecs::jpeg::JpegDecoder;

use super::bands::Bands;
use super::container::pixel_format;
use super::jpeg::{self, EncodedMap, Written};
use super::packed::{planes_of, unpack};
use super::{ExifOrientation, StillError, Xmp};
use crate::Frame;

/// The gain map of an Ultra HDR picture.
///
/// ```
/// use plumbline_image::still::{GainMap, frame_of_rgb};
///
/// let map = GainMap { frame: frame_of_rgb(&[0; 12], 2, 2)?, xmp: None, iso: None };
/// assert_eq!(map.frame.width, 2);
/// # Ok::<(), plumbline_image::still::StillError>(())
/// ```
#[derive(Debug)]
pub struct GainMap {
    /// The map, 8 bit, upright like its picture, of any size with the same shape.
    pub frame: Frame,
    /// How it is applied, as XMP of the namespace `hdrgm`.
    pub xmp: Option<Vec<u8>>,
    /// The same in the binary form of ISO 21496-1.
    pub iso: Option<Vec<u8>>,
}

impl GainMap {
    /// The same map with other pixels.
    ///
    /// ```
    /// # use plumbline_image::still::{GainMap, frame_of_rgb};
    /// let map = GainMap { frame: frame_of_rgb(&[0; 12], 2, 2)?, xmp: None, iso: Some(vec![1]) };
    /// let cut = map.with_frame(frame_of_rgb(&[0; 3], 1, 1)?);
    /// assert_eq!((cut.frame.width, cut.iso), (1, map.iso));
    /// # Ok::<(), plumbline_image::still::StillError>(())
    /// ```
    #[must_use]
    pub fn with_frame(&self, frame: Frame) -> Self {
        Self { frame, xmp: self.xmp.clone(), iso: self.iso.clone() }
    }

    /// Decodes a map, in the orientation of its picture, of at most so many pixels.
    pub(super) fn decoded(map: EncodedMap, orientation: ExifOrientation, most: usize) -> Result<Self, StillError> {
        let EncodedMap { file, xmp, iso } = map;
        let size = jpeg::check(&file)?.size;
        if size.0 * size.1 > most {
            return Err(StillError::Damaged("a gain map larger than its picture".to_owned()));
        }
        let decoder = JpegDecoder::new(Cursor::new(file)).map_err(StillError::of_decoder)?;
        let format = pixel_format(&decoder)?;
        let mut packed = vec![0_u8; size.0 * size.1 * planes_of(format).len()];
        decoder.read_image(&mut packed).map_err(StillError::of_decoder)?;
        let frame = unpack(&packed, size, format, orientation).ok_or(StillError::Layout)?;
        Ok(Self { frame, xmp, iso })
    }

    /// The map as a JPEG file.
    pub(super) fn encoded(&self, quality: u8) -> Result<Vec<u8>, StillError> {
        let mut file = Vec::new();
        let written = Written { xmp: self.xmp.as_deref(), iso: self.iso.as_deref(), ..Written::default() };
        jpeg::encode(&Bands::of(&self.frame), quality, &written, &mut file)?;
        Ok(file)
    }

    /// XMP of the picture, which says that a map of so many bytes follows it; `None` where there is no room for that.
    pub(super) fn announced(xmp: Option<&Xmp>, bytes: usize) -> Option<Vec<u8>> {
        let item = |semantic: &str, length: &str| {
            format!(
                "<rdf:li rdf:parseType=\"Resource\"><Container:Item Item:Semantic=\"{semantic}\" \
                 Item:Mime=\"image/jpeg\"{length}/></rdf:li>"
            )
        };
        let items = item("Primary", "") + &item("GainMap", &format!(" Item:Length=\"{bytes}\""));
        let description = format!(
            "<rdf:Description rdf:about=\"\" xmlns:rdf=\"http://www.w3.org/1999/02/22-rdf-syntax-ns#\" \
             xmlns:hdrgm=\"http://ns.adobe.com/hdr-gain-map/1.0/\" \
             xmlns:Container=\"http://ns.google.com/photos/1.0/container/\" \
             xmlns:Item=\"http://ns.google.com/photos/1.0/container/item/\" hdrgm:Version=\"1.0\">\
             <Container:Directory><rdf:Seq>{items}</rdf:Seq></Container:Directory></rdf:Description>"
        );
        let packet = match xmp {
            Some(xmp) => xmp.with_description(&description)?,
            None => Xmp::of_description(&description),
        };
        Some(packet).filter(|p| p.len() <= jpeg::MAX_XMP)
    }
}
