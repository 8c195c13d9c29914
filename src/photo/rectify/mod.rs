//! Wide-angle pictures without bent lines and without stretched edges.
//!
//! No flat picture of a wide field is both straight (only the rectilinear one is, and it stretches the edges by `1/cos θ`)
//! and true in shape (only conformal ones are, and they bend lines). People look at lines, faces and what is salient: there
//! the picture is made right, and what must give way does so elsewhere. See `solver.rs` for the energy.
//!
//! # Reference
//! R. Carroll, M. Agrawala, A. Agarwala, *Optimizing content-preserving projections for wide-angle images*, ACM Trans. Graph.
//! (SIGGRAPH) 28 (2009).

mod chart;
mod error;
mod fixed;
mod frame;
mod solver;
mod sphere_grid;
mod straight;
mod weights;

use nalgebra::Rotation3;

pub use error::RectifyError;
pub use frame::{Crop, OutputSize};
pub use solver::EnergyWeights;
pub use sphere_grid::Window;

use super::warp::PhotoWarp;
use super::{Line, report};
use crate::camera::{Lens, Projection, Vec3};
use crate::image::Plane;
use crate::math::Rect;
use crate::mesh::GridMesh;
use crate::warp::{InverseMesh, Map};
use frame::Unframed;
pub(super) use solver::drawn_back;
use solver::{Sheet, SolveReport};
use sphere_grid::{SphereGrid, chart_for};
use straight::GridLine;
use weights::{CellWeights, FaceTarget};

/// What the output shall look like.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Target {
    /// The minimizer of the energy.
    #[default]
    Optimized,
    /// A projection with a formula.
    Fixed(Projection),
}

/// Where the viewer looks, relative to the camera.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct View {
    /// To the right, rad.
    pub yaw: f64,
    /// Up, rad.
    pub pitch: f64,
    /// Clockwise, rad.
    pub roll: f64,
}

impl View {
    /// Turns directions of the camera into directions of the view.
    pub fn view_from_camera(&self) -> Rotation3<f64> {
        let turned = |axis, angle| Rotation3::from_axis_angle(&axis, angle);
        let camera_from_view =
            turned(Vec3::y_axis(), self.yaw) * turned(Vec3::x_axis(), self.pitch) * turned(Vec3::z_axis(), self.roll);
        camera_from_view.inverse()
    }
}

/// How to rectify.
#[derive(Clone, Debug, PartialEq)]
pub struct RectifyOptions {
    /// What the output shall look like.
    pub target: Target,
    /// Where the viewer looks.
    pub view: View,
    /// How much the view shows; `None`: all that the picture has, as far as the projection can show it.
    pub window: Option<Window>,
    /// What is cut away.
    pub crop: Crop,
    /// How large the output is.
    pub size: OutputSize,
    /// Cells along the longer side of the grid, 4 to 512; even.
    pub cells: usize,
    /// What the energies weigh.
    pub weights: EnergyWeights,
}

impl Default for RectifyOptions {
    fn default() -> Self {
        Self {
            target: Target::default(),
            view: View::default(),
            window: None,
            crop: Crop::default(),
            size: OutputSize::default(),
            cells: 48,
            weights: EnergyWeights::default(),
        }
    }
}

/// What is known of the picture.
#[derive(Clone, Copy, Debug)]
pub struct RectifyInput<'a> {
    /// The lens, for the picture's size.
    pub lens: &'a Lens,
    /// Lines to make straight, source px.
    pub lines: &'a [Line],
    /// Faces to keep in shape, source px.
    pub faces: &'a [Rect],
    /// Where distortion would show, over the whole picture at any resolution, in [0, 1].
    pub salience: Option<&'a Plane<f32>>,
}

/// The warp that rectifies a picture.
///
/// # Errors
/// [`RectifyError`]: an option out of range, a view that shows nothing, an output without pixels.
pub fn rectify(input: &RectifyInput<'_>, options: &RectifyOptions) -> Result<PhotoWarp, RectifyError> {
    check(options)?;
    let (unframed, iterations) = match &options.target {
        Target::Optimized => optimized(input, options)?,
        Target::Fixed(projection) => (fixed::unframed(input.lens, projection, options)?, 0),
    };
    let mut warp = unframed.framed(input.lens, options)?;
    warp.iterations = iterations;
    warp.lines = input.lines.iter().map(|line| report::of_line(line, Some(input.lens), &warp)).collect();
    Ok(warp)
}

fn check(options: &RectifyOptions) -> Result<(), RectifyError> {
    if let OutputSize::Exact(w, h) = options.size {
        frame::check_size(w as f64, h as f64)?;
    }
    let aspect = if let Crop::Aspect(aspect) = options.crop { aspect } else { 1.0 };
    let w = &options.weights;
    let numbers = [
        ("cells", options.cells as f64, (4.0..=512.0).contains(&(options.cells as f64)), "4 to 512"),
        ("ratio of the crop", aspect, aspect > 0.0 && aspect.is_finite(), "above 0"),
        ("weight of conformality", w.conformality, w.conformality > 0.0 && w.conformality.is_finite(), "above 0"),
        ("smooth length", w.smooth_length, (0.0..=10.0).contains(&w.smooth_length), "0 to 10 rad"),
        ("weight of lines", w.straightness, (0.0..=1e8).contains(&w.straightness), "0 to 1e8"),
        ("weight of faces", w.faces, (0.0..=1e8).contains(&w.faces), "0 to 1e8"),
    ];
    match numbers.into_iter().find(|(_, _, valid, _)| !valid) {
        Some((name, value, _, range)) => Err(RectifyError::Option { name, value, range }),
        None => Ok(()),
    }
}

/// The minimizer of the energy, and the solves it took.
fn optimized(input: &RectifyInput<'_>, options: &RectifyOptions) -> Result<(Unframed, usize), RectifyError> {
    let lens = input.lens;
    let chart = chart_for(options.view.view_from_camera(), options.window);
    let coarse = SphereGrid::new(chart, lens, options.window, options.cells / 2).ok_or(RectifyError::EmptyView)?;
    let fine = coarse.refined(lens);
    let border = match options.crop {
        Crop::Auto | Crop::Aspect(_) => straight::sides(lens, &fine).is_some(),
        Crop::Rectangle | Crop::None => false,
    };
    let solved = |border: bool| {
        let (start, first) = solved(input, options, &coarse, border, None)?;
        let (sheet, last) = solved(input, options, &fine, border, Some(&start))?;
        Ok::<_, RectifyError>((sheet, first.iterations + last.iterations, last.folded))
    };
    let (mut sheet, mut iterations, folded) = solved(border)?;
    if border && folded {
        // The border cannot be had straight without harm.
        let (without, more, _) = solved(false)?;
        (sheet, iterations) = (without, iterations + more);
    }
    Ok((unframed(lens, fine, &sheet)?, iterations))
}

/// The sheet of the input's lines and faces, in the chart, with a straight border if wanted.
fn solved(
    input: &RectifyInput<'_>,
    options: &RectifyOptions,
    sphere: &SphereGrid,
    border: bool,
    start: Option<&GridMesh>,
) -> Result<(GridMesh, SolveReport), RectifyError> {
    let lens = input.lens;
    let mut lines = if border { straight::sides(lens, sphere).unwrap_or_default() } else { Vec::new() };
    let sides = lines.len();
    lines.extend(input.lines.iter().filter_map(|line| GridLine::new(line, lens, sphere)));
    let faces: Vec<FaceTarget> = input.faces.iter().filter_map(|f| FaceTarget::new(f, lens, sphere)).collect();
    let cell_weights = CellWeights::new(sphere, lens, &lines[sides..], input.faces, input.salience);
    Ok(Sheet::new(sphere, &lines, &faces, options.weights, &cell_weights)?.solve(start)?)
}

/// The warp of a solved sheet, in px at the density of the source.
fn unframed(lens: &Lens, sphere: SphereGrid, sheet: &GridMesh) -> Result<Unframed, RectifyError> {
    let focal = fixed::density(lens, sphere.chart.view_from_camera());
    let vertices = sheet.vertices.iter().map(|v| v * focal).collect();
    let mesh = GridMesh { cols: sheet.cols, rows: sheet.rows, vertices };
    let inverse = Map::Mesh(InverseMesh::new(&mesh, sphere.grid.width, sphere.grid.height)?);
    let maps = vec![inverse, Map::Radial(Box::new(sphere.source(lens)))];
    let (lens, forward_mesh) = (lens.clone(), mesh.clone());
    let forward = Box::new(move |p| Some(forward_mesh.at(sphere.locate(sphere.chart.at(&lens.unproject(p)?)?)?)));
    Ok(Unframed { maps, mesh, forward })
}

#[cfg(test)]
mod tests;
