//! `image.map_export`: writes the map of a still picture.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::pipeline::kind::{OverTime, StageSettings};
use crate::pipeline::memory::Held;
use crate::pipeline::port::{Port, PortType};

/// Settings of `image.map_export`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct MapExportSettings {
    /// Beginning of the files' names: PREFIX_x.npy, PREFIX_y.npy, PREFIX_mesh.npy and PREFIX.exr
    #[schemars(extend("format" = "path"))]
    pub path: String,
    /// Also write the map for compositors, as 32-bit EXR: R = x/W, G = 1 - y/H
    pub exr: bool,
}

impl Default for MapExportSettings {
    fn default() -> Self {
        Self { path: String::new(), exr: true }
    }
}

impl MapExportSettings {
    /// Source column and row of every pixel of the output, the grid, and the map for compositors.
    pub fn files(&self) -> [Option<String>; 4] {
        let file = |end: &str| Some(format!("{}{end}", self.path));
        [file("_x.npy"), file("_y.npy"), file("_mesh.npy"), file(".exr").filter(|_| self.exr)]
    }
}

impl StageSettings for MapExportSettings {
    const KIND: &'static str = "image.map_export";
    const SUMMARY: &'static str =
        "writes where each pixel comes from, and the grid: NumPy arrays, and EXR for compositors";
    const INPUTS: &'static [Port] = &[
        Port::one("image", PortType::Image, "the picture that the map is of, before it is sampled"),
        Port::one("warp", PortType::Warp, "the map"),
    ];
    const OUTPUTS: &'static [Port] = &[Port::one("file", PortType::File, "the files")];
    const REQUIRED: &'static [&'static str] = &["path"];

    fn over_time(&self) -> OverTime {
        OverTime::Once
    }

    fn held(&self) -> Vec<Held> {
        vec![Held { what: "the map at every pixel", bytes_per_px: 24.0, ..Held::default() }]
    }

    fn writes(&self) -> Vec<String> {
        self.files().into_iter().flatten().collect()
    }
}
