//! Biovision hierarchies (`.bvh`): joints by offsets from their parents, and their angles per frame.
//!
//! ```text
//! world_from_joint = world_from_parent · T(OFFSET + position channels) · R(first angle) · R(second) · R(third)
//! ```
//!
//! The angles stand in the order of the channels, in degrees. Frames at rest are turned as the world. An `End Site` with a length
//! becomes a joint called after its parent with ` end` behind it, so that the last bone has an end.
//!
//! Skeletons whose frames are turned at rest are written by the turns of their joints in the world from rest:
//! `A_j = G_j G_j,rest⁻¹` and angles of `A_parent⁻¹ A_j`.

mod read;
mod write;

pub use read::parse_bvh;
pub use write::bvh_text;

/// Of messages.
const FORMAT: &str = "BVH";

/// Behind the name of the joint whose bone it ends.
const END: &str = " end";
