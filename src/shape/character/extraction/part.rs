//! Extraction of the curve of one connected component: the sequence of all steps.

use nalgebra::{Point3, Vector3};

use super::aabb::AabbTree;
use super::axis;
use super::complex::Complex;
use super::contraction::{Contraction, Weights};
use super::curve_graph::CurveGraph;
use super::geodesic_extrema::{GeodesicExtrema, Maximum};
use super::homology::Classes;
use super::medial::{Ball, balls};
use super::parts::{self, Part};
use super::{ContractionStep, ExtractionOptions, Frame, Keep, Observer, no_area};
use super::{
    bends, caps, centering, corner_branches, detours, pruning, reduction, resampling, sheet, sight, surgery, tips,
};
use crate::character::CharacterError;
use crate::mesh::{TriMesh, neighbors_of_vertices};
use plumbline_num::run::{Run, Stopped};

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
/// Smallest number of triangles; components with fewer become a point.
const MIN_TRIANGLES: usize = 4;
/// Length below which edges collapse during contraction.
const COLLAPSE_LENGTH: f64 = 0.03;
/// Length below which edges collapse during contraction, in local radii.
const COLLAPSE_RADII: f64 = 0.3;
/// Smallest persistence of tips kept on request, in radii of the sphere of equal area.
const KEPT_TIP_PERSISTENCE: f64 = 0.25;
/// Smallest persistence of tips that are pinned during contraction.
const PINNED_TIP_PERSISTENCE: f64 = 0.15;
/// Smallest persistence of tips that get a branch if they have none, in local radii: fingers of large bodies.
const TIP_PERSISTENCE_RADII: f64 = 2.0;
/// Lower bound of that persistence.
const MIN_TIP_PERSISTENCE: f64 = 0.04;
/// Smallest persistence of tips of slim limbs without other tips, with lengths in local radii along the path: ears, horns, fingers that turn
/// back. Lips have 2.1.
const SLIM_TIP_PERSISTENCE: f64 = 2.2;
/// Lower bound of the local radius in these lengths.
const MIN_RADIUS: f64 = 0.02;
/// Smallest depth of a branch end below a tip.
const MIN_TIP_DEPTH: f64 = 0.01;
/// Growth of the contraction weight per iteration; Au et al. use 2.
const CONTRACTION_GROWTH: f64 = 1.2;
/// Node spacing, in radii of the sphere of equal area.
const SPACING: f64 = 0.04;
/// Largest radius of a medial ball: twice that of the sphere of equal area.
const MAX_BALL_RADIUS: f64 = 2.0;
/// Centering passes before and after pruning.
const CENTERING_PASSES: [usize; 2] = [3, 6];
/// Distance below which junctions merge, in local radii.
const JUNCTION_MERGE_RADII: f64 = 0.5;

/// A curve in model coordinates.
pub(super) struct Found {
    pub(super) nodes: Vec<Point3<f64>>,
    pub(super) edges: Vec<[u32; 2]>,
    pub(super) radius: Vec<f64>,
    pub(super) node_of_vertex: Vec<u32>,
    pub(super) iterations: usize,
    /// Handles of the closed surface.
    pub(super) handles: usize,
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
    let mut tree = AabbTree::new(surface.positions(), surface.triangles());
    let mut handles = parts::handles(&surface);
    let mut over: Vec<u32> = (0..surface.vertex_count() as u32).collect();
    let mut closed = parts::is_closed(&surface);
    run.check()?;
    if !closed {
        let turned = inside_out(&surface);
        let solid = [&surface, &turned].into_iter().find(|s| sheet::is_solid(s, &s.vertex_normals())).map(caps::closed);
        if let Some(solid) = solid {
            surface = solid;
        } else if let Some((thick, sources)) = sheet::thickened(&surface) {
            (surface, over) = (thick, sources);
        }
        run.check()?;
        tree = AabbTree::new(surface.positions(), surface.triangles());
        handles = parts::handles(&surface);
        closed = parts::is_closed(&surface);
    }
    run.check()?;
    // 2. Subdivide coarse surfaces, pin requested vertices, reduce fine ones.
    let fine = divided(&surface);
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
    }
    let balls = balls_of(&complex, &normals, run)?;
    let places: Vec<_> = complex.vertices().map(|v| complex.positions[v as usize]).collect();
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
    let classes = Classes::new(&complex).unwrap_or_else(Classes::trivial);
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
        places: &places,
        pinned: &pinned,
        run,
    };
    let (graph, iterations) = job.curve(&complex, &classes, &tips, observer)?;
    let Job { tree, frame, .. } = job;
    run.check()?;
    // 4. Back to the model: nodes of vertices, connected regions.
    let mut found = found(&graph, &tree, &frame, surface.vertex_count(), iterations);
    found.handles = handles.unwrap_or(0);
    // Of the two sides of a thickened sheet the first one counts.
    let mut node_of_vertex = vec![0; part.mesh.vertex_count()];
    over.iter().zip(&found.node_of_vertex).rev().for_each(|(v, node)| node_of_vertex[*v as usize] = *node);
    found.node_of_vertex = node_of_vertex;
    whole_regions(&part.mesh, &mut found.node_of_vertex);
    Ok(found)
}

/// Vertices that are tips of the curve.
#[derive(Default)]
struct Tips {
    /// Pinned throughout, on request.
    kept: Vec<u32>,
    /// Pinned during contraction.
    held: Vec<u32>,
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
        let mut far = extrema.maxima(&|_| 1.0, &[]);
        if let Keep::Extrema = keep {
            far.retain(|t| t.persistence >= KEPT_TIP_PERSISTENCE);
            return Self { kept: vertices(far), ..Self::default() };
        }
        let radius = |v: u32| balls[v as usize].radius;
        far.retain(|t| {
            t.persistence
                >= PINNED_TIP_PERSISTENCE.min(MIN_TIP_PERSISTENCE.max(TIP_PERSISTENCE_RADII * radius(t.vertex)))
        });
        let (held, less) = far.into_iter().partition(|t| t.persistence >= PINNED_TIP_PERSISTENCE);
        let (held, mut shown) = (vertices(held), vertices(less));
        let mut slim = extrema.maxima(&|v| radius(v).max(MIN_RADIUS), &[&held[..], &shown].concat());
        slim.retain(|t| t.persistence >= SLIM_TIP_PERSISTENCE);
        shown.extend(vertices(slim));
        Self { kept: Vec::new(), held, shown }
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
    /// Surface points from which the curve should be visible.
    places: &'a [Point3<f64>],
    pinned: &'a [bool],
    run: &'a Run,
}

impl Job<'_> {
    /// The curve of the surface, with branches to the `tips`, and the number of iterations.
    fn curve(
        &self,
        complex: &Complex,
        classes: &Classes,
        tips: &Tips,
        observer: &mut Observer<'_>,
    ) -> Result<(CurveGraph, usize), CharacterError> {
        let options = self.options;
        let weights = Weights {
            contraction: options.contraction,
            attraction: options.attraction,
            medial: options.medial,
            growth: CONTRACTION_GROWTH,
            short: COLLAPSE_LENGTH,
            short_of_radius: COLLAPSE_RADII,
            iterations: options.iterations,
            tolerance: 1e-4,
        };
        let mut pinned = self.pinned.to_vec();
        for v in &tips.held {
            pinned[*v as usize] = true;
        }
        let mut classes = classes.clone();
        let mut contraction = Contraction::new(complex.clone(), self.balls, pinned.clone(), weights);
        let iterations = contract(&mut contraction, self.which, options, &self.frame, observer, self.run)?;
        classes.follow(&contraction.complex.collapses);
        let collapsed = surgery::collapse_to_curve(&contraction.complex, &pinned, &mut classes, self.run)?;
        let mut graph = CurveGraph::new(collapsed.nodes, &collapsed.edges, collapsed.node_of_vertex);
        for v in (0..pinned.len()).filter(|v| self.pinned[*v]) {
            let node = graph.node_of(v) as usize;
            graph.pinned[node] = true;
            graph.nodes[node] = self.fine.positions()[v];
        }
        let end = |v: &u32| {
            let node = graph.node_of(*v as usize);
            (node, self.end_at(*v as usize, &graph.nodes[node as usize]))
        };
        let ends: Vec<(u32, Point3<f64>)> = tips.held.iter().chain(&tips.shown).map(end).collect();
        tips::end_at(&mut graph, &ends);
        Ok((self.finished(&graph)?, iterations))
    }

    /// The ball center at a tip; if its normal is unreliable, as on a needle, a point just below the tip toward the curve.
    fn end_at(&self, tip: usize, curve: &Point3<f64>) -> Point3<f64> {
        let place = self.fine.positions()[tip];
        let center = place - self.normals[tip] * self.balls[tip].radius.max(MIN_TIP_DEPTH);
        if self.is_inside(&center) {
            return center;
        }
        place + (curve - place).try_normalize(0.0).unwrap_or_default() * MIN_TIP_DEPTH
    }

    /// Postprocessing: resampled, pruned, centered, visible from the surface.
    fn finished(&self, graph: &CurveGraph) -> Result<CurveGraph, CharacterError> {
        let (tree, closed) = (&self.tree, self.closed);
        let mut graph = resampling::resample(graph, SPACING);
        centering::center(&mut graph, tree, closed, CENTERING_PASSES[0], self.run)?;
        self.run.check()?;
        tips::trim(&mut graph, tree, &|p| self.is_inside(p));
        if closed {
            tips::extend(&mut graph, tree);
        }
        graph = resampling::resample(&graph, SPACING);
        self.remove_insignificant_branches(&mut graph)?;
        graph = resampling::resample(&graph, SPACING);
        tips::extrapolate_ends(&mut graph, tree);
        centering::center(&mut graph, tree, closed, CENTERING_PASSES[1], self.run)?;
        self.run.check()?;
        tips::trim(&mut graph, tree, &|p| self.is_inside(p));
        tips::extrapolate_ends(&mut graph, tree);
        axis::settle(&mut graph, tree, self.run)?;
        graph = resampling::resample(&graph, SPACING);
        sight::draw(&mut graph, tree, self.places, self.run)?;
        self.run.check()?;
        if closed {
            centering::keep_inside(&mut graph, tree);
        }
        self.run.check()?;
        bends::round_off(&mut graph, tree);
        resampling::thin(&mut graph, tree, SPACING);
        Ok(graph)
    }

    /// Removes branches that are no limbs, and detours.
    fn remove_insignificant_branches(&self, graph: &mut CurveGraph) -> Result<(), Stopped> {
        let (tree, prune) = (&self.tree, self.options.prune);
        let radii = centering::radii(graph, tree);
        corner_branches::remove_corner_clusters(graph, &radii);
        pruning::prune(graph, tree, &radii, prune, self.run)?;
        if corner_branches::remove_corner_clusters(graph, &radii) {
            pruning::prune(graph, tree, &radii, prune, self.run)?;
        }
        pruning::join_junctions(graph, &radii, JUNCTION_MERGE_RADII, self.run)?;
        detours::cut(graph, tree, &radii, self.run)?;
        corner_branches::remove_rim_hooks(graph, &radii);
        Ok(())
    }

    /// Inside test; everything is inside a surface without an inside.
    fn is_inside(&self, p: &Point3<f64>) -> bool {
        !self.closed || self.tree.encloses(p)
    }
}

/// The result for a component too small for a curve.
fn point(part: &Part) -> Found {
    let all = part.mesh.positions();
    let first = all[0];
    let middle = first + all.iter().map(|p| p - first).sum::<nalgebra::Vector3<f64>>() / all.len() as f64;
    let radius = all.iter().map(|p| nalgebra::distance(p, &middle)).fold(0.0, f64::max);
    Found {
        nodes: vec![middle],
        edges: Vec::new(),
        radius: vec![radius],
        node_of_vertex: vec![0; all.len()],
        iterations: 0,
        handles: 0,
    }
}

/// The surface with reversed orientation: an open surface may be inside out.
fn inside_out(surface: &TriMesh) -> TriMesh {
    let turned = surface.triangles().iter().map(|[a, b, c]| [*a, *c, *b]).collect();
    TriMesh::new(surface.positions().to_vec(), turned).expect("the same corners and positions")
}

/// Subdivides triangles into four until there are enough vertices. Vertices keep their indices.
fn divided(surface: &TriMesh) -> TriMesh {
    let mut mesh = surface.clone();
    while mesh.vertex_count() < MIN_VERTICES {
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

/// Runs the contraction; returns the number of iterations.
fn contract(
    contraction: &mut Contraction,
    (part, parts): (usize, usize),
    options: &ExtractionOptions,
    frame: &Frame,
    observer: &mut Observer<'_>,
    run: &Run,
) -> Result<usize, CharacterError> {
    for iteration in 1..=options.iterations {
        run.step((iteration - 1) as f64 / options.iterations as f64)?;
        let done = contraction.step(run)?;
        let surface = || contracted(&contraction.complex, frame);
        let area_left = contraction.area_left();
        let told =
            ContractionStep { part, parts, iteration, iterations: options.iterations, area_left, surface: &surface };
        if observer(&told).is_break() {
            return Err(Stopped::Interrupted.into());
        }
        if done {
            return Ok(iteration);
        }
    }
    Ok(options.iterations)
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

fn found(graph: &CurveGraph, tree: &AabbTree, frame: &Frame, vertices: usize, iterations: usize) -> Found {
    let alive: Vec<u32> = graph.alive().collect();
    let mut number = vec![0_u32; graph.nodes.len()];
    alive.iter().zip(0..).for_each(|(v, i)| number[*v as usize] = i);
    let radii = centering::radii(graph, tree);
    let joined = |v: &u32| graph.neighbors(*v).iter().filter(|u| *v < **u).map(|u| [*v, *u]).collect::<Vec<_>>();
    Found {
        nodes: alive.iter().map(|v| frame.of_model(&graph.nodes[*v as usize])).collect(),
        edges: alive.iter().flat_map(joined).map(|e| e.map(|v| number[v as usize])).collect(),
        radius: alive.iter().map(|v| radii[*v as usize] * frame.scale).collect(),
        node_of_vertex: (0..vertices).map(|v| number[graph.node_of(v) as usize]).collect(),
        iterations,
        handles: 0,
    }
}

/// Makes the vertices of each node connected: a subdivided or welded surface may be connected where the original is not. The largest piece of
/// each node stays; others are reassigned to adjacent nodes.
fn whole_regions(mesh: &TriMesh, node_of_vertex: &mut [u32]) {
    let neighbors = neighbors_of_vertices(mesh.vertex_count(), mesh.triangles());
    let mut piece_of_vertex = vec![usize::MAX; mesh.vertex_count()];
    let mut pieces: Vec<Vec<u32>> = Vec::new();
    for v in 0..mesh.vertex_count() as u32 {
        if piece_of_vertex[v as usize] != usize::MAX {
            continue;
        }
        let mut piece = vec![v];
        piece_of_vertex[v as usize] = pieces.len();
        let mut at = 0;
        while let Some(u) = piece.get(at).copied() {
            at += 1;
            for &w in &neighbors[u as usize] {
                if piece_of_vertex[w as usize] == usize::MAX && node_of_vertex[w as usize] == node_of_vertex[v as usize]
                {
                    piece_of_vertex[w as usize] = pieces.len();
                    piece.push(w);
                }
            }
        }
        pieces.push(piece);
    }
    let mut largest = std::collections::HashMap::new();
    for (i, piece) in pieces.iter().enumerate() {
        let best = largest.entry(node_of_vertex[piece[0] as usize]).or_insert(i);
        if piece.len() > pieces[*best].len() {
            *best = i;
        }
    }
    let settled = |v: usize, nodes: &[u32]| nodes[v] != u32::MAX;
    for (i, piece) in pieces.iter().enumerate() {
        if largest[&node_of_vertex[piece[0] as usize]] != i {
            piece_of_vertex[piece[0] as usize] = usize::MAX;
        }
    }
    let strays: Vec<u32> =
        pieces.iter().filter(|p| piece_of_vertex[p[0] as usize] == usize::MAX).flatten().copied().collect();
    for v in &strays {
        node_of_vertex[*v as usize] = u32::MAX;
    }
    let mut queue: std::collections::VecDeque<u32> =
        (0..mesh.vertex_count() as u32).filter(|v| settled(*v as usize, node_of_vertex)).collect();
    while let Some(v) = queue.pop_front() {
        for &w in &neighbors[v as usize] {
            if !settled(w as usize, node_of_vertex) {
                node_of_vertex[w as usize] = node_of_vertex[v as usize];
                queue.push_back(w);
            }
        }
    }
}
