//! NumPy's archives: arrays by name in a ZIP file, uncompressed.

use std::io::{self, Write};

use super::numpy::write_npy;

/// Polynomial of CRC-32, reversed.
const POLYNOMIAL: u32 = 0xedb8_8320;
/// The first day that ZIP knows: archives of equal arrays are equal.
const DATE: u16 = 1 << 5 | 1;

/// An array to be written: its name, shape, and numbers with the last axis varying fastest.
pub(crate) struct Array<'a> {
    pub(crate) name: &'a str,
    pub(crate) shape: Vec<usize>,
    pub(crate) values: Vec<f64>,
}

/// Writes the arrays.
///
/// # Errors
/// Those of `out`, and archives of 4 GiB and more.
pub(crate) fn write_npz(mut out: impl Write, arrays: &[Array<'_>]) -> io::Result<()> {
    let (mut directory, mut offset) = (Vec::new(), 0_u32);
    for array in arrays {
        let mut file = Vec::new();
        write_npy(&mut file, &array.shape, &array.values)?;
        let name = format!("{}.npy", array.name);
        let size = u32::try_from(file.len()).map_err(|_| too_large())?;
        let about = about(&name, crc32(&file), size);
        out.write_all(b"PK\x03\x04")?;
        out.write_all(&about)?;
        out.write_all(name.as_bytes())?;
        out.write_all(&file)?;
        directory.extend(b"PK\x01\x02\x14\x00");
        directory.extend(&about);
        directory.extend([0; 10]); // no comment, first disk, no attributes
        directory.extend(offset.to_le_bytes());
        directory.extend(name.as_bytes());
        let written = (4 + about.len() + name.len()) as u32;
        offset = offset.checked_add(written).and_then(|o| o.checked_add(size)).ok_or_else(too_large)?;
    }
    out.write_all(&directory)?;
    let count = (arrays.len() as u16).to_le_bytes();
    out.write_all(b"PK\x05\x06\x00\x00\x00\x00")?;
    out.write_all(&[count, count].concat())?;
    out.write_all(&(directory.len() as u32).to_le_bytes())?;
    out.write_all(&offset.to_le_bytes())?;
    out.write_all(&[0; 2])?;
    out.flush()
}

fn too_large() -> io::Error {
    io::Error::other("the arrays are larger than the 4 GiB that an archive may be")
}

/// What both headers of a file share: version, flags, method, time, date, checksum, sizes, length of the name, no extras.
fn about(name: &str, crc: u32, size: u32) -> Vec<u8> {
    let mut out = Vec::with_capacity(26);
    for word in [20, 0, 0, 0, DATE] {
        out.extend(u16::to_le_bytes(word));
    }
    for word in [crc, size, size] {
        out.extend(word.to_le_bytes());
    }
    out.extend((name.len() as u16).to_le_bytes());
    out.extend([0; 2]);
    out
}

fn crc32(bytes: &[u8]) -> u32 {
    let step = |crc: u32| if crc & 1 == 1 { crc >> 1 ^ POLYNOMIAL } else { crc >> 1 };
    let table: [u32; 256] = std::array::from_fn(|i| (0..8).fold(i as u32, |crc, _| step(crc)));
    !bytes.iter().fold(u32::MAX, |crc, b| table[((crc ^ u32::from(*b)) & 255) as usize] ^ crc >> 8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_checksum_is_that_of_the_standard() {
        assert_eq!(crc32(b"123456789"), 0xcbf4_3926);
        assert_eq!(crc32(b""), 0);
    }

    #[test]
    fn the_end_of_the_archive_points_to_its_directory() {
        let mut out = Vec::new();
        let array = |name| Array { name, shape: vec![2], values: vec![1.0, 2.0] };
        write_npz(&mut out, &[array("a"), array("b")]).expect("memory");
        let end = out.len() - 22;
        assert_eq!(&out[end..end + 4], b"PK\x05\x06");
        let at = u32::from_le_bytes(out[end + 16..end + 20].try_into().expect("four")) as usize;
        assert_eq!(&out[at..at + 4], b"PK\x01\x02");
        assert_eq!(at + u32::from_le_bytes(out[end + 12..end + 16].try_into().expect("four")) as usize, end);
    }
}
