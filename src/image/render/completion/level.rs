//! A small copy of a picture with its hole.

use crate::render::RenderError;
use crate::{Frame, Plane};

/// Relaxation iterations of the smooth fill per pixel of the longer side.
const SMOOTHING_ITERATIONS: usize = 4;

/// Gray or color in [0, 1], row-major, and where it is known.
#[derive(Clone, Debug)]
pub(super) struct Level {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) channels: Vec<Vec<f32>>,
    /// Whole pixels of the picture.
    pub(super) known: Vec<bool>,
}

impl Level {
    /// The picture with its longer side at most `side`: means of what is shown. A pixel is known where all of it is shown.
    pub(super) fn of_frame(frame: &Frame, shown: &Plane<u8>, side: usize) -> Result<Self, RenderError> {
        let (w, h) = (frame.width, frame.height);
        let scale = (side as f64 / w.max(h) as f64).min(1.0);
        let small = |n: usize| ((n as f64 * scale).round() as usize).max(1);
        let (width, height) = (small(w), small(h));
        let mask = shown.as_ref();
        let span = |i: usize, of: usize, n: usize| i * n / of..((i + 1) * n).div_ceil(of).min(n);
        let known = (0..width * height).map(|k| {
            let (xs, ys) = (span(k % width, width, w), span(k / width, height, h));
            ys.into_iter().all(|y| mask.row(y)[xs.clone()].iter().all(|v| *v == 255))
        });
        let colors = frame.format.planes() - usize::from(frame.format.alpha);
        let most = ((1_u32 << frame.format.bits) - 1) as f32;
        let mut channels = Vec::with_capacity(colors);
        for plane in 0..colors {
            let fault = RenderError::Plane { plane, role: "source" };
            let sample: Box<dyn Fn(usize, usize) -> f32> = if let Some(p) = frame.plane8(plane) {
                Box::new(move |x, y| f32::from(p.row(y)[x]) / most)
            } else {
                let p = frame.plane16(plane).ok_or(fault)?;
                Box::new(move |x, y| f32::from(p.row(y)[x]) / most)
            };
            let mean = |k: usize| {
                let (xs, ys) = (span(k % width, width, w), span(k / width, height, h));
                let pixels = ys.flat_map(|y| xs.clone().map(move |x| (x, y)));
                let (sum, count) = pixels
                    .filter(|&(x, y)| mask.row(y)[x] == 255)
                    .fold((0.0, 0.0), |(s, n), (x, y)| (s + sample(x, y), n + 1.0));
                if count > 0.0 { sum / count } else { 0.0 }
            };
            channels.push((0..width * height).map(mean).collect());
        }
        Ok(Self { width, height, channels, known: known.collect() })
    }

    /// Half the size; `None` where nothing known is left.
    pub(super) fn halved(&self) -> Option<Self> {
        let (width, height) = (self.width.div_ceil(2), self.height.div_ceil(2));
        let four = |k: usize| {
            let (x, y) = (2 * (k % width), 2 * (k / width));
            let (x1, y1) = ((x + 1).min(self.width - 1), (y + 1).min(self.height - 1));
            [y * self.width + x, y * self.width + x1, y1 * self.width + x, y1 * self.width + x1]
        };
        let known: Vec<bool> = (0..width * height).map(|k| four(k).iter().all(|&i| self.known[i])).collect();
        let mean = |channel: &Vec<f32>| {
            let one = |k: usize| {
                let four = four(k);
                let kept = four.iter().filter(|&&i| self.known[i]);
                let (sum, count) = kept.fold((0.0, 0.0), |(s, n), &i| (s + channel[i], n + 1.0));
                if count > 0.0 { sum / count } else { 0.0 }
            };
            (0..width * height).map(one).collect()
        };
        let channels = self.channels.iter().map(mean).collect();
        known.contains(&true).then_some(Self { width, height, channels, known })
    }

    /// Fills the hole with the membrane between what is known: each pixel the mean of its neighbors.
    pub(super) fn fill_smoothly(&mut self) {
        let (w, h) = (self.width, self.height);
        let hole: Vec<usize> = (0..w * h).filter(|&k| !self.known[k]).collect();
        let count = self.known.iter().filter(|k| **k).count().max(1) as f32;
        for channel in &mut self.channels {
            let mean = channel.iter().zip(&self.known).filter(|(_, k)| **k).map(|(v, _)| v).sum::<f32>() / count;
            for &k in &hole {
                channel[k] = mean;
            }
            for _ in 0..SMOOTHING_ITERATIONS * w.max(h) {
                for &k in &hole {
                    let (x, y) = (k % w, k / w);
                    let at = |x: usize, y: usize| channel[y * w + x];
                    channel[k] = 0.25
                        * (at(x.saturating_sub(1), y)
                            + at((x + 1).min(w - 1), y)
                            + at(x, y.saturating_sub(1))
                            + at(x, (y + 1).min(h - 1)));
                }
            }
        }
    }

    /// Fills the hole with a coarser level.
    pub(super) fn fill_from(&mut self, coarse: &Self) {
        for k in (0..self.known.len()).filter(|&k| !self.known[k]) {
            let from = coarse.under(k, self);
            for (channel, values) in self.channels.iter_mut().zip(&coarse.channels) {
                channel[k] = values[from];
            }
        }
    }

    /// The pixel under the middle of pixel `k` of another size of the picture.
    pub(super) fn under(&self, k: usize, of: &Self) -> usize {
        let at = |i: usize, n: usize, own: usize| ((2 * i + 1) * own / (2 * n)).min(own - 1);
        at(k / of.width, of.height, self.height) * self.width + at(k % of.width, of.width, self.width)
    }
}
