//! Evaluation of a motion model on a clip before any frame is rendered: the tracks are mapped by its maps.
//!
//! With `q_k(t)` where the map of frame `t` shows track `k`, and `d_k = q_k(t+1) − 2 q_k(t) + q_k(t−1)`:
//!
//! ```text
//! a_t = median_k d_k                              acceleration of the whole picture
//! w_t² = mean over cells c of |median_{k ∈ c} d_k − a_t|²      wobble beside it: common motion of neighbors, not their noise
//! A_t                                 affine map nearest to the grid's: anisotropy σ₂/σ₁
//! shake                               of the similarities from frame to frame of the q_k, as [`super::shake`] has it
//! ```

use std::collections::HashMap;
use std::ops::Range;

use super::error::StabilizeError;
use super::frame_maps::{ForwardMap, FrameMaps, RenderInputs};
use super::frame_models::FrameModels;
use super::options::WarpOptions;
use super::shake::{PathDeviation, path_deviations, shake};
use super::tracks::Tracks;
use crate::motion::{self, ClipMotion, MotionModel, Pair};
use crate::track::Observation;
use plumbline_image::grid::Grid;
use plumbline_num::math::{Homography, Point2, Similarity2, Vec2};
use plumbline_num::run::Run;

/// Cells of the grid on which models are evaluated: half as fine as the default of rendering, for an eighth of its time.
const CELLS: (u32, u32) = (32, 18);
/// Columns and rows of the cells of the picture in which tracks are neighbors, and tracks that a cell needs: a median of three is
/// the least that a single outlier cannot move.
const NEIGHBORHOODS: (usize, usize, usize) = (8, 6, 3);
/// Least number of tracks by which a frame is measured: with fewer their noise dominates.
const MIN_TRACKS: usize = 20;
/// Quantile of the anisotropy over the frames: the worst frames count, a single one does not.
const ANISOTROPY_QUANTILE: f64 = 0.05;

/// A motion model that was evaluated on a segment.
#[derive(Clone, Debug, PartialEq)]
pub struct EvaluatedModel {
    /// Frames of the segment.
    pub frames: Range<usize>,
    /// The model.
    pub model: MotionModel,
    /// Its figures on the segment.
    pub figures: ModelFigures,
}

/// A clip under a motion model.
pub(super) struct ModelEvaluation {
    frames: Vec<FrameFigures>,
    deviations: Vec<PathDeviation>,
}

#[derive(Clone, Copy, Default)]
struct FrameFigures {
    crop: f64,
    anisotropy: f64,
    folds: usize,
    /// Acceleration and wobble, px.
    second: Option<(f64, f64)>,
}

impl FrameFigures {
    fn of(map: &ForwardMap, grid: &Grid, crop: f64) -> Self {
        let folds = if let ForwardMap::Mesh(mesh) = map { mesh.folded_cells() } else { 0 };
        Self { crop, anisotropy: anisotropy(map, grid), folds, second: None }
    }
}

/// Figures of a range of frames under a motion model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ModelFigures {
    /// Mean fraction of the picture's width that is kept.
    pub crop: f64,
    /// Shake, px.
    pub shake_px: f64,
    /// RMS acceleration of the picture, px per frame².
    pub acceleration_px: f64,
    /// RMS acceleration of parts of the picture relative to it, px per frame².
    pub wobble_px: f64,
    /// 5th percentile over the frames of the ratio of the map's singular values, in [0, 1]; 1 keeps angles.
    pub anisotropy: f64,
    /// Cells that fold, in all frames together.
    pub folds: usize,
}

impl ModelEvaluation {
    /// Carries the tracks of `inputs` through the maps of `models`.
    pub(super) fn new(
        inputs: &RenderInputs<'_>,
        models: &FrameModels,
        motion: &ClipMotion,
        run: &Run,
    ) -> Result<Self, StabilizeError> {
        let warp = WarpOptions { columns: CELLS.0, rows: CELLS.1, ..inputs.warp.clone() };
        let mut maps = FrameMaps::new(&RenderInputs { warp: &warp, ..*inputs }, models)?;
        let grid = maps.grid();
        let mut frames: Vec<FrameFigures> = Vec::with_capacity(motion.frames.len());
        let mut steps = Vec::with_capacity(motion.frames.len());
        for shot in &motion.shots {
            let mut seen = TrackWindow::new(grid);
            for index in shot.clone() {
                run.check()?;
                let map = maps.forward(None)?;
                let (step, second) = seen.push(shown(inputs.tracks, index, &map, &grid)?);
                steps.push(step);
                if let Some(last) = frames.last_mut() {
                    last.second = second;
                }
                let crop = inputs.path.crop.get(index).map_or(1.0, |c| c.min(1.0));
                frames.push(FrameFigures::of(&map, &grid, crop));
            }
        }
        let deviations = path_deviations(motion, |t| steps.get(t).copied().flatten());
        Ok(Self { frames, deviations })
    }

    /// The figures of a range of frames; `None` where nothing could be measured in it.
    pub(super) fn over(&self, range: Range<usize>) -> Option<ModelFigures> {
        let frames = self.frames.get(range.clone())?;
        let second: Vec<(f64, f64)> = frames.iter().filter_map(|f| f.second).collect();
        let rms = |of: fn(&(f64, f64)) -> f64| {
            let sum: f64 = second.iter().map(|s| of(s).powi(2)).sum();
            (!second.is_empty()).then(|| (sum / second.len() as f64).sqrt())
        };
        let mut anisotropy: Vec<f64> = frames.iter().map(|f| f.anisotropy).collect();
        anisotropy.sort_by(f64::total_cmp);
        Some(ModelFigures {
            crop: frames.iter().map(|f| f.crop).sum::<f64>() / frames.len().max(1) as f64,
            shake_px: shake(self.deviations.get(range)?)?.px,
            acceleration_px: rms(|s| s.0)?,
            wobble_px: rms(|s| s.1)?,
            anisotropy: *anisotropy.get((ANISOTROPY_QUANTILE * anisotropy.len() as f64) as usize)?,
            folds: frames.iter().map(|f| f.folds).sum(),
        })
    }
}

/// Output positions of the background tracks of a frame.
fn shown(tracks: &Tracks, frame: usize, map: &ForwardMap, grid: &Grid) -> Result<Vec<(u32, Point2)>, StabilizeError> {
    let seen = tracks.store.read(frame)?.observations;
    let background = seen.iter().filter(|o| o.background);
    let position = |o: &Observation| Some((o.id, map.apply(grid, Point2::new(f64::from(o.x), f64::from(o.y)))?));
    Ok(background.filter_map(position).collect())
}

/// Positions of the tracks in the last two frames.
struct TrackWindow {
    cells: Grid,
    before: HashMap<u32, Point2>,
    last: HashMap<u32, Point2>,
}

impl TrackWindow {
    fn new(picture: Grid) -> Self {
        let cells = Grid { cols: NEIGHBORHOODS.0, rows: NEIGHBORHOODS.1, ..picture };
        Self { cells, before: HashMap::new(), last: HashMap::new() }
    }

    /// Takes the next frame; returns the similarity that leads to it, and acceleration and wobble at the frame before it.
    fn push(&mut self, shown: Vec<(u32, Point2)>) -> (Option<Homography>, Option<(f64, f64)>) {
        let pair = |&(id, this): &(u32, Point2)| Some(Pair { previous: *self.last.get(&id)?, this });
        let pairs: Vec<Pair> = shown.iter().filter_map(pair).collect();
        let enough = pairs.len() >= MIN_TRACKS;
        let step = enough.then(|| motion::similarity(&pairs, &vec![1.0; pairs.len()])).flatten();
        let second = self.second(&shown);
        self.before = std::mem::replace(&mut self.last, shown.into_iter().collect());
        (step.map(Similarity2::to_homography), second)
    }

    fn second(&self, shown: &[(u32, Point2)]) -> Option<(f64, f64)> {
        let mut all = Vec::new();
        let mut by_cell = vec![Vec::new(); self.cells.cell_count()];
        for (id, now) in shown {
            let Some((last, before)) = self.last.get(id).zip(self.before.get(id)) else { continue };
            let d = (now - last) - (last - before);
            all.push(d);
            if let Some(at) = self.cells.locate(*last) {
                by_cell[at.cell].push(d);
            }
        }
        let whole = (all.len() >= MIN_TRACKS).then(|| median(&all))?;
        let local: Vec<f64> = (by_cell.iter())
            .filter(|vectors| vectors.len() >= NEIGHBORHOODS.2)
            .map(|vectors| (median(vectors) - whole).norm_squared())
            .collect();
        let mean = local.iter().sum::<f64>() / local.len() as f64;
        (!local.is_empty()).then(|| (whole.norm(), mean.sqrt()))
    }
}

/// The vector of the medians.
fn median(vectors: &[Vec2]) -> Vec2 {
    let of = |axis: usize| {
        let mut values: Vec<f64> = vectors.iter().map(|v| v[axis]).collect();
        let middle = values.len() / 2;
        *values.select_nth_unstable_by(middle, f64::total_cmp).1
    };
    Vec2::new(of(0), of(1))
}

/// Ratio of the singular values of the affine map nearest to a frame's.
fn anisotropy(map: &ForwardMap, grid: &Grid) -> f64 {
    let center = Point2::new(grid.width / 2.0, grid.height / 2.0);
    let (mut x, mut y) = (Vec2::zeros(), Vec2::zeros());
    for i in 0..grid.vertex_count() {
        let v = grid.vertex(i);
        let Some(q) = map.apply(grid, v) else { return 0.0 };
        // On a regular grid the regression over x and y separates into two.
        x += q.coords * ((v.x - center.x) / grid.width.powi(2));
        y += q.coords * ((v.y - center.y) / grid.height.powi(2));
    }
    let (cols, rows) = (grid.cols as f64, grid.rows as f64);
    // Sums of ((v − c) / extent)² over the vertices of a row and of a column.
    let (square_x, square_y) = ((cols + 2.0) / (12.0 * cols), (rows + 2.0) / (12.0 * rows));
    let a = nalgebra::Matrix2::from_columns(&[x / square_x, y / square_y]);
    let singular = a.singular_values();
    if singular[0] > 0.0 { singular[1] / singular[0] } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::{FrameMotion, MotionQuality};
    use plumbline_num::time::{Timebase, Timestamp};

    const PICTURE: Grid = Grid { cols: 32, rows: 18, width: 640.0, height: 360.0 };

    /// Points all over the picture, each moved by `by`.
    fn points(by: impl Fn(Point2) -> Vec2) -> Vec<(u32, Point2)> {
        let at = |k: u32| Point2::new(20.0 + 30.0 * f64::from(k % 21), 15.0 + 30.0 * f64::from(k / 21));
        (0..252).map(|k| (k, at(k) + by(at(k)))).collect()
    }

    /// Acceleration and wobble of three frames in which points move by `by(t, p)`.
    fn second(by: impl Fn(f64, Point2) -> Vec2) -> (f64, f64) {
        let mut seen = TrackWindow::new(PICTURE);
        seen.push(points(|p| by(0.0, p)));
        seen.push(points(|p| by(1.0, p)));
        seen.push(points(|p| by(2.0, p))).1.expect("all points seen three times")
    }

    #[test]
    fn constant_velocity_has_no_acceleration_and_no_wobble() {
        let (acceleration, wobble) = second(|t, p| Vec2::new(3.0, -1.0) * t + 0.01 * t * p.coords);
        assert!(acceleration < 1e-9 && wobble < 1e-9);
    }

    #[test]
    fn common_motion_is_acceleration_and_local_motion_is_wobble() {
        let (acceleration, wobble) = second(|t, _| Vec2::new(0.5 * t * t, 0.0));
        assert!((acceleration - 1.0).abs() < 1e-9 && wobble < 1e-9);
        let corner = |p: Point2| if p.x < 160.0 && p.y < 120.0 { 1.0 } else { 0.0 };
        let (acceleration, wobble) = second(|t, p| Vec2::new(0.5 * t * t * corner(p), 0.0));
        assert!(acceleration < 1e-9 && wobble > 0.2, "{wobble}");
    }

    #[test]
    fn noise_of_single_tracks_is_no_wobble() {
        let mut random = fastrand::Rng::with_seed(3);
        let noise: Vec<f64> = (0..800).map(|_| random.f64() - 0.5).collect();
        let at = |t: f64, p: Point2| noise[(t * 252.0 + (p.x + 7.0 * p.y)) as usize % noise.len()];
        let (_, wobble) = second(|t, p| Vec2::new(at(t, p), 0.0));
        let alone = 6.0_f64.sqrt() / 12.0_f64.sqrt();
        assert!(wobble < 0.7 * alone, "{wobble} of {alone}");
    }

    #[test]
    fn the_anisotropy_of_a_map_is_the_ratio_of_its_singular_values() {
        let mut squeezed = PICTURE.to_mesh();
        squeezed.vertices.iter_mut().for_each(|v| v.y *= 0.9);
        assert!((anisotropy(&ForwardMap::Mesh(squeezed), &PICTURE) - 0.9).abs() < 1e-12);
        let rotated = plumbline_num::math::Similarity2::about(Point2::new(320.0, 180.0), 0.3, 1.2, Vec2::new(5.0, 2.0));
        assert!((anisotropy(&ForwardMap::Plane(rotated.to_homography()), &PICTURE) - 1.0).abs() < 1e-9);
    }

    #[test]
    fn the_figures_of_a_range_are_those_of_its_frames_alone() {
        let still = |t: i64| FrameMotion::still(Timestamp(t), MotionQuality::Measured);
        let motion = ClipMotion::new(640, 360, Timebase { num: 1, den: 30 }, (0..60).map(still).collect());
        // The last 30 frames jump to and fro by 4 px.
        let jump = |t: usize| if t < 31 { 0.0 } else { 4.0 * f64::from(2 * (t % 2) as u8) - 4.0 };
        let step = |t: usize| Some(Similarity2 { t: Vec2::new(jump(t), 0.0), ..Similarity2::IDENTITY }.to_homography());
        let frame = |t: usize| FrameFigures {
            crop: if t < 30 { 1.0 } else { 0.8 + 0.2 * (t % 2) as f64 },
            anisotropy: if t == 40 { 0.5 } else { 1.0 - 0.001 * t as f64 },
            folds: usize::from(t == 40),
            second: (t != 50).then_some(if t < 30 { (0.0, 0.0) } else { (3.0 * (t % 2) as f64, 1.0) }),
        };
        let evaluation =
            ModelEvaluation { frames: (0..60).map(frame).collect(), deviations: path_deviations(&motion, step) };
        let calm = evaluation.over(0..25).expect("measured");
        assert_eq!((calm.crop, calm.acceleration_px, calm.wobble_px, calm.folds), (1.0, 0.0, 0.0, 0));
        let rough = evaluation.over(30..60).expect("measured");
        assert!((rough.crop - 0.9).abs() < 1e-12 && rough.folds == 1, "{rough:?}");
        // 15 of the 29 frames that were measured accelerate by 3 px; one frame in 30 is below the quantile.
        assert!((rough.acceleration_px - 3.0 * (15.0_f64 / 29.0).sqrt()).abs() < 1e-12 && rough.wobble_px == 1.0);
        assert!((rough.anisotropy - 0.941).abs() < 1e-12, "{}", rough.anisotropy);
        assert!((1.5..2.5).contains(&rough.shake_px), "{}", rough.shake_px);
        assert!(calm.shake_px < 0.6, "{}", calm.shake_px);
        assert!(
            evaluation.over(50..51).is_none() && evaluation.over(0..61).is_none(),
            "nothing measured, nothing said"
        );
    }
}
