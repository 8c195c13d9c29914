//! Transparency: colors are averaged by how much of them shows.
//!
//! Files hold colors `c` beside their opacity `α`. Colors under full transparency are meaningless and must not leak
//! into their neighbors: `α c` and `α` are interpolated, and the color of the result is their quotient. Products have
//! 16 bit, whatever the depth of the frame.

use rayon::prelude::*;

use crate::{Frame, PixelFormat};

/// Largest value of 16 bit.
const FULL: u64 = 65_535;

/// Row `j` of plane `i` in 16 bit; 8-bit values are scaled so that full stays full.
fn row16(frame: &Frame, i: usize, j: usize, out: &mut [u16]) -> Option<()> {
    if let Some(plane) = frame.plane8(i) {
        out.iter_mut().zip(plane.row(j)).for_each(|(to, v)| *to = u16::from(*v) * 257);
    } else {
        out.copy_from_slice(frame.plane16(i)?.row(j));
    }
    Some(())
}

/// A frame of 16 bit whose colors are multiplied by their opacity. `None` where the memory does not hold the planes.
pub(super) fn weighted(frame: &Frame) -> Option<Frame> {
    let mut out = Frame::new(PixelFormat { bits: 16, ..frame.format }, frame.width, frame.height);
    out.copy_properties(frame);
    let (width, alpha) = (frame.width, frame.format.planes() - 1);
    for i in 0..=alpha {
        let (data, stride) = out.plane16_mut(i)?.into_data();
        data.par_chunks_mut(stride).take(frame.height).enumerate().try_for_each_init(
            || vec![0; width],
            |opacity, (j, row)| {
                row16(frame, i, j, &mut row[..width])?;
                if i < alpha {
                    row16(frame, alpha, j, opacity)?;
                    row.iter_mut().zip(&*opacity).for_each(|(c, a)| {
                        *c = ((u64::from(*c) * u64::from(*a) + FULL / 2) / FULL) as u16;
                    });
                }
                Some(())
            },
        )?;
    }
    Some(out)
}

/// Undoes [`weighted`] into a frame of its own depth.
pub(super) fn unweighted(frame: &Frame, out: &mut Frame) -> Option<()> {
    let max = (1_u64 << out.format.bits) - 1;
    out.copy_properties(frame);
    let alpha = frame.format.planes() - 1;
    let opacity = frame.plane16(alpha)?;
    for i in 0..=alpha {
        let plane = frame.plane16(i)?;
        // Color: α c / α; opacity itself: of all that 16 bit hold.
        let value = |v: u16, a: u16| {
            let of = if i < alpha { u64::from(a) } else { FULL };
            (u64::from(v) * max + of / 2).checked_div(of).map_or(0, |c| c.min(max))
        };
        let rows = 0..frame.height;
        if out.format.bytes_per_sample() == 1 {
            let (data, stride) = out.plane8_mut(i)?.into_data();
            data.par_chunks_mut(stride).zip(rows).for_each(|(row, j)| {
                let samples = row.iter_mut().zip(plane.row(j).iter().zip(opacity.row(j)));
                samples.for_each(|(to, (v, a))| *to = value(*v, *a) as u8);
            });
        } else {
            let (data, stride) = out.plane16_mut(i)?.into_data();
            data.par_chunks_mut(stride).zip(rows).for_each(|(row, j)| {
                let samples = row.iter_mut().zip(plane.row(j).iter().zip(opacity.row(j)));
                samples.for_each(|(to, (v, a))| *to = value(*v, *a) as u16);
            });
        }
    }
    Some(())
}
