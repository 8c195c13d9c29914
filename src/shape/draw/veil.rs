//! What lies before a place in space: how much of a mark there is seen.

use super::visibility::Seen;

/// How strongly marks behind an opaque surface show through.
const HIDDEN: f32 = 0.22;

/// Surfaces before marks.
pub(super) enum Veil {
    /// The nearest one.
    Opaque(Seen),
    /// Layers, the nearest first: per pixel, how near (`1/z`) and how opaque.
    Translucent { width: usize, layers: Vec<Vec<[f32; 2]>> },
}

impl Veil {
    pub(super) fn opaque(seen: Seen) -> Self {
        Self::Opaque(seen)
    }

    pub(super) fn translucent(width: usize) -> Self {
        Self::Translucent { width, layers: Vec::new() }
    }

    /// Adds the next layer of a translucent surface.
    pub(super) fn lay(&mut self, opacity: &[f32], seen: &Seen) {
        if let Self::Translucent { width, layers } = self {
            let pixel = |(i, opacity): (usize, &f32)| {
                let near = if *opacity > 0.0 { seen.mean_nearness(i % *width, i / *width) } else { 0.0 };
                [near, *opacity]
            };
            layers.push(opacity.iter().enumerate().map(pixel).collect());
        }
    }

    /// How strongly a mark as near as this shows in a pixel.
    pub(super) fn share(&self, (x, y): (usize, usize), nearness: f32) -> f32 {
        match self {
            Self::Opaque(seen) => {
                let n = seen.samples;
                let free = (0..n * n).filter(|i| seen.nearness(x, y, i % n, i / n) <= nearness).count();
                HIDDEN + (1.0 - HIDDEN) * free as f32 / (n * n) as f32
            }
            Self::Translucent { width, layers } => {
                let before = layers.iter().map(|layer| layer[y * width + x]).take_while(|[near, _]| *near > nearness);
                before.map(|[_, opacity]| 1.0 - opacity).product()
            }
        }
    }
}
