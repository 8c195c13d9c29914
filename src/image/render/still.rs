//! One picture through its map: transparency weighted, means where the map shrinks.

use super::alpha::{unweighted, weighted};
use super::{RenderError, RenderOptions, Renderer};
use crate::Frame;
use crate::still::Photo;
use crate::warp::{Lattice, WarpField};
use plumbline_num::run::Run;

impl Renderer {
    /// `src` as `lattice` shows it: [`Renderer::render_averaged`], with colors weighted by their opacity where there is an alpha
    /// plane.
    ///
    /// # Errors
    /// As for [`Renderer::render`].
    pub fn render_still(&self, src: &Frame, lattice: &Lattice, run: &Run) -> Result<Frame, RenderError> {
        let (width, height) = lattice.size();
        let mut dst = Frame::new(src.format, width, height);
        if !src.format.alpha {
            self.render_averaged(src, lattice, &mut dst, run)?;
            return Ok(dst);
        }
        let plane = src.format.planes() - 1;
        let source = weighted(src).ok_or(RenderError::Plane { plane, role: "source" })?;
        let mut made = Frame::new(source.format, width, height);
        self.render_averaged(&source, lattice, &mut made, run)?;
        drop(source);
        unweighted(&made, &mut dst).ok_or(RenderError::Plane { plane, role: "destination" })?;
        Ok(dst)
    }
}

impl Photo {
    /// The picture through a warp, of `size` px: sampled once, with the default kernel and border. What the file says of camera
    /// and color stays.
    ///
    /// # Errors
    /// As for [`Renderer::render`].
    pub fn rendered(&self, src_from_out: &WarpField, size: (usize, usize), run: &Run) -> Result<Self, RenderError> {
        let lattice = Lattice::between(src_from_out, size, (self.frame.width, self.frame.height));
        let frame = Renderer::new(RenderOptions::default()).render_still(&self.frame, &lattice, run)?;
        let mut made = self.with_frame(frame);
        made.warnings.splice(..0, self.warnings.iter().cloned());
        Ok(made)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::{Border, RenderOptions};
    use crate::warp::WarpField;
    use crate::{Layout, PixelFormat};
    use plumbline_num::math::{Similarity2, Vec2};

    /// Left half red and opaque, right half green and transparent.
    fn halves(bits: u8) -> Frame {
        let mut frame = Frame::new(PixelFormat { layout: Layout::Gbr, bits, alpha: true }, 40, 20);
        frame.color.full_range = Some(true);
        let full = ((1_u32 << bits) - 1) as u16;
        for (plane, left, right) in [(0, 0, full), (1, 0, 0), (2, full, 0), (3, full, 0)] {
            for (y, x) in (0..20).flat_map(|y| (0..40).map(move |x| (y, x))) {
                let v = if x < 20 { left } else { right };
                if bits == 8 {
                    frame.plane8_mut(plane).expect("8 bit").row_mut(y)[x] = v as u8;
                } else {
                    frame.plane16_mut(plane).expect("16 bit").row_mut(y)[x] = v;
                }
            }
        }
        frame
    }

    fn moved(frame: &Frame, by: f64) -> Frame {
        let s = Similarity2 { t: Vec2::new(by, 0.0), ..Similarity2::IDENTITY }.to_homography();
        let lattice = Lattice::new(&WarpField::from_forward_homography(&s).expect("regular"), 40, 20);
        let renderer = Renderer::new(RenderOptions { border: Border::Black, ..RenderOptions::default() });
        renderer.render_still(frame, &lattice, &Run::default()).expect("sizes fit")
    }

    fn sample(frame: &Frame, plane: usize, x: usize) -> u16 {
        frame.plane8(plane).map_or_else(|| frame.plane16(plane).expect("16 bit").row(9)[x], |p| p.row(9)[x].into())
    }

    #[test]
    fn transparent_pixels_leak_no_color() {
        for bits in [8, 16] {
            let full = ((1_u32 << bits) - 1) as u16;
            let result = moved(&halves(bits), 0.4);
            for x in (0..40).filter(|&x| sample(&result, 3, x) > full / 50) {
                assert!(sample(&result, 0, x) <= full / 200, "green at {x}: {}", sample(&result, 0, x));
                assert!(sample(&result, 2, x) >= full - full / 100, "red at {x}: {}", sample(&result, 2, x));
            }
            assert_eq!((sample(&result, 3, 10), sample(&result, 3, 30)), (full, 0));
            let edge = sample(&result, 3, 0);
            assert!(edge > full / 4 && edge < full, "the border is transparent: {edge}");
        }
    }

    #[test]
    fn opaque_pixels_are_reproduced_to_the_bit() {
        for bits in [8, 16] {
            let before = halves(bits);
            let after = moved(&before, 3.0);
            for (plane, x) in (0..4).flat_map(|p| (0..17).map(move |x| (p, x))) {
                assert_eq!(sample(&after, plane, x + 3), sample(&before, plane, x), "{bits} bit, plane {plane}");
            }
        }
    }
}
