//! The picture that analysis looks at: 8-bit luma, area-averaged to a small size.
//!
//! ```text
//! out(x, y) = mean of luma over [x·sx, (x+1)·sx) × [y·sy, (y+1)·sy),      sx = W/w,  sy = H/h
//! ```
//!
//! Code values are kept as they are (limited range stays limited, transfer curves stay): tracking compares pictures of one
//! clip with each other and does not care. Depths above 8 bit lose their low bits. Green, blue and red are mixed with the
//! weights of Rec. 709. The scale is exact per axis, `sx` and `sy`, and the two differ by less than half an output pixel
//! over the side.

use super::simd::multiversion;
use super::{Frame, Layout, Plane, PlaneRef};

/// Rec. 709 luma weights in the order of the planes (green, blue, red), in 1/65536; they sum to 65536.
const GBR_WEIGHTS: [u32; 3] = [46_871, 4_732, 13_933];

/// Size of the analysis picture of a `width×height` frame: the longer side at most `max_side` px, never enlarged.
pub fn analysis_size(width: usize, height: usize, max_side: usize) -> (usize, usize) {
    let longer = width.max(height);
    if longer <= max_side || max_side == 0 {
        return (width, height);
    }
    let scaled = |side: usize| ((side * max_side + longer / 2) / longer).max(1);
    (scaled(width), scaled(height))
}

/// Writes the analysis luma of `frame` into `out`, resized to [`analysis_size`]; an image px of `out` covers
/// `(frame.width / out.width, frame.height / out.height)` px of the frame.
///
/// Returns `false` and leaves `out` unspecified where the frame's memory does not hold its planes.
pub fn analysis_luma(frame: &Frame, max_side: usize, out: &mut Plane<u8>) -> bool {
    let (w, h) = analysis_size(frame.width, frame.height, max_side);
    out.resize(w, h);
    let shift = u32::from(frame.format.bits.saturating_sub(8));
    match (frame.format.layout, frame.format.bytes_per_sample()) {
        (Layout::Gbr, 1) => mixed8(|i| frame.plane8(i), out),
        (Layout::Gbr, _) => mixed(|i| frame.plane16(i), shift, out),
        (_, 1) => frame.plane8(0).is_some_and(|luma| shrink8(luma, out)),
        (_, _) => frame.plane16(0).is_some_and(|luma| shrink16(luma, shift, out)),
    }
}

/// A source of rows of `f32` luma: writes row `y` into the slice.
type Rows<'a> = dyn Fn(usize, &mut [f32]) + 'a;

fn luma_rows<T: Copy + Into<f32>>(plane: PlaneRef<'_, T>) -> impl Fn(usize, &mut [f32]) + '_ {
    move |y, out| {
        for (out, v) in out.iter_mut().zip(plane.row(y)) {
            *out = (*v).into();
        }
    }
}

fn mixed<'a, T: Copy + Into<f32> + 'a>(
    plane: impl Fn(usize) -> Option<PlaneRef<'a, T>>,
    shift: u32,
    out: &mut Plane<u8>,
) -> bool {
    let (Some(g), Some(b), Some(r)) = (plane(0), plane(1), plane(2)) else { return false };
    let [wg, wb, wr] = GBR_WEIGHTS.map(|w| w as f32 / 65_536.0);
    let rows = move |y: usize, out: &mut [f32]| {
        for (((out, g), b), r) in out.iter_mut().zip(g.row(y)).zip(b.row(y)).zip(r.row(y)) {
            *out = wg * (*g).into() + wb * (*b).into() + wr * (*r).into();
        }
    };
    shrink(&rows, shift, g.width(), g.height(), out)
}

/// [`mixed`] of 8-bit planes, which nearly all pictures are.
fn mixed8<'a>(plane: impl Fn(usize) -> Option<PlaneRef<'a, u8>>, out: &mut Plane<u8>) -> bool {
    let (Some(g), Some(b), Some(r)) = (plane(0), plane(1), plane(2)) else { return false };
    let rows = move |y: usize, out: &mut [f32]| mix_row8([g.row(y), b.row(y), r.row(y)], out);
    shrink(&rows, 0, g.width(), g.height(), out)
}

multiversion! {
    /// Luma of a row.
    fn mix_row8(gbr: [&[u8]; 3], out: &mut [f32]) {
        let [wg, wb, wr] = GBR_WEIGHTS.map(|w| w as f32 / 65_536.0);
        for (((out, g), b), r) in out.iter_mut().zip(gbr[0]).zip(gbr[1]).zip(gbr[2]) {
            *out = wg * f32::from(*g) + wb * f32::from(*b) + wr * f32::from(*r);
        }
    }
}

/// The whole number that both sides of `luma` are of those of `out`, where there is one.
fn whole_ratio<T>(luma: &PlaneRef<'_, T>, out: &Plane<u8>) -> Option<usize> {
    let ratio = luma.width() / out.width();
    let whole = ratio * out.width() == luma.width() && ratio * out.height() == luma.height();
    (whole && ratio <= MAX_RATIO).then_some(ratio)
}

/// Largest integer ratio whose column sums fit `u16` at 8 bit, and block sums `u32` at 16.
const MAX_RATIO: usize = 256;

/// Whole ratios, which is nearly every video, are summed as integers; the rest by general area weights.
fn shrink8(luma: PlaneRef<'_, u8>, out: &mut Plane<u8>) -> bool {
    match whole_ratio(&luma, out) {
        Some(ratio) => shrink_whole(luma, ratio, out),
        None => shrink(&luma_rows(luma), 0, luma.width(), luma.height(), out),
    }
}

fn shrink16(luma: PlaneRef<'_, u16>, shift: u32, out: &mut Plane<u8>) -> bool {
    let Some(ratio) = whole_ratio(&luma, out) else {
        return shrink(&luma_rows(luma), shift, luma.width(), luma.height(), out);
    };
    let mut sums = vec![0_u32; luma.width()];
    for y in 0..out.height() {
        sums.fill(0);
        (0..ratio).for_each(|k| add_row16(luma.row(ratio * y + k), &mut sums));
        let scale = 1.0 / (ratio * ratio) as f32 / (1_u32 << shift) as f32;
        for (out, block) in out.as_mut().row_mut(y).iter_mut().zip(sums.chunks_exact(ratio)) {
            *out = (block.iter().sum::<u32>() as f32 * scale + 0.5) as u8;
        }
    }
    true
}

multiversion! {
    fn add_row16(row: &[u16], sums: &mut [u32]) {
        for (sum, v) in sums.iter_mut().zip(row) {
            *sum += u32::from(*v);
        }
    }
}

fn shrink_whole(luma: PlaneRef<'_, u8>, ratio: usize, out: &mut Plane<u8>) -> bool {
    let mut sums = vec![0_u16; luma.width()];
    for y in 0..out.height() {
        let block = |k: usize| luma.row(ratio * y + k);
        let mut view = out.as_mut();
        let row = view.row_mut(y);
        match ratio {
            1 => row.copy_from_slice(block(0)),
            2 => mean_2(block(0), block(1), row),
            3 => mean_3([block(0), block(1), block(2)], &mut sums, row),
            _ => {
                sums.fill(0);
                (0..ratio).for_each(|k| add_row(block(k), &mut sums));
                mean_columns(&sums, ratio, row);
            }
        }
    }
    true
}

multiversion! {
    /// Rounded means of 2×2 blocks.
    fn mean_2(a: &[u8], b: &[u8], out: &mut [u8]) {
        for ((a, b), out) in a.chunks_exact(2).zip(b.chunks_exact(2)).zip(out) {
            let [a, b] = [a, b].map(|p| u16::from_le_bytes([p[0], p[1]]));
            *out = (((a & 255) + (a >> 8) + (b & 255) + (b >> 8) + 2) >> 2) as u8;
        }
    }
}

multiversion! {
    /// Rounded means of 3×3 blocks; `sums` is as long as the rows.
    fn mean_3(rows: [&[u8]; 3], sums: &mut [u16], out: &mut [u8]) {
        let [a, b, c] = rows.map(|r| &r[..sums.len()]);
        for (x, sum) in sums.iter_mut().enumerate() {
            *sum = u16::from(a[x]) + u16::from(b[x]) + u16::from(c[x]);
        }
        // ⌊(s + 4) / 9⌋ as a multiplication: exact for s ≤ 9·255, since 7282 = ⌈2¹⁶ / 9⌉.
        for (out, s) in out.iter_mut().zip(sums.chunks_exact(3)) {
            *out = ((u32::from(s[0] + s[1] + s[2] + 4) * 7282) >> 16) as u8;
        }
    }
}

multiversion! {
    fn add_row(row: &[u8], sums: &mut [u16]) {
        for (sum, v) in sums.iter_mut().zip(row) {
            *sum += u16::from(*v);
        }
    }
}

/// Rounded means of blocks whose columns are summed already.
fn mean_columns(sums: &[u16], ratio: usize, out: &mut [u8]) {
    let area = (ratio * ratio) as u32;
    for (out, block) in out.iter_mut().zip(sums.chunks_exact(ratio)) {
        *out = ((block.iter().map(|v| u32::from(*v)).sum::<u32>() + area / 2) / area) as u8;
    }
}

/// The source samples that an output sample covers: the first, and the weight of each.
struct Cover {
    first: usize,
    weights: Vec<f32>,
}

/// The covers of `count` output samples that share `n` source samples evenly.
fn covers(n: usize, count: usize) -> Vec<Cover> {
    let scale = n as f64 / count as f64;
    let cover = |i: usize| {
        let (from, to) = (i as f64 * scale, (i + 1) as f64 * scale);
        let (first, last) = (from.floor() as usize, (to.ceil() as usize).min(n));
        let weight = |k: usize| ((k as f64 + 1.0).min(to) - (k as f64).max(from)).max(0.0) as f32;
        Cover { first, weights: (first..last).map(weight).collect() }
    };
    (0..count).map(cover).collect()
}

/// Any ratio, any depth: rows weighted into one `f32` row, then columns.
fn shrink(rows: &Rows<'_>, shift: u32, width: usize, height: usize, out: &mut Plane<u8>) -> bool {
    let area = (width * height) as f64 / (out.width() * out.height()) as f64;
    let scale = (1.0 / (area * f64::from(1_u32 << shift))) as f32;
    // Two zeros behind the row for covers that are filled up to three samples.
    let (mut row, mut sums) = (vec![0_f32; width], vec![0_f32; width + 2]);
    let columns = covers(width, out.width());
    let longest = columns.iter().map(|cover| cover.weights.len()).max().unwrap_or(0);
    let three: Vec<(u32, [f32; 3])> =
        if longest <= 3 { columns.iter().map(Cover::three).collect() } else { Vec::new() };
    // The row that is in `row`: neighbors share the one between them.
    let mut known = usize::MAX;
    for (y, cover) in covers(height, out.height()).iter().enumerate() {
        sums.fill(0.0);
        for (k, weight) in cover.weights.iter().enumerate() {
            if known != cover.first + k {
                known = cover.first + k;
                rows(known, &mut row);
            }
            add_weighted(&row, *weight, &mut sums);
        }
        let mut view = out.as_mut();
        let line = view.row_mut(y).iter_mut();
        if three.is_empty() {
            for (out, cover) in line.zip(&columns) {
                let covered = &sums[cover.first..cover.first + cover.weights.len()];
                let sum: f32 = covered.iter().zip(&cover.weights).map(|(v, w)| v * w).sum();
                *out = (sum * scale + 0.5) as u8;
            }
        } else {
            for (out, (first, [a, b, c])) in line.zip(&three) {
                let covered = &sums[*first as usize..][..3];
                *out = ((covered[0] * a + covered[1] * b + covered[2] * c) * scale + 0.5) as u8;
            }
        }
    }
    true
}

impl Cover {
    /// At most three samples, the rest of weight 0.
    fn three(&self) -> (u32, [f32; 3]) {
        let weight = |k: usize| self.weights.get(k).copied().unwrap_or(0.0);
        (self.first as u32, [weight(0), weight(1), weight(2)])
    }
}

multiversion! {
    fn add_weighted(row: &[f32], weight: f32, sums: &mut [f32]) {
        for (sum, v) in sums.iter_mut().zip(row) {
            *sum += weight * v;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::PixelFormat;

    fn filled(layout: Layout, bits: u8, width: usize, height: usize, f: impl Fn(usize, usize, usize) -> u16) -> Frame {
        let mut frame = Frame::new(PixelFormat::opaque(layout, bits), width, height);
        for i in 0..frame.format.planes() {
            let (w, h) = frame.format.plane_size(i, width, height);
            for (y, x) in (0..h).flat_map(|y| (0..w).map(move |x| (y, x))) {
                let v = f(i, x, y);
                match bits {
                    8 => frame.plane8_mut(i).expect("8 bit").row_mut(y)[x] = v as u8,
                    _ => frame.plane16_mut(i).expect("deeper").row_mut(y)[x] = v,
                }
            }
        }
        frame
    }

    fn pattern(_: usize, x: usize, y: usize) -> u16 {
        ((x * 37 + y * 91 + x * y) % 256) as u16
    }

    /// Mean over the area of one output pixel by fine supersampling of the piecewise constant picture.
    fn by_definition(frame: &Frame, size: (usize, usize), x: usize, y: usize) -> f64 {
        const N: usize = 60;
        let luma = frame.plane8(0).expect("8 bit");
        let at = |k: usize, n: usize, from: usize, of: usize| {
            ((k as f64 + 0.5) / N as f64 + from as f64) * n as f64 / of as f64
        };
        let sum: f64 = (0..N * N)
            .map(|k| luma.row(at(k / N, frame.height, y, size.1) as usize)[at(k % N, frame.width, x, size.0) as usize])
            .map(f64::from)
            .sum();
        sum / (N * N) as f64
    }

    #[test]
    fn every_pixel_is_the_mean_of_the_area_it_covers() {
        for (w, h, side, exact) in
            [(60, 40, 60, true), (60, 40, 30, true), (90, 60, 30, true), (200, 80, 40, true), (100, 57, 64, false)]
        {
            let frame = filled(Layout::Yuv420, 8, w, h, pattern);
            let mut out = Plane::new(0, 0);
            assert!(analysis_luma(&frame, side, &mut out));
            let size = (out.width(), out.height());
            for (x, y) in [(0, 0), (7, 3), (size.0 - 1, size.1 - 1), (size.0 / 2, size.1 / 3)] {
                let (got, want) = (f64::from(out.as_ref().row(y)[x]), by_definition(&frame, size, x, y));
                let bound = if exact { 0.500_1 } else { 3.0 }; // the reference samples where an edge cuts a sample
                assert!((got - want).abs() <= bound, "{w}×{h} at ({x}, {y}): {got} against {want}");
            }
        }
    }

    #[test]
    fn whole_ratios_agree_with_the_general_path() {
        for (w, h, ratio) in [(64, 32, 1), (64, 32, 2), (99, 33, 3), (64, 36, 4), (70, 35, 5)] {
            let (frame, deep) = (
                filled(Layout::Gray, 8, w, h, pattern),
                filled(Layout::Gray, 12, w, h, |i, x, y| pattern(i, x, y) * 16),
            );
            let (luma, luma16) = (frame.plane8(0).expect("8 bit"), deep.plane16(0).expect("12 bit"));
            let mut whole = Plane::new(w / ratio, h / ratio);
            let (mut general, mut whole16) = (whole.clone(), whole.clone());
            assert!(shrink8(luma, &mut whole) && shrink(&luma_rows(luma), 0, w, h, &mut general));
            assert!(shrink16(luma16, 4, &mut whole16));
            assert!(whole == general && whole == whole16, "ratio {ratio}");
        }
    }

    #[test]
    fn depth_and_layout_do_not_change_the_picture() {
        let mut eight = Plane::new(0, 0);
        let mut other = Plane::new(0, 0);
        assert!(analysis_luma(&filled(Layout::Yuv420, 8, 96, 54, pattern), 48, &mut eight));
        for (layout, bits) in
            [(Layout::Yuv422, 10), (Layout::Yuv444, 16), (Layout::Gray, 12), (Layout::Gbr, 8), (Layout::Gbr, 12)]
        {
            let frame = filled(layout, bits, 96, 54, |i, x, y| pattern(i, x, y) << (bits - 8));
            assert!(analysis_luma(&frame, 48, &mut other));
            for y in 0..27 {
                for (a, b) in eight.as_ref().row(y).iter().zip(other.as_ref().row(y)) {
                    assert!(a.abs_diff(*b) <= 1, "{layout:?} {bits} bit: {a} against {b}");
                }
            }
        }
    }

    #[test]
    fn green_weighs_most_and_blue_least() {
        let mut out = Plane::new(0, 0);
        let levels = [0, 1, 2].map(|lit| {
            assert!(analysis_luma(&filled(Layout::Gbr, 8, 8, 8, |i, _, _| 255 * u16::from(i == lit)), 8, &mut out));
            out.as_ref().row(3)[3]
        });
        assert_eq!(levels, [182, 18, 54], "green, blue, red of Rec. 709");
    }

    #[test]
    fn the_longer_side_is_bounded_and_nothing_is_enlarged() {
        assert_eq!(analysis_size(1920, 1080, 640), (640, 360));
        assert_eq!(analysis_size(1080, 1920, 640), (360, 640));
        assert_eq!(analysis_size(320, 240, 640), (320, 240));
        assert_eq!(analysis_size(5000, 3, 640), (640, 1));
    }
}
