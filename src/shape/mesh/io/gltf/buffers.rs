//! Buffers and buffer views of a glTF document.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;

use super::super::{ReadLimits, read_opened};
use super::document::Document;
use super::meshopt::EXTENSION;
use super::{fault, item};
use crate::mesh::MeshError;
use plumbline_num::files::{AccessError, FileAccess, open_regular};

/// All buffers of a document.
pub(super) struct Buffers<'a> {
    all: Vec<Bytes<'a>>,
    /// Bytes of the files that were read for them.
    read: u64,
    /// What the streams of compressed views make, by view.
    decoded: HashMap<usize, Vec<u8>>,
    /// Bytes of those streams.
    compressed: u64,
}

/// The bytes of a buffer; buffers in one file share them.
#[derive(Clone)]
enum Bytes<'a> {
    Chunk(&'a [u8]),
    Read(Arc<[u8]>),
    /// Stands for what the streams of compressed views make.
    Placeholder,
}

impl Bytes<'_> {
    fn all(&self) -> &[u8] {
        match self {
            Self::Chunk(bytes) => bytes,
            Self::Read(bytes) => bytes,
            Self::Placeholder => &[],
        }
    }
}

/// The bytes of a buffer view, and its stride if it has one.
#[derive(Clone, Copy)]
pub(super) struct View<'a> {
    pub(super) bytes: &'a [u8],
    pub(super) stride: Option<usize>,
}

impl<'a> Buffers<'a> {
    /// Loads all buffers and decodes compressed views; their total size is limited. Only the first buffer may be the binary chunk of
    /// a GLB file.
    pub(super) fn load(
        document: &Document,
        binary: Option<&'a [u8]>,
        folder: Option<&Path>,
        limits: &ReadLimits,
    ) -> Result<Self, MeshError> {
        let mut source = Source { access: access(folder, limits), left: limits.max_bytes, files: HashMap::new() };
        let compressed = document.buffer_views.iter().any(|view| view.extensions.compression.is_some());
        let mut all = Vec::new();
        for (k, buffer) in document.buffers.iter().enumerate() {
            let at = format!("/buffers/{k}");
            let bytes = match (&buffer.uri, binary) {
                (Some(uri), _) => source.fetch(uri, &at)?,
                (None, Some(binary)) if k == 0 => Bytes::Chunk(binary),
                (None, _) if compressed => Bytes::Placeholder,
                (None, _) if k == 0 => return Err(fault(at, "has no `uri`, and the file no binary chunk")),
                (None, _) => {
                    return Err(fault(at, "has no `uri`; only the first buffer may stand in the binary chunk"));
                }
            };
            let length = bytes.all().len();
            if buffer.byte_length > length as u64 && !matches!(bytes, Bytes::Placeholder) {
                let told = format!("{} bytes are announced, but there are {length}", buffer.byte_length);
                return Err(fault(format!("{at}/byteLength"), told));
            }
            all.push(bytes);
        }
        let mut buffers = Self { all, read: limits.max_bytes - source.left, decoded: HashMap::new(), compressed: 0 };
        buffers.decode(document)?;
        Ok(buffers)
    }

    /// Decodes the compressed views. Their streams together are no longer than the buffers: none is decoded again and again.
    fn decode(&mut self, document: &Document) -> Result<(), MeshError> {
        let most = self.all.iter().map(|bytes| bytes.all().len() as u64).sum::<u64>();
        for (k, view) in document.buffer_views.iter().enumerate() {
            let Some(compression) = &view.extensions.compression else { continue };
            let at = format!("/bufferViews/{k}/extensions/{EXTENSION}");
            self.compressed = self.compressed.saturating_add(compression.byte_length);
            if self.compressed > most {
                return Err(fault(
                    at,
                    format!("the streams up to this one are longer than all buffers ({most} bytes)"),
                ));
            }
            let stream = self.range(compression.buffer, compression.byte_offset, compression.byte_length, &at)?;
            let bytes = compression.decode(stream, view.byte_length, &at)?;
            self.decoded.insert(k, bytes);
        }
        Ok(())
    }

    /// Bytes of the streams of compressed views.
    pub(super) fn compressed_bytes(&self) -> u64 {
        self.compressed
    }

    /// Bytes of the files that were read besides the document.
    pub(super) fn read_bytes(&self) -> u64 {
        self.read
    }

    /// The bytes of a view; `user` is the JSON pointer of the value that references it, for errors.
    pub(super) fn view<'b>(&'b self, document: &Document, view: usize, user: &str) -> Result<View<'b>, MeshError> {
        let described = item(&document.buffer_views, view, user, "buffer view")?;
        let raw = || {
            self.range(described.buffer, described.byte_offset, described.byte_length, &format!("/bufferViews/{view}"))
        };
        let bytes = self.decoded.get(&view).map_or_else(raw, |decoded| Ok(decoded.as_slice()))?;
        Ok(View { bytes, stride: described.byte_stride.filter(|&s| s > 0).map(|s| s as usize) })
    }

    /// Bytes of a buffer, for the value at `at`.
    fn range(&self, index: usize, from: u64, length: u64, at: &str) -> Result<&[u8], MeshError> {
        let buffer = item(&self.all, index, at, "buffer")?.all();
        let range = usize::try_from(from).ok().zip(usize::try_from(from.saturating_add(length)).ok());
        range.and_then(|(from, to)| buffer.get(from..to)).ok_or_else(|| {
            let end = buffer.len();
            fault(at, format!("{length} bytes from byte {from} go beyond the end of buffer {index} ({end} bytes)"))
        })
    }
}

/// The files that a document may name.
fn access<'a>(folder: Option<&'a Path>, limits: &'a ReadLimits) -> FileAccess<'a> {
    folder.map_or_else(FileAccess::default, |folder| FileAccess::of_folder(folder, &limits.allow_paths))
}

/// Where the buffers of a document come from.
struct Source<'a> {
    access: FileAccess<'a>,
    /// Bytes that may still be read.
    left: u64,
    /// Files that were read: a small document may name one many times.
    files: HashMap<PathBuf, Arc<[u8]>>,
}

impl Source<'_> {
    /// The bytes at a URI: `data:` or a file that the document may name.
    fn fetch<'b>(&mut self, uri: &str, at: &str) -> Result<Bytes<'b>, MeshError> {
        if let Some(data) = uri.strip_prefix("data:") {
            let (kind, text) = data.split_once(',').ok_or_else(|| fault(at, "a `data:` address without data"))?;
            if !kind.ends_with(";base64") {
                return Err(fault(at, "a `data:` address that is not base64"));
            }
            let bytes = STANDARD.decode(text);
            let bytes = bytes.map_err(|e| fault(at, format!("base64 that cannot be decoded: {e}")))?;
            return Ok(Bytes::Read(bytes.into()));
        }
        let named = path_of(uri).ok_or_else(|| {
            fault(at, format!("{uri:?} is no relative path of a file; put the buffer beside the document"))
        })?;
        let path = self.access.resolve(&named).map_err(|e| refused(&e, at))?;
        if let Some(known) = self.files.get(&path) {
            return Ok(Bytes::Read(Arc::clone(known)));
        }
        let file = open_regular(&path).map_err(|e| fault(at, format!("{uri:?} cannot be read: {e}")))?;
        let bytes: Arc<[u8]> = read_opened(file, self.left).map_err(|e| fault(at, format!("{uri:?}: {e}")))?.into();
        self.left = self.left.saturating_sub(bytes.len() as u64);
        self.files.insert(path, Arc::clone(&bytes));
        Ok(Bytes::Read(bytes))
    }
}

fn refused(error: &AccessError, at: &str) -> MeshError {
    fault(at, error.to_string())
}

/// The path that a URI means: its escapes decoded. `None` for other addresses than paths, and for paths of another system.
fn path_of(uri: &str) -> Option<PathBuf> {
    let bytes = percent_decoded(uri);
    if bytes.is_empty() || bytes.iter().any(|b| matches!(b, b':' | b'\\' | b'\0')) {
        return None;
    }
    #[cfg(unix)]
    let name = <std::ffi::OsString as std::os::unix::ffi::OsStringExt>::from_vec(bytes);
    #[cfg(not(unix))]
    let name = String::from_utf8(bytes).ok()?;
    Some(PathBuf::from(name))
}

fn percent_decoded(uri: &str) -> Vec<u8> {
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
    out
}
