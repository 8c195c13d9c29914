//! Parts of the picture that tracking must not look at: a person, a logo, the hood of a car.
//!
//! A mask is drawn at any size and covers the whole picture. It is grown by the reach of the tracking window, so that no
//! window touches a masked pixel:
//!
//! ```text
//! M'(x) = max { M(x + d) : |d|_∞ ≤ r }.
//! ```

use std::io::{BufRead, BufReader, Cursor, Seek};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use image::{ImageReader, Limits};
use kornia_image::{Image, ImageError, ImageSize};
use kornia_imgproc::morphology::{Kernel, KernelShape, dilate};
use kornia_imgproc::padding::PaddingMode;

use super::FeatureError;
use crate::{Plane, PlaneRef};
use plumbline_num::files::open_regular;

/// A mask of the analysis picture: nonzero where no point may lie.
#[derive(Clone, Debug, PartialEq)]
pub struct Mask {
    plane: Plane<u8>,
}

/// Largest fraction of the picture that a mask may cover, %: beyond it the few remaining points do not determine the
/// camera's motion.
const MAX_COVERED_PERCENT: f64 = 98.0;

/// What to give as a mask.
const REMEDY: &str = "give a PNG or JPEG that is white where tracking must not look";

/// Most memory of a decoded mask, bytes: 8K in color. It guards against small files that announce a huge picture.
const MAX_DECODED: u64 = 150 << 20;

impl Mask {
    /// A mask from a plane of any size that covers the picture: samples of 128 and above are masked.
    ///
    /// # Errors
    /// [`FeatureError::Input`] where hardly anything is left, and for an empty picture.
    pub fn from_plane(
        drawn: PlaneRef<'_, u8>,
        width: usize,
        height: usize,
        radius_px: usize,
    ) -> Result<Self, FeatureError> {
        let covers = |x: usize, y: usize| {
            let (x, y) = (x * drawn.width() / width.max(1), y * drawn.height() / height.max(1));
            u8::from(drawn.row(y)[x] >= 128)
        };
        let plane = grown(&Plane::from_fn(width, height, covers), radius_px)
            .map_err(|e| FeatureError::Input(format!("cannot grow the mask: {e}")))?;
        let masked: usize = (0..height).map(|y| plane.as_ref().row(y).iter().filter(|v| **v > 0).count()).sum();
        let covered_percent = 100.0 * masked as f64 / (width * height).max(1) as f64;
        if covered_percent > MAX_COVERED_PERCENT {
            return Err(FeatureError::Input(format!(
                "the mask covers {covered_percent:.1} % of the picture (expected at most {MAX_COVERED_PERCENT} %); white means \
                 masked: invert it?"
            )));
        }
        Ok(Self { plane })
    }

    /// A mask from an image file, white where tracking must not look.
    ///
    /// # Errors
    /// [`FeatureError::Input`] where the file is missing, no regular file or no image; otherwise as [`Self::from_plane`].
    pub fn open(path: &Path, width: usize, height: usize, radius_px: usize) -> Result<Self, FeatureError> {
        let file = open_regular(path).map_err(|e| e.to_string());
        let drawn = file.and_then(|file| decoded(BufReader::new(file)));
        let unreadable = |e| FeatureError::Input(format!("cannot read the mask {}: {e}; {REMEDY}", path.display()));
        Self::from_plane(drawn.map_err(unreadable)?.as_ref(), width, height, radius_px)
    }

    /// A mask from an image in memory, as [`Self::open`].
    ///
    /// # Errors
    /// [`FeatureError::Input`] where it is no image, or one that is too large; otherwise as [`Self::from_plane`].
    pub fn decode(bytes: &[u8], width: usize, height: usize, radius_px: usize) -> Result<Self, FeatureError> {
        let unreadable = |e| FeatureError::Input(format!("cannot read the mask: {e}; {REMEDY}"));
        Self::from_plane(decoded(Cursor::new(bytes)).map_err(unreadable)?.as_ref(), width, height, radius_px)
    }

    /// True where no point may lie; everything outside the picture is masked.
    pub fn covers(&self, x: f32, y: f32) -> bool {
        let inside = x >= 0.0 && y >= 0.0 && x < self.plane.width() as f32 && y < self.plane.height() as f32;
        !inside || self.plane.as_ref().row(y as usize)[x as usize] > 0
    }

    /// The mask's samples: nonzero is masked.
    pub fn plane(&self) -> PlaneRef<'_, u8> {
        self.plane.as_ref()
    }
}

/// The brightness of an image.
fn decoded(file: impl BufRead + Seek) -> Result<Plane<u8>, String> {
    let mut reader = ImageReader::new(file).with_guessed_format().map_err(|e| e.to_string())?;
    let mut limits = Limits::default();
    limits.max_alloc = Some(MAX_DECODED);
    reader.limits(limits);
    // Decoders are other people's code over hostile bytes: a panic there is a damaged file, not the end of the run.
    let drawn = catch_unwind(AssertUnwindSafe(|| reader.decode())).map_err(|_| "its decoder gave up".to_owned())?;
    let drawn = drawn.map_err(|e| e.to_string())?.into_luma8();
    let (width, height) = (drawn.width() as usize, drawn.height() as usize);
    let samples = drawn.into_raw();
    Ok(Plane::from_fn(width, height, |x, y| samples[y * width + x]))
}

/// Dilation by a square of `2·radius + 1`, as a row and a column.
fn grown(mask: &Plane<u8>, radius: usize) -> Result<Plane<u8>, ImageError> {
    let size = ImageSize { width: mask.width(), height: mask.height() };
    let packed: Vec<u8> = (0..mask.height()).flat_map(|y| mask.as_ref().row(y)).copied().collect();
    let mut image = Image::<u8, 1>::new(size, packed)?;
    for _ in 0..radius {
        // A 3×3 square, radius times over: the library walks every tap of a kernel, so that small ones are cheaper.
        let mut wider = Image::<u8, 1>::from_size_val(size, 0)?;
        dilate(&image, &mut wider, &Kernel::new(KernelShape::Box { size: 3 }), PaddingMode::Constant, [0])?;
        image = wider;
    }
    let samples = image.as_slice();
    Ok(Plane::from_fn(size.width, size.height, |x, y| samples[y * size.width + x]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_masked_pixel_keeps_whole_windows_away() {
        let drawn = Plane::from_fn(64, 36, |x, y| if (x, y) == (30, 10) { 255 } else { 0 });
        let mask = Mask::from_plane(drawn.as_ref(), 64, 36, 4).expect("one pixel of many");
        for y in 0..36_i32 {
            for x in 0..64_i32 {
                let near = (x - 30).abs() <= 4 && (y - 10).abs() <= 4;
                assert_eq!(mask.covers(x as f32 + 0.5, y as f32 + 0.5), near, "({x}, {y})");
            }
        }
        assert!(mask.covers(-0.1, 5.0) && mask.covers(64.0, 5.0) && mask.covers(f32::NAN, 5.0), "outside is masked");
    }

    #[test]
    fn a_mask_of_another_size_covers_the_same_part() {
        let drawn = Plane::from_fn(200, 100, |x, _| if x < 100 { 255 } else { 0 });
        let mask = Mask::from_plane(drawn.as_ref(), 64, 36, 0).expect("half is left");
        assert!(mask.covers(31.5, 20.0) && !mask.covers(32.5, 20.0));
    }

    #[test]
    fn masks_that_leave_nothing_or_cannot_be_read_are_refused() {
        let white = Plane::from_fn(8, 8, |_, _| 255);
        let message = Mask::from_plane(white.as_ref(), 8, 8, 1).expect_err("covers all").to_string();
        assert!(message.starts_with("the mask covers 100.0 % of the picture (expected at most 98 %)"), "{message}");
        let message = Mask::open(Path::new("no such mask.png"), 8, 8, 1).expect_err("missing").to_string();
        assert!(message.starts_with("cannot read the mask no such mask.png"), "{message}");
    }
}
