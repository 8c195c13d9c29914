//! What every kind of stage is written with: the derives of its settings, its ports, its costs and its errors.

pub(super) use schemars::JsonSchema;
pub(super) use serde::{Deserialize, Serialize};

pub(super) use super::context::Context;
pub(super) use crate::pipeline::kind::{Conflict, MapStep, Stage, TemporalScope};
pub(super) use crate::pipeline::memory::MemoryCost;
pub(super) use crate::pipeline::port::{Port, PortType};
pub(super) use crate::pipeline::port_value::{HandedOn, Wired, Written};
pub(super) use crate::pipeline::run_error::RunError;
