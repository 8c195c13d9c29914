//! `video.smooth`: plans the virtual camera.

use super::prelude::*;
use crate::pipeline::paths::unescaped;
use plumbline_video::motion::ClipMotion;
pub use plumbline_video::path::Zoom;
pub use plumbline_video::stabilize::{InSpace, PathMethod, SmoothingOptions as SmoothSettings};
use plumbline_video::stabilize::{Tracks, plan_path};

impl Stage for SmoothSettings {
    const KIND: &'static str = "video.smooth";
    const SUMMARY: &'static str = "plans the path of the virtual camera under a crop budget";
    const INPUTS: &'static [Port] = &[
        Port::one("motion", PortType::Motion, "motion of the real camera"),
        Port::optional("tracks", PortType::Tracks, "points of the clip, for virtual cameras in space"),
    ];
    const OUTPUTS: &'static [Port] = &[Port::one("path", PortType::Path, "path of the virtual camera")];
    type Input = Wired;
    type Output = HandedOn;

    fn over_time(&self) -> TemporalScope {
        TemporalScope::Reduce
    }

    fn conflicts(&self) -> Vec<Conflict> {
        let help = "choose `fixed` or `adaptive`, or let borders show (`--border mirror`, `keep_inside = false`)";
        let message = "`zoom` = \"none\" leaves no room to move the picture while no border may show".to_owned();
        let zoom = self.leaves_no_room().then_some(Conflict { key: "zoom", message, help });
        let message = "`filled` has no effect while nothing outside the picture may show".to_owned();
        let help = "set `keep_inside = false` too";
        let filled = (self.filled && self.keep_inside).then_some(Conflict { key: "filled", message, help });
        zoom.into_iter().chain(filled).collect()
    }

    fn memory(&self) -> Vec<MemoryCost> {
        // One homography and one crop per frame, and the optimizer's rows of the same order.
        vec![MemoryCost { what: "path", bytes_per_clip_frame: 80.0, ..MemoryCost::default() }]
    }

    fn reads(&self) -> Vec<&str> {
        self.path_file.as_deref().and_then(std::path::Path::to_str).into_iter().collect()
    }

    fn run(&self, Wired { stage }: Wired, context: &mut Context<'_, '_>) -> Result<HandedOn, RunError> {
        let motion: &ClipMotion = context.values.get(context.required(stage, "motion")?)?;
        let tracks: Option<&Tracks> = context.edge(stage, "tracks").map(|edge| context.values.get(edge)).transpose()?;
        let options = Self { path_file: self.path_file.as_deref().map(unescaped), ..self.clone() };
        let path = plan_path(motion, tracks, &options, &context.job.run())?;
        context.values.put(stage, "path", path);
        Ok(HandedOn)
    }
}
