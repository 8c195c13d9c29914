//! Rectification and retargeting of photos and clips, plumb-line calibration, line detection.
//!
//! Both are warps of a grid: on the viewing sphere for `rectify`, on the picture for `retarget`. Nothing here touches
//! pixels that are written; results are maps.

mod aspect_ratio;
pub mod calibration;
mod crop;
mod error;
mod great_circle;
mod line;
pub mod line_detection;
pub mod marks;
pub mod rectangle;
pub mod rectify;
mod report;
pub mod retarget;
mod straightness;
pub mod temporal;
mod warp;

pub use aspect_ratio::AspectRatio;
pub use error::PhotoError;
pub use great_circle::{Sight, best_circle};
pub use line::{Line, Orientation};
pub use straightness::measure_straightness;
pub use warp::{FittedLine, Forward, LineReport, PhotoWarp, Straightness};
