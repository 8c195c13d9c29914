//! Readers of nodes, skins, morph targets and animations.

pub(super) mod animations;
pub(super) mod nodes;
pub(super) mod skins;
pub(super) mod targets;

use crate::mesh::model::articulation::{ChannelInterpolation, Property};

/// The names of animated properties, and the types of their values.
pub(super) const PROPERTIES: [(Property, &str, &str); 4] = [
    (Property::Translation, "translation", "VEC3"),
    (Property::Rotation, "rotation", "VEC4"),
    (Property::Scale, "scale", "VEC3"),
    (Property::Weights, "weights", "SCALAR"),
];

/// The names of interpolations.
pub(super) const INTERPOLATIONS: [(ChannelInterpolation, &str); 3] = [
    (ChannelInterpolation::Linear, "LINEAR"),
    (ChannelInterpolation::Step, "STEP"),
    (ChannelInterpolation::CubicSpline, "CUBICSPLINE"),
];
