//! Clips: points tracked from frame to frame, the motion of the camera, the path of the virtual camera;
//! [`stabilize`] is the whole method.

pub mod motion;
pub mod path;
pub mod stabilize;
pub mod track;
