//! Scalars over the surface: how far it is from rest, and where it resists.

use nalgebra::Point3;
use serde::{Deserialize, Serialize};

use crate::error::StudioError;
use plumbline_shape::surface::{CellEnergies, CotangentRule, DistortionMetrics, SolvableMesh};

/// What colors of the surface mean.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[serde(rename_all = "snake_case")]
pub enum Overlay {
    /// Nothing.
    #[default]
    None,
    /// Root mean square of the relative changes of edge lengths at a vertex.
    Distortion,
    /// Energy of the cell of a vertex (ARAP), squared mesh units.
    Energy,
    /// Vertices of faces that are inverted.
    Flipped,
    /// Distance from the rest position, mesh units.
    Displacement,
}

/// Values of an overlay with the range of its colors.
#[derive(Clone, Debug, PartialEq)]
pub struct Values {
    /// One per vertex of the surface.
    pub values: Vec<f64>,
    /// The highest color; the lowest is 0.
    pub high: f64,
}

/// Fraction of the values below the highest color: single spikes would leave all others in one color.
const IN_RANGE: f64 = 0.995;

/// What overlays compute from.
#[derive(Debug, Default)]
pub struct Overlays {
    metrics: Option<DistortionMetrics>,
    energies: Option<(CotangentRule, CellEnergies)>,
}

impl Overlays {
    /// The values of an overlay for positions of the surface; `None` without an overlay.
    ///
    /// # Errors
    /// [`StudioError::Method`].
    pub fn of(
        &mut self,
        overlay: Overlay,
        solvable: &SolvableMesh,
        positions: &[Point3<f64>],
        cotangents: CotangentRule,
    ) -> Result<Option<Values>, StudioError> {
        let rest = &solvable.mesh;
        let metrics = |this: &mut Self| this.metrics.take().unwrap_or_else(|| DistortionMetrics::new(rest));
        let values = match overlay {
            Overlay::None => {
                *self = Self::default();
                return Ok(None);
            }
            Overlay::Distortion => {
                let metrics = metrics(self);
                self.metrics.insert(metrics).stretch_of_vertices(positions)
            }
            Overlay::Flipped => {
                let metrics = metrics(self);
                let flipped = self.metrics.insert(metrics).flipped(positions);
                return Ok(Some(marked(rest.triangles(), &flipped, positions.len())));
            }
            Overlay::Energy => {
                if self.energies.as_ref().is_none_or(|e| e.0 != cotangents) {
                    self.energies = Some((cotangents, CellEnergies::new(rest, cotangents)));
                }
                let (_, energies) = self.energies.as_mut().ok_or_else(|| StudioError::Method(String::new()))?;
                energies.of_vertices(positions).map_err(|e| StudioError::Method(e.to_string()))?
            }
            Overlay::Displacement => positions.iter().zip(rest.positions()).map(|(p, q)| (p - q).norm()).collect(),
        };
        let high = quantile(&values).max(smallest(overlay, rest.diagonal()));
        Ok(Some(Values { values, high }))
    }
}

/// Smallest value of the highest color: below it a surface at rest would show its rounding.
fn smallest(overlay: Overlay, diagonal: f64) -> f64 {
    match overlay {
        Overlay::Distortion => 1e-3,
        Overlay::Energy => 1e-10 * diagonal * diagonal,
        Overlay::Displacement => 1e-4 * diagonal,
        Overlay::None | Overlay::Flipped => 1.0,
    }
}

fn marked(triangles: &[[u32; 3]], flipped: &[u32], count: usize) -> Values {
    let mut values = vec![0.0; count];
    flipped.iter().flat_map(|t| triangles[*t as usize]).for_each(|v| values[v as usize] = 1.0);
    Values { values, high: 1.0 }
}

/// The value that a fraction [`IN_RANGE`] of them is below; 0 without values.
fn quantile(values: &[f64]) -> f64 {
    let mut sorted: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
    if sorted.is_empty() {
        return 0.0;
    }
    let at = ((sorted.len() - 1) as f64 * IN_RANGE) as usize;
    *sorted.select_nth_unstable_by(at, f64::total_cmp).1
}
