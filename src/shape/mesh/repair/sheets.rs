//! From a triangle soup to oriented manifold sheets: edge adjacency, consistent orientation, and splitting of non-manifold
//! vertices.

use std::collections::VecDeque;

use nalgebra::{Point3, Vector3};

use super::report::describe;
use super::{RepairReport, Repaired, Soup};
use crate::mesh::half_edges::edge_groups;
use crate::mesh::{HalfEdges, TriMesh};
use plumbline_num::run::{Run, Stopped};
use plumbline_num::spatial::UnionFind;

/// Null index: no paired half-edge, no number yet. `u32::MAX` is no valid half-edge.
const NONE: u32 = u32::MAX;

/// Bonus of a convex pair at a non-manifold edge, in units of the cosine of [`Sheets::bend`]: a concave pair is preferred only
/// if it is flatter by more than this. Well above rounding, it decides ties: two solids that touch along an edge are separated.
const CONVEX_BONUS: f64 = 1e-6;

/// Edge adjacency and orientation of the triangles of a soup.
struct Sheets<'a> {
    soup: &'a Soup<'a>,
    /// Paired half-edge of each half-edge `3t + k` of the soup, or [`NONE`]. Symmetric: `across[across[h]] = h`. The two may
    /// run in the same direction as long as the triangles are not consistently oriented.
    across: Vec<u32>,
    /// Whether the orientation of each triangle is reversed.
    flipped: Vec<bool>,
    report: RepairReport,
}

/// Pairs triangles at edges, orients them, splits non-manifold vertices and builds the result.
pub(super) fn finish(soup: &Soup<'_>, report: RepairReport, run: &Run) -> Result<Repaired, Stopped> {
    let triangles = soup.corners.len();
    let mut sheets = Sheets { soup, across: vec![NONE; 3 * triangles], flipped: vec![false; triangles], report };
    run.check()?;
    sheets.pair();
    run.check()?;
    sheets.orient();
    let classes = sheets.split(run)?;
    run.check()?;
    sheets.face_outward(&classes);
    run.check()?;
    Ok(sheets.build(&classes))
}

impl Sheets<'_> {
    fn origin(&self, h: u32) -> u32 {
        self.soup.vertices(h as usize / 3)[h as usize % 3]
    }

    fn destination(&self, h: u32) -> u32 {
        self.origin(HalfEdges::next(h))
    }

    /// Pairs two half-edges.
    fn connect(&mut self, g: u32, h: u32) {
        self.across[g as usize] = h;
        self.across[h as usize] = g;
    }

    /// Removes the pairing of a half-edge.
    fn cut(&mut self, h: u32) {
        let other = std::mem::replace(&mut self.across[h as usize], NONE);
        if other != NONE {
            self.across[other as usize] = NONE;
        }
    }

    /// Pairs the triangles at each edge.
    fn pair(&mut self) {
        let origins: Vec<u32> = (0..self.soup.corners.len()).flat_map(|t| self.soup.vertices(t)).collect();
        for edge in edge_groups(&origins).iter() {
            match *edge {
                [_] => {}
                [(_, g), (_, h)] => self.connect(g, h),
                _ => {
                    let (p, q) = (self.origin(edge[0].1), self.destination(edge[0].1));
                    self.report.non_manifold_edges.push([p.min(q), p.max(q)]);
                    self.pair_crowd(edge);
                }
            }
        }
    }

    /// Pairs the triangles at a non-manifold edge greedily: consistently oriented pairs first, then by [`Self::bend`], so that
    /// the flattest pairs come first.
    fn pair_crowd(&mut self, edge: &[(u64, u32)]) {
        let mut pairs = Vec::new();
        for (k, &(_, g)) in edge.iter().enumerate() {
            for &(_, h) in &edge[k + 1..] {
                pairs.push((self.origin(g) == self.origin(h), self.bend(g, h), g, h));
            }
        }
        pairs.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
        for (_, _, g, h) in pairs {
            if self.across[g as usize] == NONE && self.across[h as usize] == NONE {
                self.connect(g, h);
            }
        }
    }

    /// Bending cost of a pair at an edge, one plus the cosine of the angle between the triangles: 0 for coplanar continuation,
    /// 2 for overlapping triangles; lower for convex than for concave angles by [`CONVEX_BONUS`].
    fn bend(&self, g: u32, h: u32) -> f64 {
        let position = |h: u32| self.soup.position(self.origin(h));
        let (a, b) = (position(g), position(HalfEdges::next(g)));
        let axis = (b - a).normalize();
        let outward = |h: u32| {
            let arm = position(HalfEdges::previous(h)) - a;
            (arm - axis * arm.dot(&axis)).try_normalize(0.0).unwrap_or_else(Vector3::zeros)
        };
        let (u, v) = (outward(g), outward(h));
        // A convex neighbor is below the plane of g.
        let convex = axis.cross(&u).dot(&v) < 0.0;
        let bonus = if convex { CONVEX_BONUS } else { 0.0 };
        1.0 + u.dot(&v) - bonus
    }

    /// Orients adjacent triangles consistently; cuts edges where that is impossible.
    fn orient(&mut self) {
        let mut seen = vec![false; self.soup.corners.len()];
        for seed in 0..seen.len() as u32 {
            if !std::mem::replace(&mut seen[seed as usize], true) {
                let members = self.orient_like(seed, &mut seen);
                self.reverse_to_majority(&members);
            }
        }
    }

    /// Orients all triangles reachable from `seed` consistently with it; returns them. Edges with consistent triangles are
    /// crossed first, so that few triangles are reversed and a non-orientable surface is cut where it is inconsistent already.
    fn orient_like(&mut self, seed: u32, seen: &mut [bool]) -> Vec<u32> {
        let (mut open, mut later, mut members) = (vec![seed], VecDeque::new(), Vec::new());
        loop {
            while let Some(t) = open.pop() {
                members.push(t);
                for h in 3 * t..3 * t + 3 {
                    let other = self.across[h as usize];
                    if other != NONE && self.origin(h) == self.origin(other) {
                        later.push_back(h);
                    } else if other != NONE {
                        self.reach(h, seen, &mut open);
                    }
                }
            }
            let Some(h) = later.pop_front() else { return members };
            self.reach(h, seen, &mut open);
        }
    }

    /// Crosses a half-edge: orients the adjacent triangle consistently, or cuts the edge if that triangle was visited with the
    /// opposite orientation.
    fn reach(&mut self, h: u32, seen: &mut [bool], open: &mut Vec<u32>) {
        let other = self.across[h as usize];
        if other == NONE {
            return;
        }
        let (t, u) = (h as usize / 3, other / 3);
        let wanted = self.flipped[t] != (self.origin(h) == self.origin(other));
        if !std::mem::replace(&mut seen[u as usize], true) {
            self.flipped[u as usize] = wanted;
            open.push(u);
        } else if self.flipped[u as usize] != wanted {
            self.cut(h);
            self.report.unorientable_cuts += 1;
        }
    }

    /// Reverses the orientation of triangles.
    fn reverse(&mut self, members: &[u32]) {
        for &t in members {
            self.flipped[t as usize] ^= true;
        }
    }

    /// Reverses the component if most of its area was reversed, so that the larger part of the area keeps its input
    /// orientation.
    fn reverse_to_majority(&mut self, members: &[u32]) {
        let area = |t: &u32| {
            let [a, b, c] = self.soup.vertices(*t as usize).map(|v| self.soup.position(v));
            (b - a).cross(&(c - a)).norm()
        };
        let reversed: f64 = members.iter().filter(|&&t| self.flipped[t as usize]).map(area).sum();
        if reversed > 0.5 * members.iter().map(area).sum::<f64>() {
            self.reverse(members);
        }
    }

    /// Orients closed components outwards. A component with consistent input orientation stays inwards if it is inside another
    /// component: it is a cavity.
    fn face_outward(&mut self, classes: &UnionFind) {
        let shells = self.shells(classes);
        for shell in &shells {
            if !(shell.closed && shell.volume < 0.0) {
                continue;
            }
            let around = |other: &Shell| other.closed && other.volume > 0.0 && other.encloses(shell);
            if !(shell.as_given && shells.iter().any(around)) {
                self.reverse(&shell.members);
            }
        }
        let reversed = (0..self.flipped.len()).filter(|&t| self.flipped[t]);
        self.report.flipped = reversed.map(|t| self.soup.corners[t][0] / 3).collect();
    }

    /// Edge-connected components after the vertex splits.
    fn shells(&self, classes: &UnionFind) -> Vec<Shell> {
        let origins: Vec<u32> = (0..self.across.len() as u32).map(|h| classes.root(h)).collect();
        let mut joined = UnionFind::new(self.flipped.len());
        let mut open = vec![false; self.flipped.len()];
        for edge in edge_groups(&origins).iter() {
            match *edge {
                [(_, g), (_, h)] => {
                    joined.join(g / 3, h / 3);
                }
                _ => edge.iter().for_each(|&(_, h)| open[h as usize / 3] = true),
            }
        }
        let mut number = vec![NONE; self.flipped.len()];
        let mut shells: Vec<Shell> = Vec::new();
        for t in 0..number.len() {
            let root = joined.root(t as u32) as usize;
            if root == t {
                number[t] = shells.len() as u32;
                shells.push(Shell::starting_at(self.soup.position(self.soup.vertices(t)[0])));
            }
            shells[number[root] as usize].add(self, t, open[t]);
        }
        shells
    }

    /// The vertices of a triangle in its current orientation.
    fn reversed(&self, t: usize) -> [u32; 3] {
        let [a, b, c] = self.soup.corners[t];
        if self.flipped[t] { [a, c, b] } else { [a, b, c] }
    }

    /// Sets of corners `3t + k` of the soup that become one vertex: corners connected across paired edges, that is one fan per
    /// vertex. Triangles at edges that are still non-manifold are disconnected until there are none.
    fn split(&mut self, run: &Run) -> Result<UnionFind, Stopped> {
        loop {
            run.check()?;
            // Join the corners at both ends of each paired edge; half-edges may run in the same or in opposite directions.
            let mut classes = UnionFind::new(self.across.len());
            for h in 0..self.across.len() as u32 {
                let other = self.across[h as usize];
                if other == NONE || other < h {
                    continue;
                }
                let (near, far) = if self.origin(h) == self.origin(other) {
                    (other, HalfEdges::next(other))
                } else {
                    (HalfEdges::next(other), other)
                };
                classes.join(h, near);
                classes.join(HalfEdges::next(h), far);
            }
            // Done if no edge is non-manifold; else disconnect the surplus triangles and repeat. Each iteration cuts more
            // edges.
            let crowded = self.crowded(&classes);
            if crowded.is_empty() {
                return Ok(classes);
            }
            for t in crowded {
                (3 * t..3 * t + 3).for_each(|h| self.cut(h));
                self.report.detached.push(self.soup.corners[t as usize][0] / 3);
            }
        }
    }

    /// Triangles at edges that are still non-manifold, because the sheets there are also connected elsewhere: all but one pair.
    fn crowded(&self, classes: &UnionFind) -> Vec<u32> {
        let origins: Vec<u32> = (0..self.across.len() as u32).map(|h| classes.root(h)).collect();
        let mut found = Vec::new();
        for edge in edge_groups(&origins).iter() {
            let first = edge[0].1;
            let along = |h: u32| {
                (origins[h as usize] == origins[first as usize])
                    != (self.flipped[h as usize / 3] != self.flipped[first as usize / 3])
            };
            let partner = edge[1..].iter().find(|&&(_, h)| !along(h)).map_or(first, |&(_, h)| h);
            found.extend(edge.iter().filter(|&&(_, h)| h != first && h != partner).map(|&(_, h)| h / 3));
        }
        found.sort_unstable();
        found.dedup();
        found
    }

    /// Builds the result: vertices, index maps, triangles and report.
    fn build(mut self, classes: &UnionFind) -> Repaired {
        let soup = self.soup;
        let corner_at = |h: usize| soup.corners[h / 3][h % 3];
        // Vertices of the result: sets of corners sorted by lowest source vertex, then by root corner, to keep the input order.
        let mut source = vec![NONE; self.across.len()];
        for h in 0..self.across.len() {
            let root = classes.root(h as u32) as usize;
            source[root] = source[root].min(soup.source(corner_at(h)));
        }
        let mut order: Vec<(u32, u32)> =
            (0..source.len()).filter(|&r| source[r] != NONE).map(|r| (source[r], r as u32)).collect();
        order.sort_unstable();
        let mut number = vec![NONE; source.len()];
        for (vertex, &(_, root)) in order.iter().enumerate() {
            number[root as usize] = vertex as u32;
        }
        let vertex_at = |h: usize| number[classes.root(h as u32) as usize];
        // Index map from the input, and the welded vertices that were split.
        let mut vertex_of_source = vec![None; soup.mesh.vertex_count()];
        let mut of_joined = vec![None; soup.mesh.vertex_count()];
        for h in 0..self.across.len() {
            let (given, vertex) = (soup.source(corner_at(h)) as usize, vertex_at(h));
            vertex_of_source[given].get_or_insert(vertex);
            let first = of_joined[soup.vertex(corner_at(h)) as usize].get_or_insert(vertex);
            if *first != vertex {
                self.report.non_manifold_vertices.push(soup.vertex(corner_at(h)));
            }
        }
        self.report.non_manifold_vertices.sort_unstable();
        self.report.non_manifold_vertices.dedup();
        for (given, vertex) in vertex_of_source.iter_mut().enumerate() {
            *vertex = vertex.or(of_joined[soup.joined.root(given as u32) as usize]);
        }
        // Positions of the welded representatives, triangles in their final orientation.
        let position = |&(source, _): &(u32, u32)| soup.position(soup.joined.root(source));
        let positions: Vec<Point3<f64>> = order.iter().map(position).collect();
        let triangle = |t: usize| {
            let [a, b, c] = [3 * t, 3 * t + 1, 3 * t + 2].map(vertex_at);
            if self.flipped[t] { [a, c, b] } else { [a, b, c] }
        };
        let triangles = (0..soup.corners.len()).map(triangle).collect();
        let source_corners = (0..soup.corners.len()).map(|t| self.reversed(t)).collect();
        let mesh = TriMesh::new(positions, triangles).expect("positions and corners of a mesh");
        // Properties of the result.
        let (report, component_of_vertex) = describe(&mesh, self.report);
        let source_of_vertex = order.iter().map(|&(source, _)| source).collect();
        Repaired { mesh, report, source_of_vertex, vertex_of_source, source_corners, component_of_vertex }
    }
}

/// An edge-connected component with its orientation.
#[expect(clippy::struct_excessive_bools, reason = "each is a fact of its own")]
struct Shell {
    members: Vec<u32>,
    /// Whether the component has no boundary edge.
    closed: bool,
    /// Whether some triangle keeps its orientation, and whether some was reversed.
    kept: bool,
    reversed: bool,
    /// Whether no triangle was reversed relative to another.
    as_given: bool,
    /// Six times the signed volume about `first`.
    volume: f64,
    /// Reference point: a vertex of the component, to avoid cancellation far from the origin.
    first: Point3<f64>,
    /// Bounding box.
    low: Point3<f64>,
    high: Point3<f64>,
}

impl Shell {
    fn starting_at(first: Point3<f64>) -> Self {
        let (low, high, members) = (first, first, Vec::new());
        Self { members, closed: true, kept: false, reversed: false, as_given: true, volume: 0.0, first, low, high }
    }

    fn add(&mut self, sheets: &Sheets<'_>, t: usize, open: bool) {
        let corners = sheets.soup.vertices(t).map(|v| sheets.soup.position(v));
        let [a, b, c] = corners.map(|p| p - self.first);
        let reversed = sheets.flipped[t];
        self.members.push(t as u32);
        self.closed &= !open;
        *(if reversed { &mut self.reversed } else { &mut self.kept }) = true;
        self.as_given = !(self.reversed && self.kept);
        self.volume += a.dot(&b.cross(&c)) * if reversed { -1.0 } else { 1.0 };
        for p in &corners {
            (self.low, self.high) = (self.low.inf(p), self.high.sup(p));
        }
    }

    /// Whether the bounding box strictly contains that of the other: a necessary condition for enclosure.
    fn encloses(&self, other: &Self) -> bool {
        (0..3).all(|k| self.low[k] < other.low[k] && other.high[k] < self.high[k])
    }
}
