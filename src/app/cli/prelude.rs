//! What every command that builds a pipeline is written with.

pub(super) use clap::Args;

pub(super) use super::failure::Failure;
pub(super) use super::job::BuildsPipeline;
pub(super) use super::options::{Given, Offer, Setting};
pub(super) use crate::pipeline::file::literal_path;
pub(super) use crate::pipeline::{PipelineFile, StageEntry};
