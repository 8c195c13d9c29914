//! Scenes and rooms rendered by rule, with known cameras: inputs of tests, examples and benches.

pub mod plane;
pub mod room;
pub mod scene;
