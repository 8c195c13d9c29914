//! Laws that every projection obeys.

use std::f64::consts::{FRAC_PI_2, PI};

use super::*;

/// One of each kind, and more where the parameters change the branch.
pub(crate) fn projections() -> Vec<Projection> {
    vec![
        Projection::Rectilinear,
        Projection::Equidistant,
        Projection::Equisolid,
        Projection::Stereographic,
        Projection::Orthographic,
        Projection::kannala_brandt([0.0397, 0.0385, -0.03, 0.0076]),
        Projection::kannala_brandt([-0.02, -0.003, 0.0004, -0.00002]),
        Projection::AnglePolynomial(AnglePolynomial::new([-0.09, 0.05, -0.02])),
        Projection::Division(-0.31),
        Projection::Division(0.02),
        Projection::Division(0.0),
        Projection::FieldOfView(2.0 * (0.45_f64).tan()),
        Projection::Unified(Unified::camera(0.41).expect("valid")),
        Projection::Unified(Unified::camera(0.72).expect("valid")),
        Projection::Unified(Unified::extended(0.586, 1.139).expect("valid")),
        Projection::Unified(Unified::extended(0.4, 0.8).expect("valid")),
        Projection::Unified(Unified::double_sphere(-0.244, 0.5657).expect("valid")),
        Projection::Unified(Unified::double_sphere(0.4, 0.35).expect("valid")),
        Projection::Ocam(fisheye_of_the_toolbox()),
        Projection::BrownConrady(distorted(DistortedPlane::Tangent)),
        Projection::BrownConrady(distorted(DistortedPlane::Angle)),
        Projection::BrownConrady(distorted(DistortedPlane::Sphere(0.8))),
        Projection::BrownConrady(distorted(DistortedPlane::Sphere(1.7))),
        Projection::BrownConrady(radial_only()),
        Projection::RadialPolynomial(bent(&Projection::Rectilinear)),
        Projection::RadialPolynomial(bent(&Projection::Equidistant)),
        Projection::RadialPolynomial(bent(&Projection::Stereographic)),
        Projection::Equirectangular,
        Projection::Cylindrical,
        Projection::Mercator,
        Projection::Panini(0.0),
        Projection::Panini(0.6),
        Projection::Panini(1.0),
        Projection::Panini(2.0),
    ]
}

/// With all kinds of terms, all small.
fn distorted(plane: DistortedPlane) -> BrownConrady {
    let terms = DistortionTerms {
        radial: [-0.11, 0.021, -0.0004, 0.0007],
        rational: [0.012, 0.003, 0.0001],
        tangential: [0.0007, -0.0011],
        thin_prism: [0.0009, -0.0002, -0.0006, 0.0001],
    };
    BrownConrady::new(plane, terms).expect("valid")
}

fn radial_only() -> BrownConrady {
    let terms = DistortionTerms { radial: [-0.29, 0.0796, 0.0, 0.0], ..DistortionTerms::default() };
    BrownConrady::new(DistortedPlane::Tangent, terms).expect("valid")
}

/// A real 190° lens, its affine part exaggerated.
fn fisheye_of_the_toolbox() -> Ocam {
    let f: f64 = 471.44;
    let a = [0.0, 7.356e-04, -3.773e-07, 5.8e-10];
    let b: Vec<f64> = (1..).zip(a).map(|(i, a)| -a * f.powi(i - 1)).collect();
    Ocam::new(&b, Matrix2::new(1.0, -0.01, -0.02, 1.003)).expect("valid")
}

fn bent(base: &Projection) -> RadialPolynomial {
    let (a, b, c) = (0.012, -0.034, 0.006);
    RadialPolynomial::new(base, 0.7, [1.0 - a - b - c, c, b, a, 0.0]).expect("valid")
}

fn lens(projection: Projection) -> Lens {
    Lens { projection, focal: Vec2::new(310.0, 305.0), center: Point2::new(402.5, 297.25), size: (800.0, 600.0) }
}

/// Directions all over the sphere, none of them special, of various lengths.
fn directions() -> Vec<Vec3> {
    let mut random = fastrand::Rng::with_seed(11);
    let mut direction = || Vec3::from_fn(|_, _| random.f64() - 0.5);
    let all = (0..800).map(|i| direction() * if i % 2 == 0 { 1.0 } else { 37.0 });
    all.filter(|d| d.norm() > 0.1).collect()
}

fn off_axis(ray: &Vec3) -> f64 {
    ray.x.hypot(ray.y).atan2(ray.z)
}

#[test]
fn a_pixel_looks_where_it_is_seen_from() {
    for projection in projections() {
        let lens = lens(projection);
        let mut seen = 0;
        for ray in directions() {
            let Some(p) = lens.project(&ray) else { continue };
            seen += 1;
            let back = lens.unproject(p).unwrap_or_else(|| panic!("{:?}: {ray:?} at {p:?}", lens.projection));
            assert!((back.norm() - 1.0).abs() < 1e-14, "{:?}", lens.projection);
            // Near the edge of the field a pixel holds much angle.
            let slope =
                lens.project_with_jacobian(&ray.normalize()).expect("seen").1.svd(false, false).singular_values[1];
            let miss = (back - ray.normalize()).norm();
            assert!(miss * slope < 1e-9 * (1.0 + p.coords.norm()), "{:?}: {ray:?} {miss:e}", lens.projection);
        }
        assert!(seen > 200, "{:?} sees {seen} of {} directions", lens.projection, directions().len());
    }
}

#[test]
fn everything_inside_the_field_is_seen_and_nothing_beyond() {
    for projection in projections() {
        let (lens, limit) = (lens(projection), |l: &Lens| l.max_angle());
        for ray in directions() {
            let inside = off_axis(&ray) < limit(&lens) - 1e-9;
            let seen = lens.project(&ray).is_some();
            assert!(seen || !inside, "{:?} misses {:.2}°", lens.projection, off_axis(&ray).to_degrees());
            assert!(inside || !seen || lens.projection.is_panoramic(), "{:?} sees {ray:?}", lens.projection);
        }
    }
}

#[test]
fn the_jacobian_agrees_with_central_differences() {
    let h = 1e-6;
    for projection in projections() {
        let lens = lens(projection);
        for ray in directions().iter().map(Vec3::normalize) {
            let Some((p, jacobian)) = lens.project_with_jacobian(&ray) else { continue };
            assert_eq!(Some(p), lens.project(&ray));
            assert!((jacobian * ray).norm() < 1e-9 * jacobian.norm(), "length does not matter: {:?}", lens.projection);
            for k in 0..3 {
                let step = Vec3::ith(k, h);
                let (Some(a), Some(b)) = (lens.project(&(ray + step)), lens.project(&(ray - step))) else { continue };
                if (a - b).norm() > 100.0 {
                    continue; // across the seam of a panorama
                }
                let slope = (a - b) / (2.0 * h);
                let size = jacobian.norm() * (1.0 + jacobian.norm() / 310.0);
                assert!((slope - jacobian.column(k)).norm() < 1e-6 * size, "{:?} {ray:?} {k}", lens.projection);
            }
        }
    }
}

#[test]
fn the_axis_is_seen_at_the_center_with_the_slope_of_the_focal_length() {
    for projection in projections() {
        let lens = lens(projection);
        let (p, jacobian) = lens.project_with_jacobian(&Vec3::new(0.0, 0.0, 2.0)).expect("the axis");
        assert!((p - lens.center).norm() < 1e-12, "{:?}", lens.projection);
        let slope = match &lens.projection {
            Projection::Ocam(ocam) => ocam.affine(),
            Projection::RadialPolynomial(polynomial) => polynomial.parameters().2[0] * Matrix2::identity(),
            _ => Matrix2::identity(),
        };
        let expected = Matrix2::from_diagonal(&lens.focal) * slope * Matrix2x3::identity();
        assert!((jacobian - expected / 2.0).norm() < 1e-9, "{:?}: {jacobian}", lens.projection);
        assert!((lens.unproject(lens.center).expect("the axis") - Vec3::z()).norm() < 1e-15);
        // And it is reached smoothly.
        let off = Vec3::new(1e-9, -2e-9, 1.0);
        let near = lens.project(&off).expect("near the axis") - lens.center;
        assert!((near - expected * off).norm() < 1e-12, "{:?} {near}", lens.projection);
    }
}

#[test]
fn directions_behind_the_camera_are_seen_by_those_that_can() {
    let behind = Vec3::new(0.6, 0.3, -0.5);
    for projection in projections() {
        let sees = lens(projection.clone()).project(&behind).is_some();
        let blind = matches!(projection, Projection::Rectilinear | Projection::Orthographic | Projection::Panini(0.0));
        let limited = lens(projection.clone()).max_angle() < off_axis(&behind) && !projection.is_panoramic();
        let panini = matches!(projection, Projection::Panini(_));
        assert!(sees != (blind || limited) || panini, "{projection:?}");
    }
    for projection in [Projection::Equidistant, Projection::Equisolid, Projection::Stereographic] {
        let lens = lens(projection);
        let nearly = Vec3::new(1e-7, 0.0, -1.0);
        let back = lens.project(&nearly).and_then(|p| lens.unproject(p)).expect("inside the field");
        assert!((back - nearly).norm() < 1e-7, "{:?}", lens.projection);
        assert_eq!(lens.project(&Vec3::new(0.0, 0.0, -1.0)), None, "{:?}: seen all around", lens.projection);
    }
}

#[test]
fn what_is_no_direction_has_no_image_and_what_is_no_pixel_no_direction() {
    for projection in projections() {
        let lens = lens(projection);
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            for k in 0..3 {
                let mut ray = Vec3::new(0.1, 0.2, 1.0);
                ray[k] = bad;
                assert_eq!(lens.project(&ray), None);
                assert!(lens.project_with_jacobian(&ray).is_none());
            }
            assert_eq!(lens.unproject(Point2::new(bad, 3.0)), None);
            assert_eq!(lens.unproject(Point2::new(3.0, bad)), None);
        }
        assert_eq!(lens.project(&Vec3::zeros()), None);
        for far in [1e30, 1e300, -1e308] {
            if let Some(ray) = lens.unproject(Point2::new(far, 0.3 * far)) {
                assert!((ray.norm() - 1.0).abs() < 1e-12, "{:?} {ray:?}", lens.projection);
            }
        }
        for tiny in [Vec3::new(0.0, 1e-300, 1e-300), Vec3::new(1e300, 1e300, 1e300)] {
            assert!(lens.project(&tiny).is_none_or(|p| p.coords.iter().all(|v| v.is_finite())));
        }
    }
}

#[test]
fn the_classical_radii_are_those_of_the_books() {
    let t = 0.7_f64;
    let ray = Vec3::new(t.sin(), 0.0, t.cos());
    for (projection, r) in [
        (Projection::Rectilinear, t.tan()),
        (Projection::Equidistant, t),
        (Projection::Equisolid, 2.0 * (t / 2.0).sin()),
        (Projection::Stereographic, 2.0 * (t / 2.0).tan()),
        (Projection::Orthographic, t.sin()),
        (
            Projection::kannala_brandt([0.1, 0.2, 0.3, 0.4]),
            t + 0.1 * t.powi(3) + 0.2 * t.powi(5) + 0.3 * t.powi(7) + 0.4 * t.powi(9),
        ),
        (
            Projection::AnglePolynomial(AnglePolynomial::new([0.1, 0.2, 0.3])),
            t + 0.1 * t.powi(2) + 0.2 * t.powi(3) + 0.3 * t.powi(4),
        ),
        (Projection::Equirectangular, t),
        (Projection::Panini(1.0), 2.0 * (t / 2.0).tan()),
        (Projection::Panini(0.0), t.tan()),
    ] {
        let p = lens(projection.clone()).project(&ray).expect("in front");
        assert!((p.x - 402.5 - 310.0 * r).abs() < 1e-10 && (p.y - 297.25).abs() < 1e-12, "{projection:?}");
    }
    let up = Vec3::new(0.0, t.sin(), t.cos());
    for (projection, y) in [
        (Projection::Equirectangular, t),
        (Projection::Cylindrical, t.tan()),
        (Projection::Mercator, (t / 2.0 + std::f64::consts::FRAC_PI_4).tan().ln()),
        (Projection::Panini(1.7), t.tan()),
    ] {
        let p = lens(projection.clone()).project(&up).expect("in front");
        assert!((p.y - 297.25 - 305.0 * y).abs() < 1e-10 && (p.x - 402.5).abs() < 1e-12, "{projection:?}");
    }
}

#[test]
fn a_polynomial_that_turns_back_shows_nothing_beyond_the_turn() {
    // dr/dθ = 1 − 3·0.1 θ²: turns back at √(1/0.3) = 104.6°.
    let lens = lens(Projection::kannala_brandt([-0.1, 0.0, 0.0, 0.0]));
    let turn = (1.0_f64 / 0.3).sqrt();
    assert!((lens.max_angle() - turn).abs() < 1e-12);
    let at = |t: f64| lens.project(&Vec3::new(t.sin(), 0.0, t.cos()));
    assert!(at(turn - 1e-6).is_some() && at(turn + 1e-6).is_none());
    let farthest = turn - 0.1 * turn.powi(3);
    let pixel = |r: f64| lens.unproject(Point2::new(402.5 + 310.0 * r, 297.25));
    assert!(pixel(farthest + 1e-9).is_none());
    let edge = pixel(farthest - 1e-6).expect("just inside");
    assert!(off_axis(&edge) < turn && off_axis(&edge) > turn - 0.01);
    assert_eq!(Projection::kannala_brandt([f64::NAN, 0.0, 0.0, 0.0]).with(|m| m.max_angle()), 0.0);
}

#[test]
fn limits_are_those_of_the_formulas() {
    let limit = |p: Projection| p.with(|m| m.max_angle());
    assert_eq!(limit(Projection::Rectilinear), FRAC_PI_2);
    assert_eq!(limit(Projection::Orthographic), FRAC_PI_2);
    assert_eq!(limit(Projection::Equisolid), PI);
    assert_eq!(limit(Projection::kannala_brandt([0.0; 4])), PI);
    assert_eq!(limit(Projection::Panini(-0.1)), 0.0);
}

#[test]
fn a_scaled_picture_is_seen_by_the_scaled_lens() {
    let full = lens(Projection::Equidistant);
    let half = full.resized((400.0, 300.0)).expect("the same shape");
    let ray = Vec3::new(0.3, -0.2, 0.8);
    let (a, b) = (full.project(&ray).expect("in front"), half.project(&ray).expect("in front"));
    assert!((a.coords / 2.0 - b.coords).norm() < 1e-12);
    assert!(full.resized((267.0, 200.0)).is_ok(), "rounded to pixels");
    for wrong in [(800.0, 450.0), (600.0, 800.0)] {
        assert!(matches!(full.resized(wrong), Err(LensError::Aspect { .. })));
    }
    let turned = full.resized((600.0, 800.0)).expect_err("turned").to_string();
    assert!(turned.contains("turned by 90°"), "{turned}");
    assert!(!full.resized((800.0, 450.0)).expect_err("cropped").to_string().contains("turned by 90°"));
    for none in [(0.0, 0.0), (f64::NAN, 3.0), (-800.0, -600.0)] {
        assert!(matches!(full.resized(none), Err(LensError::Size(..))));
    }
}
