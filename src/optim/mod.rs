//! Search and optimization shared by the domains: robust consensus.

pub mod ransac;
