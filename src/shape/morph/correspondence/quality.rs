//! How good a map between surfaces is.

use std::collections::BTreeSet;

use nalgebra::{Point3, Vector3, center};

use super::super::MorphError;
use super::registration::Target;
use crate::mesh::TriMesh;
use plumbline_num::run::Run;

/// A triangle laid to a smaller part of its size than this is lost.
const LOST: f64 = 1e-9;

/// A map that takes one mesh to another, in numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MapQuality {
    /// Triangles that face away from the surface on which they lie.
    pub flipped: usize,
    /// Triangles laid to nothing.
    pub collapsed: usize,
    /// Root of the mean of `(σ₁² + σ₂²)/2` over the area, of the map scaled to keep the area; 1 where nothing is stretched.
    pub stretch: f64,
    /// The same of the 95th percentile of triangles, by area.
    pub stretch_95: f64,
    /// Farthest that a landmark lies from its place, in diagonals of the second mesh.
    pub landmark_error: f64,
    /// Root of the mean square distance from the second mesh's vertices to the surface laid on it, in diagonals.
    pub missed_rms: f64,
    /// The greatest of these distances: features that are lost.
    pub missed_worst: f64,
}

/// Measures a map from `first` to `laid`, which should lie on `second`.
///
/// # Errors
/// [`MorphError::Empty`], [`MorphError::Interrupted`].
pub fn measure(
    first: &TriMesh,
    laid: &TriMesh,
    second: &TriMesh,
    landmarks: &[(u32, u32)],
    run: &Run,
) -> Result<MapQuality, MorphError> {
    let target = Target::new(second)?;
    let unit = second.diagonal();
    let (stretch, stretch_95) = stretches(first, laid);
    let cover = Target::new(laid).map_err(|_| MorphError::Empty { which: "laid" })?;
    let named: BTreeSet<u32> = second.triangles().iter().flatten().copied().collect();
    let mut missed = Vec::with_capacity(named.len());
    for &v in &named {
        run.check()?;
        missed.extend(cover.nearest(&second.positions()[v as usize]).map(|place| place.squared));
    }
    let landmark = |&(v, w): &(u32, u32)| (laid.positions()[v as usize] - second.positions()[w as usize]).norm() / unit;
    let sizes = [first.area(), second.area()];
    let collapsed =
        |t: &usize| is_collapsed(laid.area_normal(*t).norm() / sizes[1], first.area_normal(*t).norm() / sizes[0]);
    let against = |t: &usize| lies_against(&laid.corners(*t), &laid.area_normal(*t), &target);
    let mut flipped = 0;
    for t in 0..laid.triangle_count() {
        run.check()?;
        flipped += usize::from(!collapsed(&t) && against(&t));
    }
    Ok(MapQuality {
        flipped,
        collapsed: (0..laid.triangle_count()).filter(collapsed).count(),
        stretch,
        stretch_95,
        landmark_error: landmarks.iter().map(landmark).fold(0.0, f64::max),
        missed_rms: (missed.iter().sum::<f64>() / missed.len().max(1) as f64).sqrt() / unit,
        missed_worst: missed.iter().copied().fold(0.0, f64::max).sqrt() / unit,
    })
}

/// A triangle is laid to nothing; its shares of the areas of what it is laid on and of its own surface.
pub(super) fn is_collapsed(laid: f64, first: f64) -> bool {
    !(laid > LOST * first)
}

/// Most of the places around the middle of a triangle have normals that point away from its own.
pub(super) fn lies_against(corners: &[Point3<f64>; 3], normal: &Vector3<f64>, target: &Target<'_>) -> bool {
    let [a, b, c] = corners;
    let middle = Point3::from((a.coords + b.coords + c.coords) / 3.0);
    let samples = [middle, center(&middle, a), center(&middle, b), center(&middle, c)];
    let against =
        samples.iter().filter_map(|p| target.nearest(p)).filter(|p| target.normal(p.triangle).dot(normal) < 0.0);
    against.count() > samples.len() / 2
}

/// Stretch of the whole, and of the 95th percentile.
fn stretches(first: &TriMesh, laid: &TriMesh) -> (f64, f64) {
    let mut of_triangle: Vec<(f64, f64)> = (0..first.triangle_count())
        .filter_map(|t| {
            let area = 0.5 * first.area_normal(t).norm();
            squared_stretch(&first.corners(t), &laid.corners(t)).map(|s| (s, area))
        })
        .collect();
    let area: f64 = of_triangle.iter().map(|s| s.1).sum();
    if !(area > 0.0) || !(laid.area() > 0.0) {
        return (f64::NAN, f64::NAN);
    }
    let scale = area / laid.area();
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
    fn a_surface_on_itself_is_perfect_and_a_scaled_one_as_good() {
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
    fn a_plane_stretched_one_way_has_the_stretch_of_its_singular_values() {
        let plane = shapes::plane(6);
        let laid =
            plane.with_positions(plane.positions().iter().map(|p| Point3::new(4.0 * p.x, p.y, 0.0)).collect()).unwrap();
        let quality = measure(&plane, &laid, &laid, &[], &Run::default()).unwrap();
        // σ = 4, 1; the area grows by 4.
        assert!((quality.stretch - (17.0_f64 / 2.0 / 4.0).sqrt()).abs() < 1e-12, "{}", quality.stretch);
    }

    #[test]
    fn what_is_folded_collapsed_or_missed_is_counted() {
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
    }
}
