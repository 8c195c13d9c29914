//! What every glTF file is packed of: a buffer of numbers, views of it and accessors, in JSON with the buffer in base64 or in one
//! binary file.
//!
//! # Reference
//! Khronos Group, *glTF 2.0 specification*, sections 3.6 (binary data), 4.4 (binary layout).

use std::io::{self, Write};

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Map, Value, json};

/// The first bytes of a binary file.
pub const MAGIC: &[u8; 4] = b"glTF";
/// Kind of the chunk with the document.
pub const JSON_CHUNK: u32 = 0x4E4F_534A;
/// Kind of the chunk with the buffer.
pub const BINARY_CHUNK: u32 = 0x004E_4942;
/// Target of views of vertex attributes.
pub const ARRAY_BUFFER: u32 = 34_962;
/// Target of views of indices.
pub const ELEMENT_ARRAY_BUFFER: u32 = 34_963;
/// Component type of 32-bit floats.
const FLOAT: u32 = 5126;

/// The buffer of a file in the making.
#[derive(Clone, Debug, Default)]
pub struct GltfBuffer {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
    /// A number was not finite.
    is_beyond: bool,
}

impl GltfBuffer {
    /// Appends bytes, padded to a multiple of four; the number of their view.
    pub fn view(&mut self, bytes: &[u8], target: Option<u32>) -> usize {
        let mut view = json!({ "buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len() });
        if let Some(target) = target {
            view["target"] = json!(target);
        }
        self.bytes.extend_from_slice(bytes);
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        self.views.push(view);
        self.views.len() - 1
    }

    /// Appends `count` values of a `kind` such as `VEC3`, of components of a type; the number of their accessor.
    pub fn accessor(&mut self, bytes: &[u8], component: u32, count: usize, kind: &str, target: Option<u32>) -> usize {
        let view = self.view(bytes, target);
        self.accessors.push(json!({ "bufferView": view, "componentType": component, "count": count, "type": kind }));
        self.accessors.len() - 1
    }

    /// Appends values of 32-bit floats; the number of their accessor. The format has no numbers that are not finite (section 3.6.2.2): with
    /// one of them [`Self::write`] fails.
    pub fn floats<const N: usize>(&mut self, values: &[[f32; N]], kind: &str, target: Option<u32>) -> usize {
        self.is_beyond |= !values.iter().flatten().all(|x| x.is_finite());
        let bytes: Vec<u8> = values.iter().flatten().flat_map(|x| x.to_le_bytes()).collect();
        self.accessor(&bytes, FLOAT, values.len(), kind, target)
    }

    /// [`Self::floats`] with their least and largest values, as the format asks of positions and times.
    pub fn bounded<const N: usize>(&mut self, values: &[[f32; N]], kind: &str, target: Option<u32>) -> usize {
        let bound = |pick: fn(f32, f32) -> f32| -> Vec<f32> {
            (0..N).map(|k| values.iter().map(|v| v[k]).reduce(pick).unwrap_or_default()).collect()
        };
        let accessor = self.floats(values, kind, target);
        self.accessors[accessor]["min"] = json!(bound(f32::min));
        self.accessors[accessor]["max"] = json!(bound(f32::max));
        accessor
    }

    /// Writes the file: `document` and this buffer. Empty lists are left out, as the format demands.
    ///
    /// # Errors
    /// Those of `out`; a number that is not finite; a binary file beyond 4 GiB.
    pub fn write(self, mut document: Map<String, Value>, binary: bool, out: &mut impl Write) -> io::Result<()> {
        if self.is_beyond {
            return Err(io::Error::other(format!("glTF holds numbers up to {:e}, and some are larger", f32::MAX)));
        }
        if !self.bytes.is_empty() {
            let mut buffer = json!({ "byteLength": self.bytes.len() });
            if !binary {
                let uri = format!("data:application/octet-stream;base64,{}", STANDARD.encode(&self.bytes));
                buffer["uri"] = json!(uri);
            }
            document.insert("buffers".to_owned(), json!([buffer]));
        }
        document.insert("bufferViews".to_owned(), Value::Array(self.views));
        document.insert("accessors".to_owned(), Value::Array(self.accessors));
        document.retain(|_, value| value.as_array().is_none_or(|list| !list.is_empty()));
        let mut text = Value::Object(document).to_string().into_bytes();
        if !binary {
            return out.write_all(&text);
        }
        text.resize(text.len().next_multiple_of(4), b' ');
        let chunks = [(JSON_CHUNK, &text), (BINARY_CHUNK, &self.bytes)];
        let chunks = chunks.iter().filter(|(_, bytes)| !bytes.is_empty());
        let total = 12 + chunks.clone().map(|(_, bytes)| 8 + bytes.len()).sum::<usize>();
        let size = |n: usize| {
            u32::try_from(n).map_err(|_| io::Error::other("a GLB file has at most 4 GiB; write PLY instead"))
        };
        out.write_all(MAGIC)?;
        out.write_all(&2_u32.to_le_bytes())?;
        out.write_all(&size(total)?.to_le_bytes())?;
        for (kind, bytes) in chunks {
            out.write_all(&size(bytes.len())?.to_le_bytes())?;
            out.write_all(&kind.to_le_bytes())?;
            out.write_all(bytes)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_that_are_not_finite_are_not_written() {
        let mut buffer = GltfBuffer::default();
        buffer.floats(&[[f32::MAX]], "SCALAR", None);
        assert!(buffer.clone().write(Map::new(), false, &mut Vec::new()).is_ok());
        buffer.bounded(&[[0.0, f32::INFINITY]], "VEC2", None);
        let mut out = Vec::new();
        let refused = buffer.write(Map::new(), true, &mut out).expect_err("too large");
        assert!(refused.to_string().contains("3.4028235e38") && out.is_empty(), "{refused}");
    }

    #[test]
    fn both_containers_hold_the_same_document_and_the_binary_one_its_buffer() {
        let mut buffer = GltfBuffer::default();
        assert_eq!(buffer.view(&[1, 2, 3], None), 0);
        assert_eq!(buffer.bounded(&[[1.0, -2.0], [0.5, 7.0]], "VEC2", Some(ARRAY_BUFFER)), 0);
        let written = |binary: bool| {
            let (mut out, document) = (Vec::new(), json!({ "asset": { "version": "2.0" }, "nodes": [] }));
            let Value::Object(document) = document else { unreachable!("an object") };
            buffer.clone().write(document, binary, &mut out).unwrap();
            out
        };
        let mut text: Value = serde_json::from_slice(&written(false)).unwrap();
        assert_eq!(text["accessors"][0]["min"], json!([0.5, -2.0]));
        assert_eq!(text["bufferViews"][1], json!({ "buffer": 0, "byteOffset": 4, "byteLength": 16, "target": 34_962 }));
        assert!(text.get("nodes").is_none() && text["buffers"][0]["byteLength"] == 20);
        let binary = written(true);
        let length = u32::from_le_bytes(binary[12..16].try_into().unwrap()) as usize;
        text["buffers"][0].as_object_mut().unwrap().remove("uri");
        assert_eq!(serde_json::from_slice::<Value>(&binary[20..20 + length]).unwrap(), text);
        assert_eq!(binary[20 + length..][..11], [20, 0, 0, 0, b'B', b'I', b'N', 0, 1, 2, 3]);
        assert_eq!(u32::from_le_bytes(binary[8..12].try_into().unwrap()) as usize, binary.len());
    }
}
