//! Sequential decoding of the values of a PLY file.

use super::super::text::Words;
use super::super::{MeshFormat, malformed};
use super::header::{Element, Encoding, Header, Property, Scalar, Shape};
use crate::mesh::{MeshError, Position};

/// The file contents after the header.
pub(super) enum Body<'a> {
    Text(Words<'a>),
    Binary { bytes: &'a [u8], at: usize, big: bool },
}

impl<'a> Body<'a> {
    pub(super) fn after(header: &Header, bytes: &'a [u8]) -> Self {
        match header.encoding {
            Encoding::Ascii => Self::Text(Words::new(bytes, header.end, header.line, MeshFormat::Ply, None)),
            Encoding::Little => Self::Binary { bytes, at: header.end, big: false },
            Encoding::Big => Self::Binary { bytes, at: header.end, big: true },
        }
    }

    /// Position of the next value.
    pub(super) fn place(&self) -> Position {
        match self {
            Self::Text(words) => words.place(),
            Self::Binary { at, .. } => Position::Byte(*at),
        }
    }

    pub(super) fn fault(&self, fault: impl Into<String>) -> MeshError {
        self.fault_at(self.place(), fault)
    }

    #[expect(clippy::unused_self, reason = "reads as `fault` does")]
    pub(super) fn fault_at(&self, at: Position, fault: impl Into<String>) -> MeshError {
        malformed(MeshFormat::Ply, at, fault)
    }

    fn remaining(&self) -> usize {
        match self {
            Self::Text(words) => words.remaining(),
            Self::Binary { bytes, at, .. } => bytes.len() - at,
        }
    }

    /// Rejects an element with more items than the rest of the file can contain, before allocation.
    pub(super) fn holds(&self, element: &Element) -> Result<(), MeshError> {
        let least = |property: &Property| match (self, property.shape) {
            // At least a digit and a space.
            (Self::Text(_), _) => 2,
            (Self::Binary { .. }, Shape::One(scalar) | Shape::List(scalar, _)) => scalar.size() as u64,
        };
        let size: u64 = element.properties.iter().map(least).sum();
        let (left, count) = (self.remaining() as u64, element.count);
        // The last word of a text file may lack its space.
        if count.saturating_mul(size) > left + 1 {
            let name = &element.name;
            let told = format!(
                "{count} items of element `{name}` take at least {} bytes, but only {left} follow; the file is cut short",
                count.saturating_mul(size)
            );
            return Err(self.fault(told));
        }
        Ok(())
    }

    /// The next value.
    pub(super) fn value(&mut self, scalar: Scalar) -> Result<f64, MeshError> {
        let cut_short = self.cut_short();
        match self {
            Self::Text(words) => words.number("a value"),
            Self::Binary { bytes, at, big } => {
                let size = scalar.size();
                let Some(value) = bytes.get(*at..*at + size) else { return Err(cut_short()) };
                *at += size;
                Ok(decoded(scalar, value, *big))
            }
        }
    }

    fn cut_short(&self) -> impl FnOnce() -> MeshError + use<> {
        let place = match self {
            Self::Binary { at, .. } => Position::Byte(*at),
            Self::Text(_) => Position::Byte(0),
        };
        move || malformed(MeshFormat::Ply, place, "the file ends inside an element; it is cut short")
    }

    /// The next list, of the types of `property`. Its length is checked against the remaining file size before allocation.
    pub(super) fn list(&mut self, property: &Property, into: &mut Vec<f64>) -> Result<(), MeshError> {
        into.clear();
        let Shape::List(count, item) = property.shape else { return Ok(()) };
        let at = self.place();
        let length = self.value(count)?;
        let room = self.remaining() / if matches!(self, Self::Text(_)) { 1 } else { item.size() };
        if !(length >= 0.0 && length <= room as f64 && length.fract() == 0.0) {
            let told = format!("a list `{}` of {length} items; the file has room for {room}", property.name);
            return Err(malformed(MeshFormat::Ply, at, told));
        }
        for _ in 0..length as usize {
            into.push(self.value(item)?);
        }
        Ok(())
    }
}

/// Decodes a binary value of either byte order.
fn decoded(scalar: Scalar, value: &[u8], big: bool) -> f64 {
    let mut raw = [0; 8];
    for (k, &byte) in value.iter().enumerate() {
        raw[if big { value.len() - 1 - k } else { k }] = byte;
    }
    let bits = u64::from_le_bytes(raw);
    match scalar {
        Scalar::I8 => f64::from(bits as i8),
        Scalar::U8 => f64::from(bits as u8),
        Scalar::I16 => f64::from(bits as i16),
        Scalar::U16 => f64::from(bits as u16),
        Scalar::I32 => f64::from(bits as i32),
        Scalar::U32 => f64::from(bits as u32),
        Scalar::F32 => f64::from(f32::from_bits(bits as u32)),
        Scalar::F64 => f64::from_bits(bits),
    }
}
