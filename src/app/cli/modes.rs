//! `plumbline modes`: vibration modes of a mesh, and its near-rigid parts.

use std::path::PathBuf;

use super::mesh_stages::mesh;
use super::prelude::*;
use crate::stages::MeshModesSettings;

/// Options of `plumbline modes`.
#[derive(Debug, Args)]
#[command(group = clap::ArgGroup::new("targets").required(true).multiple(true).args(["output", "parts"]))]
pub(super) struct ModesArgs {
    /// The mesh: OBJ, PLY, OFF, STL, glTF, GLB or FBX
    #[arg(value_name = "MESH")]
    input: PathBuf,
    #[command(flatten)]
    modes: Given<Modes>,
}

/// Options for `mesh.modes`.
struct Modes;

impl Offer for Modes {
    type Kind = MeshModesSettings;
    const SETTINGS: &'static [Setting] = &[
        Setting::of("count").short('k'),
        Setting::of("modes").named("output").short('o').value("FILE.npz"),
        Setting::of("parts").value("FILE.json"),
        Setting::of("part_count").requires("parts"),
        Setting::of("cotangents"),
    ];
}

impl BuildsPipeline for ModesArgs {
    fn pipeline(&self) -> Result<PipelineFile, Failure> {
        let modes = StageEntry::built("modes", &self.modes.settings).input("mesh", "mesh");
        Ok(PipelineFile::built("modes", vec![mesh("mesh", literal_path(&self.input)), modes]))
    }
}
