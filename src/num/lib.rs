//! What everything else computes with: points and transforms, exact time, sparse matrices, energies, optimizers.

pub mod energy;
pub mod math;
pub mod optim;
pub mod run;
pub mod sparse;
pub mod time;
pub mod union_find;
