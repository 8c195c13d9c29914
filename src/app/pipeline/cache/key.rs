//! Which result of the cache: its name, and all that decides it.

use serde_json::{Map, Value as Json};

/// Which result: 64 hexadecimal digits, and the parts that they are the hash of.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Key {
    pub(super) kind: String,
    pub(super) parts: Map<String, Json>,
    pub(super) hash: String,
}

impl Key {
    /// Of a result of this kind, of version `version` of the algorithm, that `parts` decide: settings, and digests of inputs.
    ///
    /// The version of the program and the platform are parts as well.
    ///
    /// # Example
    /// ```
    /// use plumbline_app::pipeline::cache::Key;
    /// use serde_json::json;
    ///
    /// let key = |points: u32| Key::new("video.track", 1, [("clip", json!("77aa")), ("points", json!(points))]);
    /// assert_eq!(key(600), key(600));
    /// assert_ne!(key(600), key(601));
    /// ```
    pub fn new(kind: &str, version: u32, parts: impl IntoIterator<Item = (&'static str, Json)>) -> Self {
        let platform = format!("{} {}", std::env::consts::OS, std::env::consts::ARCH);
        let mut all: Map<String, Json> = parts.into_iter().map(|(name, part)| (name.to_owned(), part)).collect();
        all.insert("cache_version".to_owned(), version.into());
        all.insert("program".to_owned(), env!("CARGO_PKG_VERSION").into());
        all.insert("platform".to_owned(), platform.into());
        let hash = hash_of(kind, &all);
        Self { kind: kind.to_owned(), parts: all, hash }
    }
}

/// BLAKE3 of kind and parts, in the order of their names whatever the order of the map.
fn hash_of(kind: &str, parts: &Map<String, Json>) -> String {
    let mut names: Vec<&String> = parts.keys().collect();
    names.sort_unstable();
    let mut hasher = blake3::Hasher::new();
    let mut add = |text: &str| {
        hasher.update(&(text.len() as u64).to_le_bytes());
        hasher.update(text.as_bytes());
    };
    add(kind);
    for name in names {
        add(name);
        add(&parts[name].to_string());
    }
    hasher.finalize().to_hex().to_string()
}
