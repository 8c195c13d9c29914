//! The header of a PLY file: encoding, elements, properties.

use super::super::scalar::Scalar;
use super::super::text::{shown, whole, words};
use super::super::{MeshFormat, malformed};
use crate::mesh::{MeshError, Position};

/// Maximum number of elements: files have two to five. Their names are compared with each other.
const MAX_ELEMENTS: usize = 1000;

/// Encoding of the values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    Ascii,
    Little,
    Big,
}

/// The scalar type under its old or its sized name.
fn scalar_of(name: &[u8]) -> Option<Scalar> {
    Some(match name {
        b"char" | b"int8" => Scalar::I8,
        b"uchar" | b"uint8" => Scalar::U8,
        b"short" | b"int16" => Scalar::I16,
        b"ushort" | b"uint16" => Scalar::U16,
        b"int" | b"int32" => Scalar::I32,
        b"uint" | b"uint32" => Scalar::U32,
        b"float" | b"float32" => Scalar::F32,
        b"double" | b"float64" => Scalar::F64,
        _ => return None,
    })
}

/// One number, or a list: the type of its length and that of its items.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Shape {
    One(Scalar),
    List(Scalar, Scalar),
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Property {
    pub(super) name: String,
    pub(super) shape: Shape,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Element {
    pub(super) name: String,
    pub(super) count: u64,
    pub(super) properties: Vec<Property>,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Header {
    pub(super) encoding: Encoding,
    pub(super) elements: Vec<Element>,
    /// Offset of the first byte after the header.
    pub(super) end: usize,
    /// Line number of that byte.
    pub(super) line: usize,
}

impl Header {
    /// Reads the header up to `end_header`. The line ending is that of the first line: `\n`, `\r\n` or `\r`.
    pub(super) fn read(bytes: &[u8]) -> Result<Self, MeshError> {
        // Line ending, from the magic line.
        let lone_return = bytes.starts_with(b"ply\r") && !bytes.starts_with(b"ply\r\n");
        let ending = if lone_return { b'\r' } else { b'\n' };
        let mut header = Self { encoding: Encoding::Ascii, elements: Vec::new(), end: 0, line: 0 };
        let mut encoding = None;
        loop {
            let rest = &bytes[header.end..];
            let Some(length) = rest.iter().position(|&b| b == ending) else {
                let told = "the header does not end (`end_header`); the file may be cut short";
                return Err(fault(header.line + 1, told));
            };
            header.end += length + 1;
            header.line += 1;
            let text = rest[..length].trim_ascii();
            if text == b"end_header" {
                break;
            }
            if header.line == 1 {
                if text != b"ply" {
                    return Err(fault(1, "the first line is not `ply`"));
                }
                continue;
            }
            header.statement(text, &mut encoding)?;
        }
        header.line += 1;
        header.encoding = encoding.ok_or_else(|| fault(header.line, "the header does not tell the format"))?;
        Ok(header)
    }

    /// Reads one statement of the header.
    fn statement(&mut self, text: &[u8], encoding: &mut Option<Encoding>) -> Result<(), MeshError> {
        let line = self.line;
        let mut words = words(text);
        let mut word = || words.next().unwrap_or_default();
        match word() {
            b"format" => {
                *encoding = Some(match word() {
                    b"ascii" => Encoding::Ascii,
                    b"binary_little_endian" => Encoding::Little,
                    b"binary_big_endian" => Encoding::Big,
                    other => return Err(fault(line, format!("format {} is not known", shown(other)))),
                });
            }
            b"element" => {
                let name = String::from_utf8_lossy(word()).into_owned();
                let count =
                    whole(word()).ok_or_else(|| fault(line, format!("element `{name}` has no number of items")))?;
                if self.elements.len() >= MAX_ELEMENTS {
                    return Err(fault(line, format!("more than {MAX_ELEMENTS} elements")));
                }
                if self.elements.iter().any(|e| e.name == name) {
                    return Err(fault(line, format!("element `{name}` stands twice")));
                }
                self.elements.push(Element { name, count, properties: Vec::new() });
            }
            b"property" => {
                let scalar =
                    |name: &[u8]| scalar_of(name).ok_or_else(|| fault(line, format!("{} is no type", shown(name))));
                let first = word();
                let shape = if first == b"list" {
                    Shape::List(scalar(word())?, scalar(word())?)
                } else {
                    Shape::One(scalar(first)?)
                };
                let name = String::from_utf8_lossy(word()).into_owned();
                let element = self.elements.last_mut().ok_or_else(|| fault(line, "a property before any element"))?;
                element.properties.push(Property { name, shape });
            }
            b"comment" | b"obj_info" | b"" => {}
            other => return Err(fault(line, format!("{} is no statement of a header", shown(other)))),
        }
        Ok(())
    }
}

fn fault(line: usize, fault: impl Into<String>) -> MeshError {
    malformed(MeshFormat::Ply, Position::Line(line), fault)
}
