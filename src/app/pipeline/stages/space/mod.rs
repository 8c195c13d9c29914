//! Virtual cameras in space, joined to the planner that thinks in the picture.
//!
//! A virtual camera `V_t` shows the scene's points at `q = V_t X`. In the picture that is, near enough for planning, a
//! similarity `G_t` (`shown_from_src`), fitted over the points a frame sees. The planner gets the motion that a film of these
//! views would show,
//!
//! ```text
//! F_t = G_t⁻¹ P_t G_{t−1},      P_t: similarity from the views of frame t − 1 to those of frame t,
//! ```
//!
//! and answers with windows `W_t` (`out_from_src`) inside the frames. What turns a view into the output is then the
//! correction `D_t = W_t G_t⁻¹`: it holds crop and zoom, and is as smooth as the planned path.

mod fit;
mod places;
mod shown;
mod steadied;
mod views;

pub(super) use places::{Places, direction};
pub(super) use shown::shown;
pub(super) use steadied::steadied;
pub(super) use views::{Views, Wanted};
