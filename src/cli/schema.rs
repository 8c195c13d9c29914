//! `plumbline schema`: the JSON schema of pipeline files.

use super::tell;
use crate::pipeline::{Exit, schema};

pub(super) fn run() -> Exit {
    tell(&format!("{:#}\n", schema()));
    Exit::Done
}
