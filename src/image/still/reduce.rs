//! What a format cannot hold, taken away: depth beyond 8 bit, and transparency.

use rayon::prelude::*;

use super::StillError;
use super::packed::Sample;
use crate::{Frame, Layout, PixelFormat};

/// Calls `f` with each row of plane `i` of `to`.
fn each_row<S: Sample>(to: &mut Frame, i: usize, f: impl Fn(usize, &mut [S]) + Sync) -> Result<(), StillError> {
    let (width, height) = (to.width, to.height);
    let (data, stride) = S::plane_mut(to, i).ok_or(StillError::Layout)?.into_data();
    data.par_chunks_mut(stride).take(height).enumerate().for_each(|(j, row)| f(j, &mut row[..width]));
    Ok(())
}

/// The frame with 8 bits per sample, rounded.
pub(super) fn to_8_bit(frame: &Frame) -> Result<Frame, StillError> {
    let mut out = Frame::new(PixelFormat { bits: 8, ..frame.format }, frame.width, frame.height);
    out.color = frame.color;
    for i in 0..frame.format.planes() {
        let from = frame.plane16(i).ok_or(StillError::Layout)?;
        each_row::<u8>(&mut out, i, |j, row| {
            row.iter_mut().zip(from.row(j)).for_each(|(to, &v)| *to = ((u32::from(v) * 255 + 32_767) / 65_535) as u8);
        })?;
    }
    Ok(out)
}

/// The frame laid over white.
pub(super) fn over_white(frame: &Frame) -> Result<Frame, StillError> {
    flattened(frame, 1.0)
}

/// A frame with alpha laid over an even gray from 0, black, to 1, white.
///
/// # Errors
/// [`StillError::Layout`] for a frame without alpha, or whose memory does not hold its planes.
pub fn flattened(frame: &Frame, gray: f64) -> Result<Frame, StillError> {
    if !frame.format.alpha {
        return Err(StillError::Layout);
    }
    let level = |max: u32| (gray.clamp(0.0, 1.0) * f64::from(max)).round() as u32;
    if frame.format.bits == 8 { over::<u8>(frame, 255, level(255)) } else { over::<u16>(frame, 65_535, level(65_535)) }
}

fn over<S>(frame: &Frame, max: u32, ground: u32) -> Result<Frame, StillError>
where
    S: Sample + Into<u32> + TryFrom<u32>,
{
    let mut out = Frame::new(PixelFormat { alpha: false, ..frame.format }, frame.width, frame.height);
    out.color = frame.color;
    let color = frame.format.planes() - 1;
    let alpha = S::plane(frame, color).ok_or(StillError::Layout)?;
    for i in 0..color {
        let from = S::plane(frame, i).ok_or(StillError::Layout)?;
        each_row::<S>(&mut out, i, |j, row| {
            for ((to, &v), &a) in row.iter_mut().zip(from.row(j)).zip(alpha.row(j)) {
                let (v, a): (u32, u32) = (v.into(), a.into());
                let sum = u64::from(v) * u64::from(a) + u64::from(ground) * u64::from(max - a);
                let mixed = ((sum + u64::from(max / 2)) / u64::from(max)) as u32;
                *to = S::try_from(mixed).unwrap_or(*to);
            }
        })?;
    }
    Ok(out)
}

/// True where every pixel is opaque, or there is no alpha.
pub(super) fn is_opaque(frame: &Frame) -> bool {
    if !frame.format.alpha {
        return true;
    }
    let alpha = frame.format.planes() - 1;
    let full = |j: usize| {
        let eight = frame.plane8(alpha).map(|p| p.row(j).iter().all(|&a| a == u8::MAX));
        eight.or_else(|| frame.plane16(alpha).map(|p| p.row(j).iter().all(|&a| a == u16::MAX))).unwrap_or(false)
    };
    (0..frame.height).into_par_iter().all(full)
}

/// True where all color planes are alike, so that gray says the same.
pub(super) fn is_gray(frame: &Frame) -> bool {
    frame.format.layout == Layout::Gray
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(bits: u8, values: [u16; 2], alpha: [u16; 2]) -> Frame {
        let mut f = Frame::new(PixelFormat { layout: Layout::Gray, bits, alpha: true }, 2, 1);
        for (i, row) in [values, alpha].iter().enumerate() {
            for (x, &v) in row.iter().enumerate() {
                if bits == 8 {
                    f.plane8_mut(i).expect("8 bit").row_mut(0)[x] = v as u8;
                } else {
                    f.plane16_mut(i).expect("16 bit").row_mut(0)[x] = v;
                }
            }
        }
        f
    }

    #[test]
    fn ends_stay_ends_and_the_middle_is_rounded() {
        let eight = to_8_bit(&frame(16, [0, 65_535], [128, 129])).expect("16 bit");
        assert_eq!(eight.plane8(0).expect("8 bit").row(0), [0, 255]);
        assert_eq!(eight.plane8(1).expect("8 bit").row(0), [0, 1], "half of 257 rounds up");
    }

    #[test]
    fn transparent_pixels_become_white_and_opaque_ones_stay() {
        for (bits, max) in [(8, 255), (16, 65_535)] {
            let flat = over_white(&frame(bits, [7, 7], [0, max])).expect("with alpha");
            let at = |x: usize| {
                flat.plane8(0).map_or_else(|| flat.plane16(0).expect("16 bit").row(0)[x], |p| u16::from(p.row(0)[x]))
            };
            assert_eq!((at(0), at(1)), (max, 7));
            assert!(!flat.format.alpha);
        }
        assert!(!is_opaque(&frame(8, [0, 0], [255, 254])) && is_opaque(&frame(8, [0, 0], [255, 255])));
        assert!(!is_opaque(&frame(16, [0, 0], [65_535, 255])));
    }
}
