//! Accessors: typed values in buffer views.

use super::super::ReadLimits;
use super::buffers::{Buffers, View};
use super::document::{Accessor, Document, SparsePart};
use super::fault;
use crate::mesh::MeshError;

/// Component type of an accessor.
#[derive(Clone, Copy)]
enum Component {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

impl Component {
    fn of(code: u32, at: &str) -> Result<Self, MeshError> {
        Ok(match code {
            5120 => Self::I8,
            5121 => Self::U8,
            5122 => Self::I16,
            5123 => Self::U16,
            5125 => Self::U32,
            5126 => Self::F32,
            _ => {
                return Err(fault(
                    format!("{at}/componentType"),
                    format!("{code} is no type of numbers (5120 to 5126)"),
                ));
            }
        })
    }

    fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::U32 | Self::F32 => 4,
        }
    }

    /// Decodes the first bytes; `normalized` integers become fractions, by the formulas of the specification.
    fn value(self, bytes: &[u8], normalized: bool) -> f64 {
        let two = || [bytes[0], bytes[1]];
        let four = || [bytes[0], bytes[1], bytes[2], bytes[3]];
        let (value, full) = match self {
            Self::I8 => (f64::from(bytes[0].cast_signed()), 127.0),
            Self::U8 => (f64::from(bytes[0]), 255.0),
            Self::I16 => (f64::from(i16::from_le_bytes(two())), 32_767.0),
            Self::U16 => (f64::from(u16::from_le_bytes(two())), 65_535.0),
            Self::U32 => (f64::from(u32::from_le_bytes(four())), f64::from(u32::MAX)),
            Self::F32 => return f64::from(f32::from_le_bytes(four())),
        };
        if normalized { (value / full).max(-1.0) } else { value }
    }
}

/// Values of an accessor, `width` numbers each.
pub(super) struct Values {
    pub(super) width: usize,
    pub(super) numbers: Vec<f64>,
}

impl Values {
    /// Number of values.
    pub(super) fn len(&self) -> usize {
        self.numbers.len() / self.width
    }

    /// The first `N` numbers of each value; missing ones are 1 (the opacity of an RGB color).
    pub(super) fn rows<const N: usize>(&self) -> impl Iterator<Item = [f64; N]> {
        self.numbers.chunks_exact(self.width).map(|row| std::array::from_fn(|k| row.get(k).copied().unwrap_or(1.0)))
    }
}

/// Reads accessor `index`, whose type must be among `kinds`.
pub(super) fn values(
    document: &Document,
    buffers: &Buffers<'_>,
    index: usize,
    kinds: &[&str],
    limits: &ReadLimits,
) -> Result<Values, MeshError> {
    // Type and count; the count is limited before allocation.
    let at = format!("/accessors/{index}");
    let missing = || fault(&at, format!("there are only {} accessors", document.accessors.len()));
    let accessor = document.accessors.get(index).ok_or_else(missing)?;
    if !kinds.contains(&accessor.kind.as_str()) {
        return Err(fault(
            format!("{at}/type"),
            format!("{:?}, where {} is needed", accessor.kind, kinds.join(" or ")),
        ));
    }
    let width = match accessor.kind.as_str() {
        "SCALAR" => 1,
        "VEC2" => 2,
        "VEC3" => 3,
        "MAT4" => 16,
        _ => 4,
    };
    let component = Component::of(accessor.component_type, &at)?;
    let count = usize::try_from(accessor.count).unwrap_or(usize::MAX);
    limits.check("number of values of an accessor", count)?;
    // Dense values, then the sparse replacements.
    let mut numbers = match accessor.buffer_view {
        // Without a buffer view the values are zeros, which the sparse part may replace.
        None => vec![0.0; count * width],
        Some(view) => {
            let view = buffers.view(document, view, &at)?;
            let packed = Packed { component, width, normalized: accessor.normalized, count };
            packed.numbers(view, accessor.byte_offset, &at)?
        }
    };
    substitute(document, buffers, accessor, &at, component, width, &mut numbers)?;
    Ok(Values { width, numbers })
}

/// Layout of equally spaced values in a buffer view.
struct Packed {
    component: Component,
    width: usize,
    normalized: bool,
    count: usize,
}

impl Packed {
    fn numbers(&self, view: View<'_>, offset: u64, at: &str) -> Result<Vec<f64>, MeshError> {
        let (size, offset) = (self.component.size() * self.width, usize::try_from(offset).unwrap_or(usize::MAX));
        let stride = view.stride.unwrap_or(size);
        if stride < size {
            return Err(fault(at, format!("items of {size} bytes stand {stride} bytes apart")));
        }
        let end = match self.count {
            0 => offset,
            n => offset.saturating_add(stride.saturating_mul(n - 1)).saturating_add(size),
        };
        if end > view.bytes.len() {
            let told = format!("{} items end at byte {end} of a buffer view of {}", self.count, view.bytes.len());
            return Err(fault(at, told));
        }
        let mut numbers = Vec::with_capacity(self.count * self.width);
        for item in 0..self.count {
            let item = &view.bytes[offset + item * stride..];
            for k in 0..self.width {
                numbers.push(self.component.value(&item[k * self.component.size()..], self.normalized));
            }
        }
        Ok(numbers)
    }
}

/// Replaces the values at the indices of the sparse part.
fn substitute(
    document: &Document,
    buffers: &Buffers<'_>,
    accessor: &Accessor,
    at: &str,
    component: Component,
    width: usize,
    numbers: &mut [f64],
) -> Result<(), MeshError> {
    let Some(sparse) = &accessor.sparse else { return Ok(()) };
    let at = format!("{at}/sparse");
    let count = usize::try_from(sparse.count).unwrap_or(usize::MAX);
    if count > numbers.len() / width {
        return Err(fault(at, format!("{count} values replace those of an accessor of {}", numbers.len() / width)));
    }
    let part = |part: &SparsePart, component: Component, width: usize, normalized: bool| {
        let view = buffers.view(document, part.buffer_view, &at)?;
        let packed = Packed { component, width, normalized, count };
        packed.numbers(View { stride: None, ..view }, part.byte_offset, &at)
    };
    let places = part(&sparse.indices, Component::of(sparse.indices.component_type, &at)?, 1, false)?;
    let values = part(&sparse.values, component, width, accessor.normalized)?;
    for (&place, value) in places.iter().zip(values.chunks_exact(width)) {
        let from = place as usize * width;
        match numbers.get_mut(from..from + width) {
            Some(into) if place.fract() == 0.0 && place >= 0.0 => into.copy_from_slice(value),
            _ => return Err(fault(&at, format!("replaces value {place}, which the accessor does not have"))),
        }
    }
    Ok(())
}
