//! A view whose lines may change: everything that does not depend on them is computed once.
//!
//! The initial guess of the first solve is the chart, on cells twice as large. A dragged line moves little between
//! solves: [`Rectifier::follow`] starts from the last solution on the full grid and keeps a free border free, and a straight
//! one straight unless it folds, so that the picture does not jump.

use super::frame::{Crop, OutputSize, Unframed};
use super::solver::{Folding, Sheet, halved};
use super::sphere_grid::{SphereGrid, chart_for};
use super::straight::{GridLine, sides};
use super::weights::{CellWeights, FaceTarget};
use super::{RectifyInput, RectifyOptions, check, empty_view, fixed};
use crate::{Line, PhotoError, PhotoWarp, report};
use plumbline_camera::Lens;
use plumbline_image::grid::GridMesh;
use plumbline_image::warp::{InverseMesh, Map};
use plumbline_num::math::Rect;
use plumbline_num::run::Run;

/// Rectifies one view of a picture for varying lines.
#[derive(Debug)]
pub struct Rectifier {
    lens: Lens,
    options: RectifyOptions,
    faces: Vec<Rect>,
    coarse: Sheet,
    fine: Sheet,
    /// The sides of the picture on both grids, if the border may become straight.
    sides: Option<[Vec<GridLine>; 2]>,
    solved: Option<Solved>,
}

/// The last solution.
#[derive(Debug)]
struct Solved {
    lines: Vec<Line>,
    sheet: GridMesh,
    /// The border is straight.
    border: bool,
    iterations: usize,
}

impl Rectifier {
    /// The view of a picture; the lines of the input are the first ones.
    ///
    /// # Errors
    /// As [`super::rectify`].
    pub fn new(input: &RectifyInput<'_>, options: &RectifyOptions, run: &Run) -> Result<Self, PhotoError> {
        check(options)?;
        let lens = input.lens;
        let chart = chart_for(options.view.view_from_camera(), options.window);
        let coarse = SphereGrid::new(chart, lens, options.window, options.cells / 2).ok_or_else(empty_view)?;
        let fine = coarse.refined(lens);
        let sides = match options.crop {
            Crop::Auto | Crop::Aspect(_) => sides(lens, &coarse).zip(sides(lens, &fine)).map(<[_; 2]>::from),
            Crop::Rectangle | Crop::None => None,
        };
        let sheet = |sphere: SphereGrid| {
            let faces = input.faces.iter().filter_map(|f| FaceTarget::new(f, lens, &sphere)).collect();
            let base = CellWeights::new(&sphere, lens, input.faces, input.saliency);
            Sheet::new(sphere, faces, options.weights, base)
        };
        let (coarse, fine) = (sheet(coarse)?, sheet(fine)?);
        let (lens, options, faces) = (lens.clone(), options.clone(), input.faces.to_vec());
        let mut rectifier = Self { lens, options, faces, coarse, fine, sides, solved: None };
        run.check()?;
        rectifier.solve(input.lines, run)?;
        Ok(rectifier)
    }

    /// Solves for other lines from scratch: the result does not depend on earlier solves.
    ///
    /// # Errors
    /// [`PhotoError::Energy`] for lines that are not finite; [`PhotoError::Interrupted`]; the last solution is
    /// kept.
    pub fn solve(&mut self, lines: &[Line], run: &Run) -> Result<(), PhotoError> {
        let mut iterations = 0;
        let mut found = None;
        if self.sides.is_some() {
            found = self.solve_with(lines, true, &mut iterations, run)?;
        }
        let border = found.is_some();
        let sheet = match found {
            Some(sheet) => sheet,
            // The straight border folds: solve with a free one.
            None => self.solve_with(lines, false, &mut iterations, run)?.expect("folds are held"),
        };
        self.solved = Some(Solved { lines: lines.to_vec(), sheet, border, iterations });
        Ok(())
    }

    /// Solves for lines that have moved little, starting from the last solution. A straight border becomes free where the grid would
    /// fold, and stays so until the next [`Self::solve`].
    ///
    /// # Errors
    /// As [`Self::solve`].
    pub fn follow(&mut self, lines: &[Line], run: &Run) -> Result<(), PhotoError> {
        let Some(solved) = &self.solved else { return self.solve(lines, run) };
        let (before, mut border) = (solved.sheet.clone(), solved.border);
        let followed = |rectifier: &mut Self, border: bool| {
            let on_grid = rectifier.on_grid(lines, &rectifier.fine.sphere, border.then_some(1));
            rectifier.fine.follow(&on_grid, &before, folding(border), run)
        };
        let (mut sheet, mut report) = followed(self, border)?;
        if border && report.folded {
            border = false;
            (sheet, report) = followed(self, border)?;
        }
        self.solved = Some(Solved { lines: lines.to_vec(), sheet, border, iterations: report.iterations });
        Ok(())
    }

    /// The solved grid, in radians at the center of the view.
    pub fn sheet(&self) -> &GridMesh {
        &self.solved().sheet
    }

    /// The warp of the last solve.
    ///
    /// # Errors
    /// [`PhotoError::Output`] where nothing is left of the picture, or an output would have no pixels, or too many.
    pub fn warp(&self) -> Result<PhotoWarp, PhotoError> {
        let frame = self.frame()?;
        self.warp_in(&frame)
    }

    /// The rectangle that [`Self::warp`] shows of the plane in which the picture was solved, px at the density of the source. The
    /// search takes longer than the warp itself.
    ///
    /// # Errors
    /// [`PhotoError::Output`] where nothing is left of the picture.
    pub fn frame(&self) -> Result<Rect, PhotoError> {
        self.unframed()?.frame(&self.lens, &self.faces, &self.options)
    }

    /// The warp of the last solve in a given rectangle of the plane: of an earlier solve, so that a picture whose lines are
    /// dragged neither jumps nor waits for the search.
    ///
    /// # Errors
    /// [`PhotoError::Output`] where an output would have no pixels, or too many.
    pub fn warp_in(&self, frame: &Rect) -> Result<PhotoWarp, PhotoError> {
        let solved = self.solved();
        let mut warp = self.unframed()?.in_frame(*frame, &self.lens, &self.faces, &self.options)?;
        warp.iterations = solved.iterations;
        warp.lines = solved.lines.iter().map(|line| report::of_line(line, Some(&self.lens), &warp)).collect();
        Ok(warp)
    }

    /// Changes crop and size of the output without solving; [`Self::warp`] returns the new warp. A change from a free
    /// to a straight border takes effect with the next [`Self::solve`].
    ///
    /// # Errors
    /// [`PhotoError::Option`], [`PhotoError::Output`].
    pub fn set_frame(&mut self, crop: Crop, size: OutputSize) -> Result<(), PhotoError> {
        let options = RectifyOptions { crop, size, ..self.options.clone() };
        check(&options)?;
        self.options = options;
        Ok(())
    }

    fn solved(&self) -> &Solved {
        self.solved.as_ref().expect("solved when made")
    }

    /// The sheet with a straight border or without; `None` where the straight one folds.
    fn solve_with(
        &mut self,
        lines: &[Line],
        border: bool,
        iterations: &mut usize,
        run: &Run,
    ) -> Result<Option<GridMesh>, PhotoError> {
        let on_coarse = self.on_grid(lines, &self.coarse.sphere, border.then_some(0));
        let on_fine = self.on_grid(lines, &self.fine.sphere, border.then_some(1));
        let (initial, first) = self.coarse.solve(&on_coarse, None, Folding::Held, run)?;
        let (sheet, last) = self.fine.solve(&on_fine, Some(halved(&initial)), folding(border), run)?;
        *iterations += first.iterations + last.iterations;
        Ok((!border || !last.folded).then_some(sheet))
    }

    /// Lines on a grid, preceded by the sides of the picture if they are to be straight.
    fn on_grid(&self, lines: &[Line], sphere: &SphereGrid, sides: Option<usize>) -> Vec<GridLine> {
        let mut all = sides.and_then(|k| Some(self.sides.as_ref()?[k].clone())).unwrap_or_default();
        all.extend(lines.iter().filter_map(|line| GridLine::new(line, &self.lens, sphere)));
        all
    }

    /// The warp of the solved sheet, in px at the density of the source.
    fn unframed(&self) -> Result<Unframed, PhotoError> {
        let (sphere, sheet) = (self.fine.sphere.clone(), self.sheet());
        let focal = fixed::density(&self.lens, sphere.chart.view_from_camera());
        let vertices = sheet.vertices.iter().map(|v| v * focal).collect();
        let mesh = GridMesh { cols: sheet.cols, rows: sheet.rows, vertices };
        let inverse = Map::Mesh(InverseMesh::new(&mesh, sphere.grid.width, sphere.grid.height)?);
        let maps = vec![inverse, Map::Radial(Box::new(sphere.source(&self.lens)))];
        let (lens, forward_mesh) = (self.lens.clone(), mesh.clone());
        let forward = Box::new(move |p| Some(forward_mesh.at(sphere.locate(sphere.chart.at(&lens.unproject(p)?)?)?)));
        Ok(Unframed { maps, mesh, forward })
    }
}

/// A straight border that folds is given up; a free one is the last resort.
fn folding(border: bool) -> Folding {
    if border { Folding::Refused } else { Folding::Held }
}
