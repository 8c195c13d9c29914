//! One picture through its map: transparency weighted, means where the map shrinks.

use super::alpha::{unweighted, weighted};
use super::{RenderError, RenderOptions, Renderer};
use crate::Frame;
use crate::still::{GainMap, Photo};
use crate::warp::{Lattice, Map, WarpField};
use nalgebra::{Matrix2, Matrix2x3};
use plumbline_num::math::{Point2, PointMap, Vec2};
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
        let renderer = Renderer::new(RenderOptions::default());
        let frame = renderer.render_still(&self.frame, &lattice, run)?;
        let mut made = self.with_frame(frame);
        if let Some(map) = &self.gain_map {
            let whole = (self.frame.width, self.frame.height);
            made.gain_map = Some(map.rendered(&lattice, whole, &renderer, run)?);
        }
        made.warnings.splice(..0, self.warnings.iter().cloned());
        Ok(made)
    }
}

impl GainMap {
    /// The gain map of a picture of `whole` px through the lattice that shows the picture, with as many pixels for each of the
    /// picture as before.
    ///
    /// # Errors
    /// As for [`Renderer::render`].
    pub fn rendered(
        &self,
        lattice: &Lattice,
        whole: (usize, usize),
        renderer: &Renderer,
        run: &Run,
    ) -> Result<Self, RenderError> {
        let (own, size) = ((self.frame.width, self.frame.height), lattice.size());
        let scale = (own.0 as f64 / whole.0 as f64, own.1 as f64 / whole.1 as f64);
        let side = |length: usize, scale: f64| ((length as f64 * scale).round() as usize).max(1);
        let out = (side(size.0, scale.0), side(size.1, scale.1));
        let scaled = |x: f64, y: f64| Map::Affine(Matrix2x3::new(x, 0.0, 0.0, 0.0, y, 0.0));
        let field = WarpField::identity()
            .then(scaled(size.0 as f64 / out.0 as f64, size.1 as f64 / out.1 as f64))
            .then(Map::Radial(Box::new(Sampled(lattice.clone()))))
            .then(scaled(scale.0, scale.1));
        let lattice = Lattice::between(&field, out, own);
        Ok(self.with_frame(renderer.render_still(&self.frame, &lattice, run)?))
    }
}

/// A lattice as a map of points.
struct Sampled(Lattice);

impl PointMap for Sampled {
    fn map(&self, p: Point2) -> Option<Point2> {
        self.0.src_from_out(p)
    }

    fn jacobian(&self, p: Point2) -> Option<Matrix2<f64>> {
        let along = |step: Vec2| Some(self.map(p + step)? - self.map(p - step)?);
        Some(Matrix2::from_columns(&[along(Vec2::new(0.5, 0.0))?, along(Vec2::new(0.0, 0.5))?]))
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
    fn a_gain_map_goes_where_its_picture_goes() {
        let gray = |w: usize, h: usize| {
            let mut frame = Frame::new(PixelFormat::opaque(Layout::Gray, 8), w, h);
            let mut plane = frame.plane8_mut(0).expect("8 bit");
            (0..h).for_each(|y| plane.row_mut(y)[w / 2..].fill(200));
            frame
        };
        let mut photo = Photo::new(gray(64, 48));
        photo.gain_map = Some(GainMap { frame: gray(16, 12), xmp: Some(vec![7]), iso: None });
        // Half the size, and 16 px of the source further left.
        let field = WarpField::identity().then(Map::Affine(Matrix2x3::new(2.0, 0.0, 16.0, 0.0, 2.0, 0.0)));
        let made = photo.rendered(&field, (24, 24), &Run::default()).expect("sizes fit");
        let map = made.gain_map.expect("carried along");
        assert_eq!((map.frame.width, map.frame.height, map.xmp), (6, 6, Some(vec![7])));
        let edge = |frame: &Frame| {
            let plane = frame.plane8(0).expect("8 bit");
            plane.row(plane.height() / 2).iter().map(|v| 1.0 - f64::from(*v) / 200.0).sum::<f64>()
                / plane.width() as f64
        };
        let (picture, map) = (edge(&made.frame), edge(&map.frame));
        assert!((picture - 8.0 / 24.0).abs() < 0.02 && (map - picture).abs() < 0.02, "{picture} and {map}");
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
