//! The tables of a JPEG header, read back for the coder that continues it.

use super::blocks::{place, scale};
use super::segments::segment;

/// Steps of quantization.
#[derive(Clone, Debug)]
pub(super) struct Quantization {
    /// What a coefficient of the scaled transform is multiplied by, in the order of a transposed block.
    factors: [f32; 64],
}

impl Quantization {
    /// Of steps in zigzag order.
    pub(super) fn of_steps(steps: &[u8; 64]) -> Self {
        let mut factors = [0.0; 64];
        for (k, step) in steps.iter().enumerate() {
            let at = place(k);
            factors[at] = 1.0 / (f32::from(*step) * scale(at / 8, at % 8));
        }
        Self { factors }
    }

    pub(super) fn factors(&self) -> [f32; 64] {
        self.factors
    }
}

/// A Huffman code: of each symbol the bits and their number.
#[derive(Clone, Debug)]
pub(super) struct Huffman {
    pub(super) codes: [(u16, u8); 256],
}

impl Huffman {
    /// Of the counts of codes of each length, and the symbols in their order (ITU-T T.81, annex C).
    fn of(counts: &[u8; 16], symbols: &[u8]) -> Self {
        let (mut codes, mut code, mut symbols) = ([(0, 0); 256], 0_u16, symbols.iter());
        for (length, count) in (1..).zip(counts) {
            for symbol in symbols.by_ref().take(usize::from(*count)) {
                codes[usize::from(*symbol)] = (code, length);
                code = code.wrapping_add(1);
            }
            code <<= 1;
        }
        Self { codes }
    }
}

/// The tables of luma and of color: steps, codes of the means of blocks, codes of the rest.
#[derive(Clone, Debug, Default)]
pub(super) struct Tables {
    pub(super) quantization: [Option<Quantization>; 2],
    pub(super) means: [Option<Huffman>; 2],
    pub(super) rest: [Option<Huffman>; 2],
}

impl Tables {
    /// Those before the scan of a header that an encoder wrote: one table per segment.
    pub(super) fn of(header: &[u8]) -> Self {
        let (mut tables, mut at) = (Self::default(), 2);
        while let Some(s) = segment(header, at) {
            match (s.code, header.get(s.start..s.end)) {
                (0xdb, Some([kind, steps @ ..])) => {
                    let steps = steps.first_chunk::<64>().map(Quantization::of_steps);
                    tables.quantization[usize::from(kind % 2)] = steps;
                }
                (0xc4, Some([kind, codes @ ..])) => {
                    let code = codes.split_first_chunk::<16>().map(|(counts, symbols)| Huffman::of(counts, symbols));
                    let of = if kind / 16 == 0 { &mut tables.means } else { &mut tables.rest };
                    of[usize::from(kind % 2)] = code;
                }
                (0xda, _) => break,
                _ => {}
            }
            at = s.end;
        }
        tables
    }
}
