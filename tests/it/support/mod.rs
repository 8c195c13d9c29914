//! What tests of several areas share.

pub(crate) mod clips;
pub(crate) mod program;
