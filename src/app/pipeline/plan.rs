//! Cuts a graph into passes.
//!
//! A stage that needs the whole clip (`reduce`) ends a pass: what takes its result runs in a later one. With `level(s)` the
//! least pass that stage `s` can run in,
//!
//! ```text
//! level(s) = max over edges r → s of  level(r) + [r is reduce],
//! ```
//!
//! where a reduction of what is there before the first frame (`once`) ends no pass;
//! a stage runs in pass `level(s)`; but pictures are never stored, so a stage that gives pictures runs again in every pass that
//! takes them: a `frames` port is a re-openable source. All else that crosses passes is carried over.

use std::collections::BTreeSet;

use super::graph::{Graph, Stage};
use super::kind::TemporalScope;
use super::memory::{ClipShape, MemoryCost, human_bytes};
use super::port::PortType;

/// One streaming run over the clip.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pass {
    /// Position, from 0.
    pub index: usize,
    /// Stages in order, as indices into the graph.
    pub stages: Vec<usize>,
    /// Results that later passes take: `(stage, port)`.
    pub hands_on: Vec<(usize, &'static str)>,
}

/// The passes of a graph, in order.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Plan {
    /// The passes.
    pub passes: Vec<Pass>,
}

impl Plan {
    /// Cuts `graph`.
    pub fn of(graph: &Graph) -> Self {
        let level = levels(graph);
        let runs_in = runs_in(graph, &level);
        let indices: BTreeSet<usize> = runs_in.iter().flatten().copied().collect();
        let pass = |(index, at): (usize, &usize)| {
            let stages = (0..graph.stages.len()).filter(|&s| runs_in[s].contains(at)).collect();
            Pass { index, stages, hands_on: hands_on(graph, &level, &runs_in, *at) }
        };
        Self { passes: indices.iter().enumerate().map(pass).collect() }
    }

    /// The plan in words, with the memory of each pass: in bytes if the clip is known.
    pub fn describe(&self, graph: &Graph, clip: Option<&ClipShape>) -> String {
        let mut lines: Vec<String> = self.passes.iter().flat_map(|p| self.describe_pass(p, graph, clip)).collect();
        let peak = self.passes.iter().map(|p| p.memory(graph, clip)).max().filter(|_| clip.is_some());
        lines.extend(peak.map(|bytes| format!("peak memory: about {} beside the program itself", human_bytes(bytes))));
        let space = clip.map(|clip| temporary_space(graph, clip)).filter(|bytes| *bytes > 0);
        lines.extend(space.map(|bytes| format!("temporary space: up to {}", human_bytes(bytes))));
        lines.push(String::new());
        lines.join("\n")
    }

    fn describe_pass(&self, pass: &Pass, graph: &Graph, clip: Option<&ClipShape>) -> Vec<String> {
        let name = |s: usize| graph.stages[s].name.as_str();
        let names: Vec<&str> = pass.stages.iter().map(|&s| name(s)).collect();
        let mut lines = vec![format!("pass {} of {}: {}", pass.index + 1, self.passes.len(), names.join(" → "))];
        lines.extend(pass.stages.iter().flat_map(|&s| describe_stage(&graph.stages[s], clip)));
        if clip.is_some() {
            lines.push(format!("  memory: about {}", human_bytes(pass.memory(graph, clip))));
        }
        let carried: Vec<String> = pass.hands_on.iter().map(|(s, port)| format!("{port} of `{}`", name(*s))).collect();
        if !carried.is_empty() {
            lines.push(format!("  hands on: {}", carried.join(", ")));
        }
        lines
    }
}

/// Bytes that the temporary files of a run may take: they are kept from the pass that fills them to the end.
pub fn temporary_space(graph: &Graph, clip: &ClipShape) -> u64 {
    let costs = graph.stages.iter().flat_map(Stage::memory);
    costs.filter(|cost| cost.on_disk).map(|cost| cost.evaluate(clip)).sum()
}

/// It takes or gives frames.
fn of_clip(stage: &Stage) -> bool {
    stage.kind.inputs.iter().chain(stage.kind.outputs).any(|p| p.data == PortType::Frames)
}

fn describe_stage(stage: &Stage, clip: Option<&ClipShape>) -> Vec<String> {
    let time = match stage.settings.over_time() {
        TemporalScope::Map => "frame by frame".to_owned(),
        TemporalScope::Window(n) => format!("looks {n} frames around"),
        TemporalScope::Reduce => "needs the whole clip".to_owned(),
        TemporalScope::Once if of_clip(stage) => "before the first frame".to_owned(),
        TemporalScope::Once => "once".to_owned(),
    };
    let mut lines = vec![format!("  {:<10} {:<14} {time}", stage.name, stage.kind.name)];
    lines.extend(stage.memory().iter().map(|cost| format!("{:27} {}", "", cost_text(cost, clip))));
    lines
}

impl Pass {
    /// Bytes of memory during this pass; 0 while the clip is unknown.
    pub fn memory(&self, graph: &Graph, clip: Option<&ClipShape>) -> u64 {
        let costs = self.stages.iter().flat_map(|&s| graph.stages[s].memory());
        clip.map_or(0, |clip| costs.filter(|c| !c.on_disk).map(|c| c.evaluate(clip)).sum())
    }
}

fn cost_text(cost: &MemoryCost, clip: Option<&ClipShape>) -> String {
    let location = if cost.on_disk { " in a temporary file" } else { "" };
    let amount = clip.map_or_else(|| cost.to_string(), |clip| human_bytes(cost.evaluate(clip)));
    format!("{}: {amount}{location}", cost.what)
}

fn levels(graph: &Graph) -> Vec<usize> {
    let mut level = vec![0; graph.stages.len()];
    let streamed = streamed(graph);
    for (s, stage) in graph.stages.iter().enumerate() {
        let after = |e: &super::graph::Edge| {
            let reduce = graph.stages[e.from].settings.over_time() == TemporalScope::Reduce && streamed[e.from];
            level[e.from] + usize::from(reduce)
        };
        level[s] = stage.edges.iter().map(after).max().unwrap_or(0);
    }
    level
}

/// Whether what a stage gives depends on frames of this run.
fn streamed(graph: &Graph) -> Vec<bool> {
    let mut streamed = vec![true; graph.stages.len()];
    for (s, stage) in graph.stages.iter().enumerate() {
        let source = stage.edges.is_empty();
        let once = stage.settings.over_time() == TemporalScope::Once;
        streamed[s] = !once && (source || stage.edges.iter().any(|e| streamed[e.from]));
    }
    streamed
}

/// Data that is streamed again rather than stored.
fn reopened(data: PortType) -> bool {
    matches!(data, PortType::Frames | PortType::Audio)
}

fn runs_in(graph: &Graph, level: &[usize]) -> Vec<BTreeSet<usize>> {
    let mut runs: Vec<BTreeSet<usize>> = vec![BTreeSet::new(); graph.stages.len()];
    for s in (0..graph.stages.len()).rev() {
        let streams_only = graph.stages[s].kind.outputs.iter().all(|o| reopened(o.data));
        if !streams_only || runs[s].is_empty() {
            runs[s].insert(level[s]);
        }
        for edge in graph.stages[s].edges.iter().filter(|e| reopened(e.output.data)) {
            let passes = runs[s].clone();
            runs[edge.from].extend(passes);
        }
    }
    runs
}

fn hands_on(graph: &Graph, level: &[usize], runs_in: &[BTreeSet<usize>], at: usize) -> Vec<(usize, &'static str)> {
    let mut out: Vec<(usize, &'static str)> = Vec::new();
    for (s, stage) in graph.stages.iter().enumerate() {
        for edge in stage.edges.iter().filter(|e| !reopened(e.output.data)) {
            let later = runs_in[s].iter().any(|&p| p > at);
            if level[edge.from] == at && later && !out.contains(&(edge.from, edge.output.name)) {
                out.push((edge.from, edge.output.name));
            }
        }
    }
    out.sort_unstable();
    out
}
