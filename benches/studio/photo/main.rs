//! Bars of the photo workspace of the studio, in CPU time of this process: a line drag among 24 lines on a photo of 12 megapixels.
//!
//! ```sh
//! cargo run --release --example studio_photo_bars -- media/room-kb-125.jpg media/room-kb-125.lens.json media/room-kb-125.lines.json
//! ```
//!
//! The photo is enlarged to 12 megapixels where it is smaller, its marks with it; `--megapixels N` takes another size. Sends the
//! edits of a hand that drags to the workspace, as the session does, and reads what comes back.

#![allow(clippy::print_stdout)] // a table of figures is its result

#[path = "../measure.rs"]
mod measure;

use std::error::Error;
use std::path::Path;

use measure::{Started, quantile, report, report_memory};
use nalgebra::Matrix2x3;
use plumbline::image::still::Photo;
use plumbline::image::warp::{Map, WarpField};
use plumbline::num::run::Run;
use plumbline_studio::files::DocumentFiles;
use plumbline_studio::outbox::Outbox;
use plumbline_studio::photo::{Ask, BufferKind, PhotoDocument, PhotoWorkspace, View};
use plumbline_studio::workspace::{Answer, Work, Workspace};
use serde_json::{Value, json};

const DRAGS: u32 = 150;
const LINES: usize = 24;
/// The result on a screen of 1920 × 1080, px.
const SCREEN: [u32; 2] = [690, 900];

type Failure = Box<dyn Error>;

fn main() -> Result<(), Failure> {
    let mut args: Vec<String> = std::env::args().skip(1).collect();
    let mut megapixels = 12.0;
    if let Some(at) = args.iter().position(|a| a == "--megapixels") {
        megapixels = args.get(at + 1).ok_or("--megapixels needs a number")?.parse()?;
        args.drain(at..at + 2);
    }
    let [photo, lens, lines] = args.as_slice() else {
        return Err("a photo, a lens file and a lines file are needed".into());
    };
    let folder = tempfile::tempdir()?;
    let folder = folder.path().canonicalize()?;
    let scale = enlarged(Path::new(photo), &folder.join("photo.jpg"), megapixels)?;
    std::fs::copy(lens, folder.join("lens.json"))?;
    let marks = marks(Path::new(lines), scale)?;
    report_memory()?;
    let mut bench = Bench::open(&folder.join("photo.jpg"))?;
    report_memory()?;
    bench.mark(&marks)?;
    report_memory()?;
    bench.drag(&marks)?;
    bench.rest()?;
    report_memory()?;
    bench.export()?;
    report_memory()
}

/// Writes the photo with so many megapixels; gives the scale.
fn enlarged(from: &Path, to: &Path, megapixels: f64) -> Result<f64, Failure> {
    let photo = Photo::load(from)?;
    let (w, h) = (photo.frame.width as f64, photo.frame.height as f64);
    let scale = (megapixels * 1e6 / (w * h)).sqrt();
    let map = Map::Affine(Matrix2x3::new(1.0 / scale, 0.0, 0.0, 0.0, 1.0 / scale, 0.0));
    let size = ((w * scale).round() as usize, (h * scale).round() as usize);
    photo.rendered(&WarpField::identity().then(map), size, &Run::default())?.save(to)?;
    Ok(scale)
}

/// The longest lines of a file, their points scaled.
fn marks(file: &Path, scale: f64) -> Result<Vec<Value>, Failure> {
    let file: Value = serde_json::from_slice(&std::fs::read(file)?)?;
    let mut lines = file["lines"].as_array().ok_or("no lines")?.clone();
    lines.sort_by_key(|line| std::cmp::Reverse(line["points"].as_array().map_or(0, Vec::len)));
    lines.truncate(LINES);
    for line in &mut lines {
        for v in line["points"].as_array_mut().into_iter().flatten().filter_map(Value::as_array_mut).flatten() {
            *v = json!(v.as_f64().unwrap_or(0.0) * scale);
        }
    }
    Ok(lines)
}

struct Bench {
    files: DocumentFiles,
    workspace: PhotoWorkspace,
    document: PhotoDocument,
    out: Outbox,
}

impl Bench {
    fn open(file: &Path) -> Result<Self, Failure> {
        let mut files = DocumentFiles::new(file, std::collections::BTreeMap::default());
        let started = Started::now();
        let (mut workspace, document) = PhotoWorkspace::open(&mut files, &Run::default())?;
        let mut out = Outbox::default();
        workspace.greet(&document, &mut out);
        report("opening to the source on the page", started.spent());
        workspace.view(&document, View { size: Some(SCREEN), ..View::default() })?;
        Ok(Self { files, workspace, document, out })
    }

    fn edit(&mut self, edit: Value) -> Result<(), Failure> {
        let step = self.workspace.edit(&self.document, serde_json::from_value(edit)?)?;
        self.document = step.document;
        self.workspace.changed(&self.document);
        Ok(())
    }

    /// Slices until a picture is there.
    fn picture(&mut self) -> Result<(), Failure> {
        self.out.buffers.clear();
        while !self.out.buffers.iter().any(|b| b.kind == BufferKind::Result as u32) {
            if self.workspace.work(&self.document, &mut self.out, &Run::default())? == Work::Rest {
                break;
            }
        }
        Ok(())
    }

    fn mark(&mut self, lines: &[Value]) -> Result<(), Failure> {
        self.edit(json!({ "do": "set_lens", "lens": "lens.json" }))?;
        for line in lines {
            self.edit(json!({ "do": "add_line", "points": line["points"], "orientation": line["orientation"] }))?;
        }
        self.rest()
    }

    /// An end of a line goes back and forth; each update is solved, sampled and packed before the next one comes.
    fn drag(&mut self, lines: &[Value]) -> Result<(), Failure> {
        let (line, start) = (3, &lines[3]["points"][0]);
        let (x, y) = (start[0].as_f64().ok_or("a point")?, start[1].as_f64().ok_or("a point")?);
        let mut times = Vec::new();
        for k in 0..DRAGS {
            let phase = f64::from(k) * 0.2;
            let started = Started::now();
            let (x, y) = (x + 30.0 * phase.sin(), y + 20.0 * (0.7 * phase).sin());
            self.edit(json!({ "do": "move_point", "line": line, "point": 0, "x": x, "y": y }))?;
            self.picture()?;
            let state = serde_json::to_value(self.workspace.state(&self.document))?;
            if state["result"]["exact"] == true {
                return Err("a drag was solved exactly".into());
            }
            times.push(started.spent());
        }
        report("line drag, first update", times[0]);
        report("line drag, median of the others", quantile(&times[1..], 0.5));
        report("line drag, p95 of all", quantile(&times, 0.95));
        Ok(())
    }

    fn rest(&mut self) -> Result<(), Failure> {
        let started = Started::now();
        while self.workspace.work(&self.document, &mut self.out, &Run::default())? == Work::More {}
        let state = serde_json::to_value(self.workspace.state(&self.document))?;
        report("to rest", started.spent());
        if state["result"]["exact"] != true {
            return Err(format!("no exact result: {}", state["problem"]).into());
        }
        Ok(())
    }

    fn export(&mut self) -> Result<(), Failure> {
        let started = Started::now();
        let answer = self.workspace.ask(&self.document, Ask::Export, &self.files, &Run::default())?;
        let Answer::Download { bytes, .. } = answer else { return Err("an export is a file".into()) };
        report("export at full size", started.spent());
        println!("the file                             {:8.1} MB", bytes.len() as f64 / 1e6);
        Ok(())
    }
}
