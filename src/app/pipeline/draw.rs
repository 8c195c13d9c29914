//! A graph as Mermaid, Graphviz DOT, text or JSON.

use std::fmt::Write as _;

use clap::ValueEnum;
use serde_json::{Value as Json, json};

use super::graph::{Graph, Stage};

/// How a graph is drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum GraphFormat {
    /// Indented text
    #[default]
    Text,
    /// Mermaid, as code hosts draw it
    Mermaid,
    /// Graphviz
    Dot,
    /// JSON, for programs
    Json,
}

/// Draws `graph`.
pub fn draw(graph: &Graph, format: GraphFormat) -> String {
    match format {
        GraphFormat::Text => text(graph),
        GraphFormat::Mermaid => mermaid(graph),
        GraphFormat::Dot => dot(graph),
        GraphFormat::Json => format!("{:#}\n", json_of(graph)),
    }
}

/// Every edge as `(from, to, label)`.
fn edges(graph: &Graph) -> impl Iterator<Item = (&Stage, &Stage, String)> {
    graph.stages.iter().flat_map(move |to| {
        to.edges.iter().map(move |e| {
            let label = if e.output.name == e.port.name {
                e.port.name.to_owned()
            } else {
                format!("{} → {}", e.output.name, e.port.name)
            };
            (&graph.stages[e.from], to, label)
        })
    })
}

/// Writing to a string cannot fail.
const INFALLIBLE: &str = "writing to a string cannot fail";

fn text(graph: &Graph) -> String {
    let mut out = String::new();
    for stage in &graph.stages {
        writeln!(out, "{} ({})", stage.name, stage.kind.name).expect(INFALLIBLE);
        for edge in &stage.edges {
            let from = &graph.stages[edge.from].name;
            writeln!(out, "  {:<8} ← {from}.{} ({})", edge.port.name, edge.output.name, edge.port.data)
                .expect(INFALLIBLE);
        }
    }
    out
}

/// Names may contain `-`, which Mermaid and DOT do not take in a bare identifier.
fn identifier(name: &str) -> String {
    name.replace('-', "_m")
}

fn mermaid(graph: &Graph) -> String {
    let mut out = String::from("flowchart LR\n");
    for stage in &graph.stages {
        writeln!(out, "  {}[\"{}<br/><small>{}</small>\"]", identifier(&stage.name), stage.name, stage.kind.name)
            .expect(INFALLIBLE);
    }
    for (from, to, label) in edges(graph) {
        writeln!(out, "  {} -->|{label}| {}", identifier(&from.name), identifier(&to.name)).expect(INFALLIBLE);
    }
    out
}

fn dot(graph: &Graph) -> String {
    let mut out = String::from("digraph pipeline {\n  rankdir = LR;\n  node [shape = box];\n");
    for stage in &graph.stages {
        writeln!(out, "  \"{}\" [label = \"{}\\n{}\"];", stage.name, stage.name, stage.kind.name).expect(INFALLIBLE);
    }
    for (from, to, label) in edges(graph) {
        writeln!(out, "  \"{}\" -> \"{}\" [label = \"{label}\"];", from.name, to.name).expect(INFALLIBLE);
    }
    out.push_str("}\n");
    out
}

fn json_of(graph: &Graph) -> Json {
    let stage = |s: &Stage| {
        let edge = |e: &super::graph::Edge| json!({"port": e.port.name, "data": e.port.data.name(), "from": graph.stages[e.from].name, "output": e.output.name});
        let edges: Vec<Json> = s.edges.iter().map(edge).collect();
        json!({"name": s.name, "use": s.kind.name, "inputs": edges, "settings": s.settings.to_json()})
    };
    json!({"stages": graph.stages.iter().map(stage).collect::<Vec<_>>()})
}
