//! Extraction of the curve of one connected component: the sequence of all steps.

use std::collections::{BTreeMap, VecDeque};

use nalgebra::{Point3, Vector3};

use super::aabb::AabbTree;
use super::complex::Complex;
use super::contraction::Contraction;
use super::curve_graph::CurveGraph;
use super::geodesic_extrema::{GeodesicExtrema, Maximum};
use super::homology::Classes;
use super::medial::{Ball, balls};
use super::parts::{self, Part};
use super::{ContractionStep, ExtractionOptions, Frame, Keep, Observer, no_area};
use super::{caps, curve_energy, inside, pruning, reduction, resampling, sheet, surgery, tips};
use crate::character::{CharacterError, CurveSkeleton};
use crate::mesh::{TriMesh, neighbors_of_vertices};
use plumbline_num::run::{Run, Stopped};
use plumbline_num::spatial::UnionFind;

/// Largest number of vertices with medial balls: twice the contracted ones, so that the reduction can choose.
const MAX_BALLS: usize = 12000;
/// Largest number of contracted vertices. At 4000 a horse of 48 000 loses an ear.
const MAX_VERTICES: usize = 6000;
/// Edge length to which the surface is reduced, in local radii: about 25 edges around a limb. At 0.2 and at 0.3 ears and toes of some models
/// are lost.
const TARGET_EDGE_RADII: f64 = 0.25;
/// Edge size below every edge of a normalized model: only the vertex count then limits the reduction.
const MIN_EDGE_SIZE: f64 = 1e-12;
/// Lower bound of the radius in the target edge length: bumps of scans have tiny balls.
const MIN_REDUCTION_RADIUS: f64 = 0.01;
/// Smallest number of contracted vertices: coarser surfaces are subdivided.
const MIN_VERTICES: usize = 1500;
/// Number of vertices to which all components together are subdivided: 32 components in full. Beyond, the work would not depend on the
/// size of the input but on the number of its components.
const MAX_SUBDIVIDED: usize = 32 * MIN_VERTICES;
/// Smallest number of triangles; components with fewer become a point.
const MIN_TRIANGLES: usize = 4;
/// Smallest persistence of tips kept on request, in radii of the sphere of equal area.
const KEPT_TIP_PERSISTENCE: f64 = 0.25;
/// Smallest persistence of tips that get a branch, with lengths in local radii along the path. Pruning decides which of them are limbs: at 1.05
/// there are as many ends but for one model of 26, at 2.2 the six bumps of a ball get five.
const TIP_PERSISTENCE: f64 = 1.5;
/// Smallest persistence of tips that are pinned during contraction: without, large limbs shorten and loops turn; 2 to 6 differ little.
const PINNED_TIP_PERSISTENCE: f64 = 3.0;
/// Lower bound of the local radius in these lengths.
const MIN_RADIUS: f64 = 0.02;
/// Smallest depth of a branch end below a tip.
const MIN_TIP_DEPTH: f64 = 0.01;
/// Node spacing, in radii of the sphere of equal area.
const SPACING: f64 = 0.04;
/// About the largest number of nodes of a curve; longer curves get a larger spacing. A horse has 300; a tube needs more where it is more
/// than three thousand times as long as wide. Pruning takes the time of branches times nodes.
const MAX_NODES: f64 = 2000.0;
/// Largest radius of a medial ball: twice that of the sphere of equal area.
const MAX_BALL_RADIUS: f64 = 2.0;
/// Steps of the energy before and after pruning, at most: bounds of time. From 6 to 16 and from 8 to 16 differ little.
const ENERGY_STEPS: [usize; 2] = [10, 16];

/// The curve of a component.
#[derive(Default)]
pub(super) struct Found {
    /// In model coordinates.
    pub(super) curve: CurveSkeleton,
    pub(super) iterations: usize,
    /// Handles of the closed surface.
    pub(super) handles: usize,
    /// Factor by which the nodes are farther apart than usual.
    pub(super) spacing: f64,
    /// Whether the curve was refined to the end.
    pub(super) refined: bool,
}

/// Extracts the curve of component `which.0` of `which.1`.
pub(super) fn extract(
    part: &Part,
    which: (usize, usize),
    options: &ExtractionOptions,
    observer: &mut Observer<'_>,
    run: &Run,
) -> Result<Found, CharacterError> {
    let Some(frame) = Frame::of(&part.mesh).filter(|_| part.mesh.triangle_count() >= MIN_TRIANGLES) else {
        return Ok(point(part));
    };
    let positions: Vec<_> = part.mesh.positions().iter().map(|p| frame.normalized(p)).collect();
    // 1. Normalize, and close or thicken open surfaces.
    let mut surface = part.mesh.with_positions(positions).map_err(|_| no_area())?;
    run.check()?;
    let mut over: Vec<u32> = (0..surface.vertex_count() as u32).collect();
    if !parts::is_closed(&surface) {
        let reversed = inside_out(&surface);
        let solid =
            [&surface, &reversed].into_iter().find(|s| sheet::is_solid(s, &s.vertex_normals(), run)).map(caps::closed);
        if let Some(solid) = solid {
            surface = solid;
        } else if let Some((thick, sources)) = sheet::thickened(&surface) {
            (surface, over) = (thick, sources);
        }
    }
    run.check()?;
    let tree = AabbTree::new(surface.positions(), surface.triangles(), run);
    let (handles, closed) = (parts::handles(&surface).unwrap_or(0), parts::is_closed(&surface));
    run.check()?;
    // 2. Subdivide coarse surfaces, pin requested vertices, reduce fine ones.
    let fine = divided(&surface, MIN_VERTICES.min(MAX_SUBDIVIDED / which.1));
    let normals = fine.vertex_normals();
    let mut pinned = vec![false; fine.vertex_count()];
    if let Keep::Vertices(all) = &options.keep {
        let wanted = |sources: &Vec<u32>| sources.iter().any(|v| all.contains(v));
        over.iter()
            .enumerate()
            .filter(|(_, v)| wanted(&part.sources[**v as usize]))
            .for_each(|(v, _)| pinned[v] = true);
    }
    let mut complex = Complex::new(fine.positions().to_vec(), fine.triangles().to_vec());
    if complex.alive_count() > MAX_BALLS {
        reduction::reduce(&mut complex, MAX_BALLS, &pinned, &|_| MIN_EDGE_SIZE, run)?;
        let left = complex.alive_count();
        if left > MAX_BALLS {
            return Err(CharacterError::Input(format!(
                "a component of {} triangles cannot be simplified to fewer than {left} vertices, and at most {MAX_BALLS} can be contracted: \
                 too many of its triangles meet at vertices without forming a surface; remesh it, or leave it out",
                part.mesh.triangle_count()
            )));
        }
    }
    let balls = balls_of(&complex, &normals, run)?;
    reduction::reduce(
        &mut complex,
        MAX_VERTICES,
        &pinned,
        &|v| TARGET_EDGE_RADII * balls[v as usize].radius.max(MIN_REDUCTION_RADIUS),
        run,
    )?;
    run.check()?;
    // 3. Tips and homology classes, then the curve.
    let tips = Tips::of(&complex, &balls, &options.keep);
    for v in &tips.kept {
        pinned[*v as usize] = true;
    }
    run.check()?;
    let classes = Classes::new(&complex, run).unwrap_or_default();
    run.check()?;
    complex.collapses.clear();
    let job = Job {
        options,
        which,
        frame,
        tree,
        closed,
        fine: &fine,
        normals: &normals,
        balls: &balls,
        pinned: &pinned,
        run,
    };
    let (graph, iterations, spacing) = job.curve(complex, classes, &tips, observer)?;
    run.check()?;
    // 4. Back to the model: nodes of vertices, connected regions.
    let mut curve = of_model(&graph, &job.tree, &frame);
    // Of the two sides of a thickened sheet the first one counts.
    let mut node_of_vertex = vec![0; part.mesh.vertex_count()];
    over.iter().zip(&curve.node_of_vertex).rev().for_each(|(v, node)| node_of_vertex[*v as usize] = *node);
    whole_regions(&part.mesh, &mut node_of_vertex);
    curve.node_of_vertex = node_of_vertex;
    Ok(Found { curve, iterations, handles, spacing: spacing / SPACING, refined: !job.tree.is_exhausted() })
}

/// Vertices that are tips of the curve.
#[derive(Default)]
struct Tips {
    /// Pinned throughout, on request.
    kept: Vec<u32>,
    /// Pinned during contraction.
    fixed: Vec<u32>,
    /// Get a branch if they have none.
    shown: Vec<u32>,
}

impl Tips {
    fn of(complex: &Complex, balls: &[Ball], keep: &Keep) -> Self {
        let vertices = |maxima: Vec<Maximum>| maxima.into_iter().map(|t| t.vertex).collect::<Vec<u32>>();
        if let Keep::Vertices(_) = keep {
            return Self::default();
        }
        let extrema = GeodesicExtrema::new(complex);
        if let Keep::Extrema = keep {
            let mut far = extrema.maxima(&|_| 1.0);
            far.retain(|t| t.persistence >= KEPT_TIP_PERSISTENCE);
            return Self { kept: vertices(far), ..Self::default() };
        }
        let mut tips = extrema.maxima(&|v| balls[v as usize].radius.max(MIN_RADIUS));
        tips.retain(|t| t.persistence >= TIP_PERSISTENCE);
        let (fixed, shown) = tips.into_iter().partition(|t| t.persistence >= PINNED_TIP_PERSISTENCE);
        Self { kept: Vec::new(), fixed: vertices(fixed), shown: vertices(shown) }
    }
}

/// Inputs of a contraction.
struct Job<'a> {
    options: &'a ExtractionOptions,
    which: (usize, usize),
    frame: Frame,
    tree: AabbTree,
    closed: bool,
    fine: &'a TriMesh,
    normals: &'a [Vector3<f64>],
    balls: &'a [Ball],
    pinned: &'a [bool],
    run: &'a Run,
}

impl Job<'_> {
    /// The curve of the surface, with branches to the `tips`, the number of iterations, and the node spacing.
    fn curve(
        &self,
        complex: Complex,
        mut classes: Classes,
        tips: &Tips,
        observer: &mut Observer<'_>,
    ) -> Result<(CurveGraph, usize, f64), CharacterError> {
        let mut pinned = self.pinned.to_vec();
        for v in &tips.fixed {
            pinned[*v as usize] = true;
        }
        let mut contraction = Contraction::new(complex, self.balls, pinned.clone(), self.options);
        let iterations = self.contract(&mut contraction, observer)?;
        classes.follow(&contraction.complex.collapses);
        let mut graph = surgery::collapse_to_curve(contraction.complex, &pinned, &mut classes, self.run)?;
        self.lead_through_borders(&mut graph);
        for v in (0..pinned.len()).filter(|v| self.pinned[*v]) {
            let node = graph.node_of(v) as usize;
            graph.pinned[node] = true;
            graph.nodes[node] = self.fine.positions()[v];
        }
        let end = |v: &u32| {
            let node = graph.node_of(*v as usize);
            (node, self.end_at(*v as usize, &graph.nodes[node as usize]))
        };
        let ends: Vec<(u32, Point3<f64>)> = tips.fixed.iter().chain(&tips.shown).map(end).collect();
        tips::end_at(&mut graph, &ends);
        let length: f64 = graph.branches().iter().map(|branch| graph.branch_length(branch)).sum();
        let spacing = SPACING.max(length / MAX_NODES);
        Ok((self.finished(&graph, spacing)?, iterations, spacing))
    }

    /// Leads every edge that passes outside through the middle of the border between the regions of its nodes. An edge that is long beside the
    /// limb passes through a hole of the shape; the border goes around the limb.
    fn lead_through_borders(&self, graph: &mut CurveGraph) {
        let mut borders: BTreeMap<[u32; 2], (Vector3<f64>, f64)> = BTreeMap::new();
        for (t, corners) in self.fine.triangles().iter().enumerate() {
            let (nodes, p) = (corners.map(|v| graph.node_of(v as usize)), self.fine.corners(t));
            for [i, j, k] in [[0, 1, 2], [1, 2, 0], [2, 0, 1]] {
                // The border cuts corner i off.
                if nodes[i] != nodes[j] && nodes[j] == nodes[k] {
                    let length = 0.5 * nalgebra::distance(&p[j], &p[k]);
                    let middle = nalgebra::center(&p[i], &nalgebra::center(&p[j], &p[k]));
                    let edge = [nodes[i].min(nodes[j]), nodes[i].max(nodes[j])];
                    let (sum, whole) = borders.entry(edge).or_default();
                    *sum += middle.coords * length;
                    *whole += length;
                }
            }
        }
        for ([a, b], (sum, length)) in borders.into_iter().filter(|(_, (_, length))| *length > 0.0) {
            let [p, q] = [a, b].map(|v| graph.nodes[v as usize]);
            if graph.neighbors(a).contains(&b) && self.tree.is_hit(&p, &(q - p), 1.0) {
                graph.split(a, b, Point3::from(sum / length));
            }
        }
    }

    /// Runs the contraction; returns the number of iterations.
    fn contract(
        &self,
        contraction: &mut Contraction<'_>,
        observer: &mut Observer<'_>,
    ) -> Result<usize, CharacterError> {
        let ((part, parts), iterations) = (self.which, self.options.iterations);
        for iteration in 1..=iterations {
            self.run.step((iteration - 1) as f64 / iterations as f64)?;
            let done = contraction.step(self.run)?;
            let surface = || contracted(&contraction.complex, &self.frame);
            let area_left = contraction.area_left();
            let step = ContractionStep { part, parts, iteration, iterations, area_left, surface: &surface };
            if observer(&step).is_break() {
                return Err(Stopped::Interrupted.into());
            }
            if done {
                return Ok(iteration);
            }
        }
        Ok(iterations)
    }

    /// The ball center at a tip; if its normal is unreliable, as on a needle, a point just below the tip toward the curve.
    fn end_at(&self, tip: usize, curve: &Point3<f64>) -> Point3<f64> {
        let position = self.fine.positions()[tip];
        let center = position - self.normals[tip] * self.balls[tip].radius.max(MIN_TIP_DEPTH);
        if self.is_inside(&center) {
            return center;
        }
        position + (curve - position).try_normalize(0.0).unwrap_or_default() * MIN_TIP_DEPTH
    }

    /// Postprocessing: pruned, and of least energy.
    fn finished(&self, graph: &CurveGraph, spacing: f64) -> Result<CurveGraph, CharacterError> {
        let (tree, least, [before, after]) = (&self.tree, self.options.prune, ENERGY_STEPS);
        let mut graph = resampling::resample(graph, spacing);
        self.minimize(&mut graph, spacing, before)?;
        graph = resampling::resample(&graph, spacing);
        let radii = inside::radii(&graph, tree);
        pruning::prune(&mut graph, tree, &radii, least, self.run)?;
        pruning::cut_ends(&mut graph, tree, &radii, least);
        if self.closed {
            tips::extend(&mut graph, tree);
        }
        graph = self.run.complete(resampling::resample(&graph, spacing))?;
        self.minimize(&mut graph, spacing, after)?;
        tips::trim(&mut graph, tree, &|p| self.is_inside(p));
        graph = resampling::resample(&graph, spacing);
        if self.closed {
            inside::keep_inside(&mut graph, tree);
        }
        self.run.check()?;
        resampling::thin(&mut graph, tree, spacing);
        Ok(self.run.complete(graph)?)
    }

    /// Minimizes the energy of a curve whose ends are continued to the surface.
    fn minimize(&self, graph: &mut CurveGraph, spacing: f64, steps: usize) -> Result<(), CharacterError> {
        if self.closed {
            inside::bring_nodes_in(graph, &self.tree);
            tips::reach(graph, &self.tree, spacing);
        }
        curve_energy::minimize(graph, &self.tree, &self.frame.axes, (steps, spacing), self.run)
    }

    /// Inside test; everything is inside a surface without an inside.
    fn is_inside(&self, p: &Point3<f64>) -> bool {
        !self.closed || self.tree.encloses(p)
    }
}

/// Distance of the nodes of a surface of this area.
pub(super) fn node_distance(area: f64) -> f64 {
    SPACING * (area / (4.0 * std::f64::consts::PI)).sqrt()
}

/// The mean of the vertices, and the distance of the farthest one.
fn extent(part: &Part) -> (Point3<f64>, f64) {
    let all = part.mesh.positions();
    let first = all[0];
    let middle = first + all.iter().map(|p| p - first).sum::<nalgebra::Vector3<f64>>() / all.len() as f64;
    (middle, all.iter().map(|p| nalgebra::distance(p, &middle)).fold(0.0, f64::max))
}

/// A single node, if the component reaches no farther from its middle than `reach`.
pub(super) fn point_within(part: &Part, reach: f64) -> Option<Found> {
    (extent(part).1 <= reach).then(|| point(part))
}

/// The result for a component too small for a curve.
fn point(part: &Part) -> Found {
    let (middle, radius) = extent(part);
    let node_of_vertex = vec![0; part.mesh.vertex_count()];
    let curve = CurveSkeleton { nodes: vec![middle], edges: Vec::new(), radius: vec![radius], node_of_vertex };
    Found { curve, refined: true, ..Found::default() }
}

/// The surface with reversed orientation: an open surface may be inside out.
fn inside_out(surface: &TriMesh) -> TriMesh {
    let reversed = surface.triangles().iter().map(|[a, b, c]| [*a, *c, *b]).collect();
    TriMesh::new(surface.positions().to_vec(), reversed).expect("the same corners and positions")
}

/// Subdivides triangles into four until there are at least `least` vertices. Vertices keep their indices.
fn divided(surface: &TriMesh, least: usize) -> TriMesh {
    let mut mesh = surface.clone();
    while mesh.vertex_count() < least {
        let mut positions = mesh.positions().to_vec();
        let mut middle = std::collections::HashMap::new();
        let mut triangles = Vec::with_capacity(4 * mesh.triangle_count());
        for &[a, b, c] in mesh.triangles() {
            let [ab, bc, ca] = [(a, b), (b, c), (c, a)].map(|(p, q)| {
                *middle.entry((p.min(q), p.max(q))).or_insert_with(|| {
                    positions.push(nalgebra::center(&positions[p as usize], &positions[q as usize]));
                    positions.len() as u32 - 1
                })
            });
            triangles.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
        }
        mesh = TriMesh::new(positions, triangles).expect("midpoints of finite positions");
    }
    mesh
}

/// Medial balls of the remaining vertices; zero for others.
fn balls_of(complex: &Complex, normals: &[Vector3<f64>], run: &Run) -> Result<Vec<Ball>, Stopped> {
    let alive: Vec<u32> = complex.vertices().collect();
    let points: Vec<_> = alive.iter().map(|v| complex.positions[*v as usize]).collect();
    let normals: Vec<_> = alive.iter().map(|v| normals[*v as usize]).collect();
    let mut all = vec![Ball { center: Point3::origin(), radius: 0.0 }; complex.positions.len()];
    for (v, ball) in alive.iter().zip(balls(&points, &normals, MAX_BALL_RADIUS, run)?) {
        all[*v as usize] = ball;
    }
    Ok(all)
}

/// The current surface, without merged vertices.
fn contracted(complex: &Complex, frame: &Frame) -> TriMesh {
    let mut number = vec![0; complex.positions.len()];
    let mut positions = Vec::new();
    for v in complex.vertices() {
        number[v as usize] = positions.len() as u32;
        positions.push(frame.of_model(&complex.positions[v as usize]));
    }
    let triangles = complex.faces().map(|t| t.map(|v| number[v as usize])).collect();
    TriMesh::new(positions, triangles).expect("a contraction keeps finite positions")
}

/// The curve in model coordinates.
fn of_model(graph: &CurveGraph, tree: &AabbTree, frame: &Frame) -> CurveSkeleton {
    let alive: Vec<u32> = graph.alive().collect();
    let mut number = vec![0_u32; graph.nodes.len()];
    alive.iter().zip(0..).for_each(|(v, i)| number[*v as usize] = i);
    let radii = inside::radii(graph, tree);
    let joined = |v: &u32| graph.neighbors(*v).iter().filter(|u| *v < **u).map(|u| [*v, *u]).collect::<Vec<_>>();
    CurveSkeleton {
        nodes: alive.iter().map(|v| frame.of_model(&graph.nodes[*v as usize])).collect(),
        edges: alive.iter().flat_map(joined).map(|e| e.map(|v| number[v as usize])).collect(),
        radius: alive.iter().map(|v| radii[*v as usize] * frame.scale).collect(),
        node_of_vertex: (0..graph.vertex_count()).map(|v| number[graph.node_of(v) as usize]).collect(),
    }
}

/// Makes the vertices of each node connected: a subdivided or welded surface may be connected where the original is not. The largest piece of
/// each node stays; others are reassigned to adjacent nodes.
fn whole_regions(mesh: &TriMesh, node_of_vertex: &mut [u32]) {
    let neighbors = neighbors_of_vertices(mesh.vertex_count(), mesh.triangles());
    let vertices = || 0..mesh.vertex_count() as u32;
    let mut pieces = UnionFind::new(mesh.vertex_count());
    for (v, u) in vertices().flat_map(|v| neighbors[v as usize].iter().map(move |u| (v, *u))) {
        if node_of_vertex[v as usize] == node_of_vertex[u as usize] {
            pieces.join(v, u);
        }
    }
    let piece_of_vertex = pieces.roots();
    let mut sizes = vec![0_usize; mesh.vertex_count()];
    for piece in &piece_of_vertex {
        sizes[*piece as usize] += 1;
    }
    let mut largest = std::collections::HashMap::new();
    for v in vertices().filter(|v| piece_of_vertex[*v as usize] == *v) {
        let best = largest.entry(node_of_vertex[v as usize]).or_insert(v);
        if sizes[v as usize] > sizes[*best as usize] {
            *best = v;
        }
    }
    let (mut queue, strays): (VecDeque<u32>, VecDeque<u32>) =
        vertices().partition(|v| largest[&node_of_vertex[*v as usize]] == piece_of_vertex[*v as usize]);
    for v in strays {
        node_of_vertex[v as usize] = u32::MAX;
    }
    while let Some(v) = queue.pop_front() {
        for &w in &neighbors[v as usize] {
            if node_of_vertex[w as usize] == u32::MAX {
                node_of_vertex[w as usize] = node_of_vertex[v as usize];
                queue.push_back(w);
            }
        }
    }
}
