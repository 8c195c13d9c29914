//! Deformations of surfaces.

pub mod handle_file;
