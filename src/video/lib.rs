//! Clips: points tracked from frame to frame, the motion of the camera, the path of the virtual camera.

pub mod motion;
pub mod path;
pub mod track;
