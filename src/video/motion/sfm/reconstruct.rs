//! From tracks to cameras, with a quality verdict.
//!
//! Keyframes → pairs of keyframes ([`super::view_graph`]) → focal length → the dominant geometry of the pairs:
//!
//! - depth: an incremental map from the best pair ([`super::mapper`]), or, if that is not accepted, a global map of
//!   all keyframes ([`super::global_mapping`]); completed with all frames;
//! - one plane: a map grown from the poses that the homography allows, the best of them kept;
//! - no parallax: rotations only, points at infinity, no translation.
//!
//! Both mappers are needed (`docs/ABLATIONS.md`): without the first one four of 46 clips and synthetic shots have no
//! cameras and four have cameras in fewer frames or less accurate ones; without the second one `nus-regular-2` is a
//! rotation only.

use super::bundle::BundleReport;
use super::figures::{SfmFigures, figures};
use super::global_mapping::map_globally;
use super::keyframes::keyframes;
use super::mapper::{GROWN, Last, LensPrior, MIN_POINTS, Mapper};
use super::rotation_estimation::{estimate_rotations, focal_of_rotations};
use super::two_view::TwoViewVerdict;
use super::verdict::{MIN_ANGLE, SfmVerdict, judged, predicts};
use super::view_graph::{Edge, shared_focal, view_graph};
use super::zoom::zoom;
use super::{Scene, TrackTable};
use plumbline_camera::{CameraPose, Intrinsics};
use plumbline_num::math::median;
use plumbline_num::run::{Run, Stopped};

/// Default focal length, in image widths: that of most phones and cameras.
const USUAL_FOCAL: f64 = 1.0;
/// Factor by which the default focal length may be wrong: from 0.45 widths (wide-angle) to 2.2 widths (a short
/// telephoto lens).
const USUAL_FOCAL_FACTOR: f64 = 2.2;
/// Minimum standard deviation of `ln f` of the estimate from pairs: pairs agree with each other under a common error.
const MIN_PAIR_SIGMA: f64 = 0.1;
/// Standard deviation of `k₁` for clips of unknown lenses: phones have up to 0.1, action cameras more.
const SIGMA_K1: f64 = 0.1;
/// Factor on that standard deviation for a planar scene, where `k₁` is correlated with tilt.
const PLANAR_K1_FRACTION: f64 = 0.1;
/// Standard deviation of `ln f` of the estimate from rotations: they determine it well or not at all.
const ROTATION_SIGMA: f64 = 0.3;
/// Maximum ratio of the cost with a readout to the cost without one for the readout to be kept.
const MAX_READOUT_COST: f64 = 0.97;
/// Range of readouts that are kept, frame periods. A shorter one distorts less than the accuracy of tracks; none is
/// longer than a frame, with a margin for noise.
const MIN_READOUT: f64 = 0.05;
/// See [`MIN_READOUT`].
const MAX_READOUT: f64 = 1.2;
/// Observations per frame of the rough adjustment, which separates outliers from inliers and estimates a readout.
const ROUGH_OBSERVATIONS: usize = 160;
/// Observations per frame of the final adjustment. On five rendered walks rotations between frames are a seventh less
/// accurate with 400 than with all thousand, with 240 a quarter.
const FINE_OBSERVATIONS: usize = 400;
/// Maximum ratio of the RMS residual of pure rotations to that with depths for which the camera counts as rotating
/// only: the additional depths and translations absorb a third of the noise of short tracks.
const MAX_ROTATION_LOSS: f64 = 1.5;
/// Number of planar pairs from which a map is grown, in order of strength: the pose of a single one may be the wrong
/// one of the two that its homography allows.
/// For scenes with depth further seeds change nothing (`docs/ABLATIONS.md`).
const MAX_PLANAR_SEEDS: usize = 3;

/// Prior knowledge.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SfmOptions {
    /// Focal length, px, and the standard deviation of its logarithm, for example from the container's metadata.
    pub focal: Option<(f64, f64)>,
    /// Estimate the readout time of a rolling shutter; it is kept if it explains the tracks clearly better.
    pub rolling_shutter: bool,
}

/// A reconstruction and its quality.
#[derive(Clone, Debug)]
pub struct Reconstruction {
    /// Cameras and points; empty if the verdict says so.
    pub scene: Scene,
    /// Kind of the result.
    pub verdict: SfmVerdict,
    /// Reason for the verdict, for the user.
    pub reason: String,
    /// Quality figures.
    pub figures: SfmFigures,
}

/// Reconstructs the cameras of one shot.
///
/// # Errors
/// [`Stopped`].
pub fn reconstruct(table: &TrackTable, options: &SfmOptions, run: &Run) -> Result<Reconstruction, Stopped> {
    let width = f64::from(table.width.max(table.height));
    let focal = options.focal.map_or(USUAL_FOCAL * width, |(focal, _)| focal);
    let guess = Intrinsics::centered(focal, table.width, table.height);
    let mut counts: Vec<f64> = (0..table.frames()).map(|f| table.in_frame(f).len() as f64).collect();
    let points = median(&mut counts).unwrap_or(0.0);
    if points < MIN_POINTS as f64 || table.frames() < 3 {
        return Ok(without_cameras(
            table,
            guess,
            SfmVerdict::TooFewPoints,
            format!("{points:.0} points in most frames"),
        ));
    }
    run.step(0.0)?;
    let keys = keyframes(table, &guess);
    let mut shot = Shot { table, options, run, guess, keys, edges: Vec::new() };
    shot.edges = shot.pairs(&guess, shot.lens_prior(USUAL_FOCAL_FACTOR.ln()))?;
    run.step(0.1)?;
    let found = match Kind::of(&shot.edges) {
        Kind::General => shot.general_or_rotation()?,
        Kind::Planar => shot.planar()?,
        Kind::Rotation => shot.rotation_only()?,
        Kind::Nothing => shot.failed("no two keyframes agree on any motion"),
    };
    let rotating = found.verdict != SfmVerdict::ThreeD;
    Ok(match zoom(&shot.edges, &guess, rotating, run)? {
        Some(factor) => {
            let reason = format!("the focal length changes, by a factor of {factor:.2}");
            without_cameras(table, guess, SfmVerdict::Zoom, reason)
        }
        None => found,
    })
}

/// Dominant geometry of the keyframe pairs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    General,
    Planar,
    Rotation,
    Nothing,
}

impl Kind {
    /// Depth requires only one strong pair: between close keyframes parallax can be absent.
    fn of(edges: &[Edge]) -> Self {
        let deep = edges.iter().filter(|e| is_seed(e)).count();
        let general = count(edges, TwoViewVerdict::General);
        let planar = count(edges, TwoViewVerdict::Planar);
        let rotation = count(edges, TwoViewVerdict::RotationOnly);
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

fn count(edges: &[Edge], verdict: TwoViewVerdict) -> usize {
    edges.iter().filter(|e| e.view.verdict == verdict).count()
}

fn is_seed(edge: &Edge) -> bool {
    edge.view.verdict == TwoViewVerdict::General && edge.view.median_angle >= MIN_ANGLE && edge.inliers() >= MIN_POINTS
}

/// Pairs in descending order of strength.
fn by_strength<'e>(edges: impl Iterator<Item = &'e Edge>) -> Vec<&'e Edge> {
    let mut sorted: Vec<&Edge> = edges.collect();
    sorted.sort_by(|a, b| b.strength().total_cmp(&a.strength()));
    sorted
}

/// A shot, its keyframes and their pairs.
struct Shot<'a> {
    table: &'a TrackTable,
    options: &'a SfmOptions,
    run: &'a Run,
    /// The lens as given, or the default one.
    guess: Intrinsics,
    keys: Vec<usize>,
    edges: Vec<Edge>,
}

impl<'a> Shot<'a> {
    /// The focal length has the prior of the options, or else one of standard deviation `sigma_ln_focal`.
    fn lens_prior(&self, sigma_ln_focal: f64) -> LensPrior {
        let sigma_ln_focal = self.options.focal.map_or(sigma_ln_focal, |(_, sigma)| sigma);
        LensPrior { sigma_ln_focal, sigma_k1: SIGMA_K1 }
    }

    fn pairs(&self, camera: &Intrinsics, lens: LensPrior) -> Result<Vec<Edge>, Stopped> {
        view_graph(self.table, &self.keys, camera, lens.sigma_ln_focal.exp(), self.run)
    }

    /// An empty map over the keyframes.
    fn mapper(&self, camera: Intrinsics, lens: LensPrior) -> Mapper<'a> {
        Mapper::new(self.table, &self.keys, camera, lens, self.run)
    }

    fn failed(&self, reason: &str) -> Reconstruction {
        without_cameras(self.table, self.guess, SfmVerdict::Failed, reason.to_owned())
    }

    /// A map of a scene with depth; or rotations only, if the depths predict nothing and rotations explain the tracks
    /// about as well.
    fn general_or_rotation(&self) -> Result<Reconstruction, Stopped> {
        let found = self.general()?;
        if found.verdict != SfmVerdict::Failed || predicts(&found.figures) {
            return Ok(found);
        }
        let rotation = self.rotation_only()?;
        let nothing_else = found.figures.points == 0;
        let as_well = nothing_else || rotation.figures.rms_px <= MAX_ROTATION_LOSS * found.figures.rms_px;
        Ok(if rotation.verdict == SfmVerdict::RotationOnly && as_well { rotation } else { found })
    }

    /// A map of a scene with depth, whatever its verdict.
    fn general(&self) -> Result<Reconstruction, Stopped> {
        let (camera, lens) = self.lens_of_pairs()?;
        let edges = self.pairs(&camera, lens)?;
        let empty = self.mapper(camera, lens);
        let grown = match by_strength(edges.iter().filter(|e| is_seed(e))).first() {
            Some(seed) => grown(&empty, seed, seed.view.poses[0])?,
            None => None,
        };
        self.run.step(0.4)?;
        let grown = grown.map(|m| self.completed(m, SfmVerdict::ThreeD)).transpose()?;
        // A rotating camera has positions too, spurious ones, and they take as long to compute.
        let deep = 2 * count(&edges, TwoViewVerdict::General) >= edges.len();
        if !deep || grown.as_ref().is_some_and(|g| g.verdict.has_cameras()) {
            return Ok(grown.unwrap_or_else(|| self.failed("no pair of keyframes carries a map")));
        }
        let mut mapper = empty;
        let mapped = map_globally(self.table, &mut mapper, &self.keys, &edges, self.run)?;
        let global = mapped.then(|| self.completed(mapper, SfmVerdict::ThreeD)).transpose()?;
        let worth = |r: &Reconstruction| (r.verdict.has_cameras(), r.figures.registered, -r.figures.rms_px);
        Ok(match (grown, global) {
            (Some(grown), Some(global)) => {
                if worth(&global) > worth(&grown) {
                    global
                } else {
                    grown
                }
            }
            (grown, global) => global.or(grown).unwrap_or_else(|| self.failed("no pair of keyframes carries a map")),
        })
    }

    /// The lens as given, or with the focal length estimated from the pairs with depth.
    fn lens_of_pairs(&self) -> Result<(Intrinsics, LensPrior), Stopped> {
        let estimate = match self.options.focal {
            Some(_) => None,
            None => shared_focal(self.table, &self.edges, self.run)?,
        };
        let Some(estimate) = estimate else { return Ok((self.guess, self.lens_prior(USUAL_FOCAL_FACTOR.ln()))) };
        let camera = Intrinsics { focal: estimate.focal, ..self.guess };
        Ok((camera, self.lens_prior(estimate.sigma_ln.max(MIN_PAIR_SIGMA))))
    }

    /// A map of a planar scene, from the best of the poses that its homographies allow.
    fn planar(&self) -> Result<Reconstruction, Stopped> {
        let lens = LensPrior { sigma_k1: PLANAR_K1_FRACTION * SIGMA_K1, ..self.lens_prior(MIN_PAIR_SIGMA) };
        let empty = self.mapper(self.guess, lens);
        let planes = by_strength(self.edges.iter().filter(|e| e.view.verdict == TwoViewVerdict::Planar));
        let guesses = planes.into_iter().take(MAX_PLANAR_SEEDS).flat_map(|s| s.view.poses.iter().map(move |p| (s, *p)));
        let mut best: Option<(f64, Mapper<'_>)> = None;
        for (seed, pose) in guesses {
            self.run.check()?;
            let Some(mut mapper) = grown(&empty, seed, pose)? else { continue };
            let lost = self.keys.len() - mapper.registered().len();
            let residual = mapper.adjust_all(false, GROWN)?.map_or(f64::INFINITY, |r| r.median_px);
            let cost = lost as f64 + residual;
            if best.as_ref().is_none_or(|(least, _)| cost < *least) {
                best = Some((cost, mapper));
            }
        }
        match best {
            Some((_, mapper)) => self.completed(mapper, SfmVerdict::Planar),
            None => Ok(self.failed("no pose explains the plane that the points move as")),
        }
    }

    /// The cameras of a shot without parallax.
    fn rotation_only(&self) -> Result<Reconstruction, Stopped> {
        let focal = if self.options.focal.is_some() { None } else { focal_of_rotations(&self.edges, &self.guess) };
        let camera = Intrinsics { focal: focal.unwrap_or(self.guess.focal), ..self.guess };
        let mut mapper = self.mapper(camera, self.lens_prior(ROTATION_SIGMA));
        mapper.admit(&(0..self.table.frames()).collect::<Vec<_>>());
        estimate_rotations(self.table, &mut mapper, &self.keys, &self.edges, self.run)?;
        self.concluded(mapper, SfmVerdict::RotationOnly)
    }

    /// Registers the frames between keyframes, adjusts everything and determines the verdict.
    fn completed(&self, mut mapper: Mapper<'_>, verdict: SfmVerdict) -> Result<Reconstruction, Stopped> {
        let all: Vec<usize> = (0..self.table.frames()).collect();
        mapper.admit(&all);
        let missing: Vec<usize> = all.into_iter().filter(|&f| mapper.scene.poses[f].is_none()).collect();
        for frame in missing {
            mapper.register(frame)?;
        }
        mapper.triangulate_new()?;
        self.concluded(mapper, verdict)
    }

    /// Adjusts, measures and evaluates a map of all frames.
    fn concluded(&self, mut mapper: Mapper<'_>, verdict: SfmVerdict) -> Result<Reconstruction, Stopped> {
        self.run.step(0.7)?;
        let report = adjusted(&mut mapper, self.options.rolling_shutter, verdict == SfmVerdict::RotationOnly)?;
        let figures = figures(self.table, &mapper.scene, report.and_then(|r| r.sigma_ln_focal), self.run)?;
        let (verdict, reason) = judged(&figures, mapper.scene.intrinsics.k1, verdict, self.table.unit_px());
        Ok(Reconstruction { scene: mapper.scene, verdict, reason, figures })
    }
}

/// The map grown over the keyframes from an initial pair and its relative pose; `None` if the pair does not support
/// one.
fn grown<'a>(empty: &Mapper<'a>, seed: &Edge, pose: CameraPose) -> Result<Option<Mapper<'a>>, Stopped> {
    let mut mapper = empty.clone();
    if !mapper.seed(seed.first, seed.second, pose)? {
        return Ok(None);
    }
    mapper.extend()?;
    Ok(Some(mapper))
}

/// Adjusts a map of all frames twice. The rough pass finds outliers and, with `rolling`, whether a readout explains
/// the residuals; the final pass runs without the outliers to the final tolerance.
fn adjusted(mapper: &mut Mapper<'_>, rolling: bool, rotation_only: bool) -> Result<Option<BundleReport>, Stopped> {
    let rough = Last { rotation_only, ..Last::ROUGH };
    let mut sample = mapper.sample(ROUGH_OBSERVATIONS);
    let global = mapper.finish(&mut sample, rough)?;
    let mut has_readout = false;
    if let Some(global) = global.filter(|_| rolling) {
        let mut with_readout = sample.clone();
        let report = mapper.finish(&mut with_readout, Last { rolling, ..rough })?;
        has_readout = report.is_some_and(|r| r.cost < MAX_READOUT_COST * global.cost)
            && (MIN_READOUT..MAX_READOUT).contains(&with_readout.scene.readout);
        if has_readout {
            sample = with_readout;
        }
    }
    mapper.take_cameras(sample)?;
    mapper.discard_wrong();
    if !rotation_only {
        mapper.triangulate_new()?;
    }
    let mut sample = mapper.sample(FINE_OBSERVATIONS);
    let report = mapper.finish(&mut sample, Last { rolling: has_readout, rotation_only, ..Last::FINE })?;
    mapper.take_cameras(sample)?;
    mapper.discard_wrong();
    Ok(report)
}

fn without_cameras(table: &TrackTable, camera: Intrinsics, verdict: SfmVerdict, reason: String) -> Reconstruction {
    let scene = Scene::unknown(table, camera);
    let figures = SfmFigures { frames: table.frames(), ..SfmFigures::default() };
    Reconstruction { scene, verdict, reason, figures }
}
