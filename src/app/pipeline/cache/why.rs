//! Why a result was computed: in which parts of its key it differs from those that were there.

use std::collections::BTreeMap;
use std::io;
use std::path::Path;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use serde_json::{Map, Value as Json};

use super::entry::Meta;
use super::{Cache, folder_bytes};
use crate::pipeline::paths::to_text;

/// A result that is there, and the one before it that is most like it.
#[derive(Clone, Debug, PartialEq)]
pub struct Explanation {
    /// Kind of the result, such as `video.track`.
    pub kind: String,
    /// When it was made.
    pub made: SystemTime,
    /// Its size, bytes.
    pub bytes: u64,
    /// The parts of its key, `name value`; those of an object as `name.key`.
    pub parts: BTreeMap<String, String>,
    /// The result of the same kind and file, made before, that differs in the fewest parts: when it was made, and in what it differs.
    pub nearest: Option<(SystemTime, Vec<Difference>)>,
}

/// A part of two keys that differs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Difference {
    /// Its name.
    pub part: String,
    /// Its value in the key of the result.
    pub now: String,
    /// Its value in that of the earlier one.
    pub then: String,
}

/// A result on disk.
struct Known {
    meta: Meta,
    bytes: u64,
    parts: BTreeMap<String, String>,
}

impl Cache {
    /// The results that runs on the file `source` made and that are there, the newest first.
    ///
    /// # Errors
    /// The system's error; entries that cannot be read are passed over.
    pub fn why(&self, source: &Path) -> io::Result<Vec<Explanation>> {
        let mut known = Vec::new();
        for folder in self.entry_folders()? {
            if let Ok(Some((meta, _))) = Meta::read(&folder) {
                let parts = flat(&meta.parts);
                known.push(Known { meta, bytes: folder_bytes(&folder), parts });
            }
        }
        known.sort_by_key(|k| k.meta.made);
        let source = source_name(source);
        let explained = known.iter().enumerate().rev().filter(|(_, k)| k.meta.sources.contains(&source));
        Ok(explained.map(|(at, k)| k.explained(&known[..at], &source)).collect())
    }
}

/// The name under which entries list a file that was read.
pub fn source_name(path: &Path) -> String {
    to_text(path.canonicalize().unwrap_or_else(|_| path.to_owned()))
}

impl Known {
    fn explained(&self, before: &[Self], source: &String) -> Explanation {
        let is_alike = |other: &&Self| other.meta.kind == self.meta.kind && other.meta.sources.contains(source);
        let alike = before.iter().filter(is_alike);
        let differences = alike.map(|other| (time(other.meta.made), self.differences(other)));
        // Of those that are as near, the newest.
        let nearest = differences.rev().min_by_key(|(_, differences)| differences.len());
        Explanation {
            kind: self.meta.kind.clone(),
            made: time(self.meta.made),
            bytes: self.bytes,
            parts: self.parts.clone(),
            nearest,
        }
    }

    fn differences(&self, other: &Self) -> Vec<Difference> {
        let value =
            |parts: &BTreeMap<String, String>, part: &str| parts.get(part).map_or("none", String::as_str).to_owned();
        let mut names: Vec<&String> = self.parts.keys().chain(other.parts.keys()).collect();
        names.sort_unstable();
        names.dedup();
        let differs = names.into_iter().filter(|name| self.parts.get(*name) != other.parts.get(*name));
        let difference = |part: &String| Difference {
            part: part.clone(),
            now: value(&self.parts, part),
            then: value(&other.parts, part),
        };
        differs.map(difference).collect()
    }
}

fn time(milliseconds: u64) -> SystemTime {
    // A time that no clock has is of a damaged file.
    UNIX_EPOCH.checked_add(Duration::from_millis(milliseconds)).unwrap_or(UNIX_EPOCH)
}

/// The parts without objects: what is in one gets a name with a dot. Digests are shortened, for people.
fn flat(parts: &Map<String, Json>) -> BTreeMap<String, String> {
    let mut found = BTreeMap::new();
    for (name, value) in parts {
        match value {
            Json::Object(inner) => found.extend(flat(inner).into_iter().map(|(key, v)| (format!("{name}.{key}"), v))),
            // A setting that is left out, and a path in the place of which there is a digest.
            Json::Null => {}
            Json::String(text) if text.is_empty() => {}
            Json::String(text) => drop(found.insert(name.clone(), text.clone())),
            other => drop(found.insert(name.clone(), other.to_string())),
        }
    }
    found
}
