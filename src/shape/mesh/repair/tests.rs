use nalgebra::{Rotation3, Vector3};
use proptest::prelude::*;

use super::*;
use crate::mesh::shapes::{
    bar, book, cylinder, disjoint, holed_torus, hourglass, icosphere, moebius, one_triangle, plane, soup,
};
use crate::mesh::{HalfEdges, MeshError};
use plumbline_num::run::Run;

fn fixed(mesh: &TriMesh) -> Repaired {
    repair(mesh, &RepairOptions::default(), &Run::default()).expect("a run that never stops")
}

fn changed(mesh: &TriMesh, change: impl FnOnce(&mut Vec<Point3<f64>>, &mut Vec<[u32; 3]>)) -> TriMesh {
    let (mut positions, mut triangles) = (mesh.positions().to_vec(), mesh.triangles().to_vec());
    change(&mut positions, &mut triangles);
    TriMesh::new(positions, triangles).expect("valid")
}

/// Invariants of every result.
fn check(source: &TriMesh, result: &Repaired, options: &RepairOptions) {
    let mesh = &result.mesh;
    HalfEdges::new(mesh).expect("an oriented manifold");
    let again = repair(mesh, &RepairOptions { weld: Weld::Never, ..*options }, &Run::default())
        .expect("a run that never stops");
    assert!(again.report.is_clean() && again.mesh == *mesh, "repaired twice: {}", again.report);
    for (t, corners) in result.source_corners.iter().enumerate() {
        for (k, &corner) in corners.iter().enumerate() {
            let given = source.triangles()[corner as usize / 3][corner as usize % 3];
            let corner = mesh.positions()[mesh.triangles()[t][k] as usize];
            let far = (source.positions()[given as usize] - corner).norm();
            assert!(far <= 1e-6 * source.diagonal(), "corner {k} of triangle {t} is {far} away");
            assert!(result.vertex_of_source[given as usize].is_some());
        }
    }
    for (vertex, &given) in result.source_of_vertex.iter().enumerate() {
        assert!((source.positions()[given as usize] - mesh.positions()[vertex]).norm() <= 1e-6 * source.diagonal());
    }
    let sizes = |of: fn(&Component) -> usize| result.report.components.iter().map(of).sum::<usize>();
    assert_eq!((sizes(|c| c.vertices), sizes(|c| c.triangles)), (mesh.vertex_count(), mesh.triangle_count()));
}

#[test]
fn a_tidy_mesh_comes_back_as_it_was() {
    for mesh in
        [icosphere(2), plane(5), cylinder(8, 3, 1.0, 2.0), holed_torus(2, 10), disjoint(&[plane(2), icosphere(1)])]
    {
        let result = fixed(&mesh);
        assert_eq!(result.mesh, mesh);
        assert!(result.report.is_clean(), "{}", result.report);
        assert!(result.source_of_vertex.iter().copied().eq(0..mesh.vertex_count() as u32));
    }
    let report = fixed(&holed_torus(2, 10)).report;
    assert_eq!((report.components.len(), report.components[0].genus, report.boundary_loops.len()), (1, 2, 0));
}

#[test]
fn soup_becomes_the_surface_it_was_cut_from() {
    for mesh in [icosphere(2), bar([2, 3, 4], [1.0, 2.0, 3.0]), plane(4)] {
        let result = fixed(&soup(&mesh));
        assert_eq!(
            (result.mesh.vertex_count(), result.mesh.triangle_count()),
            (mesh.vertex_count(), mesh.triangle_count())
        );
        assert!((result.mesh.area() - mesh.area()).abs() < 1e-12);
        // Moved corners go back to the soup's own vertices.
        let moved: Vec<_> = result.mesh.positions().iter().map(|p| p * 2.0 + Vector3::x()).collect();
        let back = result.carry_back(&soup(&mesh), &moved);
        assert!(back.iter().zip(soup(&mesh).positions()).all(|(p, q)| (p - (q * 2.0 + Vector3::x())).norm() < 1e-12));
    }
}

#[test]
fn turned_triangles_are_turned_back_and_closed_parts_face_outward() {
    let torn = changed(&icosphere(2), |_, triangles| triangles.iter_mut().step_by(3).for_each(|t| t.swap(1, 2)));
    let result = fixed(&torn);
    assert_eq!(result.mesh.triangles(), icosphere(2).triangles());
    assert_eq!(result.report.flipped.len(), 320_usize.div_ceil(3));
    let inside_out = changed(&icosphere(1), |_, triangles| triangles.iter_mut().for_each(|t| t.swap(0, 1)));
    assert!(fixed(&inside_out).mesh.volume() > 0.0);
    let few = changed(&plane(4), |_, triangles| triangles[7].swap(0, 1));
    assert_eq!(fixed(&few).report.flipped, [7], "an open part keeps the side that most of it has");
}

#[test]
fn a_cavity_stays_inside_out() {
    let inner = changed(&icosphere(1), |positions, triangles| {
        for p in positions.iter_mut() {
            *p *= 0.5;
        }
        for t in triangles.iter_mut() {
            t.swap(0, 1);
        }
    });
    let shell = changed(&icosphere(1), |positions, triangles| {
        let first = positions.len() as u32;
        positions.extend_from_slice(inner.positions());
        triangles.extend(inner.triangles().iter().map(|t| t.map(|v| v + first)));
    });
    let result = fixed(&shell);
    assert!(result.report.is_clean() && (result.mesh.volume() / icosphere(1).volume() - 0.875).abs() < 1e-9);
}

#[test]
fn equal_triangles_and_loose_vertices_go() {
    let doubled = changed(&icosphere(1), |positions, triangles| {
        positions.insert(5, Point3::new(9.0, 9.0, 9.0));
        triangles.iter_mut().flatten().for_each(|v| *v += u32::from(*v >= 5));
        let [a, b, c] = triangles[3];
        triangles.extend([[b, c, a], [b, a, c], [a, a, b]]);
    });
    let result = fixed(&doubled);
    assert_eq!(result.mesh.triangles(), icosphere(1).triangles());
    assert_eq!((&result.report.unreferenced[..], result.vertex_of_source[5]), (&[5][..], None));
    assert_eq!((&result.report.duplicates[..], &result.report.collapsed[..]), (&[80, 81][..], &[82][..]));
    let back = result.carry_back(&doubled, result.mesh.positions());
    assert_eq!(back, doubled.positions());
}

#[test]
fn triangles_without_area_leave_no_crack() {
    // The middle of an edge as a vertex of one side alone: a cap on the other side closes the gap.
    let with_cap = changed(&icosphere(1), |positions, triangles| {
        let [a, b, c] = triangles[0];
        let middle = nalgebra::center(&positions[a as usize], &positions[b as usize]);
        positions.push(middle);
        let m = positions.len() as u32 - 1;
        triangles[0] = [a, m, c];
        triangles.extend([[m, b, c], [a, b, m]]);
    });
    let result = fixed(&with_cap);
    assert_eq!((result.report.caps_flipped, result.report.boundary_loops.len()), (1, 0));
    assert_eq!(result.mesh.triangle_count(), 82, "two halves on either side");
    // A vertex that is two, a billionth apart: needles between them.
    let with_needles = changed(&plane(4), |positions, triangles| {
        positions.push(positions[12] + Vector3::new(1e-10, 0.0, 0.0));
        let (old, new) = (12, positions.len() as u32 - 1);
        let right =
            |t: &[u32; 3], p: &[Point3<f64>]| t.contains(&old) && t.iter().map(|&v| p[v as usize].x).sum::<f64>() > 1.5;
        let (moved, _): (Vec<_>, Vec<_>) = (0..triangles.len()).partition(|&t| right(&triangles[t], positions));
        for t in moved {
            triangles[t] = triangles[t].map(|v| if v == old { new } else { v });
        }
        triangles.extend([[old, new, 17], [old, 7, new]]);
    });
    let result = fixed(&with_needles);
    assert!(result.report.needles_collapsed > 0, "{}", result.report);
    assert_eq!((result.mesh.triangle_count(), result.report.boundary_loops.len()), (32, 1));
    let line =
        TriMesh::new((0..3).map(|k| Point3::new(f64::from(k), 0.0, 0.0)).collect(), vec![[0, 1, 2]]).expect("valid");
    let result = fixed(&line);
    assert_eq!((result.mesh.triangle_count(), &result.report.flat_dropped[..]), (0, &[0][..]));
    assert_eq!(result.vertex_of_source, [None; 3]);
}

#[test]
fn sheets_that_meet_are_taken_apart() {
    for pages in 3..7 {
        let result = fixed(&book(pages));
        assert_eq!(result.report.non_manifold_edges, [[0, 1]]);
        assert_eq!(result.report.components.len(), pages.div_ceil(2), "{pages} pages");
        check(&book(pages), &result, &RepairOptions::default());
    }
    let result = fixed(&hourglass());
    assert_eq!((&result.report.non_manifold_vertices[..], result.report.components.len()), (&[0][..], 2));
    assert_eq!(result.source_of_vertex.iter().filter(|&&v| v == 0).count(), 2);
    assert!(result.report.components.iter().all(|c| c.volume.is_some_and(|v| v > 0.0)));
    // Two boxes that share an edge come apart; they do not become one crossing sheet.
    let touching = changed(&bar([1, 1, 1], [1.0; 3]), |positions, triangles| {
        let other = bar([1, 1, 1], [1.0; 3]);
        triangles.extend(other.triangles().iter().map(|t| t.map(|v| v + 8)));
        positions.extend(other.positions().iter().map(|p| p + Vector3::new(1.0, 1.0, 0.0)));
    });
    let report = fixed(&touching).report;
    assert_eq!(
        (report.components.len(), report.components[0].volume, report.components[1].volume),
        (2, Some(1.0), Some(1.0))
    );
}

#[test]
fn a_moebius_strip_is_cut_open_once() {
    let result = fixed(&moebius(20, 3));
    assert_eq!(result.report.unorientable_cuts, 3);
    assert!(result.report.flipped.is_empty(), "it is cut where its triangles disagree already");
    assert_eq!((result.mesh.vertex_count(), result.report.boundary_loops.len()), (84, 1));
    assert_eq!(result.report.components[0].genus, 0);
}

#[test]
fn similar_meshes_are_repaired_alike() {
    let messy = messy();
    let report = fixed(&messy).report;
    assert!(!report.is_clean());
    let rotation = Rotation3::from_euler_angles(0.7, 0.2, -2.0);
    for (scale, shift) in [(1e-3, 0.0), (1e3, 0.0), (1.0, 1e4)] {
        let moved = changed(&messy, |positions, _| {
            for p in positions.iter_mut() {
                *p = rotation * *p * scale + Vector3::new(shift, -2.0 * shift, shift);
            }
        });
        let other = fixed(&moved).report;
        assert_eq!(
            report.changes().collect::<Vec<_>>(),
            other.changes().collect::<Vec<_>>(),
            "scale {scale}, shift {shift}"
        );
    }
}

fn messy() -> TriMesh {
    let tidy = disjoint(&[icosphere(1), moebius(9, 2), book(4), hourglass()]);
    changed(&soup(&tidy), |positions, triangles| {
        triangles.iter_mut().step_by(5).for_each(|t| t.swap(0, 2));
        triangles.push(triangles[4]);
        positions.push(Point3::new(0.1, 0.2, 0.3));
    })
}

#[test]
fn welding_within_a_distance_joins_what_is_near_and_nothing_else() {
    let shaken = changed(&soup(&icosphere(2)), |positions, _| {
        let mut random = fastrand::Rng::with_seed(4);
        for p in positions.iter_mut() {
            *p += Vector3::from_fn(|_, _| 1e-7 * (random.f64() - 0.5));
        }
    });
    assert_eq!(fixed(&shaken).mesh.vertex_count(), 960);
    for fraction in [1e-7, 1e-5, 1e-3] {
        let options = RepairOptions { weld: Weld::Within(fraction), ..RepairOptions::default() };
        let result = repair(&shaken, &options, &Run::default()).expect("a run that never stops");
        assert_eq!((result.mesh.vertex_count(), result.report.boundary_loops.len()), (162, 0), "{fraction}");
    }
    // A hundredth of the shortest edge is .004 of the diagonal here.
    let [closed, torn] = [1.0, 1e6].map(|times| {
        let spread = changed(&shaken, |positions, _| {
            for (p, q) in positions.iter_mut().zip(soup(&icosphere(2)).positions()) {
                *p = q + times * (*p - q);
            }
        });
        let options = RepairOptions { weld: Weld::Gaps(0.01), ..RepairOptions::default() };
        repair(&spread, &options, &Run::default()).expect("a run that never stops")
    });
    assert_eq!((closed.mesh.vertex_count(), closed.report.boundary_loops.len(), closed.report.bridged), (162, 0, 798));
    assert!(torn.mesh.vertex_count() > 800, "{}", torn.report);
    let never =
        repair(&soup(&plane(2)), &RepairOptions { weld: Weld::Never, ..RepairOptions::default() }, &Run::default())
            .expect("a run that never stops");
    assert!(never.report.is_clean() && never.report.components.len() == 8);
}

#[test]
fn gaps_are_judged_by_the_edges_around_them() {
    let bridged = |gap: f64| {
        let apart = changed(&disjoint(&[plane(4), plane(40)]), |positions, _| {
            let second = positions[plane(4).vertex_count()..].iter_mut();
            second.zip(plane(40).positions()).for_each(|(p, q)| *p = q + Vector3::x() * (1.0 + gap));
        });
        let options = RepairOptions { weld: Weld::Gaps(0.1), ..RepairOptions::default() };
        repair(&apart, &options, &Run::default()).expect("a run that never stops").report.bridged
    };
    // Five corners of the coarse square meet corners of the fine one, whose edges are a fortieth.
    assert_eq!([0.0, 0.05 / 40.0, 0.2 / 40.0].map(bridged), [0, 5, 0]);
}

#[test]
fn nothing_is_repaired_into_nothing() {
    let empty = fixed(&TriMesh::default());
    assert!(empty.report.is_clean() && empty.mesh == TriMesh::default());
    let points = TriMesh::new(vec![Point3::origin(); 3], vec![]).expect("valid");
    assert_eq!(fixed(&points).vertex_of_source, [None; 3]);
    assert!(fixed(&one_triangle()).report.is_clean());
    assert!(matches!(HalfEdges::new(&book(3)), Err(MeshError::NonManifoldEdge { .. })));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, failure_persistence: None, ..ProptestConfig::default() })]

    /// Random triangles over few vertices of a grid: duplicate, degenerate, non-manifold and inconsistently oriented ones.
    #[test]
    fn any_triangles_become_an_oriented_manifold(
        vertices in prop::collection::vec([0..4_i32, 0..4_i32, 0..3_i32], 3..14),
        corners in prop::collection::vec([any::<u32>(), any::<u32>(), any::<u32>()], 0..40),
    ) {
        let n = vertices.len() as u32;
        let positions = vertices.iter().map(|p| Point3::from(p.map(f64::from))).collect();
        let mesh = TriMesh::new(positions, corners.iter().map(|t| t.map(|v| v % n)).collect()).expect("valid");
        for weld in [Weld::Exact, Weld::Never, Weld::Within(1e-9)] {
            let options = RepairOptions { weld, ..RepairOptions::default() };
            check(&mesh, &repair(&mesh, &options, &Run::default()).expect("a run that never stops"), &options);
        }
    }
}
