use std::f64::consts::PI;

use super::*;
use crate::Orientation;
use plumbline_camera::{BrownConrady, DistortedPlane, DistortionTerms, Vec3};
use plumbline_num::run::Run;

const SIZE: (f64, f64) = (1000.0, 750.0);

fn gaussian(rng: &mut fastrand::Rng) -> f64 {
    (-2.0 * (1.0 - rng.f64()).ln()).sqrt() * (2.0 * PI * rng.f64()).cos()
}

/// The visible part of a great circle, marked about every 40 px with noise.
fn marked(lens: &Lens, n: &Vec3, noise: f64, rng: &mut fastrand::Rng) -> Vec<Point2> {
    let along = n.cross(&Vec3::z()).try_normalize(1e-9).unwrap_or(Vec3::x());
    let ahead = along.cross(n);
    let ahead = ahead * ahead.z.signum();
    let mut points: Vec<Point2> = Vec::new();
    for i in -300..=300 {
        let a = f64::from(i) * 0.005;
        let Some(p) = lens.project(&(along * a.sin() + ahead * a.cos())) else { continue };
        let inside = p.x > 2.0 && p.y > 2.0 && p.x < SIZE.0 - 2.0 && p.y < SIZE.1 - 2.0;
        if inside && points.last().is_none_or(|q| (p - q).norm() > 40.0) {
            points.push(p);
        }
    }
    let noisy = points.into_iter().map(|p| p + noise * Vec2::new(gaussian(rng), gaussian(rng)));
    noisy.collect()
}

/// Twelve lines across the picture.
fn scene(lens: &Lens, noise: f64, seed: u64) -> Vec<Line> {
    let mut rng = fastrand::Rng::with_seed(seed);
    let mut lines = Vec::new();
    while lines.len() < 12 {
        let n = Vec3::new(gaussian(&mut rng), gaussian(&mut rng), 0.8 * gaussian(&mut rng)).normalize();
        let points = marked(lens, &n, noise, &mut rng);
        if points.len() >= 8 {
            lines.push(Line { name: format!("line {}", lines.len()), points, orientation: Orientation::Free });
        }
    }
    lines
}

fn lens(projection: Projection, degrees: f64) -> Lens {
    let fov = FieldOfView::degrees(degrees, FieldAxis::Horizontal);
    let mut lens = Lens::from_field_of_view(projection, fov, SIZE).expect("within the projection's field");
    lens.center += Vec2::new(-4.0, 6.0);
    lens
}

fn field_deg(lens: &Lens) -> f64 {
    lens.field_of_view(FieldAxis::Horizontal).expect("within the field").radians.to_degrees()
}

/// Largest distance of the true lines from straight ones after `lens` turns the picture rectilinear, px at the middle's
/// scale, within 65° of the axis.
fn bend(truth: &Lens, lens: &Lens) -> f64 {
    let straightened = |line: &Line| -> Vec<nalgebra::Point2<f64>> {
        let ahead = line.points.iter().filter_map(|p| lens.unproject(*p)).filter(|r| r.z > 65_f64.to_radians().cos());
        ahead.map(|r| Point2::new(r.x, r.y) * lens.focal.x / r.z).collect()
    };
    scene(truth, 0.0, 77).iter().map(|line| off_line(&straightened(line))).fold(0.0, f64::max)
}

/// Largest distance from the line of least squares.
fn off_line(points: &[Point2]) -> f64 {
    let Some(line) = crate::FittedLine::through(points) else { return 0.0 };
    points.iter().map(|p| line.off(*p).abs()).fold(0.0, f64::max)
}

#[test]
fn every_model_is_found_again_from_noisy_lines() {
    for (projection, degrees, model) in [
        (Projection::Equidistant, 120.0, LensModel::Equidistant),
        (Projection::Equidistant, 170.0, LensModel::Equidistant),
        (Projection::Equisolid, 150.0, LensModel::Equisolid),
        (Projection::Stereographic, 150.0, LensModel::Stereographic),
        (Projection::Orthographic, 130.0, LensModel::Orthographic),
    ] {
        let truth = lens(projection, degrees);
        let found =
            calibrate(&scene(&truth, 0.2, 5), SIZE, &CalibrationOptions::default(), &Run::default()).expect("a lens");
        assert_eq!(found.model, model, "{:?}", found.candidates);
        assert!((found.lens.focal.x / truth.focal.x).ln().abs() < 0.01, "{model:?} {:?}", found.lens);
        assert!((found.lens.center - truth.center).norm() < 3.0, "{model:?} {:?}", found.lens);
        assert!((found.noise_px / 0.2 - 1.0).abs() < 0.25, "{model:?} {}", found.noise_px);
        assert!(bend(&truth, &found.lens) < 0.5, "{model:?} {}", bend(&truth, &found.lens));
    }
}

#[test]
fn lines_become_straight_under_a_lens_with_terms_of_its_own() {
    let truth = lens(Projection::kannala_brandt([0.04, 0.038, -0.03, 0.0076]), 124.0);
    let found =
        calibrate(&scene(&truth, 0.15, 3), SIZE, &CalibrationOptions::default(), &Run::default()).expect("a lens");
    assert!(bend(&truth, &found.lens) < 1.0, "{} {:?}", bend(&truth, &found.lens), found.lens);
    let (field, sigma) = found.field_of_view.expect("sides see something");
    assert!((field.to_degrees() - field_deg(&truth)).abs() < 3.0 * sigma.to_degrees().max(1.0), "{field} {sigma}");
}

#[test]
fn an_ordinary_lens_is_straightened_whatever_its_field_and_keeps_the_field_it_claims() {
    let terms = DistortionTerms { radial: [-0.08, 0.01, 0.0, 0.0], ..DistortionTerms::default() };
    let barrel = BrownConrady::new(DistortedPlane::Tangent, terms).expect("a field");
    let mut truth = lens(Projection::Rectilinear, 70.0);
    truth.projection = Projection::BrownConrady(barrel);
    let lines = scene(&truth, 0.2, 9);
    let guessed = calibrate(&lines, SIZE, &CalibrationOptions::default(), &Run::default()).expect("a lens");
    assert!(bend(&truth, &guessed.lens) < 0.5, "{} {:?}", bend(&truth, &guessed.lens), guessed.lens);
    let (field, sigma) = guessed.field_of_view.expect("the sides are seen");
    assert!((field.to_degrees() - field_deg(&truth)).abs() < 2.0 * sigma.to_degrees(), "{field} {sigma} {guessed:?}");
    let claimed = (FieldOfView::degrees(field_deg(&truth), FieldAxis::Horizontal), 0.03);
    let options = CalibrationOptions { field_of_view: Some(claimed), ..CalibrationOptions::default() };
    let told = calibrate(&lines, SIZE, &options, &Run::default()).expect("a lens");
    assert!(bend(&truth, &told.lens) < 0.5, "{} {:?}", bend(&truth, &told.lens), told.lens);
    assert!((field_deg(&told.lens) - field_deg(&truth)).abs() < 3.0, "{} {:?}", field_deg(&told.lens), told.candidates);
}

#[test]
fn the_standard_deviation_of_the_focal_length_covers_the_error() {
    let (mut within, mut total) = (0, 0);
    for (seed, degrees) in (0..20).zip([100.0, 130.0, 160.0].into_iter().cycle()) {
        let truth = lens(Projection::Equisolid, degrees);
        let options = CalibrationOptions { models: vec![LensModel::Equisolid], ..CalibrationOptions::default() };
        let found = calibrate(&scene(&truth, 0.4, seed), SIZE, &options, &Run::default()).expect("a lens");
        within += usize::from((found.lens.focal.x / truth.focal.x).ln().abs() < 2.0 * found.focal_sigma);
        total += 1;
    }
    // 95 % under normal noise; 15 of 20 would be a chance of 1 in 500.
    assert!(within >= 16, "{within} of {total} within two standard deviations");
}

#[test]
fn straight_lines_leave_the_focal_length_at_its_prior() {
    let truth = lens(Projection::Rectilinear, 60.0);
    let fov = FieldOfView::degrees(75.0, FieldAxis::Horizontal);
    let options = CalibrationOptions { field_of_view: Some((fov, 0.05)), ..CalibrationOptions::default() };
    let found = calibrate(&scene(&truth, 0.3, 8), SIZE, &options, &Run::default()).expect("a lens");
    assert_eq!(found.model, LensModel::Rectilinear, "{:?}", found.candidates);
    assert!((field_deg(&found.lens) - 75.0).abs() < 0.5, "{}", field_deg(&found.lens));
    assert!((found.focal_sigma - 0.05).abs() < 1e-3, "{}", found.focal_sigma);
}

#[test]
fn a_line_that_is_not_straight_is_named_and_does_no_harm() {
    let truth = lens(Projection::Equidistant, 140.0);
    let mut lines = scene(&truth, 0.2, 11);
    let last = lines[3].points.len() as f64 - 1.0;
    for (i, p) in lines[3].points.iter_mut().enumerate() {
        let t = 2.0 * i as f64 / last - 1.0;
        *p += Vec2::new(0.5, -0.8) * 25.0 * t * t;
    }
    lines[7].points.truncate(2);
    let found = calibrate(&lines, SIZE, &CalibrationOptions::default(), &Run::default()).expect("a lens");
    let roles: Vec<_> = found.lines.iter().map(|l| l.role).collect();
    assert_eq!(roles[3], LineRole::Bent);
    assert_eq!((roles[7], found.lines[7].distance_px), (LineRole::TooShort, None));
    assert_eq!(roles.iter().filter(|r| **r == LineRole::Used).count(), 10, "{:?}", found.lines);
    assert!((found.lens.focal.x / truth.focal.x).ln().abs() < 0.01, "{:?}", found.lens);
    assert!(bend(&truth, &found.lens) < 0.5);
}

#[test]
fn marks_scaled_with_their_picture_give_the_lens_scaled() {
    let truth = lens(Projection::Equisolid, 130.0);
    let lines = scene(&truth, 0.2, 6);
    let doubled: Vec<_> =
        lines.iter().map(|l| Line { points: l.points.iter().map(|p| p * 2.0).collect(), ..l.clone() }).collect();
    let options = CalibrationOptions::default();
    let small = calibrate(&lines, SIZE, &options, &Run::default()).expect("a lens");
    let large = calibrate(&doubled, (2.0 * SIZE.0, 2.0 * SIZE.1), &options, &Run::default()).expect("a lens");
    assert_eq!(small.model, large.model);
    assert!((large.lens.focal.x / small.lens.focal.x - 2.0).abs() < 1e-3, "{:?} {:?}", small.lens, large.lens);
}

#[test]
fn lines_that_determine_no_lens_are_refused_with_the_reason() {
    let options = CalibrationOptions::default();
    let refused =
        |lines: &[Line], size| calibrate(lines, size, &options, &Run::default()).expect_err("refused").to_string();
    let good = scene(&lens(Projection::Equidistant, 120.0), 0.2, 1);
    assert!(
        refused(&[], SIZE).starts_with("0 lines of three points or more with 0 points in all do not determine a lens")
    );
    assert!(refused(&good[..1], SIZE).contains("expected 2 lines"));
    assert!(refused(&good, (0.0, f64::NAN)).starts_with("picture size 0 × NaN px is invalid"));
    let mut broken = good.clone();
    broken[2].points[1].x = f64::NAN;
    assert_eq!(refused(&broken, SIZE), "line \"line 2\" has a point that is not finite: mark it again");
    // Points that coincide are no line, but no reason to panic either.
    for points in [vec![Point2::new(5.0, 5.0); 6], vec![Point2::new(500.0, 375.0); 6]] {
        let lines = vec![Line { name: "dot".into(), points, orientation: Orientation::Free }; 3];
        let _ = calibrate(&lines, SIZE, &options, &Run::default());
    }
    let mut rng = fastrand::Rng::with_seed(2);
    let noise: Vec<_> = (0..6)
        .map(|i| Line {
            name: i.to_string(),
            points: (0..9).map(|_| Point2::new(1000.0 * rng.f64(), 750.0 * rng.f64())).collect(),
            orientation: Orientation::Free,
        })
        .collect();
    let _ = calibrate(&noise, SIZE, &options, &Run::default());
}
