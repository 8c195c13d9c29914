//! Structure from motion: the cameras of a clip and the points they saw, from tracks alone.

mod absolute_pose;
mod correspondence;
mod essential;
mod essential_pose;
mod five_point;
mod focal;
mod fundamental;
mod golden_section;
mod gric;
mod homography_poses;
mod homography_search;
mod null_space;
mod polynomial;
mod rotation_averaging;
mod rotation_fit;
mod sampson;
mod scene;
#[cfg(test)]
mod synthetic;
mod three_point;
mod triangulate;
mod two_view;
mod view_graph_focal;

pub use absolute_pose::absolute_pose;
pub use correspondence::Correspondence;
pub use essential::refine_relative_pose;
pub use essential_pose::{pose_of_essential, poses_of_essential};
pub use five_point::five_point;
pub use focal::{FocalEstimate, FocalOptions, estimate_focal};
pub use fundamental::{eight_point, seven_point};
pub use gric::{ModelSize, gric};
pub use homography_poses::{PlanarPose, calibrated_homography, poses_of_homography, visible_planar_poses};
pub use rotation_averaging::{AveragedRotations, RotationEdge, average_rotations};
pub use rotation_fit::{Turn, conjugate_rotation, fit_turn};
pub use scene::{Observation, Scene, ScenePoint};
pub use three_point::{Sighting, three_point};
pub use triangulate::{Triangulated, View, triangulate};
pub use two_view::{TwoView, TwoViewOptions, TwoViewScores, TwoViewVerdict, two_view};
pub use view_graph_focal::{focal_of_fundamental, view_graph_focal};
