//! Pictures of surfaces: triangles seen by a perspective camera, lit from its side, with edges, colors and marks.
//!
//! 1. [`SurfaceCamera::fit`] finds the nearest place from which every vertex is inside the picture.
//! 2. `visibility.rs` decides for `s × s` samples per pixel which triangle is seen: a z-buffer, in bands on all threads.
//! 3. `shade.rs` colors each pixel once per triangle that its samples see; smooth normals stop at creases
//!    (`corner_normals.rs`), and a wireframe is drawn by the distance to the triangle's edges, so that what hides a face
//!    hides its edges.
//! 4. Of a translucent surface layers are peeled off one by one, and laid over each other.
//! 5. `marks.rs` draws points and segments (handles, skeletons: `graph.rs`) over it; what a surface hides is drawn faintly, what
//!    a translucent one veils as far as it lets through (`veil.rs`).
//!
//! Both sides of a triangle are lit. Degenerate triangles are not seen. The picture does not depend on the number of threads.

mod camera;
mod corner_normals;
mod graph;
mod legend;
mod lighting;
mod marks;
mod shade;
#[cfg(test)]
mod tests;
mod veil;
mod visibility;

pub use camera::{SurfaceCamera, UpAxis, ViewDirection};
pub use graph::{branch_marks, node_marks};
pub use marks::{Mark, Shape};

use crate::mesh::TriMesh;
use plumbline_image::canvas::{Canvas, ColorMap, Rgb};
use plumbline_num::run::{Run, Stopped};

/// The color of a surface that has none of its own: a warm light gray on which light and shadow read well.
pub const CLAY: Rgb = [214, 208, 198];

/// Which numbers the two ends of a color map stand for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    /// The number at its low end.
    pub low: f64,
    /// The number at its high end.
    pub high: f64,
    /// The map.
    pub map: ColorMap,
}

impl Scale {
    /// From the least to the largest finite value; diverging about zero where both signs occur, and as far to both sides.
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

    /// Where a value lies between both ends, in [0, 1]; the middle where they are one. `None` for NaN.
    fn share(&self, value: f64) -> Option<f64> {
        if value.is_nan() {
            return None;
        }
        let share = (value - self.low) / (self.high - self.low);
        Some(if share.is_nan() { 0.5 } else { share.clamp(0.0, 1.0) })
    }
}

/// How a surface is colored. Where a list is too short, and where a value is NaN, it is gray.
#[derive(Clone, Copy, Debug)]
pub enum Paint<'a> {
    /// One color all over.
    Plain(Rgb),
    /// A color per vertex, mixed within triangles.
    VertexColors(&'a [Rgb]),
    /// A color per triangle.
    FaceColors(&'a [Rgb]),
    /// A number per vertex, mixed within triangles before it becomes a color.
    VertexValues(&'a [f64], Scale),
    /// A number per triangle.
    FaceValues(&'a [f64], Scale),
}

/// What is drawn.
#[derive(Clone, Copy, Debug)]
pub struct Surface<'a> {
    /// The triangles.
    pub mesh: &'a TriMesh,
    /// Their colors.
    pub paint: Paint<'a>,
    /// For each triangle, which of its edges a wireframe shows: bit `k` for the one from corner `k` to the next. All where
    /// there is no list, so that polygons can be shown without their diagonals.
    pub edges: Option<&'a [u8]>,
    /// Points and segments beside the surface.
    pub marks: &'a [Mark],
}

impl<'a> Surface<'a> {
    /// A surface of one color.
    pub fn new(mesh: &'a TriMesh) -> Self {
        Self { mesh, paint: Paint::Plain(CLAY), edges: None, marks: &[] }
    }
}

/// Lines along edges.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wireframe {
    /// Their color.
    pub color: Rgb,
    /// Their width, px. Where triangles are not much larger, lines grow fainter, or nothing else would be seen.
    pub width_px: f64,
}

impl Default for Wireframe {
    fn default() -> Self {
        Self { color: [30, 34, 42], width_px: 1.0 }
    }
}

/// How it is drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Style {
    /// Color above and color below; between them it changes evenly.
    pub background: [Rgb; 2],
    /// Triangles are flat; else normals are smooth up to `crease_deg`.
    pub flat: bool,
    /// Edges whose faces turn by more than this stay sharp, degrees.
    pub crease_deg: f64,
    /// Lines along edges.
    pub wireframe: Option<Wireframe>,
    /// Color of faces that are seen from behind, where they shall stand out.
    pub back: Option<Rgb>,
    /// How opaque surfaces are that face the viewer, 0 to 1. Less than 1: what lies behind shows through, layer by layer.
    pub opacity: f64,
    /// Samples per pixel along each axis, at least 1.
    pub samples: usize,
    /// Whether numbers get a bar that tells their colors.
    pub legend: bool,
}

impl Default for Style {
    fn default() -> Self {
        Self {
            background: [[250, 251, 253], [219, 224, 232]],
            flat: false,
            // Half a right angle: the edges of a box stay sharp, coarse cylinders of nine sides and more look round.
            crease_deg: 45.0,
            wireframe: None,
            back: None,
            opacity: 1.0,
            samples: 3,
            legend: true,
        }
    }
}

/// The picture that `camera` takes of a surface.
///
/// # Errors
/// [`Stopped`].
pub fn draw(surface: &Surface<'_>, camera: &SurfaceCamera, style: &Style, run: &Run) -> Result<Canvas, Stopped> {
    let samples = style.samples.clamp(1, 8);
    run.check()?;
    let view = visibility::View::new(surface.mesh, camera, samples);
    let (mut canvas, veil) = shade::shade(surface, camera, style, &view, run)?;
    marks::draw(surface.marks, camera, &veil, &mut canvas);
    if let (Paint::VertexValues(_, scale) | Paint::FaceValues(_, scale), true) = (&surface.paint, style.legend) {
        legend::draw(scale, &mut canvas);
    }
    Ok(canvas)
}
