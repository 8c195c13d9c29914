//! From tracks to cameras, and an honest word on what they are worth.
//!
//! Keyframes → pairs of keyframes ([`super::view_graph`]) → focal length → what the pairs say:
//!
//! - depth between them: a map grown from the best pair ([`super::mapper`]), completed with all frames;
//! - one plane: the same, from the poses that the plane allows, the better of them kept;
//! - no parallax: rotations only, points at infinity, no translation made up.
//!
//! Low residuals do not prove cameras, so a map counts as 3D only where its points are seen under an angle, in enough of
//! the frames and of the picture.

use super::keyframes::{keyframes, rotation_between};
use super::mapper::{LEAST_INLIERS, LensPrior, Mapper, WRONG_PX};
use super::two_view::TwoViewVerdict;
use super::view_graph::{Edge, shared_focal, view_graph};
use super::{Scene, ScenePoint, TrackTable};
use crate::camera::{CameraPose, Intrinsics, Vec3};

/// Focal length, in widths of the picture, where nothing is known: that of most phones and cameras.
const USUAL_FOCAL: f64 = 1.0;
/// How far the usual one may be off, as a factor.
const USUAL_DOUBT: f64 = 2.2;
/// Standard deviation of `ln f` after a vote of the pairs, at least.
const VOTED_SIGMA: f64 = 0.1;
/// Standard deviation of `k₁` in clips of unknown lenses.
const SIGMA_K1: f64 = 0.1;
/// Points per frame (median) below which nothing is tried.
const FEWEST_POINTS: usize = 40;
/// Seeds tried before a map is given up.
const SEEDS: usize = 3;
/// Triangulation angle, rad, median over points, from which on depth is believed.
const LEAST_ANGLE: f64 = 0.017;
/// Share of frames that must have a camera.
const LEAST_REGISTERED: f64 = 0.7;
/// RMS reprojection, px at 640 px across, beyond which cameras are not believed.
const MOST_RMS_PX: f64 = 1.5;
/// Uncertainty of `ln f` beyond which the focal length is not believed.
const MOST_SIGMA_LN_FOCAL: f64 = 0.3;
/// Columns and rows of the cells in which coverage is counted.
const CELLS: (usize, usize) = (8, 6);
/// Share of the cells that must hold points, mean over frames.
const LEAST_COVERAGE: f64 = 0.35;

/// What is known beforehand.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SfmOptions {
    /// Focal length, px, and the standard deviation of its logarithm: from the container's metadata, say.
    pub focal: Option<(f64, f64)>,
    /// Look for the readout time of a rolling shutter.
    pub rolling_shutter: bool,
}

/// What a shot's tracks allow to say about its cameras.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SfmVerdict {
    /// Cameras with places, points with depths.
    #[serde(rename = "3d")]
    ThreeD,
    /// The scene is one plane; places are in units of its distance.
    Planar,
    /// The camera only turned.
    RotationOnly,
    /// Too few still points.
    TooFewPoints,
    /// No cameras were found that explain the tracks.
    Failed,
}

/// How good a reconstruction is.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
pub struct SfmFigures {
    /// Frames with a camera.
    pub registered: usize,
    /// Frames of the shot.
    pub frames: usize,
    /// Points with a place.
    pub points: usize,
    /// Sightings of them within 3 px (at 640 px across).
    pub observations: usize,
    /// Mean distance of those from where the cameras see them, px.
    pub reprojection_px: f64,
    /// Root of the mean squared distance, px.
    pub rms_px: f64,
    /// Median over the points of the widest angle under which they are seen, rad.
    pub angle: f64,
    /// Share of the picture's cells that hold such a sighting, mean over the frames.
    pub coverage: f64,
    /// Focal length, px.
    pub focal: f64,
    /// Standard deviation of its logarithm; `None` where it was not determined.
    pub sigma_ln_focal: Option<f64>,
}

/// A reconstruction and what it is worth.
#[derive(Clone, Debug)]
pub struct Reconstruction {
    /// Cameras and points; without any where the verdict says so.
    pub scene: Scene,
    /// What they are.
    pub verdict: SfmVerdict,
    /// Why, for the user.
    pub reason: String,
    /// How good they are.
    pub figures: SfmFigures,
}

/// Reconstructs the cameras of one shot.
pub fn reconstruct(table: &TrackTable, options: &SfmOptions) -> Reconstruction {
    let width = f64::from(table.width.max(table.height));
    let (focal, sigma) = options.focal.unwrap_or((USUAL_FOCAL * width, USUAL_DOUBT.ln()));
    let guess = Intrinsics::centered(focal, table.width, table.height);
    let few = median(&mut (0..table.frames()).map(|f| table.in_frame(f).len() as f64).collect::<Vec<_>>());
    if few < FEWEST_POINTS as f64 || table.frames() < 3 {
        return nothing(table, guess, SfmVerdict::TooFewPoints, format!("{few:.0} points in most frames"));
    }
    let keys = keyframes(table, &guess);
    let edges = view_graph(table, &keys, &guess, sigma.exp());
    match Kind::of(&edges) {
        Kind::General => general(table, options, &keys, &edges, guess),
        Kind::Planar => planar(table, options, &keys, &edges, guess),
        Kind::Rotation => rotation_only(table, options, &keys, &edges, guess),
        Kind::Nothing => nothing(table, guess, SfmVerdict::Failed, "no two keyframes agree on any motion".to_owned()),
    }
}

/// What most pairs of keyframes say.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    General,
    Planar,
    Rotation,
    Nothing,
}

impl Kind {
    /// Depth needs one strong pair: between near keyframes it need not show.
    fn of(edges: &[Edge]) -> Self {
        let count = |verdict| edges.iter().filter(|e| e.view.verdict == verdict).count();
        let deep = edges.iter().filter(|e| is_seed(e)).count();
        let (general, planar) = (count(TwoViewVerdict::General), count(TwoViewVerdict::Planar));
        let rotation = count(TwoViewVerdict::RotationOnly);
        if deep > 0 && 4 * general >= planar + rotation {
            Self::General
        } else if planar > rotation {
            Self::Planar
        } else if rotation > 0 {
            Self::Rotation
        } else {
            Self::Nothing
        }
    }
}

fn is_seed(edge: &Edge) -> bool {
    edge.view.verdict == TwoViewVerdict::General
        && edge.view.median_angle >= LEAST_ANGLE
        && edge.inliers() >= 2 * LEAST_INLIERS
}

/// A map of a scene with depth.
fn general(
    table: &TrackTable,
    options: &SfmOptions,
    keys: &[usize],
    edges: &[Edge],
    guess: Intrinsics,
) -> Reconstruction {
    let (camera, lens) = match (options.focal, shared_focal(table, edges)) {
        (None, Some(vote)) => {
            let sigma = vote.sigma_ln.max(VOTED_SIGMA);
            let camera = Intrinsics { focal: vote.focal, ..guess };
            (camera, LensPrior { sigma_ln_focal: sigma, sigma_k1: SIGMA_K1 })
        }
        (given, _) => {
            let sigma = given.map_or(USUAL_DOUBT.ln(), |(_, sigma)| sigma);
            (guess, LensPrior { sigma_ln_focal: sigma, sigma_k1: SIGMA_K1 })
        }
    };
    let edges = view_graph(table, keys, &camera, lens.sigma_ln_focal.exp());
    let mut seeds: Vec<&Edge> = edges.iter().filter(|e| is_seed(e)).collect();
    seeds.sort_by(|a, b| b.strength().total_cmp(&a.strength()));
    let start = Mapper::new(table, keys, camera, lens);
    let mut best: Option<(usize, Mapper<'_>)> = None;
    for seed in seeds.into_iter().take(SEEDS) {
        let mut mapper = start.clone();
        if !mapper.seed(seed.first, seed.second, seed.view.poses[0]) {
            continue;
        }
        let known = mapper.extend();
        if best.as_ref().is_none_or(|(n, _)| known > *n) {
            best = Some((known, mapper));
        }
        if known == keys.len() {
            break;
        }
    }
    match best {
        Some((_, mapper)) => finished(table, mapper, options, SfmVerdict::ThreeD),
        None => nothing(table, camera, SfmVerdict::Failed, "no pair of keyframes carries a map".to_owned()),
    }
}

/// A map of a plane, from the best of the poses that its homographies allow.
fn planar(
    table: &TrackTable,
    options: &SfmOptions,
    keys: &[usize],
    edges: &[Edge],
    guess: Intrinsics,
) -> Reconstruction {
    let sigma = options.focal.map_or(VOTED_SIGMA, |(_, sigma)| sigma);
    let lens = LensPrior { sigma_ln_focal: sigma, sigma_k1: 0.1 * SIGMA_K1 };
    let mut seeds: Vec<&Edge> = edges.iter().filter(|e| e.view.verdict == TwoViewVerdict::Planar).collect();
    seeds.sort_by(|a, b| b.strength().total_cmp(&a.strength()));
    let start = Mapper::new(table, keys, guess, lens);
    let mut best: Option<(f64, Mapper<'_>)> = None;
    for (seed, pose) in seeds.iter().take(SEEDS).flat_map(|s| s.view.poses.iter().map(move |p| (s, *p))) {
        let mut mapper = start.clone();
        if !mapper.seed(seed.first, seed.second, pose) {
            continue;
        }
        let lost = keys.len() - mapper.extend();
        let cost = mapper.adjust_all(false).map_or(f64::INFINITY, |r| r.median_px) + lost as f64;
        if best.as_ref().is_none_or(|(c, _)| cost < *c) {
            best = Some((cost, mapper));
        }
    }
    match best {
        Some((_, mapper)) => finished(table, mapper, options, SfmVerdict::Planar),
        None => {
            nothing(table, guess, SfmVerdict::Failed, "no pose explains the plane that the points move as".to_owned())
        }
    }
}

/// Registers the frames between keyframes, adjusts everything and judges the result.
fn finished(table: &TrackTable, mut mapper: Mapper<'_>, options: &SfmOptions, verdict: SfmVerdict) -> Reconstruction {
    let all: Vec<usize> = (0..table.frames()).collect();
    mapper.admit(&all);
    let missing: Vec<usize> = all.into_iter().filter(|&f| mapper.scene.poses[f].is_none()).collect();
    for frame in missing {
        mapper.register(frame);
    }
    mapper.triangulate_new();
    let mut report = mapper.finish(false);
    mapper.discard_wrong();
    mapper.triangulate_new();
    if options.rolling_shutter {
        report = mapper.finish(true);
    } else {
        report = mapper.finish(false).or(report);
    }
    mapper.discard_wrong();
    let sigma = report.and_then(|r| r.sigma_ln_focal);
    let figures = figures(table, &mapper.scene, sigma);
    let (verdict, reason) = judged(&figures, verdict, f64::from(table.width.max(table.height)) / 640.0);
    Reconstruction { scene: mapper.scene, verdict, reason, figures }
}

/// Whether the figures bear the verdict.
fn judged(figures: &SfmFigures, verdict: SfmVerdict, unit_px: f64) -> (SfmVerdict, String) {
    let f = figures;
    let registered = f.registered as f64 / f.frames.max(1) as f64;
    let failed = |why: String| (SfmVerdict::Failed, why);
    if !(registered >= LEAST_REGISTERED) {
        failed(format!("cameras for {} of {} frames only", f.registered, f.frames))
    } else if !(f.rms_px <= MOST_RMS_PX * unit_px) {
        failed(format!("points lie {:.1} px beside where the cameras see them", f.rms_px))
    } else if !(f.coverage >= LEAST_COVERAGE) {
        failed(format!("still points on {:.0} % of the picture only", 100.0 * f.coverage))
    } else if verdict == SfmVerdict::ThreeD && !(f.angle >= LEAST_ANGLE) {
        failed(format!("points are seen under {:.1} degrees only", f.angle.to_degrees()))
    } else if verdict == SfmVerdict::ThreeD && !f.sigma_ln_focal.is_some_and(|s| s <= MOST_SIGMA_LN_FOCAL) {
        failed("the focal length cannot be told".to_owned())
    } else {
        let angle = f.angle.to_degrees();
        (verdict, format!("{} points seen under {angle:.1} degrees, to {:.2} px", f.points, f.reprojection_px))
    }
}

/// The cameras of a shot that shows no parallax.
fn rotation_only(
    table: &TrackTable,
    options: &SfmOptions,
    keys: &[usize],
    edges: &[Edge],
    guess: Intrinsics,
) -> Reconstruction {
    let camera = Intrinsics { focal: guess.focal * turned_focal(edges, options), ..guess };
    let sigma = options.focal.map_or(VOTED_SIGMA, |(_, sigma)| sigma);
    let mut mapper = Mapper::new(table, keys, camera, LensPrior { sigma_ln_focal: sigma, sigma_k1: SIGMA_K1 });
    let all: Vec<usize> = (0..table.frames()).collect();
    mapper.admit(&all);
    let mut pose = CameraPose::identity();
    let mut before: Option<usize> = None;
    for frame in all {
        if let Some(before) = before {
            let shared = table.shared(before, frame);
            if shared.len() < LEAST_INLIERS {
                continue;
            }
            let ray = |p| camera.ray(p).map(|r: Vec3| r.normalize());
            let rays: Vec<(Vec3, Vec3)> = shared.iter().filter_map(|m| Some((ray(m.first)?, ray(m.second)?))).collect();
            let step = CameraPose { rotation: rotation_between(&rays).into(), translation: Vec3::zeros() };
            pose = step * pose;
        }
        mapper.scene.poses[frame] = Some(pose);
        before = Some(frame);
    }
    place_at_infinity(table, &mut mapper.scene);
    // Translations and inverse depths of zero have no gradient: the adjustment turns cameras and rays only.
    let report = mapper.finish(false);
    mapper.discard_wrong();
    let sigma = report.and_then(|r| r.sigma_ln_focal);
    let figures = figures(table, &mapper.scene, sigma);
    let (verdict, reason) =
        judged(&figures, SfmVerdict::RotationOnly, f64::from(table.width.max(table.height)) / 640.0);
    Reconstruction { scene: mapper.scene, verdict, reason, figures }
}

/// The focal length of turning cameras in units of the assumed one: that of the pairs that turned most.
fn turned_focal(edges: &[Edge], options: &SfmOptions) -> f64 {
    if options.focal.is_some() {
        return 1.0;
    }
    let mut turns: Vec<(f64, f64)> =
        edges.iter().filter_map(|e| e.view.turn).map(|t| (t.rotation.angle(), t.focal_ratio)).collect();
    turns.sort_by(|a, b| b.0.total_cmp(&a.0));
    turns.truncate(turns.len().div_ceil(3).max(1));
    let mut ratios: Vec<f64> = turns.into_iter().map(|t| t.1).collect();
    if ratios.is_empty() { 1.0 } else { median(&mut ratios) }
}

fn place_at_infinity(table: &TrackTable, scene: &mut Scene) {
    for point in 0..table.points() {
        let first = table.of_point(point).find(|o| scene.poses[o.frame as usize].is_some());
        scene.points[point] = first.and_then(|o| {
            let ray = scene.intrinsics.undistorted(o.pixel)?;
            Some(ScenePoint { anchor: o.frame, ray, inverse_depth: 0.0 })
        });
    }
}

fn nothing(table: &TrackTable, camera: Intrinsics, verdict: SfmVerdict, reason: String) -> Reconstruction {
    let scene = Scene {
        intrinsics: camera,
        readout: 0.0,
        poses: vec![None; table.frames()],
        points: vec![None; table.points()],
    };
    let figures = SfmFigures { frames: table.frames(), ..SfmFigures::default() };
    Reconstruction { scene, verdict, reason, figures }
}

/// Measures a scene against its tracks.
fn figures(table: &TrackTable, scene: &Scene, sigma_ln_focal: Option<f64>) -> SfmFigures {
    let unit = f64::from(table.width.max(table.height)) / 640.0;
    let (mut sum, mut squares, mut observations, mut covered) = (0.0, 0.0, 0, 0.0);
    for frame in (0..table.frames()).filter(|&f| scene.poses[f].is_some()) {
        let mut cells = vec![false; CELLS.0 * CELLS.1];
        for o in table.in_frame(frame) {
            let Some(miss) = scene.project(o.frame, o.point).map(|p| (p - o.pixel).norm()) else { continue };
            if miss <= WRONG_PX * unit {
                (sum, squares, observations) = (sum + miss, squares + miss * miss, observations + 1);
                cells[cell(table, o.pixel.x, o.pixel.y)] = true;
            }
        }
        covered += cells.iter().filter(|c| **c).count() as f64 / cells.len() as f64;
    }
    let registered = scene.poses.iter().flatten().count();
    let mut angles: Vec<f64> = (0..table.points()).filter_map(|p| widest_angle(table, scene, p)).collect();
    SfmFigures {
        registered,
        frames: table.frames(),
        points: angles.len(),
        observations,
        reprojection_px: sum / f64::from(observations.max(1) as u32),
        rms_px: (squares / f64::from(observations.max(1) as u32)).sqrt(),
        angle: median(&mut angles),
        coverage: covered / registered.max(1) as f64,
        focal: scene.intrinsics.focal,
        sigma_ln_focal,
    }
}

fn cell(table: &TrackTable, x: f64, y: f64) -> usize {
    let along = |v: f64, size: u32, n: usize| ((v / f64::from(size) * n as f64).max(0.0) as usize).min(n - 1);
    along(y, table.height, CELLS.1) * CELLS.0 + along(x, table.width, CELLS.0)
}

/// Widest angle, rad, between the anchor's ray of a point and those of the other frames that see it.
fn widest_angle(table: &TrackTable, scene: &Scene, point: usize) -> Option<f64> {
    let place = scene.points[point]?;
    let anchor = scene.poses[place.anchor as usize]?;
    let ray = place.direction();
    let angle = |pose: CameraPose| {
        let from_anchor = pose * anchor.inverse();
        (from_anchor.rotation * ray).angle(&place.scaled_in(&pose, &anchor))
    };
    let poses = table.of_point(point).filter_map(|o| scene.poses[o.frame as usize]);
    Some(poses.map(angle).fold(0.0, f64::max))
}

fn median(values: &mut [f64]) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}
