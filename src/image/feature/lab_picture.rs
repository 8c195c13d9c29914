//! The picture that judges importance: small, and in a space where distance is difference to the eye.
//!
//! Every plane is averaged over the source pixels that a small pixel covers (whole ones: the phase is off by less than a
//! source pixel), converted to R'G'B' and from there, as sRGB under D65, to CIE L\*a\*b\*. Other primaries and transfer
//! curves are taken for sRGB: analysis compares colors of one picture with each other.
//!
//! # Reference
//! CIE 15:2004, *Colorimetry*; IEC 61966-2-1 (sRGB).

use std::ops::Range;

use rayon::prelude::*;

use crate::simd::multiversion;
use crate::{Frame, Layout, Plane, PlaneRef, analysis_size};

/// `L*`, `a*` and `b*`, each divided by 100: `L*` in [0, 1], the others about within ±1.
#[derive(Clone, Debug)]
pub struct LabPicture {
    /// `[L*, a*, b*] / 100` per pixel, row-major.
    pixels: Vec<[f32; 3]>,
    width: usize,
    height: usize,
}

impl LabPicture {
    /// The picture with its longer side at most `max_side` px; `None` where the frame's memory does not hold its planes
    /// or a side is zero.
    pub fn of_frame(frame: &Frame, max_side: usize) -> Option<Self> {
        let SmallRgb { pixels, width, height } = SmallRgb::of_frame(frame, max_side)?;
        Some(Self { pixels: pixels.into_iter().map(lab_of_rgb).collect(), width, height })
    }

    /// A picture of `width × height` px whose R'G'B' values in [0, 1] are `rgb(x, y)`.
    pub fn from_fn(width: usize, height: usize, rgb: impl Fn(usize, usize) -> [f32; 3]) -> Self {
        let pixels = (0..width * height).map(|i| lab_of_rgb(rgb(i % width, i / width))).collect();
        Self { pixels, width, height }
    }

    /// Width, px.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Height, px.
    pub fn height(&self) -> usize {
        self.height
    }

    /// All pixels, row-major.
    pub fn pixels(&self) -> &[[f32; 3]] {
        &self.pixels
    }

    /// One of the three coordinates as a plane.
    pub fn channel(&self, c: usize) -> Plane<f32> {
        Plane::from_fn(self.width, self.height, |x, y| self.pixels[y * self.width + x][c])
    }
}

/// A picture made small, R'G'B' in [0, 1], row-major.
pub(super) struct SmallRgb {
    pub(super) pixels: Vec<[f32; 3]>,
    pub(super) width: usize,
    pub(super) height: usize,
}

impl SmallRgb {
    /// As [`LabPicture::of_frame`].
    pub(super) fn of_frame(frame: &Frame, max_side: usize) -> Option<Self> {
        if frame.width == 0 || frame.height == 0 {
            return None;
        }
        let (width, height) = analysis_size(frame.width, frame.height, max_side);
        let plane = |i: usize| shrunk(frame, i, width, height);
        let pixels = match frame.format.layout {
            Layout::Gray => plane(0)?.into_iter().map(|v| [v; 3]).collect(),
            Layout::Gbr => joined(&plane(0)?, &plane(1)?, &plane(2)?, |g, b, r| [r, g, b]),
            _ => joined(&plane(0)?, &plane(1)?, &plane(2)?, rgb_of_yuv),
        };
        Some(Self { pixels, width, height })
    }

    /// The pixel at a place; `None` outside.
    pub(super) fn at(&self, (x, y): (isize, isize)) -> Option<[f32; 3]> {
        let (x, y) = (usize::try_from(x).ok()?, usize::try_from(y).ok()?);
        (x < self.width && y < self.height).then(|| self.pixels[y * self.width + x])
    }
}

fn joined(a: &[f32], b: &[f32], c: &[f32], rgb: impl Fn(f32, f32, f32) -> [f32; 3]) -> Vec<[f32; 3]> {
    a.iter().zip(b).zip(c).map(|((&a, &b), &c)| rgb(a, b, c)).collect()
}

/// Rec. 709, limited range: of the matrices in use the middle one.
fn rgb_of_yuv(y: f32, u: f32, v: f32) -> [f32; 3] {
    let (y, u, v) = ((y * 255.0 - 16.0) / 219.0, (u * 255.0 - 128.0) / 224.0, (v * 255.0 - 128.0) / 224.0);
    [y + 1.5748 * v, y - 0.1873 * u - 0.4681 * v, y + 1.8556 * u].map(|c| c.clamp(0.0, 1.0))
}

/// Plane `i` averaged to `width × height` px, values in [0, 1].
fn shrunk(frame: &Frame, i: usize, width: usize, height: usize) -> Option<Vec<f32>> {
    let full = 1.0 / ((1_u32 << frame.format.bits) - 1) as f32;
    match frame.format.bytes_per_sample() {
        1 => frame.plane8(i).map(|p| averaged(p, add_bytes, (width, height), full)),
        _ => frame.plane16(i).map(|p| averaged(p, add_words, (width, height), full)),
    }
}

multiversion! {
    fn add_bytes(row: &[u8], sums: &mut [u32]) {
        sums.iter_mut().zip(row).for_each(|(sum, v)| *sum += u32::from(*v));
    }
}

multiversion! {
    fn add_words(row: &[u16], sums: &mut [u32]) {
        sums.iter_mut().zip(row).for_each(|(sum, v)| *sum += u32::from(*v));
    }
}

fn averaged<T: Sync>(
    plane: PlaneRef<'_, T>,
    add: impl Fn(&[T], &mut [u32]) + Sync,
    (width, height): (usize, usize),
    full: f32,
) -> Vec<f32> {
    let span = |k: usize, source: usize, count: usize| {
        let from = k * source / count;
        from..((k + 1) * source / count).max(from + 1)
    };
    let columns: Vec<Range<usize>> = (0..width).map(|x| span(x, plane.width(), width)).collect();
    let mut out = vec![0.0; width * height];
    let sums = || vec![0_u32; plane.width()];
    out.par_chunks_mut(width).enumerate().for_each_init(sums, |sums, (y, row)| {
        let rows = span(y, plane.height(), height);
        sums.fill(0);
        rows.clone().for_each(|source| add(plane.row(source), sums));
        for (out, columns) in row.iter_mut().zip(&columns) {
            let area = (columns.len() * rows.len()) as f32;
            *out = sums[columns.clone()].iter().map(|&s| s as f32).sum::<f32>() * full / area;
        }
    });
    out
}

fn lab_of_rgb(rgb: [f32; 3]) -> [f32; 3] {
    let [r, g, b] = rgb.map(|v| if v <= 0.040_45 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) });
    let f = |t: f32| if t > 0.008_856 { t.cbrt() } else { 7.787 * t + 16.0 / 116.0 };
    let x = f((0.4124 * r + 0.3576 * g + 0.1805 * b) / 0.9505);
    let y = f(0.2126 * r + 0.7152 * g + 0.0722 * b);
    let z = f((0.0193 * r + 0.1192 * g + 0.9505 * b) / 1.089);
    [1.16 * y - 0.16, 5.0 * (x - y), 2.0 * (y - z)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::PixelFormat;

    #[test]
    fn the_corners_of_srgb_have_their_published_lab_values() {
        for (rgb, lab) in [
            ([1.0, 1.0, 1.0], [1.0, 0.0, 0.0]),
            ([0.0, 0.0, 0.0], [0.0, 0.0, 0.0]),
            ([1.0, 0.0, 0.0], [0.5324, 0.8009, 0.6720]),
            ([0.0, 1.0, 0.0], [0.8773, -0.8618, 0.8318]),
            ([0.0, 0.0, 1.0], [0.3230, 0.7919, -1.0786]),
        ] {
            let found = lab_of_rgb(rgb);
            let error = found.iter().zip(lab).map(|(a, b): (&f32, f32)| (a - b).abs()).fold(0.0, f32::max);
            assert!(error < 1e-3, "{rgb:?}: {found:?}, published {lab:?}");
        }
    }

    #[test]
    fn depth_and_layout_do_not_change_the_picture() {
        let mut deep = Frame::new(PixelFormat::opaque(Layout::Gbr, 16), 40, 30);
        let mut flat = Frame::new(PixelFormat::opaque(Layout::Gbr, 8), 40, 30);
        for i in 0..3 {
            for y in 0..30 {
                for x in 0..40 {
                    let v = ((x * 5 + y * 3 + i * 40) % 256) as u8;
                    flat.plane8_mut(i).expect("own").row_mut(y)[x] = v;
                    deep.plane16_mut(i).expect("own").row_mut(y)[x] = u16::from(v) * 257;
                }
            }
        }
        let [a, b] = [deep, flat].map(|f| LabPicture::of_frame(&f, 20).expect("has planes"));
        assert_eq!((a.width(), a.height()), (20, 15));
        let close = |(a, b): (&[f32; 3], &[f32; 3])| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-4);
        assert!(a.pixels().iter().zip(b.pixels()).all(close));
    }

    #[test]
    fn an_average_is_over_the_pixels_covered() {
        let mut frame = Frame::new(PixelFormat::opaque(Layout::Gray, 8), 8, 8);
        frame.plane8_mut(0).expect("own").row_mut(3)[5] = 255;
        let small = shrunk(&frame, 0, 4, 4).expect("one plane");
        let expected: Vec<f32> = (0..16).map(|i| if i == 6 { 0.25 } else { 0.0 }).collect();
        assert_eq!(small, expected);
    }
}
