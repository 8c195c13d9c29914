//! Virtual cameras in space, joined to the planner of paths in the picture.
//!
//! A virtual camera `V_t` projects the scene's points to `q = V_t X`. For planning, this is approximated in the picture by a
//! similarity `G_t` (`shown_from_src`), fitted to the points of the frame. The planner gets the motion of these views,
//!
//! ```text
//! F_t = G_t⁻¹ P_t G_{t−1},      P_t: similarity from the views of frame t − 1 to those of frame t,
//! ```
//!
//! and returns windows `W_t` (`out_from_src`) inside the frames. The correction `D_t = W_t G_t⁻¹` maps a view to the output:
//! it contains crop and zoom, and is as smooth as the planned path.

mod fit;
mod point_targets;
mod scene_points;
mod steadied;
mod views;

pub(super) use point_targets::point_targets;
pub(super) use scene_points::{ScenePoints, viewing_direction};
pub(super) use steadied::steadied;
pub(super) use views::{TargetPose, Views};
