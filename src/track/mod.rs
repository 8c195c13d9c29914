//! Points followed through a clip: pyramidal KLT, the streaming tracker, frame classification and the track store.

mod klt;
mod window;
#[cfg(target_arch = "x86_64")]
mod window_x86;

pub use klt::{KltOptions, Match, track};
