//! From tracks to cameras, and an honest word on what they are worth.
//!
//! Keyframes → pairs of keyframes ([`super::view_graph`]) → focal length → what the pairs say:
//!
//! - depth between them: a map grown from the best pair ([`super::mapper`]), or, where it loses keyframes or turns away from
//!   what the pairs say, all keyframes placed at once ([`super::rescue`]); completed with all frames;
//! - one plane: the same, from the poses that the plane allows, the better of them kept;
//! - no parallax: rotations only, points at infinity, no translation made up.

use super::bundle::BundleReport;
use super::figures::{SfmFigures, figures};
use super::keyframes::keyframes;
use super::mapper::{GROWN, Last, LensPrior, MIN_INLIERS, Mapper};
use super::rescue::{agrees, averaged, place_all};
use super::turning::{focal_of_turns, turn_cameras};
use super::two_view::TwoViewVerdict;
use super::verdict::{MIN_ANGLE, SfmVerdict, foretells, judged};
use super::view_graph::{Edge, shared_focal, view_graph};
use super::zoom::zoom_between;
use super::{Scene, TrackTable};
use plumbline_camera::{CameraPose, Intrinsics};
use plumbline_num::math::median;
use plumbline_num::run::{Run, Stopped};

/// Focal length, in widths of the picture, where nothing is known: that of most phones and cameras.
const USUAL_FOCAL: f64 = 1.0;
/// How far the usual one may be off, as a factor.
const USUAL_DOUBT: f64 = 2.2;
/// Standard deviation of `ln f` after a vote of the pairs, at least.
const VOTED_SIGMA: f64 = 0.1;
/// Standard deviation of `k₁` in clips of unknown lenses.
const SIGMA_K1: f64 = 0.1;
/// Standard deviation of `ln f` after the turns have told it: they tell it well or not at all.
const TURNED_SIGMA: f64 = 0.3;
/// Share of the cost that a readout must leave at most to be believed.
const CLEAR_GAIN: f64 = 0.97;
/// Readouts that are believed, frame periods: one below bends less than tracks are accurate; none is longer than a frame, a
/// little allowed for noise.
const MIN_READOUT: f64 = 0.05;
/// See [`MIN_READOUT`].
const MAX_READOUT: f64 = 1.2;
/// Points per frame (median) below which nothing is tried.
const MIN_POINTS: usize = 40;
/// Sightings per frame by which wrong points are told from right ones and a readout is found.
const FEW_SIGHTINGS: usize = 160;
/// Sightings per frame that the final cameras rest on. On five rendered walks rotations between frames are a seventh less
/// accurate by 400 than by all thousand, by 240 a quarter.
const ENOUGH_SIGHTINGS: usize = 400;
/// Residuals of turns over those with depths made up, RMS, up to which a camera is taken to have turned only: a depth and a
/// translation too many take up a third of the noise of short tracks.
const MAX_ROTATION_LOSS: f64 = 1.5;
/// Seeds tried before a map is given up.
const SEEDS: usize = 3;

/// What is known beforehand.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SfmOptions {
    /// Focal length, px, and the standard deviation of its logarithm: from the container's metadata, say.
    pub focal: Option<(f64, f64)>,
    /// Look for the readout time of a rolling shutter; it is kept where it explains clearly more.
    pub rolling_shutter: bool,
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
///
/// # Errors
/// [`Stopped`].
pub fn reconstruct(table: &TrackTable, options: &SfmOptions, run: &Run) -> Result<Reconstruction, Stopped> {
    let width = f64::from(table.width.max(table.height));
    let (focal, sigma) = options.focal.unwrap_or((USUAL_FOCAL * width, USUAL_DOUBT.ln()));
    let guess = Intrinsics::centered(focal, table.width, table.height);
    let few =
        median(&mut (0..table.frames()).map(|f| table.in_frame(f).len() as f64).collect::<Vec<_>>()).unwrap_or(0.0);
    if few < MIN_POINTS as f64 || table.frames() < 3 {
        return Ok(nothing(table, guess, SfmVerdict::TooFewPoints, format!("{few:.0} points in most frames")));
    }
    run.step(0.0)?;
    let keys = keyframes(table, &guess);
    let edges = view_graph(table, &keys, &guess, sigma.exp(), run)?;
    run.step(0.1)?;
    let found = match Kind::of(&edges) {
        Kind::General => with_depth(table, options, &keys, &edges, guess, run)?,
        Kind::Planar => planar(table, options, &keys, &edges, guess, run)?,
        Kind::Rotation => rotation_only(table, options, &keys, &edges, guess, run)?,
        Kind::Nothing => nothing(table, guess, SfmVerdict::Failed, "no two keyframes agree on any motion".to_owned()),
    };
    if found.verdict != SfmVerdict::Failed {
        return Ok(found);
    }
    Ok(match zoom_between(&edges, &guess, run)? {
        Some(factor) => nothing(
            table,
            guess,
            SfmVerdict::Zoom,
            format!("the focal length changes, by {factor:.2} in a second or so"),
        ),
        None => found,
    })
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
        && edge.view.median_angle >= MIN_ANGLE
        && edge.inliers() >= 2 * MIN_INLIERS
}

/// A map of a scene with depth; where the depth foretells nothing and turns explain the tracks about as well, those.
fn with_depth(
    table: &TrackTable,
    options: &SfmOptions,
    keys: &[usize],
    edges: &[Edge],
    guess: Intrinsics,
    run: &Run,
) -> Result<Reconstruction, Stopped> {
    let found = general(table, options, keys, edges, guess, run)?;
    if found.verdict != SfmVerdict::Failed || foretells(&found.figures) {
        return Ok(found);
    }
    let turning = rotation_only(table, options, keys, edges, guess, run)?;
    let nothing_else = found.figures.points == 0;
    let as_well = nothing_else || turning.figures.rms_px <= MAX_ROTATION_LOSS * found.figures.rms_px;
    Ok(if turning.verdict == SfmVerdict::RotationOnly && as_well { turning } else { found })
}

/// A map of a scene with depth, whatever that is worth.
fn general(
    table: &TrackTable,
    options: &SfmOptions,
    keys: &[usize],
    edges: &[Edge],
    guess: Intrinsics,
    run: &Run,
) -> Result<Reconstruction, Stopped> {
    let (camera, lens) = match (options.focal, shared_focal(table, edges, run)?) {
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
    let edges = view_graph(table, keys, &camera, lens.sigma_ln_focal.exp(), run)?;
    let mut seeds: Vec<&Edge> = edges.iter().filter(|e| is_seed(e)).collect();
    seeds.sort_by(|a, b| b.strength().total_cmp(&a.strength()));
    let starts = seeds.into_iter().take(SEEDS).map(|seed| (seed, seed.view.poses[0]));
    let empty = Mapper::new(table, keys, camera, lens, run);
    let mapper = grown(&empty, starts, |_| Ok(0.0), run)?;
    run.step(0.4)?;
    let averaged = averaged(keys, &edges, run)?;
    let whole = mapper.as_ref().is_some_and(|m| m.registered().len() == keys.len() && agrees(m, keys, &averaged));
    let found = mapper.map(|m| finished(table, m, options, SfmVerdict::ThreeD, run)).transpose()?;
    if whole {
        return Ok(found.expect("a map was found"));
    }
    // Turning cameras have places too, made up ones, and they take as long to find.
    let general = edges.iter().filter(|e| e.view.verdict == TwoViewVerdict::General).count();
    let mut all = empty.clone();
    let placed = 2 * general >= edges.len() && place_all(table, &mut all, keys, &averaged, run)?;
    let rescued = placed.then(|| finished(table, all, options, SfmVerdict::ThreeD, run)).transpose()?;
    Ok(match (found, rescued) {
        (Some(found), Some(rescued)) => better(found, rescued),
        (found, rescued) => found.or(rescued).unwrap_or_else(|| {
            nothing(table, camera, SfmVerdict::Failed, "no pair of keyframes carries a map".to_owned())
        }),
    })
}

/// Of two maps the one that is believed, of more frames, of smaller residuals.
fn better(a: Reconstruction, b: Reconstruction) -> Reconstruction {
    let worth = |r: &Reconstruction| (r.verdict.has_cameras(), r.figures.registered, -r.figures.rms_px);
    if worth(&b) > worth(&a) { b } else { a }
}

/// The map that loses fewest keyframes, `cost` added, of those that grow from the `starts`.
fn grown<'a, 'e>(
    empty: &Mapper<'a>,
    starts: impl Iterator<Item = (&'e Edge, CameraPose)>,
    cost: impl Fn(&mut Mapper<'a>) -> Result<f64, Stopped>,
    run: &Run,
) -> Result<Option<Mapper<'a>>, Stopped> {
    let mut best: Option<(f64, Mapper<'a>)> = None;
    for (seed, pose) in starts {
        let mut mapper = empty.clone();
        run.check()?;
        if !mapper.seed(seed.first, seed.second, pose)? {
            continue;
        }
        let lost = mapper.keyframes() - mapper.extend()?;
        let cost = lost as f64 + cost(&mut mapper)?;
        if best.as_ref().is_none_or(|(least, _)| cost < *least) {
            best = Some((cost, mapper));
        }
        if cost == 0.0 {
            break;
        }
    }
    Ok(best.map(|(_, mapper)| mapper))
}

/// A map of a plane, from the best of the poses that its homographies allow.
fn planar(
    table: &TrackTable,
    options: &SfmOptions,
    keys: &[usize],
    edges: &[Edge],
    guess: Intrinsics,
    run: &Run,
) -> Result<Reconstruction, Stopped> {
    let sigma = options.focal.map_or(VOTED_SIGMA, |(_, sigma)| sigma);
    let lens = LensPrior { sigma_ln_focal: sigma, sigma_k1: 0.1 * SIGMA_K1 };
    let mut seeds: Vec<&Edge> = edges.iter().filter(|e| e.view.verdict == TwoViewVerdict::Planar).collect();
    seeds.sort_by(|a, b| b.strength().total_cmp(&a.strength()));
    let starts = seeds.into_iter().take(SEEDS).flat_map(|s| s.view.poses.iter().map(move |p| (s, *p)));
    let miss = |mapper: &mut Mapper<'_>| {
        let report = mapper.adjust_all(false, GROWN)?;
        Ok(report.map_or(f64::INFINITY, |r| r.median_px))
    };
    let Some(mapper) = grown(&Mapper::new(table, keys, guess, lens, run), starts, miss, run)? else {
        let reason = "no pose explains the plane that the points move as".to_owned();
        return Ok(nothing(table, guess, SfmVerdict::Failed, reason));
    };
    finished(table, mapper, options, SfmVerdict::Planar, run)
}

/// Registers the frames between keyframes, adjusts everything and judges the result.
fn finished(
    table: &TrackTable,
    mut mapper: Mapper<'_>,
    options: &SfmOptions,
    verdict: SfmVerdict,
    run: &Run,
) -> Result<Reconstruction, Stopped> {
    let all: Vec<usize> = (0..table.frames()).collect();
    mapper.admit(&all);
    let missing: Vec<usize> = all.into_iter().filter(|&f| mapper.scene.poses[f].is_none()).collect();
    for frame in missing {
        mapper.register(frame)?;
    }
    mapper.triangulate_new()?;
    run.step(0.7)?;
    let (mapper, report) = settled(mapper, options, false)?;
    concluded(table, mapper, report, verdict, run)
}

/// The cameras of a shot that shows no parallax.
fn rotation_only(
    table: &TrackTable,
    options: &SfmOptions,
    keys: &[usize],
    edges: &[Edge],
    guess: Intrinsics,
    run: &Run,
) -> Result<Reconstruction, Stopped> {
    let focal = if options.focal.is_some() { None } else { focal_of_turns(edges, &guess) };
    let camera = Intrinsics { focal: focal.unwrap_or(guess.focal), ..guess };
    let sigma_ln_focal = options.focal.map_or(TURNED_SIGMA, |(_, sigma)| sigma);
    let mut mapper = Mapper::new(table, keys, camera, LensPrior { sigma_ln_focal, sigma_k1: SIGMA_K1 }, run);
    mapper.admit(&(0..table.frames()).collect::<Vec<_>>());
    turn_cameras(table, &mut mapper, keys, edges, run)?;
    run.step(0.7)?;
    let (mapper, report) = settled(mapper, options, true)?;
    concluded(table, mapper, report, SfmVerdict::RotationOnly, run)
}

/// Adjusts a complete map; with a readout where one is allowed and the residuals show it.
fn settled<'a>(
    mut mapper: Mapper<'a>,
    options: &SfmOptions,
    turning: bool,
) -> Result<(Mapper<'a>, Option<BundleReport>), Stopped> {
    let rough = Last { turning, ..Last::ROUGH };
    let mut sample = mapper.sample(FEW_SIGHTINGS);
    let still = mapper.finish(&mut sample, rough)?;
    let mut rolling = false;
    if let Some(still) = still.filter(|_| options.rolling_shutter) {
        let mut moving = sample.clone();
        let found = mapper.finish(&mut moving, Last { rolling: true, ..rough })?;
        rolling = found.is_some_and(|r| r.cost < CLEAR_GAIN * still.cost)
            && (MIN_READOUT..MAX_READOUT).contains(&moving.scene.readout);
        if rolling {
            sample = moving;
        }
    }
    mapper.take_cameras(sample)?;
    mapper.discard_wrong();
    if !turning {
        mapper.triangulate_new()?;
    }
    let mut sample = mapper.sample(ENOUGH_SIGHTINGS);
    let report = mapper.finish(&mut sample, Last { rolling, turning, ..Last::FINE })?;
    mapper.take_cameras(sample)?;
    mapper.discard_wrong();
    Ok((mapper, report))
}

/// Measures and judges a finished map.
fn concluded(
    table: &TrackTable,
    mapper: Mapper<'_>,
    report: Option<BundleReport>,
    verdict: SfmVerdict,
    run: &Run,
) -> Result<Reconstruction, Stopped> {
    let figures = figures(table, &mapper.scene, report.and_then(|r| r.sigma_ln_focal), run)?;
    let (verdict, reason) =
        judged(&figures, mapper.scene.intrinsics.k1, verdict, f64::from(table.width.max(table.height)) / 640.0);
    Ok(Reconstruction { scene: mapper.scene, verdict, reason, figures })
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
