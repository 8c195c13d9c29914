//! Feature tracking through a clip: pyramidal KLT, the streaming tracker, frame classification and the track store.
#![allow(clippy::cast_possible_wrap)] // indices of pixels are far below 2⁶³

mod appearance;
mod coarse;
mod klt;
mod observation;
mod quality;
mod store;
mod tracker;
mod window;
#[cfg(target_arch = "x86_64")]
mod window_x86;

pub use klt::{Match, track};
pub use observation::{FrameQuality, FrameTracks, Observation};
pub use store::{RESOLUTION_PX, StoreError, TrackStore};
pub use tracker::{TrackError, TrackOptions, Tracker};
