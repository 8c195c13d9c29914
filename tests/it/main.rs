//! The integration tests, one binary: each further binary would cost a link per edit.

mod allocations;
mod energy;
mod sparse;
mod warp;
