//! NumPy's array files, version 1.0, of 32-bit floats.

use std::io::{self, Write};

/// Writes an array whose last axis varies fastest.
pub(super) fn write_npy(mut out: impl Write, shape: &[usize], values: &[f32]) -> io::Result<()> {
    let axes: Vec<String> = shape.iter().map(|n| format!("{n},")).collect();
    let mut header = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({}), }}", axes.join(" "));
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
        values.iter().try_for_each(|v| out.write_all(&v.to_le_bytes()))?;
    }
    out.flush()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_header_is_what_numpy_writes() {
        let mut out = Vec::new();
        write_npy(&mut out, &[2, 3], &[1.0, 2.0, 3.0, 4.0, 5.0, f32::NAN]).expect("memory");
        assert_eq!(out.len(), 128 + 24);
        let header = std::str::from_utf8(&out[10..128]).expect("text");
        assert_eq!(header.trim_end(), "{'descr': '<f4', 'fortran_order': False, 'shape': (2, 3,), }");
        assert!(header.ends_with('\n'));
        assert_eq!(u16::from_le_bytes([out[8], out[9]]), 118);
        assert_eq!(out[128..132], 1.0_f32.to_le_bytes());
    }
}
