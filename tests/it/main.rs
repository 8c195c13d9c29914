//! All integration tests, in one binary: each further binary would cost a link per edit.

mod house;
mod layers;
mod path;
//! The integration tests, one binary: each further binary would cost a link per edit.

mod energy;
mod warp;
mod render;
