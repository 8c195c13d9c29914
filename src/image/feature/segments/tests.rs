use super::*;
use crate::Plane;

/// A half plane, its edge through `at` in direction `angle`, as a sensor with square pixels sees it (8×8 samples each).
fn half_plane(w: usize, h: usize, at: Point2, angle: f64) -> Plane<f32> {
    let normal = Vec2::new(-angle.sin(), angle.cos());
    Plane::from_fn(w, h, |x, y| {
        let inside = (0..64).filter(|k| {
            let p = Point2::new(x as f64 + (f64::from(k % 8) + 0.5) / 8.0, y as f64 + (f64::from(k / 8) + 0.5) / 8.0);
            (p - at).dot(&normal) < 0.0
        });
        60.0 + 120.0 * inside.count() as f32 / 64.0
    })
}

fn gaussian(rng: &mut fastrand::Rng) -> f32 {
    ((-2.0 * (1.0 - rng.f32()).ln()).sqrt()) * (std::f32::consts::TAU * rng.f32()).cos()
}

fn noise(w: usize, h: usize, sigma: f32, seed: u64) -> Plane<f32> {
    let mut rng = fastrand::Rng::with_seed(seed);
    Plane::from_fn(w, h, |_, _| 128.0 + sigma * gaussian(&mut rng))
}

#[test]
fn an_edge_is_found_once_within_a_tenth_of_a_pixel_and_of_a_degree() {
    // A multiple of 1/8 px, where the samples of the made-up sensor are exact along the axes.
    let at = Point2::new(80.375, 60.625);
    for degrees in [0.0_f64, 3.0, 17.0, 45.0, 80.0, 90.0, 133.0, 200.0, 301.0] {
        let picture = half_plane(160, 120, at, degrees.to_radians());
        let found = segments(picture.as_ref(), 0.0);
        assert_eq!(found.len(), 1, "{degrees}°: {found:?}");
        let (s, along) = (found[0], Vec2::new(degrees.to_radians().cos(), degrees.to_radians().sin()));
        // The brighter side is at negative normal, which is the left of `along` on a screen.
        assert!(s.direction().dot(&along) > 0.1_f64.to_radians().cos(), "{degrees}°: {s:?}");
        let normal = Vec2::new(-along.y, along.x);
        for end in [s.start, s.end] {
            assert!((end - at).dot(&normal).abs() < 0.1, "{degrees}°: {}", (end - at).dot(&normal));
        }
    }
}

#[test]
fn a_bar_has_two_edges_of_opposite_direction_that_end_where_it_ends() {
    let bar =
        Plane::from_fn(200, 100, |x, y| if (40..160).contains(&x) && (44..56).contains(&y) { 220.0 } else { 30.0 });
    let long: Vec<_> = segments(bar.as_ref(), 40.0);
    assert_eq!(long.len(), 2, "{long:?}");
    assert!(long[0].direction().dot(&long[1].direction()) < -0.9999);
    for s in long {
        let (from, to) = (s.start.x.min(s.end.x), s.start.x.max(s.end.x));
        assert!((from - 40.0).abs() < 2.0 && (to - 160.0).abs() < 2.0, "{s:?}");
        let y = s.start.y;
        assert!((y - 44.0).abs().min((y - 56.0).abs()) < 0.1, "{s:?}");
    }
}

#[test]
fn noise_holds_less_than_one_segment_per_picture() {
    let found: usize = (0..10).map(|seed| segments(noise(200, 200, 25.0, seed).as_ref(), 0.0).len()).sum();
    assert!(found < 10, "{found} segments in 10 pictures of noise");
}

#[test]
fn an_edge_survives_noise_of_a_tenth_of_its_contrast() {
    let (at, angle) = (Point2::new(100.0, 75.0), 0.4_f64);
    let (edge, noise) = (half_plane(200, 150, at, angle), noise(200, 150, 12.0, 7));
    let picture = Plane::from_fn(200, 150, |x, y| edge.as_ref().row(y)[x] + noise.as_ref().row(y)[x] - 128.0);
    let found = segments(picture.as_ref(), 0.0);
    let along = Vec2::new(angle.cos(), angle.sin());
    let on_edge = |s: &&Segment| {
        s.direction().dot(&along) > 2_f64.to_radians().cos()
            && [s.start, s.end].iter().all(|p| (p - at).perp(&along).abs() < 1.0)
    };
    let length: f64 = found.iter().filter(on_edge).map(Segment::length).sum();
    let whole = 150.0 / angle.sin().abs().max(150.0 / 200.0 * angle.cos());
    assert!(length > 0.8 * whole, "{length} of {whole}");
}

#[test]
fn a_circle_gives_no_segment_longer_than_its_curvature_allows() {
    let (c, r) = (Point2::new(100.0, 100.0), 70.0);
    let disc = Plane::from_fn(200, 200, |x, y| {
        let d = (Point2::new(x as f64 + 0.5, y as f64 + 0.5) - c).norm() - r;
        (128.0 - 80.0 * d.clamp(-0.5, 0.5)) as f32
    });
    // A chord that strays from the arc by 2 px is 2 √(2 · 2 r) long.
    let longest = 2.0 * (4.0 * r).sqrt();
    for s in segments(disc.as_ref(), 0.0) {
        assert!(s.length() < longest, "{s:?}");
    }
}

#[test]
fn pictures_without_edges_or_with_samples_that_are_no_numbers_are_borne() {
    for (w, h) in [(0, 0), (1, 1), (2, 2), (3, 3), (1, 500), (500, 1), (2, 300)] {
        for value in [0.0, 255.0, f32::NAN, f32::INFINITY, -1e38] {
            assert!(segments(Plane::from_fn(w, h, |_, _| value).as_ref(), 0.0).is_empty());
        }
    }
    let mut rng = fastrand::Rng::with_seed(3);
    let wild = Plane::from_fn(90, 70, |_, _| [0.0, 255.0, f32::NAN, 3e38, f32::NEG_INFINITY][rng.usize(0..5)]);
    segments(wild.as_ref(), 0.0);
    assert!(segments(Plane::from_fn(100, 100, |_, _| 128.0).as_ref(), 0.0).is_empty());
}

#[test]
fn the_same_picture_gives_the_same_segments() {
    let picture = half_plane(160, 120, Point2::new(80.0, 60.0), 0.3);
    assert_eq!(segments(picture.as_ref(), 0.0), segments(picture.as_ref(), 0.0));
}
