//! `video.warp`: a map per frame; no pixel is touched.

use super::prelude::*;
pub use plumbline_video::stabilize::{ModelChoice, WarpOptions as WarpSettings};

/// Frames over which points fade in and out.
const FADE: u32 = 25;

impl Stage for WarpSettings {
    const KIND: &'static str = "video.warp";
    const SUMMARY: &'static str = "finds the map of each frame from the output to the source";
    const INPUTS: &'static [Port] = &[
        Port::one("tracks", PortType::Tracks, "points that pull the mesh"),
        Port::one("path", PortType::Path, "where the picture shall be"),
        Port::optional("motion", PortType::Motion, "motion within the frame, for rolling shutter"),
    ];
    const OUTPUTS: &'static [Port] = &[Port::one("warp", PortType::Warp, "one map per frame")];
    const MAP: Option<MapStep> = Some(MapStep::Steady);
    type Input = Wired;
    type Output = HandedOn;

    fn over_time(&self) -> TemporalScope {
        TemporalScope::Window(FADE)
    }

    fn memory(&self) -> Vec<MemoryCost> {
        // Two unknowns per vertex; a nested-dissection factor of a grid of this size has about 60 entries per unknown.
        let unknowns = 2 * u64::from(self.columns + 1) * u64::from(self.rows + 1);
        vec![MemoryCost { what: "mesh and its factor", bytes: unknowns * (60 * 8 + 4 * 8), ..MemoryCost::default() }]
    }

    // Only describes a stream: the stage at its end pulls frames through it.
    fn run(&self, _input: Wired, _context: &mut Context<'_, '_>) -> Result<HandedOn, RunError> {
        Ok(HandedOn)
    }
}
