//! Triangles that follow one end.
//!
//! Where the map turns a triangle over, or far against its neighbors, the mean of both poses collapses and folds, though one of them
//! does not. Such a triangle takes the pose alone in which it conforms better with those around it, and so do triangles with two
//! corners of such ones: an edge between a pose and a mean of both folds in turn. The other end takes over next to its own time.

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
    // How much better the folded triangles at a vertex conform in the second end. Folds of both ends stay.
    let mut votes = vec![0.0; ends[0].len()];
    for (t, corners) in triangles.iter().enumerate() {
        let [first, second] = [0, 1].map(|end| at_end[end][t]);
        if folded[t] && first.max(second) > 0.0 {
            for v in corners {
                votes[*v as usize] += second - first;
            }
        }
    }
    let of_triangle = |corners: &[u32; 3]| {
        let votes = corners.map(|v| votes[v as usize]);
        let sum: f64 = votes.iter().sum();
        if votes.iter().filter(|vote| **vote != 0.0).count() < 2 || sum == 0.0 {
            Follows::Both
        } else if sum > 0.0 {
            Follows::Second
        } else {
            Follows::First
        }
    };
    triangles.iter().map(of_triangle).collect()
}
