//! Buffers and buffer views of a glTF document.

use std::borrow::Cow;
use std::path::{Component, Path, PathBuf};

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;

use super::super::{ReadLimits, read_file};
use super::document::Document;
use super::{fault, item};
use crate::mesh::MeshError;

/// All buffers of a document.
pub(super) struct Buffers<'a>(Vec<Cow<'a, [u8]>>);

/// The bytes of a buffer view, and its stride if it has one.
#[derive(Clone, Copy)]
pub(super) struct View<'a> {
    pub(super) bytes: &'a [u8],
    pub(super) stride: Option<usize>,
}

impl<'a> Buffers<'a> {
    /// Loads all buffers; their total size is limited. Only the first may be the binary chunk of a GLB file.
    pub(super) fn load(
        document: &Document,
        binary: Option<&'a [u8]>,
        folder: Option<&Path>,
        limits: &ReadLimits,
    ) -> Result<Self, MeshError> {
        let mut left = limits.max_bytes;
        let mut buffers = Vec::new();
        for (k, buffer) in document.buffers.iter().enumerate() {
            let at = format!("/buffers/{k}");
            let bytes = match &buffer.uri {
                None if k == 0 => Cow::Borrowed(
                    binary.ok_or_else(|| fault(at.clone(), "has no `uri`, and the file no binary chunk"))?,
                ),
                None => return Err(fault(at, "has no `uri`; only the first buffer may stand in the binary chunk")),
                Some(uri) => Cow::Owned(fetch(uri, folder, left, &at)?),
            };
            left = left.saturating_sub(bytes.len() as u64);
            if buffer.byte_length > bytes.len() as u64 {
                let told = format!("{} bytes are announced, but there are {}", buffer.byte_length, bytes.len());
                return Err(fault(format!("{at}/byteLength"), told));
            }
            buffers.push(bytes);
        }
        Ok(Self(buffers))
    }

    /// The bytes of a view; `user` is the JSON pointer of the value that references it, for errors.
    pub(super) fn view<'b>(&'b self, document: &Document, view: usize, user: &str) -> Result<View<'b>, MeshError> {
        let described = item(&document.buffer_views, view, user, "buffer view")?;
        let at = format!("/bufferViews/{view}");
        let buffer = item(&self.0, described.buffer, &at, "buffer")?;
        let (from, length) = (described.byte_offset, described.byte_length);
        let range = usize::try_from(from).ok().zip(usize::try_from(from.saturating_add(length)).ok());
        let bytes = range.and_then(|(from, to)| buffer.get(from..to)).ok_or_else(|| {
            let told = format!(
                "{length} bytes from byte {from} go beyond the end of buffer {} ({} bytes)",
                described.buffer,
                buffer.len()
            );
            fault(at, told)
        })?;
        Ok(View { bytes, stride: described.byte_stride.filter(|&s| s > 0).map(|s| s as usize) })
    }
}

/// The bytes at a URI: `data:` or a file in the folder.
fn fetch(uri: &str, folder: Option<&Path>, limit: u64, at: &str) -> Result<Vec<u8>, MeshError> {
    if let Some(data) = uri.strip_prefix("data:") {
        let (kind, text) = data.split_once(',').ok_or_else(|| fault(at, "a `data:` address without data"))?;
        if !kind.ends_with(";base64") {
            return Err(fault(at, "a `data:` address that is not base64"));
        }
        return STANDARD.decode(text).map_err(|e| fault(at, format!("base64 that cannot be decoded: {e}")));
    }
    let path = inside(uri, folder, at)?;
    read_file(&path, limit).map_err(|e| fault(at, format!("{uri:?}: {e}")))
}

/// Resolves a relative URI; rejected if it leads outside the folder.
fn inside(uri: &str, folder: Option<&Path>, at: &str) -> Result<PathBuf, MeshError> {
    let name = percent_decoded(uri);
    let refused = || fault(at, format!("{uri:?} leads outside the folder of the file; put the buffer beside it"));
    let folder = folder.ok_or_else(|| fault(at, format!("{uri:?}: other files are not opened here")))?;
    let path = Path::new(&name);
    let stays = path.components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir));
    if !stays || name.contains([':', '\\', '\0']) || name.is_empty() {
        return Err(refused());
    }
    let missing = |e: std::io::Error| fault(at, format!("{uri:?} cannot be read: {e}"));
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let whole = folder.join(path).canonicalize().map_err(missing)?;
    // Symbolic links may lead outside as well.
    let home = folder.canonicalize().map_err(missing)?;
    if whole.starts_with(home) { Ok(whole) } else { Err(refused()) }
}

fn percent_decoded(uri: &str) -> String {
    let bytes = uri.as_bytes();
    let (mut out, mut at) = (Vec::with_capacity(bytes.len()), 0);
    while at < bytes.len() {
        let digits = bytes.get(at + 1..at + 3).and_then(|d| std::str::from_utf8(d).ok());
        match digits.and_then(|d| u8::from_str_radix(d, 16).ok()) {
            Some(byte) if bytes[at] == b'%' => {
                out.push(byte);
                at += 3;
            }
            _ => {
                out.push(bytes[at]);
                at += 1;
            }
        }
    }
    String::from_utf8_lossy(&out).into_owned()
}
