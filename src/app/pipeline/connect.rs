//! Connects the stages of a file: names to stages, outputs to ports, types to types, every fault at once.

use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashMap};
use std::sync::Arc;

use super::file::{Input, Name, PipelineFile, StageEntry};
use super::graph::{Edge, Graph, Stage};
use super::kind::{Settings, StageKind};
use super::port::{Port, PortType};
use super::problem::{MAX_SHOWN, Problem};
use super::suggest::did_you_mean;
use super::syntax::{Entry, Span};
use super::warps;

/// What [`connect`] needs of a stage beside its entry.
pub(super) struct Prepared {
    pub enabled: bool,
    pub settings: Option<Arc<dyn Settings>>,
    pub deferred: Vec<Entry>,
}

/// An edge before the stages are sorted, with the span of its text.
struct Link {
    port: &'static Port,
    from: usize,
    output: &'static Port,
    span: Option<Span>,
}

/// Connects the stages of `file`; appends every fault, and gives the graph if there was none.
pub(super) fn connect(file: &PipelineFile, prepared: Vec<Prepared>, problems: &mut Vec<Problem>) -> Graph {
    let before = problems.len();
    // The first of a name counts: TOML has no second.
    let mut named = HashMap::new();
    for (i, stage) in file.stages.iter().enumerate() {
        named.entry(stage.name.text.as_str()).or_insert(i);
    }
    let wiring = Wiring { stages: &file.stages, named: &named, prepared: &prepared };
    let links: Vec<Vec<Link>> = (0..file.stages.len()).map(|i| wiring.links(i, problems)).collect();
    let order = sorted(&file.stages, &links, problems);
    if problems.len() > before {
        return Graph::default();
    }
    let graph = assemble(file, prepared, &links, &order);
    check_sinks(&graph, problems);
    let span = |stage: &Stage| named.get(stage.name.as_str()).and_then(|i| file.stages[*i].name.span);
    check_resamples(&graph, &span, problems);
    check_streams(&graph, &span, problems);
    graph
}

/// Edges of one stage, and what was found beside them.
#[derive(Default)]
struct Found {
    links: Vec<Link>,
    /// Edges from disabled stages: port, stage, span.
    disabled: Vec<(&'static Port, usize, Option<Span>)>,
    /// An edge was refused, so that a missing one may be its consequence.
    unsound: bool,
}

struct Wiring<'a> {
    stages: &'a [StageEntry],
    /// Positions of the stages by their names.
    named: &'a HashMap<&'a str, usize>,
    prepared: &'a [Prepared],
}

impl Wiring<'_> {
    fn links(&self, at: usize, problems: &mut Vec<Problem>) -> Vec<Link> {
        let stage = &self.stages[at];
        let Some(kind) = stage.kind.filter(|_| self.prepared[at].enabled) else { return Vec::new() };
        let mut found = Found { unsound: stage.unsound, ..Found::default() };
        for (port, from) in assignments(stage, kind, problems, &mut found.unsound) {
            match self.resolve(stage, port, from, problems) {
                Some((i, _)) if !self.prepared[i].enabled => found.disabled.push((port, i, from.span)),
                Some((i, output)) => found.links.push(Link { port, from: i, output, span: from.span }),
                None => found.unsound = true,
            }
        }
        for port in kind.inputs {
            self.check_arity(stage, port, &found, problems);
        }
        found.links.sort_by_key(|l| kind.inputs.iter().position(|p| p.name == l.port.name));
        found.links
    }

    /// The stage and output that `from` names, if it fits `port`. Stages of unknown kind were reported: `None` without a word.
    fn resolve(
        &self,
        stage: &StageEntry,
        port: &'static Port,
        from: &Name,
        problems: &mut Vec<Problem>,
    ) -> Option<(usize, &'static Port)> {
        let (name, output) = from.text.split_once('.').map_or((from.text.as_str(), None), |(s, o)| (s, Some(o)));
        // The stage by its name.
        let Some(&i) = self.named.get(name) else {
            // A suggestion looks at every stage: of more faults than are shown it is left out.
            let known = self.stages.iter().take(if problems.len() < MAX_SHOWN { usize::MAX } else { 0 });
            problems.push(
                Problem::new(
                    "input",
                    format!("stage `{}` takes input from `{name}`, which does not exist", stage.name.text),
                )
                .label(from.span, "no such stage")
                .suggest(did_you_mean(name, known.map(|s| s.name.text.as_str()))),
            );
            return None;
        };
        let kind = self.stages[i].kind?;
        // The output by its name; the first where none is given.
        let found = output.map_or(kind.outputs.first(), |o| kind.output(o));
        let Some(found) = found else {
            let output = output.unwrap_or_default();
            problems.push(
                Problem::new("input", format!("stage `{name}` ({}) has no output `{output}`", kind.name))
                    .label(from.span, "no such output")
                    .suggest(did_you_mean(output, kind.outputs.iter().map(|p| p.name))),
            );
            return None;
        };
        // Both ports must carry the same type.
        if found.data != port.data {
            problems.push(wrong_data(stage, port, from, (name, kind, found)));
            return None;
        }
        Some((i, found))
    }

    /// Edges that `port` has too many of, or too few.
    fn check_arity(&self, stage: &StageEntry, port: &'static Port, found: &Found, problems: &mut Vec<Problem>) {
        let mine: Vec<&Link> = found.links.iter().filter(|l| l.port.name == port.name).collect();
        let name = &stage.name.text;
        if !port.arity.is_list() && mine.len() > 1 {
            let message = format!("port `{}` of stage `{name}` takes one input, not {}", port.name, mine.len());
            problems.push(Problem::new("input", message).label(mine[1].span, "one too many"));
        }
        for (i, link) in mine.iter().enumerate() {
            let same = |l: &&Link| l.from == link.from && l.output.name == link.output.name;
            if port.arity.is_list() && mine[..i].iter().any(same) {
                let message = format!("port `{}` of stage `{name}` takes the same data twice", port.name);
                problems.push(Problem::new("input", message).label(link.span, "named before"));
            }
        }
        if port.arity.is_required() && mine.is_empty() {
            problems.extend(self.missing(stage, port, found));
        }
    }

    /// A required port without an edge; nothing where that follows from a fault reported before.
    fn missing(&self, stage: &StageEntry, port: &'static Port, found: &Found) -> Option<Problem> {
        let name = &stage.name.text;
        if let Some((_, from, span)) = found.disabled.iter().find(|(p, ..)| p.name == port.name) {
            let from = &self.stages[*from];
            let switch = from.enable.as_ref().and_then(|n| n.span);
            let message = format!("stage `{name}` needs `{}`, which is disabled", from.name.text);
            let problem = Problem::new("disabled", message)
                .label(*span, format!("port `{}` needs it", port.name))
                .label(switch, "disabled here")
                .help("disable the consumer too, or take the input from another stage");
            return Some(problem);
        }
        let problem = || {
            Problem::new("input", format!("port `{}` of stage `{name}` is not connected", port.name))
                .label(stage.name.span, format!("needs {}: {}", port.data, port.doc))
                .help(format!(
                    "add it to `inputs`, for example `inputs = {{ {} = {} }}`",
                    port.name,
                    self.example(port)
                ))
        };
        (!found.unsound).then(problem)
    }

    /// A stage of the file that could feed `port`, as it would be written.
    fn example(&self, port: &Port) -> String {
        let feeds = |s: &StageEntry| {
            let outputs = s.kind?.outputs;
            let at = outputs.iter().position(|o| o.data == port.data)?;
            Some(if at == 0 { s.name.text.clone() } else { format!("{}.{}", s.name.text, outputs[at].name) })
        };
        let name = self.stages.iter().find_map(feeds).unwrap_or_else(|| "STAGE".to_owned());
        if port.arity.is_list() { format!("[\"{name}\"]") } else { format!("\"{name}\"") }
    }
}

/// Which name goes to which port: the table form says so, the list form fills the ports in order.
fn assignments<'n>(
    stage: &'n StageEntry,
    kind: &'static StageKind,
    problems: &mut Vec<Problem>,
    unsound: &mut bool,
) -> Vec<(&'static Port, &'n Name)> {
    let mut out = Vec::new();
    for Input { port, from, .. } in &stage.inputs {
        let Some(name) = port else {
            out.extend(in_order(stage, kind, from, problems, unsound));
            continue;
        };
        if let Some(port) = kind.input(&name.text) {
            out.extend(from.iter().map(|f| (port, f)));
        } else {
            *unsound = true;
            problems.push(unknown_input(stage, kind, name));
        }
    }
    out
}

/// The list form: each name to the next port, the rest to a last port that takes a list.
fn in_order<'n>(
    stage: &StageEntry,
    kind: &'static StageKind,
    from: &'n [Name],
    problems: &mut Vec<Problem>,
    unsound: &mut bool,
) -> Vec<(&'static Port, &'n Name)> {
    let mut out = Vec::new();
    let last = kind.inputs.last().filter(|p| p.arity.is_list());
    for (i, name) in from.iter().enumerate() {
        if let Some(port) = kind.inputs.get(i).or(last) {
            out.push((port, name));
        } else {
            *unsound = true;
            let count = kind.inputs.len();
            let message = format!("stage `{}` ({}) takes {count} inputs, this is one more", stage.name.text, kind.name);
            problems.push(Problem::new("input", message).label(name.span, "too many"));
        }
    }
    out
}

fn unknown_input(stage: &StageEntry, kind: &StageKind, port: &Name) -> Problem {
    let message = format!("stage `{}` ({}) has no input `{}`", stage.name.text, kind.name, port.text);
    let none = kind.inputs.is_empty().then(|| "it takes no inputs".to_owned());
    let suggestion = did_you_mean(&port.text, kind.inputs.iter().map(|p| p.name)).or(none);
    Problem::new("input", message).label(port.span, "no such input").suggest(suggestion)
}

fn wrong_data(stage: &StageEntry, port: &Port, from: &Name, source: (&str, &StageKind, &Port)) -> Problem {
    let (name, kind, output) = source;
    let message = format!(
        "`{}` gives {}, but port `{}` of stage `{}` takes {}",
        from.text, output.data, port.name, stage.name.text, port.data
    );
    let fitting = kind.outputs.iter().find(|o| o.data == port.data);
    Problem::new("type", message)
        .label(from.span, format!("this is {}", output.data))
        .suggest(fitting.map(|o| format!("did you mean `{name}.{}`?", o.name)))
}

/// Kahn's algorithm, ties in the order of the file; a cycle is reported with its chain.
fn sorted(stages: &[StageEntry], links: &[Vec<Link>], problems: &mut Vec<Problem>) -> Vec<usize> {
    let mut order: Vec<usize> = Vec::with_capacity(stages.len());
    let mut done = vec![false; stages.len()];
    let mut waiting: Vec<usize> = links.iter().map(Vec::len).collect();
    let mut feeds: Vec<Vec<usize>> = vec![Vec::new(); stages.len()];
    for (i, link) in links.iter().enumerate().flat_map(|(i, links)| links.iter().map(move |link| (i, link))) {
        feeds[link.from].push(i);
    }
    let mut ready: BinaryHeap<Reverse<usize>> = (0..stages.len()).filter(|i| waiting[*i] == 0).map(Reverse).collect();
    while let Some(Reverse(next)) = ready.pop() {
        done[next] = true;
        order.push(next);
        for &fed in &feeds[next] {
            waiting[fed] -= 1;
            ready.extend((waiting[fed] == 0).then_some(Reverse(fed)));
        }
    }
    if let Some(start) = done.iter().position(|d| !d) {
        problems.push(cycle(start, stages, links, &done));
    }
    order
}

fn cycle(start: usize, stages: &[StageEntry], links: &[Vec<Link>], done: &[bool]) -> Problem {
    // Every stage that is left waits for one that is left: walking back must meet itself.
    let mut walk = vec![start];
    let mut position = HashMap::from([(start, 0)]);
    let ring = loop {
        let at = walk[walk.len() - 1];
        let Some(from) = links[at].iter().map(|l| l.from).find(|&f| !done[f]) else { break walk };
        if let Some(first) = position.insert(from, walk.len()) {
            break walk.split_off(first);
        }
        walk.push(from);
    };
    let mut names: Vec<&str> = ring.iter().rev().take(MAX_SHOWN).map(|&i| stages[i].name.text.as_str()).collect();
    if ring.len() > names.len() {
        names.push("…");
    }
    names.push(names[0]);
    let next = ring.get(1).unwrap_or(&ring[0]);
    let span = links[ring[0]].iter().find(|l| l.from == *next).and_then(|l| l.span);
    Problem::new("cycle", format!("the stages form a cycle: {}", names.join(" → ")))
        .label(span, "closes the circle")
        .help("a stage cannot take data that it gave")
}

fn assemble(file: &PipelineFile, mut prepared: Vec<Prepared>, links: &[Vec<Link>], order: &[usize]) -> Graph {
    let mut position = vec![usize::MAX; file.stages.len()];
    let mut graph = Graph::default();
    for &i in order {
        let entry = &file.stages[i];
        let state = &mut prepared[i];
        let (Some(kind), Some(settings), true) = (entry.kind, state.settings.take(), state.enabled) else { continue };
        position[i] = graph.stages.len();
        let edges = links[i].iter().map(|l| Edge { port: l.port, from: position[l.from], output: l.output }).collect();
        let deferred = std::mem::take(&mut state.deferred);
        graph.stages.push(Stage { name: entry.name.text.clone(), kind, settings, deferred, edges });
    }
    graph
}

fn check_sinks(graph: &Graph, problems: &mut Vec<Problem>) {
    let writes = |s: &Stage| s.kind.outputs.iter().any(|o| o.data == PortType::File) || !s.settings.writes().is_empty();
    if !graph.stages.is_empty() && !graph.stages.iter().any(writes) && problems.is_empty() {
        let help = "add a stage such as `use = \"video.encode\"` or `use = \"image.save\"`";
        problems.push(Problem::new("no-output", "the pipeline writes no file").help(help));
    }
}

/// What the bodies of the stages cannot do: pictures of another clip beside the result, maps in an order that means nothing.
fn check_streams(graph: &Graph, span_of: &dyn Fn(&Stage) -> Option<Span>, problems: &mut Vec<Problem>) {
    for stage in &graph.stages {
        let from = |port: &str| stage.edges.iter().find(|e| e.port.name == port).map(|e| e.from);
        let span = || span_of(stage);
        let upstream = |at: usize| graph.stages[at].edges.iter().find(|e| e.port.name == "frames").map(|e| e.from);
        if let (Some(frames), Some(beside)) = (from("frames"), from("side_by_side"))
            && beside != frames
            && Some(beside) != upstream(frames)
        {
            let (shown, other) = (&graph.stages[frames].name, &graph.stages[beside].name);
            let message = format!("`{}` shows `{shown}` beside `{other}`, which it is not made from", stage.name);
            let help = "connect `beside` to the stage that `frames` takes its pictures from";
            problems.push(Problem::new("side_by_side", message).label(span(), "in this stage").help(help));
        }
        problems.extend(warps::check(graph, stage).map(|p| p.label(span(), "in this stage")));
    }
}

fn check_resamples(graph: &Graph, span_of: &dyn Fn(&Stage) -> Option<Span>, problems: &mut Vec<Problem>) {
    let resamples = graph.all_resamples();
    for (i, stage) in graph.stages.iter().enumerate() {
        let twice = stage.kind.resamples && resamples[i] > 1;
        let feeds_again = stage.edges.iter().find(|e| e.output.data.is_picture() && resamples[e.from] > 0);
        if let (true, Some(edge)) = (twice, feeds_again) {
            let first = &graph.stages[edge.from].name;
            problems.push(
                Problem::new(
                    "two-resamples",
                    format!("`{}` would interpolate pixels that were interpolated before (`{first}`)", stage.name),
                )
                .label(span_of(stage), "second interpolation of the same pixels")
                .help("give all maps to one render stage: `warps = [\"first\", \"second\"]`"),
            );
        }
    }
}
