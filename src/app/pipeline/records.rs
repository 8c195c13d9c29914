//! What earlier runs made, on record beside the results, so that a batch can be run again.
//!
//! Each folder with results has a file `.plumbline/done.jsonl`: one JSON object per line and item, the last line of an item
//! counts. It states from which inputs, settings and version the results were made, and size and time of every file, so that a
//! later run can decide without reading a picture whether a result is [up to date](Standing::UpToDate), and otherwise name what
//! differs. What does not change a result (threads, progress, items at once) is not compared, nor are the names of the paths.
//!
//! A line is appended under a lock, by one write, when files of an item are published: first as incomplete, then as complete.
//! What a killed run left is therefore known to be its own, and is made again. A torn line is passed over, several runs may
//! append to one file, and lines that later ones replace are dropped now and then. Nothing is trusted: at worst a result
//! counts as not on record, and stays.

use std::collections::{BTreeMap, HashMap, HashSet};
use std::ffi::OsStr;
use std::fmt;
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read, Seek, SeekFrom, Write};
use std::path::{Component, Path, PathBuf};
use std::sync::Mutex;

use serde::de::IgnoredAny;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value as Json};

use super::batch::Instance;
use super::graph::{Graph, Stage};
use super::items::{RECORDS_FOLDER, is_glob};
use super::paths::{to_path, to_text};

/// The file in [`RECORDS_FOLDER`].
const RECORDS_FILE: &str = "done.jsonl";

/// Longest line that is written or read, bytes: an item with ten thousand results has a tenth of it.
const MAX_LINE: u64 = 8 << 20;

/// Bytes that are read of a file, from its end: a hundred thousand items have half of them.
const MAX_BYTES: u64 = 256 << 20;

/// A file is written anew once it has this many lines for each that counts, and some more.
const LINES_PER_RECORD: usize = 2;

/// Differences that a message lists.
const MAX_LISTED: usize = 3;

/// How the results of an item stand.
#[derive(Clone, Debug, PartialEq)]
pub enum Standing {
    /// There is none.
    Missing,
    /// All are there, made from these inputs and settings by this version, and as they were written.
    UpToDate,
    /// Some are missing, and those that are there are as an earlier run wrote them from the same inputs and settings: they may be
    /// made again.
    Unfinished,
    /// Made from something else, or changed since.
    Outdated(Vec<Difference>),
    /// This file exists, and no run on record made it.
    Unrecorded(PathBuf),
}

/// In what a result on record differs from what would be made now.
#[derive(Clone, Debug, PartialEq)]
pub enum Difference {
    /// The version of the program that made it.
    Version(String),
    /// A stage or a setting, in words.
    Settings(String),
    /// An input, in words.
    Input(String),
    /// This result was altered since it was written.
    Altered(PathBuf),
}

impl fmt::Display for Difference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Version(made) => {
                write!(f, "version changed: made by plumbline {made}, this is {}", env!("CARGO_PKG_VERSION"))
            }
            Self::Settings(text) => write!(f, "settings changed: {text}"),
            Self::Input(text) => write!(f, "input changed: {text}"),
            Self::Altered(path) => write!(f, "result altered: `{}` is not as it was written", path.display()),
        }
    }
}

/// The records of the folders that a run writes to.
#[derive(Debug, Default)]
pub struct Records {
    folders: Mutex<HashMap<PathBuf, Folder>>,
}

/// The records of one folder.
#[derive(Debug, Default)]
struct Folder {
    /// Last record of each item, by the name of its first result: its line, and lines of further results.
    lines: HashMap<String, Vec<String>>,
    /// Lines of the file, those that do not count included.
    count: usize,
    /// Length of the file when it was read, bytes.
    length: u64,
    /// This run has appended to it.
    appended: bool,
}

/// One line.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Record {
    /// The first result, relative to the folder.
    name: String,
    /// Key of the item.
    key: String,
    /// Version of the program.
    version: String,
    /// Everything was written; false while the item is at work.
    complete: bool,
    /// Stages by their names.
    stages: BTreeMap<String, StageRecord>,
    /// Inputs in the order of the stages.
    inputs: Vec<InputRecord>,
    /// Files and folders that were written.
    outputs: Vec<OutputRecord>,
}

/// A line that adds a result to the record before it, so that an item of many results is not written as often.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Further {
    /// The first result of the item.
    name: String,
    /// One more.
    output: OutputRecord,
}

/// What a stage did.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct StageRecord {
    /// Its kind.
    #[serde(rename = "use")]
    kind: String,
    /// Its edges, `port = stage.output`.
    inputs: Vec<String>,
    /// Settings other than paths that differ from their defaults.
    set: Map<String, Json>,
}

/// A file that was read.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct InputRecord {
    /// The stage that read it.
    stage: String,
    /// Its path relative to the folder of the results: trees may be moved as a whole.
    path: String,
    /// `None`: it was missing.
    file: Option<Stamp>,
}

/// A file or folder that was written.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct OutputRecord {
    /// Its path relative to the folder.
    path: String,
    #[serde(flatten)]
    file: Stamp,
}

/// What a file is recognized by.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Stamp {
    /// Bytes; of a folder, of all files in it.
    size: u64,
    /// Time of its last change, nanoseconds since 1970; of a folder, the latest of its files.
    mtime_ns: u64,
    /// Of a folder or a sequence: its files, with size and time of each.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    files: Option<String>,
}

impl Stamp {
    /// Of a file, of all files in a folder, or of those that a pattern may mean; `None` where there is none.
    pub(super) fn of(path: &Path) -> Option<Self> {
        match path.metadata() {
            Ok(meta) if meta.is_dir() => Self::of_files(files_below(path)),
            Ok(meta) => Some(Self { size: meta.len(), mtime_ns: mtime_ns(&meta), files: None }),
            // A pattern of numbers, or a glob: all files of the folder that end like it.
            Err(_) if is_pattern(path) => {
                let like = |file: &PathBuf| file.extension() == path.extension();
                let listed = std::fs::read_dir(folder_of(path)).into_iter().flatten().filter_map(Result::ok);
                Self::of_files(listed.map(|e| e.path()).filter(like).collect())
            }
            Err(_) => None,
        }
    }

    fn of_files(mut files: Vec<PathBuf>) -> Option<Self> {
        files.sort();
        let mut all = Self { size: 0, mtime_ns: 0, files: None };
        // FNV-1a: a change by accident is to be seen, not one by intent.
        let mut sum = 0xcbf2_9ce4_8422_2325_u64;
        let mut add = |bytes: &[u8]| {
            for byte in bytes {
                sum = (sum ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3);
            }
        };
        let mut count = 0;
        for file in &files {
            let Ok(meta) = file.metadata() else { continue };
            if !meta.is_file() {
                continue;
            }
            count += 1;
            all.size += meta.len();
            all.mtime_ns = all.mtime_ns.max(mtime_ns(&meta));
            add(file.file_name().unwrap_or_default().as_encoded_bytes());
            add(&meta.len().to_le_bytes());
            add(&mtime_ns(&meta).to_le_bytes());
        }
        all.files = Some(format!("{count}:{sum:016x}"));
        (count > 0).then_some(all)
    }
}

fn mtime_ns(meta: &std::fs::Metadata) -> u64 {
    let since = meta.modified().ok().and_then(|t| t.duration_since(std::time::UNIX_EPOCH).ok());
    since.and_then(|t| u64::try_from(t.as_nanos()).ok()).unwrap_or(0)
}

/// The name of a numbered sequence, or a glob.
fn is_pattern(path: &Path) -> bool {
    let text = to_text(path);
    text.contains('%') || is_glob(&text)
}

/// Most files of a folder that are looked at.
const MAX_FILES: usize = 1 << 20;

/// Files below a folder, links not followed.
fn files_below(folder: &Path) -> Vec<PathBuf> {
    let (mut files, mut left) = (Vec::new(), vec![folder.to_owned()]);
    while let Some(folder) = left.pop() {
        for entry in std::fs::read_dir(&folder).into_iter().flatten().filter_map(Result::ok) {
            match entry.file_type() {
                Ok(kind) if kind.is_dir() && entry.file_name() != OsStr::new(RECORDS_FOLDER) => left.push(entry.path()),
                Ok(kind) if !kind.is_dir() && files.len() < MAX_FILES => files.push(entry.path()),
                _ => {}
            }
        }
    }
    files
}

fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|p| *p != Path::new("")).unwrap_or(Path::new("."))
}

/// The path without links, also of what does not exist; `.` and `..` taken out.
pub(super) fn resolved(path: &Path) -> PathBuf {
    if let Ok(found) = path.canonicalize() {
        return found;
    }
    match (folder_of(path).canonicalize(), path.file_name()) {
        (Ok(folder), Some(name)) => folder.join(name),
        _ => std::path::absolute(path).unwrap_or_else(|_| path.to_owned()),
    }
}

/// `path` as seen from `folder`; both without links.
fn relative(path: &Path, folder: &Path) -> PathBuf {
    let (mut to, mut from) = (path.components().peekable(), folder.components().peekable());
    while to.peek().is_some() && to.peek() == from.peek() {
        to.next();
        from.next();
    }
    from.map(|_| Component::ParentDir).chain(to).collect()
}

/// Files and folders that an instance writes, except standard output.
fn targets(instance: &Instance) -> Vec<PathBuf> {
    let all = [instance.outputs(), instance.folders()].concat();
    all.into_iter().filter(|path| path != Path::new("-")).collect()
}

/// A result is there: a folder counts once something is in it.
fn is_there(target: &Path) -> bool {
    match target.metadata() {
        Ok(meta) if meta.is_dir() => std::fs::read_dir(target).is_ok_and(|mut entries| entries.next().is_some()),
        Ok(_) => true,
        // A link to nothing occupies the name as well.
        Err(_) => target.symlink_metadata().is_ok() || (is_pattern(target) && Stamp::of(target).is_some()),
    }
}

/// The folder of the records of an item, without links, and the name of its first result there.
fn position(targets: &[PathBuf]) -> Option<(PathBuf, String)> {
    let first = targets.first()?;
    let folder = folder_of(first);
    let folder = folder.canonicalize().unwrap_or_else(|_| folder.to_owned());
    Some((folder, to_text(first.file_name()?)))
}

impl Records {
    /// How the results of `instance` stand against what would be made now.
    pub fn standing(&self, instance: &Instance) -> Standing {
        let targets = targets(instance);
        let Some(first) = targets.iter().find(|target| is_there(target)) else { return Standing::Missing };
        let Some((folder, name)) = position(&targets) else { return Standing::Missing };
        let Some(record) = self.find(&folder, &name) else { return Standing::Unrecorded(first.clone()) };
        let mut differences = record.differences(&Record::of(instance, &folder, name));
        let mut missing = false;
        let mut wanted: HashMap<PathBuf, PathBuf> = targets.into_iter().map(|t| (resolved(&t), t)).collect();
        for output in &record.outputs {
            let path = normal(&folder.join(to_path(&output.path)));
            let target = wanted.remove(&path);
            match Stamp::of(&path) {
                None => missing = true,
                Some(file) if file == output.file => {}
                Some(_) => differences.push(Difference::Altered(target.unwrap_or(path))),
            }
        }
        // A file that the record knows nothing of was made by others, and stays.
        if let Some(target) = wanted.values().filter(|target| is_there(target)).min() {
            return Standing::Unrecorded(target.clone());
        }
        missing |= !wanted.is_empty();
        match (differences.is_empty(), record.complete && !missing) {
            (false, _) => Standing::Outdated(differences),
            (true, true) => Standing::UpToDate,
            (true, false) => Standing::Unfinished,
        }
    }

    /// Begins the record of an item whose inputs are read from now on; `None` where it writes no file. What an unfinished run left
    /// of it stays on record.
    pub fn begin<'a>(&'a self, instance: &'a Instance) -> Option<ItemRecord<'a>> {
        let targets = targets(instance);
        let (folder, name) = position(&targets)?;
        let mut record = Record::of(instance, &folder, name);
        let before = self.find(&folder, &record.name);
        if let Some(before) = before.filter(|before| before.differences(&record).is_empty()) {
            record.outputs = before.outputs;
        }
        let item = Mutex::new(Item { record, begun: false });
        Some(ItemRecord { records: self, targets, folder, item })
    }

    /// Puts on record that `outputs` of `instance`, and all others that it writes, were written just now.
    ///
    /// # Errors
    /// The system's error. The results themselves are not touched.
    pub fn note(&self, instance: &Instance, outputs: &[PathBuf]) -> io::Result<()> {
        self.begin(instance).map_or(Ok(()), |item| item.finish(outputs))
    }

    /// Whether the file `result` is on record as a result of this item, made from what it works on.
    pub(super) fn is_result(&self, result: &Path, instance: &Instance) -> bool {
        let Some(source) = instance.item.as_ref().map(|item| resolved(&item.path)) else { return false };
        let Some((folder, name)) = position(&targets(instance)) else { return false };
        let Some(record) = self.find(&folder, &name) else { return false };
        let absolute = |path: &str| normal(&folder.join(to_path(path)));
        let result = resolved(result);
        record.inputs.iter().any(|input| absolute(&input.path) == source)
            && record.outputs.iter().any(|output| absolute(&output.path) == result)
    }

    fn find(&self, folder: &Path, name: &str) -> Option<Record> {
        let mut folders = self.folders.lock().ok()?;
        let known = folders.entry(folder.to_owned()).or_insert_with(|| Folder::read(folder));
        // Another run may have gone on meanwhile.
        if path_in(folder).metadata().is_ok_and(|meta| meta.len() != known.length) {
            *known = Folder { appended: known.appended, ..Folder::read(folder) };
        }
        let (line, further) = known.lines.get(name)?.split_first()?;
        let mut record: Record = serde_json::from_str(line).ok()?;
        if !further.is_empty() {
            let mut outputs: BTreeMap<String, OutputRecord> =
                record.outputs.into_iter().map(|output| (output.path.clone(), output)).collect();
            for Further { output, .. } in further.iter().filter_map(|line| serde_json::from_str(line).ok()) {
                outputs.insert(output.path.clone(), output);
            }
            record.outputs = outputs.into_values().collect();
        }
        Some(record)
    }

    fn append(&self, folder: &Path, record: &impl Serialize) -> io::Result<()> {
        let line = serde_json::to_string(record)?;
        if line.len() as u64 >= MAX_LINE {
            return Err(io::Error::other("it has too many results for one record"));
        }
        let Ok(mut folders) = self.folders.lock() else { return Ok(()) };
        let known = folders.entry(folder.to_owned()).or_insert_with(|| Folder::read(folder));
        std::fs::create_dir_all(folder.join(RECORDS_FOLDER))?;
        let mut file = locked(&path_in(folder))?;
        let length = file.seek(SeekFrom::End(0))?;
        // A run that was killed may have left half a line.
        let torn = length > 0 && {
            let mut last = [0];
            file.seek(SeekFrom::End(-1))?;
            file.read_exact(&mut last)?;
            last != *b"\n"
        };
        let text = format!("{}{line}\n", if torn { "\n" } else { "" });
        file.write_all(text.as_bytes())?;
        if length == known.length {
            known.length = length + text.len() as u64;
        }
        known.appended = true;
        known.add(line.as_bytes());
        Ok(())
    }

    /// Drops lines that do not count from the files that this run has appended to, where they are many.
    ///
    /// # Errors
    /// The system's error; the records stay as they are.
    pub fn compact(&self) -> io::Result<()> {
        let Ok(folders) = self.folders.lock() else { return Ok(()) };
        let live = |known: &Folder| known.lines.values().map(Vec::len).sum::<usize>();
        let long = |known: &&Folder| known.appended && known.count > LINES_PER_RECORD * live(known) + 64;
        for (folder, _) in folders.iter().filter(|(_, known)| long(known)) {
            compact(folder)?;
        }
        Ok(())
    }
}

/// The record of an item at work.
///
/// A result is on record before it has its name, by size and time of the file that is to get it: whenever a run is killed, what
/// is there is known to be its own.
#[derive(Debug)]
pub struct ItemRecord<'a> {
    records: &'a Records,
    targets: Vec<PathBuf>,
    folder: PathBuf,
    item: Mutex<Item>,
}

#[derive(Debug)]
struct Item {
    record: Record,
    /// Its line was written, and lines of single results follow.
    begun: bool,
}

impl ItemRecord<'_> {
    /// `file` is whole and is about to become `target`, or has just become it.
    ///
    /// # Errors
    /// The system's error. The results themselves are not touched.
    pub fn publishing(&self, file: &Path, target: &Path) -> io::Result<()> {
        let Ok(mut item) = self.item.lock() else { return Ok(()) };
        let Some(output) = self.output(file, target) else { return Ok(()) };
        if !item.begun {
            self.records.append(&self.folder, &item.record)?;
            item.begun = true;
        }
        self.records.append(&self.folder, &Further { name: item.record.name.clone(), output })
    }

    /// `outputs` were written, and all other results of the item.
    ///
    /// # Errors
    /// The system's error. The results themselves are not touched.
    pub fn finish(&self, outputs: &[PathBuf]) -> io::Result<()> {
        let Ok(mut item) = self.item.lock() else { return Ok(()) };
        let record = &mut item.record;
        record.outputs.clear();
        let mut seen = HashSet::new();
        for path in outputs.iter().filter(|path| *path != Path::new("-")).chain(&self.targets) {
            if seen.insert(resolved(path)) {
                record.outputs.extend(self.output(path, path));
            }
        }
        record.complete = true;
        if record.outputs.is_empty() { Ok(()) } else { self.records.append(&self.folder, record) }
    }

    /// `target` as `file` is now.
    fn output(&self, file: &Path, target: &Path) -> Option<OutputRecord> {
        let folder = self.folder.canonicalize().unwrap_or_else(|_| self.folder.clone());
        let path = to_text(relative(&resolved(target), &folder));
        Stamp::of(file).map(|file| OutputRecord { path, file })
    }
}

/// The path of the file of records.
fn path_in(folder: &Path) -> PathBuf {
    folder.join(RECORDS_FOLDER).join(RECORDS_FILE)
}

/// `..` taken out of a path without links.
fn normal(path: &Path) -> PathBuf {
    let mut out = PathBuf::new();
    for part in path.components() {
        match part {
            Component::ParentDir => _ = out.pop(),
            Component::CurDir => {}
            part => out.push(part),
        }
    }
    out
}

/// Opens a file of records for appending, alone. The lock goes with the file; where there are no locks, appending by one write
/// must do.
fn locked(path: &Path) -> io::Result<File> {
    loop {
        if path.metadata().is_ok_and(|meta| !meta.is_file()) {
            return Err(io::Error::other(format!("`{}` is no file", path.display())));
        }
        let file = File::options().read(true).append(true).create(true).open(path)?;
        let _ = file.lock();
        // Another run may have put a shorter file in its place while this one waited.
        if same_file(&file, path) {
            return Ok(file);
        }
    }
}

#[cfg(unix)]
fn same_file(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let of = |meta: io::Result<std::fs::Metadata>| meta.map(|m| (m.dev(), m.ino()));
    match (of(file.metadata()), of(path.metadata())) {
        (Ok(a), Ok(b)) => a == b,
        // It was removed, which ends no run: the next line begins a new one.
        (_, Err(e)) if e.kind() == io::ErrorKind::NotFound => false,
        _ => true,
    }
}

#[cfg(not(unix))]
fn same_file(_: &File, _: &Path) -> bool {
    true
}

fn compact(folder: &Path) -> io::Result<()> {
    let path = path_in(folder);
    let held = locked(&path)?;
    let known = Folder::read(folder);
    let mut names: Vec<&String> = known.lines.keys().collect();
    names.sort();
    let mut out = tempfile::NamedTempFile::new_in(folder.join(RECORDS_FOLDER))?;
    for name in names {
        for line in &known.lines[name] {
            writeln!(out, "{line}")?;
        }
    }
    out.as_file().sync_all()?;
    out.persist(&path).map_err(|e| e.error)?;
    drop(held);
    Ok(())
}

impl Folder {
    /// Reads the file of a folder; what is no record is passed over.
    fn read(folder: &Path) -> Self {
        let path = path_in(folder);
        let mut known = Self::default();
        // A pipe would be waited for.
        if !path.metadata().is_ok_and(|meta| meta.is_file()) {
            return known;
        }
        let Ok(mut file) = File::open(path) else { return known };
        known.length = file.metadata().map_or(0, |meta| meta.len());
        let from = known.length.saturating_sub(MAX_BYTES);
        if file.seek(SeekFrom::Start(from)).is_err() {
            return known;
        }
        let mut reader = BufReader::new(file).take(MAX_BYTES);
        let mut bytes = Vec::new();
        loop {
            bytes.clear();
            let read = (&mut reader).take(MAX_LINE).read_until(b'\n', &mut bytes);
            if !matches!(read, Ok(1..)) {
                return known;
            }
            known.add(&bytes);
        }
    }

    fn add(&mut self, bytes: &[u8]) {
        /// Enough of a line to find it again.
        #[derive(Deserialize)]
        struct Head {
            name: String,
            output: Option<IgnoredAny>,
        }
        self.count += 1;
        let Ok(line) = std::str::from_utf8(bytes) else { return };
        let line = line.trim_end().to_owned();
        match serde_json::from_str(&line) {
            Ok(Head { name, output: None }) => {
                self.lines.insert(name, vec![line]);
            }
            Ok(Head { name, output: Some(_) }) => {
                if let Some(lines) = self.lines.get_mut(&name) {
                    lines.push(line);
                }
            }
            Err(_) => {}
        }
    }
}

impl Record {
    /// What would be made now, into `folder`; nothing of its results.
    fn of(instance: &Instance, folder: &Path, name: String) -> Self {
        let stages = instance.graph.stages.iter();
        let input = |stage: &Stage, path: &str| {
            let path = to_path(path);
            let file = Stamp::of(&path);
            InputRecord { stage: stage.name.clone(), path: to_text(relative(&resolved(&path), folder)), file }
        };
        Self {
            name,
            key: instance.key.clone(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            complete: false,
            stages: stages.clone().map(|s| (s.name.clone(), StageRecord::of(&instance.graph, s))).collect(),
            inputs: stages.flat_map(|s| s.settings.reads().into_iter().map(|path| input(s, path))).collect(),
            outputs: Vec::new(),
        }
    }

    /// In what this record differs from `now`, results aside.
    fn differences(&self, now: &Self) -> Vec<Difference> {
        let mut out = Vec::new();
        if self.version != now.version {
            out.push(Difference::Version(self.version.clone()));
        }
        out.extend(stage_differences(&self.stages, &now.stages).into_iter().map(Difference::Settings));
        let name = |input: &InputRecord| {
            to_path(&input.path).file_name().map_or_else(String::new, |n| Path::new(n).display().to_string())
        };
        for (was, is) in self.inputs.iter().zip(&now.inputs) {
            let text = match (&was.file, &is.file) {
                _ if was.path != is.path => format!("made from `{}`, not from `{}`", name(was), name(is)),
                (Some(a), Some(b)) if a == b => continue,
                (None, None) => continue,
                (Some(_), None) => format!("`{}` is gone", name(is)),
                (None, Some(_)) => format!("`{}` is new", name(is)),
                (Some(a), Some(b)) if a.size != b.size => {
                    format!("`{}` had {} bytes and has {}", name(is), a.size, b.size)
                }
                (Some(_), Some(_)) => format!("`{}` was written again since", name(is)),
            };
            out.push(Difference::Input(text));
        }
        if self.inputs.len() != now.inputs.len() {
            let (was, is) = (self.inputs.len(), now.inputs.len());
            out.push(Difference::Input(format!("made from {was} files, now there are {is}")));
        }
        out
    }
}

impl StageRecord {
    fn of(graph: &Graph, stage: &Stage) -> Self {
        let schema = stage.kind.json_schema();
        let defaults = stage.kind.defaults().map(|d| d.to_json()).unwrap_or_default();
        let settings = stage.settings.to_json();
        let differs = |(key, value): &(&String, &Json)| {
            defaults[key.as_str()] != **value && schema["properties"][key.as_str()]["format"] != "path"
        };
        let set = settings.as_object().into_iter().flatten().filter(differs);
        let edge =
            |e: &super::graph::Edge| format!("{} = {}.{}", e.port.name, graph.stages[e.from].name, e.output.name);
        Self {
            kind: stage.kind.name.to_owned(),
            inputs: stage.edges.iter().map(edge).collect(),
            set: set.map(|(key, value)| (key.clone(), value.clone())).collect(),
        }
    }
}

/// Stages and settings that differ, each in words.
fn stage_differences(was: &BTreeMap<String, StageRecord>, is: &BTreeMap<String, StageRecord>) -> Vec<String> {
    let mut out = Vec::new();
    for (name, a) in was {
        let Some(b) = is.get(name) else {
            out.push(format!("stage `{name}` ({}) is gone", a.kind));
            continue;
        };
        if a.kind != b.kind {
            out.push(format!("stage `{name}` was {} and is {}", a.kind, b.kind));
            continue;
        }
        if a.inputs != b.inputs {
            out.push(format!("stage `{name}` takes other inputs"));
        }
        let keys: std::collections::BTreeSet<&String> = a.set.keys().chain(b.set.keys()).collect();
        let value = |set: &Map<String, Json>, key: &str| set.get(key).map_or("its default".to_owned(), Json::to_string);
        for key in keys.into_iter().filter(|key| a.set.get(*key) != b.set.get(*key)) {
            out.push(format!("`{key}` of stage `{name}` was {} and is {}", value(&a.set, key), value(&b.set, key)));
        }
    }
    let new = is.iter().filter(|(name, _)| !was.contains_key(*name));
    out.extend(new.map(|(name, stage)| format!("stage `{name}` ({}) is new", stage.kind)));
    out
}

/// Why an item is refused, in words; `None` where it may be made.
pub(crate) fn refusal(standing: &Standing, instance: &Instance) -> Option<String> {
    let help = "allow to replace it with --overwrite (`run.existing = \"overwrite\"`)";
    match standing {
        Standing::Missing | Standing::UpToDate | Standing::Unfinished => None,
        Standing::Unrecorded(path) => {
            Some(format!("`{}` exists, not made by a run that is on record; {help}", path.display()))
        }
        Standing::Outdated(differences) => {
            let mut text: Vec<String> = differences.iter().take(MAX_LISTED).map(ToString::to_string).collect();
            if let Some(more) = differences.len().checked_sub(MAX_LISTED).filter(|more| *more > 0) {
                text.push(format!("and {more} further differences"));
            }
            let target = targets(instance).into_iter().find(|target| is_there(target)).unwrap_or_default();
            Some(format!("`{}` exists and is not up to date: {}; {help}", target.display(), text.join("; ")))
        }
    }
}
