//! Video stabilization: computes a map per frame of a shaky clip that makes the motion of its camera smooth.
//!
//! The method, step by step; each is a call of its own too:
//!
//! 1. **Tracking** ([`ClipTracker`]): about a thousand points are tracked through the frames (`crate::track`), cuts detected,
//!    and the planar motion of the still background estimated from frame to frame (`crate::motion`). This is done in windows of
//!    fixed length, which other processes can analyze as well ([`WindowTracker`], [`WindowJoiner`]).
//! 2. **Camera motion** ([`complete_motion`]): the readout time of a rolling shutter and, if requested, cameras and points in
//!    space, shot by shot (`crate::motion::sfm`). A motion file or a COLMAP model ([`MotionFile`], [`ImportedModels`]) can
//!    replace both steps.
//! 3. **Path** ([`plan_path`]): the virtual camera. In the picture it is a quadratic program under the crop budget
//!    (`crate::path`). In space the cameras are smoothed or follow a target path of a given shape as far as the frames cover it,
//!    and the planner finds the windows that show their views. Where both are possible, the better one is selected by evaluating
//!    each on the tracks.
//! 4. **Models** ([`select_models`]): per segment the most flexible motion model that is no worse than the next simpler one:
//!    points in space, trajectories in a common subspace, a mesh, a homography, a similarity, or no motion.
//! 5. **Maps** ([`FrameMaps`]): anchors are the targets of points; a content-preserving warp moves the frame to them
//!    (`plumbline_image::warp`). One [`WarpField`](plumbline_image::warp::WarpField) per frame, from output to source pixels; no
//!    pixel is resampled here.
//!
//! [`Stabilizer`] does all of it in three calls. The energies are stated where they are minimized: the path's in
//! `path/optimal.rs`, the warp's in `warp/content_preserving.rs`, the bundle adjustment's in `motion/sfm/bundle`.
//!
//! ```
//! # use std::convert::Infallible;
//! # use plumbline_image::{Frame, Layout, PixelFormat};
//! # use plumbline_num::run::Run;
//! # use plumbline_video::stabilize::{ClipInfo, FrameSource, StabilizeError, Stabilizer, StabilizerOptions};
//! # use plumbline_num::time::{Timebase, Timestamp};
//! # /// A textured wall that jumps to and fro by some pixels.
//! # struct Wall;
//! # impl FrameSource for Wall {
//! #     type Error = Infallible;
//! #     fn info(&self) -> ClipInfo {
//! #         ClipInfo::new(160, 120, Timebase { num: 1, den: 30 })
//! #     }
//! #     fn frames(&self) -> Result<impl Iterator<Item = Result<Frame, Infallible>>, Infallible> {
//! #         Ok((0..20_usize).map(|t| {
//! #             let mut frame = Frame::new(PixelFormat::opaque(Layout::Gray, 8), 160, 120);
//! #             frame.pts = Timestamp(t as i64);
//! #             let shift = [3, 0, 5, 1, 4][t % 5];
//! #             let mut luma = frame.plane8_mut(0).expect("8 bit");
//! #             for y in 0..120 {
//! #                 for (x, v) in luma.row_mut(y).iter_mut().enumerate() {
//! #                     let (x, y) = ((x + shift) as f64, y as f64);
//! #                     let waves = (0.31 * x + 2.0 * (0.07 * y).sin()).sin() + (0.27 * y + 3.0 * (0.05 * x).cos()).sin();
//! #                     *v = (128.0 + 60.0 * waves) as u8;
//! #                 }
//! #             }
//! #             Ok(frame)
//! #         }))
//! #     }
//! # }
//! # let source = Wall;
//! let stabilizer = Stabilizer::new(StabilizerOptions::default().with_keep(0.85))?;
//! let analysis = stabilizer.analyze(&source, &Run::default())?; // any clip that can be read twice
//! let plan = stabilizer.plan(&analysis, &Run::default())?; // again with other options: nothing is tracked again
//! let mut maps = plan.maps()?;
//! for frame in source.frames().expect("a clip in memory") {
//!     let src_from_out = maps.next(&frame.expect("a frame in memory"))?; // for `render::Renderer`, or another
//! #   assert_eq!(src_from_out.chain.len(), 1);
//! }
//! let shake = plan.summary().shake.expect("its motion was measured");
//! assert!(shake.after.px < 0.5 * shake.before.px);
//! # Ok::<(), StabilizeError>(())
//! ```
//!
//! # Reference
//! F. Liu, M. Gleicher, H. Jin, A. Agarwala, *Content-preserving warps for 3D video stabilization*, SIGGRAPH 2009. Departures: the
//! targets of the warp come from smoothed trajectories where the cameras are not needed (F. Liu et al., *Subspace video
//! stabilization*, TOG 2011), and the path is planned under a crop budget (M. Grundmann, V. Kwatra, I. Essa, *Auto-directed video
//! stabilization with robust L1 optimal camera paths*, CVPR 2011) instead of being cropped afterwards.

mod camera_recovery;
mod crop_correction;
mod error;
mod frame_maps;
mod frame_models;
mod import;
mod measurement;
mod model_evaluation;
mod model_selection;
mod moving_objects;
mod options;
mod path_file;
mod path_planning;
mod plan_file;
mod rolling_shutter;
mod shake;
mod source;
mod space;
mod stabilizer;
mod summary;
mod target_path;
mod tracking;
mod tracks;
mod warp_solver;

pub use camera_recovery::{CameraRecovery, complete_motion};
pub use error::StabilizeError;
pub use frame_maps::{FrameMaps, RenderInputs};
pub use frame_models::FrameModels;
pub use import::{ImportedModels, ImportedMotion, MotionFile};
pub use model_evaluation::{EvaluatedModel, ModelFigures};
pub use model_selection::select_models;
pub use options::{
    CameraMotionOptions, InSpace, ModelChoice, PathMethod, SmoothingOptions, StabilizerOptions, TrackingOptions,
    WarpOptions,
};
pub use path_file::PathFile;
#[cfg(feature = "schema")]
pub use path_file::path_file_schema;
pub use path_planning::plan_path;
pub use plan_file::PlanFile;
pub use rolling_shutter::RollingShutter;
pub use shake::{PathDeviations, Shake, ShakeSummary};
pub use source::{ClipInfo, FrameSource};
pub use stabilizer::{Analysis, Plan, Stabilizer};
pub use summary::{PlanSegment, PlanSummary, model_name, verdict_name};
pub use tracking::{ClipTracker, WindowJoiner, WindowTracker};
pub use tracks::{PointCarrier, Tracks};
