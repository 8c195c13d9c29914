//! Synthetic shots with ground truth: a shaking camera among random points, with exact or noisy tracks.
//!
//! The generator imitates a tracker: in every frame points are added at random pixels and depths until the target
//! number is followed; each is followed until it leaves the image or its lifetime ends.

mod measure;
mod path;

pub(crate) use measure::{PathError, path_error};
pub(crate) use path::{Course, ShakyPath};

use nalgebra::UnitQuaternion;

use super::{Observation, Scene, ScenePoint, TrackTable};
use plumbline_camera::{CameraPose, Intrinsics, Point3, Vec3};
use plumbline_num::math::{Point2, Vec2};

/// Options of a synthetic shot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ShotOptions {
    /// Random seed.
    pub(crate) seed: u64,
    /// Number of frames.
    pub(crate) frames: usize,
    /// Points seen in each frame.
    pub(crate) per_frame: usize,
    /// Mean duration of a track, frames, if the point stays in the image.
    pub(crate) lifetime: f64,
    /// How the camera moves.
    pub(crate) course: Course,
    /// Amplitude of the shake. 1: hand-held; 0: a dolly without shake.
    pub(crate) shake: f64,
    /// Focal length, px; the image has 640 × 360 px.
    pub(crate) focal: f64,
    /// Radial term.
    pub(crate) k1: f64,
    /// Readout, frame periods.
    pub(crate) readout: f64,
    /// Standard deviation of the observation noise, px, in x and in y.
    pub(crate) noise_px: f64,
    /// Fraction of outliers: observations uniformly distributed within 40 px of the true position.
    pub(crate) outliers: f64,
}

impl Default for ShotOptions {
    /// Exact tracks of a walk.
    fn default() -> Self {
        Self {
            seed: 0,
            frames: 60,
            per_frame: 150,
            lifetime: 40.0,
            course: Course::Walk,
            shake: 1.0,
            focal: 576.0,
            k1: 0.0,
            readout: 0.0,
            noise_px: 0.0,
            outliers: 0.0,
        }
    }
}

/// A shot with its ground truth.
#[derive(Clone, Debug)]
pub(crate) struct Shot {
    /// The true scene.
    pub(crate) truth: Scene,
    /// Observations, by frame.
    pub(crate) observations: Vec<Observation>,
    /// Which of the observations are outliers.
    pub(crate) is_outlier: Vec<bool>,
}

/// Deviation of an initial guess from the truth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Disturbance {
    /// Rotation of every camera about a random axis, rad.
    pub(crate) rotation: f64,
    /// Translation of every camera in a random direction, as a fraction of the path's length.
    pub(crate) shift: f64,
    /// Maximum factor by which depths are multiplied or divided.
    pub(crate) depth_factor: f64,
    /// Ratio of the focal length to the true one.
    pub(crate) focal_factor: f64,
}

const SIZE: (f64, f64) = (640.0, 360.0);
/// Minimum distance of points from the image border, px.
const MARGIN: f64 = 4.0;
/// Range of depths at which points appear, m; log-uniform.
const DEPTHS: (f64, f64) = (3.0, 30.0);

/// A point with an active track.
struct Followed {
    index: u32,
    position: Point3,
    until: f64,
}

impl Shot {
    /// Generates a shot.
    pub(crate) fn new(options: &ShotOptions) -> Self {
        let mut rng = fastrand::Rng::with_seed(options.seed);
        let path = ShakyPath::new(options.course, options.frames, options.shake, &mut rng);
        let lens = Intrinsics { k1: options.k1, ..Intrinsics::centered(options.focal, SIZE.0 as u32, SIZE.1 as u32) };
        let truth = Scene {
            intrinsics: lens,
            readout: options.readout,
            poses: (0..options.frames).map(|f| Some(path.pose(f as f64))).collect(),
            points: Vec::new(),
        };
        let mut shot = Self { truth, observations: Vec::new(), is_outlier: Vec::new() };
        let mut followed = Vec::new();
        for frame in 0..options.frames {
            shot.observe(frame, &path, options, &mut followed, &mut rng);
        }
        shot
    }

    /// Output of a tracker: per frame the observed points and their positions, ordered by point.
    pub(crate) fn frames(&self) -> Vec<Vec<(u32, Point2)>> {
        let mut frames = vec![Vec::new(); self.truth.poses.len()];
        self.observations.iter().for_each(|o| frames[o.frame as usize].push((o.point, o.pixel)));
        for frame in &mut frames {
            frame.sort_by_key(|p: &(u32, Point2)| p.0);
        }
        frames
    }

    /// The same as a [`TrackTable`].
    pub(crate) fn table(&self) -> TrackTable {
        TrackTable::new(SIZE.0 as u32, SIZE.1 as u32, self.frames())
    }

    fn observe(
        &mut self,
        frame: usize,
        path: &ShakyPath,
        options: &ShotOptions,
        followed: &mut Vec<Followed>,
        rng: &mut fastrand::Rng,
    ) {
        let lens = self.truth.intrinsics;
        let seen = |p: &Followed| projected(path, &lens, options.readout, frame, &p.position).filter(inside);
        followed.retain(|p| frame as f64 <= p.until && seen(p).is_some());
        while followed.len() < options.per_frame {
            let pixel = Point2::new(SIZE.0 * rng.f64(), SIZE.1 * rng.f64());
            let depth = DEPTHS.0 * (DEPTHS.1 / DEPTHS.0).powf(rng.f64());
            let Some(ray) = lens.ray(pixel) else { continue };
            let index = self.truth.points.len() as u32;
            let position = path.pose(frame as f64).inverse().apply(&Point3::from(depth * ray));
            let until = frame as f64 - options.lifetime * (1.0 - rng.f64()).ln();
            let point = Followed { index, position, until };
            if seen(&point).is_some() {
                let anchored = ScenePoint { anchor: frame as u32, ray: ray.xy(), inverse_depth: 1.0 / depth };
                self.truth.points.push(Some(anchored));
                followed.push(point);
            }
        }
        for point in followed.iter() {
            let Some(exact) = seen(point) else { continue };
            let is_outlier = rng.f64() < options.outliers;
            let off = if is_outlier {
                Vec2::new(rng.f64() - 0.5, rng.f64() - 0.5) * 80.0
            } else {
                Vec2::new(gaussian(rng), gaussian(rng)) * options.noise_px
            };
            self.observations.push(Observation { frame: frame as u32, point: point.index, pixel: exact + off });
            self.is_outlier.push(is_outlier);
        }
    }

    /// An initial guess for an adjustment: the disturbed truth, with `k₁` and readout unknown.
    pub(crate) fn start(&self, disturbance: &Disturbance, seed: u64) -> Scene {
        let mut rng = fastrand::Rng::with_seed(seed);
        let mut scene = self.truth.clone();
        let centers: Vec<_> = scene.poses.iter().flatten().map(CameraPose::center).collect();
        let length: f64 = centers.windows(2).map(|w| (w[1] - w[0]).norm()).sum();
        for pose in scene.poses.iter_mut().flatten() {
            let rotation = UnitQuaternion::from_scaled_axis(disturbance.rotation * direction(&mut rng));
            let center = pose.center() + disturbance.shift * length * direction(&mut rng);
            *pose = CameraPose::looking_from(center, rotation * pose.rotation);
        }
        for point in scene.points.iter_mut().flatten() {
            point.inverse_depth *= disturbance.depth_factor.powf(2.0 * rng.f64() - 1.0);
        }
        scene.intrinsics.focal *= disturbance.focal_factor;
        (scene.intrinsics.k1, scene.readout) = (0.0, 0.0);
        scene
    }
}

/// Pixel at which a point is observed, with the pose of the row that captures it.
fn projected(path: &ShakyPath, lens: &Intrinsics, readout: f64, frame: usize, position: &Point3) -> Option<Point2> {
    let mut time = frame as f64;
    let mut pixel = lens.project(&path.pose(time).apply(position))?;
    // Fixed-point iteration: row and time depend on each other. The contraction factor is the image motion per row,
    // far below one.
    for _ in 0..if readout == 0.0 { 0 } else { 30 } {
        time = frame as f64 + (pixel.y / SIZE.1 - 0.5) * readout;
        pixel = lens.project(&path.pose(time).apply(position))?;
    }
    Some(pixel)
}

fn inside(p: &Point2) -> bool {
    p.x >= MARGIN && p.x <= SIZE.0 - MARGIN && p.y >= MARGIN && p.y <= SIZE.1 - MARGIN
}

/// A standard normal variable, by the Box–Muller transform.
fn gaussian(rng: &mut fastrand::Rng) -> f64 {
    (-2.0 * (1.0 - rng.f64()).ln()).sqrt() * (std::f64::consts::TAU * rng.f64()).cos()
}

fn direction(rng: &mut fastrand::Rng) -> Vec3 {
    Vec3::new(gaussian(rng), gaussian(rng), gaussian(rng)).normalize()
}
