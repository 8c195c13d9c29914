//! Search and optimization that is not plain least squares, each behind a type of our own.

pub mod lanczos;
pub mod levenberg_marquardt;
pub mod newton;
pub mod qp;
pub mod ransac;
