//! Deinterlacing at the frame rate: the earlier field is kept, the lines of the other one are rebuilt.
//!
//! A line of the later field shows the scene half a frame later; in shaky video it does not fit the lines around it. With
//! `c` the current frame, `p` the one before, and line `y` to be rebuilt between kept lines `y ± 1`, `y ± 3`:
//!
//! ```text
//! still(x, y)  =  max( |c(x,y) − p(x,y)|, |c(x,y−1) − p(x,y−1)|, |c(x,y+1) − p(x,y+1)| )  <  τ
//! d*           =  argmin over d ∈ {0, −1, 1} of  Σᵢ |c(x+i+d, y−1) − c(x+i−d, y+1)|,  i ∈ {−1, 0, 1}
//! out(x, y)    =  c(x, y)                                                                  where still,
//!                 ½ ( c(x+d*, y−1) + c(x−d*, y+1) )                                        where d* ≠ 0,
//!                 ( 9 c(x,y−1) + 9 c(x,y+1) − c(x,y−3) − c(x,y+3) ) / 16                   elsewhere
//! ```
//!
//! That is weaving where nothing moves, edge-based line averaging along diagonals, and the cubic through four lines of the
//! field elsewhere, each plane on its own. Frames that are not flagged as interlaced pass untouched unless told otherwise, so
//! mixed material keeps its whole pictures.
//!
//! # Reference
//! G. de Haan, E. B. Bellers, *Deinterlacing — An Overview*, Proceedings of the IEEE 86(9), 1998: sections on motion-adaptive
//! methods and on edge-dependent (ELA) interpolation.

use super::Deinterlace;
use super::av::PlanarFrame;
use plumbline_image::{FrameBuffer, PixelFormat};

/// Change, as a fraction of the full range, below which a pixel counts as static. Camera noise is about 1 %; smaller
/// loses vertical detail in static areas, larger lets slow motion comb.
const MOTION_THRESHOLD: f32 = 0.015;

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

    /// Whether flags are looked at.
    pub(super) fn trusts_flags(&self) -> bool {
        matches!(self.mode, Deinterlace::Auto | Deinterlace::Refuse)
    }

    /// The order of fields in a picture flagged `fields` (top field first), as far as it is to be deinterlaced.
    pub(super) fn order(&self, fields: Option<bool>) -> Option<bool> {
        match self.mode {
            Deinterlace::Auto => fields,
            Deinterlace::Top => Some(true),
            Deinterlace::Bottom => Some(false),
            Deinterlace::Off | Deinterlace::Refuse => None,
        }
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
    out: (&mut [u8], usize),
    size: (usize, usize),
    format: PixelFormat,
    rebuilt: usize,
) {
    let max = i32::from(u16::MAX >> (16 - format.bits));
    let limits = Limits { max, still: (MOTION_THRESHOLD * max as f32) as i32 };
    match format.bytes_per_sample() {
        1 => rebuild::<1>(current, before, out, size, limits, rebuilt),
        _ => rebuild::<2>(current, before, out, size, limits, rebuilt),
    }
}

/// Largest sample, and the change below which a pixel is static.
#[derive(Clone, Copy)]
struct Limits {
    max: i32,
    still: i32,
}

/// A line of samples of `B` bytes.
type Line<'a, const B: usize> = &'a [[u8; B]];

fn sample<const B: usize>(bytes: [u8; B]) -> i32 {
    if B == 1 { i32::from(bytes[0]) } else { i32::from(u16::from_ne_bytes([bytes[0], bytes[B - 1]])) }
}

fn rebuild<const B: usize>(
    current: (&[u8], usize),
    before: Option<(&[u8], usize)>,
    (out, out_stride): (&mut [u8], usize),
    (w, h): (usize, usize),
    limits: Limits,
    rebuilt: usize,
) {
    fn line<const B: usize>(plane: (&[u8], usize), y: usize, w: usize) -> Line<'_, B> {
        plane.0[y * plane.1..][..w * B].as_chunks::<B>().0
    }
    for y in 0..h {
        let target = out[y * out_stride..][..w * B].as_chunks_mut::<B>().0;
        if y % 2 != rebuilt || h < 2 {
            target.copy_from_slice(line(current, y, w));
            continue;
        }
        let (above, below) = (if y > 0 { y - 1 } else { 1 }, if y + 1 < h { y + 1 } else { y - 1 });
        let (far_above, far_below) = (if y >= 3 { y - 3 } else { above }, if y + 3 < h { y + 3 } else { below });
        let now = [far_above, above, y, below, far_below].map(|y| line(current, y, w));
        let then = before.map(|p| [above, y, below].map(|y| line(p, y, w)));
        rebuild_line(now, then, limits, target);
    }
}

/// The middle one of five lines, of which the first and last are the next but one of its field; `then`: the middle three, one
/// frame before.
fn rebuild_line<const B: usize>(
    now: [Line<'_, B>; 5],
    then: Option<[Line<'_, B>; 3]>,
    limits: Limits,
    out: &mut [[u8; B]],
) {
    let w = out.len();
    let [far_above, above, own, below, far_below] = now;
    let straight = |x: usize| {
        let near = 9 * (sample(above[x]) + sample(below[x]));
        ((near - sample(far_above[x]) - sample(far_below[x]) + 8) >> 4).clamp(0, limits.max)
    };
    let around = |line: Line<'_, B>, x: usize| {
        [0, 1, 2, 3, 4].map(|i: usize| sample(line[(x + i).saturating_sub(2).min(w - 1)]))
    };
    let inside = 2.min(w)..w.saturating_sub(2).max(2.min(w));
    for x in (0..inside.start).chain(inside.end..w) {
        put(&mut out[x], along_edge(around(above, x), around(below, x), straight(x)));
    }
    // The same without a bound to look at, which the compiler makes vectors of.
    let windows = above.windows(5).zip(below.windows(5));
    for ((x, target), (a, b)) in inside.clone().zip(&mut out[inside]).zip(windows) {
        let five = |w: &[[u8; B]]| [w[0], w[1], w[2], w[3], w[4]].map(sample);
        put(target, along_edge(five(a), five(b), straight(x)));
    }
    let Some(then) = then else { return };
    for (x, target) in out.iter_mut().enumerate() {
        let change = |now: Line<'_, B>, then: Line<'_, B>| (sample(now[x]) - sample(then[x])).abs();
        let most = change(above, then[0]).max(change(own, then[1])).max(change(below, then[2]));
        *target = if most < limits.still { own[x] } else { *target };
    }
}

fn put<const B: usize>(target: &mut [u8; B], value: i32) {
    let bytes = (value as u16).to_ne_bytes();
    *target = std::array::from_fn(|i| if B == 1 { value as u8 } else { bytes[i] });
}

/// The value between the third of five samples above and below: `straight`, or the mean along the diagonal on which the lines
/// agree better.
fn along_edge(a: [i32; 5], b: [i32; 5], straight: i32) -> i32 {
    let cost = |d: usize| (1..=3).map(|i| (a[i + d - 1] - b[i + 1 - d]).abs()).sum::<i32>();
    let mean = |d: usize| (a[1 + d] + b[3 - d] + 1) >> 1;
    let (left, down, right) = (cost(0), cost(1), cost(2)); // d − 1 is the direction
    let (best, diagonal) = if left < right { (left, mean(0)) } else { (right, mean(2)) };
    if best < down { diagonal } else { straight }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: Limits = Limits { max: 255, still: 4 };

    #[test]
    fn a_diagonal_edge_is_continued_and_not_blurred() {
        let above = [0, 0, 0, 0, 100, 100, 100, 100].map(|v| [v]);
        let below = [0, 0, 100, 100, 100, 100, 100, 100].map(|v| [v]);
        let mut line = [[7]; 8];
        rebuild_line([&above, &above, &[[50]; 8], &below, &below], None, LIMITS, &mut line);
        assert_eq!(line.map(|v| v[0]), [0, 0, 0, 100, 100, 100, 100, 100]);
    }

    #[test]
    fn static_pixels_are_woven_and_moving_ones_interpolated() {
        let flat = [[10]; 4];
        let (own, own_then) = ([50, 50, 90, 90].map(|v| [v]), [[50]; 4]);
        let mut line = [[0]; 4];
        rebuild_line([&flat, &flat, &own, &flat, &flat], Some([&flat, &own_then, &flat]), LIMITS, &mut line);
        assert_eq!(line.map(|v| v[0]), [50, 50, 10, 10]);
        rebuild_line([&flat, &flat, &own, &flat, &flat], None, LIMITS, &mut line);
        assert_eq!(line.map(|v| v[0]), [10; 4]);
    }

    #[test]
    fn a_parabola_down_the_column_is_met_exactly_and_nothing_leaves_the_range() {
        // Lines −3, −1, 1, 3 of 100 + y²; the cubic through them is 100 at 0.
        let [far, near] = [[[109]; 9], [[101]; 9]];
        let mut line = [[0]; 9];
        rebuild_line([&far, &near, &near, &near, &far], None, LIMITS, &mut line);
        assert_eq!(line, [[100]; 9]);
        let (dark, bright) = ([[0]; 9], [[255]; 9]);
        rebuild_line([&dark, &bright, &dark, &bright, &dark], None, LIMITS, &mut line);
        assert_eq!(line, [[255]; 9], "overshoot is cut off");
    }

    #[test]
    fn samples_of_two_bytes_are_treated_like_those_of_one() {
        let small: Vec<[u8; 1]> = (0..5 * 17_usize).map(|i| [(i * 37 % 251) as u8]).collect();
        let wide: Vec<[u8; 2]> = small.iter().map(|v| u16::from(v[0]).to_ne_bytes()).collect();
        let (mut a, mut b) = ([[0]; 17], [[0; 2]; 17]);
        let rows = [0, 17, 34, 51, 68];
        rebuild_line(rows.map(|i| &small[i..i + 17]), None, LIMITS, &mut a);
        rebuild_line(rows.map(|i| &wide[i..i + 17]), None, LIMITS, &mut b);
        assert_eq!(a.map(|v| u16::from(v[0])), b.map(u16::from_ne_bytes));
    }

    #[test]
    fn lines_of_the_earlier_field_are_kept_bit_for_bit() {
        let format = PixelFormat::opaque(plumbline_image::Layout::Gray, 8);
        for width in [1, 2, 4] {
            let current: Vec<u8> = (0..5 * width).map(|i| (i * 37 % 251) as u8).collect();
            for (rebuilt, kept) in [(1, [0, 2, 4]), (0, [1, 3, 3])] {
                let mut out = vec![0; current.len()];
                rebuild_plane((&current, width), None, (&mut out, width), (width, 5), format, rebuilt);
                for y in kept {
                    assert_eq!(out[y * width..][..width], current[y * width..][..width]);
                }
                assert_ne!(out[rebuilt * width..][..width], current[rebuilt * width..][..width]);
            }
        }
    }
}
