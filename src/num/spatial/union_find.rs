//! Sets that grow together: what edges or triangles connect, what is at one position.

/// A partition of `0..n`; each set is named by its lowest element.
pub struct UnionFind {
    /// An element of the same set, lower unless it is the lowest.
    up: Vec<u32>,
}

impl UnionFind {
    /// Every element by itself.
    pub fn new(n: usize) -> Self {
        Self { up: (0..n as u32).collect() }
    }

    /// The lowest element of the set of `v`.
    pub fn root(&self, mut v: u32) -> u32 {
        while self.up[v as usize] != v {
            v = self.up[v as usize];
        }
        v
    }

    /// Makes one set of those of `a` and `b`; whether they were two.
    pub fn join(&mut self, a: u32, b: u32) -> bool {
        let (a, b) = (self.shortened(a), self.shortened(b));
        self.up[a.max(b) as usize] = a.min(b);
        a != b
    }

    /// The lowest element of the set of each.
    pub fn roots(mut self) -> Vec<u32> {
        // Going up only ever leads down in number, so what comes before is final.
        for v in 0..self.up.len() {
            self.up[v] = self.up[self.up[v] as usize];
        }
        self.up
    }

    /// Number of elements that are not the lowest of their set.
    pub fn joined(&self) -> usize {
        self.up.iter().enumerate().filter(|&(v, &up)| v as u32 != up).count()
    }

    /// [`Self::root`], with the path there halved for the next time.
    fn shortened(&mut self, mut v: u32) -> u32 {
        while self.up[v as usize] != v {
            let up = self.up[self.up[v as usize] as usize];
            self.up[v as usize] = up;
            v = up;
        }
        v
    }
}

/// Lowest vertex of the connected component of each of `vertices` vertices.
pub fn components(vertices: usize, triangles: &[[u32; 3]]) -> Vec<u32> {
    let mut sets = UnionFind::new(vertices);
    for &[a, b, c] in triangles {
        sets.join(a, b);
        sets.join(b, c);
    }
    sets.roots()
}

/// The number of the connected component of each vertex, in the order of their lowest vertices, and how many there are.
pub fn numbered_components(vertices: usize, triangles: &[[u32; 3]]) -> (Vec<u32>, usize) {
    let mut component = components(vertices, triangles);
    let mut count = 0;
    for v in 0..vertices {
        let lowest = component[v] as usize;
        if lowest == v {
            component[v] = count;
            count += 1;
        } else {
            component[v] = component[lowest];
        }
    }
    (component, count as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sets_are_named_by_their_lowest_in_whatever_order_they_grow() {
        let mut pairs: Vec<(u32, u32)> = (0..97).map(|k| (k, k + 3)).collect();
        for seed in 0..20 {
            fastrand::Rng::with_seed(seed).shuffle(&mut pairs);
            let mut sets = UnionFind::new(101);
            assert!(pairs.iter().all(|&(a, b)| sets.join(b, a)), "each pair joins two");
            assert!(!sets.join(0, 99) && !sets.join(1, 1));
            assert_eq!(sets.joined(), 97);
            let expected: Vec<u32> = (0..101).map(|v| if v == 100 { 100 } else { v % 3 }).collect();
            assert!((0..101).all(|v| sets.root(v) == expected[v as usize]));
            assert_eq!(sets.roots(), expected);
        }
    }

    #[test]
    fn a_vertex_without_triangles_is_a_component() {
        let triangles = [[6, 4, 5], [1, 2, 4]];
        assert_eq!(components(7, &triangles), [0, 1, 1, 3, 1, 1, 1]);
        assert_eq!(numbered_components(7, &triangles), (vec![0, 1, 1, 2, 1, 1, 1], 3));
    }
}
