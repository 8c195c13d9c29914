//! From the plane of a projection to the pixels of the output: crop and scale.

use nalgebra::Matrix2x3;

use super::RectifyOptions;
use super::error::RectifyError;
use crate::camera::Lens;
use crate::math::{Point2, Rect, Vec2};
use crate::mesh::GridMesh;
use crate::photo::crop::Coverage;
use crate::photo::warp::{Forward, PhotoWarp};
use crate::warp::{Lattice, Map, WarpField};

/// Pixels along the longer side of the raster on which the crop is found.
const RASTER: usize = 800;
/// Largest side of an output, px: what the renderer takes.
const MAX_SIDE: f64 = 16_384.0;

/// What is cut away.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Crop {
    /// Nothing where the picture's border can be made straight; all outside the largest rectangle otherwise.
    #[default]
    Auto,
    /// All outside the largest rectangle that the picture fills.
    Rectangle,
    /// As [`Self::Auto`], and of that the largest rectangle with this ratio of width to height.
    Aspect(f64),
    /// Nothing: the output holds the whole picture, with its curved border.
    None,
}

/// How large the output is.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum OutputSize {
    /// As wide as the source; for panoramas, whose view is a part of them, as dense.
    #[default]
    Source,
    /// So many pixels; the crop takes this shape.
    Exact(usize, usize),
}

/// A warp whose output is a plane: positions are in px at the density of the source where the viewer looks.
pub(super) struct Unframed {
    /// From the plane to the source, the map nearest to the plane first.
    pub(super) maps: Vec<Map>,
    /// The grid in the plane.
    pub(super) mesh: GridMesh,
    /// From the source to the plane.
    pub(super) forward: Box<Forward>,
}

impl Unframed {
    /// The warp of the part that the options ask for.
    pub(super) fn framed(
        mut self,
        lens: &Lens,
        faces: &[Rect],
        options: &RectifyOptions,
    ) -> Result<PhotoWarp, RectifyError> {
        let bounds = bounds(&self.mesh).ok_or(RectifyError::EmptyView)?;
        let frame = self.crop(bounds, lens, faces, options).ok_or(RectifyError::EmptyView)?;
        let (size, scale) = size(&frame, lens, options)?;
        let plane_from_out = Matrix2x3::new(1.0 / scale.x, 0.0, frame.min.x, 0.0, 1.0 / scale.y, frame.min.y);
        self.maps.insert(0, Map::Affine(plane_from_out));
        let out_from_plane = move |p: Point2| Point2::from((p - frame.min).component_mul(&scale));
        self.mesh.vertices.iter_mut().for_each(|v| *v = out_from_plane(*v));
        let forward = self.forward;
        Ok(PhotoWarp {
            field: WarpField { chain: self.maps },
            size,
            mesh: self.mesh,
            forward: Box::new(move |p| forward(p).map(out_from_plane)),
            lines: Vec::new(),
            iterations: 0,
        })
    }

    /// The part of the plane that is kept; `None` where the picture fills nothing.
    fn crop(&mut self, bounds: Rect, lens: &Lens, _faces: &[Rect], options: &RectifyOptions) -> Option<Rect> {
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
        match (options.crop, options.size) {
            (Crop::None, _) => coverage.bounds(),
            (Crop::Aspect(aspect), _) => coverage.largest_of_shape(aspect),
            (Crop::Auto | Crop::Rectangle, OutputSize::Exact(w, h)) => coverage.largest_of_shape(w as f64 / h as f64),
            (Crop::Auto | Crop::Rectangle, OutputSize::Source) => coverage.largest(),
        }
    }
}

/// Size of the output, px, and its pixels per unit of the plane along x and y.
fn size(frame: &Rect, lens: &Lens, options: &RectifyOptions) -> Result<((usize, usize), Vec2), RectifyError> {
    let (width, height) = match options.size {
        OutputSize::Exact(w, h) => (w as f64, h as f64),
        OutputSize::Source if lens.projection.is_panoramic() => (frame.width().round(), frame.height().round()),
        OutputSize::Source => (lens.size.0.round(), (frame.height() * lens.size.0.round() / frame.width()).round()),
    };
    check_size(width, height)?;
    let scale = match options.crop {
        // An irregular border leaves room: shapes are kept, and the picture lies in the middle.
        Crop::None => Vec2::repeat((width / frame.width()).min(height / frame.height())),
        _ => Vec2::new(width / frame.width(), height / frame.height()),
    };
    Ok(((width as usize, height as usize), scale))
}

/// Whether an output can have this size.
pub(super) fn check_size(width: f64, height: f64) -> Result<(), RectifyError> {
    let valid = |side: f64| (1.0..=MAX_SIDE).contains(&side);
    if valid(width) && valid(height) { Ok(()) } else { Err(RectifyError::Size { width, height }) }
}

fn bounds(mesh: &GridMesh) -> Option<Rect> {
    let first = *mesh.vertices.first()?;
    let grow = |b: Rect, v: &Point2| Rect { min: b.min.inf(v), max: b.max.sup(v) };
    let bounds = mesh.vertices.iter().fold(Rect { min: first, max: first }, grow);
    (bounds.width() > 0.0 && bounds.height() > 0.0).then_some(bounds)
}
