use super::*;
use crate::marks::LinesFile;
use plumbline_camera::{FieldAxis, FieldOfView};
use plumbline_image::Plane;
use plumbline_num::run::Run;

/// A room of dark slats on bright walls, seen by a lens: slats along x, y and z in a frame that is pitched and yawed.
struct Room {
    lens: Lens,
    lens_from_room: nalgebra::Rotation3<f64>,
}

impl Room {
    fn new(projection: Projection, degrees: f64, pitch_deg: f64) -> Self {
        let fov = FieldOfView::degrees(degrees, FieldAxis::Horizontal);
        let lens = Lens::from_field_of_view(projection, fov, (640.0, 480.0)).expect("a lens");
        let pitch = nalgebra::Rotation3::new(Vec3::x() * pitch_deg.to_radians());
        let yaw = nalgebra::Rotation3::new(Vec3::y() * 25_f64.to_radians());
        Self { lens, lens_from_room: pitch * yaw }
    }

    /// Gray level in a direction: the room is a box of 4 × 3 × 6 m around the camera.
    fn gray(&self, ray: &Vec3) -> f32 {
        let d = self.lens_from_room.inverse() * ray;
        let half = Vec3::new(2.0, 1.5, 3.0);
        let reach = half.component_div(&d.abs().map(|v| v.max(1e-9)));
        let wall = reach.imin();
        let p = d * reach[wall];
        let (u, v) = ((wall + 1) % 3, (wall + 2) % 3);
        let slat = |a: f64| (a / 0.9).rem_euclid(1.0) < 0.12;
        let shade = [190.0, 215.0, 160.0][wall];
        let dark = slat(p[u] + 0.2) ^ slat(p[v] + 0.35);
        if dark { shade - 120.0 } else { shade }
    }

    fn photo(&self) -> Plane<f32> {
        let (w, h) = (self.lens.size.0 as usize, self.lens.size.1 as usize);
        Plane::from_fn(w, h, |x, y| {
            let sample = |k: usize| {
                let p = Point2::new(x as f64 + ((k % 3) as f64 + 0.5) / 3.0, y as f64 + ((k / 3) as f64 + 0.5) / 3.0);
                self.lens.unproject(p).map_or(0.0, |r| self.gray(&r))
            };
            (0..9).map(sample).sum::<f32>() / 9.0
        })
    }

    /// Normal of the great circle of the edge that some points lie on: of a slat or of a wall.
    fn edge(&self, points: &[Point2]) -> Vec3 {
        let rays: Vec<Vec3> = points.iter().filter_map(|p| self.lens.unproject(*p)).collect();
        let half = Vec3::new(2.0, 1.5, 3.0);
        let d = self.lens_from_room.inverse() * rays[rays.len() / 2];
        let reach = half.component_div(&d.abs().map(|v| v.max(1e-9)));
        let wall = reach.imin();
        let p = d * reach[wall];
        let (u, v) = ((wall + 1) % 3, (wall + 2) % 3);
        let along = |k: usize, other: usize, offset: f64| {
            let slat = ((p[k] + offset) / 0.9).floor();
            let places = [slat, slat + 0.12, slat + 1.0].map(|place| 0.9 * place - offset);
            places.into_iter().chain([-half[k], half[k]]).map(move |place| {
                let (mut on, mut axis) = (p, Vec3::zeros());
                on[k] = place;
                axis[other] = 1.0;
                self.lens_from_room * on.cross(&axis).normalize()
            })
        };
        let off = |n: &Vec3| rays.iter().map(|ray| n.dot(ray).abs()).fold(0.0, f64::max);
        let edges = along(u, v, 0.2).chain(along(v, u, 0.35));
        edges.min_by(|a, b| off(a).total_cmp(&off(b))).expect("ten edges")
    }

    fn detect(&self) -> LineDetection {
        detect_lines(self.photo().as_ref(), Some(&self.lens), &LineDetectionOptions::default(), &Run::default())
            .expect("a run that never stops")
    }
}

/// Largest distance of a line's points from its best great circle, px.
fn bend(line: &DetectedLine, lens: &Lens) -> f64 {
    let sights: Vec<_> = line.line.points.iter().filter_map(|p| crate::great_circle::Sight::new(lens, *p)).collect();
    let n = crate::great_circle::best_circle(&sights).expect("two points");
    sights.iter().map(|s| s.distance(&n).abs()).fold(0.0, f64::max)
}

#[test]
fn the_slats_of_a_room_are_found_under_every_lens_and_grouped_by_direction() {
    for (projection, degrees) in [
        (Projection::Rectilinear, 80.0),
        (Projection::Equidistant, 120.0),
        (Projection::Stereographic, 150.0),
        (Projection::Equirectangular, 270.0),
    ] {
        let room = Room::new(projection, degrees, 8.0);
        let found = room.detect();
        let name = room.lens.projection.name();
        assert!(found.lines.len() >= 20, "{name}: {} lines", found.lines.len());
        let down = found.down.expect("verticals");
        let off = down.angle(&(room.lens_from_room * Vec3::y())).to_degrees();
        assert!(off < 0.5, "{name}: down is {off}° off");
        for axis in [Vec3::x(), Vec3::z()] {
            let axis = room.lens_from_room * axis;
            let near = found.horizontals.iter().map(|h| h.cross(&axis).norm()).fold(1.0, f64::min);
            assert!(near < 0.01, "{name}: no horizontal direction within {near} of {axis}");
        }
        for line in &found.lines {
            assert!(bend(line, &room.lens) < 0.01, "{name}: a line's points lie on its circle");
            let rays: Vec<_> = line.line.points.iter().filter_map(|p| room.lens.unproject(*p)).collect();
            let normal = rays[0].cross(&rays[rays.len() - 1]).normalize();
            let axes = [Vec3::x(), Vec3::y(), Vec3::z()].map(|a| (room.lens_from_room * a).dot(&normal).abs());
            assert!(
                axes.into_iter().fold(1.0, f64::min) < 0.03,
                "{name}: {} runs along no axis: {axes:?}",
                line.line.name
            );
        }
    }
}

#[test]
fn verticals_shall_be_upright_only_where_the_camera_is_nearly_level() {
    for (pitch, upright) in [(0.0, true), (12.0, true), (-12.0, true), (30.0, false)] {
        let found = Room::new(Projection::Equidistant, 120.0, pitch).detect();
        let verticals: Vec<_> = found.lines.iter().filter(|l| l.group == LineGroup::Vertical).collect();
        assert!(verticals.len() >= 4, "{pitch}°: {}", verticals.len());
        let wanted = if upright { Orientation::Vertical } else { Orientation::Free };
        assert!(verticals.iter().all(|l| l.line.orientation == wanted), "{pitch}°");
    }
}

#[test]
fn edges_on_a_fisheye_become_whole_lines_not_chords() {
    let room = Room::new(Projection::Equidistant, 150.0, 0.0);
    let found = room.detect();
    let diagonal = 800.0;
    let long = found.lines.iter().filter(|l| l.length_px > 0.25 * diagonal).count();
    assert!(long >= 8, "{long} lines longer than a quarter of the diagonal");
    let chord = |l: &DetectedLine| {
        let (a, b) = (l.line.points[0], l.line.points[l.line.points.len() - 1]);
        let n = Vec2::new(-(b - a).y, (b - a).x).normalize();
        l.line.points.iter().map(|p| (p - a).dot(&n).abs()).fold(0.0, f64::max)
    };
    assert!(found.lines.iter().map(chord).fold(0.0, f64::max) > 10.0, "some lines are bent on the photo");
}

#[test]
fn names_of_lines_are_unique_and_the_maximum_number_holds() {
    let room = Room::new(Projection::Equidistant, 120.0, 0.0);
    let options = LineDetectionOptions { max_lines: 15, ..LineDetectionOptions::default() };
    let found = detect_lines(room.photo().as_ref(), Some(&room.lens), &options, &Run::default())
        .expect("a run that never stops");
    assert_eq!(found.lines.len(), 15);
    let names: std::collections::BTreeSet<_> = found.lines.iter().map(|l| l.line.name.as_str()).collect();
    assert_eq!(names.len(), 15);
    assert!(names.contains("vertical 1"), "{names:?}");
    assert_eq!(
        found,
        detect_lines(room.photo().as_ref(), Some(&room.lens), &options, &Run::default())
            .expect("a run that never stops"),
        "the same again"
    );
}

#[test]
fn without_a_lens_straight_edges_are_taken_from_the_photo_itself() {
    let bar = Plane::from_fn(300, 200, |x, y| {
        let slanted = (x as f32 + 0.5 - 0.25 * (y as f32 + 0.5) - 200.0).clamp(0.0, 1.0);
        let flat = if (61..65).contains(&y) && x < 180 { 1.0 } else { 0.0 };
        40.0 + 160.0 * slanted.max(flat)
    });
    let found = detect_lines(bar.as_ref(), None, &LineDetectionOptions::default(), &Run::default())
        .expect("a run that never stops");
    let orientations: Vec<_> = found.lines.iter().map(|l| l.line.orientation).collect();
    assert!(orientations.contains(&Orientation::Horizontal) && orientations.contains(&Orientation::Free), "{found:?}");
    assert_eq!(orientations.len(), 2, "the two edges of the bar are one line: {found:?}");
    assert!(found.lines.iter().all(|l| l.line.points.len() == 2 && l.group == LineGroup::Free));
}

#[test]
fn pictures_without_lines_have_none_and_no_size_is_too_small() {
    let fov = FieldOfView::degrees(120.0, FieldAxis::Horizontal);
    let mut rng = fastrand::Rng::with_seed(4);
    for (w, h) in [(1, 1), (1, 90), (9, 8), (64, 3), (150, 120)] {
        let size = (w as f64, h as f64);
        let fisheye = Lens::from_field_of_view(Projection::Equidistant, fov, size).expect("a lens");
        for photo in [
            Plane::from_fn(w, h, |_, _| 99.0),
            Plane::from_fn(w, h, |_, _| f32::NAN),
            Plane::from_fn(w, h, |_, _| 255.0 * rng.f32()),
        ] {
            for lens in [None, Some(&fisheye)] {
                let found = detect_lines(photo.as_ref(), lens, &LineDetectionOptions::default(), &Run::default())
                    .expect("a run that never stops");
                assert!(found.lines.len() <= 1, "{w}×{h}: {found:?}");
            }
        }
    }
}

#[test]
fn lines_found_on_a_reduced_photo_are_in_pixels_of_the_photo() {
    let room = Room::new(Projection::Equidistant, 120.0, 0.0);
    let flat = Room::new(Projection::Rectilinear, 70.0, 0.0);
    for room in [room, flat] {
        let photo = room.photo();
        let options = |max_side| LineDetectionOptions { max_side, ..LineDetectionOptions::default() };
        let whole = detect_lines(photo.as_ref(), Some(&room.lens), &options(1400), &Run::default())
            .expect("a run that never stops");
        let shrunk = detect_lines(photo.as_ref(), Some(&room.lens), &options(320), &Run::default())
            .expect("a run that never stops");
        assert!(shrunk.lines.len() >= 10, "{}", shrunk.lines.len());
        let normal = |l: &DetectedLine| {
            let rays: Vec<_> = l.line.points.iter().filter_map(|p| room.lens.unproject(*p)).collect();
            rays[0].cross(&rays[rays.len() - 1]).normalize()
        };
        let known: Vec<_> = whole.lines.iter().map(normal).collect();
        let near = |l: &&DetectedLine| known.iter().any(|n| n.cross(&normal(l)).norm() < 0.03);
        let found = shrunk.lines.iter().filter(near).count();
        assert!(3 * found >= 2 * shrunk.lines.len(), "{found} of {} are lines of the whole photo", shrunk.lines.len());
    }
}

#[test]
fn detected_lines_are_saved_switched_off_by_name_and_read_back() {
    let room = Room::new(Projection::Equirectangular, 360.0, 0.0);
    let found = room.detect();
    let size = (room.lens.size.0 as u32, room.lens.size.1 as u32);
    let mut file = LinesFile::new(size, found.lines.iter().map(|l| l.line.clone()).collect());
    for marked in file.lines.iter_mut().filter(|m| m.line.name == "vertical 1") {
        marked.off = true;
    }
    let read = LinesFile::parse(&file.to_json(), size).expect("our own file");
    assert_eq!((read.lines.len(), read.in_use().count()), (found.lines.len(), found.lines.len() - 1));
    for (line, again) in found.lines.iter().zip(&read.lines) {
        assert_eq!(line.line.orientation, again.line.orientation);
        assert!(line.line.points.iter().zip(&again.line.points).all(|(p, q)| (p - q).norm() < 1e-3));
    }
}

#[test]
fn lines_on_faces_are_no_lines_of_buildings() {
    let at = |x: f64, y: f64| Point2::new(x, y);
    let line =
        |points: &[Point2]| Line { name: String::new(), points: points.to_vec(), orientation: Orientation::Free };
    let face = plumbline_num::math::Rect { min: at(100.0, 100.0), max: at(200.0, 220.0) };
    let glasses = line(&[at(110.0, 150.0), at(190.0, 155.0)]);
    let hair = line(&[at(90.0, 90.0), at(90.0, 200.0)]);
    let shelf = line(&[at(0.0, 150.0), at(150.0, 150.0), at(600.0, 150.0)]);
    let lines = vec![glasses, hair, shelf.clone()];
    assert_eq!(super::off_faces(lines.clone(), &[]), lines);
    assert_eq!(super::off_faces(lines, &[face]), [shelf], "most of the shelf is beside it");
}

#[test]
fn edges_alone_tell_the_lens() {
    for (projection, degrees) in [(Projection::Equidistant, 120.0), (Projection::Stereographic, 140.0)] {
        let room = Room::new(projection, degrees, 12.0);
        let edges = curves(room.photo().as_ref(), &Run::default()).expect("a run that never stops");
        let options = crate::calibration::CalibrationOptions::default();
        let found = crate::calibration::calibrate(&edges, room.lens.size, &options, &Run::default()).expect("a lens");
        let (field, _) = found.field_of_view.expect("a field");
        let name = room.lens.projection.name();
        assert!((field.to_degrees() - degrees).abs() < 0.06 * degrees, "{name}: {}°", field.to_degrees());
        assert!(found.noise_px < 0.5, "{name}: {} px", found.noise_px);
    }
}

#[test]
fn what_is_reported_of_straightness_is_what_the_result_shows() {
    use crate::rectify::{RectifyInput, RectifyOptions, Target, rectify};
    let room = Room::new(Projection::Equidistant, 120.0, 8.0);
    let photo = room.photo();
    // Long slats as they are, by the true lens.
    let truth: Vec<Line> = room
        .detect()
        .lines
        .into_iter()
        .filter(|l| l.length_px > 250.0)
        .map(|l| Line { points: l.line.course(Some(&room.lens), 16), ..l.line })
        .collect();
    assert!(truth.len() > 4);
    for factor in [1.0, 1.2, 0.85] {
        let wrong = Lens { focal: room.lens.focal * factor, ..room.lens.clone() };
        let options = RectifyOptions { target: Target::Fixed(Projection::Rectilinear), ..RectifyOptions::default() };
        let input =
            RectifyInput { lens: &wrong, lines: &truth, soft_lines: &[], found: false, faces: &[], saliency: None };
        let mut warp = rectify(&input, &options, &Run::default()).expect("a warp");
        crate::measure_straightness(&mut warp, &truth, Some(&wrong), photo.as_ref(), (640, 480));
        let measured = warp.lines.iter().filter_map(|l| l.edge).map(|e| e.max_px).fold(0.0, f64::max);
        let frame = plumbline_num::math::Rect::of_size(warp.size.0 as f64, warp.size.1 as f64);
        let real = |line: &Line| {
            let points: Vec<Point2> = line.points.iter().filter_map(|p| (warp.forward)(*p)).collect();
            let points: Vec<Point2> = points.into_iter().filter(|p| frame.contains(*p)).collect();
            let fit = crate::FittedLine::through(&points)?;
            Some(points.iter().map(|p| fit.off(*p).abs()).fold(0.0, f64::max))
        };
        let real = truth.iter().filter_map(real).fold(0.0, f64::max);
        assert!((measured - real).abs() < 0.3 * real.max(2.5), "focal × {factor}: {measured} px, in truth {real} px");
        assert!(factor == 1.0 || real > 3.0, "focal × {factor} bends by {real} px");
    }
}

#[test]
fn lines_marked_short_are_continued_as_far_as_their_edges_go_and_no_farther() {
    let room = Room::new(Projection::Equidistant, 130.0, 8.0);
    let photo = room.photo();
    let found: Vec<DetectedLine> = room.detect().lines.into_iter().filter(|l| l.length_px > 200.0).collect();
    assert!(found.len() > 8);
    let short = |l: &DetectedLine| {
        let whole = l.line.course(Some(&room.lens), 40);
        Line { points: whole[whole.len() / 3..2 * whole.len() / 3].to_vec(), ..l.line.clone() }
    };
    let marked: Vec<Line> = found.iter().map(short).collect();
    let length = |points: &[Point2]| points.windows(2).map(|p| (p[1] - p[0]).norm()).sum::<f64>();
    let whole = continued(&marked, &room.lens, photo.as_ref());
    let gained = whole.iter().zip(&marked).filter(|(w, m)| length(&w.points) > 1.8 * length(&m.points)).count();
    assert!(4 * gained > 3 * found.len(), "{gained} of {} lines", found.len());
    for (line, marks) in whole.iter().zip(&marked) {
        let edge = room.edge(&marks.points);
        let off = |p: &Point2| room.lens.unproject(*p).map_or(0.0, |ray| edge.dot(&ray).abs() * room.lens.focal.x);
        let worst = line.points.iter().map(off).fold(0.0, f64::max);
        assert!(
            worst < 2.0,
            "{}: {worst} px off its edge, marks {}",
            line.name,
            marks.points.iter().map(off).fold(0.0, f64::max)
        );
    }
    // Under a lens that is wrong the edges leave the circles of the marks: they are followed less far.
    let wrong = Lens { focal: room.lens.focal * 1.6, ..room.lens.clone() };
    let less = continued(&marked, &wrong, photo.as_ref());
    let total = |lines: &[Line]| lines.iter().map(|l| length(&l.points)).sum::<f64>();
    assert!(total(&less) < 0.8 * total(&whole), "{} of {}", total(&less), total(&whole));
    // Where nothing is to be seen, nothing is continued.
    let blank = Plane::from_fn(640, 480, |_, _| 128.0);
    assert_eq!(continued(&marked, &room.lens, blank.as_ref()), marked);
}

#[test]
fn found_lines_along_marked_ones_are_not_found_again() {
    let room = Room::new(Projection::Equidistant, 120.0, 8.0);
    let found = room.detect().lines;
    let marked: Vec<Line> = found.iter().step_by(2).map(|l| l.line.clone()).collect();
    let soft = unmarked(&found, &marked, &room.lens);
    assert!(soft.len() < found.len() - marked.len() + 1 && soft.len() > found.len() / 3, "{}", soft.len());
    assert!(soft.iter().all(|l| l.weight > 0.0 && l.weight <= 1e-2));
    assert!(soft.iter().all(|l| marked.iter().all(|m| m.points != l.points)));
    assert_eq!(unmarked(&found, &[], &room.lens).len(), found.len());
}

#[test]
fn a_bent_edge_among_straight_ones_is_no_line_and_all_bent_ones_are_lines_of_a_wrong_lens() {
    let size = (400.0, 300.0);
    let fov = FieldOfView::degrees(60.0, FieldAxis::Horizontal);
    let lines = |projection: &Projection, bends: [f64; 4]| -> Vec<bool> {
        let lens = Lens::from_field_of_view(projection.clone(), fov, size).unwrap();
        let height = |k: usize, x: f64| 60.0 * (k + 1) as f64 + bends[k] * (x / 200.0 - 1.0).powi(2);
        let levels = Plane::from_fn(400, 300, |x, y| {
            let covered = |k: usize| (y as f64 + 1.0 - height(k, x as f64 + 0.5)).clamp(0.0, 1.0);
            (0..4).map(|k| if k % 2 == 0 { covered(k) } else { -covered(k) }).sum::<f64>().mul_add(150.0, 50.0) as f32
        });
        let line = |k: usize| {
            let end = |x: f64| Point2::new(x, height(k, x) - 0.3 * bends[k]);
            Line { name: k.to_string(), points: vec![end(20.0), end(380.0)], orientation: Orientation::Free }
        };
        let found: Vec<Line> = (0..4).map(line).collect();
        straight::straight(&found.iter().collect::<Vec<_>>(), &lens, levels.as_ref())
    };
    let flat = &Projection::Rectilinear;
    assert_eq!(lines(flat, [0.0; 4]), [true; 4]);
    assert_eq!(lines(flat, [0.0, 0.0, 3.0, 0.0]), [true, true, false, true], "a bend of 3 px");
    assert_eq!(lines(flat, [5.0, -6.0, -5.0, 6.0]), [false; 4], "waves");
    let bent = lines(&Projection::Equidistant, [3.0, 3.2, 2.8, 3.0]);
    assert_eq!(bent, [true; 4], "a lens that bends them all is not hidden");
}
