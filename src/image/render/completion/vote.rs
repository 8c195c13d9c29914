//! What patches say of the pixels they cover, small and in full size.

use super::level::Level;
use super::search::{Search, around};
use crate::Plane;
use plumbline_num::run::{Run, Stopped};

/// RMS difference of patches over all channels, as a fraction of the range, at which their weight falls off.
const DEVIATION: f32 = 0.08;

/// Factor by which the weight of a patch falls per pixel of depth in the hole.
const DEPTH_DECAY: f32 = 1.2;

/// Every pixel of the hole becomes the weighted mean of the patches that cover it.
pub(super) fn vote(level: &mut Level, search: &Search) {
    let pixels = level.known.len();
    let mut weights = vec![0.0_f32; pixels];
    let mut sums = vec![vec![0.0_f32; pixels]; level.channels.len()];
    let (w, h) = (level.width as isize, level.height as isize);
    for &k in &search.targets {
        let (k, to) = (k as usize, search.nearest[k as usize] as isize);
        let trust = DEPTH_DECAY.powi(-i32::try_from(search.depth[k]).unwrap_or(0));
        let weight = trust * (-search.distance[k] / (2.0 * DEVIATION * DEVIATION)).exp().max(1e-6);
        for ((dx, dy), pixel) in around(level, k) {
            let (x, y) = (to % w + dx, to / w + dy);
            if level.known[pixel] || !((0..w).contains(&x) && (0..h).contains(&y)) {
                continue;
            }
            let from = (y * w + x) as usize;
            if level.known[from] && weight > 0.0 {
                weights[pixel] += weight;
                sums.iter_mut().zip(&level.channels).for_each(|(sum, channel)| sum[pixel] += weight * channel[from]);
            }
        }
    }
    for pixel in (0..pixels).filter(|&p| !level.known[p] && weights[p] > 0.0) {
        for (channel, sum) in level.channels.iter_mut().zip(&sums) {
            channel[pixel] = sum[pixel] / weights[pixel];
        }
    }
}

/// Column and row of every pixel that is not shown whole.
pub(super) fn hole(shown: &Plane<u8>, (width, height): (usize, usize)) -> impl Iterator<Item = (usize, usize)> {
    let shown = shown.as_ref();
    (0..height).flat_map(move |y| (0..width).map(move |x| (x, y))).filter(move |&(x, y)| shown.row(y)[x] < 255)
}

/// Copies pixels of the full picture to where the small one found its patches.
pub(super) struct Copier<'a> {
    pub(super) shown: &'a Plane<u8>,
    pub(super) level: &'a Level,
    pub(super) nearest: &'a [u32],
    /// Pixels of the small picture per pixel of the full one.
    pub(super) scale: (f64, f64),
    pub(super) channel: usize,
}

impl Copier<'_> {
    /// The values of every pixel that is not shown whole, in the order of [`hole`].
    pub(super) fn values(
        &self,
        sample: impl Fn(usize, usize) -> f32,
        size: (usize, usize),
        run: &Run,
    ) -> Result<Vec<f32>, Stopped> {
        let value = |at: (usize, usize)| run.check().map(|()| self.value(at, &sample, size));
        hole(self.shown, size).map(value).collect()
    }

    /// The mean of what the four nearest pixels of the small picture point to; their own value where that is not shown.
    fn value(&self, (x, y): (usize, usize), sample: &impl Fn(usize, usize) -> f32, size: (usize, usize)) -> f32 {
        let (w, h) = (self.level.width, self.level.height);
        let (u, v) = ((x as f64 + 0.5) * self.scale.0 - 0.5, (y as f64 + 0.5) * self.scale.1 - 0.5);
        let within = |i: f64, n: usize| i.clamp(0.0, (n - 1) as f64) as usize;
        let mut sum = 0.0;
        for (du, dv) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)] {
            let (i, j) = (u.floor() + du, v.floor() + dv);
            let weight = (1.0 - (u - i).abs()) * (1.0 - (v - j).abs());
            let k = within(j, h) * w + within(i, w);
            sum += weight as f32 * self.pointed(k, (x, y), sample, size);
        }
        sum
    }

    /// The pixel of the full picture that lies from `(x, y)` as the source of small pixel `k` lies from `k`.
    fn pointed(
        &self,
        k: usize,
        (x, y): (usize, usize),
        sample: &impl Fn(usize, usize) -> f32,
        size: (usize, usize),
    ) -> f32 {
        let (w, to) = (self.level.width, self.nearest[k] as usize);
        let moved =
            |to: usize, at: usize, own: usize, scale: f64| (own as f64 + (to as f64 - at as f64) / scale).round();
        let (i, j) = (moved(to % w, k % w, x, self.scale.0), moved(to / w, k / w, y, self.scale.1));
        let inside = i >= 0.0 && j >= 0.0 && (i as usize) < size.0 && (j as usize) < size.1;
        if inside && to != k && self.shown.as_ref().row(j as usize)[i as usize] == 255 {
            return sample(i as usize, j as usize);
        }
        self.level.channels[self.channel][k]
    }
}
