//! Sequential decoding of the values of a PLY file.

use super::super::scalar::Scalar;
use super::super::text::Words;
use super::super::{MeshFormat, malformed};
use super::header::{Element, Encoding, Header, Property, Shape};
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
    pub(super) fn position(&self) -> Position {
        match self {
            Self::Text(words) => words.position(),
            Self::Binary { at, .. } => Position::Byte(*at),
        }
    }

    pub(super) fn fault(&self, fault: impl Into<String>) -> MeshError {
        malformed(MeshFormat::Ply, self.position(), fault)
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
        match self {
            Self::Text(words) => words.number("a value"),
            Self::Binary { bytes, at, big } => {
                let size = scalar.size();
                let cut_short = || "the file ends inside an element; it is cut short";
                let fault = || malformed(MeshFormat::Ply, Position::Byte(*at), cut_short());
                let value = bytes.get(*at..*at + size).ok_or_else(fault)?;
                *at += size;
                Ok(scalar.decoded(value, *big))
            }
        }
    }

    /// The next value of `property`, or the items of its list. The length of a list is checked against the remaining file size
    /// before allocation.
    pub(super) fn values(&mut self, property: &Property, into: &mut Vec<f64>) -> Result<(), MeshError> {
        into.clear();
        let (count, item) = match property.shape {
            Shape::One(scalar) => {
                into.push(self.value(scalar)?);
                return Ok(());
            }
            Shape::List(count, item) => (count, item),
        };
        let at = self.position();
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
