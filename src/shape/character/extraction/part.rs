//! The curve of one part of a surface: all steps in their order.

use nalgebra::{Point3, Vector3};

use super::aabb::AabbTree;
use super::axis;
use super::complex::Complex;
use super::contraction::{Contraction, Weights};
use super::extremities::{Heights, Top};
use super::homology::Classes;
use super::medial::{Ball, balls};
use super::parts::{self, Part};
use super::web::Web;
use super::{ExtractionError, ExtractionOptions, Frame, Keep, Observer, Round};
use super::{bends, caps, centering, cones, detours, pruning, reduction, resampling, sheet, sight, surgery, tips};
use crate::mesh::{TriMesh, neighbors_of_vertices};
use plumbline_num::run::{Run, Stopped};

/// Vertices whose balls are found at most: twice what is contracted, so that there is a choice.
const MAX_BALLS: usize = 12000;
/// Vertices that are contracted at most. At 4000 a horse of 48 000 loses an ear.
const MAX_VERTICES: usize = 6000;
/// Edges shorter than this share of the radius of the shape go before: about 25 stay around a limb. At 0.2 and at 0.3 ears
/// and toes of some models are lost.
const FINE: f64 = 0.25;
/// A size that all edges are longer than: the shortest go first, as many as must.
const MIN_LENGTH: f64 = 1e-12;
/// Radius by which vertices are spread, at least: bumps of scans have balls as small as they are.
const MIN_SIZE: f64 = 0.01;
/// Vertices that are contracted at least: coarser surfaces are divided.
const MIN_VERTICES: usize = 1500;
/// Triangles below which a part is a point.
const MIN_TRIANGLES: usize = 4;
/// Edges shorter than this collapse in the contraction.
const SHORT: f64 = 0.03;
/// Edges shorter than this share of the radius of the shape about them collapse in the contraction.
const SHORT_OF_RADIUS: f64 = 0.3;
/// How far the tips stand out that stay where this is asked for, in radii of the sphere of equal area.
const STANDS_OUT: f64 = 0.25;
/// Those that stay while the surface contracts.
const TIP: f64 = 0.15;
/// And those that get a branch if they have none, in radii of the shape there, and at least: fingers of large bodies.
const TIP_OF_RADIUS: f64 = 2.0;
const MIN_TIP: f64 = 0.04;
/// Likewise those of slim limbs on which no other tip is, with lengths in radii of the shape on the way: ears, horns, fingers that turn
/// back. Lips stand out by 2.1. And what counts as a radius at least.
const SLIM_TIP: f64 = 2.2;
const MIN_RADIUS: f64 = 0.02;
/// How far inside the surface a branch to a tip ends at least.
const INSIDE: f64 = 0.01;
/// Growth of the contraction per round.
const GROWTH: f64 = 1.2;
/// Distance of nodes.
const SPACING: f64 = 0.04;
/// Radius of a medial ball at most: twice that of the sphere of equal area.
const MAX_BALL_RADIUS: f64 = 2.0;
/// Passes of centering before branches are judged, and after.
const PASSES: [usize; 2] = [3, 6];
/// Junctions nearer than this share of the radius are one.
const ONE_JUNCTION: f64 = 0.5;

/// A curve in the place of the model.
pub(super) struct Found {
    pub(super) nodes: Vec<Point3<f64>>,
    pub(super) edges: Vec<[u32; 2]>,
    pub(super) radius: Vec<f64>,
    pub(super) node_of_vertex: Vec<u32>,
    pub(super) rounds: usize,
    /// Handles of the closed surface that was contracted.
    pub(super) handles: usize,
}

/// Extracts the curve of part `which.0` of `which.1`.
pub(super) fn extract(
    part: &Part,
    which: (usize, usize),
    options: &ExtractionOptions,
    observer: &mut Observer<'_>,
    run: &Run,
) -> Result<Found, ExtractionError> {
    let Some(frame) = Frame::of(&part.mesh).filter(|_| part.mesh.triangle_count() >= MIN_TRIANGLES) else {
        return Ok(point(part));
    };
    let positions: Vec<_> = part.mesh.positions().iter().map(|p| frame.normalized(p)).collect();
    let mut surface = part.mesh.with_positions(positions).map_err(|_| ExtractionError::Empty)?;
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
        reduction::reduce(&mut complex, MAX_BALLS, &pinned, &|_| MIN_LENGTH, run)?;
    }
    let balls = balls_of(&complex, &normals, run)?;
    let places: Vec<_> = complex.vertices().map(|v| complex.positions[v as usize]).collect();
    reduction::reduce(&mut complex, MAX_VERTICES, &pinned, &|v| FINE * balls[v as usize].radius.max(MIN_SIZE), run)?;
    run.check()?;
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
    let (web, rounds) = job.curve(&complex, &classes, &tips, observer)?;
    let Job { tree, frame, .. } = job;
    run.check()?;
    let mut found = found(&web, &tree, &frame, surface.vertex_count(), rounds);
    found.handles = handles.unwrap_or(0);
    // Of the two sides of a sheet the first counts.
    let mut node_of_vertex = vec![0; part.mesh.vertex_count()];
    over.iter().zip(&found.node_of_vertex).rev().for_each(|(v, node)| node_of_vertex[*v as usize] = *node);
    found.node_of_vertex = node_of_vertex;
    whole_regions(&part.mesh, &mut found.node_of_vertex);
    Ok(found)
}

/// Vertices that ends of the curve belong to.
#[derive(Default)]
struct Tips {
    /// They stay for good.
    kept: Vec<u32>,
    /// They stay while the surface contracts.
    held: Vec<u32>,
    /// They get a branch if they have none.
    shown: Vec<u32>,
}

impl Tips {
    fn of(complex: &Complex, balls: &[Ball], keep: &Keep) -> Self {
        let vertices = |tops: Vec<Top>| tops.into_iter().map(|t| t.vertex).collect::<Vec<u32>>();
        if let Keep::Vertices(_) = keep {
            return Self::default();
        }
        let heights = Heights::new(complex);
        let mut far = heights.tops(&|_| 1.0, &[]);
        if let Keep::Extrema = keep {
            far.retain(|t| t.stands_out >= STANDS_OUT);
            return Self { kept: vertices(far), ..Self::default() };
        }
        let radius = |v: u32| balls[v as usize].radius;
        far.retain(|t| t.stands_out >= TIP.min(MIN_TIP.max(TIP_OF_RADIUS * radius(t.vertex))));
        let (held, less) = far.into_iter().partition(|t| t.stands_out >= TIP);
        let (held, mut shown) = (vertices(held), vertices(less));
        let mut slim = heights.tops(&|v| radius(v).max(MIN_RADIUS), &[&held[..], &shown].concat());
        slim.retain(|t| t.stands_out >= SLIM_TIP);
        shown.extend(vertices(slim));
        Self { kept: Vec::new(), held, shown }
    }
}

/// What stays the same when a part is contracted again.
struct Job<'a> {
    options: &'a ExtractionOptions,
    which: (usize, usize),
    frame: Frame,
    tree: AabbTree,
    closed: bool,
    fine: &'a TriMesh,
    normals: &'a [Vector3<f64>],
    balls: &'a [Ball],
    /// Where the curve should be seen from.
    places: &'a [Point3<f64>],
    pinned: &'a [bool],
    run: &'a Run,
}

impl Job<'_> {
    /// The curve of the surface, with branches to the `tips`; and rounds that it took.
    fn curve(
        &self,
        complex: &Complex,
        classes: &Classes,
        tips: &Tips,
        observer: &mut Observer<'_>,
    ) -> Result<(Web, usize), ExtractionError> {
        let options = self.options;
        let weights = Weights {
            contraction: options.contraction,
            hold: options.hold,
            medial: options.medial,
            growth: GROWTH,
            short: SHORT,
            short_of_radius: SHORT_OF_RADIUS,
            rounds: options.rounds,
            still: 1e-4,
        };
        let mut pinned = self.pinned.to_vec();
        for v in &tips.held {
            pinned[*v as usize] = true;
        }
        let mut classes = classes.clone();
        let mut contraction = Contraction::new(complex.clone(), self.balls, pinned.clone(), weights);
        let rounds = contract(&mut contraction, self.which, options, &self.frame, observer, self.run)?;
        classes.follow(&contraction.complex.collapses);
        let graph = surgery::collapse_to_curve(&contraction.complex, &pinned, &mut classes, self.run)?;
        let mut web = Web::new(graph.nodes, &graph.edges, graph.node_of_vertex);
        for v in (0..pinned.len()).filter(|v| self.pinned[*v]) {
            let node = web.node_of(v) as usize;
            web.pinned[node] = true;
            web.nodes[node] = self.fine.positions()[v];
        }
        let end = |v: &u32| {
            let node = web.node_of(*v as usize);
            (node, self.end_at(*v as usize, &web.nodes[node as usize]))
        };
        let ends: Vec<(u32, Point3<f64>)> = tips.held.iter().chain(&tips.shown).map(end).collect();
        tips::end_at(&mut web, &ends);
        Ok((self.finished(&web)?, rounds))
    }

    /// The center of the ball at a tip; where its normal leads astray, as on a needle, a place just below it on the way to the curve.
    fn end_at(&self, tip: usize, curve: &Point3<f64>) -> Point3<f64> {
        let place = self.fine.positions()[tip];
        let center = place - self.normals[tip] * self.balls[tip].radius.max(INSIDE);
        if self.is_inside(&center) {
            return center;
        }
        place + (curve - place).try_normalize(0.0).unwrap_or_default() * INSIDE
    }

    /// Evened out, pruned, in the middle, in sight of the surface.
    fn finished(&self, web: &Web) -> Result<Web, ExtractionError> {
        let (tree, closed) = (&self.tree, self.closed);
        let mut web = resampling::resample(web, SPACING);
        centering::center(&mut web, tree, closed, PASSES[0], self.run)?;
        self.run.check()?;
        tips::trim(&mut web, tree, &|p| self.is_inside(p));
        if closed {
            tips::extend(&mut web, tree);
        }
        web = resampling::resample(&web, SPACING);
        self.take_away_what_says_nothing(&mut web)?;
        web = resampling::resample(&web, SPACING);
        tips::go_on(&mut web, tree);
        centering::center(&mut web, tree, closed, PASSES[1], self.run)?;
        self.run.check()?;
        tips::trim(&mut web, tree, &|p| self.is_inside(p));
        tips::go_on(&mut web, tree);
        axis::settle(&mut web, tree, self.run)?;
        web = resampling::resample(&web, SPACING);
        sight::draw(&mut web, tree, self.places, self.run)?;
        self.run.check()?;
        if closed {
            centering::keep_inside(&mut web, tree);
        }
        self.run.check()?;
        bends::round_off(&mut web, tree);
        resampling::thin(&mut web, tree, SPACING);
        Ok(web)
    }

    /// Takes branches away that are no limbs, and ways there and back.
    fn take_away_what_says_nothing(&self, web: &mut Web) -> Result<(), Stopped> {
        let (tree, prune) = (&self.tree, self.options.prune);
        let radii = centering::radii(web, tree);
        cones::take_crowns(web, &radii);
        pruning::prune(web, tree, &radii, prune, self.run)?;
        if cones::take_crowns(web, &radii) {
            pruning::prune(web, tree, &radii, prune, self.run)?;
        }
        pruning::join_junctions(web, &radii, ONE_JUNCTION, self.run)?;
        detours::cut(web, tree, &radii, self.run)?;
        cones::unhook(web, &radii);
        Ok(())
    }

    /// Where a surface has no inside, everything counts as inside.
    fn is_inside(&self, p: &Point3<f64>) -> bool {
        !self.closed || self.tree.encloses(p)
    }
}

/// A part too small for a curve.
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
        rounds: 0,
        handles: 0,
    }
}

/// The surface with all triangles turned: an open one may have come with its inside out.
fn inside_out(surface: &TriMesh) -> TriMesh {
    let turned = surface.triangles().iter().map(|[a, b, c]| [*a, *c, *b]).collect();
    TriMesh::new(surface.positions().to_vec(), turned).expect("the same corners and positions")
}

/// The surface with each triangle cut into four, until there are vertices enough. Vertices keep their numbers.
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

/// Balls of the vertices that are left; the others have none.
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

/// Contracts round by round; the number of rounds.
fn contract(
    contraction: &mut Contraction,
    (part, parts): (usize, usize),
    options: &ExtractionOptions,
    frame: &Frame,
    observer: &mut Observer<'_>,
    run: &Run,
) -> Result<usize, ExtractionError> {
    for round in 1..=options.rounds {
        run.step((round - 1) as f64 / options.rounds as f64)?;
        let done = contraction.step(run)?;
        let surface = || contracted(&contraction.complex, frame);
        let area_left = contraction.area_left();
        let told = Round { part, parts, round, rounds: options.rounds, area_left, surface: &surface };
        if observer(&told).is_break() {
            return Err(Stopped::Interrupted.into());
        }
        if done {
            return Ok(round);
        }
    }
    Ok(options.rounds)
}

/// The surface as it is now, without the vertices that are gone.
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

fn found(web: &Web, tree: &AabbTree, frame: &Frame, vertices: usize, rounds: usize) -> Found {
    let alive: Vec<u32> = web.alive().collect();
    let mut number = vec![0_u32; web.nodes.len()];
    alive.iter().zip(0..).for_each(|(v, i)| number[*v as usize] = i);
    let radii = centering::radii(web, tree);
    let joined = |v: &u32| web.neighbors(*v).iter().filter(|u| *v < **u).map(|u| [*v, *u]).collect::<Vec<_>>();
    Found {
        nodes: alive.iter().map(|v| frame.of_model(&web.nodes[*v as usize])).collect(),
        edges: alive.iter().flat_map(joined).map(|e| e.map(|v| number[v as usize])).collect(),
        radius: alive.iter().map(|v| radii[*v as usize] * frame.scale).collect(),
        node_of_vertex: (0..vertices).map(|v| number[web.node_of(v) as usize]).collect(),
        rounds,
        handles: 0,
    }
}

/// Makes the vertices of each node hang together: a divided surface may be connected where the one it was made of is not. Of
/// each node the largest piece stays, the others go to nodes beside them.
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
