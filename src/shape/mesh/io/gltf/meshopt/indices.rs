//! Mode 2, indices: differences to the last index of one of two sequences.

use super::Fault;
use super::cursor::{Cursor, signed};

const HEADER: u8 = 0xd1;
/// Reserved bytes at the end.
const TAIL: usize = 4;

pub(super) fn decode(stream: &[u8], count: usize) -> Result<Vec<u32>, Fault> {
    let (mut stream, _) = Cursor::new(stream, HEADER, TAIL)?;
    let mut last = [0_u32; 2];
    let mut index = || {
        let code = stream.number()?;
        let last = &mut last[(code & 1) as usize];
        *last = last.wrapping_add(signed(code >> 1));
        Ok(*last)
    };
    let indices = (0..count).map(|_| index()).collect::<Result<_, Fault>>()?;
    stream.end()?;
    Ok(indices)
}
