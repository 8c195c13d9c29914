//! `video.report`: tells what was done.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::pipeline::kind::{Conflict, Stage};
use crate::pipeline::memory::MemoryCost;
use crate::pipeline::port::{Port, PortType};
use crate::pipeline::port_value::{HandedOn, Wired};
use crate::pipeline::run_error::RunError;
use crate::pipeline::stages;
use crate::stages::context::Context;

/// Settings of `video.report`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ReportSettings {
    /// The page to write (HTML, complete in itself)
    #[schemars(extend("format" = "path"))]
    pub path: String,
}

impl Stage for ReportSettings {
    const KIND: &'static str = "video.report";
    const SUMMARY: &'static str =
        "tells what was done on one page: figures, plots of the path, pictures before and after";
    const INPUTS: &'static [Port] = &[
        Port::one("frames", PortType::Frames, "the pictures of the result"),
        Port::one("path", PortType::Path, "the virtual camera"),
        Port::one("motion", PortType::Motion, "the camera's own motion"),
    ];
    const OUTPUTS: &'static [Port] = &[Port::one("file", PortType::File, "the page")];
    const REQUIRED: &'static [&'static str] = &["path"];
    type Input = Wired;
    type Output = HandedOn;

    fn held(&self) -> Vec<MemoryCost> {
        // A dozen pictures of at most 640 px, twice while the page is put together; a dozen plots with two curves each, as
        // numbers and as text.
        vec![MemoryCost {
            what: "pictures and plots",
            bytes: 4 << 20,
            bytes_per_clip_frame: 480.0,
            ..MemoryCost::default()
        }]
    }

    fn conflicts(&self) -> Vec<Conflict> {
        let message = || "a page cannot be written to standard output".to_owned();
        let conflict = || Conflict { key: "path", message: message(), help: "give it a file, such as report.html" };
        (self.path == "-").then(conflict).into_iter().collect()
    }

    fn writes(&self) -> Vec<String> {
        vec![self.path.clone()]
    }

    fn run(&self, Wired { stage }: Wired, context: &mut Context<'_, '_>) -> Result<HandedOn, RunError> {
        stages::report(context, stage, self).map(|()| HandedOn)
    }

    fn preflight(&self) -> Result<(), RunError> {
        stages::preflight_report(self)
    }
}
