//! `plumbline compose`: parts of two meshes joined into one.

use std::path::PathBuf;

use super::mesh_stages::{mesh, saved};
use super::prelude::*;
use crate::stages::ComposeSettings;

/// Options of `plumbline compose`.
#[derive(Debug, Args)]
pub(super) struct ComposeArgs {
    /// The base mesh, which keeps its position
    #[arg(value_name = "BASE")]
    base: PathBuf,
    /// The mesh from which a part is added
    #[arg(value_name = "PART")]
    part: PathBuf,
    /// The file to write; its extension chooses the format
    #[arg(short, long, value_name = "OUTPUT")]
    output: PathBuf,

    #[command(flatten)]
    compose: Given<Compose>,
}

/// Options for `mesh.compose`.
struct Compose;

impl Offer for Compose {
    type Kind = ComposeSettings;
    const SETTINGS: &'static [Setting] =
        &[Setting::of("seam").value("FILE.json"), Setting::of("report").value("FILE.html|FILE.json")];
}

impl BuildsPipeline for ComposeArgs {
    fn pipeline(&self) -> Result<PipelineFile, Failure> {
        let stages = vec![
            mesh("base", literal_path(&self.base)),
            mesh("part", literal_path(&self.part)),
            StageEntry::built("composed", &self.compose.settings).input("base", "base").input("part", "part"),
            saved(&self.output, 1, "composed"),
        ];
        Ok(PipelineFile::built("compose", stages))
    }
}
