//! Image pyramids: each level half the size of the one below, smoothed by the 5-tap binomial.
//!
//! ```text
//! I_{l+1}(x, y) = Σ_{i,j = −2..2} w_i w_j I_l(2x + i, 2y + j),      w = (1, 4, 6, 4, 1) / 16,
//! ```
//!
//! rounded to the nearest 8-bit value. Sample `x` of level `l` stands over sample `2ˡ x` of level 0. Every level carries a
//! border of [`PADDING`] px, mirrored about its edge samples, so that windows that reach over the edge need no special case.
//! The sums are those of OpenCV's `pyrDown`, bit for bit.
//!
//! # Reference
//! P. Burt and E. Adelson, *The Laplacian Pyramid as a Compact Image Code*, IEEE Trans. Communications 31(4), 1983.
#![allow(clippy::cast_possible_wrap)] // indices of pixels are far below 2⁶³

use super::PlaneRef;
use super::simd::multiversion;

/// Width of the mirrored border around every level, px.
///
/// A 21 px window may be centered a few px outside and is read in vectors of 32 px; 32 on every side covers both and keeps
/// rows on multiples of 32 bytes.
pub const PADDING: usize = 32;

/// An 8-bit image with a mirrored border of [`PADDING`] px.
#[derive(Clone, Debug, Default)]
pub struct PaddedPlane {
    /// Pairs of samples, so that the reduction may read even and odd ones as one number.
    pairs: Vec<u16>,
    width: usize,
    height: usize,
    stride: usize,
}

impl PaddedPlane {
    /// Width without the border, px.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Height without the border, px.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Distance between the starts of two rows, samples.
    pub fn stride(&self) -> usize {
        self.stride
    }

    /// Row `y` without the border.
    pub fn row(&self, y: usize) -> &[u8] {
        assert!(y < self.height, "row {y} of a plane of {} rows", self.height);
        let start = self.index(0, y as isize);
        &self.data()[start..start + self.width]
    }

    /// The image without its border.
    pub fn interior(&self) -> PlaneRef<'_, u8> {
        let view = PlaneRef::new(&self.data()[self.index(0, 0)..], self.width, self.height, self.stride);
        view.expect("the border holds more than the last row needs")
    }

    /// All samples from `(x, y)` on, in rows of [`Self::stride`]; both may be as low as `−PADDING`.
    pub fn from(&self, x: isize, y: isize) -> &[u8] {
        &self.data()[self.index(x, y)..]
    }

    fn data(&self) -> &[u8] {
        bytemuck::cast_slice(&self.pairs)
    }

    fn data_mut(&mut self) -> &mut [u8] {
        bytemuck::cast_slice_mut(&mut self.pairs)
    }

    /// Pairs of samples from `(2x, y)` on, the even one in the low byte.
    fn pairs_from(&self, x: isize, y: isize) -> &[u16] {
        &self.pairs[self.index(2 * x, y) / 2..]
    }

    fn index(&self, x: isize, y: isize) -> usize {
        let p = PADDING as isize;
        assert!(x >= -p && y >= -p, "({x}, {y}) lies beyond the border of {p} px");
        (y + p) as usize * self.stride + (x + p) as usize
    }

    /// Takes another size; the samples are unspecified afterwards, the allocation is kept where it suffices.
    fn resize(&mut self, width: usize, height: usize) {
        self.width = width;
        self.height = height;
        self.stride = (width + 2 * PADDING).next_multiple_of(32);
        self.pairs.resize(self.stride * (height + 2 * PADDING) / 2, 0);
    }

    fn row_mut(&mut self, y: usize) -> &mut [u8] {
        let start = self.index(0, y as isize);
        let end = start + self.width;
        &mut self.data_mut()[start..end]
    }

    /// Writes the mirrored border left and right of row `y`.
    fn mirror_sides(&mut self, y: usize) {
        let (w, p, stride) = (self.width, PADDING, self.stride);
        let row = &mut self.data_mut()[(y + p) * stride..(y + p + 1) * stride];
        for k in 1..=p {
            row[p - k] = row[p + mirrored(-(k as isize), w)];
        }
        for x in p + w..row.len() {
            row[x] = row[p + mirrored(x as isize - p as isize, w)];
        }
    }

    /// Writes the mirrored border above and below, once the sides stand.
    fn mirror_ends(&mut self) {
        let (s, p) = (self.stride, PADDING);
        for k in 1..=p {
            let above = p + mirrored(-(k as isize), self.height);
            self.data_mut().copy_within(above * s..(above + 1) * s, (p - k) * s);
            let y = self.height + k - 1;
            let below = p + mirrored(y as isize, self.height);
            self.data_mut().copy_within(below * s..(below + 1) * s, (p + y) * s);
        }
    }
}

/// Index of the sample that stands for `i` when `n` samples are continued by reflection about the first and the last.
fn mirrored(i: isize, n: usize) -> usize {
    if n <= 1 {
        return 0;
    }
    let period = 2 * (n as isize - 1);
    let k = i.rem_euclid(period);
    k.min(period - k) as usize
}

/// Level 0 and its reductions.
#[derive(Clone, Debug, Default)]
pub struct Pyramid {
    levels: Vec<PaddedPlane>,
    /// Horizontally reduced rows, five at a time.
    ring: Vec<u16>,
}

impl Pyramid {
    /// An empty pyramid, to be filled by [`Self::rebuild`].
    pub fn new() -> Self {
        Self::default()
    }

    /// Fills the pyramid from `image` with at most `levels` levels; the allocations of an earlier image are used again.
    ///
    /// Levels stop before a side would fall under 2 px.
    pub fn rebuild(&mut self, image: PlaneRef<'_, u8>, levels: usize) {
        let fits = |l: &usize| *l == 0 || (image.width() >> l).min(image.height() >> l) >= 2;
        let count = (0..levels.max(1)).take_while(fits).count();
        self.levels.resize_with(count, PaddedPlane::default);
        self.levels[0].resize(image.width(), image.height());
        for y in 0..image.height() {
            self.levels[0].row_mut(y).copy_from_slice(image.row(y));
            self.levels[0].mirror_sides(y);
        }
        self.levels[0].mirror_ends();
        for l in 1..count {
            let (below, above) = self.levels.split_at_mut(l);
            reduce(&below[l - 1], &mut above[0], &mut self.ring);
        }
    }

    /// The levels, the finest first.
    pub fn levels(&self) -> &[PaddedPlane] {
        &self.levels
    }
}

/// Fills `out` with the reduction of `image`, borders included.
fn reduce(image: &PaddedPlane, out: &mut PaddedPlane, ring: &mut Vec<u16>) {
    out.resize(image.width.div_ceil(2), image.height.div_ceil(2));
    let w = out.width;
    ring.resize(5 * w, 0);
    let slot = |y: isize| (y + 5).rem_euclid(5) as usize * w;
    for y in -2..1 {
        reduce_row(image.pairs_from(-1, y), &mut ring[slot(y)..slot(y) + w]);
    }
    for y in 0..out.height {
        let center = 2 * y as isize;
        for k in [center + 1, center + 2] {
            reduce_row(image.pairs_from(-1, k), &mut ring[slot(k)..slot(k) + w]);
        }
        let rows = [-2, -1, 0, 1, 2].map(|k| &ring[slot(center + k)..slot(center + k) + w]);
        reduce_rows(rows, out.row_mut(y));
        out.mirror_sides(y);
    }
    out.mirror_ends();
}

multiversion! {
    /// Horizontal half of the reduction, 16 times the mean: `out[x]` from the pairs `x`, `x + 1` and the even of `x + 2`.
    fn reduce_row(pairs: &[u16], out: &mut [u16]) {
        let n = out.len();
        let (left, middle, right) = (&pairs[..n], &pairs[1..=n], &pairs[2..n + 2]);
        for x in 0..n {
            let [l, m, r] = [left[x], middle[x], right[x]].map(u16::to_le);
            out[x] = (l & 255) + (r & 255) + 4 * ((l >> 8) + (m >> 8)) + 6 * (m & 255);
        }
    }
}

multiversion! {
    /// Vertical half of the reduction with the rounding division by 256.
    fn reduce_rows(rows: [&[u16]; 5], out: &mut [u8]) {
        let [a, b, c, d, e] = rows.map(|r| &r[..out.len()]);
        for (x, out) in out.iter_mut().enumerate() {
            *out = ((a[x] + e[x] + 4 * (b[x] + d[x]) + 6 * c[x] + 128) >> 8) as u8;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Plane;

    fn noise(width: usize, height: usize) -> Plane<u8> {
        let mut rng = fastrand::Rng::with_seed(7);
        Plane::from_fn(width, height, |_, _| rng.u8(..))
    }

    fn built(image: &Plane<u8>, levels: usize) -> Pyramid {
        let mut pyramid = Pyramid::new();
        pyramid.rebuild(image.as_ref(), levels);
        pyramid
    }

    /// The formula of the module, without any of its shortcuts.
    fn by_definition(image: PlaneRef<'_, u8>, x: usize, y: usize) -> u8 {
        const W: [u32; 5] = [1, 4, 6, 4, 1];
        let mut sum = 128;
        for (j, wj) in W.iter().enumerate() {
            let row = image.row(mirrored(2 * y as isize + j as isize - 2, image.height()));
            for (i, wi) in W.iter().enumerate() {
                sum += wi * wj * u32::from(row[mirrored(2 * x as isize + i as isize - 2, image.width())]);
            }
        }
        (sum >> 8) as u8
    }

    #[test]
    fn every_level_is_the_binomial_reduction_of_the_one_below() {
        for (w, h) in [(64, 36), (33, 17), (5, 4), (101, 3)] {
            let pyramid = built(&noise(w, h), 4);
            for pair in pyramid.levels().windows(2) {
                let (below, above) = (pair[0].interior(), pair[1].interior());
                assert_eq!((above.width(), above.height()), (w_half(below.width()), w_half(below.height())));
                for y in 0..above.height() {
                    for x in 0..above.width() {
                        assert_eq!(above.row(y)[x], by_definition(below, x, y), "{w}×{h} at ({x}, {y})");
                    }
                }
            }
        }
    }

    fn w_half(n: usize) -> usize {
        n.div_ceil(2)
    }

    #[test]
    fn the_border_mirrors_the_image_about_its_edge_samples() {
        let image = noise(41, 9);
        let pyramid = built(&image, 1);
        let p = PADDING as isize;
        for (x, y) in [(-1, 0), (-p, -p), (40 + p, 8 + p), (0, 9), (41, 4), (-7, 12)] {
            let expected = image.as_ref().row(mirrored(y, 9))[mirrored(x, 41)];
            assert_eq!(pyramid.levels()[0].from(x, y)[0], expected, "({x}, {y})");
        }
    }

    #[test]
    fn a_flat_image_stays_flat_and_a_small_one_has_few_levels() {
        let pyramid = built(&Plane::from_fn(20, 9, |_, _| 255), 9);
        assert_eq!(pyramid.levels().len(), 3, "9 rows halve to 5, then to 3");
        assert!(pyramid.levels().iter().all(|l| (0..l.height()).all(|y| l.row(y).iter().all(|v| *v == 255))));
        assert_eq!(built(&noise(1, 1), 4).levels().len(), 1);
    }

    #[test]
    fn a_rebuilt_pyramid_forgets_the_image_before() {
        let (large, small) = (noise(80, 60), noise(31, 22));
        let mut pyramid = built(&large, 4);
        pyramid.rebuild(small.as_ref(), 3);
        let fresh = built(&small, 3);
        for (a, b) in pyramid.levels().iter().zip(fresh.levels()) {
            assert_eq!((a.width(), &a.pairs), (b.width(), &b.pairs));
        }
    }
}
