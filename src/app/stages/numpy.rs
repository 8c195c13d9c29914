//! NumPy's array files: written as version 1.0 of floats, read as any list of numbers.

use std::io::{self, Write};

/// A type of numbers that is written.
pub(crate) trait Number: bytemuck::Pod {
    /// NumPy's name of it.
    const KIND: &'static str;

    /// Its bytes, the lowest first.
    fn bytes(self) -> impl AsRef<[u8]>;
}

impl Number for f32 {
    const KIND: &'static str = "<f4";

    fn bytes(self) -> impl AsRef<[u8]> {
        self.to_le_bytes()
    }
}

impl Number for f64 {
    const KIND: &'static str = "<f8";

    fn bytes(self) -> impl AsRef<[u8]> {
        self.to_le_bytes()
    }
}

/// Writes an array whose last axis varies fastest.
pub(crate) fn write_npy<T: Number>(mut out: impl Write, shape: &[usize], values: &[T]) -> io::Result<()> {
    let axes: Vec<String> = shape.iter().map(|n| format!("{n},")).collect();
    let (kind, axes) = (T::KIND, axes.join(" "));
    let mut header = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': ({axes}), }}");
    // Magic, version and length take 10 bytes, the line break one; together a multiple of 64.
    let padded = (header.len() + 11).next_multiple_of(64) - 11;
    header.extend(std::iter::repeat_n(' ', padded - header.len()));
    header.push('\n');
    out.write_all(b"\x93NUMPY\x01\0")?;
    out.write_all(&(header.len() as u16).to_le_bytes())?;
    out.write_all(header.as_bytes())?;
    if cfg!(target_endian = "little") {
        out.write_all(bytemuck::cast_slice(values))?;
    } else {
        values.iter().try_for_each(|v| out.write_all(v.bytes().as_ref()))?;
    }
    out.flush()
}

/// Numbers of an array whose other axes have length 1, little-endian.
///
/// # Errors
/// In words: another kind of file, more than one axis, a type that is not read, fewer bytes than numbers.
pub(crate) fn read_npy(bytes: &[u8]) -> Result<Vec<f64>, String> {
    let (header, data) = split(bytes).ok_or("not a NumPy file (.npy)")?;
    let after = |key: &str| Some(header.split_once(key)?.1.trim_start_matches([' ', ':', '\'', '"']));
    let kind = after("descr").and_then(|t| t.split(['\'', '"']).next()).unwrap_or("");
    let shape = after("shape").and_then(|t| t.strip_prefix('(')?.split_once(')')).map_or("", |t| t.0);
    let axes: Vec<usize> = shape.split(',').filter_map(|n| n.trim().parse().ok()).collect();
    if axes.iter().filter(|n| **n != 1).count() > 1 {
        return Err(format!("an array of shape ({shape}) (expected one axis)"));
    }
    let count = axes.iter().try_fold(1_usize, |all, n| all.checked_mul(*n)).ok_or("an array of impossible size")?;
    let numbers: Vec<f64> = match kind {
        "<f8" => all(data, f64::from_le_bytes),
        "<f4" => all(data, |b| f32::from_le_bytes(b).into()),
        "<i8" => all(data, |b| i64::from_le_bytes(b) as f64),
        "<i4" => all(data, |b| i32::from_le_bytes(b).into()),
        "<u8" => all(data, |b| u64::from_le_bytes(b) as f64),
        "<u4" => all(data, |b| u32::from_le_bytes(b).into()),
        "<i2" => all(data, |b| i16::from_le_bytes(b).into()),
        "<u2" => all(data, |b| u16::from_le_bytes(b).into()),
        "|i1" => all(data, |[b]: [u8; 1]| f64::from(b as i8)),
        "|u1" | "|b1" => all(data, |[b]: [u8; 1]| f64::from(b)),
        other => return Err(format!("numbers of type {other:?} (expected little-endian integers or floats)")),
    };
    if numbers.len() < count {
        return Err(format!("{} numbers, fewer than the {count} of its header", numbers.len()));
    }
    Ok(numbers[..count].to_vec())
}

fn all<const N: usize>(data: &[u8], number: impl Fn([u8; N]) -> f64) -> Vec<f64> {
    data.as_chunks().0.iter().map(|bytes| number(*bytes)).collect()
}

/// Header and data, of version 1 to 3.
fn split(bytes: &[u8]) -> Option<(&str, &[u8])> {
    let rest = bytes.strip_prefix(b"\x93NUMPY")?;
    let (&[version, _], rest) = rest.split_first_chunk()?;
    let (length, rest) = if version == 1 {
        let (length, rest) = rest.split_first_chunk()?;
        (usize::from(u16::from_le_bytes(*length)), rest)
    } else {
        let (length, rest) = rest.split_first_chunk()?;
        (u32::from_le_bytes(*length) as usize, rest)
    };
    let (header, data) = rest.split_at_checked(length)?;
    Some((std::str::from_utf8(header).ok()?, data))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_read_back_and_other_files_refused() {
        let mut out = Vec::new();
        write_npy(&mut out, &[3], &[1.5_f32, -2.0, f32::INFINITY]).expect("memory");
        assert_eq!(read_npy(&out), Ok(vec![1.5, -2.0, f64::INFINITY]));
        let mut square = Vec::new();
        write_npy(&mut square, &[2, 2], &[0.0_f64; 4]).expect("memory");
        let refused = |bytes: &[u8]| read_npy(bytes).expect_err("refused");
        assert!(refused(&square).contains("expected one axis"));
        assert!(refused(&out[..130]).contains("fewer than the 3"));
        assert!(refused(b"v 0 0 0").contains("not a NumPy file"));
        let big = [&out[..20], &out[20..].iter().map(|b| if *b == b'<' { b'>' } else { *b }).collect::<Vec<_>>()[..]];
        assert!(refused(&big.concat()).contains("\">f4\""));
    }

    #[test]
    fn the_header_is_what_numpy_writes() {
        let mut out = Vec::new();
        write_npy(&mut out, &[2, 3], &[1.0_f32, 2.0, 3.0, 4.0, 5.0, f32::NAN]).expect("memory");
        assert_eq!(out.len(), 128 + 24);
        let header = std::str::from_utf8(&out[10..128]).expect("text");
        assert_eq!(header.trim_end(), "{'descr': '<f4', 'fortran_order': False, 'shape': (2, 3,), }");
        assert!(header.ends_with('\n'));
        assert_eq!(u16::from_le_bytes([out[8], out[9]]), 118);
        assert_eq!(out[128..132], 1.0_f32.to_le_bytes());
    }
}
