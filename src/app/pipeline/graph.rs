//! The checked graph: stages in the order of the data flow, edges with the types of their ports.

use std::sync::Arc;

use super::kind::{Settings, StageKind};
use super::memory::MemoryCost;
use super::port::{Port, PortType};
use super::syntax::Entry;

/// One edge into a stage.
#[derive(Clone, Debug)]
pub struct Edge {
    /// The input port.
    pub port: &'static Port,
    /// The stage that the data comes from, an index into [`Graph::stages`].
    pub from: usize,
    /// Its output port.
    pub output: &'static Port,
}

/// One enabled stage.
#[derive(Clone, Debug)]
pub struct Stage {
    /// Its name.
    pub name: String,
    /// Its kind.
    pub kind: &'static StageKind,
    /// Its settings; those that wait for the item have their defaults.
    pub settings: Arc<dyn Settings>,
    /// Settings that wait for the item.
    pub deferred: Vec<Entry>,
    /// Edges in the order of the ports.
    pub edges: Vec<Edge>,
}

impl Stage {
    /// The memory that it needs while it runs; twice the frames where it joins two pictures into one.
    pub fn memory(&self) -> Vec<MemoryCost> {
        let joins = self.edges.iter().any(|e| e.port.name == "side_by_side");
        let times = if joins { 2.0 } else { 1.0 };
        self.settings.memory().into_iter().map(|cost| MemoryCost { frames: times * cost.frames, ..cost }).collect()
    }
}

/// An acyclic graph whose edges fit their ports. Every edge leads to a later stage.
#[derive(Clone, Debug, Default)]
pub struct Graph {
    /// Stages, each after all that it takes data from.
    pub stages: Vec<Stage>,
}

impl PartialEq for Graph {
    fn eq(&self, other: &Self) -> bool {
        self.stages.len() == other.stages.len()
            && self.stages.iter().all(|a| other.stage(&a.name).is_some_and(|b| self.same_stage(a, other, b)))
    }
}

impl Graph {
    /// The stage called `name`.
    pub fn stage(&self, name: &str) -> Option<&Stage> {
        self.stages.iter().find(|s| s.name == name)
    }

    /// It works on still pictures or on meshes: every stage is evaluated once.
    pub fn is_still(&self) -> bool {
        self.gives(PortType::Image) || self.gives(PortType::Mesh)
    }

    /// A stage gives data of this type.
    pub fn gives(&self, data: PortType) -> bool {
        self.stages.iter().any(|s| s.kind.outputs.iter().any(|o| o.data == data))
    }

    /// How often the pixels that `stage` gives have been interpolated since they were decoded.
    pub fn resamples(&self, stage: usize) -> usize {
        self.all_resamples()[stage]
    }

    /// The same of every stage: each is after all that it takes data from, so that one pass over them is enough.
    pub(super) fn all_resamples(&self) -> Vec<usize> {
        let mut counts: Vec<usize> = Vec::with_capacity(self.stages.len());
        for stage in &self.stages {
            let before = stage.edges.iter().filter(|e| e.output.data.is_picture()).map(|e| counts[e.from]).max();
            counts.push(before.unwrap_or(0) + usize::from(stage.kind.resamples));
        }
        counts
    }

    fn same_stage(&self, a: &Stage, other: &Self, b: &Stage) -> bool {
        let edges = |graph: &Self, stage: &Stage| -> Vec<(&str, String, &str)> {
            let named = |e: &Edge| (e.port.name, graph.stages[e.from].name.clone(), e.output.name);
            stage.edges.iter().map(named).collect()
        };
        a.kind.name == b.kind.name
            && a.settings.to_json() == b.settings.to_json()
            && a.deferred == b.deferred
            && edges(self, a) == edges(other, b)
    }
}
