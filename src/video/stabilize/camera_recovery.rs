//! Camera motion beyond the planar: the readout time of the sensor, and the camera's poses in space.

use std::collections::HashSet;
use std::ops::Range;

use super::error::StabilizeError;
use super::options::CameraMotionOptions;
use super::rolling_shutter::RollingShutter;
use super::tracks::Tracks;
use crate::motion::sfm::{SfmOptions, ShotWindows, TrackTable, Windows, unit_px};
use crate::motion::{ClipCameras, ClipMotion, WindowCameras};
use crate::track::TrackStore;
use plumbline_num::math::Point2;
use plumbline_num::run::Run;

/// Standard deviation of the logarithm of the focal length in the metadata of a container: its whole millimeters are 4 % apart for
/// a phone, and a clip stabilized in the camera shows less than the sensor sees.
const SIGMA_LN_FOCAL: f64 = 0.05;

/// Adds to the motion of a clip, as `options` request: the readout time of its sensor, and its cameras in space where none are
/// known. `focal_px`: the focal length by the metadata of the clip.
///
/// # Errors
/// [`StabilizeError::Store`]: tracks cannot be read; [`StabilizeError::Interrupted`].
pub fn complete_motion(
    motion: &mut ClipMotion,
    tracks: &Tracks,
    options: &CameraMotionOptions,
    focal_px: Option<f64>,
    run: &Run,
) -> Result<(), StabilizeError> {
    match options.rolling_shutter {
        RollingShutter::Auto => {}
        RollingShutter::Off => motion.readout_s = None,
        RollingShutter::Readout(seconds) => motion.readout_s = Some(seconds),
    }
    if options.cameras && motion.cameras.is_none() {
        let recovery = CameraRecovery::new(motion, options, focal_px);
        let frames = 0..motion.frames.len();
        let first = recovery.shots.len() as f64 / recovery.windows_of(&frames).count().max(1) as f64;
        let mut found = recovery.leading(tracks, frames.clone(), &run.part(0.0, first))?;
        found.extend(recovery.following(tracks, frames, &found, &run.part(first, 1.0))?);
        motion.cameras = Some(recovery.join(found)?);
    }
    Ok(())
}

/// The cameras of a clip in space, window by window, so that several tasks can do it: structure from motion by [`ShotWindows`].
///
/// Each window belongs to the task that has its first frame among its `starts`. First the leading windows of all shots that start there
/// are solved, then, by any tasks, all others with what the leading ones show; the same cameras come of any partition.
///
/// ```no_run
/// use plumbline_num::run::Run;
/// # use plumbline_video::motion::{ClipMotion, ClipCameras};
/// # use plumbline_video::stabilize::{CameraMotionOptions, CameraRecovery, StabilizeError, Tracks};
/// # fn example(motion: &ClipMotion, tracks: &Tracks) -> Result<ClipCameras, StabilizeError> {
/// let (frames, run) = (motion.frames.len(), Run::default());
/// let recovery = CameraRecovery::new(motion, &CameraMotionOptions::default(), None);
/// let mut found = recovery.leading(tracks, 0..frames, &run)?;
/// for starts in [0..frames / 2, frames / 2..frames] {
///     let others = recovery.following(tracks, starts, &found, &run)?; // perhaps on another machine
///     found.extend(others);
/// }
/// recovery.join(found)
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct CameraRecovery {
    size: (u32, u32),
    shots: Vec<ShotWindows>,
    options: SfmOptions,
}

impl CameraRecovery {
    /// For the clip of `motion`, with its readout time where `options` ask for it; `focal_px`: the focal length by the metadata of the
    /// clip.
    pub fn new(motion: &ClipMotion, options: &CameraMotionOptions, focal_px: Option<f64>) -> Self {
        Self::in_windows(motion, options, focal_px, &Windows::default())
    }

    /// [`Self::new`] with other windows.
    pub fn in_windows(
        motion: &ClipMotion,
        options: &CameraMotionOptions,
        focal_px: Option<f64>,
        windows: &Windows,
    ) -> Self {
        Self {
            size: (motion.width, motion.height),
            shots: motion.shots.iter().map(|shot| ShotWindows::new(shot.clone(), windows)).collect(),
            options: SfmOptions {
                focal: focal_px.map(|focal| (focal, SIGMA_LN_FOCAL)),
                rolling_shutter: options.rolling_shutter != RollingShutter::Off,
            },
        }
    }

    /// Frames whose tracks are needed to solve all windows that start in `starts`, and, of shots that do, the leading ones.
    pub fn support(&self, starts: &Range<usize>) -> Range<usize> {
        let leading = self.shots_of(starts).flat_map(|shot| shot.leading(&self.options));
        let ends = self.windows_of(starts).map(|(_, window)| window).chain(leading).map(|window| window.end);
        starts.start..ends.max().unwrap_or(starts.start)
    }

    /// Solves the leading windows of the shots that start in `starts`.
    ///
    /// # Errors
    /// [`StabilizeError::Store`]: tracks cannot be read; [`StabilizeError::Interrupted`].
    pub fn leading(
        &self,
        tracks: &Tracks,
        starts: Range<usize>,
        run: &Run,
    ) -> Result<Vec<WindowCameras>, StabilizeError> {
        let mut found = Vec::new();
        let shots: Vec<&ShotWindows> = self.shots_of(&starts).collect();
        for (k, shot) in shots.iter().enumerate() {
            let read = |frames| self.table(tracks, frames, run);
            let solved = shot.solve_leading(read, &self.options, &part(run, k, shots.len()))?;
            let named = shot.ranges().iter().cloned().zip(solved);
            found.extend(named.map(|(frames, segments)| WindowCameras { frames, segments }));
        }
        Ok(found)
    }

    /// Solves all windows that start in `starts` and are not in `leading`, which has those of their shots.
    ///
    /// # Errors
    /// As for [`Self::leading`].
    pub fn following(
        &self,
        tracks: &Tracks,
        starts: Range<usize>,
        leading: &[WindowCameras],
        run: &Run,
    ) -> Result<Vec<WindowCameras>, StabilizeError> {
        let known: HashSet<&Range<usize>> = leading.iter().map(|known| &known.frames).collect();
        let windows: Vec<_> = self.windows_of(&starts).filter(|(_, window)| !known.contains(window)).collect();
        let mut found = Vec::new();
        for (k, (shot, window)) in windows.iter().enumerate() {
            let of_shot = leading.iter().filter(|known| shot.ranges().contains(&known.frames));
            let options = ShotWindows::following(&self.options, of_shot.map(|known| known.segments.as_slice()));
            let read = |frames| self.table(tracks, frames, run);
            let segments = ShotWindows::solve(window, read, &options, &part(run, k, windows.len()))?;
            found.push(WindowCameras { frames: (*window).clone(), segments });
        }
        Ok(found)
    }

    /// The cameras of the clip from those of all windows, in any order.
    ///
    /// # Errors
    /// [`StabilizeError::Input`] where a window of the clip is missing, or one of another clip is there.
    pub fn join(&self, mut found: Vec<WindowCameras>) -> Result<ClipCameras, StabilizeError> {
        let other = || StabilizeError::Input("the cameras of a part are not of this clip; plan it again".to_owned());
        found.sort_by_key(|known| (known.frames.start, known.frames.end));
        let mut found = found.into_iter();
        let mut cameras = ClipCameras::default();
        let unit_px = unit_px(self.size.0, self.size.1);
        for shot in &self.shots {
            let mut segments = Vec::new();
            for window in shot.ranges() {
                let known = found.next().filter(|known| known.frames == *window).ok_or_else(other)?;
                segments.push(known.segments);
            }
            for segment in ShotWindows::join(segments, unit_px) {
                cameras.push(segment);
            }
        }
        found.next().map_or(Ok(cameras), |_| Err(other()))
    }

    fn shots_of(&self, starts: &Range<usize>) -> impl Iterator<Item = &ShotWindows> {
        self.shots.iter().filter(|shot| shot.ranges().first().is_some_and(|first| starts.contains(&first.start)))
    }

    fn windows_of(&self, starts: &Range<usize>) -> impl Iterator<Item = (&ShotWindows, &Range<usize>)> {
        let all = self.shots.iter().flat_map(|shot| shot.ranges().iter().map(move |window| (shot, window)));
        all.filter(|(_, window)| starts.contains(&window.start))
    }

    fn table(&self, tracks: &Tracks, frames: Range<usize>, run: &Run) -> Result<TrackTable, StabilizeError> {
        run.check()?;
        let read = |frame: usize| points_of(&tracks.store, frames.start + frame);
        TrackTable::read(self.size.0, self.size.1, frames.len(), read)
    }
}

/// The part of a run that is for one of `count` windows.
fn part(run: &Run, index: usize, count: usize) -> Run {
    run.part(index as f64 / count as f64, (index + 1) as f64 / count as f64)
}

fn points_of(store: &TrackStore, frame: usize) -> Result<Vec<(u32, Point2)>, StabilizeError> {
    let seen = store.read(frame)?.observations;
    Ok(seen.into_iter().map(|o| (o.id, Point2::new(f64::from(o.x), f64::from(o.y)))).collect())
}
