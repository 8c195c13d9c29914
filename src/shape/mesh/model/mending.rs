//! Mends vertices with coordinates that are not finite.

use std::collections::HashMap;

use nalgebra::{Point3, Vector3};

use super::Faces;
use crate::mesh::tri_mesh::is_finite;

/// Sets each vertex that is not finite to the mean of its neighbors along edges, from the finite ones inward, or to the mean of all finite
/// ones if no edges lead there. Returns the first of these vertices and their number; `None`, and nothing changes, if there is none, or none is
/// finite. Faces may name vertices that do not exist.
pub(super) fn mend(positions: &mut [Point3<f64>], faces: &Faces) -> Option<(u32, usize)> {
    let mut is_known: Vec<bool> = positions.iter().map(is_finite).collect();
    let broken: Vec<u32> = (0..is_known.len() as u32).filter(|v| !is_known[*v as usize]).collect();
    let middle = mean(positions.iter().copied().filter(is_finite))?;
    let first = *broken.first()?;
    let mut around: HashMap<u32, Vec<u32>> = HashMap::new();
    for face in faces.iter() {
        for (a, b) in face.iter().zip(face.iter().cycle().skip(1)) {
            for (v, u) in [(a, b), (b, a)] {
                if is_known.get(*v as usize) == Some(&false) && (*u as usize) < is_known.len() {
                    around.entry(*v).or_default().push(*u);
                }
            }
        }
    }
    let mut layer: Vec<u32> = around.keys().copied().collect();
    while !layer.is_empty() {
        let mended = |v: &u32| {
            let known = around[v].iter().map(|u| *u as usize).filter(|u| is_known[*u]);
            Some((*v, mean(known.map(|u| positions[u]))?))
        };
        let means: Vec<(u32, Point3<f64>)> = layer.iter().filter_map(mended).collect();
        for (v, mean) in &means {
            (positions[*v as usize], is_known[*v as usize]) = (*mean, true);
        }
        layer = means.iter().flat_map(|(v, _)| &around[v]).copied().filter(|u| !is_known[*u as usize]).collect();
        layer.sort_unstable();
        layer.dedup();
    }
    for v in broken.iter().filter(|v| !is_known[**v as usize]) {
        positions[*v as usize] = middle;
    }
    Some((first, broken.len()))
}

/// The mean of points, of which the sum may be beyond double precision; `None` without any.
fn mean(points: impl Iterator<Item = Point3<f64>> + Clone) -> Option<Point3<f64>> {
    let share = 1.0 / points.clone().count() as f64;
    share.is_finite().then(|| Point3::from(points.map(|p| p.coords * share).sum::<Vector3<f64>>()))
}
