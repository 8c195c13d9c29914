//! The synthetic shots of the unit tests of structure from motion.

#[path = "../../../src/video/motion/sfm/tests/synthetic/mod.rs"]
#[allow(dead_code)] // only benches disturb an initial guess
mod synthetic;

use plumbline::video::motion::sfm::{Observation, Scene, ScenePoint, TrackTable};
pub(crate) use synthetic::{Course, PathError, Shot, ShotOptions, path_error};
