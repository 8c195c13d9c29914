//! `plumbline mesh`: what is in mesh files, repair, and conversion between formats.

mod files;

use std::fmt::Write as _;
use std::io::Write as _;
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::str::FromStr;

use clap::{Args, Subcommand};
use serde_json::{Value, json};

use super::failure::Failure;
use super::job::path_text;
use super::print;
use super::session::Session;
use crate::pipeline::Exit;
use crate::pipeline::items::Found;
use crate::pipeline::paths::to_text;
use crate::pipeline::threads::start;
use crate::stages::mesh::mesh_error;
use files::{MeshTargetArgs, Target, all_inputs};
use plumbline_num::run::Run;
use plumbline_shape::mesh::io::{WriteOptions, losses, write_model_if};
use plumbline_shape::mesh::model::{Axis, CoordinateChange, LengthUnit};
use plumbline_shape::mesh::{
    MeshError, MeshFacts, MeshFormat, Model, ReadLimits, RepairOptions, Weld, read_model, repair,
};

/// Options of `plumbline mesh`.
#[derive(Debug, Args)]
pub(super) struct MeshArgs {
    #[command(subcommand)]
    command: MeshCommand,
}

#[derive(Debug, Subcommand)]
enum MeshCommand {
    /// Show what is in mesh files, and what repair would change
    Info(ReadArgs),
    /// Make meshes oriented manifolds, and report the changes
    Repair(RepairArgs),
    /// Write meshes in another format
    Convert(ConvertArgs),
}

/// What all three take.
#[derive(Debug, Args)]
struct ReadArgs {
    /// Mesh files (obj ply off stl gltf glb fbx mesh), or folders of them
    #[arg(required = true, value_parser = path_text(), value_name = "INPUT")]
    inputs: Vec<String>,
    /// Of a folder, take only the files directly in it; by default folders are searched at any depth
    #[arg(long)]
    no_recurse: bool,
    /// Meshes at work at once; 0 = all processors
    #[arg(long, default_value_t = 0, value_name = "N", value_parser = clap::value_parser!(u32).range(0..=256))]
    jobs: u32,
    /// Print JSON, a list with an item per input
    #[arg(long)]
    json: bool,
    /// Most bytes of an input, the files that it refers to included
    #[arg(long, default_value_t = ReadLimits::default().max_bytes, value_name = "N")]
    max_bytes: u64,
    /// Also open files of this folder that an input names, such as buffers of glTF; may be repeated
    #[arg(long = "allow-path", value_name = "DIR")]
    allow_paths: Vec<PathBuf>,
}

#[derive(Debug, Args)]
struct RepairArgs {
    #[command(flatten)]
    read: ReadArgs,
    #[command(flatten)]
    target: MeshTargetArgs,
    /// Join vertices with equal coordinates (exact), also at open edges across gaps of a hundredth of the edges there (gaps), none (never),
    /// or those within this fraction of the diagonal
    #[arg(long, default_value = "exact", value_name = "exact|gaps|never|FRACTION", value_parser = weld)]
    weld: Weld,
    /// A triangle whose height is at most this fraction of its longest side has no area
    #[arg(long, default_value_t = RepairOptions::default().flat, value_name = "FRACTION", value_parser = fraction)]
    flat: f64,
}

#[derive(Debug, Args)]
struct ConvertArgs {
    #[command(flatten)]
    read: ReadArgs,
    #[command(flatten)]
    target: MeshTargetArgs,
    /// Multiply all lengths by this number
    #[arg(long, value_name = "NUMBER", value_parser = scale)]
    scale: Option<f64>,
    /// Write lengths in another unit, such as mm:m (mm, cm, m, in, ft)
    #[arg(long, value_name = "FROM:TO", value_parser = unit)]
    unit: Option<f64>,
    /// Rotate the mesh so that another axis points up, such as z:y; glTF means y
    #[arg(long, value_name = "FROM:TO", value_parser = up)]
    up: Option<(Axis, Axis)>,
}

impl ConvertArgs {
    fn change(&self) -> CoordinateChange {
        let scale = self.scale.unwrap_or(1.0) * self.unit.unwrap_or(1.0);
        self.up.map_or(CoordinateChange { scale, ..CoordinateChange::default() }, |up| CoordinateChange { scale, up })
    }
}

fn scale(text: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| format!("{text:?} is not a number"))?;
    if (1e-12..=1e12).contains(&value) { Ok(value) } else { Err(format!("{value} is out of range (1e-12 to 1e12)")) }
}

/// Two words with a colon between them.
fn pair<T: FromStr<Err = String>>(text: &str) -> Result<(T, T), String> {
    let (from, to) = text.split_once(':').ok_or_else(|| format!("{text:?} is not of the form FROM:TO"))?;
    Ok((from.parse()?, to.parse()?))
}

fn unit(text: &str) -> Result<f64, String> {
    pair::<LengthUnit>(text).map(|(from, to)| from.meters() / to.meters())
}

fn up(text: &str) -> Result<(Axis, Axis), String> {
    pair(text)
}

fn fraction(text: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| format!("{text:?} is not a number"))?;
    if (0.0..=0.1).contains(&value) { Ok(value) } else { Err(format!("{value} is out of range (0 to 0.1)")) }
}

fn weld(text: &str) -> Result<Weld, String> {
    match text {
        "exact" => Ok(Weld::Exact),
        "gaps" => Ok(Weld::GAPS),
        "never" => Ok(Weld::Never),
        _ => fraction(text).map(Weld::Within).map_err(|e| format!("{e}; exact, gaps and never are the other choices")),
    }
}

/// What is reported of one input.
struct Report {
    text: String,
    json: Value,
}

impl MeshArgs {
    pub(super) fn run(self, session: &Session<'_>) -> Result<Exit, Failure> {
        let run = &session.interrupt.run();
        match self.command {
            MeshCommand::Info(read) => read.each(session, true, |_, model, format| info(model, format, run)),
            MeshCommand::Repair(args) => {
                let options = RepairOptions { weld: args.weld, flat: args.flat };
                let targets = args.target.of(&args.read.found()?)?;
                args.read.each(session, true, |k, model, _| repaired(model, &options, &targets[k], run))
            }
            MeshCommand::Convert(args) => {
                let targets = args.target.of(&args.read.found()?)?;
                let change = args.change();
                args.read.each(session, false, |k, model, _| {
                    if change.is_identity() {
                        written(model, &targets[k], run)
                    } else {
                        written(&model.with_coordinates(&change)?, &targets[k], run)
                    }
                })
            }
        }
    }
}

impl ReadArgs {
    /// The files that the inputs mean.
    fn found(&self) -> Result<Vec<Found>, Failure> {
        all_inputs(&self.inputs, !self.no_recurse)
    }

    /// Does `work` with each input, some at once, and reports in their order; one that fails does not stop the others. Vertices that are
    /// not finite are mended or refused.
    fn each(
        &self,
        session: &Session<'_>,
        mend_vertices: bool,
        work: impl Fn(usize, &Model, Option<MeshFormat>) -> Result<Report, MeshError> + Sync,
    ) -> Result<Exit, Failure> {
        let run = &session.interrupt.run();
        let (max_bytes, allow_paths) = (self.max_bytes, self.allow_paths.clone());
        let limits = ReadLimits { max_bytes, allow_paths, mend_vertices, ..ReadLimits::default() };
        let inputs = self.found()?;
        let (mut items, mut failed, mut last) = (Vec::new(), 0, Exit::Done);
        let one = |k: usize| {
            let path = &inputs[k].path;
            let format = MeshFormat::of_name(path);
            read_model(path, &limits, run).and_then(|model| work(k, &model, format))
        };
        let ended = in_order(inputs.len(), self.jobs, &one, |k, report| {
            let path = &inputs[k].path;
            match report {
                Ok(report) => {
                    let name = path.display().to_string();
                    if self.json {
                        items.push(with_file(&to_text(path), report.json));
                    } else {
                        let heading = if inputs.len() > 1 { format!("{name}\n") } else { String::new() };
                        print(&format!("{heading}{}\n", report.text.trim_end()));
                    }
                }
                Err(error) => {
                    failed += 1;
                    let failure = Failure::from(mesh_error(path, &error));
                    last = failure.exit;
                    failure.report();
                    if run.check().is_err() {
                        return ControlFlow::Break(());
                    }
                    items.push(json!({ "file": to_text(path), "error": error.to_string() }));
                }
            }
            ControlFlow::Continue(())
        });
        if ended.is_break() {
            return Ok(session.interrupt.exit());
        }
        if self.json {
            print(&format!("{:#}\n", Value::Array(items)));
        }
        if failed > 0 && inputs.len() > 1 {
            // A closed standard error leaves nothing to print to.
            let _ = writeln!(std::io::stderr().lock(), "{failed} of {} items failed", inputs.len());
        }
        Ok(if failed == 0 || failed == inputs.len() { last } else { Exit::Partial })
    }
}

/// Does `work` for each number below `count`, `jobs` at once (0: all processors), and hands the results on in order until
/// `take` has enough.
fn in_order<T: Send>(
    count: usize,
    jobs: u32,
    work: &(dyn Fn(usize) -> T + Sync),
    mut take: impl FnMut(usize, T) -> ControlFlow<()>,
) -> ControlFlow<()> {
    let processors = std::thread::available_parallelism().map_or(1, usize::from);
    let jobs = if jobs == 0 { processors } else { jobs as usize };
    // By blocks, so that at most so many results wait for an earlier one.
    for first in (0..count).step_by(jobs) {
        let block = first..(first + jobs).min(count);
        let results: Vec<T> = std::thread::scope(|scope| {
            let others = block.clone().skip(1).map(|k| (k, start(scope, "mesh", move || work(k))));
            let others: Vec<_> = others.collect();
            let mut results = vec![work(first)];
            results.extend(others.into_iter().map(|(k, thread)| match thread {
                Ok(thread) => thread.join().unwrap_or_else(|e| std::panic::resume_unwind(e)),
                // The system starts no more threads.
                Err(_) => work(k),
            }));
            results
        });
        block.zip(results).try_for_each(|(k, result)| take(k, result))?;
    }
    ControlFlow::Continue(())
}

fn with_file(name: &str, mut report: Value) -> Value {
    report["file"] = json!(name);
    report
}

fn info(model: &Model, format: Option<MeshFormat>, run: &Run) -> Result<Report, MeshError> {
    let facts = MeshFacts::of(model.mesh());
    let report = repair(model.mesh(), &RepairOptions::default(), run)?.report;
    let mut text = format!("{facts}\n");
    let polygons = model.faces().iter().filter(|face| face.len() > 3).count();
    let lists = [
        (polygons, "polygons of more than three corners"),
        (model.texture().map_or(0, |t| t.values.len()), "texture coordinates"),
        (model.normals().map_or(0, |n| n.values.len()), "normals"),
        (model.colors().map_or(0, <[_]>::len), "colors"),
        (model.groups().all.len(), "groups"),
        (model.materials().all.len(), "materials"),
    ];
    for (count, what) in lists.iter().filter(|(count, _)| *count > 0) {
        let _ = writeln!(text, "{count} {what}");
    }
    text += &notes(model);
    text += "repair: ";
    text +=
        &if report.is_clean() { "nothing to do".to_owned() } else { report.changes().collect::<Vec<_>>().join("; ") };
    let groups: Vec<_> = model.groups().all.iter().map(|g| json!({ "object": g.object, "group": g.name })).collect();
    let json = json!({
        "format": format.map(|f| f.to_string()),
        "facts": facts,
        "polygons": polygons,
        "texture_coordinates": lists[1].0,
        "normals": lists[2].0,
        "colors": lists[3].0,
        "groups": groups,
        "materials": model.materials().all.iter().map(|m| &m.name).collect::<Vec<_>>(),
        "notes": model.warnings(),
        "repair": report,
    });
    Ok(Report { text, json })
}

fn repaired(model: &Model, options: &RepairOptions, target: &Target, run: &Run) -> Result<Report, MeshError> {
    let repaired = repair(model.mesh(), options, run)?;
    let report = written(&model.repaired(&repaired), target, run)?;
    let text = format!("{}{}\n{}", notes(model), repaired.report, report.text);
    Ok(Report { text, json: json!({ "notes": model.warnings(), "repair": repaired.report, "written": report.json }) })
}

/// What the reader left out or mended, a line each.
fn notes(model: &Model) -> String {
    model.warnings().iter().flat_map(|warning| ["note: ", warning, "\n"]).collect()
}

fn written(model: &Model, target: &Target, run: &Run) -> Result<Report, MeshError> {
    let Target { path, ascii, if_exists, in_folder } = target;
    if let Some(folder) = path.parent().filter(|_| *in_folder) {
        // A folder that cannot be made is reported with the file that cannot be written there.
        let _ = std::fs::create_dir_all(folder);
    }
    write_model_if(path, model, &WriteOptions { ascii: *ascii }, *if_exists, run)?;
    let lost = MeshFormat::of_name(path).map(|format| losses(model, format)).unwrap_or_default();
    let mut text = format!("written: {}", path.display());
    if !lost.is_empty() {
        let _ = write!(text, "\nnot held by the format: {}", lost.join(", "));
    }
    Ok(Report { text, json: json!({ "path": path.display().to_string(), "lost": lost }) })
}
