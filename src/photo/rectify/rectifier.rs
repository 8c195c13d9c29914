//! A view whose lines may change: everything that does not depend on them is computed once.
//!
//! The initial guess of the first solve is the chart, on cells twice as large. A dragged line moves little between
//! solves: [`Rectifier::follow`] starts from the last solution on the full grid and keeps a free border free, and a straight
//! one straight unless it folds, so that the picture does not jump.

use super::attempt::{Attempt, Loss};
use super::frame::{Crop, OutputSize, Unframed};
use super::solver::{Folding, Sheet, halved};
use super::sphere_grid::{SphereGrid, chart_for};
use super::straight::{GridLine, sides};
use super::weights::{CellWeights, FaceTarget};
use super::{RectifyInput, RectifyOptions, SoftLine, check, check_count, empty_view, fixed};
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
    soft: Vec<SoftLine>,
    /// The lines were found.
    found: bool,
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
    attempt: Attempt,
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
        let soft = input.soft_lines.to_vec();
        let found = input.found;
        let mut rectifier = Self { lens, options, faces, soft, found, coarse, fine, sides, solved: None };
        run.check()?;
        rectifier.solve(input.lines, run)?;
        Ok(rectifier)
    }

    /// Solves for other lines from scratch: the result does not depend on earlier solves.
    ///
    /// # Errors
    /// [`PhotoError::Input`] for more lines than [`super::MAX_LINES`]; [`PhotoError::Energy`] for lines that are not finite;
    /// [`PhotoError::Interrupted`]; the last solution is kept.
    pub fn solve(&mut self, lines: &[Line], run: &Run) -> Result<(), PhotoError> {
        check_count(lines)?;
        let before = self.solved.take();
        let solved = self.best(lines, run);
        let (solved, error) = match solved {
            Ok(solved) => (Some(solved), None),
            Err(error) => (before, Some(error)),
        };
        self.solved = solved;
        error.map_or(Ok(()), Err)
    }

    /// The first solution whose crop loses nothing that matters, or the one that loses least.
    fn best(&mut self, lines: &[Line], run: &Run) -> Result<Solved, PhotoError> {
        let mut iterations = 0;
        let mut best: Option<(Loss, Solved)> = None;
        let yields = self.faces.is_empty() && !lines.is_empty();
        for attempt in Attempt::all(self.sides.is_some(), yields) {
            let Some(sheet) = self.solve_with(lines, attempt, &mut iterations, run)? else { continue };
            self.solved = Some(Solved { lines: self.asked(lines), sheet, attempt, iterations });
            // Without a crop, or with one that leaves no choice, nothing else is tried.
            let whole = attempt == Attempt::Straight || self.sides.is_none();
            let loss = if whole { None } else { Some(self.loss()).filter(|loss| !loss.is_none()) };
            let solved = self.solved.take().expect("set above");
            let Some(loss) = loss else { return Ok(Solved { iterations, ..solved }) };
            if best.as_ref().is_none_or(|(least, _)| loss.is_less_than(*least)) {
                best = Some((loss, solved));
            }
        }
        let (_, solved) = best.expect("a free border is always solved");
        Ok(Solved { iterations, ..solved })
    }

    /// Lines as they are reported on: of those that were found no orientation is asked.
    fn asked(&self, lines: &[Line]) -> Vec<Line> {
        lines.iter().map(|line| if self.found { line.free() } else { line.clone() }).collect()
    }

    fn loss(&self) -> Loss {
        let asked = matches!(self.options.crop, Crop::Aspect(_)) || matches!(self.options.size, OutputSize::Exact(..));
        self.warp().map_or(Loss::ALL, |warp| Loss::of(&warp, self.lens.size, asked))
    }

    /// Solves for lines that have moved little, starting from the last solution. A straight border becomes free where the grid would
    /// fold, and stays so until the next [`Self::solve`].
    ///
    /// # Errors
    /// As [`Self::solve`].
    pub fn follow(&mut self, lines: &[Line], run: &Run) -> Result<(), PhotoError> {
        let Some(solved) = &self.solved else { return self.solve(lines, run) };
        check_count(lines)?;
        let (before, mut attempt) = (solved.sheet.clone(), solved.attempt);
        let followed = |rectifier: &mut Self, attempt: Attempt| {
            let on_grid = rectifier.on_grid(lines, &rectifier.fine.sphere, 1, attempt);
            rectifier.fine.follow(&on_grid, &before, attempt.folding(), run)
        };
        let (mut sheet, mut report) = followed(self, attempt)?;
        if report.folded && attempt.folding() == Folding::Refused {
            attempt = Attempt::Free;
            (sheet, report) = followed(self, attempt)?;
        }
        self.solved = Some(Solved { lines: self.asked(lines), sheet, attempt, iterations: report.iterations });
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

    /// The sheet of an attempt; `None` where it folds and another remains.
    fn solve_with(
        &mut self,
        lines: &[Line],
        attempt: Attempt,
        iterations: &mut usize,
        run: &Run,
    ) -> Result<Option<GridMesh>, PhotoError> {
        let on_coarse = self.on_grid(lines, &self.coarse.sphere, 0, attempt);
        let on_fine = self.on_grid(lines, &self.fine.sphere, 1, attempt);
        let (initial, first) = self.coarse.solve(&on_coarse, None, Folding::Held, run)?;
        let (sheet, last) = self.fine.solve(&on_fine, Some(halved(&initial)), attempt.folding(), run)?;
        *iterations += first.iterations + last.iterations;
        Ok((attempt.folding() == Folding::Held || !last.folded).then_some(sheet))
    }

    /// Lines on a grid, the coarse or the fine one, preceded by the sides of the picture if they are to be straight, and followed by
    /// those that were found.
    fn on_grid(&self, lines: &[Line], sphere: &SphereGrid, grid: usize, attempt: Attempt) -> Vec<GridLine> {
        let given = lines.iter().flat_map(|line| {
            let (own, preferred) =
                if self.found { (&line.free(), GridLine::preferred(line, &self.lens, sphere)) } else { (line, None) };
            GridLine::new(own, &self.lens, sphere).into_iter().chain(preferred)
        });
        let found = self.soft.iter().filter_map(|line| GridLine::soft(line, &self.lens, sphere));
        let mut inner: Vec<GridLine> = given.chain(found).collect();
        attempt.weigh(&mut inner, &self.lens, sphere);
        let sides = self.sides.as_ref().zip(attempt.border()).into_iter();
        let sides = sides.flat_map(|(sides, weight)| sides[grid].iter().map(move |side| side.clone().weighted(weight)));
        sides.chain(inner).collect()
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
