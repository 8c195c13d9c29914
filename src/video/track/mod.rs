//! Feature tracking through a clip: pyramidal KLT, the streaming tracker, its analysis windows and their
//! join, frame classification and the track store.
#![allow(clippy::cast_possible_wrap)] // indices of pixels are far below 2⁶³

mod analysis_window;
mod appearance;
mod coarse;
mod join;
mod klt;
mod observation;
mod quality;
mod store;
mod tracker;
mod window;
mod window_tracks;
#[cfg(target_arch = "x86_64")]
mod window_x86;

pub use analysis_window::AnalysisWindows;
pub use join::{JoinError, TrackJoiner};
pub use klt::{Match, track};
pub use observation::{FrameQuality, FrameTracks, Observation};
pub use store::{RESOLUTION_PX, StoreError, TrackStore};
pub use tracker::{TrackError, TrackOptions, Tracker};
pub use window_tracks::{WindowFileError, WindowTracks};
