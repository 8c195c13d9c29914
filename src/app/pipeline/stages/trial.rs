//! What a tier would make of a clip, measured before a picture is drawn: tracks are carried through the maps of the tier.
//!
//! With `q_k(t)` where the map of frame `t` shows track `k`, and `d_k = q_k(t+1) − 2 q_k(t) + q_k(t−1)`:
//!
//! ```text
//! a_t = median_k d_k                              acceleration of the whole picture
//! w_t² = mean over cells c of |median_{k ∈ c} d_k − a_t|²      wobble beside it: what neighbors do together, not their noise
//! A_t                                 affine map nearest to the grid's: anisotropy σ₂/σ₁
//! shake                               of the similarities from frame to frame of the q_k, as [`super::shake`] has it
//! ```

use std::collections::HashMap;
use std::ops::Range;

use super::analysis::{Tracks, store_error};
use super::maps::{Forward, Maps};
use super::sampling::Feed;
use super::shake::{Stray, shake, strays};
use super::tiers::Tiers;
use crate::pipeline::kinds::WarpSettings;
use crate::pipeline::run_error::RunError;
use plumbline_image::grid::Grid;
use plumbline_num::math::{Homography, Point2, Similarity2, Vec2};
use plumbline_video::motion::{self, ClipMotion, Pair};
use plumbline_video::track::Observation;

/// Cells of the grid on which tiers are tried: half as fine as the one that is drawn, for an eighth of its time.
const CELLS: (u32, u32) = (32, 18);
/// Columns and rows of the cells of the picture in which tracks are neighbors, and tracks that a cell needs.
const NEIGHBORHOODS: (usize, usize, usize) = (8, 6, 3);
/// Tracks by which a frame is judged, at least.
const LEAST_TRACKS: usize = 20;
/// Quantile of the anisotropy that is told.
const LOW: f64 = 0.05;

/// The clip as a tier would show it.
pub(super) struct Trial {
    frames: Vec<FrameTrial>,
    strays: Vec<Stray>,
}

#[derive(Clone, Copy, Default)]
struct FrameTrial {
    crop: f64,
    anisotropy: f64,
    folds: usize,
    /// Acceleration and wobble, px.
    second: Option<(f64, f64)>,
}

impl FrameTrial {
    fn of(map: &Forward, grid: &Grid, crop: f64) -> Self {
        let folds = if let Forward::Mesh(mesh) = map { mesh.folded_cells() } else { 0 };
        Self { crop, anisotropy: anisotropy(map, grid), folds, second: None }
    }
}

/// A range of frames as a tier would show it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct TrialFigures {
    /// Mean part of the picture's width that stays.
    pub(super) crop: f64,
    /// Shake, px.
    pub(super) shake_px: f64,
    /// RMS acceleration of the picture, px per frame².
    pub(super) acceleration_px: f64,
    /// RMS of what single tracks do beside it, px per frame².
    pub(super) wobble_px: f64,
    /// 5th percentile over the frames; 1 keeps angles.
    pub(super) anisotropy: f64,
    /// Cells that fold.
    pub(super) folds: usize,
}

impl Trial {
    /// Carries the tracks of `feed` through the maps that `tiers` mean.
    pub(super) fn run(feed: &Feed<'_>, tiers: &Tiers, motion: &ClipMotion, covered: bool) -> Result<Self, RunError> {
        let warp = WarpSettings { columns: CELLS.0, rows: CELLS.1, ..feed.warp.clone() };
        let mut maps = Maps::new(&Feed { warp: &warp, ..*feed }, tiers, covered)?;
        let grid = maps.grid();
        let mut frames: Vec<FrameTrial> = Vec::with_capacity(motion.frames.len());
        let mut steps = Vec::with_capacity(motion.frames.len());
        for shot in &motion.shots {
            let mut seen = Seen::new(grid);
            for index in shot.clone() {
                let map = maps.forward(None)?;
                let (step, second) = seen.push(shown(feed.tracks, index, &map, &grid)?);
                steps.push(step);
                if let Some(last) = frames.last_mut() {
                    last.second = second;
                }
                let crop = feed.path.crop.get(index).map_or(1.0, |c| c.min(1.0));
                frames.push(FrameTrial::of(&map, &grid, crop));
            }
        }
        let strays = strays(motion, |t| steps.get(t).copied().flatten());
        Ok(Self { frames, strays })
    }

    /// The figures of a range of frames; `None` where nothing could be measured in it.
    pub(super) fn over(&self, range: Range<usize>) -> Option<TrialFigures> {
        let frames = self.frames.get(range.clone())?;
        let second: Vec<(f64, f64)> = frames.iter().filter_map(|f| f.second).collect();
        let rms = |of: fn(&(f64, f64)) -> f64| {
            let sum: f64 = second.iter().map(|s| of(s).powi(2)).sum();
            (!second.is_empty()).then(|| (sum / second.len() as f64).sqrt())
        };
        let mut anisotropy: Vec<f64> = frames.iter().map(|f| f.anisotropy).collect();
        anisotropy.sort_by(f64::total_cmp);
        Some(TrialFigures {
            crop: frames.iter().map(|f| f.crop).sum::<f64>() / frames.len().max(1) as f64,
            shake_px: shake(self.strays.get(range)?)?.px,
            acceleration_px: rms(|s| s.0)?,
            wobble_px: rms(|s| s.1)?,
            anisotropy: *anisotropy.get((LOW * anisotropy.len() as f64) as usize)?,
            folds: frames.iter().map(|f| f.folds).sum(),
        })
    }
}

/// Where the map of a frame shows the tracks of the background.
fn shown(tracks: &Tracks, frame: usize, map: &Forward, grid: &Grid) -> Result<Vec<(u32, Point2)>, RunError> {
    let seen = tracks.store.read(frame).map_err(store_error)?.observations;
    let still = seen.iter().filter(|o| o.background);
    let place = |o: &Observation| Some((o.id, map.apply(grid, Point2::new(f64::from(o.x), f64::from(o.y)))?));
    Ok(still.filter_map(place).collect())
}

/// Tracks as the last two frames showed them.
struct Seen {
    cells: Grid,
    before: HashMap<u32, Point2>,
    last: HashMap<u32, Point2>,
}

impl Seen {
    fn new(picture: Grid) -> Self {
        let cells = Grid { cols: NEIGHBORHOODS.0, rows: NEIGHBORHOODS.1, ..picture };
        Self { cells, before: HashMap::new(), last: HashMap::new() }
    }

    /// Takes the next frame; returns the similarity that leads to it, and acceleration and wobble at the frame before it.
    fn push(&mut self, shown: Vec<(u32, Point2)>) -> (Option<Homography>, Option<(f64, f64)>) {
        let pair = |&(id, this): &(u32, Point2)| Some(Pair { previous: *self.last.get(&id)?, this });
        let pairs: Vec<Pair> = shown.iter().filter_map(pair).collect();
        let enough = pairs.len() >= LEAST_TRACKS;
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
        let whole = (all.len() >= LEAST_TRACKS).then(|| median(&all))?;
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
fn anisotropy(map: &Forward, grid: &Grid) -> f64 {
    let center = Point2::new(grid.width / 2.0, grid.height / 2.0);
    let (mut x, mut y) = (Vec2::zeros(), Vec2::zeros());
    for i in 0..grid.vertex_count() {
        let v = grid.vertex(i);
        let Some(q) = map.apply(grid, v) else { return 0.0 };
        // On a regular grid the regression over x and y falls apart into two.
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
    use plumbline_num::time::{Timebase, Timestamp};
    use plumbline_video::motion::{FrameMotion, MotionQuality};

    const PICTURE: Grid = Grid { cols: 32, rows: 18, width: 640.0, height: 360.0 };

    /// Points all over the picture, each moved by `by`.
    fn points(by: impl Fn(Point2) -> Vec2) -> Vec<(u32, Point2)> {
        let at = |k: u32| Point2::new(20.0 + 30.0 * f64::from(k % 21), 15.0 + 30.0 * f64::from(k / 21));
        (0..252).map(|k| (k, at(k) + by(at(k)))).collect()
    }

    /// Acceleration and wobble of three frames in which points move by `by(t, p)`.
    fn second(by: impl Fn(f64, Point2) -> Vec2) -> (f64, f64) {
        let mut seen = Seen::new(PICTURE);
        seen.push(points(|p| by(0.0, p)));
        seen.push(points(|p| by(1.0, p)));
        seen.push(points(|p| by(2.0, p))).1.expect("all points seen three times")
    }

    #[test]
    fn even_motion_neither_accelerates_nor_wobbles() {
        let (acceleration, wobble) = second(|t, p| Vec2::new(3.0, -1.0) * t + 0.01 * t * p.coords);
        assert!(acceleration < 1e-9 && wobble < 1e-9);
    }

    #[test]
    fn what_all_points_do_is_acceleration_and_what_a_corner_does_is_wobble() {
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
        assert!((anisotropy(&Forward::Mesh(squeezed), &PICTURE) - 0.9).abs() < 1e-12);
        let turned = plumbline_num::math::Similarity2::about(Point2::new(320.0, 180.0), 0.3, 1.2, Vec2::new(5.0, 2.0));
        assert!((anisotropy(&Forward::Plane(turned.to_homography()), &PICTURE) - 1.0).abs() < 1e-9);
    }

    #[test]
    fn the_figures_of_a_range_are_those_of_its_frames_alone() {
        let still = |t: i64| FrameMotion::still(Timestamp(t), MotionQuality::Measured);
        let motion = ClipMotion::new(640, 360, Timebase { num: 1, den: 30 }, (0..60).map(still).collect());
        // The last 30 frames jump to and fro by 4 px.
        let jump = |t: usize| if t < 31 { 0.0 } else { 4.0 * f64::from(2 * (t % 2) as u8) - 4.0 };
        let step = |t: usize| Some(Similarity2 { t: Vec2::new(jump(t), 0.0), ..Similarity2::IDENTITY }.to_homography());
        let frame = |t: usize| FrameTrial {
            crop: if t < 30 { 1.0 } else { 0.8 + 0.2 * (t % 2) as f64 },
            anisotropy: if t == 40 { 0.5 } else { 1.0 - 0.001 * t as f64 },
            folds: usize::from(t == 40),
            second: (t != 50).then_some(if t < 30 { (0.0, 0.0) } else { (3.0 * (t % 2) as f64, 1.0) }),
        };
        let trial = Trial { frames: (0..60).map(frame).collect(), strays: strays(&motion, step) };
        let calm = trial.over(0..25).expect("measured");
        assert_eq!((calm.crop, calm.acceleration_px, calm.wobble_px, calm.folds), (1.0, 0.0, 0.0, 0));
        let rough = trial.over(30..60).expect("measured");
        assert!((rough.crop - 0.9).abs() < 1e-12 && rough.folds == 1, "{rough:?}");
        // 15 of the 29 frames that were measured accelerate by 3 px; one frame in 30 is below the quantile.
        assert!((rough.acceleration_px - 3.0 * (15.0_f64 / 29.0).sqrt()).abs() < 1e-12 && rough.wobble_px == 1.0);
        assert!((rough.anisotropy - 0.941).abs() < 1e-12, "{}", rough.anisotropy);
        assert!((1.5..2.5).contains(&rough.shake_px), "{}", rough.shake_px);
        assert!(calm.shake_px < 0.6, "{}", calm.shake_px);
        assert!(trial.over(50..51).is_none() && trial.over(0..61).is_none(), "nothing measured, nothing said");
    }
}
