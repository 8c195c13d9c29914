//! Virtual cameras with smoothed corrections.

use super::fit::Fit;
use super::scene_points::ScenePoints;
use crate::path::{SteadyView, TrajectoryOptions, VirtualCamera};
use crate::stabilize::error::StabilizeError;
use crate::stabilize::tracks::Tracks;
use plumbline_num::run::Run;

/// The virtual cameras of a clip with corrections that smooth the motion of the picture as a whole.
///
/// The planned windows stay inside the frame by abrupt changes of direction. A mesh that follows trajectories smooths them
/// ([`crate::path::TrajectorySmoother`]); in space this is done for all points together, by the similarity from the projections
/// into a camera to those into a [`SteadyView`], which preserves the parallax.
pub(in crate::stabilize) fn steadied(
    cameras: &[Option<VirtualCamera>],
    tracks: &Tracks,
    scene: &ScenePoints<'_>,
    times_s: &[f64],
    run: &Run,
) -> Result<Vec<Option<VirtualCamera>>, StabilizeError> {
    let sigma_s = TrajectoryOptions::default().sigma_s;
    let mut steady = vec![None; cameras.len()];
    for (segment, frame) in scene.segments().flat_map(|segment| segment.clone().map(move |frame| (segment, frame))) {
        run.check()?;
        let Some(camera) = cameras[frame] else { continue };
        let Some(view) = SteadyView::new(cameras, times_s, segment, frame, sigma_s) else { continue };
        let mut fit = Fit::default();
        for o in &tracks.store.read(frame)?.observations {
            let Some(point) = scene.of(frame, o, camera.rotation_only) else { continue };
            if let Some((now, even)) = camera.show(&point).zip(view.show(&point)) {
                fit.add(now, even, 1.0);
            }
        }
        let correction = fit.robust_similarity().map_or(camera.correction, |even| even * camera.correction);
        steady[frame] = Some(VirtualCamera { correction, ..camera });
    }
    Ok(steady)
}
