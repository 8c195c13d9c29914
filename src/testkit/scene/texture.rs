//! Square, repeating color textures with a mip pyramid and anisotropic lookup.

use rayon::prelude::*;

use super::Vec3;
use plumbline_image::canvas::srgb::{LINEAR, srgb_from_linear};

/// Taps along the longer axis of a pixel's footprint: grazing ground stays sharp across and calm along.
const MAX_TAPS: f32 = 4.0;

/// One level of the pyramid: `side × side` texels, side a power of two.
struct Level {
    side: usize,
    texels: Vec<[u8; 4]>,
}

/// A texture over the unit square, repeated beyond it.
pub(super) struct Texture {
    levels: Vec<Level>,
}

impl Texture {
    /// Samples `paint(u, v)` (sRGB in [0, 1]) twice per texel of a `side × side` texture, a power of two.
    pub(super) fn paint(side: usize, paint: impl Fn(f32, f32) -> [f32; 3] + Sync) -> Self {
        let texel = |i: usize| {
            let (x, y) = ((i % side) as f32, (i / side) as f32);
            let mut sum = [0.0; 3];
            for (dx, dy) in [(0.25, 0.3), (0.75, 0.7)] {
                let color = paint((x + dx) / side as f32, (y + dy) / side as f32);
                (0..3).for_each(|c| sum[c] += color[c] / 2.0);
            }
            let byte = |v: f32| (v.clamp(0.0, 1.0) * 255.0).round() as u8;
            [byte(sum[0]), byte(sum[1]), byte(sum[2]), 255]
        };
        let mut levels = vec![Level { side, texels: (0..side * side).into_par_iter().map(texel).collect() }];
        while levels.last().is_some_and(|l| l.side > 1) {
            levels.push(half(&levels[levels.len() - 1]));
        }
        Self { levels }
    }

    /// Linear color of a pixel whose center lies at `uv` and whose sides span `du_dx = ∂(u,v)/∂x` and `∂(u,v)/∂y`.
    pub(super) fn sample(&self, [u, v]: [f32; 2], across: [f32; 2], along: [f32; 2]) -> Vec3 {
        let (a, b) = (across[0].hypot(across[1]), along[0].hypot(along[1]));
        let (long, axis, short) = if a > b { (a, across, b) } else { (b, along, a) };
        // A footprint that is nearly round needs one tap: the mip level covers it.
        let taps = (long / short.max(long / MAX_TAPS) - 0.4).ceil().clamp(1.0, MAX_TAPS);
        let lod = (long / taps * self.levels[0].side as f32).max(1.0).log2();
        let mut sum = Vec3::zeros();
        for k in 0..taps as usize {
            let offset = (k as f32 + 0.5) / taps - 0.5;
            sum += self.trilinear(u + axis[0] * offset, v + axis[1] * offset, lod);
        }
        sum / taps
    }

    fn trilinear(&self, u: f32, v: f32, lod: f32) -> Vec3 {
        let last = self.levels.len() - 1;
        let level = (lod as usize).min(last);
        let fine = self.levels[level].bilinear(u, v);
        let rest = lod - level as f32;
        if rest < 0.02 || level == last {
            return fine;
        }
        fine + (self.levels[level + 1].bilinear(u, v) - fine) * rest
    }
}

impl Level {
    fn bilinear(&self, u: f32, v: f32) -> Vec3 {
        let side = self.side as f32;
        let (x, y) = ((u - u.floor()) * side - 0.5, (v - v.floor()) * side - 0.5);
        let (x0, y0) = (x.floor(), y.floor());
        let (fx, fy) = (x - x0, y - y0);
        let mask = self.side - 1;
        let (x0, y0) = (x0 as isize as usize & mask, y0 as isize as usize & mask);
        let (x1, y1) = ((x0 + 1) & mask, (y0 + 1) & mask);
        let at = |x: usize, y: usize| {
            let t = self.texels[y * self.side + x];
            Vec3::new(LINEAR[t[0] as usize], LINEAR[t[1] as usize], LINEAR[t[2] as usize])
        };
        (at(x0, y0) * (1.0 - fx) + at(x1, y0) * fx) * (1.0 - fy) + (at(x0, y1) * (1.0 - fx) + at(x1, y1) * fx) * fy
    }
}

/// Means of 2×2 texels, in linear light.
fn half(fine: &Level) -> Level {
    let side = fine.side / 2;
    let texel = |i: usize| {
        let (x, y) = (i % side * 2, i / side * 2);
        let four = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(dx, dy)| fine.texels[(y + dy) * fine.side + x + dx]);
        let mean = |c: usize| four.iter().map(|t| LINEAR[t[c] as usize]).sum::<f32>() / 4.0;
        let byte = |c: usize| (srgb_from_linear(mean(c)) * 255.0).round() as u8;
        [byte(0), byte(1), byte(2), 255]
    };
    Level { side, texels: (0..side * side).map(texel).collect() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_texel_center_has_the_texel_color_and_the_texture_repeats() {
        let t = Texture::paint(4, |u, _| [if u < 0.25 { 1.0 } else { 0.0 }; 3]);
        let tiny = ([1e-6, 0.0], [0.0, 1e-6]);
        assert!((t.sample([0.125, 0.5], tiny.0, tiny.1).x - 1.0).abs() < 1e-6);
        assert!((t.sample([3.125, -7.5], tiny.0, tiny.1).x - 1.0).abs() < 1e-4);
        assert!((t.sample([0.25, 0.5], tiny.0, tiny.1).x - 0.5).abs() < 1e-4, "between two texels");
    }

    #[test]
    fn a_footprint_of_the_whole_texture_gives_its_mean_light() {
        let t = Texture::paint(64, |u, _| [if ((u * 64.0) as usize).is_multiple_of(2) { 1.0 } else { 0.0 }; 3]);
        assert!((t.sample([0.3, 0.7], [1.0, 0.0], [0.0, 1.0]).x - 0.5).abs() < 0.01);
    }
}
