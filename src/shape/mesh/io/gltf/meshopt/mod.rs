//! Buffer views that are compressed with meshopt.
//!
//! A stream of attributes takes at least two bits for 16 bytes, one of indices a byte for each index or triangle: what it announces
//! is checked against its length before anything is allocated. Indices are not checked here: whoever reads them knows how many
//! vertices there are.
//!
//! # Reference
//! Khronos Group, *`EXT_meshopt_compression`*, appendices A (bitstream) and B (filters).

mod attributes;
mod cursor;
mod filters;
mod indices;
mod triangles;

use serde::Deserialize;

use super::fault;
use crate::mesh::MeshError;

/// The name of the extension.
pub(super) const EXTENSION: &str = "EXT_meshopt_compression";

/// Most bytes that a byte of a stream makes: 256 equal bytes of successive elements take 32 bits.
const MAX_RATIO: u64 = 64;

/// A compressed view: where its stream stands, and the layout of what it makes.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Compression {
    pub(super) buffer: usize,
    #[serde(default)]
    pub(super) byte_offset: u64,
    pub(super) byte_length: u64,
    byte_stride: u64,
    count: u64,
    mode: Mode,
    #[serde(default)]
    filter: Filter,
}

#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "UPPERCASE")]
enum Mode {
    Attributes,
    Triangles,
    Indices,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(rename_all = "UPPERCASE")]
enum Filter {
    #[default]
    None,
    Octahedral,
    Quaternion,
    Exponential,
}

/// Why a stream cannot be decoded.
type Fault = &'static str;

impl Compression {
    /// The bytes of the view, of which `expected` are announced, from its `stream`; `at` is the JSON pointer of the compression.
    pub(super) fn decode(&self, stream: &[u8], expected: u64, at: &str) -> Result<Vec<u8>, MeshError> {
        self.check(stream.len() as u64, expected).map_err(|told| fault(at, told))?;
        let (count, stride) = (self.count as usize, self.byte_stride as usize);
        let decoded = match self.mode {
            Mode::Attributes => attributes::decode(stream, count, stride),
            Mode::Triangles => triangles::decode(stream, count / 3).map(|indices| packed(&indices, stride)),
            Mode::Indices => indices::decode(stream, count).map(|indices| packed(&indices, stride)),
        };
        let mut bytes = decoded.map_err(|told| fault(at, told))?;
        match self.filter {
            Filter::None => {}
            Filter::Octahedral => filters::octahedral(&mut bytes, stride),
            Filter::Quaternion => filters::quaternion(&mut bytes),
            Filter::Exponential => filters::exponential(&mut bytes),
        }
        Ok(bytes)
    }

    fn check(&self, stream: u64, expected: u64) -> Result<(), String> {
        let Self { byte_stride: stride, count, mode, filter, .. } = *self;
        let strides = match (mode, filter) {
            (Mode::Attributes, Filter::None | Filter::Exponential) => (4..=256).contains(&stride) && stride % 4 == 0,
            (Mode::Attributes, Filter::Octahedral) => stride == 4 || stride == 8,
            (Mode::Attributes, Filter::Quaternion) => stride == 8,
            (Mode::Triangles | Mode::Indices, Filter::None) => stride == 2 || stride == 4,
            (Mode::Triangles | Mode::Indices, _) => return Err("a filter of indices".to_owned()),
        };
        if !strides {
            return Err(format!("items of {stride} bytes, which mode and filter do not allow"));
        }
        if mode == Mode::Triangles && count % 3 != 0 {
            return Err(format!("{count} indices make no triangles"));
        }
        let length = count.saturating_mul(stride);
        if length != expected {
            return Err(format!("{count} items of {stride} bytes, in a view of {expected}"));
        }
        if length > stream.saturating_mul(MAX_RATIO) {
            return Err(format!("{stream} bytes cannot make the {length} that are announced; the file is cut short"));
        }
        Ok(())
    }
}

/// Indices as numbers of two or four bytes.
fn packed(indices: &[u32], stride: usize) -> Vec<u8> {
    indices.iter().flat_map(|index| index.to_le_bytes().into_iter().take(stride)).collect()
}

#[cfg(test)]
mod tests;
