//! Software rasterizer: a triangle mesh under a perspective camera, with lighting, wireframe, color maps and marks.
//!
//! 1. [`SurfaceCamera::fit`] computes the nearest camera position with every vertex inside the picture.
//! 2. `visibility.rs` and `raster.rs` find the nearest triangle of `s × s` samples per pixel: a z-buffer, in bands on all threads.
//! 3. `shade.rs` shades each pixel once per visible triangle. Smooth normals stop at creases (`corner_normals.rs`). The
//!    wireframe is drawn by the distance to the triangle's edges, so that it is hidden with its triangle.
//! 4. The layers of a translucent surface are found by depth peeling and composited front to back.
//! 5. `marks.rs` draws points and segments (handles, skeletons: `graph.rs`). Hidden marks are attenuated (`occlusion.rs`).
//! 6. `labels.rs` writes names beside points ([`draw_labels`]).
//!
//! Both sides of a triangle are lit; degenerate triangles are skipped. The picture does not depend on the number of threads.

mod camera;
mod corner_normals;
mod graph;
mod labels;
mod legend;
mod lighting;
mod marks;
mod occlusion;
mod raster;
mod shade;
#[cfg(test)]
mod tests;
mod view_text;
mod visibility;

pub use camera::{SurfaceCamera, UpAxis, ViewDirection};
pub use graph::{branch_marks, node_marks};
pub use labels::{Label, draw_labels};
pub use marks::{Mark, Shape};

use crate::mesh::TriMesh;
use plumbline_image::canvas::{Canvas, ColorMap, Rgb};
use plumbline_num::run::{Run, Stopped};

/// Default surface color: a warm light gray with contrast to both highlights and shadows.
pub const CLAY: Rgb = [214, 208, 198];

/// The value range of a color map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    /// Value at the low end of the map.
    pub low: f64,
    /// Value at the high end of the map.
    pub high: f64,
    /// The map.
    pub map: ColorMap,
}

impl Scale {
    /// The range of the finite values. Where both signs occur: a diverging map, symmetric about zero.
    pub fn of(values: &[f64]) -> Self {
        let finite = || values.iter().copied().filter(|v| v.is_finite());
        let (low, high) = (finite().fold(f64::INFINITY, f64::min), finite().fold(f64::NEG_INFINITY, f64::max));
        if low > high {
            return Self { low: 0.0, high: 1.0, map: ColorMap::Sequential };
        }
        let far = high.max(-low);
        if low < 0.0 && high > 0.0 {
            return Self { low: -far, high: far, map: ColorMap::Diverging };
        }
        Self { low, high, map: ColorMap::Sequential }
    }

    /// Position of a value in the range, in [0, 1]; 0.5 for an empty range, `None` for NaN.
    fn normalized(&self, value: f64) -> Option<f64> {
        if value.is_nan() {
            return None;
        }
        let t = (value - self.low) / (self.high - self.low);
        Some(if t.is_nan() { 0.5 } else { t.clamp(0.0, 1.0) })
    }
}

/// Surface colors. Entries beyond the end of a list and NaN values are gray.
#[derive(Clone, Copy, Debug)]
pub enum Paint<'a> {
    /// One color.
    Plain(Rgb),
    /// A color per vertex, interpolated in triangles.
    VertexColors(&'a [Rgb]),
    /// A color per triangle.
    FaceColors(&'a [Rgb]),
    /// A value per vertex, interpolated in triangles, then mapped to a color.
    VertexValues(&'a [f64], Scale),
    /// A value per triangle, mapped to a color.
    FaceValues(&'a [f64], Scale),
}

/// A mesh to draw.
#[derive(Clone, Copy, Debug)]
pub struct Surface<'a> {
    /// The triangles.
    pub mesh: &'a TriMesh,
    /// Their colors.
    pub paint: Paint<'a>,
    /// Per triangle, the edges that a wireframe shows: bit `k` for the edge from corner `k` to the next. Without a list all edges
    /// are shown; a list hides the diagonals of polygons.
    pub edges: Option<&'a [u8]>,
    /// Points and segments drawn over the surface.
    pub marks: &'a [Mark],
}

impl<'a> Surface<'a> {
    /// A surface of one color.
    pub fn new(mesh: &'a TriMesh) -> Self {
        Self { mesh, paint: Paint::Plain(CLAY), edges: None, marks: &[] }
    }
}

/// A wireframe.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wireframe {
    /// Line color.
    pub color: Rgb,
    /// Line width, px. Lines fade on triangles that are not much larger than the width.
    pub width_px: f64,
}

impl Default for Wireframe {
    fn default() -> Self {
        Self { color: [30, 34, 42], width_px: 1.0 }
    }
}

/// Drawing style.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Style {
    /// Background colors at the top and at the bottom, interpolated linearly.
    pub background: [Rgb; 2],
    /// Flat shading; otherwise smooth normals up to `crease_deg`.
    pub flat: bool,
    /// Dihedral angle above which an edge is shaded sharp, degrees.
    pub crease_deg: f64,
    /// Wireframe over the surface.
    pub wireframe: Option<Wireframe>,
    /// Color of back faces; the surface color if `None`.
    pub back: Option<Rgb>,
    /// Opacity at normal incidence, 0 to 1. Below 1 the layers behind show through.
    pub opacity: f64,
    /// Samples per pixel along each axis, at least 1.
    pub samples: usize,
    /// Draw a color bar for mapped values.
    pub legend: bool,
}

impl Default for Style {
    fn default() -> Self {
        Self {
            background: [[250, 251, 253], [219, 224, 232]],
            flat: false,
            // Half a right angle: the edges of a box stay sharp, cylinders of nine and more sides look round.
            crease_deg: 45.0,
            wireframe: None,
            back: None,
            opacity: 1.0,
            samples: 3,
            legend: true,
        }
    }
}

/// Renders a surface.
///
/// # Errors
/// [`Stopped`].
pub fn draw(surface: &Surface<'_>, camera: &SurfaceCamera, style: &Style, run: &Run) -> Result<Canvas, Stopped> {
    let samples = style.samples.clamp(1, 8);
    run.check()?;
    let view = visibility::View::new(surface.mesh, camera, samples);
    let (mut canvas, occlusion) = shade::shade(surface, camera, style, &view, run)?;
    marks::draw(surface.marks, camera, &occlusion, &mut canvas);
    if let (Paint::VertexValues(_, scale) | Paint::FaceValues(_, scale), true) = (&surface.paint, style.legend) {
        legend::draw(scale, &mut canvas);
    }
    Ok(canvas)
}
