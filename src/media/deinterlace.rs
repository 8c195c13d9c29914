//! Deinterlacing at the frame rate: the earlier field is kept, the lines of the other one are rebuilt.
//!
//! A line of the later field shows the scene half a frame later; in shaky video it does not fit the lines around it. With
//! `c` the current frame, `p` the one before, and line `y` to be rebuilt between kept lines `y ± 1`:
//!
//! ```text
//! still(x, y)  =  max( |c(x,y) − p(x,y)|, |c(x,y−1) − p(x,y−1)|, |c(x,y+1) − p(x,y+1)| )  <  τ
//! d*           =  argmin over d ∈ {0, −1, 1} of  Σᵢ |c(x+i+d, y−1) − c(x+i−d, y+1)|,  i ∈ {−1, 0, 1}
//! out(x, y)    =  c(x, y)                                          where still,
//!                 ½ ( c(x+d*, y−1) + c(x−d*, y+1) )                elsewhere
//! ```
//!
//! That is weaving where nothing moves and edge-based line averaging elsewhere, each plane on its own. Frames that are not
//! flagged as interlaced pass untouched, so mixed material keeps its whole pictures.
//!
//! # Reference
//! G. de Haan, E. B. Bellers, *Deinterlacing — An Overview*, Proceedings of the IEEE 86(9), 1998: sections on motion-adaptive
//! methods and on edge-dependent (ELA) interpolation.

use super::Deinterlace;
use super::av::PlanarFrame;
use crate::image::{FrameBuffer, PixelFormat};

/// Change below which a place counts as still, as a fraction of the full range. Camera noise is about 1 %; smaller makes
/// still areas lose vertical detail, larger lets slow motion comb.
const STILL: f32 = 0.015;

/// Rebuilds pictures from their earlier field.
pub(super) struct Deinterlacer {
    mode: Deinterlace,
    previous: Option<PlanarFrame>,
}

impl Deinterlacer {
    pub(super) fn new(mode: Deinterlace) -> Self {
        Self { mode, previous: None }
    }

    pub(super) fn refuses(&self) -> bool {
        self.mode == Deinterlace::Refuse
    }

    pub(super) fn is_active(&self) -> bool {
        self.mode == Deinterlace::Auto
    }

    /// A picture that is whole already.
    pub(super) fn whole(&mut self, picture: PlanarFrame) -> PlanarFrame {
        self.previous = None;
        picture
    }

    /// The picture of the earlier field of `current`, written into `out`, a blank picture of the same format.
    pub(super) fn field(&mut self, current: PlanarFrame, top_first: bool, mut out: PlanarFrame) -> PlanarFrame {
        let format = current.format();
        let size = current.frame().size();
        for i in 0..format.planes() {
            let (w, h) = format.plane_size(i, size.0, size.1);
            let before = self.previous.as_ref().map(|p| p.plane(i));
            let Some(target) = out.plane_mut(i) else { return current };
            rebuild_plane(current.plane(i), before, target, (w, h), format, usize::from(top_first));
        }
        self.previous = Some(current);
        out
    }
}

/// Lines of one parity (`rebuilt`: 1 keeps the first line) are rebuilt, the others copied.
fn rebuild_plane(
    current: (&[u8], usize),
    before: Option<(&[u8], usize)>,
    (out, out_stride): (&mut [u8], usize),
    (w, h): (usize, usize),
    format: PixelFormat,
    rebuilt: usize,
) {
    let bytes = format.bytes_per_sample();
    let row = |plane: (&[u8], usize), y: usize| -> Vec<u16> {
        let row = &plane.0[y * plane.1..][..w * bytes];
        match bytes {
            1 => row.iter().map(|v| u16::from(*v)).collect(),
            _ => row.as_chunks::<2>().0.iter().map(|v| u16::from_ne_bytes(*v)).collect(),
        }
    };
    let still = (STILL * f32::from(u16::MAX >> (16 - format.bits))) as u16;
    for y in 0..h {
        let own = row(current, y);
        let line = if y % 2 != rebuilt || h < 2 {
            own
        } else {
            let (above, below) = (if y > 0 { y - 1 } else { 1 }, if y + 1 < h { y + 1 } else { y - 1 });
            let now = [row(current, above), own, row(current, below)];
            let then = before.map(|p| [row(p, above), row(p, y), row(p, below)]);
            rebuild_line(&now, then.as_ref(), still)
        };
        let target = &mut out[y * out_stride..][..w * bytes];
        match bytes {
            1 => target.iter_mut().zip(&line).for_each(|(t, v)| *t = *v as u8),
            _ => target.as_chunks_mut::<2>().0.iter_mut().zip(&line).for_each(|(t, v)| *t = v.to_ne_bytes()),
        }
    }
}

/// The middle one of three lines, from its neighbors, or from itself where nothing moved since `then`.
fn rebuild_line(now: &[Vec<u16>; 3], then: Option<&[Vec<u16>; 3]>, still: u16) -> Vec<u16> {
    let [above, own, below] = now;
    let is_still = |x: usize| then.is_some_and(|then| (0..3).all(|i| now[i][x].abs_diff(then[i][x]) < still));
    (0..own.len()).map(|x| if is_still(x) { own[x] } else { edge_average(above, below, x) }).collect()
}

/// Average along the direction in which the lines above and below agree best; straight down on a tie.
fn edge_average(above: &[u16], below: &[u16], x: usize) -> u16 {
    // Samples x − 2 to x + 2, the line's ends repeated.
    let around = |line: &[u16]| [0, 1, 2, 3, 4].map(|i| u32::from(line[(x + i).saturating_sub(2).min(line.len() - 1)]));
    let (a, b) = (around(above), around(below));
    let cost = |d: usize| -> u32 { (1..=3).map(|i| a[i + d - 1].abs_diff(b[i + 1 - d])).sum() };
    let d = [1, 0, 2].into_iter().min_by_key(|d| cost(*d)).unwrap_or(1); // d − 1 is the direction
    (a[1 + d] + b[3 - d]).div_ceil(2) as u16
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_diagonal_edge_is_continued_and_not_blurred() {
        let above = [0, 0, 0, 0, 100, 100, 100, 100];
        let below = [0, 0, 100, 100, 100, 100, 100, 100];
        let line: Vec<u16> = (0..8).map(|x| edge_average(&above, &below, x)).collect();
        assert_eq!(line, [0, 0, 0, 100, 100, 100, 100, 100]);
    }

    #[test]
    fn still_places_are_woven_and_moving_ones_interpolated() {
        let now = [vec![10, 10, 10, 10], vec![50, 50, 90, 90], vec![10, 10, 10, 10]];
        let then = [vec![10, 10, 10, 10], vec![50, 50, 50, 50], vec![10, 10, 10, 10]];
        assert_eq!(rebuild_line(&now, Some(&then), 4), [50, 50, 10, 10]);
        assert_eq!(rebuild_line(&now, None, 4), [10, 10, 10, 10]);
    }

    #[test]
    fn lines_of_the_earlier_field_are_kept_bit_for_bit() {
        let format = PixelFormat::opaque(crate::image::Layout::Gray, 8);
        let current: Vec<u8> = (0..5 * 4).map(|i| (i * 37 % 251) as u8).collect();
        for (rebuilt, kept) in [(1, [0, 2, 4]), (0, [1, 3, 3])] {
            let mut out = vec![0; current.len()];
            rebuild_plane((&current, 4), None, (&mut out, 4), (4, 5), format, rebuilt);
            for y in kept {
                assert_eq!(out[y * 4..][..4], current[y * 4..][..4]);
            }
            assert_ne!(out[rebuilt * 4..][..4], current[rebuilt * 4..][..4]);
        }
    }
}
