//! One picture through its map: transparency weighted, means where the map shrinks.

use std::io::{Seek, Write};
use std::ops::Range;

use super::alpha::{unweighted, weighted};
use super::averaged::Spreads;
use super::plane::Band;
use super::{RenderError, RenderOptions, Renderer, check_size};
use crate::still::{GainMap, Photo, RowSource, SaveOptions, Saved, StillError, StillFormat, encode_rows};
use crate::warp::{Lattice, Map, WarpField};
use crate::{Frame, PixelFormat};
use nalgebra::{Matrix2, Matrix2x3};
use plumbline_num::math::{Point2, PointMap, Vec2};
use plumbline_num::run::Run;

/// A still picture through a lattice: the whole, or any rows of it, which are the same to the bit.
///
/// Where rows are written as soon as they are made, the result is never in memory as a whole.
///
/// ```
/// use plumbline_image::render::{RenderOptions, Renderer, StillRendering};
/// use plumbline_image::still::frame_of_rgb;
/// use plumbline_image::warp::{Lattice, WarpField};
/// use plumbline_num::run::Run;
///
/// let picture = frame_of_rgb(&[7; 12], 2, 2)?;
/// let lattice = Lattice::new(&WarpField::identity(), 2, 2);
/// let renderer = Renderer::new(RenderOptions::default());
/// let rendering = StillRendering::new(&renderer, &picture, &lattice)?;
/// let lower = rendering.rows(1..2, &Run::default())?;
/// assert_eq!(lower.plane8(0).map(|plane| plane.row(0).to_vec()), Some(vec![7, 7]));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct StillRendering<'a> {
    renderer: &'a Renderer,
    source: &'a Frame,
    /// The source with colors weighted by their opacity, where it has any.
    weighted: Option<Frame>,
    lattice: &'a Lattice,
    spreads: Option<Spreads>,
}

impl<'a> StillRendering<'a> {
    /// Of `source` as `lattice` shows it: [`Renderer::render_averaged`], with colors weighted by their opacity where there is an
    /// alpha plane.
    ///
    /// # Errors
    /// [`RenderError::Dimensions`]; [`RenderError::Plane`] where the memory of the source does not hold its planes.
    pub fn new(renderer: &'a Renderer, source: &'a Frame, lattice: &'a Lattice) -> Result<Self, RenderError> {
        check_size((source.width, source.height))?;
        check_size(lattice.size())?;
        let lost = RenderError::Plane { plane: source.format.planes() - 1, role: "source" };
        let weighted = if source.format.alpha { Some(weighted(source).ok_or(lost)?) } else { None };
        Ok(Self { renderer, source, weighted, lattice, spreads: Spreads::of(lattice) })
    }

    /// Format of the result: that of the source.
    pub fn format(&self) -> PixelFormat {
        self.source.format
    }

    /// Width and height of the result, px.
    pub fn size(&self) -> (usize, usize) {
        self.lattice.size()
    }

    /// The result, made on all threads.
    ///
    /// # Errors
    /// As for [`Renderer::render`].
    pub fn frame(mut self, run: &Run) -> Result<Frame, RenderError> {
        let made = self.sampled(Band::Whole, self.size().1, run)?;
        // As large as the result, twice that at 8 bit.
        self.weighted = None;
        self.plain(made)
    }

    /// Rows of the result as a frame of their own, made on the thread of the caller.
    ///
    /// # Errors
    /// As for [`Renderer::render`]; [`RenderError::Size`] for rows that the result does not have, or that begin within a row of
    /// subsampled chroma.
    pub fn rows(&self, rows: Range<usize>, run: &Run) -> Result<Frame, RenderError> {
        let (size, format) = (self.size(), self.source.format);
        let row = (0..format.planes()).map(|i| 1_usize << format.subsampling(i).1).max().unwrap_or(1);
        if rows.is_empty() || rows.end > size.1 || !rows.start.is_multiple_of(row) {
            return Err(RenderError::Size { lattice: size, dst: (size.0, rows.end) });
        }
        self.plain(self.sampled(Band::From(rows.start), rows.len(), run)?)
    }

    /// Writes the result as a picture file, with what `head` has beside its pixels ([`Photo::without_pixels`]). Rows are made as
    /// they are written: the file is that of the whole, which is never in memory, except for WebP as packed samples.
    ///
    /// ```
    /// use plumbline_image::render::{RenderOptions, Renderer, StillRendering};
    /// use plumbline_image::still::{Photo, SaveOptions, StillFormat, frame_of_rgb};
    /// use plumbline_image::warp::{Lattice, WarpField};
    /// use plumbline_num::run::Run;
    ///
    /// let photo = Photo::new(frame_of_rgb(&[90; 3 * 64], 8, 8)?);
    /// let lattice = Lattice::between(&WarpField::identity(), (4, 4), (8, 8));
    /// let renderer = Renderer::new(RenderOptions::default());
    /// let rendering = StillRendering::new(&renderer, &photo.frame, &lattice)?;
    /// let head = photo.without_pixels(rendering.size());
    /// let mut file = std::io::Cursor::new(Vec::new());
    /// rendering.encode(&head, StillFormat::Jpeg, SaveOptions::default(), &mut file, &Run::default())?;
    /// assert!(file.into_inner().starts_with(&[0xff, 0xd8]));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// Those of [`StillError`] that are about output; [`StillError::Stopped`].
    pub fn encode(
        &self,
        head: &Photo,
        format: StillFormat,
        options: SaveOptions,
        out: impl Write + Seek,
        run: &Run,
    ) -> Result<Saved, StillError> {
        encode_rows(head, &RenderedRows { rendering: self, run }, format, options, out)
    }

    /// So many rows, colors weighted by their opacity where there is an alpha plane.
    fn sampled(&self, band: Band, height: usize, run: &Run) -> Result<Frame, RenderError> {
        let source = self.weighted.as_ref().unwrap_or(self.source);
        let mut made = Frame::new(source.format, self.size().0, height);
        self.renderer.render_planes(source, self.lattice, &mut made, (self.spreads.as_ref(), band), run)?;
        Ok(made)
    }

    /// Sampled rows in the format of the source.
    fn plain(&self, made: Frame) -> Result<Frame, RenderError> {
        let format = self.source.format;
        if !format.alpha {
            return Ok(made);
        }
        let mut plain = Frame::new(format, made.width, made.height);
        let lost = RenderError::Plane { plane: format.planes() - 1, role: "destination" };
        unweighted(&made, &mut plain).ok_or(lost)?;
        Ok(plain)
    }
}

/// A rendering whose rows go into a file.
struct RenderedRows<'a> {
    rendering: &'a StillRendering<'a>,
    run: &'a Run,
}

impl RowSource for RenderedRows<'_> {
    fn format(&self) -> PixelFormat {
        self.rendering.format()
    }

    fn size(&self) -> (usize, usize) {
        self.rendering.size()
    }

    fn rows(&self, rows: Range<usize>) -> Result<Frame, StillError> {
        self.rendering.rows(rows, self.run).map_err(|e| match e {
            RenderError::Interrupted(stopped) => stopped.into(),
            // Sizes are checked before: what is left is memory of the source that does not hold its planes.
            _ => StillError::Layout,
        })
    }
}

impl Renderer {
    /// `src` as `lattice` shows it: all of a [`StillRendering`].
    ///
    /// # Errors
    /// As for [`Renderer::render`].
    pub fn render_still(&self, src: &Frame, lattice: &Lattice, run: &Run) -> Result<Frame, RenderError> {
        StillRendering::new(self, src, lattice)?.frame(run)
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
    use std::io::Cursor;

    use super::*;
    use crate::Layout;
    use crate::render::Border;
    use crate::still::encode;
    use plumbline_num::math::Similarity2;
    use plumbline_num::run::Interrupt;

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
    fn rows_are_those_of_the_whole_at_every_depth_and_where_the_map_shrinks() {
        let mut frames = vec![halves(8), halves(16), Frame::new(PixelFormat::opaque(Layout::Yuv420, 8), 200, 150)];
        for (plane, y) in (0..3).flat_map(|p| (0..75).map(move |y| (p, y))) {
            let mut rows = frames[2].plane8_mut(plane).expect("8 bit");
            rows.row_mut(y).iter_mut().enumerate().for_each(|(x, v)| *v = (x * 5 + y * y * 3 + plane * 50) as u8);
        }
        let mut noise = Frame::new(PixelFormat::opaque(Layout::Gbr, 8), 200, 150);
        for (plane, y) in (0..3).flat_map(|p| (0..150).map(move |y| (p, y))) {
            let mut rows = noise.plane8_mut(plane).expect("8 bit");
            rows.row_mut(y).iter_mut().enumerate().for_each(|(x, v)| *v = (x * x * 7 + y * 31 + plane * 77) as u8);
        }
        frames.push(noise);
        let renderer = Renderer::new(RenderOptions::default());
        for (frame, scale) in frames.iter().flat_map(|frame| [0.8, 2.3].map(|scale| (frame, scale))) {
            let field = WarpField::identity().then(Map::Affine(Matrix2x3::new(scale, 0.1, 1.3, -0.05, scale, 2.7)));
            let lattice = Lattice::between(&field, (83, 67), (frame.width, frame.height));
            let rendering = StillRendering::new(&renderer, frame, &lattice).expect("a still frame");
            let whole = renderer.render_still(frame, &lattice, &Run::default()).expect("sizes fit");
            let (planes, chroma) = (frame.format.planes(), frame.format.subsampling(1).1);
            for rows in [0..1, 6..40, 40..67] {
                let part = rendering.rows(rows.clone(), &Run::default()).expect("rows of it");
                assert_eq!((part.width, part.height), (83, rows.len()));
                for plane in 0..planes {
                    let shift = frame.format.subsampling(plane).1;
                    let row = |frame: &Frame, j: usize| -> Vec<u16> {
                        let eight = frame.plane8(plane).map(|p| p.row(j).iter().map(|&v| v.into()).collect());
                        eight.unwrap_or_else(|| frame.plane16(plane).expect("16 bit").row(j).to_vec())
                    };
                    for k in 0..rows.len().div_ceil(1 << shift) {
                        let j = (rows.start >> shift) + k;
                        assert_eq!(row(&part, k), row(&whole, j), "plane {plane}, row {j}, scale {scale}");
                    }
                }
            }
            assert_eq!(rendering.rows(5..40, &Run::default()).is_err(), chroma > 0, "rows within one of chroma");
            assert!(rendering.rows(60..68, &Run::default()).is_err() && rendering.rows(3..3, &Run::default()).is_err());
        }
    }

    #[test]
    fn a_file_written_as_it_is_sampled_is_the_file_of_the_whole() {
        let affine = Matrix2x3::new(0.9, 0.1, 1.0, -0.1, 1.6, 3.0);
        let field = WarpField::identity().then(Map::Affine(affine));
        let ((w, h), size, run) = ((181, 600), (150, 333), Run::default());
        let lattice = Lattice::between(&field, size, (w, h));
        let renderer = Renderer::new(RenderOptions::default());
        let formats = [StillFormat::Jpeg, StillFormat::Png, StillFormat::Tiff, StillFormat::WebP];
        for (layout, bits, alpha) in [Layout::Gray, Layout::Gbr]
            .into_iter()
            .flat_map(|l| [(l, 8, false), (l, 8, true), (l, 16, false), (l, 16, true)])
        {
            let mut photo = Photo::new(Frame::new(PixelFormat { layout, bits, alpha }, w, h));
            for (plane, y) in (0..photo.frame.format.planes()).flat_map(|p| (0..h).map(move |y| (p, y))) {
                let value = |x: usize| (x * 150 / w + y * 60 / h + 15 * plane) as u16;
                if bits == 8 {
                    let mut rows = photo.frame.plane8_mut(plane).expect("8 bit");
                    rows.row_mut(y).iter_mut().enumerate().for_each(|(x, v)| *v = value(x) as u8);
                } else {
                    let mut rows = photo.frame.plane16_mut(plane).expect("16 bit");
                    rows.row_mut(y).iter_mut().enumerate().for_each(|(x, v)| *v = value(x) * 256 + x as u16);
                }
            }
            let whole = photo.rendered(&field, size, &run).expect("a still frame");
            let rendering = StillRendering::new(&renderer, &photo.frame, &lattice).expect("a still frame");
            let head = photo.without_pixels(size);
            for (format, quality) in formats.into_iter().flat_map(|format| [80, 92].map(|quality| (format, quality))) {
                let (mut expected, mut out) = (Cursor::new(Vec::new()), Cursor::new(Vec::new()));
                let options = SaveOptions { quality };
                let said = encode(&whole, format, options, &mut expected).expect("it can be written");
                let saved = rendering.encode(&head, format, options, &mut out, &run).expect("it can be written");
                assert_eq!(saved, said);
                assert!(out.into_inner() == expected.into_inner(), "{format:?} {quality} {layout:?} {bits} {alpha}");
            }
            let interrupt = Interrupt::new();
            interrupt.stop();
            let stopped = Run::with_interrupt(&interrupt);
            let mut out = Cursor::new(Vec::new());
            let refused = rendering.encode(&head, StillFormat::Jpeg, SaveOptions::default(), &mut out, &stopped);
            assert!(matches!(refused, Err(StillError::Stopped(_))) && out.into_inner().is_empty());
        }
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
