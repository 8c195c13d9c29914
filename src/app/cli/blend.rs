//! `plumbline blend`: two meshes blended with painted weights.

use std::path::PathBuf;

use super::mesh_stages::{mesh, saved};
use super::prelude::*;
use crate::stages::BlendSettings;

/// Options of `plumbline blend`.
#[derive(Debug, Args)]
pub(super) struct BlendArgs {
    /// The mesh where 0 is painted, whose faces the blend has
    #[arg(value_name = "FIRST")]
    first: PathBuf,
    /// The mesh where 1 is painted: another pose of the first, or any mesh with --landmarks
    #[arg(value_name = "SECOND")]
    second: PathBuf,
    /// The file to write; its extension chooses the format
    #[arg(short, long, value_name = "OUTPUT")]
    output: PathBuf,

    #[command(flatten)]
    blend: Given<Blend>,
}

/// Options for `mesh.blend`.
struct Blend;

impl Offer for Blend {
    type Kind = BlendSettings;
    const SETTINGS: &'static [Setting] = &[
        Setting::of("paint").value("FILE.json"),
        Setting::of("frames"),
        Setting::of("landmarks").under("Method"),
        Setting::of("iterations").under("Method"),
        Setting::of("report").value("FILE.html|FILE.json"),
    ];
}

impl BuildsPipeline for BlendArgs {
    fn pipeline(&self) -> Result<PipelineFile, Failure> {
        let blend = &self.blend.settings;
        let stages = vec![
            mesh("first", literal_path(&self.first)),
            mesh("second", literal_path(&self.second)),
            StageEntry::built("blend", blend).input("mesh", "first").input("other", "second"),
            saved(&self.output, blend.frames, "blend"),
        ];
        Ok(PipelineFile::built("blend", stages))
    }
}
