//! What everything else computes with, and what every call and every file has in common.
//!
//! | module | contains |
//! | --- | --- |
//! | [`math`] | points, similarities, homographies, rotations, dual quaternions; median, golden section |
//! | [`time`] | exact timestamps |
//! | [`spatial`] | trees of boxes, k-d trees, closest points on triangles, disjoint sets, shortest paths |
//! | [`sparse`] | matrices, orderings, Cholesky, LDLᵀ, LU and QR factors, low-rank updates, constraints, conjugate gradients, Gauss–Seidel, Matrix Market files |
//! | [`energy`] | quadratic energies: constrained Laplacians, refilled and bordered least squares; robust losses, convergence |
//! | [`optim`] | Newton's method, Levenberg–Marquardt, quadratic programs, eigenpairs (Lanczos), RANSAC |
//! | [`run`], [`options`] | interrupt, progress and budget of long calls; options out of their range |
//! | [`files`], [`limits`] | regular files, files that another file names, files that appear once they are whole; limits of the process |
//! | [`document`] | our versioned JSON documents; glTF and GLB |

pub mod document;
pub mod energy;
pub mod files;
pub mod limits;
pub mod math;
pub mod optim;
pub mod options;
pub mod run;
pub mod sparse;
pub mod spatial;
pub mod time;
