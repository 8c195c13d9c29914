//! Still pictures as files: JPEG, PNG, TIFF and WebP, read into a planar [`Frame`] and written from one.
//!
//! Samples keep their depth (8 or 16 bit) and alpha; ICC profile, EXIF, XMP and IPTC travel along as bytes. A picture is upright once
//! it is read: the orientation that EXIF asks for is applied to the pixels and the tag set to 1, so that neither a viewer nor
//! a second program turns it again. What EXIF says of the picture's size is corrected when it is written, its thumbnail
//! unlinked, and nothing else touched (`exif.rs`); XMP is corrected likewise (`xmp/`).
//!
//! Sizes are checked before memory is taken for pixels, whatever the file claims.
//!
//! | format | read | written |
//! | --- | --- | --- |
//! | JPEG | 8 bit, gray, color, and CMYK by its profile (`jpeg/inks.rs`), baseline and progressive | baseline, in bands on all threads (`jpeg/`); 8 bit |
//! | PNG | all but animated | 8 and 16 bit, alpha |
//! | TIFF | 8 and 16 bit, gray and RGB; floating point as 16 bit (`floats.rs`) | uncompressed, 8 and 16 bit, alpha (`tiff.rs`) |
//! | WebP | lossy and lossless, not animated | lossless; 8 bit |
//!
//! Other formats are recognized by their first bytes and refused with a remedy; HEIF pictures (HEIC, AVIF) are left to
//! the layer that knows a decoder for them ([`StillError::Heif`]).

mod bands;
mod container;
mod error;
mod exif;
mod facts;
mod floats;
mod gain_map;
mod iptc;
mod jpeg;
mod load;
mod orientation;
mod packed;
mod photo;
mod png;
mod reduce;
mod save;
mod sniff;
#[cfg(test)]
mod tests;
mod tiff;
mod xmp;

pub(crate) use bands::RowSource;
pub use bands::{rgb_of_frame, rgb_of_rows};
pub use error::StillError;
pub use exif::exif_of_container;
pub use facts::ExifTags;
pub use gain_map::GainMap;
pub use load::{LoadOptions, decode, load, size};
pub use orientation::ExifOrientation;
pub use packed::{frame_of_rgb, oriented};
pub use reduce::flattened;
pub(crate) use save::encode_rows;
pub use save::{SaveOptions, Saved, encode};
pub use sniff::{RAW_EXTENSIONS, StillFormat};
pub use xmp::Xmp;

use super::Frame;

/// A picture and its file's metadata.
#[derive(Debug)]
pub struct Photo {
    /// The pixels, upright: gray or GBR, 8 or 16 bit, with or without alpha.
    pub frame: Frame,
    /// EXIF, from its TIFF header on; the orientation in it is 1.
    pub exif: Option<Vec<u8>>,
    /// What EXIF said of camera and lens, before anything was put right in it.
    pub tags: ExifTags,
    /// ICC profile of the samples.
    pub icc: Option<Vec<u8>>,
    /// XMP; what it says of orientation and size is true of the frame.
    pub xmp: Option<Xmp>,
    /// IPTC, as bytes of the Information Interchange Model.
    pub iptc: Option<Vec<u8>>,
    /// Gain map of an Ultra HDR picture.
    pub gain_map: Option<GainMap>,
    /// The file's format; `None` where another layer decoded it.
    pub format: Option<StillFormat>,
    /// What the user should know of how it was read.
    pub warnings: Vec<String>,
}
