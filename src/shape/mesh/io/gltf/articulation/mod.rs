//! Readers of nodes, skins, morph targets and animations.

pub(super) mod animations;
pub(super) mod nodes;
pub(super) mod skins;
pub(super) mod targets;
