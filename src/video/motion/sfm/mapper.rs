//! Incremental mapping: from an initial pair with parallax, keyframe by keyframe, to the cameras of a whole shot.
//!
//! A keyframe adjacent to the map is registered by *resection*: its pose is predicted from the motion of its neighbors
//! and then optimized on the points it observes. New points are triangulated, the newest cameras adjusted (local
//! bundle adjustment), and the whole map whenever it has grown by a third (global bundle adjustment). The focal length
//! is fixed until the map has enough baseline ([`FREED`] keyframes): with two or three views it diverges. Points with
//! too large a fraction of outlier observations are not part of the static scene and are removed.

use super::absolute_pose::absolute_pose;
use super::bundle::{BundleError, BundleOptions, BundleReport, Freedom, RobustFit, adjust, refine_points, residuals};
use super::sample::Sample;
use super::three_point::PointRay;
use super::triangulate::{View, triangulate};
use super::{Observation, Scene, ScenePoint, TrackTable};
use plumbline_camera::{CameraPose, Intrinsics, Point3};
use plumbline_num::energy::Loss;
use plumbline_num::math::{Vec2, median};
use plumbline_num::optim::levenberg_marquardt::DampingOptions;
use plumbline_num::optim::ransac::MsacOptions;
use plumbline_num::run::{Run, Stopped};

/// Number of keyframes from which on focal length and distortion are free: with two or three views the focal length
/// diverges.
const FREED: usize = 8;
/// Number of newest keyframes in the local adjustment after each registration. Without a local adjustment one synthetic shot
/// (`m02`) loses its 22 frames with cameras (`docs/ABLATIONS.md`).
const LOCAL: usize = 5;
/// Growth factor of the map, by a third, that triggers a global adjustment: all of them together cost four times the last
/// one (geometric series).
const GROWTH: f64 = 1.34;
/// Minimum number of inlier points of a registration: 40 equations for six unknowns, from which the noise is known to an
/// eighth (1/√68).
pub(super) const MIN_INLIERS: usize = 20;
/// Minimum number of points of a frame and of a pair of frames: half of them are enough for a registration.
pub(super) const MIN_POINTS: usize = 2 * MIN_INLIERS;
/// Minimum fraction of inliers among the known points that a frame observes: at this fraction 6 % of the samples of three
/// are all inliers, so that 500 samples contain one.
const MIN_SUPPORT: f64 = 0.4;
/// Fraction of inliers from which on the pose near the predicted one is accepted without a robust search: no other
/// pose can have as many.
const CLEAR_SUPPORT: f64 = 0.8;
/// Reprojection error, px at 640 px across, above which an observation is an outlier: six standard deviations, which noise
/// exceeds once in 7·10⁷.
pub(super) const WRONG_PX: f64 = 6.0 * SIGMA_PX;
/// Standard deviation of an observation in x and in y, px at 640 px across: trackers reach 0.1 to 0.5.
const SIGMA_PX: f64 = 0.5;
/// Fraction of outlier observations above which a point is not static. Of static points with ten observations, a tenth of
/// them wrong, 1.3 % are removed.
const MAX_OUTLIER_RATIO: f64 = 0.3;
/// Minimum inverse depth in resection, relative to the median: points farther away are used at this depth. Over a baseline
/// as long as the median depth they move by 0.6 px (f = 600 px), the noise of tracks.
const MIN_INVERSE_DEPTH: f64 = 1e-3;

/// Relative cost decrease below which the solver stops while the map grows: later adjustments recover the remainder.
const GROWING: f64 = 1e-3;
/// The same for a complete map.
pub(super) const GROWN: f64 = 1e-4;

/// Prior on the lens.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct LensPrior {
    /// Standard deviation of `ln f`.
    pub(super) sigma_ln_focal: f64,
    /// Standard deviation of `k₁` about 0.
    pub(super) sigma_k1: f64,
}

/// Free parameters and tolerance of a final adjustment.
#[derive(Clone, Copy, Debug)]
pub(super) struct Last {
    /// Estimate the readout time.
    pub(super) rolling: bool,
    /// Rotations only, no translations.
    pub(super) rotation_only: bool,
    /// Compute the standard deviation of the focal length.
    pub(super) uncertainty: bool,
    pub(super) iterations: usize,
    pub(super) tolerance: f64,
}

impl Last {
    /// Tolerance sufficient to separate outliers from inliers.
    pub(super) const ROUGH: Self =
        Self { rolling: false, rotation_only: false, uncertainty: false, iterations: 8, tolerance: 1e-3 };
    /// Final tolerance: further steps stay within the standard deviations of the parameters.
    pub(super) const FINE: Self =
        Self { rolling: false, rotation_only: false, uncertainty: true, iterations: 40, tolerance: 3e-5 };
}

/// A growing map.
#[derive(Clone)]
pub(super) struct Mapper<'a> {
    table: &'a TrackTable,
    lens: LensPrior,
    start: Intrinsics,
    /// Frames that can be registered, ascending.
    frames: Vec<usize>,
    /// Their observations.
    observations: Vec<Observation>,
    /// By point: found not to be static.
    banned: Vec<bool>,
    pub(super) scene: Scene,
    run: &'a Run,
}

impl<'a> Mapper<'a> {
    /// An empty map over the keyframes `frames`.
    pub(super) fn new(
        table: &'a TrackTable,
        frames: &[usize],
        camera: Intrinsics,
        lens: LensPrior,
        run: &'a Run,
    ) -> Self {
        let scene = Scene::unknown(table, camera);
        let banned = vec![false; table.points()];
        let mut mapper =
            Self { table, lens, start: camera, frames: Vec::new(), observations: Vec::new(), banned, scene, run };
        mapper.admit(frames);
        mapper
    }

    /// Adds frames to those that can be registered.
    pub(super) fn admit(&mut self, frames: &[usize]) {
        self.frames = frames.to_vec();
        self.observations = frames.iter().flat_map(|&f| self.table.in_frame(f).iter().copied()).collect();
    }

    /// Initializes the map from two frames with a known relative pose; false if they do not support a map.
    pub(super) fn seed(&mut self, first: usize, second: usize, second_from_first: CameraPose) -> Result<bool, Stopped> {
        self.scene.poses[first] = Some(CameraPose::identity());
        self.scene.poses[second] = Some(second_from_first);
        self.triangulate_new()?;
        Ok(self.adjust_all(false, GROWING)?.is_some() && self.known_points() >= MIN_INLIERS)
    }

    /// Registers keyframes outward from the known ones until no further one can be registered.
    pub(super) fn extend(&mut self) -> Result<(), Stopped> {
        let mut adjusted = self.registered().len();
        let (mut blocked_below, mut blocked_above) = (false, false);
        loop {
            let known = self.registered();
            let Some((&low, &high)) = known.first().zip(known.last()) else { return Ok(()) };
            let below = self.frames.iter().rev().find(|&&f| f < low).copied().filter(|_| !blocked_below);
            let above = self.frames.iter().find(|&&f| f > high).copied().filter(|_| !blocked_above);
            let Some(frame) = nearer(below, above, low, high).or_else(|| self.gap(&known)) else { break };
            if !self.register(frame)? {
                blocked_below |= frame < low;
                blocked_above |= frame > high;
                if frame > low && frame < high {
                    self.frames.retain(|&f| f != frame);
                }
                continue;
            }
            self.triangulate_new()?;
            let count = known.len() + 1;
            if count as f64 >= GROWTH * adjusted as f64 {
                self.adjust_all(count >= FREED, GROWING)?;
                self.discard_wrong();
                adjusted = count;
            } else {
                self.adjust_around(frame)?;
            }
        }
        self.adjust_all(self.registered().len() >= FREED, GROWN)?;
        self.discard_wrong();
        Ok(())
    }

    /// An unknown frame between known ones.
    fn gap(&self, known: &[usize]) -> Option<usize> {
        self.frames
            .iter()
            .copied()
            .find(|f| known.binary_search(f).is_err() && *f > known[0] && *f < known[known.len() - 1])
    }

    /// Frames with a pose, ascending.
    pub(super) fn registered(&self) -> Vec<usize> {
        self.frames.iter().copied().filter(|&f| self.scene.poses[f].is_some()).collect()
    }

    /// Whether a point was found not to be static.
    pub(super) fn is_banned(&self, point: usize) -> bool {
        self.banned[point]
    }

    fn known_points(&self) -> usize {
        self.scene.points.iter().flatten().count()
    }

    /// Estimates the pose of a frame from the known points it observes; false if they do not agree on one.
    pub(super) fn register(&mut self, frame: usize) -> Result<bool, Stopped> {
        let points = self.point_rays(frame);
        if points.len() < MIN_INLIERS {
            return Ok(false);
        }
        let threshold = 2.0 * WRONG_PX * self.table.unit_px() / self.scene.intrinsics.focal;
        let options = MsacOptions { threshold, min_samples: 20, max_samples: 500, local_steps: 3 };
        let predicted = self.predicted(frame);
        let near = MsacOptions { max_samples: 0, ..options };
        let mut found =
            absolute_pose(&points, &near, predicted, frame as u64, self.run)?.filter(|s| s.support >= CLEAR_SUPPORT);
        if found.is_none() {
            found = absolute_pose(&points, &options, predicted, frame as u64, self.run)?;
        }
        let Some(found) = found.filter(|s| s.support >= MIN_SUPPORT) else { return Ok(false) };
        if found.support * (points.len() as f64) < MIN_INLIERS as f64 {
            return Ok(false);
        }
        self.scene.poses[frame] = Some(found.model);
        Ok(true)
    }

    /// 2D–3D correspondences of a frame with the known points.
    fn point_rays(&self, frame: usize) -> Vec<PointRay> {
        let nearest = self.farthest_inverse_depth();
        let point_ray = |o: &Observation| {
            let point = self.scene.points[o.point as usize]?;
            let anchor = self.scene.poses[point.anchor as usize]?;
            let depth = 1.0 / point.inverse_depth.max(nearest);
            let position = anchor.inverse().apply(&Point3::from(point.direction() * depth));
            Some(PointRay { point: position, ray: self.scene.intrinsics.undistorted(o.pixel)? })
        };
        self.table.in_frame(frame).iter().filter_map(point_ray).collect()
    }

    fn farthest_inverse_depth(&self) -> f64 {
        let mut depths: Vec<f64> =
            self.scene.points.iter().flatten().map(|p| p.inverse_depth).filter(|w| *w > 0.0).collect();
        median(&mut depths).map_or(1.0, |depth| MIN_INVERSE_DEPTH * depth)
    }

    /// Predicted pose at `frame`: interpolated between known neighbors, or extrapolated from the last motion.
    fn predicted(&self, frame: usize) -> Option<CameraPose> {
        let known = |f: &usize| self.scene.poses[*f].is_some();
        let before = (0..frame).rev().find(known);
        let after = (frame + 1..self.scene.poses.len()).find(known);
        let (a, b) = match (before, after) {
            (Some(a), Some(b)) => (a, b),
            (Some(a), None) => (a, (0..a).rev().find(known)?),
            (None, Some(b)) => (b, (b + 1..self.scene.poses.len()).find(known)?),
            (None, None) => return None,
        };
        let (pose_a, pose_b) = (self.scene.poses[a]?, self.scene.poses[b]?);
        let fraction = (frame as f64 - a as f64) / (b as f64 - a as f64);
        Some(pose_a.toward(&pose_b, fraction))
    }

    /// Triangulates every point observed by enough known frames.
    pub(super) fn triangulate_new(&mut self) -> Result<(), Stopped> {
        for point in 0..self.table.points() {
            self.run.check()?;
            if self.scene.points[point].is_none() && !self.banned[point] {
                self.scene.points[point] = self.triangulated(point);
            }
        }
        Ok(())
    }

    fn triangulated(&self, point: usize) -> Option<ScenePoint> {
        let known = self.table.of_point(point).filter_map(|o| {
            let pose = self.scene.poses[o.frame as usize]?;
            Some((o.frame, pose, self.scene.intrinsics.undistorted(o.pixel)?))
        });
        let seen: Vec<(u32, CameraPose, Vec2)> = known.collect();
        let (anchor, rest) = seen.split_first()?;
        let from_anchor = anchor.1.inverse();
        let views: Vec<View> =
            rest.iter().map(|(_, pose, ray)| View { view_from_anchor: *pose * from_anchor, ray: *ray }).collect();
        let found = triangulate(anchor.2, &views)?;
        let wrong = WRONG_PX * self.table.unit_px() / self.scene.intrinsics.focal;
        (found.residual < wrong).then(|| ScenePoint {
            anchor: anchor.0,
            ray: anchor.2,
            inverse_depth: found.inverse_depth.max(0.0),
        })
    }

    /// Local bundle adjustment: the newest frame, its nearest known neighbors and the points they observe.
    fn adjust_around(&mut self, frame: usize) -> Result<(), Stopped> {
        let mut known = self.registered();
        known.sort_by_key(|f| f.abs_diff(frame));
        let (free, rest) = known.split_at(LOCAL.min(known.len()));
        let mut wanted = vec![false; self.table.points()];
        for o in free.iter().flat_map(|&f| self.table.in_frame(f)) {
            wanted[o.point as usize] = true;
        }
        let near: Vec<Observation> = self.observations.iter().filter(|o| wanted[o.point as usize]).copied().collect();
        let fixed_frames = rest.iter().map(|&f| f as u32).collect();
        let options =
            BundleOptions { fixed_frames, fit: self.fit(6, 1e-2), uncertainty: false, ..BundleOptions::default() };
        // On failure the scene is unchanged; the next global adjustment uses the same data again.
        unless_stopped(adjust(&mut self.scene, &near, &options, self.run)).map(drop)
    }

    /// Global bundle adjustment; with `lens` also of focal length and distortion.
    pub(super) fn adjust_all(&mut self, lens: bool, tolerance: f64) -> Result<Option<BundleReport>, Stopped> {
        let mut options =
            BundleOptions { fit: self.fit(30, tolerance), uncertainty: false, ..BundleOptions::default() };
        if lens {
            let (value, sigma) = (self.start.focal, self.lens.sigma_ln_focal);
            options.focal = Freedom::Near { value, sigma };
            options.k1 = Freedom::Near { value: 0.0, sigma: self.lens.sigma_k1 };
        }
        unless_stopped(adjust(&mut self.scene, &self.observations, &options, self.run))
    }

    /// A sample of about `per_frame` observations per frame of the map's points, with the scene they belong to.
    pub(super) fn sample(&self, per_frame: usize) -> Sample {
        Sample::of(self.table, &self.scene, per_frame)
    }

    /// Adjusts a sample of a complete map, lens included, from near its optimum. Its points are first refined one by
    /// one: the pieces of cut tracks have never been optimized.
    pub(super) fn finish(&self, sample: &mut Sample, last: Last) -> Result<Option<BundleReport>, Stopped> {
        let refined = refine_points(&mut sample.scene, &sample.observations, &self.structure_fit(), self.run);
        if unless_stopped(refined)?.is_none() {
            return Ok(None);
        }
        let options = BundleOptions {
            fit: RobustFit { losses: vec![Loss::Cauchy(2.0)], ..self.fit(last.iterations, last.tolerance) },
            rotation_only: last.rotation_only,
            focal: Freedom::Near { value: self.start.focal, sigma: self.lens.sigma_ln_focal },
            k1: Freedom::Near { value: 0.0, sigma: self.lens.sigma_k1 },
            readout: if last.rolling { Freedom::Free } else { Freedom::Fixed },
            uncertainty: last.uncertainty,
            ..BundleOptions::default()
        };
        unless_stopped(adjust(&mut sample.scene, &sample.observations, &options, self.run))
    }

    /// Takes the cameras of an adjusted sample and refines all points with these cameras fixed.
    pub(super) fn take_cameras(&mut self, sample: Sample) -> Result<(), Stopped> {
        self.scene = Scene { points: std::mem::take(&mut self.scene.points), ..sample.scene };
        let fit = self.structure_fit();
        // On failure the points are unchanged: those that no longer fit are removed by their residuals.
        unless_stopped(refine_points(&mut self.scene, &self.observations, &fit, self.run)).map(drop)
    }

    /// Options for the refinement of points with fixed cameras.
    fn structure_fit(&self) -> RobustFit {
        RobustFit { losses: vec![Loss::Cauchy(2.0)], ..self.fit(8, 1e-3) }
    }

    fn fit(&self, max_iterations: usize, tolerance: f64) -> RobustFit {
        let damping = DampingOptions { tolerance, max_iterations, ..DampingOptions::default() };
        RobustFit { sigma_px: SIGMA_PX * self.table.unit_px(), damping, ..RobustFit::default() }
    }

    /// Removes the points of which too large a fraction of the observations are outliers.
    pub(super) fn discard_wrong(&mut self) {
        let wrong_px = WRONG_PX * self.table.unit_px();
        let residuals = residuals(&self.scene, &self.observations);
        for of_point in residuals.chunk_by(|a, b| a.point == b.point) {
            let wrong = of_point.iter().filter(|m| !(m.px <= wrong_px)).count();
            if wrong as f64 > MAX_OUTLIER_RATIO * of_point.len() as f64 {
                let point = of_point[0].point as usize;
                self.scene.points[point] = None;
                self.banned[point] = true;
            }
        }
    }
}

/// The result, `None` on failure; an interruption is passed on.
fn unless_stopped<T>(found: Result<T, BundleError>) -> Result<Option<T>, Stopped> {
    match found {
        Err(BundleError::Interrupted(stopped)) => Err(stopped),
        found => Ok(found.ok()),
    }
}

/// The nearer of two frames outside `low..=high`.
fn nearer(below: Option<usize>, above: Option<usize>, low: usize, high: usize) -> Option<usize> {
    match (below, above) {
        (Some(b), Some(a)) => Some(if low - b < a - high { b } else { a }),
        (b, a) => b.or(a),
    }
}
