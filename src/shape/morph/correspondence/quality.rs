//! Quality of a map between surfaces.

use nalgebra::{Point3, Vector3, center};

use super::super::MorphError;
use super::registration::Target;
use crate::mesh::TriMesh;
use plumbline_num::run::Run;

/// Minimum area ratio of a mapped triangle, relative to the total areas; below it the triangle is collapsed.
const MIN_AREA_RATIO: f64 = 1e-9;

/// Maximum fraction of triangles that are flipped or collapsed: folds are visible from about one in a thousand.
const MAX_FOLDED: f64 = 1e-3;
/// Maximum 95th percentile of the stretch. Good maps of unlike bodies have 1.5 to 3; from about 10 single triangles cover whole parts.
const MAX_STRETCH: f64 = 6.0;
/// Maximum distance of a landmark from its target, in diagonals: a smaller one is hardly seen, and no reason to prefer a folded map.
const MAX_LANDMARK_ERROR: f64 = 0.01;
/// Maximum distance from a vertex of the second mesh to the mapped surface, in diagonals: more is a part that is missing, such as an ear.
const MAX_MISSED: f64 = 0.1;

/// Quality metrics of a map.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MapQuality {
    /// Number of triangles.
    pub triangles: usize,
    /// Number of triangles whose normal opposes that of the surface below them.
    pub flipped: usize,
    /// Number of collapsed triangles.
    pub collapsed: usize,
    /// L² stretch: root of the area-weighted mean of `(σ₁² + σ₂²)/2`, with the map scaled to preserve the total area; 1 for an isometry.
    pub stretch: f64,
    /// 95th percentile of the stretch of triangles, by area.
    pub stretch_95: f64,
    /// Largest distance of a landmark from its target, in diagonals of the second mesh.
    pub landmark_error: f64,
    /// RMS distance from the second mesh's vertices to the mapped surface, in diagonals.
    pub missed_rms: f64,
    /// Largest of these distances: lost features.
    pub missed_worst: f64,
}

/// A check of a map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct QualityCheck {
    /// What is checked.
    pub name: &'static str,
    /// The value.
    pub value: f64,
    /// The largest value that passes.
    pub limit: f64,
    /// The value is a fraction, not a factor.
    fraction: bool,
}

impl QualityCheck {
    /// The value over its limit; infinite where it is not a number.
    pub(super) fn excess(&self) -> f64 {
        if self.value.is_nan() { f64::INFINITY } else { self.value / self.limit }
    }
}

impl std::fmt::Display for QualityCheck {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { name, value, limit, fraction } = self;
        if *fraction {
            write!(f, "{name} {:.2} % (at most {} %)", 100.0 * value, 100.0 * limit)
        } else {
            write!(f, "{name} {value:.2} (at most {limit})")
        }
    }
}

impl MapQuality {
    /// The checks of folds, stretch, landmark error and coverage.
    pub(super) fn checks(&self) -> [QualityCheck; 4] {
        let folded = (self.flipped + self.collapsed) as f64 / self.triangles.max(1) as f64;
        [
            ("folds", folded, MAX_FOLDED, true),
            ("stretch of 95 % of the area", self.stretch_95, MAX_STRETCH, false),
            ("landmarks missed by", self.landmark_error, MAX_LANDMARK_ERROR, true),
            ("features missed by", self.missed_worst, MAX_MISSED, true),
        ]
        .map(|(name, value, limit, fraction)| QualityCheck { name, value, limit, fraction })
    }

    /// The checks that the map fails.
    pub fn failed_checks(&self) -> Vec<QualityCheck> {
        self.checks().into_iter().filter(|c| !(c.excess() <= 1.0)).collect()
    }
}

/// Measures a map from `first` to `mapped` on `second`.
///
/// # Errors
/// [`MorphError::Empty`], [`MorphError::Layered`], [`MorphError::Interrupted`].
pub fn measure(
    first: &TriMesh,
    mapped: &TriMesh,
    second: &TriMesh,
    landmarks: &[(u32, u32)],
    run: &Run,
) -> Result<MapQuality, MorphError> {
    let target = Target::new(second, "second", first.triangle_count())?;
    let unit = second.diagonal();
    let (stretch, stretch_95) = stretches(first, mapped);
    let cover = Target::new(mapped, "mapped", second.triangle_count())?;
    let (referenced, _) = second.referenced_and_isolated();
    let mut missed = Vec::with_capacity(referenced.len());
    for v in referenced {
        run.check()?;
        missed.push(cover.nearest(&second.positions()[v as usize])?.squared);
    }
    let landmark =
        |&(v, w): &(u32, u32)| (mapped.positions()[v as usize] - second.positions()[w as usize]).norm() / unit;
    let sizes = [first.area(), second.area()];
    let collapsed =
        |t: &usize| is_collapsed(mapped.area_normal(*t).norm() / sizes[1], first.area_normal(*t).norm() / sizes[0]);
    let against = |t: &usize| is_flipped(&mapped.corners(*t), &mapped.area_normal(*t), &target);
    let mut flipped = 0;
    for t in 0..mapped.triangle_count() {
        run.check()?;
        flipped += usize::from(!collapsed(&t) && against(&t)?);
    }
    Ok(MapQuality {
        triangles: mapped.triangle_count(),
        flipped,
        collapsed: (0..mapped.triangle_count()).filter(collapsed).count(),
        stretch,
        stretch_95,
        landmark_error: landmarks.iter().map(landmark).fold(0.0, f64::max),
        missed_rms: (missed.iter().sum::<f64>() / missed.len().max(1) as f64).sqrt() / unit,
        missed_worst: missed.iter().copied().fold(0.0, f64::max).sqrt() / unit,
    })
}

/// Whether a triangle is collapsed, by its fractions of the areas of the target and of its own surface.
pub(super) fn is_collapsed(mapped: f64, first: f64) -> bool {
    !(mapped > MIN_AREA_RATIO * first)
}

/// Whether most of the surface points below a triangle have normals opposite to its own.
pub(super) fn is_flipped(
    corners: &[Point3<f64>; 3],
    normal: &Vector3<f64>,
    target: &Target<'_>,
) -> Result<bool, MorphError> {
    let [a, b, c] = corners;
    let middle = Point3::from((a.coords + b.coords + c.coords) / 3.0);
    let samples = [middle, center(&middle, a), center(&middle, b), center(&middle, c)];
    let mut against = 0;
    for sample in &samples {
        let below = target.normal(target.nearest(sample)?.triangle);
        against += usize::from(below.dot(normal) < 0.0);
    }
    Ok(against > samples.len() / 2)
}

/// Total stretch, and the 95th percentile.
fn stretches(first: &TriMesh, mapped: &TriMesh) -> (f64, f64) {
    let mut of_triangle: Vec<(f64, f64)> = (0..first.triangle_count())
        .filter_map(|t| {
            let area = 0.5 * first.area_normal(t).norm();
            squared_stretch(&first.corners(t), &mapped.corners(t)).map(|s| (s, area))
        })
        .collect();
    let area: f64 = of_triangle.iter().map(|s| s.1).sum();
    if !(area > 0.0) || !(mapped.area() > 0.0) {
        return (f64::NAN, f64::NAN);
    }
    let scale = area / mapped.area();
    let mean = of_triangle.iter().map(|(s, a)| s * a).sum::<f64>() / area;
    of_triangle.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    let mut passed = 0.0;
    let high = of_triangle.iter().find(|(_, a)| {
        passed += a;
        passed >= 0.95 * area
    });
    ((mean * scale).sqrt(), high.map_or(f64::NAN, |h| (h.0 * scale).sqrt()))
}

/// `(σ₁² + σ₂²)/2` of the map of a triangle: `Σ cot |e'|² / (2·2A)`, by Dirichlet's energy.
fn squared_stretch(rest: &[Point3<f64>; 3], moved: &[Point3<f64>; 3]) -> Option<f64> {
    let edge = |p: &[Point3<f64>; 3], k: usize| p[(k + 2) % 3] - p[(k + 1) % 3];
    let doubled = edge(rest, 0).cross(&edge(rest, 1)).norm();
    let longest = (0..3).map(|k| edge(rest, k).norm_squared()).fold(0.0, f64::max);
    if !(doubled > 1e-12 * longest) {
        return None;
    }
    // cot at corner k is −e_i·e_j / 2A of the two other edges.
    let part =
        |k: usize| -edge(rest, (k + 1) % 3).dot(&edge(rest, (k + 2) % 3)) / doubled * edge(moved, k).norm_squared();
    let dirichlet = 0.5 * (0..3).map(part).sum::<f64>();
    Some(dirichlet / doubled)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;

    #[test]
    fn the_identity_and_scalings_have_no_distortion() {
        let mesh = shapes::cactus(9);
        for scale in [1.0, 7.0] {
            let second = mesh.with_positions(mesh.positions().iter().map(|p| p * scale).collect()).unwrap();
            let quality = measure(&mesh, &second, &second, &[(0, 0), (5, 5)], &Run::default()).unwrap();
            assert_eq!((quality.flipped, quality.collapsed, quality.landmark_error), (0, 0, 0.0));
            assert!((quality.stretch - 1.0).abs() < 1e-9 && (quality.stretch_95 - 1.0).abs() < 1e-9);
            assert!(quality.missed_worst < 1e-12);
        }
    }

    #[test]
    fn a_uniaxial_stretch_has_the_stretch_of_its_singular_values() {
        let plane = shapes::plane(6);
        let mapped =
            plane.with_positions(plane.positions().iter().map(|p| Point3::new(4.0 * p.x, p.y, 0.0)).collect()).unwrap();
        let quality = measure(&plane, &mapped, &mapped, &[], &Run::default()).unwrap();
        // σ = 4, 1; the area grows by 4.
        assert!((quality.stretch - (17.0_f64 / 2.0 / 4.0).sqrt()).abs() < 1e-12, "{}", quality.stretch);
    }

    #[test]
    fn flipped_collapsed_and_missed_parts_are_counted() {
        let plane = shapes::plane(8);
        let mut positions = plane.positions().to_vec();
        let inner = 4 * 9 + 4;
        positions[inner] = Point3::new(0.5 + 0.125 * 1.5, 0.5, 0.0);
        let folded = plane.with_positions(positions.clone()).unwrap();
        let quality = measure(&plane, &folded, &plane, &[(inner as u32, inner as u32)], &Run::default()).unwrap();
        assert!(quality.flipped > 0 && quality.flipped <= 4, "{quality:?}");
        assert!((quality.landmark_error - 0.1875 / 2.0_f64.sqrt()).abs() < 1e-12);
        positions[inner] = positions[inner + 1];
        let collapsed = plane.with_positions(positions).unwrap();
        assert!(measure(&plane, &collapsed, &plane, &[], &Run::default()).unwrap().collapsed >= 2);
        let spikes = shapes::spiked_plane(8, 4, 0.5);
        let quality = measure(&plane, &plane, &spikes, &[], &Run::default()).unwrap();
        assert!((quality.missed_worst - 0.5 / spikes.diagonal()).abs() < 1e-12);
        let failed: Vec<String> = quality.failed_checks().iter().map(ToString::to_string).collect();
        assert!(
            failed.iter().any(|f| f.starts_with("features missed by 3") && f.ends_with("(at most 10 %)")),
            "{failed:?}"
        );
        assert_eq!(measure(&plane, &plane, &plane, &[], &Run::default()).unwrap().failed_checks(), []);
    }
}
