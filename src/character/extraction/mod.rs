//! Skeleton extraction by mesh contraction.
mod aabb;
mod centering;
mod complex;
mod contraction;
mod error;
mod homology;
mod kd_tree;
mod medial;
mod order;
mod pruning;
mod reduction;
mod resampling;
mod surgery;
mod web;

pub use error::ExtractionError;
use nalgebra::{Point3, Vector3};

use complex::Complex;
use contraction::{Contraction, Weights};

pub(self) fn env(name: &str, d: f64) -> f64 {
    std::env::var(name).ok().and_then(|s| s.parse().ok()).unwrap_or(d)
}

/// Trial.
pub fn trial(mesh: &crate::mesh::TriMesh) -> (Vec<Point3<f64>>, Vec<[u32; 2]>, f64) {
    let t0 = std::time::Instant::now();
    let area = mesh.area();
    let scale = (area / (4.0 * std::f64::consts::PI)).sqrt();
    let mid = mesh.positions()[0];
    let positions: Vec<Point3<f64>> = mesh.positions().iter().map(|p| Point3::from((p - mid) / scale)).collect();
    let normalized = crate::mesh::TriMesh::new(positions.clone(), mesh.triangles().to_vec()).unwrap();
    let normals = normalized.vertex_normals();
    let mut complex = Complex::new(positions.clone(), mesh.triangles().to_vec());
    let t1 = t0.elapsed();
    let none = vec![false; positions.len()];
    reduction::reduce(&mut complex, env("TARGET", 4000.0) as usize, &none);
    let t2 = t0.elapsed();
    let mut classes = homology::Classes::new(&complex);
    eprintln!("classes {:?} rank {:?} {:?}", classes.is_some(), classes.as_ref().map(|c| c.rank()), t0.elapsed());
    complex.collapses.clear();
    let alive: Vec<u32> = complex.vertices().collect();
    let p: Vec<_> = alive.iter().map(|v| positions[*v as usize]).collect();
    let n: Vec<Vector3<f64>> = alive.iter().map(|v| normals[*v as usize]).collect();
    let found = medial::balls(&p, &n, 2.0);
    let mut balls = vec![medial::Ball { center: Point3::origin(), radius: 0.0 }; positions.len()];
    alive.iter().zip(found).for_each(|(v, b)| balls[*v as usize] = b);
    let t3 = t0.elapsed();
    let weights = Weights {
        contraction: env("WL", 0.5),
        hold: env("WH", 0.1),
        medial: env("WM", 0.2),
        growth: env("GROW", 1.2),
        short: env("SHORT", 0.03),
        rounds: env("ROUNDS", 25.0) as usize,
        still: env("STILL", 1e-4),
    };
    let mut contraction = Contraction::new(complex, &balls, none.clone(), weights);
    loop {
        let done = contraction.step().unwrap();
        if env("VERBOSE", 0.0) > 0.0 {
            eprintln!("{} {:.5} {:?}", contraction.complex.alive_count(), contraction.area_left(), t0.elapsed());
        }
        if done {
            break;
        }
    }
    let t4 = t0.elapsed();
    let mut classes = classes.take().unwrap_or_else(homology::Classes::trivial);
    classes.follow(&contraction.complex.collapses);
    let g = surgery::collapse_to_curve(&contraction.complex, &none, &contraction.mass, &mut classes);
    let t5 = t0.elapsed();
    let tree = aabb::AabbTree::new(&positions, mesh.triangles());
    let mut web = web::Web::new(g.nodes, &g.edges, g.node_of_vertex);
    if env("CENTER", 1.0) > 0.0 {
        let spacing = env("SPACING", 0.04);
        web = resampling::resample(&web, spacing);
        centering::center(&mut web, &tree, env("P1", 3.0) as usize);
        let mut radius = |web: &web::Web, v: u32| centering::radius(&tree, &web.nodes[v as usize]);
        pruning::prune(&mut web, &mut radius, env("PRUNE", 0.3));
        pruning::join_junctions(&mut web, &mut radius, env("JOIN", 0.5));
        web = resampling::resample(&web, spacing);
        centering::center(&mut web, &tree, env("P2", 8.0) as usize);
        web = resampling::resample(&web, spacing);
    }
    let t6 = t0.elapsed();
    eprintln!("complex {t1:?} reduce {t2:?} balls {t3:?} contraction {t4:?} surgery {t5:?} curve {t6:?}");
    let mut edges = Vec::new();
    let mut number = vec![u32::MAX; web.nodes.len()];
    let mut nodes = Vec::new();
    for v in web.alive() { number[v as usize] = nodes.len() as u32; nodes.push(mid + web.nodes[v as usize].coords * scale); }
    for v in web.alive() { for &u in web.neighbors(v) { if v < u { edges.push([number[v as usize], number[u as usize]]); } } }
    (nodes, edges, scale)
}

