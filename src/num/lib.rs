//! What everything else computes with: points and transforms, exact time, trees over space, sparse matrices, energies,
//! optimizers; and what every call and every file has in common.

pub mod document;
pub mod energy;
pub mod math;
pub mod optim;
pub mod options;
pub mod run;
pub mod sparse;
pub mod spatial;
pub mod time;
