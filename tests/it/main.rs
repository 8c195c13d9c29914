//! One binary for all integration tests: each extra one costs a link per edit.

mod media_bad_input;
mod media_roundtrip;
mod support;
