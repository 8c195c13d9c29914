//! The program: pipeline files and their stages, reports, the command line.

pub mod cli;
pub mod pipeline;
pub mod report;
pub mod stages;
