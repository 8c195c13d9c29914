//! Models assigned to the frames of a clip: cameras per frame, and the observations of the images as tracks.

use std::collections::{BTreeMap, HashMap};
use std::ops::Range;

use super::{ColmapError, Image, Model};
use crate::motion::sfm::{SfmFigures, SfmVerdict};
use crate::motion::{ClipCameras, FrameCamera, ShotCameras, WorldPoint};
use crate::track::Observation;
use plumbline_camera::{Intrinsics, Vec3};

/// Columns and rows of the cells in which coverage is counted; a coarse grid of nearly square cells at 4:3.
const CELLS: (usize, usize) = (8, 6);

/// The models of a clip, frame by frame.
#[derive(Clone, Debug, PartialEq)]
pub struct ImportedClip {
    /// One shot per model.
    pub cameras: ClipCameras,
    /// Per frame the observations of its image, ids ascending; none where there is no image.
    pub tracks: Vec<Vec<Observation>>,
    /// The shots, in order, without gaps.
    pub shots: Vec<ImportedShot>,
}

/// The frames of one model.
#[derive(Clone, Debug, PartialEq)]
pub struct ImportedShot {
    /// From its first image, or the clip's first frame, to that of the next model.
    pub frames: Range<usize>,
    /// Frames that have an image.
    pub images: usize,
}

impl ImportedClip {
    /// Assigns `models` to a clip of `frames` frames of `width × height` px.
    ///
    /// Where there are as many images as frames, they are assigned in the order of the numbers in their names. Otherwise that
    /// number is the frame, counted from 0, or from 1 where one equals the number of frames.
    ///
    /// # Errors
    /// [`ColmapError::Misfit`]: no image, a name without a number, a frame that does not exist or has two images, models whose
    /// frames interleave, a camera of another size.
    pub fn new(models: &[Model], frames: usize, (width, height): (u32, u32)) -> Result<Self, ColmapError> {
        let frame_of = frames_of_images(models, frames)?;
        let mut order: Vec<usize> = (0..models.len()).filter(|&m| !frame_of[m].is_empty()).collect();
        order.sort_by_key(|&m| frame_of[m].values().min().copied());
        let first = |m: usize| frame_of[m].values().min().copied().unwrap_or(0);
        let last = |m: usize| frame_of[m].values().max().copied().unwrap_or(0);
        if let Some(pair) = order.windows(2).find(|w| last(w[0]) >= first(w[1])) {
            return Err(ColmapError::Misfit(format!(
                "two models have frames {} to {} and {} to {}, which interleave; give one of them",
                first(pair[0]),
                last(pair[0]),
                first(pair[1]),
                last(pair[1])
            )));
        }
        let mut found = Self {
            cameras: ClipCameras { frames: vec![None; frames], ..ClipCameras::default() },
            tracks: vec![Vec::new(); frames],
            shots: Vec::new(),
        };
        for (shot, &m) in order.iter().enumerate() {
            let start = if shot == 0 { 0 } else { first(m) };
            let end = order.get(shot + 1).map_or(frames, |&next| first(next));
            found.shots.push(ImportedShot { frames: start..end, images: frame_of[m].len() });
            found.push(&models[m], &frame_of[m], (width, height))?;
        }
        Ok(found)
    }

    /// Adds the model of the shot that was added last.
    fn push(&mut self, model: &Model, frame_of: &BTreeMap<u32, usize>, size: (u32, u32)) -> Result<(), ColmapError> {
        let shot = self.shots.len() as u32 - 1;
        let lenses = lenses(model, size)?;
        let from = self.cameras.points.last().map_or(0, |p| p.id + 1);
        let mut points: Vec<_> = model.points.iter().collect();
        points.sort_by_key(|p| p.id);
        let ids: HashMap<u64, u32> = points.iter().zip(from..).map(|(p, id)| (p.id, id)).collect();
        self.cameras.points.extend(points.iter().zip(from..).map(|(p, id)| WorldPoint {
            shot,
            id,
            position: p.position,
        }));
        let mut measures = Measures::default();
        for image in &model.images {
            let (Some(&frame), Some(&intrinsics)) = (frame_of.get(&image.id), lenses.get(&image.camera)) else {
                continue;
            };
            let camera = FrameCamera { pose: image.pose, intrinsics };
            self.cameras.frames[frame] = Some(camera);
            self.tracks[frame] = observations(image, &ids, size);
            let world = &self.cameras.points;
            measures.add(&camera, &self.tracks[frame], |id| world[id as usize], size);
        }
        let frames = self.shots[shot as usize].frames.clone();
        let figures =
            measures.figures(frames.len(), lenses.values().map(|l| l.focal).sum::<f64>() / lenses.len() as f64);
        let reason = format!(
            "read from a COLMAP model: {} of {} frames, {} points, reprojection error {:.2} px",
            figures.registered, figures.frames, figures.points, figures.reprojection_px
        );
        self.cameras.shots.push(ShotCameras { frames, verdict: SfmVerdict::ThreeD, reason, figures });
        Ok(())
    }
}

/// By model, by image, the frame.
fn frames_of_images(models: &[Model], frames: usize) -> Result<Vec<BTreeMap<u32, usize>>, ColmapError> {
    let mut numbered = Vec::new();
    for (m, image) in models.iter().enumerate().flat_map(|(m, model)| model.images.iter().map(move |i| (m, i))) {
        let misfit = || ColmapError::Misfit(format!("image {:?} has no frame number in its name", image.name));
        numbered.push((number_in(&image.name).ok_or_else(misfit)?, m, image));
    }
    if numbered.is_empty() {
        return Err(ColmapError::Misfit("the model has no image".to_owned()));
    }
    numbered.sort_by_key(|(number, ..)| *number);
    if let Some(pair) = numbered.windows(2).find(|w| w[0].0 == w[1].0) {
        let (a, b) = (&pair[0].2.name, &pair[1].2.name);
        return Err(ColmapError::Misfit(format!("images {a:?} and {b:?} are of the same frame; give one model of it")));
    }
    let in_order = numbered.len() == frames;
    let base = u64::from(numbered.last().is_some_and(|l| l.0 == frames as u64) && numbered[0].0 > 0);
    let mut frame_of = vec![BTreeMap::new(); models.len()];
    for (k, (number, m, image)) in numbered.into_iter().enumerate() {
        let frame = if in_order { k } else { usize::try_from(number - base).unwrap_or(usize::MAX) };
        if frame >= frames {
            let message = format!("image {:?} is of frame {frame}, and the clip has {frames} frames", image.name);
            return Err(ColmapError::Misfit(message));
        }
        frame_of[m].insert(image.id, frame);
    }
    Ok(frame_of)
}

/// The last number in the name of a file, its extension left out.
fn number_in(name: &str) -> Option<u64> {
    let stem = name.rsplit_once('.').map_or(name, |(stem, _)| stem);
    let end = stem.rfind(|c: char| c.is_ascii_digit())? + 1;
    let start = stem[..end]
        .rfind(|c: char| !c.is_ascii_digit())
        .map_or(0, |at| at + stem[at..].chars().next().map_or(1, char::len_utf8));
    stem[start..end].parse().ok()
}

/// The lenses by camera, all of the clip's size.
fn lenses(model: &Model, (width, height): (u32, u32)) -> Result<HashMap<u32, Intrinsics>, ColmapError> {
    let other = model.cameras.iter().find(|c| (c.width, c.height) != (u64::from(width), u64::from(height)));
    if let Some(c) = other {
        let message = format!("camera {} is of {}×{} px, and the clip of {width}×{height} px", c.id, c.width, c.height);
        return Err(ColmapError::Misfit(message));
    }
    Ok(model.cameras.iter().map(|c| (c.id, c.intrinsics)).collect())
}

/// The observations of known points inside the picture, each once, ids ascending.
fn observations(image: &Image, ids: &HashMap<u64, u32>, (width, height): (u32, u32)) -> Vec<Observation> {
    let inside = |x: f64, size: u32| (0.0..=f64::from(size)).contains(&x);
    let seen = image.observations.iter().filter(|s| inside(s.at.x, width) && inside(s.at.y, height));
    let observation = |s: &super::ImageObservation| {
        let id = *ids.get(&s.point?)?;
        Some(Observation { id, x: s.at.x as f32, y: s.at.y as f32, background: true })
    };
    let mut found: Vec<Observation> = seen.filter_map(observation).collect();
    found.sort_by_key(|o| o.id);
    found.dedup_by_key(|o| o.id);
    found
}

/// Sums over the observations of a shot.
#[derive(Default)]
struct Measures {
    images: usize,
    observations: usize,
    sum: f64,
    squares: f64,
    covered: usize,
    /// By point: the ray of its first observation, and the widest angle to it.
    rays: HashMap<u32, (Vec3, f64)>,
}

impl Measures {
    fn add(
        &mut self,
        camera: &FrameCamera,
        seen: &[Observation],
        point: impl Fn(u32) -> WorldPoint,
        (width, height): (u32, u32),
    ) {
        self.images += 1;
        let mut cells = [false; CELLS.0 * CELLS.1];
        let cell = |x: f32, size: u32, n: usize| ((f64::from(x) / f64::from(size) * n as f64) as usize).min(n - 1);
        for o in seen {
            let position = point(o.id).position;
            let Some(expected) = camera.intrinsics.project(&camera.pose.apply(&position)) else { continue };
            let error = (expected.x - f64::from(o.x)).hypot(expected.y - f64::from(o.y));
            (self.sum, self.squares) = (self.sum + error, self.squares + error * error);
            self.observations += 1;
            cells[cell(o.y, height, CELLS.1) * CELLS.0 + cell(o.x, width, CELLS.0)] = true;
            let ray = position - camera.pose.center();
            let (first, widest) = self.rays.entry(o.id).or_insert((ray, 0.0));
            *widest = widest.max(first.angle(&ray));
        }
        self.covered += cells.iter().filter(|c| **c).count();
    }

    fn figures(&self, frames: usize, focal: f64) -> SfmFigures {
        let mut angles: Vec<f64> = self.rays.values().map(|r| r.1).collect();
        angles.sort_by(f64::total_cmp);
        let n = self.observations.max(1) as f64;
        SfmFigures {
            registered: self.images,
            frames,
            points: angles.len(),
            observations: self.observations,
            reprojection_px: self.sum / n,
            rms_px: (self.squares / n).sqrt(),
            angle: angles.get(angles.len() / 2).copied().unwrap_or(0.0),
            coverage: self.covered as f64 / (CELLS.0 * CELLS.1 * self.images.max(1)) as f64,
            focal,
            sigma_ln_focal: None,
            ..SfmFigures::default()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_number_in_a_name_is_the_last_one_before_its_extension() {
        for (name, number) in [
            ("frame_000012.png", Some(12)),
            ("shot 2/cam1_0007.jp2", Some(7)),
            ("ä7ö", Some(7)),
            ("12", Some(12)),
            ("frame.png", None),
            ("99999999999999999999.png", None),
        ] {
            assert_eq!(number_in(name), number, "{name}");
        }
    }
}
