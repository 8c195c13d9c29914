//! Sets that grow together, such as the pieces of a graph: union and find, with paths halved on the way.

/// A partition of `0..n`.
pub(super) struct UnionFind {
    into: Vec<u32>,
}

impl UnionFind {
    /// Every element by itself.
    pub(super) fn new(n: usize) -> Self {
        Self { into: (0..n as u32).collect() }
    }

    /// The smallest element of the set of `v`.
    pub(super) fn root(&mut self, mut v: u32) -> u32 {
        while self.into[v as usize] != v {
            self.into[v as usize] = self.into[self.into[v as usize] as usize];
            v = self.into[v as usize];
        }
        v
    }

    /// Makes one set of those of `a` and `b`; whether they were two.
    pub(super) fn join(&mut self, a: u32, b: u32) -> bool {
        let (a, b) = (self.root(a), self.root(b));
        self.into[a.max(b) as usize] = a.min(b);
        a != b
    }
}
