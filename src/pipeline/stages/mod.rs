//! Bodies of the stages: where the methods of the other modules are joined to the graph.

use super::job::{Backend, Job, Probed, Values};
use super::plan::Pass;
use super::run_error::RunError;
use super::summary::Summary;

/// The bodies that this program has.
pub struct Bodies;

impl Backend for Bodies {
    fn probe(&self, input: &str) -> Result<Probed, RunError> {
        Err(RunError::Internal(format!("this build cannot look into `{input}`")))
    }

    fn run_pass(&self, job: &Job<'_>, pass: &Pass, _: &mut Values, _: &mut Summary) -> Result<(), RunError> {
        let names: Vec<&str> = pass.stages.iter().map(|&s| job.graph().stages[s].kind.name).collect();
        Err(RunError::Internal(format!("this build has no body for the pass {}", names.join(" → "))))
    }
}
