//! Optimisation problems that are not plain least squares, each behind a type of our own.

pub mod qp;
