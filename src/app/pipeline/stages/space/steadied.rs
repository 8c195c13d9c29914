//! Virtual cameras whose pictures move on evenly.

use super::fit::Fit;
use super::places::Places;
use crate::pipeline::run_error::RunError;
use crate::pipeline::stages::analysis::{Tracks, store_error};
use plumbline_video::path::{SteadyView, TrajectoryOptions, VirtualCamera};

/// The virtual cameras of a clip with corrections that let the viewer's picture as a whole move on evenly.
///
/// The planned windows keep inside the frame by turning corners. A mesh that follows trajectories rounds them off
/// ([`plumbline_video::path::TrajectorySmoother`]); in space the same is done for all points together, by the similarity from what a
/// camera shows to what a [`SteadyView`] shows, so that each point stays where its depth puts it.
pub(in crate::pipeline::stages) fn steadied(
    cameras: &[Option<VirtualCamera>],
    tracks: &Tracks,
    places: &Places<'_>,
    times_s: &[f64],
) -> Result<Vec<Option<VirtualCamera>>, RunError> {
    let sigma_s = TrajectoryOptions::default().sigma_s;
    let mut steady = vec![None; cameras.len()];
    for (segment, frame) in places.segments().flat_map(|segment| segment.clone().map(move |frame| (segment, frame))) {
        let Some(camera) = cameras[frame] else { continue };
        let Some(view) = SteadyView::new(cameras, times_s, segment, frame, sigma_s) else { continue };
        let mut fit = Fit::default();
        for o in &tracks.store.read(frame).map_err(store_error)?.observations {
            let Some(place) = places.of(frame, o, camera.turns) else { continue };
            if let Some((now, even)) = camera.show(&place).zip(view.show(&place)) {
                fit.add(now, even, 1.0);
            }
        }
        let correction = fit.robust_similarity().map_or(camera.correction, |even| even * camera.correction);
        steady[frame] = Some(VirtualCamera { correction, ..camera });
    }
    Ok(steady)
}
