//! The work of one item as data: what another process needs to do it.

use serde::{Deserialize, Serialize};
use serde_json::Value as Json;

use crate::pipeline::batch::Instance;
use crate::pipeline::graph::{Edge, Graph, Stage};
use crate::pipeline::job::JobOptions;
use crate::pipeline::kind::StageKind;
use crate::pipeline::plan::Plan;
use crate::stages;

/// An instance whose settings are all known, and how it is to run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Order {
    key: String,
    stages: Vec<StageOrder>,
    /// How it is to run.
    pub options: JobOptions,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(in crate::pipeline) struct StageOrder {
    name: String,
    kind: String,
    settings: Json,
    /// Input port, number of the stage that the data come from, output port of that stage.
    edges: Vec<(String, usize, String)>,
}

impl Order {
    /// The work of `instance`.
    pub fn of(instance: &Instance, options: JobOptions) -> Self {
        let edge = |e: &Edge| (e.port.name.to_owned(), e.from, e.output.name.to_owned());
        let stage = |s: &Stage| StageOrder {
            name: s.name.clone(),
            kind: s.kind.name.to_owned(),
            settings: s.settings.to_json(),
            edges: s.edges.iter().map(edge).collect(),
        };
        let stages = instance.graph.stages.iter().map(stage).collect();
        Self { key: instance.key.clone(), stages, options }
    }

    /// The stages, which are all that decides the result.
    pub(in crate::pipeline) fn stages(&self) -> &[StageOrder] {
        &self.stages
    }

    /// The kind of each stage, where this program knows it, and its settings.
    pub(in crate::pipeline) fn kinds_and_settings(
        &mut self,
    ) -> impl Iterator<Item = (Option<&'static StageKind>, &mut Json)> {
        self.stages.iter_mut().map(|stage| (stages::find_in_task(&stage.kind), &mut stage.settings))
    }

    /// The instance, with its plan; it has no item, since nothing is left open.
    ///
    /// # Errors
    /// What this version of the program does not know.
    pub fn instance(&self) -> Result<Instance, String> {
        let mut graph = Graph::default();
        for order in &self.stages {
            let stage = order.stage(&graph)?;
            graph.stages.push(stage);
        }
        let plan = Plan::of(&graph);
        Ok(Instance { key: self.key.clone(), item: None, graph, plan: plan.into() })
    }
}

impl StageOrder {
    /// The stage behind those of `graph`.
    fn stage(&self, graph: &Graph) -> Result<Stage, String> {
        let unknown = |what: &str| format!("stage `{}`: no {what}", self.name);
        let kind = stages::find_in_task(&self.kind).ok_or_else(|| unknown(&self.kind))?;
        let settings = (kind.parse)(self.settings.clone()).map_err(|e| format!("stage `{}`: {e}", self.name))?;
        let edge = |(port, from, output): &(String, usize, String)| {
            let source = graph.stages.get(*from).ok_or_else(|| unknown("stage before it"))?;
            let output = source.kind.output(output).ok_or_else(|| unknown(output))?;
            Ok(Edge { port: kind.input(port).ok_or_else(|| unknown(port))?, from: *from, output })
        };
        let edges = self.edges.iter().map(edge).collect::<Result<_, String>>()?;
        Ok(Stage { name: self.name.clone(), kind, settings, deferred: Vec::new(), edges })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pipeline::cache::CacheUse;
    use crate::pipeline::{read, shipped};

    #[test]
    fn an_order_gives_back_the_instance_of_every_shipped_pipeline() {
        let options = JobOptions {
            threads: 3,
            overwrite: true,
            strict: true,
            allow_paths: vec!["shared".into()],
            cache: Some(CacheUse { folder: "cached".into(), named: true, trusted: true, force: vec!["tracks".into()] }),
        };
        for (name, _) in shipped::SHIPPED {
            let source = shipped::find_source(name).expect("shipped");
            let pipeline = read(source, &["batch.foreach=item.x".to_owned()]).expect("no faults");
            let instance = pipeline.instances().expect("one item").remove(0);
            let text = serde_json::to_string(&Order::of(&instance, options.clone())).expect("plain data");
            let order: Order = serde_json::from_str(&text).expect("its own text");
            let again = order.instance().expect("known kinds");
            assert_eq!(order.options, options);
            assert_eq!((&again.key, &again.graph), (&instance.key, &instance.graph), "{name}");
            assert_eq!(again.plan.passes.len(), instance.plan.passes.len());
        }
    }

    #[test]
    fn settings_of_every_kind_survive_the_way() {
        for kind in stages::KINDS {
            let json = kind.defaults().expect("defaults").to_json();
            let text = serde_json::to_string(&json).expect("plain data");
            let again = (kind.parse)(serde_json::from_str(&text).expect("its own text")).expect(kind.name);
            assert_eq!(again.to_json(), json, "{}", kind.name);
        }
    }
}
