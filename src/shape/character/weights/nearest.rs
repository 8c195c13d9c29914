//! Nearest points: a k-d tree.

use nalgebra::Point3;

/// Points of a leaf.
const LEAF: usize = 8;

/// Points, sorted so that the middle of every range splits it along an axis.
#[derive(Debug)]
pub(super) struct Nearest {
    points: Vec<(Point3<f64>, u32)>,
}

impl Nearest {
    pub(super) fn new(points: Vec<Point3<f64>>) -> Self {
        let mut points: Vec<_> = points.into_iter().zip(0..).collect();
        sort(&mut points, 0);
        Self { points }
    }

    /// Number of the point nearest to `p` (the lowest of equals) and its squared distance; `None` without points.
    pub(super) fn find(&self, p: &Point3<f64>) -> Option<(usize, f64)> {
        let mut best = (u32::MAX, f64::INFINITY);
        search(&self.points, 0, p, &mut best);
        (best.0 != u32::MAX).then_some((best.0 as usize, best.1))
    }
}

fn sort(points: &mut [(Point3<f64>, u32)], axis: usize) {
    if points.len() <= LEAF {
        return;
    }
    let middle = points.len() / 2;
    points.select_nth_unstable_by(middle, |a, b| a.0[axis].total_cmp(&b.0[axis]).then(a.1.cmp(&b.1)));
    let (low, high) = points.split_at_mut(middle);
    sort(low, (axis + 1) % 3);
    sort(&mut high[1..], (axis + 1) % 3);
}

fn search(points: &[(Point3<f64>, u32)], axis: usize, p: &Point3<f64>, best: &mut (u32, f64)) {
    let mut look = |(q, n): &(Point3<f64>, u32)| {
        let d2 = (q - p).norm_squared();
        if d2 < best.1 || (d2 == best.1 && *n < best.0) {
            *best = (*n, d2);
        }
    };
    if points.len() <= LEAF {
        points.iter().for_each(look);
        return;
    }
    let middle = points.len() / 2;
    look(&points[middle]);
    let beyond = p[axis] - points[middle].0[axis];
    let (low, high) = (&points[..middle], &points[middle + 1..]);
    let (near, far) = if beyond < 0.0 { (low, high) } else { (high, low) };
    search(near, (axis + 1) % 3, p, best);
    if beyond * beyond <= best.1 {
        search(far, (axis + 1) % 3, p, best);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_tree_finds_the_nearest_of_all() {
        let mut random = fastrand::Rng::with_seed(5);
        // On a coarse lattice, so that distances tie.
        let mut point = || Point3::new(random.u32(0..9) as f64, random.u32(0..9) as f64, random.u32(0..9) as f64);
        let points: Vec<Point3<f64>> = (0..500).map(|_| point()).collect();
        let tree = Nearest::new(points.clone());
        for _ in 0..300 {
            let p = point() + nalgebra::Vector3::new(0.5, 0.0, 0.25);
            let all = points.iter().map(|q| (q - p).norm_squared());
            let least = all.clone().fold(f64::INFINITY, f64::min);
            assert_eq!(tree.find(&p), Some((all.clone().position(|d| d == least).expect("one"), least)));
        }
        assert_eq!(Nearest::new(vec![]).find(&Point3::origin()), None);
    }
}
