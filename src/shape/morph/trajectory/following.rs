//! Triangles that follow one end.
//!
//! Where the map turns a triangle over, or far against its neighbors, the mean of both poses collapses and folds, though one of them
//! does not. Such a triangle takes the pose alone in which it conforms better with those around it. The other takes over next to its
//! own time.

use nalgebra::Point3;

use crate::morph::folds::conformities;

/// Times at which shapes are searched for folds: evenly, and symmetric in the two ends.
pub(super) const SEARCHED: [f64; 4] = [0.2, 0.4, 0.6, 0.8];
/// Time within which the other end takes over: a fold that it has is seen at the end alone, and nothing jumps.
const TRANSITION: f64 = 0.1;

/// Which ends a triangle follows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Follows {
    #[default]
    Both,
    First,
    Second,
}

impl Follows {
    /// The weight of the second end at a time; that of the first is the rest.
    pub(super) fn weight(self, time: f64) -> f64 {
        match self {
            Self::Both => time,
            Self::First => time * ((time - 1.0) / TRANSITION + 1.0).clamp(0.0, 1.0),
            Self::Second => 1.0 - (1.0 - time) * (1.0 - time / TRANSITION).clamp(0.0, 1.0),
        }
    }
}

/// What the triangles follow, given the shapes at the times [`SEARCHED`].
pub(super) fn follows(triangles: &[[u32; 3]], ends: [&[Point3<f64>]; 2], between: &[Vec<Point3<f64>>]) -> Vec<Follows> {
    let at_end = ends.map(|x| conformities(triangles, x));
    let mut folded = vec![false; triangles.len()];
    for x in between {
        folded.iter_mut().zip(conformities(triangles, x)).for_each(|(folded, c)| *folded |= c < 0.0);
    }
    let of_triangle = |t: usize| {
        let [first, second] = [0, 1].map(|end| at_end[end][t]);
        // Folds of both ends stay.
        match folded[t] && first.max(second) > 0.0 {
            true if first > second => Follows::First,
            true if second > first => Follows::Second,
            _ => Follows::Both,
        }
    };
    (0..triangles.len()).map(of_triangle).collect()
}
