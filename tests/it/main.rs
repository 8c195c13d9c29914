//! All integration tests, in one binary: each further binary would cost a link per edit.

mod energy;
mod house;
mod layers;
mod path;
mod render;
mod warp;
