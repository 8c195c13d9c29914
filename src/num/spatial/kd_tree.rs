//! The nearest of many points: a balanced k-d tree without pointers.
//!
//! The middle point of a range by the widest axis is in its middle; the ranges left and right of it are the two halves. Built
//! in `O(n log² n)`, asked in `O(log n)`.

use nalgebra::Point3;

/// Points in the order of the tree.
#[derive(Clone, Debug)]
pub struct KdTree {
    /// Point, its number, and the axis that divides below it.
    nodes: Vec<(Point3<f64>, u32, u8)>,
}

/// Ranges up to this length are searched one by one: shorter ones cost more steps down the tree, longer ones more distances.
const LEAF: usize = 8;

impl KdTree {
    /// The tree of points; they are identified by their indices in the list.
    pub fn new(points: &[Point3<f64>]) -> Self {
        let mut nodes: Vec<_> = points.iter().zip(0..).map(|(p, i)| (*p, i, 0)).collect();
        divide(&mut nodes);
        Self { nodes }
    }

    /// The point nearest to `p` among those that `wanted` takes, and the square of its distance.
    pub fn nearest(&self, p: &Point3<f64>, wanted: impl Fn(u32) -> bool) -> Option<(u32, f64)> {
        self.nearest_within(p, f64::INFINITY, wanted)
    }

    /// Likewise, where the square of its distance is less than `square`.
    pub fn nearest_within(&self, p: &Point3<f64>, square: f64, wanted: impl Fn(u32) -> bool) -> Option<(u32, f64)> {
        let mut best = (u32::MAX, square);
        search::<false>(&self.nodes, p, &wanted, &mut best);
        (best.0 != u32::MAX).then_some(best)
    }

    /// The point nearest to `p`, of equally near ones the first of the list, and the square of its distance.
    pub fn first_nearest(&self, p: &Point3<f64>) -> Option<(u32, f64)> {
        let mut best = (u32::MAX, f64::INFINITY);
        search::<true>(&self.nodes, p, &|_| true, &mut best);
        (best.0 != u32::MAX).then_some(best)
    }
}

fn divide(nodes: &mut [(Point3<f64>, u32, u8)]) {
    if nodes.len() <= LEAF {
        return;
    }
    let first = nodes[0].0;
    let (low, high) = nodes.iter().fold((first, first), |(low, high), n| (low.inf(&n.0), high.sup(&n.0)));
    let axis = (high - low).imax();
    let middle = nodes.len() / 2;
    nodes.select_nth_unstable_by(middle, |a, b| a.0[axis].total_cmp(&b.0[axis]).then(a.1.cmp(&b.1)));
    nodes[middle].2 = axis as u8;
    let (left, right) = nodes.split_at_mut(middle);
    divide(left);
    divide(&mut right[1..]);
}

/// Takes what is nearer than the best, and with `FIRST` what is as near and of a lower number.
fn search<const FIRST: bool>(
    nodes: &[(Point3<f64>, u32, u8)],
    p: &Point3<f64>,
    wanted: &impl Fn(u32) -> bool,
    best: &mut (u32, f64),
) {
    let mut take = |n: &(Point3<f64>, u32, u8)| {
        let d = nalgebra::distance_squared(&n.0, p);
        if (d < best.1 || (FIRST && d == best.1 && n.1 < best.0)) && wanted(n.1) {
            *best = (n.1, d);
        }
    };
    if nodes.len() <= LEAF {
        nodes.iter().for_each(take);
        return;
    }
    let middle = nodes.len() / 2;
    let node = &nodes[middle];
    take(node);
    let axis = usize::from(node.2);
    let offset = p[axis] - node.0[axis];
    let (left, right) = (&nodes[..middle], &nodes[middle + 1..]);
    let (near, far) = if offset < 0.0 { (left, right) } else { (right, left) };
    search::<FIRST>(near, p, wanted, best);
    let beyond = offset * offset;
    if beyond < best.1 || (FIRST && beyond == best.1) {
        search::<FIRST>(far, p, wanted, best);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_point_is_the_one_that_a_search_of_all_finds() {
        let mut rng = fastrand::Rng::with_seed(3);
        let points: Vec<_> = (0..642).map(|_| Point3::from([0; 3].map(|_| 2.0 * rng.f64() - 1.0))).collect();
        let tree = KdTree::new(&points);
        for k in 0..200 {
            let k = f64::from(k);
            let p = Point3::new((k * 0.37).sin() * 2.0, (k * 0.73).cos(), (k * 1.31).sin() * 0.5);
            let wanted = |i: u32| !i.is_multiple_of(3);
            let slow = (0..points.len() as u32)
                .filter(|i| wanted(*i))
                .map(|i| nalgebra::distance_squared(&points[i as usize], &p))
                .fold(f64::INFINITY, f64::min);
            let (found, square) = tree.nearest(&p, wanted).unwrap();
            assert!(wanted(found) && square == slow);
            assert_eq!(tree.nearest_within(&p, slow, wanted), None);
            assert_eq!(tree.nearest_within(&p, slow * 1.001, wanted), Some((found, slow)));
        }
        assert_eq!(KdTree::new(&[]).nearest(&Point3::origin(), |_| true), None);
    }

    #[test]
    fn of_equally_near_points_the_first_is_found() {
        let mut random = fastrand::Rng::with_seed(5);
        // On a coarse lattice, so that distances tie.
        let mut point = || Point3::new(random.u32(0..9) as f64, random.u32(0..9) as f64, random.u32(0..9) as f64);
        let points: Vec<Point3<f64>> = (0..500).map(|_| point()).collect();
        let tree = KdTree::new(&points);
        for _ in 0..300 {
            let p = point() + nalgebra::Vector3::new(0.5, 0.0, 0.25);
            let all = points.iter().map(|q| (q - p).norm_squared());
            let least = all.clone().fold(f64::INFINITY, f64::min);
            assert_eq!(
                tree.first_nearest(&p),
                Some((all.clone().position(|d| d == least).expect("one") as u32, least))
            );
        }
        assert_eq!(KdTree::new(&[]).first_nearest(&Point3::origin()), None);
    }
}
