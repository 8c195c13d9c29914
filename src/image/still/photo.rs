//! A picture read, rendered and written with the defaults: one call each.

use std::io::{BufWriter, Write};
use std::path::Path;

use super::{ExifTags, LoadOptions, Photo, SaveOptions, Saved, StillError, StillFormat, encode, load};
use crate::Frame;
use plumbline_num::files::{AtomicFile, IfExists};

impl Photo {
    /// A picture of which nothing is known but its pixels.
    ///
    /// ```
    /// use plumbline_image::still::{Photo, frame_of_rgb};
    ///
    /// let photo = Photo::new(frame_of_rgb(&[255, 0, 0], 1, 1)?);
    /// assert!(photo.exif.is_none() && photo.size() == (1, 1));
    /// # Ok::<(), plumbline_image::still::StillError>(())
    /// ```
    pub fn new(frame: Frame) -> Self {
        Self {
            frame,
            exif: None,
            tags: ExifTags::default(),
            icc: None,
            xmp: None,
            iptc: None,
            gain_map: None,
            format: None,
            warnings: Vec::new(),
        }
    }

    /// Other pixels, which were moved or resized, with what the file said of this picture. What is true of the old ones alone, such
    /// as the geometry of a panorama, is left out; the warnings are of what was lost that way. So is the gain map, which
    /// [`GainMap::rendered`](super::GainMap::rendered) carries along.
    ///
    /// ```
    /// use plumbline_image::still::{Photo, frame_of_rgb};
    ///
    /// let mut photo = Photo::new(frame_of_rgb(&[0; 12], 2, 2)?);
    /// photo.icc = Some(vec![1, 2, 3]);
    /// let cut = photo.with_frame(frame_of_rgb(&[0; 3], 1, 1)?);
    /// assert_eq!((cut.size(), cut.icc), ((1, 1), photo.icc));
    /// # Ok::<(), plumbline_image::still::StillError>(())
    /// ```
    #[must_use]
    pub fn with_frame(&self, frame: Frame) -> Self {
        let head = self.without_pixels((frame.width, frame.height));
        Self { frame, ..head }
    }

    /// [`Photo::with_frame`] for pixels of a size that are not made yet; the frame is one pixel of the same format.
    /// [`StillRendering::encode`](crate::render::StillRendering::encode) takes it.
    ///
    /// ```
    /// use plumbline_image::still::{Photo, frame_of_rgb};
    ///
    /// let mut photo = Photo::new(frame_of_rgb(&[0; 12], 2, 2)?);
    /// photo.icc = Some(vec![1, 2, 3]);
    /// let head = photo.without_pixels((400, 300));
    /// assert_eq!((head.size(), head.icc), ((1, 1), photo.icc));
    /// # Ok::<(), plumbline_image::still::StillError>(())
    /// ```
    #[must_use]
    pub fn without_pixels(&self, size: (usize, usize)) -> Self {
        let moved = self.xmp.as_ref().map(|xmp| xmp.of_moved_pixels(size));
        let (xmp, lost) = moved.unwrap_or_default();
        let warning = |what| format!("{what} does not fit the new pixels and was left out");
        Self {
            frame: Frame::new(self.frame.format, 1, 1),
            exif: self.exif.clone(),
            tags: self.tags.clone(),
            icc: self.icc.clone(),
            xmp,
            iptc: self.iptc.clone(),
            gain_map: None,
            format: self.format,
            warnings: lost.into_iter().map(warning).collect(),
        }
    }

    /// Reads a picture file: [`load`] with the default limits.
    ///
    /// # Errors
    /// Any of [`StillError`] that is about input.
    pub fn load(path: impl AsRef<Path>) -> Result<Self, StillError> {
        load(path.as_ref(), LoadOptions::default())
    }

    /// Width and height of the upright picture, px.
    pub fn size(&self) -> (u32, u32) {
        (self.frame.width as u32, self.frame.height as u32)
    }

    /// Writes the picture in the format of the name's extension: [`encode`] with the default quality. The file appears whole or
    /// not at all, in place of one that has the name.
    ///
    /// # Errors
    /// Those of [`StillError`] that are about output.
    pub fn save(&self, path: impl AsRef<Path>) -> Result<Saved, StillError> {
        let path = path.as_ref();
        let format = StillFormat::of_name(path)?;
        let mut unfinished = AtomicFile::next_to(path, IfExists::Replace).map_err(StillError::Write)?;
        let file = unfinished.file().ok_or_else(|| StillError::Write(std::io::ErrorKind::Unsupported.into()))?;
        let mut out = BufWriter::new(file);
        let saved = encode(self, format, SaveOptions::default(), &mut out)?;
        out.flush().map_err(StillError::Write)?;
        drop(out);
        unfinished.publish(path, IfExists::Replace).map_err(StillError::Write)?;
        Ok(saved)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Layout, PixelFormat};

    #[test]
    fn a_saved_picture_reads_back_and_a_name_of_no_format_leaves_nothing() {
        let folder = tempfile::tempdir().expect("a folder");
        let mut frame = Frame::new(PixelFormat::opaque(Layout::Gbr, 8), 5, 3);
        frame.plane8_mut(1).expect("8 bit").row_mut(2)[4] = 200;
        let photo = Photo::new(frame);
        let path = folder.path().join("a.png");
        for _ in 0..2 {
            photo.save(&path).expect("a folder that can be written");
        }
        let read = Photo::load(&path).expect("what was written");
        assert_eq!(read.size(), (5, 3));
        assert_eq!(read.frame.plane8(1).expect("8 bit").row(2)[4], 200);
        assert!(matches!(photo.save(folder.path().join("a.xyz")), Err(StillError::Extension(_))));
        assert_eq!(std::fs::read_dir(folder.path()).expect("a folder").count(), 1);
    }
}
