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

mod folder;
mod record;
mod stamp;

use std::collections::{BTreeMap, HashMap, HashSet};
use std::fmt;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use serde::Serialize;

use super::batch::Instance;
use super::items::RECORDS_FOLDER;
use super::lines_file::append;
use super::paths::{to_path, to_text};
use folder::{Folder, MAX_LINE, compact, path_in};
use record::{Further, OutputRecord, Record};
pub(super) use stamp::{Stamp, resolved};
use stamp::{folder_of, is_pattern, normal, relative};

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
        let (length, written) = append(&path_in(folder), &format!("{line}\n"))?;
        if length == known.length {
            known.length = length + written;
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
