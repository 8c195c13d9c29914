//! Laws of pictures of surfaces.

use nalgebra::{Point3, Vector3};

use super::*;
use plumbline_num::run::Run;

fn mesh(positions: &[[f64; 3]], triangles: &[[u32; 3]]) -> TriMesh {
    TriMesh::new(positions.iter().map(|p| Point3::from(*p)).collect(), triangles.to_vec()).unwrap()
}

/// A box of half sides `half` about `at`, faces outward.
fn cuboid(at: Vector3<f64>, half: Vector3<f64>) -> TriMesh {
    let sign = |i: u32, bit: u32| if i >> bit & 1 == 1 { 1.0 } else { -1.0 };
    let corner = |i| Point3::from(at + half.component_mul(&Vector3::new(sign(i, 0), sign(i, 1), sign(i, 2))));
    let quads = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let triangles = quads.iter().flat_map(|q| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]]).collect();
    TriMesh::new((0..8).map(corner).collect(), triangles).unwrap()
}

fn camera(mesh: &TriMesh, name: &str, size: (usize, usize)) -> SurfaceCamera {
    SurfaceCamera::fit(mesh.positions(), ViewDirection::named(name).unwrap(), UpAxis::Y, size)
}

const PLAIN: Style = Style {
    background: [[0; 3]; 2],
    flat: true,
    crease_deg: 45.0,
    wireframe: None,
    back: None,
    opacity: 1.0,
    samples: 2,
    legend: false,
};

/// Columns and rows that are not background.
fn box_of_ink(canvas: &Canvas) -> Option<[usize; 4]> {
    let inked = |(i, p): (usize, &Rgb)| (*p != [0; 3]).then_some((i % canvas.width(), i / canvas.width()));
    let pixels: Vec<_> = canvas.pixels().iter().enumerate().filter_map(inked).collect();
    let (x, y) = (pixels.iter().map(|p| p.0), pixels.iter().map(|p| p.1));
    Some([x.clone().min()?, x.max()?, y.clone().min()?, y.max()?])
}

#[test]
fn a_fitted_camera_shows_everything_and_is_as_near_as_it_can_be() {
    let half = Vector3::new(1.0, 0.3, 0.7);
    for (scale, at) in [(1.0, Vector3::zeros()), (1e-3, Vector3::new(1e3, 0.0, 0.0)), (1e3, Vector3::repeat(1e6))] {
        let mesh = cuboid(at, half * scale);
        for (name, ..) in ViewDirection::NAMED {
            for size in [(200, 100), (100, 200), (150, 150)] {
                let camera = camera(&mesh, name, size);
                let drawn =
                    draw(&Surface::new(&mesh), &camera, &PLAIN, &Run::default()).expect("a run that never stops");
                let [left, right, top, bottom] = box_of_ink(&drawn).expect("a mark is visible");
                assert!(left > 0 && top > 0 && right + 1 < size.0 && bottom + 1 < size.1, "{name} {size:?}");
                // One of the sides is filled to the margin.
                let fill = ((right - left + 1) as f64 / size.0 as f64).max((bottom - top + 1) as f64 / size.1 as f64);
                assert!((fill - 0.94).abs() < 0.03, "{name} {size:?} at {at:?}: {fill}");
            }
        }
    }
}

#[test]
fn named_directions_look_at_their_sides() {
    // A small box in front of each side of a large one: only the one towards the viewer is fully visible.
    let directions = [("front", [0.0, 0.0, 1.0]), ("back", [0.0, 0.0, -1.0]), ("left", [1.0, 0.0, 0.0])];
    let more = [("right", [-1.0, 0.0, 0.0]), ("top", [0.0, 1.0, 0.0]), ("bottom", [0.0, -1.0, 0.0])];
    for (name, towards) in directions.into_iter().chain(more) {
        let camera = camera(&cuboid(Vector3::zeros(), Vector3::repeat(1.0)), name, (64, 64));
        let forward = camera.pose.rotation.inverse() * Vector3::z();
        assert!((forward + Vector3::from(towards)).norm() < 1e-12, "{name}: {forward:?}");
    }
    let up = |axis| {
        let mesh = cuboid(Vector3::zeros(), Vector3::repeat(1.0));
        let view = ViewDirection::degrees(20.0, 0.0);
        SurfaceCamera::fit(mesh.positions(), view, axis, (64, 64)).pose.rotation.inverse() * -Vector3::y()
    };
    assert!((up(UpAxis::Y) - Vector3::y()).norm() < 1e-12 && (up(UpAxis::Z) - Vector3::z()).norm() < 1e-12);
}

#[test]
fn the_nearer_face_hides_the_farther_one_whatever_their_order() {
    let squares = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    let positions: Vec<[f64; 3]> =
        [0.5, -0.5].iter().flat_map(|z| squares.iter().map(move |[x, y]| [*x, *y, *z])).collect();
    let near = [[0, 1, 2], [0, 2, 3]];
    let far = [[4, 5, 6], [4, 6, 7]];
    for (triangles, near_first) in [([near, far].concat(), true), ([far, near].concat(), false)] {
        let mesh = mesh(&positions, &triangles);
        let mut colors = [[255, 0, 0], [255, 0, 0], [0, 0, 255], [0, 0, 255]];
        if !near_first {
            colors.reverse();
        }
        let surface = Surface { paint: Paint::FaceColors(&colors), ..Surface::new(&mesh) };
        let drawn =
            draw(&surface, &camera(&mesh, "front", (80, 80)), &PLAIN, &Run::default()).expect("a run that never stops");
        let [r, _, b] = drawn.pixels()[40 * 80 + 40];
        assert!(r > 2 * b, "the red face is nearer: {r} {b}");
    }
}

#[test]
fn triangles_that_share_an_edge_leave_no_crack_and_cover_no_sample_twice() {
    // A fan about an odd place: every spoke is an edge between two triangles.
    let rim = 37;
    let angle = |i: u32| f64::from(i) / f64::from(rim) * std::f64::consts::TAU;
    let mut positions = vec![[0.123, 0.0457, 0.0]];
    positions.extend((0..rim).map(|i| [angle(i).cos(), angle(i).sin(), 0.0]));
    let fan: Vec<[u32; 3]> = (0..rim).map(|i| [0, 1 + i, 1 + (i + 1) % rim]).collect();
    let whole = mesh(&positions, &fan);
    let camera = camera(&whole, "front", (120, 120));
    let covered = |triangles: &[[u32; 3]]| -> Vec<bool> {
        let seen = visibility::View::new(&mesh(&positions, triangles), &camera, 3)
            .nearest(&Run::default())
            .expect("a run that never stops");
        let samples = (0..120 * 120 * 9).map(|i| seen.triangle(i / 9 % 120, i / 9 / 120, i % 3, i % 9 / 3));
        samples.map(|t| t != visibility::NO_TRIANGLE).collect()
    };
    let together = covered(&fan).iter().filter(|c| **c).count();
    let alone: usize = fan.iter().map(|t| covered(&[*t]).iter().filter(|c| **c).count()).sum();
    assert_eq!(together, alone, "each sample belongs to one triangle");
    let seen = draw(&Surface::new(&whole), &camera, &PLAIN, &Run::default()).expect("a run that never stops");
    for y in 30..90 {
        for x in 30..90 {
            assert_ne!(seen.pixels()[y * 120 + x], [0; 3], "a crack at ({x}, {y})");
        }
    }
}

#[test]
fn both_sides_are_lit_alike_and_the_back_may_have_its_own_color() {
    let one = mesh(&[[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0]], &[[0, 1, 2]]);
    let other = mesh(&[[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0]], &[[0, 2, 1]]);
    let camera = camera(&one, "front", (50, 50));
    for flat in [true, false] {
        let style = Style { flat, ..PLAIN };
        assert_eq!(
            draw(&Surface::new(&one), &camera, &style, &Run::default()).expect("a run that never stops"),
            draw(&Surface::new(&other), &camera, &style, &Run::default()).expect("a run that never stops")
        );
    }
    let marked = Style { back: Some([200, 0, 0]), ..PLAIN };
    let middle = |m: &TriMesh| {
        draw(&Surface::new(m), &camera, &marked, &Run::default()).expect("a run that never stops").pixels()
            [30 * 50 + 25]
    };
    assert!(middle(&other)[0] > 2 * middle(&other)[1] && middle(&one)[1] > 100);
}

#[test]
fn creases_stay_sharp_and_gentle_bends_become_smooth() {
    let cube = cuboid(Vector3::zeros(), Vector3::repeat(1.0));
    let of_faces: Vec<_> = (0..12).map(|t| cube.area_normal(t).normalize().cast::<f32>()).collect();
    for (corners, face) in corner_normals::corner_normals(&cube, 45.0).iter().zip(&of_faces) {
        assert!(corners.iter().all(|n| (n - face).norm() < 1e-6));
    }
    let smooth = corner_normals::corner_normals(&cube, 120.0);
    assert!(smooth.iter().zip(&of_faces).all(|(corners, face)| corners.iter().all(|n| n.dot(face) < 0.95)));
}

#[test]
fn a_wireframe_darkens_edges_and_spares_those_that_are_not_shown() {
    let square =
        mesh(&[[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]], &[[0, 1, 2], [0, 2, 3]]);
    let camera = camera(&square, "front", (101, 101));
    let style = Style { wireframe: Some(Wireframe { color: [0; 3], width_px: 3.0 }), ..PLAIN };
    let center = |edges| {
        draw(&Surface { edges, ..Surface::new(&square) }, &camera, &style, &Run::default())
            .expect("a run that never stops")
            .pixels()[50 * 101 + 50]
    };
    assert!(center(None)[0] < 20, "the diagonal passes through the middle");
    assert!(center(Some(&[0b011, 0b110]))[0] > 100, "of a quad it is not shown");
}

#[test]
fn numbers_are_mixed_before_they_become_colors() {
    let square =
        mesh(&[[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]], &[[0, 1, 2], [0, 2, 3]]);
    let camera = camera(&square, "front", (101, 101));
    let paint = |values: &[f64; 4]| {
        let surface = Surface { paint: Paint::VertexValues(values, Scale::of(values)), ..Surface::new(&square) };
        draw(&surface, &camera, &PLAIN, &Run::default()).expect("a run that never stops").pixels()[50 * 101 + 50]
    };
    // Halfway between the ends of a diverging map is its light middle, not a mixture of blue and red.
    let [r, g, b] = paint(&[-1.0, 1.0, 1.0, -1.0]);
    assert!(r.abs_diff(b) < 12 && g > 120, "{r} {g} {b}");
    let [r, g, b] = paint(&[f64::NAN, 1.0, 1.0, 0.0]);
    assert!(r.abs_diff(g) < 8 && g.abs_diff(b) < 8, "NaN is gray: {r} {g} {b}");
}

#[test]
fn marks_behind_a_surface_are_fainter() {
    let square =
        mesh(&[[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]], &[[0, 1, 2], [0, 2, 3]]);
    let camera = camera(&square, "front", (101, 101));
    let at = |z: f64| {
        let mark = Mark { shape: Shape::Point(Point3::new(0.0, 0.0, z)), color: [0, 0, 255], width_px: 9.0 };
        draw(&Surface { marks: &[mark], ..Surface::new(&square) }, &camera, &PLAIN, &Run::default())
            .expect("a run that never stops")
            .pixels()[50 * 101 + 50]
    };
    assert_eq!(at(0.01), [0, 0, 255]);
    assert_eq!(at(0.0), [0, 0, 255], "on the surface counts as before it");
    assert!(at(-0.5)[0] > 100, "{:?}", at(-0.5));
}

/// Squares of side 2 across the axis of the view, one behind the other.
fn squares(depths: &[f64]) -> TriMesh {
    let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    let positions: Vec<_> = depths.iter().flat_map(|z| corners.map(|[x, y]| [x, y, *z])).collect();
    let triangles: Vec<_> =
        (0..depths.len() as u32).flat_map(|k| [[0, 1, 2], [0, 2, 3]].map(|t| t.map(|v| 4 * k + v))).collect();
    mesh(&positions, &triangles)
}

#[test]
fn layers_of_glass_let_through_what_each_of_them_lets_through() {
    let linear = |[r, _, _]: Rgb| f64::from(plumbline_image::canvas::srgb::LINEAR[usize::from(r)]);
    let style = Style { flat: true, opacity: 0.3, background: [[255; 3]; 2], ..PLAIN };
    let glass = squares(&[0.0]);
    let camera = camera(&glass, "front", (101, 101));
    let middle = |m: &TriMesh, opacity: f64| {
        let black = Surface { paint: Paint::Plain([0; 3]), ..Surface::new(m) };
        linear(
            draw(&black, &camera, &Style { opacity, ..style }, &Run::default())
                .expect("a run that never stops")
                .pixels()[50 * 101 + 50],
        )
    };
    let gloss = middle(&glass, 1.0);
    let one = 0.3 * gloss + 0.7;
    for count in 1..=4 {
        let depths: Vec<f64> = (0..count).map(|k| -0.1 * f64::from(k)).collect();
        // The order in the list does not matter.
        let reversed: Vec<f64> = depths.iter().rev().copied().collect();
        let wanted = (1..count).fold(one, |behind, _| 0.3 * gloss + 0.7 * behind);
        for depths in [depths, reversed] {
            let seen = middle(&squares(&depths), 0.3);
            assert!((seen - wanted).abs() < 0.02, "{count} layers: {seen}, not {wanted}");
        }
    }
}

#[test]
fn a_mark_behind_translucent_layers_is_attenuated_by_those_in_front_alone() {
    let glass = squares(&[0.0, -1.0, -2.0]);
    let camera = camera(&glass, "front", (101, 101));
    let style = Style { flat: true, opacity: 0.4, ..PLAIN };
    let red = |marks: &[Mark]| {
        let drawn = draw(&Surface { marks, ..Surface::new(&glass) }, &camera, &style, &Run::default())
            .expect("a run that never stops");
        f64::from(drawn.pixels()[50 * 101 + 50][0])
    };
    // A blue mark replaces red by its visible fraction.
    let seen = |z: f64| {
        let shape = Shape::Segment(Point3::new(-0.1, 0.0, z), Point3::new(0.1, 0.0, z));
        let mark = Mark { shape, color: [0, 0, 255], width_px: 9.0 };
        1.0 - red(&[mark]) / red(&[])
    };
    for (z, wanted) in [(0.5, 1.0), (-0.5, 0.6), (-1.5, 0.36), (-2.5, 0.216)] {
        assert!((seen(z) - wanted).abs() < 0.02, "at {z} the fraction {} is visible, not {wanted}", seen(z));
    }
}

#[test]
fn nothing_degenerate_or_empty_is_drawn_and_nothing_fails() {
    let same = [[1.0, 2.0, 3.0]; 3];
    let line = [[0.0, 0.0, 0.0], [1.0, 1.0, 1.0], [2.0, 2.0, 2.0]];
    let huge = [[-1e300, 0.0, 0.0], [1e300, 0.0, 0.0], [0.0, 1e300, 1e300]];
    let tiny = [[0.0, 0.0, 0.0], [1e-300, 0.0, 0.0], [0.0, 1e-300, 0.0]];
    let style = Style { wireframe: Some(Wireframe::default()), legend: true, flat: false, ..PLAIN };
    let values = [f64::NAN, f64::INFINITY, 1.0];
    for positions in [&same[..], &line, &huge, &tiny, &[]] {
        let triangles: &[[u32; 3]] = if positions.is_empty() { &[] } else { &[[0, 1, 2], [0, 0, 1], [2, 1, 0]] };
        let mesh = mesh(positions, triangles);
        for size in [(1, 1), (300, 200)] {
            let marks = [
                Mark {
                    shape: Shape::Segment(Point3::origin(), Point3::new(f64::NAN, 0.0, 1.0)),
                    color: [9; 3],
                    width_px: 2.0,
                },
                Mark {
                    shape: Shape::Segment(Point3::new(-1e9, 0.0, -1e9), Point3::new(1e9, 1.0, 1e9)),
                    color: [9; 3],
                    width_px: 2.0,
                },
            ];
            let surface = Surface {
                paint: Paint::VertexValues(&values, Scale::of(&values)),
                edges: Some(&[]),
                marks: &marks,
                mesh: &mesh,
            };
            let drawn = draw(&surface, &camera(&mesh, "corner", size), &style, &Run::default())
                .expect("a run that never stops");
            assert_eq!((drawn.width(), drawn.height()), size);
        }
    }
}

#[test]
fn a_camera_inside_a_model_sees_the_walls_around_it() {
    let room = cuboid(Vector3::zeros(), Vector3::repeat(1.0));
    let outside = camera(&room, "front", (60, 60));
    let pose = plumbline_camera::CameraPose::looking_from(Point3::origin(), outside.pose.rotation);
    let inside = SurfaceCamera { pose, near: 1e-3, ..outside };
    let drawn = draw(&Surface::new(&room), &inside, &PLAIN, &Run::default()).expect("a run that never stops");
    assert!(drawn.pixels().iter().all(|p| *p != [0; 3]), "walls cross the near plane and are clipped, not lost");
}

#[test]
fn a_scale_diverges_about_zero_where_values_have_both_signs() {
    assert_eq!(Scale::of(&[-1.0, 3.0]), Scale { low: -3.0, high: 3.0, map: ColorMap::Diverging });
    assert_eq!(Scale::of(&[1.0, f64::NAN, 3.0]), Scale { low: 1.0, high: 3.0, map: ColorMap::Sequential });
    assert_eq!(Scale::of(&[]).map, ColorMap::Sequential);
}
