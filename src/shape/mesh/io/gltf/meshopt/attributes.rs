//! Mode 0, attributes: differences of each byte to that of the element before, in blocks of elements and groups of 16.

use super::Fault;
use super::cursor::{Cursor, signed};

const HEADER: u8 = 0xa0;
/// Elements of a group.
const GROUP: usize = 16;
/// Least size of the tail, whose last bytes are the element before the first.
const MIN_TAIL: usize = 32;

pub(super) fn decode(stream: &[u8], count: usize, stride: usize) -> Result<Vec<u8>, Fault> {
    let (mut stream, tail) = Cursor::new(stream, HEADER, stride.max(MIN_TAIL))?;
    let mut before = tail[tail.len() - stride..].to_vec();
    let mut bytes = vec![0; count * stride];
    for block in bytes.chunks_mut(stride * block_elements(stride)) {
        for (k, before) in before.iter_mut().enumerate() {
            *before = column(&mut stream, block, k, stride, *before)?;
        }
    }
    stream.end()?;
    Ok(bytes)
}

/// Most elements of a block.
fn block_elements(stride: usize) -> usize {
    (8192 / stride / GROUP * GROUP).min(256)
}

/// Decodes byte `k` of all elements of a block; returns that of the last one.
fn column(stream: &mut Cursor<'_>, block: &mut [u8], k: usize, stride: usize, before: u8) -> Result<u8, Fault> {
    let groups = (block.len() / stride).div_ceil(GROUP);
    let modes = stream.take(groups.div_ceil(4))?;
    let mut last = before;
    for (g, elements) in block.chunks_mut(stride * GROUP).enumerate() {
        let codes = group(stream, modes[g / 4] >> (2 * (g % 4)) & 3)?;
        for (element, code) in elements.chunks_exact_mut(stride).zip(codes) {
            last = last.wrapping_add(signed(code.into()) as u8);
            element[k] = last;
        }
    }
    Ok(last)
}

/// The codes of a group: all zero, in two or four bits of which the greatest value stands for a byte behind them, or in bytes.
fn group(stream: &mut Cursor<'_>, mode: u8) -> Result<[u8; GROUP], Fault> {
    let mut codes = [0; GROUP];
    match mode {
        0 => {}
        3 => codes.copy_from_slice(stream.take(GROUP)?),
        _ => {
            let bits = 2 * usize::from(mode);
            let (per_byte, escape) = (8 / bits, (1 << bits) - 1);
            let packed = stream.take(GROUP / per_byte)?;
            for (i, code) in codes.iter_mut().enumerate() {
                *code = packed[i / per_byte] >> (8 - bits * (i % per_byte + 1)) & escape;
                if *code == escape {
                    *code = stream.byte()?;
                }
            }
        }
    }
    Ok(codes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_group_of_the_specification() {
        let bytes = [0x17, 0x5f, 0xf0, 0xbc, 0x77, 0xa9, 0x21, 0x00, 0x34, 0xb5];
        let stream = [&[HEADER][..], &bytes].concat();
        let (mut stream, _) = Cursor::new(&stream, HEADER, 0).expect("a stream");
        let codes = group(&mut stream, 2).expect("a group");
        let differences = codes.map(|code| signed(code.into()) as u8 as i8);
        assert_eq!(differences, [-1, -4, -3, 26, -91, 0, -6, 6, -4, -4, 5, -5, 1, -1, 0, 0]);
        stream.end().expect("all bytes are read");
    }

    #[test]
    fn blocks_hold_whole_groups_in_eight_kilobytes() {
        assert_eq!([4, 16, 64, 256].map(block_elements), [256, 256, 128, 32]);
    }
}
