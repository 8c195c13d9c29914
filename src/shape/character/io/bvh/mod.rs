//! Biovision hierarchies (`.bvh`): joint offsets, and Euler angles per frame.
//!
//! ```text
//! world_from_joint = world_from_parent · T(OFFSET + position channels) · R(first angle) · R(second) · R(third)
//! ```
//!
//! Angles follow the order of the channels, in degrees. Frames at rest are axis-aligned. An `End Site` with a non-zero offset becomes a
//! joint named after its parent with the suffix ` end`, so that the last bone has an end.
//!
//! A skeleton with rotated rest frames is written by the world rotations of its joints from rest: `A_j = G_j G_j,rest⁻¹`, as Euler angles
//! of `A_parent⁻¹ A_j`.

mod read;
#[cfg(test)]
mod tests;
mod write;

pub use read::parse_bvh;
pub use write::bvh_text;

/// Format name in messages.
const FORMAT: &str = "BVH";

/// Name suffix of a joint that was an `End Site`.
const END: &str = " end";

/// Largest depth of the hierarchy, in joints: each of its lines is indented by it.
const MAX_DEPTH: usize = 1 << 12;
