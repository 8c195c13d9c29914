//! Formats by example, what they refuse, and bytes of all kinds.

use nalgebra::Matrix2;
use proptest::prelude::*;

use super::*;
use crate::{Projection, Vec3};

/// Nothing known of the picture.
fn unknown() -> ExifFacts {
    ExifFacts::default()
}

fn sized(width: f64, height: f64) -> ExifFacts {
    ExifFacts { size: Some((width, height)), ..ExifFacts::default() }
}

fn parsed(text: &str) -> Profile {
    parse_lens(text, &unknown()).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

fn refused(text: &str) -> String {
    parse_lens(text, &unknown()).expect_err(text).to_string()
}

/// Where a direction is seen.
fn seen(profile: &Profile, x: f64, y: f64, z: f64) -> Point2 {
    profile.lens.project(&Vec3::new(x, y, z)).expect("inside the field")
}

/// Asserts that (0.3, −0.2, 1) is seen at `(x, y)` of OpenCV's coordinates.
fn seen_by_opencv_at(profile: &Profile, x: f64, y: f64) {
    let p = seen(profile, 0.3, -0.2, 1.0);
    assert!((p - Point2::new(x + 0.5, y + 0.5)).norm() < 1e-6, "{} at {p}, not ({x}, {y})", profile.format);
}

const OPENCV_FISHEYE: &str = "%YAML:1.0
---
image_width: 1000
image_height: 750
fisheye_model: 1
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 437., 0., 493.5, 0., 436., 379., 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 4
   cols: 1
   dt: d
   data: [ 4.0e-02, 3.8e-02, -3.0e-02, 7.5e-03 ]
avg_reprojection_error: 3.0e-01
";

const OPENCV_STANDARD_XML: &str = r#"<?xml version="1.0"?>
<opencv_storage>
<image_width>640</image_width> <image_height>480</image_height>
<camera_matrix type_id="opencv-matrix"><rows>3</rows><cols>3</cols><dt>d</dt>
  <data>500. 0. 320. 0. 510. 240. 0. 0. 1.</data></camera_matrix>
<distortion_coefficients type_id="opencv-matrix"><rows>5</rows><cols>1</cols><dt>d</dt>
  <data>-0.3 0.1 0.001 -0.002 0.05</data></distortion_coefficients>
</opencv_storage>"#;

const ROS: &str = "image_width: 640
image_height: 480
camera_name: left
camera_matrix: {rows: 3, cols: 3, data: [500, 0, 320, 0, 510, 240, 0, 0, 1]}
distortion_model: plumb_bob
distortion_coefficients: {rows: 1, cols: 5, data: [-0.3, 0.1, 0.001, -0.002, 0.05]}
";

const CAMCHAIN: &str = "cam0:
  cam_overlaps: [1]
  camera_model: pinhole
  distortion_coeffs: [-0.3, 0.1, 0.001, -0.002]
  distortion_model: radtan
  intrinsics: [500.0, 510.0, 320.0, 240.0]
  resolution: [640, 480]
  rostopic: /cam0/image_raw
cam1:
  T_cn_cnm1:
  - [1.0, 0.0, 0.0, 0.1]
  - [0.0, 1.0, 0.0, 0.0]
  - [0.0, 0.0, 1.0, 0.0]
  - [0.0, 0.0, 0.0, 1.0]
  camera_model: omni
  distortion_coeffs: [-0.1, 0.2, 0.001, -0.002]
  distortion_model: radtan
  intrinsics: [1.8, 1400.0, 1410.0, 400.0, 300.0]
  resolution: [800, 600]
";

const OCAM: &str = "#polynomial coefficients for the DIRECT mapping function (ocam_model.ss in MATLAB).

3 -300.0 0.0 0.0008

#polynomial coefficients for the inverse mapping function

2 400.0 200.0

#center: \"row\" and \"column\", starting from 0 (C convention)

240.0 330.0

#affine parameters \"c\", \"d\", \"e\"

1.01 0.02 -0.03

#image size: \"height\" and \"width\"

480 640
";

const GYROFLOW: &str = r#"{"name": "A_B", "camera_brand": "A", "calib_dimension": {"w": 1920, "h": 1080},
 "orig_dimension": {"w": 1920, "h": 1080}, "input_horizontal_stretch": 1.0, "asymmetrical": false,
 "fisheye_params": {"RMS_error": 0.6, "camera_matrix": [[900.0, 0.0, 940.0], [0.0, 910.0, 530.0], [0.0, 0.0, 1.0]],
 "distortion_coeffs": [0.1, 0.02, -0.03, 0.004], "radial_distortion_limit": null},
 "distortion_model": null, "digital_lens": null}"#;

const WOODSCAPE: &str = r#"{"extrinsic": {"translation": [3.7, 0.0, 0.6]}, "intrinsic": {"aspect_ratio": 1.01,
 "cx_offset": 3.9, "cy_offset": -3.0, "height": 966.0, "k1": 339.7, "k2": -31.9, "k3": 48.2, "k4": -7.2,
 "model": "radial_poly", "poly_order": 4, "width": 1280.0}, "name": "FV"}"#;

const COLMAP: &str = "# Camera list with one line of data per camera:
#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]
# Number of cameras: 1
1 OPENCV 640 480 500 510 320.5 240.5 -0.3 0.1 0.001 -0.002
";

const LENSFUN: &str = r#"<!DOCTYPE lensdatabase SYSTEM "lensfun-database.dtd">
<lensdatabase version="2">
 <camera><maker>Canon</maker><model>Canon EOS 7D</model><mount>Canon EF</mount><cropfactor>1.6</cropfactor></camera>
 <camera><maker>Ricoh</maker><model>GR II</model><mount>ricohGR2</mount><cropfactor>1.5</cropfactor></camera>
 <lens><maker>Canon</maker><model>Canon EF-S 10-22mm f/3.5-4.5 USM</model><mount>Canon EF</mount><cropfactor>1.6</cropfactor>
  <calibration><distortion model="ptlens" focal="10" a="0.01" b="-0.03" c="0.005"/>
   <distortion model="ptlens" focal="22" a="0" b="-0.01" c="0"/></calibration></lens>
 <lens><maker>Sigma</maker><model>Sigma 8mm f/3.5 EX DG circular fisheye</model><mount>Canon EF</mount><type>equisolid</type>
  <cropfactor>1</cropfactor><calibration><distortion model="poly3" focal="8" k1="0.01" real-focal="7.8"/></calibration></lens>
 <lens><maker>Ricoh</maker><model>GR II lens</model><mount>ricohGR2</mount><cropfactor>1.5</cropfactor>
  <calibration><distortion model="poly5" focal="18.3" k1="-0.01" k2="0.002"/></calibration></lens>
</lensdatabase>"#;

const OWN: &str = r#"{"version": 1, "name": "mine", "model": "kannala-brandt", "width": 1000, "height": 750, "fx": 437,
 "fy": 436, "cx": 494, "cy": 379.5, "k": [0.04, 0.038, -0.03, 0.0075]}"#;

const PLAIN: &str = r#"{"model": "kb", "fx": 437, "fy": 436, "cx": 493.5, "cy": 379.0, "k": [0.04, 0.038, -0.03, 0.0075],
 "width": 1000, "height": 750, "rms_px": 0.3, "n_images": 22, "source": "somewhere"}"#;

const ALL: [&str; 11] =
    [OPENCV_FISHEYE, OPENCV_STANDARD_XML, ROS, CAMCHAIN, OCAM, GYROFLOW, WOODSCAPE, COLMAP, LENSFUN, OWN, PLAIN];

#[test]
fn opencvs_fisheye_in_three_notations_is_one_lens() {
    let [yaml, own, plain] = [OPENCV_FISHEYE, OWN, PLAIN].map(parsed);
    assert_eq!((yaml.format, own.format, plain.format), ("OpenCV", "lens JSON", "lens JSON"));
    assert_eq!(yaml.lens, own.lens);
    assert_eq!(yaml.lens, plain.lens);
    assert_eq!((yaml.rms_px, plain.rms_px, own.name.as_str()), (Some(0.3), Some(0.3), "mine"));
    let r = 0.13_f64.sqrt();
    let theta = r.atan();
    let bent =
        theta * (1.0 + 0.04 * theta.powi(2) + 0.038 * theta.powi(4) - 0.03 * theta.powi(6) + 0.0075 * theta.powi(8));
    seen_by_opencv_at(&yaml, 437.0 * bent * 0.3 / r + 493.5, -436.0 * bent * 0.2 / r + 379.0);
}

#[test]
fn the_standard_camera_reads_the_same_from_xml_and_ros_and_in_the_order_of_opencv() {
    let [xml, ros] = [OPENCV_STANDARD_XML, ROS].map(parsed);
    assert_eq!(xml.lens, ros.lens);
    assert_eq!(ros.name, "left");
    let (x, y) = (0.3, -0.2);
    let s: f64 = 0.13;
    let g = 1.0 - 0.3 * s + 0.1 * s * s + 0.05 * s.powi(3);
    let u = g * x + 2.0 * 0.001 * x * y - 0.002 * (s + 2.0 * x * x);
    let v = g * y + 0.001 * (s + 2.0 * y * y) - 2.0 * 0.002 * x * y;
    seen_by_opencv_at(&xml, 500.0 * u + 320.0, 510.0 * v + 240.0);
}

#[test]
fn a_chain_gives_the_camera_of_the_pictures_size() {
    let pinhole = parse_lens(CAMCHAIN, &sized(640.0, 480.0)).expect("cam0");
    assert_eq!((pinhole.name.as_str(), pinhole.format), ("cam0", "Kalibr"));
    let omni = parse_lens(CAMCHAIN, &sized(800.0, 600.0)).expect("cam1");
    let (xi, d) = (1.8, (1.0_f64 + 0.13).sqrt());
    let (x, y) = (0.3 / (1.0 + xi * d), -0.2 / (1.0 + xi * d));
    let s = x * x + y * y;
    let g = 1.0 - 0.1 * s + 0.2 * s * s;
    let u = g * x + 2.0 * 0.001 * x * y - 0.002 * (s + 2.0 * x * x);
    let v = g * y + 0.001 * (s + 2.0 * y * y) - 2.0 * 0.002 * x * y;
    seen_by_opencv_at(&omni, 1400.0 * u + 400.0, 1410.0 * v + 300.0);
    assert!(refused(CAMCHAIN).contains("several cameras (cam0, cam1)"));
}

#[test]
fn kalibrs_other_cameras_follow_their_papers() {
    let chain = |camera: &str, intrinsics: &str, distortion: &str| {
        parsed(&format!(
            "cam0:\n  camera_model: {camera}\n  intrinsics: [{intrinsics}]\n  distortion_model: {distortion}\n  \
             distortion_coeffs: [0.9, 0.0, 0.0, 0.0]\n  resolution: [640, 480]\n"
        ))
    };
    let at = |profile: &Profile, m: f64| seen_by_opencv_at(profile, 300.0 * 0.3 * m + 320.0, -310.0 * 0.2 * m + 240.0);
    let d = 1.13_f64.sqrt();
    at(&chain("pinhole", "300, 310, 320, 240", "none"), 1.0);
    let eucm = 1.0 / (0.6 * (1.1 * 0.13 + 1.0_f64).sqrt() + 0.4);
    at(&chain("eucm", "0.6, 1.1, 300, 310, 320, 240", "none"), eucm);
    let z = -0.2 * d + 1.0;
    at(&chain("ds", "-0.2, 0.55, 300, 310, 320, 240", "none"), 1.0 / (0.55 * (0.13 + z * z).sqrt() + 0.45 * z));
    let r = 0.13_f64.sqrt();
    at(&chain("pinhole", "300, 310, 320, 240", "fov"), (2.0 * r * 0.45_f64.tan()).atan() / 0.9 / r);
    let bent = r.atan() * (1.0 + 0.9 * r.atan().powi(2)) / r;
    at(&chain("pinhole", "300, 310, 320, 240", "equidistant"), bent);
    let text = "cam0:\n  camera_model: omni\n  intrinsics: [1, 2]\n  distortion_model: cubic\n  resolution: [4, 4]\n";
    assert!(refused(text).starts_with("uses the camera model `omni-cubic` (known in Kalibr: "));
}

#[test]
fn single_cameras_are_recognized_by_the_names_of_their_parameters() {
    let file = |parameters: &str| {
        format!(
            "image:\n  width: 640\n  height: 480\nparameter:\n  fx: 300\n  fy: 310\n  cx: 320\n  cy: 240\n{parameters}"
        )
    };
    let kind = |parameters: &str| parsed(&file(parameters)).lens.projection;
    assert_eq!(kind(""), Projection::Rectilinear);
    assert!(matches!(kind("  alpha: 0.6\n  xi: -0.2\n"), Projection::Unified(u) if u.parameters() == (-0.2, 0.6, 1.0)));
    assert!(matches!(kind("  alpha: 0.6\n  beta: 1.2\n"), Projection::Unified(u) if u.parameters() == (0.0, 0.6, 1.2)));
    assert!(matches!(kind("  k1: 0.1\n  k2: 0\n  k3: 0\n  k4: 0\n"), Projection::KannalaBrandt(_)));
    assert!(matches!(kind("  k1: 0.1\n  k2: 0\n  p1: 0.001\n  p2: 0\n"), Projection::BrownConrady(_)));
    assert!(
        refused(&file("  gamma: 1\n")).contains("fx fy cx cy gamma")
            || refused(&file("  gamma: 1\n")).contains("gamma")
    );
}

#[test]
fn the_toolbox_counts_rows_first_and_looks_along_minus_z() {
    let profile = parsed(OCAM);
    // The formulas of the toolbox, forwards from a pixel.
    let (row, column) = (100.0, 500.0);
    let affine = Matrix2::new(1.01, 0.02, -0.03, 1.0);
    let rho = affine.try_inverse().expect("near the identity") * Vec2::new(row - 240.0, column - 330.0);
    let (x, y, z) = (rho.x, rho.y, -300.0 + 0.0008 * rho.norm_squared());
    let ray = profile.lens.unproject(Point2::new(column + 0.5, row + 0.5)).expect("inside the picture");
    assert!((ray - Vec3::new(y, x, -z).normalize()).norm() < 1e-12, "{ray}");
}

#[test]
fn gyroflow_centers_unless_told_otherwise() {
    let profile = parsed(GYROFLOW);
    assert_eq!(profile.lens.center, Point2::new(960.0, 540.0));
    assert_eq!((profile.rms_px, profile.name.as_str()), (Some(0.6), "A_B"));
    let own = parsed(&GYROFLOW.replace("\"asymmetrical\": false", "\"asymmetrical\": true"));
    assert_eq!(own.lens.center, Point2::new(940.5, 530.5));
    let standard = parsed(&GYROFLOW.replace("\"distortion_model\": null", "\"distortion_model\": \"opencv_standard\""));
    assert!(matches!(standard.lens.projection, Projection::BrownConrady(_)));
    let sony = refused(&GYROFLOW.replace("\"distortion_model\": null", "\"distortion_model\": \"sony\""));
    assert_eq!(sony, "uses the camera model `sony` (known in Gyroflow: opencv_fisheye, opencv_standard)");
    assert!(
        refused(&GYROFLOW.replace("\"digital_lens\": null", "\"digital_lens\": \"gopro_superview\""))
            .contains("digital_lens")
    );
    assert!(refused(&GYROFLOW.replace("stretch\": 1.0", "stretch\": 1.33")).contains("anamorphic"));
}

#[test]
fn woodscapes_polynomial_is_in_pixels() {
    let profile = parsed(WOODSCAPE);
    let theta = 0.13_f64.sqrt().atan();
    let rho = 339.7 * theta - 31.9 * theta.powi(2) + 48.2 * theta.powi(3) - 7.2 * theta.powi(4);
    let r = 0.13_f64.sqrt();
    seen_by_opencv_at(&profile, rho * 0.3 / r + 640.0 + 3.9 - 0.5, -1.01 * rho * 0.2 / r + 483.0 - 3.0 - 0.5);
}

#[test]
fn colmaps_models_have_their_parameters_in_colmaps_order() {
    assert_eq!(parsed(COLMAP).lens.center, Point2::new(320.5, 240.5));
    let (x, y): (f64, f64) = (0.3, -0.2);
    let (s, r) = (0.13_f64, 0.13_f64.sqrt());
    let t = r.atan();
    let plane = |m: f64| (m * x, m * y);
    let tangential = |u: f64, v: f64, p: [f64; 2]| {
        let s = u * u + v * v;
        (2.0 * p[0] * u * v + p[1] * (s + 2.0 * u * u), 2.0 * p[1] * u * v + p[0] * (s + 2.0 * v * v))
    };
    let standard = |g: f64| {
        let (a, b) = tangential(x, y, [0.001, -0.002]);
        (g * x + a, g * y + b)
    };
    let thin = {
        let ((u, v), g) = (plane(t / r), 1.0 + 0.1 * t * t + 0.02 * t.powi(4) + 0.03 * t.powi(6) + 0.004 * t.powi(8));
        let (a, b) = tangential(u, v, [0.001, -0.002]);
        (g * u + a + 0.0003 * t * t, g * v + b + 0.0004 * t * t)
    };
    let d = |s: f64| (1.0 - (1.0 - 4.0 * -0.1 * s).sqrt()) / (2.0 * -0.1 * s);
    for (model, parameters, m) in [
        ("SIMPLE_PINHOLE", "300 320 240", plane(1.0)),
        ("PINHOLE", "300 310 320 240", plane(1.0)),
        ("SIMPLE_RADIAL", "300 320 240 -0.2", plane(1.0 - 0.2 * s)),
        ("RADIAL", "300 320 240 -0.2 0.1", plane(1.0 - 0.2 * s + 0.1 * s * s)),
        ("OPENCV", "300 310 320 240 -0.2 0.1 0.001 -0.002", standard(1.0 - 0.2 * s + 0.1 * s * s)),
        (
            "FULL_OPENCV",
            "300 310 320 240 -0.2 0.1 0.001 -0.002 0.05 0.01 0.02 0.03",
            standard(
                (1.0 - 0.2 * s + 0.1 * s * s + 0.05 * s.powi(3)) / (1.0 + 0.01 * s + 0.02 * s * s + 0.03 * s.powi(3)),
            ),
        ),
        ("OPENCV_FISHEYE", "300 310 320 240 0.1 0.02 0 0", plane(t / r * (1.0 + 0.1 * t * t + 0.02 * t.powi(4)))),
        ("SIMPLE_RADIAL_FISHEYE", "300 320 240 0.1", plane(t / r * (1.0 + 0.1 * t * t))),
        ("RADIAL_FISHEYE", "300 320 240 0.1 0.02", plane(t / r * (1.0 + 0.1 * t * t + 0.02 * t.powi(4)))),
        ("FOV", "300 310 320 240 0.9", plane((2.0 * r * 0.45_f64.tan()).atan() / 0.9 / r)),
        ("THIN_PRISM_FISHEYE", "300 310 320 240 0.1 0.02 0.001 -0.002 0.03 0.004 0.0003 0.0004", thin),
        ("SIMPLE_DIVISION", "300 320 240 -0.1", plane(d(s))),
        ("DIVISION", "300 310 320 240 -0.1", plane(d(s))),
        ("SIMPLE_FISHEYE", "300 320 240", plane(t / r)),
        ("FISHEYE", "300 310 320 240", plane(t / r)),
        ("EUCM", "300 310 320 240 0.6 1.1", plane(1.0 / (0.6 * (1.1 * s + 1.0).sqrt() + 0.4))),
    ] {
        let profile = parsed(&format!("7 {model} 640 480 {parameters}\n"));
        let fy = if parameters.starts_with("300 310") { 310.0 } else { 300.0 };
        let p = seen(&profile, x, y, 1.0);
        assert!((p - Point2::new(320.0 + 300.0 * m.0, 240.0 + fy * m.1)).norm() < 1e-9, "{model} at {p}");
        let missing = parameters.rsplit_once(' ').expect("several").0;
        let error = refused(&format!("7 {model} 640 480 {missing}\n"));
        assert!(
            error.contains("line 1") && error.contains(model) || error.contains("is no lens file"),
            "{model}: {error}"
        );
    }
    let whole = parsed("1 EQUIRECTANGULAR 2000 1000 2000 1000\n");
    assert!((seen(&whole, 1.0, 0.0, 0.0) - Point2::new(1500.0, 500.0)).norm() < 1e-9);
    assert!((seen(&whole, 0.0, 1.0, 1e-12) - Point2::new(1000.0, 1000.0)).norm() < 1e-6);
    assert!(refused("1 RAD_TAN_THIN_PRISM_FISHEYE 640 480 1 2 3 4\n").starts_with("uses the camera model `RAD_TAN"));
}

#[test]
fn four_coefficients_are_taken_by_their_names_and_it_is_said() {
    let file = |k: &str, d: &str, more: &str| {
        format!(
            "image_width: 640\nimage_height: 480\n{k}: [[300, 0, 320], [0, 310, 240], [0, 0, 1]]\n{d}: [0.1, 0.02, 0, 0]\n{more}"
        )
    };
    let fisheye = parsed(&file("K", "D", ""));
    assert!(matches!(fisheye.lens.projection, Projection::KannalaBrandt(_)));
    assert!(fisheye.notes[0].contains("taken as fisheye"));
    let standard = parsed(&file("camera_matrix", "distortion_coefficients", ""));
    assert!(matches!(standard.lens.projection, Projection::BrownConrady(_)) && standard.notes[0].contains("standard"));
    let told = parsed(&file("K", "D", "distortion_model: standard\n"));
    assert!(matches!(told.lens.projection, Projection::BrownConrady(_)) && told.notes.is_empty());
    let omni = parsed(&file("K", "D", "xi: 1.2\n"));
    assert!((omni.lens.focal.x - 300.0 / 2.2).abs() < 1e-12);
}

#[test]
fn a_file_without_a_size_takes_the_pictures_and_says_so() {
    let text = "K: [300, 0, 320, 0, 310, 240, 0, 0, 1]\nD: [0.1, 0, 0, 0]\ndistortion_model: fisheye\n";
    assert!(refused(text).starts_with("lacks `image_width`"));
    let profile = parse_lens(text, &sized(640.0, 480.0)).expect("a size");
    assert!(profile.lens.size == (640.0, 480.0) && profile.notes[0].contains("640 × 480"));
}

fn canon(lens: &str, focal: f64) -> ExifFacts {
    ExifFacts {
        make: Some("Canon".into()),
        model: Some("Canon EOS 7D".into()),
        lens: Some(lens.into()),
        focal_mm: Some(focal),
        ..sized(5184.0, 3456.0)
    }
}

#[test]
fn the_database_finds_the_lens_and_bends_it_at_its_focal_length() {
    let profile = parse_lens(LENSFUN, &canon("EF-S10-22mm f/3.5-4.5 USM", 16.0)).expect("in the database");
    assert_eq!(profile.name, "Canon Canon EF-S 10-22mm f/3.5-4.5 USM");
    let f = 16.0 / 43.266_615 * 1.6 * 5184.0_f64.hypot(3456.0);
    assert!((profile.lens.focal.x - f).abs() < 1e-3);
    // Half way from 10 to 22 mm; the unit is half the short side, 1728 px.
    let (a, b, c) = (0.005, -0.02, 0.0025);
    let undistorted = 1200.0;
    let rho: f64 = undistorted / 1728.0;
    let bent = 1728.0 * (a * rho.powi(4) + b * rho.powi(3) + c * rho.powi(2) + (1.0 - a - b - c) * rho);
    let p = seen(&profile, undistorted, 0.0, f);
    assert!((p.x - 2592.0 - bent).abs() < 0.01, "{} {bent}", p.x - 2592.0);
}

#[test]
fn a_lens_keeps_its_distortion_on_another_sensor_and_its_real_focal_length() {
    let profile = parse_lens(LENSFUN, &canon("Sigma 8mm F3.5 EX DG Circular Fisheye", 8.0)).expect("in the database");
    let scale = 5184.0_f64.hypot(3456.0) * 1.6 / 43.266_615_305_567_87;
    assert!((profile.lens.focal.x - 7.8 * scale).abs() < 1e-6);
    let Projection::RadialPolynomial(model) = &profile.lens.projection else { panic!("{profile:?}") };
    let (base, unit, c) = model.parameters();
    assert_eq!(base, Projection::Equisolid);
    assert!((unit * 7.8 - 12.0).abs() < 1e-9, "half the short side of 36 × 24 mm: {}", unit * 7.8);
    assert_eq!(c, [0.99, 0.0, 0.01, 0.0, 0.0]);
}

#[test]
fn unknown_lenses_are_refused_with_the_nearest_names() {
    let error = parse_lens(LENSFUN, &canon("Tokina 11-16mm f/2.8", 11.0)).expect_err("unknown").to_string();
    assert!(error.starts_with("the lens \"Tokina 11-16mm f/2.8\" is not in the database (nearest: "), "{error}");
    let compact = ExifFacts {
        make: Some("RICOH IMAGING COMPANY, LTD.".into()),
        model: Some("GR II".into()),
        focal_mm: Some(18.3),
        ..sized(4928.0, 3264.0)
    };
    assert_eq!(parse_lens(LENSFUN, &compact).expect("by its mount").name, "Ricoh GR II lens");
    let nameless = ExifFacts { lens: None, ..canon("", 10.0) };
    assert!(parse_lens(LENSFUN, &nameless).expect_err("several").to_string().contains("several fit its camera"));
    assert!(refused(LENSFUN).contains("the picture's size"));
    let unfocused = ExifFacts { focal_mm: None, ..canon("EF-S10-22mm f/3.5-4.5 USM", 1.0) };
    assert!(parse_lens(LENSFUN, &unfocused).expect_err("a zoom").to_string().contains("focal length"));
}

#[test]
fn our_own_file_keeps_every_lens() {
    for projection in crate::lens::tests::projections() {
        let lens = Lens {
            projection,
            focal: Vec2::new(310.125, 305.5),
            center: Point2::new(402.5, 297.25),
            size: (800.0, 600.0),
        };
        let text = serde_json::to_string(&LensFile::of(&lens, "all of them")).expect("plain data");
        let profile = parsed(&text);
        assert_eq!(profile.name, "all of them");
        assert_eq!(profile.lens.projection.name(), lens.projection.name());
        let ray = Vec3::new(0.31, -0.27, 0.9);
        let (a, b) = (lens.project(&ray).expect("in front"), profile.lens.project(&ray).expect("in front"));
        assert!((a - b).norm() < 1e-12, "{text}");
        assert!((profile.lens.max_angle() - lens.max_angle()).abs() < 1e-12);
    }
}

#[test]
fn our_own_file_refuses_unknown_keys() {
    for (from, to, says) in [
        ("\"k\"", "\"kk\"", "unknown field `kk`"),
        ("\"version\": 1", "\"format\": \"plumbline.lines\", \"version\": 1", "has `format` = plumbline.lines"),
        ("\"version\": 1", "\"version\": 2", "has `version` = 2"),
        ("kannala-brandt", "fishy", "uses the camera model `fishy`"),
        ("\"fx\": 437", "\"fx\": -437", "focal length along x` = -437"),
        ("\"fx\": 437", "\"fx\": \"wide\"", "line 1"),
        ("\"width\": 1000", "\"width\": 0", "the picture's width` = 0"),
        ("\"cx\": 494", "\"cx\": 49400", "the center's x` = 49400"),
        (
            "\"k\": [",
            "\"lambda\": 0.1, \"k\": [",
            "has `lambda` = a parameter (expected only parameters of kannala-brandt: k)",
        ),
        ("\"k\": [", "\"k\": [1,2,", "has `k` = 6 numbers (expected at most 4)"),
        ("\"fx\": 437", "\"pixel_center\": 1, \"fx\": 437", "has `pixel_center` = 1"),
    ] {
        let error = refused(&OWN.replace(from, to));
        assert!(error.contains(says), "{says:?} not in {error:?}");
    }
}

#[cfg(feature = "schema")]
#[test]
fn the_schema_names_every_key_of_a_file() {
    let schema = lens_file_schema();
    let file = serde_json::to_value(LensFile::default()).expect("plain data");
    for key in file.as_object().expect("a mapping").keys() {
        assert!(schema["properties"][key]["description"].is_string(), "{key}");
    }
}

#[test]
fn contents_that_are_no_lens_are_refused_in_words() {
    for (text, says) in [
        ("", "is no lens file that is known"),
        ("hello", "is no lens file that is known"),
        ("{}", "is no lens file that is known"),
        ("{\"fx\": ", "is no valid JSON: EOF"),
        ("<html></html>", "is no lens file that is known"),
        ("<a", "is no valid XML"),
        ("a: [1, 2", "is no valid YAML"),
        ("a: &x 1\nb: *x\n", "aliases"),
        (
            "K: [1, 2, 3]\nD: [0]\nimage_width: 1\nimage_height: 1\n",
            "has `K` = a list of 3 numbers (expected a list of 9)",
        ),
        ("cam0: {camera_model: ds, intrinsics: [0, 2, 300, 300, 1, 1], resolution: [4, 4]}", "alpha = 2 is invalid"),
        ("1 PINHOLE 640 480 a b c d", "has `line 1` = a (expected a number)"),
    ] {
        let error = refused(text);
        assert!(error.contains(says), "{says:?} not in {error:?}");
    }
    let deep = format!("a: {}", "[".repeat(100_000));
    let error = refused(&deep);
    assert!(error.contains("nested too deeply") || error.contains("recursion limit"), "{error}");
    let deep = "{\"a\":".repeat(100_000);
    assert!(refused(&deep).contains("recursion limit"));
    let deep = format!("{}{}", "<opencv_storage>".repeat(40_000), "</opencv_storage>".repeat(40_000));
    assert!(!refused(&deep).is_empty());
}

#[test]
fn a_file_is_named_in_the_message_and_large_files_and_bytes_are_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("x.json");
    let fault = |bytes: &[u8]| {
        std::fs::write(&path, bytes).expect("writable");
        read_lens(&path, &unknown()).expect_err("no lens").to_string()
    };
    assert!(fault(&[0xff, 0xfe, 0x00]).contains("x.json: cannot be read: not text in UTF-8"));
    assert!(fault(&vec![b' '; 9 << 20]).contains("larger than 8388608 bytes"));
    assert!(
        read_lens(&folder.path().join("none"), &unknown()).expect_err("absent").to_string().contains("cannot be read")
    );
    std::fs::write(&path, OWN).expect("writable");
    assert_eq!(read_lens(&path, &unknown()).expect("a lens").name, "mine");
    std::fs::write(folder.path().join("db.xml"), LENSFUN).expect("writable");
    assert!(read_lens(folder.path(), &canon("EF-S10-22mm f/3.5-4.5 USM", 16.0)).is_ok());
}

#[test]
fn a_lens_is_fitted_to_a_scaled_picture_and_not_to_a_cropped_one() {
    let lens = parsed(OWN).lens;
    assert!(lens.resized((4000.0, 3000.0)).is_ok());
    let error = lens.resized((1920.0, 1080.0)).expect_err("another shape").to_string();
    assert!(
        error.starts_with("the lens is for 1000×750 px (aspect 1.3333) and the picture is 1920×1080 px"),
        "{error}"
    );
}

/// A text of one of the formats with some of its bytes changed, cut or doubled.
fn damaged() -> impl Strategy<Value = String> {
    let change = (any::<prop::sample::Index>(), 0_u8..4, any::<u8>());
    (0..ALL.len(), prop::collection::vec(change, 0..6)).prop_map(|(which, changes)| {
        let mut bytes = ALL[which].as_bytes().to_vec();
        for (place, kind, byte) in changes {
            let at = place.index(bytes.len().max(1)).min(bytes.len().saturating_sub(1));
            match kind {
                0 if !bytes.is_empty() => bytes[at] = byte,
                1 => bytes.truncate(at),
                2 if !bytes.is_empty() => bytes.insert(at, byte),
                _ => bytes.extend_from_within(at..),
            }
        }
        String::from_utf8_lossy(&bytes).into_owned()
    })
}

/// A text of one of the formats with some of its numbers replaced.
fn renumbered() -> impl Strategy<Value = String> {
    let number =
        prop::sample::select(vec!["0", "-1", "1e308", "-1e-300", "nan", "inf", "65536", "0.5", "1e400", "[]", "null"]);
    (0..ALL.len(), any::<prop::sample::Index>(), number).prop_map(|(which, place, number)| {
        let text = ALL[which];
        let starts: Vec<usize> = text.char_indices().filter(|(_, c)| c.is_ascii_digit()).map(|(i, _)| i).collect();
        let start = starts[place.index(starts.len())];
        let rest = text[start..].trim_start_matches(|c: char| c.is_ascii_digit() || ".e+-".contains(c));
        format!("{}{number}{rest}", &text[..start])
    })
}

/// Whatever is read, it works without panics and its directions are finite.
fn holds_together(text: &str) {
    for picture in [unknown(), sized(640.0, 480.0), canon("Sigma 8mm f/3.5 fisheye", 8.0)] {
        let Ok(profile) = parse_lens(text, &picture) else { continue };
        for (x, y) in [(0.0, 0.0), (100.0, 700.0), (639.0, 1.0)] {
            if let Some(ray) = profile.lens.unproject(Point2::new(x, y)) {
                assert!((ray.norm() - 1.0).abs() < 1e-9, "{text}");
                let _ = profile.lens.project(&ray);
            }
        }
        assert!(profile.lens.max_angle() > 0.0);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1500))]

    #[test]
    fn damaged_files_are_refused_without_a_panic(text in damaged()) {
        holds_together(&text);
    }

    #[test]
    fn files_with_wrong_numbers_are_refused_without_a_panic(text in renumbered()) {
        holds_together(&text);
    }

    #[test]
    fn any_text_is_refused_without_a_panic(text in "[ -~\n]{0,200}") {
        holds_together(&text);
    }
}
