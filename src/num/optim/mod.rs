//! Minimization of energies that are not quadratic, and searches: each method drives a problem of the caller's through a small trait,
//! or takes its data.
//!
//! | method | for | who uses it |
//! | --- | --- | --- |
//! | [`newton`] | smooth energies with a Hessian or `JᵀJ`, by line search | PriMo |
//! | [`levenberg_marquardt`] | nonlinear least squares with robust losses | inverse kinematics, lens calibration, bundle adjustment |
//! | [`qp`] | convex quadratic programs with linear constraints | camera paths, axis-aligned retargeting |
//! | [`lanczos`] | the lowest eigenpairs of a sparse pencil | modes of surfaces |
//! | [`ransac`] | models of data with many outliers | motions between frames, two views |

pub mod lanczos;
pub mod levenberg_marquardt;
pub mod newton;
#[cfg(feature = "quadratic-programs")]
pub mod qp;
pub mod ransac;
