//! Virtual cameras in space, joined to the planner of paths in the picture.
//!
//! A virtual camera `V_t` shows the scene's points at `q = V_t X`. In the picture that is, near enough for planning, a
//! similarity `G_t` (`shown_from_src`), fitted over the points a frame sees. The planner gets the motion that a film of these
//! views would show,
//!
//! ```text
//! F_t = G_t⁻¹ P_t G_{t−1},      P_t: similarity from the views of frame t − 1 to those of frame t,
//! ```
//!
//! and answers with windows `W_t` (`out_from_src`) inside the frames. The correction `D_t = W_t G_t⁻¹` then maps a
//! view to the output: it contains crop and zoom, and is as smooth as the planned path.

mod fit;
mod point_targets;
mod scene_points;
mod steadied;
mod views;

pub(super) use point_targets::point_targets;
pub(super) use scene_points::{ScenePoints, viewing_direction};
pub(super) use steadied::steadied;
pub(super) use views::{TargetPose, Views};
