//! From the plane of a projection to the pixels of the output: crop and scale.

use nalgebra::Matrix2x3;

use super::{RectifyOptions, empty_view, people};
use crate::PhotoError;
use crate::aspect_ratio::AspectRatio;
use crate::crop::Coverage;
use crate::warp::{Forward, MAX_SIDE, PhotoWarp};
use plumbline_camera::Lens;
use plumbline_image::grid::GridMesh;
use plumbline_image::warp::{Lattice, Map, WarpField};
use plumbline_num::math::{Point2, Rect, Vec2};

/// Pixels along the longer side of the raster on which the crop is searched: the crop is exact to 1/800 of the side.
const RASTER: usize = 800;
/// Tolerance for faces at the frame, as a fraction of its longer side: two pixels of the raster.
const CUT: f64 = 2.0 / RASTER as f64;

/// Pixels of a view per pixel of the panorama above which there are as many as the panorama has: a whole panorama as a cylinder
/// has 1.1 times as many.
const MAX_GROWTH: f64 = 1.25;

/// Crop of the output: `"auto"`, `"rectangle"`, `"none"`, or an aspect ratio such as `"3:2"`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Crop {
    /// The whole picture where its border can be made straight; beside lines, where there are no people, without what would bend them;
    /// else the largest covered rectangle.
    #[default]
    Auto,
    /// The largest rectangle that the picture covers.
    Rectangle,
    /// As [`Self::Auto`], then the largest rectangle with this ratio of width to height.
    Aspect(AspectRatio),
    /// No crop: the output contains the whole picture with its curved border.
    None,
}

/// Size of the output.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum OutputSize {
    /// The width of the source; for panoramas, their density in px/rad.
    #[default]
    Source,
    /// Width and height, px; the crop takes this aspect ratio.
    Exact(usize, usize),
}

/// A warp to an unbounded plane, in px at the density of the source at the view's center.
pub(super) struct Unframed {
    /// From the plane to the source, the map nearest to the plane first.
    pub(super) maps: Vec<Map>,
    /// The grid in the plane.
    pub(super) mesh: GridMesh,
    /// From the source to the plane.
    pub(super) forward: Box<Forward>,
}

impl Unframed {
    /// The warp with the crop and size of the options.
    pub(super) fn framed(
        mut self,
        lens: &Lens,
        faces: &[Rect],
        options: &RectifyOptions,
    ) -> Result<PhotoWarp, PhotoError> {
        let frame = self.frame(lens, faces, options)?;
        self.in_frame(frame, lens, faces, options)
    }

    /// The rectangle of the plane that the output shows.
    pub(super) fn frame(&mut self, lens: &Lens, faces: &[Rect], options: &RectifyOptions) -> Result<Rect, PhotoError> {
        let bounds = bounds(&self.mesh).ok_or_else(empty_view)?;
        self.crop(bounds, lens, faces, options).ok_or_else(empty_view)
    }

    /// The warp that shows a rectangle of the plane.
    pub(super) fn in_frame(
        mut self,
        frame: Rect,
        lens: &Lens,
        faces: &[Rect],
        options: &RectifyOptions,
    ) -> Result<PhotoWarp, PhotoError> {
        let Scaled { size, scale, bounded_from } = size(&frame, lens, options)?;
        let plane_from_out = Matrix2x3::new(1.0 / scale.x, 0.0, frame.min.x, 0.0, 1.0 / scale.y, frame.min.y);
        self.maps.insert(0, Map::Affine(plane_from_out));
        let out_from_plane = move |p: Point2| Point2::from((p - frame.min).component_mul(&scale));
        self.mesh.vertices.iter_mut().for_each(|v| *v = out_from_plane(*v));
        let forward = self.forward;
        let forward: Box<Forward> = Box::new(move |p| forward(p).map(out_from_plane));
        let picture = Rect::of_size(lens.size.0, lens.size.1);
        let cut = |regions: &[Option<Rect>]| people::cut(regions, &picture, &*forward, size, CUT);
        let (cut_faces, cut_below) = (
            cut(&faces.iter().copied().map(Some).collect::<Vec<_>>()),
            cut(&faces.iter().map(|face| people::body(face, &picture)).collect::<Vec<_>>()),
        );
        let field = WarpField { chain: self.maps };
        Ok(PhotoWarp { bounded_from, cut_faces, cut_below, ..PhotoWarp::new(field, size, self.mesh, forward) })
    }

    /// The crop rectangle in the plane; `None` if the picture covers none.
    fn crop(&mut self, bounds: Rect, lens: &Lens, faces: &[Rect], options: &RectifyOptions) -> Option<Rect> {
        let pixel = bounds.width().max(bounds.height()) / RASTER as f64;
        let plane_from_raster = Matrix2x3::new(pixel, 0.0, bounds.min.x, 0.0, pixel, bounds.min.y);
        self.maps.insert(0, Map::Affine(plane_from_raster));
        let field = WarpField { chain: std::mem::take(&mut self.maps) };
        let raster = [bounds.width(), bounds.height()].map(|length| (length / pixel).ceil() as usize + 1);
        let source = (lens.size.0.ceil() as usize, lens.size.1.ceil() as usize);
        let lattice = Lattice::between(&field, (raster[0], raster[1]), source);
        self.maps = field.chain;
        self.maps.remove(0);
        let picture = Rect::of_size(lens.size.0, lens.size.1);
        let covered = |p: Point2| {
            let at = Point2::from((p - bounds.min) / pixel);
            lattice.src_from_out(at).is_some_and(|src| picture.contains(src))
        };
        let coverage = Coverage::new(bounds, RASTER, covered);
        let largest = |kept: Option<&Rect>| match (options.crop, options.size, kept) {
            (Crop::Aspect(aspect), _, _) => coverage.largest_of_shape(aspect.value(), kept),
            (_, OutputSize::Exact(w, h), _) => coverage.largest_of_shape(w as f64 / h as f64, kept),
            (_, OutputSize::Source, Some(kept)) => coverage.largest_around(kept),
            (_, OutputSize::Source, None) => coverage.largest(),
        };
        if options.crop == Crop::None {
            return coverage.bounds();
        }
        let whole = largest(None)?;
        // Pixels of the raster that the border cuts are not covered.
        let inset = Vec2::repeat(pixel);
        let inner = |r: Rect| Rect { min: r.min + inset, max: r.max - inset };
        let seen = |region: &Rect| people::outline(region, &picture, &*self.forward).map(inner);
        let mut shown: Vec<Rect> = faces.iter().filter_map(seen).collect();
        let bodies = faces.iter().filter_map(|face| people::body(face, &picture));
        let mut bodies: Vec<Rect> = bodies.filter_map(|body| seen(&body)).collect();
        if shown.iter().chain(&bodies).all(|region| people::within(region, &whole)) {
            return Some(whole);
        }
        Some(people::around(&mut shown, &mut bodies, largest).unwrap_or(whole))
    }
}

/// Size of an output.
struct Scaled {
    /// Width and height, px.
    size: (usize, usize),
    /// Pixels per unit of the plane along x and y.
    scale: Vec2,
    /// What the size would have been without a bound.
    bounded_from: Option<(usize, usize)>,
}

/// Size of the output. Views of panoramas have the density of the source, and not many more pixels than it.
fn size(frame: &Rect, lens: &Lens, options: &RectifyOptions) -> Result<Scaled, PhotoError> {
    let mut bounded_from = None;
    let (width, height) = match options.size {
        OutputSize::Exact(w, h) => (w as f64, h as f64),
        OutputSize::Source if lens.projection.is_panoramic() => {
            let growth = frame.width() * frame.height() / (lens.size.0 * lens.size.1);
            let scale = if growth > MAX_GROWTH { growth.sqrt().recip() } else { 1.0 };
            bounded_from = (scale < 1.0).then(|| (frame.width() as usize, frame.height() as usize));
            ((scale * frame.width()).round().max(1.0), (scale * frame.height()).round().max(1.0))
        }
        OutputSize::Source => (lens.size.0.round(), (frame.height() * lens.size.0.round() / frame.width()).round()),
    };
    check_size(width, height)?;
    let scale = match options.crop {
        // An irregular border leaves room: shapes are kept, and the picture lies in the middle.
        Crop::None => Vec2::repeat((width / frame.width()).min(height / frame.height())),
        _ => Vec2::new(width / frame.width(), height / frame.height()),
    };
    Ok(Scaled { size: (width as usize, height as usize), scale, bounded_from })
}

/// Whether an output can have this size.
pub(super) fn check_size(width: f64, height: f64) -> Result<(), PhotoError> {
    let valid = |side: f64| (1.0..=MAX_SIDE as f64).contains(&side);
    let refused = || {
        let size = format!("{width} × {height} px (expected 1 to {MAX_SIDE} each)");
        PhotoError::Output(format!("the output would have {size}: choose another size or crop"))
    };
    (valid(width) && valid(height)).then_some(()).ok_or_else(refused)
}

fn bounds(mesh: &GridMesh) -> Option<Rect> {
    let first = *mesh.vertices.first()?;
    let grow = |b: Rect, v: &Point2| Rect { min: b.min.inf(v), max: b.max.sup(v) };
    let bounds = mesh.vertices.iter().fold(Rect { min: first, max: first }, grow);
    (bounds.width() > 0.0 && bounds.height() > 0.0).then_some(bounds)
}
