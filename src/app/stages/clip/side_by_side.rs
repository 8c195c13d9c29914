//! Original and result in one picture, side by side as a player shows them.
//!
//! A picture takes a slot of `⌈W / c⌉·c` px, with `c` the width of a chroma sample in luma pixels, so that the right
//! picture begins on a chroma sample too and both are copied sample by sample in every plane. Even sizes have no gap; beside
//! an odd one, the last column is repeated up to the end of its slot.
//!
//! With `θ` the clockwise rotation that the player applies after an optional mirroring `s = ±1` of the coded x axis, coded +x
//! is shown along `s·(cos θ, sin θ)` and coded +y along `(−sin θ, cos θ)`. The slots follow the coded axis that is shown
//! horizontally, the original where that axis is shown on the left.

use plumbline_image::{Frame, PixelFormat};
use plumbline_media::VideoInfo;

/// Where the two pictures lie in the joined one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct SideBySide {
    /// Width and height that one picture takes, px.
    slot: (usize, usize),
    /// The slots follow each other down the coded picture, not across it.
    stacked: bool,
    /// The original comes first on the coded axis.
    original_first: bool,
}

impl SideBySide {
    /// The arrangement for pictures of this video.
    pub(crate) fn of(video: &VideoInfo) -> Self {
        Self::arranged((video.width, video.height), video.format, video.rotation_deg, video.mirrored)
    }

    fn arranged((width, height): (usize, usize), format: PixelFormat, rotation_deg: f64, mirrored: bool) -> Self {
        let (sin, cos) = rotation_deg.to_radians().sin_cos();
        let stacked = sin.abs() > cos.abs();
        let across = if mirrored { -cos } else { cos };
        let original_first = if stacked { sin < 0.0 } else { across > 0.0 };
        let cell = |axis: fn((u32, u32)) -> u32| {
            (0..format.planes()).map(|i| 1_usize << axis(format.subsampling(i))).max().unwrap_or(1)
        };
        let slot = if stacked {
            (width, height.next_multiple_of(cell(|(_, y)| y)))
        } else {
            (width.next_multiple_of(cell(|(x, _)| x)), height)
        };
        Self { slot, stacked, original_first }
    }

    /// The video that joined frames make of `video`.
    pub(crate) fn video(&self, video: &VideoInfo) -> VideoInfo {
        let (across, down) = self.times();
        let mut joined = video.clone();
        (joined.width, joined.height) = (across * self.slot.0, down * self.slot.1);
        joined
    }

    /// Slots across and down the coded picture.
    fn times(&self) -> (usize, usize) {
        if self.stacked { (1, 2) } else { (2, 1) }
    }

    /// Copies both pictures into `joined`, which takes over time and color of the result; false where it is shared memory.
    pub(crate) fn join(&self, original: &Frame, result: &Frame, joined: &mut Frame) -> bool {
        joined.copy_properties(result);
        let second = if self.stacked { (0, self.slot.1) } else { (self.slot.0, 0) };
        let (at_original, at_result) = if self.original_first { ((0, 0), second) } else { (second, (0, 0)) };
        paste(original, joined, at_original, self.slot) && paste(result, joined, at_result, self.slot)
    }
}

/// Copies `from` to the position `at` of `to` and repeats its last column and row up to the end of `slot`, all in luma px.
/// False where the memory of `to` is shared. `at` must lie on a chroma sample, and the slot inside `to`.
pub(crate) fn paste(from: &Frame, to: &mut Frame, at: (usize, usize), slot: (usize, usize)) -> bool {
    let bytes = from.format.bytes_per_sample();
    for i in 0..from.format.planes() {
        let (width, height) = from.format.plane_size(i, from.width, from.height);
        let (slot_width, slot_height) = from.format.plane_size(i, slot.0, slot.1);
        let (shift_x, shift_y) = from.format.subsampling(i);
        let (x, y) = ((at.0 >> shift_x) * bytes, at.1 >> shift_y);
        let (source, source_stride) = from.buffer().plane(i);
        let Some((target, stride)) = to.buffer_mut().plane_mut(i) else { return false };
        for row in 0..slot_height {
            let source = &source[row.min(height - 1) * source_stride..][..width * bytes];
            let target = &mut target[(y + row) * stride + x..][..slot_width * bytes];
            let (picture, rest) = target.split_at_mut(width * bytes);
            picture.copy_from_slice(source);
            rest.chunks_exact_mut(bytes).for_each(|sample| sample.copy_from_slice(&source[(width - 1) * bytes..]));
        }
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;
    use plumbline_image::Layout;

    fn beside(size: (usize, usize), layout: Layout, rotation_deg: f64, mirrored: bool) -> SideBySide {
        SideBySide::arranged(size, PixelFormat::opaque(layout, 8), rotation_deg, mirrored)
    }

    /// Samples that encode picture, plane and position.
    fn picture(format: PixelFormat, (width, height): (usize, usize), mark: usize) -> Frame {
        let mut frame = Frame::new(format, width, height);
        for i in 0..format.planes() {
            let (w, h) = format.plane_size(i, width, height);
            let at = |x: usize, y: usize| mark + 50 * i + 7 * y + x;
            for y in 0..h {
                for x in 0..w {
                    if let Some(mut plane) = frame.plane8_mut(i) {
                        plane.row_mut(y)[x] = at(x, y) as u8;
                    } else if let Some(mut plane) = frame.plane16_mut(i) {
                        plane.row_mut(y)[x] = at(x, y) as u16;
                    }
                }
            }
        }
        frame
    }

    /// Sample `(x, y)` of plane `i`.
    fn sample(frame: &Frame, i: usize, x: usize, y: usize) -> u16 {
        frame.plane8(i).map_or_else(|| frame.plane16(i).expect("16 bit").row(y)[x], |p| u16::from(p.row(y)[x]))
    }

    #[test]
    fn both_pictures_stand_in_the_joined_one_sample_by_sample_at_any_size_and_depth() {
        let layouts = [Layout::Gray, Layout::Yuv420, Layout::Yuv422, Layout::Yuv440, Layout::Yuv411, Layout::Yuv444];
        for (layout, bits, (w, h)) in layouts.iter().flat_map(|l| [(*l, 8, (8, 6)), (*l, 8, (7, 5)), (*l, 10, (5, 3))])
        {
            for rotation in [0.0, 90.0, 180.0, -90.0] {
                let format = PixelFormat::opaque(layout, bits);
                let (original, result) = (picture(format, (w, h), 1), picture(format, (w, h), 101));
                let beside = SideBySide::arranged((w, h), format, rotation, false);
                let (across, down) = beside.times();
                let mut joined = Frame::new(format, across * beside.slot.0, down * beside.slot.1);
                assert!(beside.join(&original, &result, &mut joined));
                let second = if beside.stacked { (0, beside.slot.1) } else { (beside.slot.0, 0) };
                let positions = if beside.original_first { [(0, 0), second] } else { [second, (0, 0)] };
                for (i, (picture, at)) in
                    (0..format.planes()).flat_map(|i| [(i, (&original, positions[0])), (i, (&result, positions[1]))])
                {
                    let (shift_x, shift_y) = format.subsampling(i);
                    assert_eq!(((at.0 >> shift_x) << shift_x, (at.1 >> shift_y) << shift_y), at, "on a chroma sample");
                    let (pw, ph) = format.plane_size(i, w, h);
                    for (x, y) in (0..ph).flat_map(|y| (0..pw).map(move |x| (x, y))) {
                        let there = sample(&joined, i, x + (at.0 >> shift_x), y + (at.1 >> shift_y));
                        assert_eq!(
                            there,
                            sample(picture, i, x, y),
                            "{layout:?} {bits} {rotation}: plane {i} ({x}, {y})"
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn an_even_size_is_doubled_exactly_and_the_gap_beside_an_odd_one_repeats_its_edge() {
        assert_eq!(beside((8, 5), Layout::Yuv420, 0.0, false).slot, (8, 5));
        assert_eq!(beside((7, 5), Layout::Yuv420, 0.0, false).slot, (8, 5));
        assert_eq!(beside((7, 5), Layout::Yuv444, 0.0, false).slot, (7, 5));
        assert_eq!(beside((7, 5), Layout::Yuv420, 90.0, false).slot, (7, 6));
        let format = PixelFormat::opaque(Layout::Yuv420, 8);
        let (original, result) = (picture(format, (7, 5), 1), picture(format, (7, 5), 101));
        let mut joined = Frame::new(format, 16, 5);
        assert!(beside((7, 5), Layout::Yuv420, 0.0, false).join(&original, &result, &mut joined));
        for y in 0..5 {
            assert_eq!(sample(&joined, 0, 7, y), sample(&original, 0, 6, y));
            assert_eq!(sample(&joined, 0, 15, y), sample(&result, 0, 6, y));
        }
    }

    #[test]
    fn the_original_is_shown_on_the_left_whatever_the_turn() {
        for (rotation, mirrored, stacked, original_first) in [
            (0.0, false, false, true),
            (180.0, false, false, false),
            (0.0, true, false, false),
            (180.0, true, false, true),
            (90.0, false, true, false),
            (-90.0, false, true, true),
        ] {
            let it = beside((8, 6), Layout::Yuv420, rotation, mirrored);
            assert_eq!((it.stacked, it.original_first), (stacked, original_first), "{rotation} {mirrored}");
        }
    }
}
