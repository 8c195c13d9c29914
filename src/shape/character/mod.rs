//! Characters: a surface that follows a skeleton.
//!
//! ```text
//! skeleton    joints in a forest; joint j has the frame parent_from_joint Tⱼ at rest and Lⱼ in a pose
//! globals     Gⱼ = G_parent(j) Lⱼ              world_from_joint
//! skin        Mⱼ = Gⱼ Bⱼ                       Bⱼ the inverse bind matrix: the inverse of Gⱼ in the bind pose
//! weights     w_ij ≥ 0,  Σⱼ w_ij = 1           influence of joint j on vertex i
//! ```
//!
//! A [`Pose`] holds the local frame of every joint of a [`Skeleton`]. The skin matrices `Mⱼ` of a [`Skin`] map rest space to posed
//! space per joint; a skinning method blends them over the surface.

#[expect(clippy::module_inception, reason = "the module holds the domain, the file its central type")]
mod character;
pub mod clip;
mod curve;
pub mod edit;
mod error;
pub mod extraction;
pub mod fitting;
pub mod humanoid;
pub mod ik;
pub mod io;
mod limits;
pub mod naming;
mod pose;
pub mod pose_file;
mod refinement;
pub mod regression;
pub mod retargeting;
mod skeleton;
pub mod skeleton_file;
mod skin;
mod skin_weights;
pub mod skinning;
#[cfg(test)]
mod tests;
pub mod weights;
mod weights_file;

pub use character::{Character, MorphShape};
pub use clip::{Clip, Curve, Extrapolation, Interpolation, Keys, MorphTrack, RotationKeys, Track};
pub use curve::CurveSkeleton;
pub use error::{CharacterError, RigFileError};
pub use limits::{Limits, SwingTwist};
pub use pose::Pose;
pub use refinement::DetailRefiner;
pub use skeleton::{Bone, Joint, Skeleton};
pub use skin::Skin;
pub use skin_weights::{Influence, Normalization, SkinWeights};
pub use weights_file::WeightsFile;
#[cfg(feature = "schema")]
pub use weights_file::weights_file_schema;
