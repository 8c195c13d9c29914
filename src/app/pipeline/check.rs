//! From the file to the checked pipeline: every fault of syntax, settings, edges and types in one pass, no input touched.

use std::sync::Arc;

use serde_json::Value as Json;

use super::connect::{Prepared, connect};
use super::file::{PipelineFile, StageEntry};
use super::graph::Graph;
use super::kind::{Settings, StageKind, schema_of};
use super::load::load;
use super::options::{BatchSettings, Existing, RunSettings};
use super::problem::{Problem, Problems};
use super::recover::{Recovered, parse_recovering};
use super::reference::{Item, Resolved, Scope, resolve};
use super::settings::{Checked, Expected, check_table};
use super::syntax::{Entry, Node, Source, Sources, Span, Value};
use super::{overrides, suggest};
use crate::stages::kept::RESULTS;

/// A pipeline without faults.
#[derive(Clone, Debug)]
pub struct Pipeline {
    /// What it was read from.
    pub file: PipelineFile,
    /// `[run]`, defaults included.
    pub run: RunSettings,
    /// `[batch]`, if given.
    pub batch: Option<BatchSettings>,
    /// The stages; settings that depend on the item are open.
    pub graph: Graph,
}

impl PartialEq for Pipeline {
    fn eq(&self, other: &Self) -> bool {
        (&self.file.name, &self.run, &self.batch, &self.graph)
            == (&other.file.name, &other.run, &other.batch, &other.graph)
    }
}

/// Reads and checks a pipeline file. `set` lists `NAME.KEY=VALUE` options, which win over the file.
///
/// # Errors
/// Every fault that can be found without touching an input.
pub fn read(source: Source, set: &[String]) -> Result<Pipeline, Problems> {
    let (mut sources, mut problems) = (Sources::default(), Vec::new());
    let id = sources.add(source);
    let Recovered { mut root, problems: faults, incomplete } = parse_recovering(&sources, id);
    problems.extend(faults);
    overrides::apply(&mut root, set, &mut sources, &mut problems);
    let file = load(root, sources, &mut problems);
    let checked = check_with(file, problems);
    // What is missing may be in what was taken out.
    checked.map_err(|mut all| {
        all.problems.retain(|problem| !incomplete || !problem.is_of_absence());
        all
    })
}

/// Checks a pipeline that a program built.
///
/// # Errors
/// Every fault that can be found without touching an input.
pub fn check(file: PipelineFile) -> Result<Pipeline, Problems> {
    check_with(file, Vec::new())
}

fn check_with(file: PipelineFile, mut problems: Vec<Problem>) -> Result<Pipeline, Problems> {
    let env = |name: &str| std::env::var(name).ok();
    let vars = resolved_vars(&file, &env, &mut problems);
    let scope = Scope { vars: &vars, env: &env, item: None };
    let prepared = file.stages.iter().map(|s| prepare(&file, s, &scope, &mut problems)).collect();
    let run = options::<RunSettings>("[run]", &file.run, &file, &scope, &mut problems);
    check_existing(run.as_ref(), &file, &mut problems);
    let batch = file.batch.as_ref().map(|entries| batch(entries, &file, &scope, &mut problems));
    check_item_use(&file, &mut problems);
    let graph = connect(&file, prepared, &mut problems);
    check_force(run.as_ref(), &graph, &file, &mut problems);
    match (problems.is_empty(), run) {
        (true, Some(run)) => Ok(Pipeline { run, batch: batch.flatten(), graph, file }),
        _ => Err(Problems::new(problems, file.sources)),
    }
}

/// Variables with the references to the environment in them replaced. A variable cannot refer to another or to the item.
pub(super) fn resolved_vars(
    file: &PipelineFile,
    env: &dyn Fn(&str) -> Option<String>,
    problems: &mut Vec<Problem>,
) -> Vec<Entry> {
    let scope = Scope { vars: &[], env, item: None };
    let mut out = Vec::with_capacity(file.vars.len());
    for var in &file.vars {
        match resolve(&var.node, &scope) {
            Ok(Resolved::Ready(node, _)) => out.push(Entry { node, ..var.clone() }),
            Ok(Resolved::Deferred) => {
                let message = format!("variable `{}` refers to the item", var.key);
                problems.push(
                    Problem::new("reference", message)
                        .label(var.node.span, "not here")
                        .help("a variable is the same for all items; use `${item.…}` in the stage itself"),
                );
                out.push(var.clone());
            }
            Err(problem) => {
                problems.push(problem.help("a variable may refer to the environment only"));
                out.push(var.clone());
            }
        }
    }
    out
}

fn stage_problem_name(stage: &StageEntry) -> String {
    let kind = stage.kind.map_or("", |k| k.name);
    format!("stage `{}` ({kind})", stage.name.text)
}

/// Checks the settings of one stage; those that wait for an item are given back.
pub(super) fn stage_settings(
    file: &PipelineFile,
    stage: &StageEntry,
    scope: &Scope<'_>,
    problems: &mut Vec<Problem>,
) -> (Option<Arc<dyn Settings>>, Vec<Entry>) {
    let Some(template) = StageTemplate::new(file, stage, scope, problems) else { return (None, Vec::new()) };
    // What waits for the item counts as given: a path of the item is a path.
    let waiting = template.deferred.iter().filter_map(|e| Some((e.key.clone(), Json::from(e.node.text()?))));
    let whole = template.known.clone().into_iter().chain(waiting).collect();
    template.check_conflicts((template.kind.parse)(Json::Object(whole)).ok().as_ref(), problems);
    (template.parse(template.known.clone(), problems), template.deferred)
}

/// The settings of a stage as far as they are known without an item.
pub(super) struct StageTemplate<'f> {
    file: &'f PipelineFile,
    stage: &'f StageEntry,
    kind: &'static StageKind,
    schema: Arc<Json>,
    known: serde_json::Map<String, Json>,
    deferred: Vec<Entry>,
}

impl<'f> StageTemplate<'f> {
    /// Checks what is known in `scope`; `None` for a stage of no kind, which was reported.
    pub(super) fn new(
        file: &'f PipelineFile,
        stage: &'f StageEntry,
        scope: &Scope<'_>,
        problems: &mut Vec<Problem>,
    ) -> Option<Self> {
        let kind = stage.kind?;
        let mut template =
            Self { file, stage, kind, schema: kind.json_schema(), known: serde_json::Map::new(), deferred: Vec::new() };
        let checked = template.check(&stage.settings, kind.required, scope, problems);
        (template.known, template.deferred) = (checked.json, checked.deferred);
        Some(template)
    }

    /// The settings of one item. Only what waited for it is looked at.
    pub(super) fn fill(&self, scope: &Scope<'_>, problems: &mut Vec<Problem>) -> Option<Arc<dyn Settings>> {
        let filled = self.check(&self.deferred, &[], scope, problems).json;
        let settings = self.parse(self.known.clone().into_iter().chain(filled).collect(), problems);
        self.check_conflicts(settings.as_ref(), problems);
        settings
    }

    fn what(&self) -> String {
        stage_problem_name(self.stage)
    }

    fn check(&self, entries: &[Entry], required: &[&str], scope: &Scope<'_>, problems: &mut Vec<Problem>) -> Checked {
        let accepts = |json: Json| (self.kind.parse)(json).map(drop).map_err(|e| e.to_string());
        let expected = Expected { what: self.what(), schema: &self.schema, required, accepts: &accepts };
        check_table(entries, self.stage.name.span, &expected, scope, &self.file.sources, problems)
    }

    fn parse(&self, json: serde_json::Map<String, Json>, problems: &mut Vec<Problem>) -> Option<Arc<dyn Settings>> {
        let refused = |error| Problem::new("bad-value", format!("{}: {error}", self.what()));
        match (self.kind.parse)(Json::Object(json)) {
            Ok(settings) => Some(settings),
            Err(error) => {
                problems.push(refused(error).label(self.stage.name.span, "here"));
                None
            }
        }
    }

    fn check_conflicts(&self, settings: Option<&Arc<dyn Settings>>, problems: &mut Vec<Problem>) {
        for conflict in settings.into_iter().flat_map(|settings| settings.conflicts()) {
            let span = self.stage.settings.iter().find(|e| e.key == conflict.key).map(|e| e.key_span.or(e.node.span));
            problems.push(
                Problem::new("conflict", format!("{}: {}", self.what(), conflict.message))
                    .label(span.unwrap_or(self.stage.name.span), "here")
                    .help(conflict.help),
            );
        }
    }
}

fn prepare(file: &PipelineFile, stage: &StageEntry, scope: &Scope<'_>, problems: &mut Vec<Problem>) -> Prepared {
    let enabled = stage.enable.as_ref().is_none_or(|node| enabled(stage, node, scope, problems));
    let (settings, deferred) = stage_settings(file, stage, scope, problems);
    Prepared { enabled, settings, deferred }
}

fn enabled(stage: &StageEntry, node: &Node, scope: &Scope<'_>, problems: &mut Vec<Problem>) -> bool {
    let found = match resolve(node, scope) {
        Ok(Resolved::Ready(node, _)) => match &node.value {
            Value::Bool(b) => return *b,
            Value::Loose(text) if text == "true" => return true,
            Value::Loose(text) if text == "false" => return false,
            Value::Unknown => return true,
            _ => node.type_name().to_owned(),
        },
        Ok(Resolved::Deferred) => "a reference to the item".to_owned(),
        Err(problem) => {
            problems.push(problem);
            return true;
        }
    };
    let message = format!("`enable` of stage `{}` is {found} (expected true or false)", stage.name.text);
    problems.push(Problem::new("bad-value", message).label(node.span, "expected true or false"));
    true
}

fn options<T>(
    what: &str,
    entries: &[Entry],
    file: &PipelineFile,
    scope: &Scope<'_>,
    problems: &mut Vec<Problem>,
) -> Option<T>
where
    T: serde::de::DeserializeOwned + schemars::JsonSchema,
{
    let accepts = |json: Json| serde_json::from_value::<T>(json).map(drop).map_err(|e| e.to_string());
    let schema = schema_of::<T>(&[]);
    let expected = Expected { what: what.to_owned(), schema: &schema, required: &[], accepts: &accepts };
    let Checked { json, deferred } = check_table(entries, None, &expected, scope, &file.sources, problems);
    for entry in deferred {
        let message = format!("`{}` of {what} refers to the item", entry.key);
        problems.push(Problem::new("reference", message).label(entry.node.span, "not here"));
    }
    serde_json::from_value(Json::Object(json)).ok()
}

/// `overwrite` is short for one value of `existing`, and cannot go with another.
fn check_existing(run: Option<&RunSettings>, file: &PipelineFile, problems: &mut Vec<Problem>) {
    let Some(RunSettings { existing: Some(existing), overwrite: true, .. }) = run else { return };
    if *existing != Existing::Overwrite {
        let span = file.run.iter().find(|e| e.key == "overwrite").and_then(|e| e.key_span.or(e.node.span));
        problems.push(
            Problem::new(
                "conflict",
                "`overwrite` of [run] is short for `existing = \"overwrite\"`, but `existing` is another",
            )
            .label(span, "here")
            .help("leave one of them out"),
        );
    }
}

/// What is computed anew must be something that the pipeline keeps.
fn check_force(run: Option<&RunSettings>, graph: &Graph, file: &PipelineFile, problems: &mut Vec<Problem>) {
    let known = |name: &String| {
        RESULTS.iter().any(|result| name == result.name || name == result.stage)
            || graph.stages.iter().any(|stage| *name == stage.name || name == stage.kind.name)
    };
    for name in run.iter().flat_map(|run| &run.force).filter(|name| !known(name)) {
        let span = file.run.iter().find(|e| e.key == "force").and_then(|e| e.node.span);
        let results: Vec<&str> = RESULTS.iter().map(|result| result.name).collect();
        problems.push(
            Problem::new(
                "bad-value",
                format!("`force` of [run] names `{name}`, which is neither a result nor a stage"),
            )
            .label(span, "here")
            .help(format!(
                "results that are kept: {}; or name a stage of the pipeline, or its kind",
                results.join(", ")
            )),
        );
    }
}

/// `key` is a template over the item: it is kept as it is written. The rest is read at once.
fn batch(
    entries: &[Entry],
    file: &PipelineFile,
    scope: &Scope<'_>,
    problems: &mut Vec<Problem>,
) -> Option<BatchSettings> {
    let (keys, others): (Vec<Entry>, Vec<Entry>) = entries.iter().cloned().partition(|e| e.key == "key");
    let mut settings: BatchSettings = options("[batch]", &others, file, scope, problems)?;
    for key in &keys {
        if key.node.value == Value::Unknown {
            continue;
        }
        if let Some(text) = key.node.text() {
            text.clone_into(&mut settings.key);
            check_template(key, scope, problems);
        } else {
            let message = format!("`key` of [batch] is {} (expected a string)", key.node.type_name());
            problems.push(Problem::new("bad-value", message).label(key.node.span, "expected a string"));
        }
    }
    if settings.foreach.is_empty() && !entries.iter().any(|e| e.key == "foreach") {
        let message = "[batch] needs `foreach`";
        problems.push(
            Problem::new("missing-key", message).help("foreach: a glob such as \"clips/*.mp4\", or a list of files"),
        );
    }
    settings.base = foreach_base(&others, file);
    Some(settings)
}

fn foreach_base(entries: &[Entry], file: &PipelineFile) -> Option<std::path::PathBuf> {
    let span: Span = entries.iter().find(|e| e.key == "foreach")?.node.span?;
    file.sources.get(span.source)?.base.clone()
}

/// Tries the template with a made-up item, so that a mistyped reference is found before any work.
fn check_template(entry: &Entry, scope: &Scope<'_>, problems: &mut Vec<Problem>) {
    let item = Item { path: "item.mp4".into(), rel: ".".into(), index: 0 };
    problems.extend(resolve(&entry.node, &Scope { item: Some(&item), ..*scope }).err());
}

/// `${item.…}` without [batch] would never be filled.
fn check_item_use(file: &PipelineFile, problems: &mut Vec<Problem>) {
    if file.batch.is_some() {
        return;
    }
    for entry in file.stages.iter().flat_map(|s| &s.settings) {
        if super::reference::refers_to_item(&entry.node) {
            let message = format!("`{}` refers to the item, but there is no [batch]", entry.key);
            let inputs = suggest::listed(&["[batch] foreach = \"clips/*.mp4\"", "--set batch.foreach='clips/*.mp4'"]);
            problems.push(
                Problem::new("reference", message)
                    .label(entry.node.span, "no item here")
                    .help(format!("give {inputs}")),
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stages::MeshDeformSettings;
    use plumbline_shape::surface::LaplacianKind;

    /// A pipeline that deforms a mesh, with `setting` on its ninth line.
    fn deforming(setting: &str) -> Result<Pipeline, Problems> {
        let text = format!(
            "version = 1\n[stage.mesh]\nuse = \"mesh.load\"\npath = \"a.obj\"\n[stage.posed]\nuse = \"mesh.deform\"\n\
             inputs = [\"mesh\"]\nhandles = \"h.json\"\n{setting}\n[stage.out]\nuse = \"mesh.save\"\n\
             inputs = [\"posed\"]\npath = \"b.obj\"\n"
        );
        read(Source { name: "x.toml".to_owned(), text, base: None }, &[])
    }

    #[test]
    fn keys_of_a_flattened_part_are_read_and_others_are_refused_at_their_place() {
        let good = deforming("laplacian = \"uniform\"").expect("no faults");
        let settings = good.graph.stage("posed").and_then(|s| s.settings.get::<MeshDeformSettings>());
        assert_eq!(settings.map(|s| s.options.laplacian), Some(LaplacianKind::Uniform));
        for (setting, code, message) in [
            ("laplacien = \"uniform\"", "unknown-key", "has no setting `laplacien`"),
            ("smoothness = 0.1", "unknown-key", "has no setting `smoothness`"),
            ("options = {}", "unknown-key", "has no setting `options`"),
            ("laplacian = \"cotangens\"", "bad-value", "expected `cotangent` or `uniform`"),
            ("tolerance = 0.7", "out-of-range", "expected 0 to 0.5"),
        ] {
            let problems = deforming(setting).expect_err("a fault");
            let problem = &problems.problems[0];
            assert_eq!((problems.problems.len(), problem.code), (1, code), "{problem:?}");
            assert!(problem.message.contains(message), "{}", problem.message);
            assert_eq!(problems.sources.line_column(problem.labels[0].0).0, 9);
        }
    }
}
