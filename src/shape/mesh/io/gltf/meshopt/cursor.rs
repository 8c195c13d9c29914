//! A stream without its header and tail, read from the front.

use super::Fault;

const TOO_SHORT: Fault = "the stream ends too early; the file is cut short";

/// The unread part of a stream.
pub(super) struct Cursor<'a> {
    rest: &'a [u8],
}

impl<'a> Cursor<'a> {
    /// The part of `stream` between its first byte, which must be `header`, and the last `tail` bytes, which are the second value.
    pub(super) fn new(stream: &'a [u8], header: u8, tail: usize) -> Result<(Self, &'a [u8]), Fault> {
        let (&first, rest) = stream.split_first().ok_or(TOO_SHORT)?;
        if first != header {
            return Err("the stream is of another mode, or of a newer version of the codec");
        }
        let at = rest.len().checked_sub(tail).ok_or(TOO_SHORT)?;
        let (rest, tail) = rest.split_at(at);
        Ok((Self { rest }, tail))
    }

    /// The next `n` bytes.
    pub(super) fn take(&mut self, n: usize) -> Result<&'a [u8], Fault> {
        let (taken, rest) = self.rest.split_at_checked(n).ok_or(TOO_SHORT)?;
        self.rest = rest;
        Ok(taken)
    }

    pub(super) fn byte(&mut self) -> Result<u8, Fault> {
        Ok(self.take(1)?[0])
    }

    /// A number in seven bits per byte, the least significant ones first; all but its last byte have the eighth bit.
    pub(super) fn number(&mut self) -> Result<u32, Fault> {
        let mut number = 0;
        for shift in (0..32).step_by(7) {
            let byte = self.byte()?;
            number |= u32::from(byte & 0x7f) << shift;
            if byte < 0x80 {
                return Ok(number);
            }
        }
        Err("a number of more than 32 bits")
    }

    /// Nothing may be left.
    pub(super) fn end(self) -> Result<(), Fault> {
        if self.rest.is_empty() { Ok(()) } else { Err("the stream is longer than what it makes") }
    }
}

/// The signed number of a zigzag code: 0, −1, 1, −2, …, in two's complement.
pub(super) fn signed(code: u32) -> u32 {
    if code & 1 == 1 { !(code >> 1) } else { code >> 1 }
}
