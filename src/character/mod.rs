//! Characters: the curve inside a surface, and the skeleton made of it.

pub mod extraction;
