//! Coefficients as the bits of a scan.
//!
//! # Reference
//! ITU-T T.81, F.1.2.

use super::blocks::Coefficients;

/// The symbol for sixteen zeros in a row, and that for nothing but zeros.
const SIXTEEN_ZEROS: usize = 0xf0;
const END: usize = 0;

/// Bits of a scan. Behind a byte of ones there is one of zeros, so that it is not taken for a marker.
#[derive(Debug)]
pub(super) struct Bits {
    out: Vec<u8>,
    /// The bits that are not yet in `out`, in its low end, and how many more it has room for.
    held: u64,
    free: u32,
}

impl Bits {
    /// None, with room for so many bytes.
    pub(super) fn with_capacity(bytes: usize) -> Self {
        Self { out: Vec::with_capacity(bytes), held: 0, free: 64 }
    }

    /// Appends the lowest `count` bits of a number, at most 32, above which it is zero.
    fn put(&mut self, bits: u32, count: u32) {
        let bits = u64::from(bits);
        if count < self.free {
            self.held = (self.held << count) | bits;
            self.free -= count;
        } else {
            let rest = count - self.free;
            self.held = (self.held << self.free) | (bits >> rest);
            self.write(8);
            (self.held, self.free) = (bits, 64 - rest);
        }
    }

    /// Writes the first bytes of what is held.
    fn write(&mut self, count: usize) {
        let bytes = self.held.to_be_bytes();
        // A byte of ones is one from which its highest bit is carried on when 1 is added.
        let ones = self.held & 0x8080_8080_8080_8080 & !self.held.wrapping_add(0x0101_0101_0101_0101);
        if ones == 0 && count == 8 {
            self.out.extend_from_slice(&bytes);
            return;
        }
        for byte in &bytes[..count] {
            self.out.push(*byte);
            if *byte == 0xff {
                self.out.push(0);
            }
        }
    }

    /// The bytes, the last one filled up with ones.
    pub(super) fn finish(mut self) -> Vec<u8> {
        let fill = self.free % 8;
        self.put((1 << fill) - 1, fill);
        if self.free < 64 {
            let count = (64 - self.free) / 8;
            self.held <<= self.free;
            self.write(count as usize);
        }
        self.out
    }

    /// Appends a block whose predecessor of the same channel has the mean `before`; its own mean.
    pub(super) fn block(
        &mut self,
        block: &Coefficients,
        before: i16,
        means: &[(u16, u8); 256],
        rest: &[(u16, u8); 256],
    ) -> i16 {
        let mean = block[0] as i16;
        let (size, bits) = magnitude(mean.wrapping_sub(before));
        self.symbol(means[size as usize], (size, bits));
        // The position behind the last coefficient that was not zero.
        let mut next = 1;
        for (k, word) in block.iter().enumerate() {
            let mut left = if k == 0 { *word & !0xffff } else { *word };
            while left != 0 {
                let lane = left.trailing_zeros() / 16;
                let value = (*word >> (16 * lane)) as i16;
                left &= !(0xffff << (16 * lane));
                let at = 4 * k + lane as usize;
                let mut zeros = at - next;
                while zeros > 15 {
                    self.symbol(rest[SIXTEEN_ZEROS], (0, 0));
                    zeros -= 16;
                }
                let (size, bits) = magnitude(value);
                self.symbol(rest[(zeros << 4 | size as usize) % 256], (size, bits));
                next = at + 1;
            }
        }
        if next < 64 {
            self.symbol(rest[END], (0, 0));
        }
        mean
    }

    /// A code, and `size` bits behind it.
    fn symbol(&mut self, (code, length): (u16, u8), (size, bits): (u32, u32)) {
        self.put(u32::from(code) << size | bits, u32::from(length) + size);
    }
}

/// The number of bits that a value takes, and the bits: negative values are one less in two's complement.
fn magnitude(value: i16) -> (u32, u32) {
    let size = 16 - value.unsigned_abs().leading_zeros();
    let bits = (i32::from(value) - i32::from(value < 0)) as u32;
    (size, bits & ((1 << size) - 1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn magnitudes_are_those_of_the_standard() {
        // Of category 2: −3, −2, 2 and 3 are 00, 01, 10 and 11.
        assert_eq!([-3, -2, 2, 3].map(magnitude), [(2, 0), (2, 1), (2, 2), (2, 3)]);
        assert_eq!([0, 1, -1, -32_768].map(magnitude), [(0, 0), (1, 1), (1, 0), (16, 32_767)]);
    }

    #[test]
    fn bits_come_in_order_and_ones_are_followed_by_zeros() {
        let mut bits = Bits::with_capacity(0);
        for k in 0..100_u32 {
            bits.put(k % 2, 1);
        }
        bits.put(0xffff, 16);
        bits.put(5, 3);
        let bytes = bits.finish();
        // 0101…, then sixteen ones from bit 100 on, then 101, then ones.
        assert_eq!(bytes[..12], [0x55; 12]);
        assert_eq!(bytes[12..], [0x5f, 0xff, 0x00, 0xfb,]);
    }
}
