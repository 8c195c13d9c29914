//! From the planes of a decoder to color planes at full size: for still pictures that come from a video decoder.
//!
//! ```text
//! R = Y + 2(1 − K_R) C_R,    B = Y + 2(1 − K_B) C_B,    G = (Y − K_R R − K_B B) / (1 − K_R − K_B),
//! ```
//!
//! with the weights that the frame names (ITU-T H.273), those of BT.601 where it names none, as HEIF has it. Chroma is
//! interpolated linearly between the places where it is sited. Depths beyond 8 bit become 16 bit, full scale staying full scale.

use rayon::prelude::*;

use super::{Frame, Layout, PixelFormat, PlaneMut};

/// The frame as gray or GBR of 8 or 16 bit over the full range; alpha is left out. `None` where its memory does not hold its
/// planes, or its matrix is not one of those weights.
pub fn rgb_frame(frame: &Frame) -> Option<Frame> {
    let layout = if frame.format.layout == Layout::Gray { Layout::Gray } else { Layout::Gbr };
    let bits = if frame.format.bits > 8 { 16 } else { 8 };
    let mut out = Frame::new(PixelFormat::opaque(layout, bits), frame.width, frame.height);
    out.color.full_range = Some(true);
    let conversion = Conversion::of(frame)?;
    for plane in 0..out.format.planes() {
        let row = |j: usize, values: &mut [f32]| conversion.row(frame, plane, j, values);
        if bits == 8 {
            fill_rows(out.plane8_mut(plane)?, row, |v| (255.0 * v).round().clamp(0.0, 255.0) as u8)?;
        } else {
            fill_rows(out.plane16_mut(plane)?, row, |v| (65_535.0 * v).round().clamp(0.0, 65_535.0) as u16)?;
        }
    }
    Some(out)
}

/// Fills a plane with `sample` of the values of each row.
fn fill_rows<T: Send>(
    out: PlaneMut<'_, T>,
    row: impl Fn(usize, &mut [f32]) -> Option<()> + Sync,
    sample: impl Fn(f32) -> T + Sync,
) -> Option<()> {
    let (width, height) = (out.width(), out.height());
    let (data, stride) = out.into_data();
    data.par_chunks_mut(stride).take(height).enumerate().try_for_each_init(
        || vec![0.0; width],
        |values, (j, to)| {
            row(j, values)?;
            to.iter_mut().zip(&*values).for_each(|(to, v)| *to = sample(*v));
            Some(())
        },
    )
}

/// How samples become red, green and blue, each from 0 to 1.
struct Conversion {
    /// Value of black and extent up to white of luma; the middle and extent of chroma.
    luma: [f32; 2],
    chroma: [f32; 2],
    /// Weights of `(Y, C_B, C_R)` in green, blue and red.
    mix: [[f32; 3]; 3],
}

impl Conversion {
    fn of(frame: &Frame) -> Option<Self> {
        let (format, color) = (frame.format, &frame.color);
        let full = color.full_range.unwrap_or(!format.is_yuv()) || format.layout == Layout::Gbr;
        let unit = (1_u32 << (format.bits - 8)) as f32;
        let most = ((1_u32 << format.bits) - 1) as f32;
        let (luma, chroma) = if full {
            ([0.0, most], [128.0 * unit, most])
        } else {
            ([16.0 * unit, 219.0 * unit], [128.0 * unit, 224.0 * unit])
        };
        let (kr, kb) = match color.matrix {
            1 => (0.2126, 0.0722),
            4 => (0.30, 0.11),
            2 | 5 | 6 | 0 => (0.299, 0.114),
            7 => (0.212, 0.087),
            9 => (0.2627, 0.0593),
            _ => return None,
        };
        let kg = 1.0 - kr - kb;
        let (b, r) = (2.0 * (1.0 - kb), 2.0 * (1.0 - kr));
        let mix = [[1.0, -kb * b / kg, -kr * r / kg], [1.0, b, 0.0], [1.0, 0.0, r]];
        Some(Self { luma, chroma, mix })
    }

    /// Row `j` of an output plane, from 0 to 1.
    fn row(&self, frame: &Frame, plane: usize, j: usize, out: &mut [f32]) -> Option<()> {
        let signal = |v: f32, [zero, extent]: [f32; 2]| (v - zero) / extent;
        if !frame.format.is_yuv() {
            samples(frame, plane, j, out)?;
            for v in out.iter_mut() {
                *v = signal(*v, self.luma);
            }
            return Some(());
        }
        let [y, cb, cr] = self.mix[plane];
        samples(frame, 0, j, out)?;
        for v in out.iter_mut() {
            *v = y * signal(*v, self.luma);
        }
        for (i, weight) in [(1, cb), (2, cr)].into_iter().filter(|(_, weight)| *weight != 0.0) {
            let mut values = vec![0.0; out.len()];
            chroma_row(frame, i, j, &mut values)?;
            out.iter_mut().zip(&values).for_each(|(v, c)| *v += weight * signal(*c, self.chroma));
        }
        Some(())
    }
}

/// Row `j` of a plane.
fn samples(frame: &Frame, i: usize, j: usize, out: &mut [f32]) -> Option<()> {
    if let Some(plane) = frame.plane8(i) {
        out.iter_mut().zip(plane.row(j)).for_each(|(to, v)| *to = f32::from(*v));
    } else {
        out.iter_mut().zip(frame.plane16(i)?.row(j)).for_each(|(to, v)| *to = f32::from(*v));
    }
    Some(())
}

/// Chroma along luma row `j`, between its own samples.
fn chroma_row(frame: &Frame, i: usize, j: usize, out: &mut [f32]) -> Option<()> {
    let (shift_x, shift_y) = frame.format.subsampling(i);
    let (width, height) = frame.format.plane_size(i, frame.width, frame.height);
    let [offset_x, offset_y] = frame.color.chroma_offset;
    let (above, below, t) = between(j, shift_y, offset_y, height);
    let (mut first, mut second) = (vec![0.0; width], vec![0.0; width]);
    samples(frame, i, above, &mut first)?;
    samples(frame, i, below, &mut second)?;
    first.iter_mut().zip(&second).for_each(|(a, b)| *a += (b - *a) * t);
    for (x, v) in out.iter_mut().enumerate() {
        let (left, right, s) = between(x, shift_x, offset_x, width);
        *v = first[left] + (first[right] - first[left]) * s;
    }
    Some(())
}

/// The two of `count` samples around luma sample `k`, and the way from the first to the second.
fn between(k: usize, shift: u32, offset: f32, count: usize) -> (usize, usize, f32) {
    if shift == 0 {
        return (k, k, 0.0);
    }
    let at = ((k as f32 - offset) / (1 << shift) as f32).clamp(0.0, (count - 1) as f32);
    let first = at as usize;
    (first, (first + 1).min(count - 1), at - first as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn yuv(layout: Layout, bits: u8, full: bool, value: [u16; 3]) -> Frame {
        let mut frame = Frame::new(PixelFormat::opaque(layout, bits), 7, 5);
        frame.color.full_range = Some(full);
        for (i, v) in value.into_iter().enumerate() {
            let (w, h) = frame.format.plane_size(i, 7, 5);
            for (y, x) in (0..h).flat_map(|y| (0..w).map(move |x| (y, x))) {
                if bits == 8 {
                    frame.plane8_mut(i).expect("8 bit").row_mut(y)[x] = v as u8;
                } else {
                    frame.plane16_mut(i).expect("deep").row_mut(y)[x] = v;
                }
            }
        }
        frame
    }

    /// Red, green and blue of the last pixel.
    fn color(frame: &Frame) -> [u16; 3] {
        [2, 0, 1].map(|i| {
            frame.plane8(i).map_or_else(|| frame.plane16(i).expect("16 bit").row(4)[6], |p| p.row(4)[6].into())
        })
    }

    #[test]
    fn black_white_and_red_come_out_at_every_depth_and_range() {
        let of = |bits, full, value| color(&rgb_frame(&yuv(Layout::Yuv420, bits, full, value)).expect("BT.601"));
        assert_eq!(of(8, false, [16, 128, 128]), [0, 0, 0]);
        assert_eq!(of(8, false, [235, 128, 128]), [255, 255, 255]);
        assert_eq!(of(8, true, [255, 128, 128]), [255, 255, 255]);
        assert_eq!(of(10, true, [1023, 512, 512]), [65_535, 65_535, 65_535]);
        // BT.601 red at studio range is (81, 90, 240).
        let [r, g, b] = of(8, false, [81, 90, 240]);
        assert!(r >= 253 && g <= 2 && b <= 2, "{r} {g} {b}");
    }

    #[test]
    fn chroma_is_linear_between_its_sites() {
        let mut frame = yuv(Layout::Yuv422, 8, true, [128, 128, 128]);
        for x in 0..4 {
            for y in 0..5 {
                frame.plane8_mut(2).expect("8 bit").row_mut(y)[x] = 100 + 20 * x as u8;
            }
        }
        frame.color.chroma_offset = [0.0, 0.5];
        let rgb = rgb_frame(&frame).expect("BT.601");
        let red: Vec<i32> = rgb.plane8(2).expect("8 bit").row(2).iter().map(|v| i32::from(*v)).collect();
        // 20 of chroma per two pixels are 14 of red per pixel.
        assert!(red.windows(2).take(5).all(|w| (w[1] - w[0] - 14).abs() <= 1), "{red:?}");
    }
}
