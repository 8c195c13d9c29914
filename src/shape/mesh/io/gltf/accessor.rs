//! Accessors: typed values in buffer views.

use super::super::ReadLimits;
use super::super::scalar::Scalar;
use super::buffers::{Buffers, View};
use super::document::{Accessor, Document, SparsePart};
use super::{fault, item};
use crate::mesh::MeshError;

/// The type of the components of an accessor at `at`, by its code.
fn component(code: u32, at: &str) -> Result<Scalar, MeshError> {
    Ok(match code {
        5120 => Scalar::I8,
        5121 => Scalar::U8,
        5122 => Scalar::I16,
        5123 => Scalar::U16,
        5125 => Scalar::U32,
        5126 => Scalar::F32,
        _ => {
            let told = format!("{code} is no type of numbers (5120 to 5126)");
            return Err(fault(format!("{at}/componentType"), told));
        }
    })
}

/// The value of a normalized integer as a fraction, by the formulas of the specification.
fn normalized(component: Scalar, value: f64) -> f64 {
    let full = match component {
        Scalar::I8 => 127.0,
        Scalar::U8 => 255.0,
        Scalar::I16 => 32_767.0,
        Scalar::U16 => 65_535.0,
        Scalar::U32 => f64::from(u32::MAX),
        Scalar::I32 | Scalar::F32 | Scalar::F64 => return value,
    };
    (value / full).max(-1.0)
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

/// Reads accessor `index`, whose type must be among `kinds`; `None` if it has more than `left` numbers.
pub(super) fn values(
    document: &Document,
    buffers: &Buffers<'_>,
    index: usize,
    kinds: &[&str],
    limits: &ReadLimits,
    left: usize,
) -> Result<Option<Values>, MeshError> {
    // Type and count; the count is limited before allocation.
    let at = format!("/accessors/{index}");
    let accessor = item(&document.accessors, index, &at, "accessor")?;
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
    let component = component(accessor.component_type, &at)?;
    let count = usize::try_from(accessor.count).unwrap_or(usize::MAX);
    limits.check("number of values of an accessor", count)?;
    if count.saturating_mul(width) > left {
        return Ok(None);
    }
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
    Ok(Some(Values { width, numbers }))
}

/// Layout of equally spaced values in a buffer view.
struct Packed {
    component: Scalar,
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
                let value = self.component.decoded(&item[k * self.component.size()..], false);
                numbers.push(if self.normalized { normalized(self.component, value) } else { value });
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
    type_of_values: Scalar,
    width: usize,
    numbers: &mut [f64],
) -> Result<(), MeshError> {
    let Some(sparse) = &accessor.sparse else { return Ok(()) };
    let at = format!("{at}/sparse");
    let count = usize::try_from(sparse.count).unwrap_or(usize::MAX);
    if count > numbers.len() / width {
        return Err(fault(at, format!("{count} values replace those of an accessor of {}", numbers.len() / width)));
    }
    let part = |part: &SparsePart, component: Scalar, width: usize, normalized: bool| {
        let view = buffers.view(document, part.buffer_view, &at)?;
        let packed = Packed { component, width, normalized, count };
        packed.numbers(View { stride: None, ..view }, part.byte_offset, &at)
    };
    let indices = part(&sparse.indices, component(sparse.indices.component_type, &at)?, 1, false)?;
    let values = part(&sparse.values, type_of_values, width, accessor.normalized)?;
    for (&index, value) in indices.iter().zip(values.chunks_exact(width)) {
        let from = index as usize * width;
        match numbers.get_mut(from..from + width) {
            Some(into) if index.fract() == 0.0 && index >= 0.0 => into.copy_from_slice(value),
            _ => return Err(fault(&at, format!("replaces value {index}, which the accessor does not have"))),
        }
    }
    Ok(())
}
