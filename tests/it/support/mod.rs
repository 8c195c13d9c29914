//! What tests of several areas share.

pub(crate) mod clips;
pub(crate) mod jobs;
pub(crate) mod missing;
pub(crate) mod models;
pub(crate) mod program;
pub(crate) mod shots;
