//! The names that most programs need: `use plumbline::prelude::*`.
//!
//! | job | names |
//! | --- | --- |
//! | stabilize a clip | `ClipFile` (feature `media`) or any [`FrameSource`], [`Stabilizer`], [`Analysis`], [`Plan`], [`WarpField`] |
//! | rectify, retarget a photo | [`Photo`], [`read_lens`], [`LinesFile`], [`rectify`], [`retarget`], [`PhotoWarp`] |
//! | deform a mesh | [`read_model`], [`Handles`], [`deform`], a [`Deformer`] for many poses |
//! | skeletons and skins | [`extract_skeleton`], [`Skeleton`], [`Pose`], [`skin`], [`Skinner`] |
//! | shapes between shapes | [`interpolate`], [`Trajectory`], [`compose`] |
//! | all of them | [`Run`]: interrupt, progress, time limit |

#[cfg(feature = "media")]
pub use crate::clip::{ClipFile, ClipFileError};
#[cfg(feature = "media")]
pub use crate::media::{Input, Output, VideoReader, VideoWriter};

pub use crate::camera::{CameraPose, ExifFacts, Intrinsics, Lens, Point3, Projection, Vec3, read_lens};
pub use crate::image::Frame;
pub use crate::image::feature::{Face, Importance};
pub use crate::image::render::{RenderOptions, Renderer};
pub use crate::image::still::Photo;
pub use crate::image::warp::{Lattice, WarpField};
pub use crate::num::math::{Point2, PointMap, Rect, Vec2};
pub use crate::num::run::{Budget, Interrupt, Progress, Run, Stopped};
pub use crate::num::time::{Timebase, Timestamp};
pub use crate::photo::marks::LinesFile;
pub use crate::photo::rectify::{RectifyInput, RectifyOptions, rectify};
pub use crate::photo::retarget::{RetargetOptions, Retargeted, retarget};
pub use crate::photo::{Line, PhotoWarp};
#[doc(inline)]
pub use crate::shape::character::extraction::skeleton as extract_skeleton;
pub use crate::shape::character::skinning::{Skinner, SkinningMethod, skin};
pub use crate::shape::character::weights::{WeightOptions, bone_weights};
pub use crate::shape::character::{Character, CurveSkeleton, Joint, Pose, Skeleton, Skin, SkinWeights};
pub use crate::shape::mesh::{Model, ReadLimits, TriMesh, read_model, write_model};
pub use crate::shape::morph::composition::{ComposeOptions, Composition, Cut, compose};
pub use crate::shape::morph::{Trajectory, TrajectoryOptions, interpolate};
pub use crate::shape::surface::{
    Convergence, DeformOptions, Deformer, HandlePose, Handles, InitialGuess, Method, deform,
};
pub use crate::video::stabilize::{
    Analysis, ClipInfo, FrameSource, Plan, StabilizeError, Stabilizer, StabilizerOptions,
};
