//! Occlusion of marks by the surface.

use super::visibility::VisibleLayer;

/// Strength of marks behind an opaque surface: visible, but clearly distinct from marks in front.
const HIDDEN: f32 = 0.22;

/// Surface layers that may hide marks.
pub(super) enum Occlusion {
    /// The nearest layer.
    Opaque(VisibleLayer),
    /// Layers, nearest first: inverse depth `1/z` and opacity per pixel.
    Translucent { width: usize, layers: Vec<Vec<[f32; 2]>> },
}

impl Occlusion {
    /// Adds the next layer of a translucent surface.
    pub(super) fn push(&mut self, opacity: &[f32], layer: &VisibleLayer) {
        if let Self::Translucent { width, layers } = self {
            let pixel = |(i, opacity): (usize, &f32)| {
                let inverse_depth = if *opacity > 0.0 { layer.mean_inverse_depth(i % *width, i / *width) } else { 0.0 };
                [inverse_depth, *opacity]
            };
            layers.push(opacity.iter().enumerate().map(pixel).collect());
        }
    }

    /// Fraction of a mark at this inverse depth that is visible in a pixel.
    pub(super) fn transmittance(&self, (x, y): (usize, usize), inverse_depth: f32) -> f32 {
        match self {
            Self::Opaque(layer) => {
                let n = layer.samples;
                let free = (0..n * n).filter(|i| layer.inverse_depth(x, y, i % n, i / n) <= inverse_depth).count();
                HIDDEN + (1.0 - HIDDEN) * free as f32 / (n * n) as f32
            }
            Self::Translucent { width, layers } => {
                let before =
                    layers.iter().map(|layer| layer[y * width + x]).take_while(|[depth, _]| *depth > inverse_depth);
                before.map(|[_, opacity]| 1.0 - opacity).product()
            }
        }
    }
}
