//! Meshes: each stage is evaluated once, in the order of the graph.
//!
//! What flows is the model as it was read, by reference count, and beside it the poses that a deformation gave it: files are
//! written from the model, so that polygons, texture coordinates, groups and materials are those that were read.

mod animated;
mod binding;
mod deform;
mod extraction;
mod handles;
mod load;
mod modes;
mod posing;
mod render;
mod report;
mod save;
pub(super) mod solvable;
mod training;
mod weights;

use std::path::Path;
use std::sync::Arc;

use nalgebra::Point3;

use super::context::Context;
use crate::pipeline::kinds::{
    MeshDeformSettings, MeshLoadSettings, MeshModesSettings, MeshRenderSettings, MeshSaveSettings, PoseSettings,
    SkeletonExtractSettings, SkeletonLoadSettings, SkinTrainSettings, SkinWeightsSettings,
};
use crate::pipeline::run_error::RunError;
use plumbline_shape::mesh::{MeshError, Model};
pub(super) use save::rehearse;

/// A mesh between stages.
#[derive(Clone)]
pub(super) struct Posed {
    /// As it was read.
    pub(super) model: Arc<Model>,
    /// Positions of its vertices, pose by pose; none: as it was read.
    pub(super) poses: Arc<Vec<Vec<Point3<f64>>>>,
    /// Vertices of handles, and whether each moves.
    pub(super) handles: Arc<Vec<(u32, bool)>>,
}

impl Posed {
    pub(super) fn at_rest(model: Model) -> Self {
        Self { model: Arc::new(model), poses: Arc::default(), handles: Arc::default() }
    }

    /// Positions of the last pose.
    pub(super) fn last(&self) -> &[Point3<f64>] {
        self.poses.last().map_or_else(|| self.model.mesh().positions(), Vec::as_slice)
    }
}

/// Runs a stage of a kind that works on meshes; `None` for one of another kind.
pub(super) fn run(context: &mut Context<'_, '_>, stage: usize) -> Option<Result<(), RunError>> {
    let settings = context.stage(stage).settings.clone();
    Some(if let Some(settings) = settings.get::<MeshLoadSettings>() {
        load::run(context, stage, settings)
    } else if let Some(settings) = settings.get::<MeshDeformSettings>() {
        deform::run(context, stage, settings)
    } else if let Some(settings) = settings.get::<MeshModesSettings>() {
        modes::run(context, stage, settings)
    } else if let Some(settings) = settings.get::<SkinWeightsSettings>() {
        weights::run(context, stage, settings)
    } else if let Some(settings) = settings.get::<SkeletonLoadSettings>() {
        posing::load(context, stage, settings)
    } else if let Some(settings) = settings.get::<SkeletonExtractSettings>() {
        extraction::run(context, stage, settings)
    } else if let Some(settings) = settings.get::<SkinTrainSettings>() {
        training::run(context, stage, settings)
    } else if let Some(settings) = settings.get::<PoseSettings>() {
        posing::pose(context, stage, settings)
    } else if let Some(settings) = settings.get::<MeshRenderSettings>() {
        render::run(context, stage, settings)
    } else if let Some(settings) = settings.get::<MeshSaveSettings>() {
        save::run(context, stage, settings)
    } else {
        return None;
    })
}

/// The mesh at the input port.
fn mesh_at(context: &Context<'_, '_>, stage: usize) -> Result<Posed, RunError> {
    context.values.get::<Posed>(context.required(stage, "mesh")?).cloned()
}

/// An error of a mesh file in the terms of a run.
fn mesh_error(path: &Path, error: &MeshError) -> RunError {
    if let MeshError::Interrupted(stopped) = error {
        return (*stopped).into();
    }
    let text = match error {
        MeshError::InFile { .. } => error.to_string(),
        _ => format!("{}: {error}", path.display()),
    };
    if error.is_output() { RunError::Output(text) } else { RunError::Input(text) }
}
