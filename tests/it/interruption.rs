//! Long calls end where their run does: with their own error's variant for it, soon, and leaving nothing half changed.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use nalgebra::{Point3, Vector3};
use plumbline::camera::{Lens, Projection};
use plumbline::image::feature::{FaceDetector, FaceOptions, FeatureError, Importance, ImportanceOptions};
use plumbline::image::render::{RenderError, complete};
use plumbline::image::{Frame, Layout, PixelFormat, Plane};
use plumbline::num::energy::ConstrainedLaplacian;
use plumbline::num::math::{Point2, Trs, Vec2};
use plumbline::num::optim::qp::{Affine, QpError, QuadraticProgram};
use plumbline::num::run::{Budget, Interrupt, Progress, Run, Stopped};
use plumbline::num::sparse::{Method, Ordering as Elimination, SparseBuilder, SparseError};
use plumbline::photo::calibration::{CalibrationOptions, calibrate};
use plumbline::photo::line_detection::{LineDetectionOptions, detect_lines};
use plumbline::photo::rectangle::{Outline, RectangleInput, RectangleOptions, rectangle};
use plumbline::photo::rectify::{Rectifier, RectifyInput, RectifyOptions, rectify};
use plumbline::photo::retarget::{RetargetOptions, retarget};
use plumbline::photo::{Line, Orientation, PhotoError};
use plumbline::shape::character::extraction::{ExtractionOptions, extract};
use plumbline::shape::character::fitting::fit_template;
use plumbline::shape::character::ik::{self, IkOptions};
use plumbline::shape::character::regression::{Example, RegressionModel, RegressionOptions};
use plumbline::shape::character::skinning::{Skinner, SkinningMethod, centers_of_rotation};
use plumbline::shape::character::weights::{WeightMethod, WeightOptions, bone_weights};
use plumbline::shape::character::{
    CharacterError, CurveSkeleton, DetailRefiner, Joint, Pose, Skeleton, Skin, SkinWeights,
};
use plumbline::shape::draw::{Style, Surface, SurfaceCamera, UpAxis, ViewDirection, draw};
use plumbline::shape::mesh::io::{WriteOptions, encode_model};
use plumbline::shape::mesh::{MeshError, MeshFormat, Model, ReadLimits, RepairOptions, TriMesh, repair, shapes};
use plumbline::shape::morph::composition::{ComposeOptions, Cut, compose};
use plumbline::shape::morph::correspondence::{CorrespondenceMethod, CorrespondenceOptions, correspond, refine};
use plumbline::shape::morph::intersections::self_intersections;
use plumbline::shape::morph::{MorphError, Trajectory, TrajectoryOptions, time_field};
use plumbline::shape::surface::{
    Constraint, Convergence, DeformOptions, Deformer, HandlePose, Handles, Hierarchy, InitialGuess,
    Method as Deformation, ModesOptions, SurfaceError, modes,
};
use plumbline::video::motion::sfm::{
    SfmOptions, TrackTable, Windows, average_rotations, reconstruct, reconstruct_shot,
};
use plumbline::video::path::{self, InterFrame, PathError, PathOptions};

use crate::support::shots::{Shot, ShotOptions};

fn raised() -> Run {
    let run = Run::with_interrupt(&Interrupt::new());
    run.interrupt.stop();
    run
}

/// A run whose listener raises the interrupt at the `n`-th report, and what counts the reports.
fn raised_at(n: usize) -> (Run, Arc<AtomicUsize>) {
    let (interrupt, heard) = (Interrupt::new(), Arc::new(AtomicUsize::new(0)));
    let (raise, count) = (interrupt.clone(), Arc::clone(&heard));
    let listen = move |_| {
        if count.fetch_add(1, Ordering::Relaxed) + 1 == n {
            raise.stop();
        }
    };
    (Run { interrupt, progress: Progress::new(listen), budget: Budget::default() }, heard)
}

fn chain(joints: usize, length: f64) -> Skeleton {
    let joint = |j: usize| Joint {
        name: format!("j{j}"),
        parent: j.checked_sub(1).map(|p| p as u32),
        rest: Trs::from_translation(Vector3::new(0.0, 0.0, if j == 0 { 0.0 } else { length })),
        limits: None,
    };
    Skeleton::new((0..joints).map(joint).collect()).expect("a chain")
}

/// A tube along z with a chain of three joints in it, each vertex with the nearer two.
fn arm(around: usize) -> (TriMesh, Skeleton, Skin) {
    let mesh = shapes::cylinder(around, 2 * around, 0.3, 3.0);
    let skeleton = chain(4, 1.0);
    let rows = mesh.positions().iter().map(|p| {
        let at = p.z.clamp(0.0, 2.999);
        vec![(at as u32, 1.0 - 0.5 * at.fract()), (at as u32 + 1, 0.5 * at.fract() + 1e-3)]
    });
    let weights = SkinWeights::normalized(4, rows, None).expect("positive").0;
    let skin = Skin::bound(weights, &skeleton).expect("as many joints");
    (mesh, skeleton, skin)
}

fn ends(mesh: &TriMesh) -> (Handles, HandlePose) {
    let low = mesh.positions().iter().map(|p| p.z).fold(f64::INFINITY, f64::min);
    let high = mesh.positions().iter().map(|p| p.z).fold(f64::NEG_INFINITY, f64::max);
    let at =
        |z: f64| (0..mesh.vertex_count() as u32).filter(move |v| (mesh.positions()[*v as usize].z - z).abs() < 1e-9);
    let mut held: Vec<u32> = at(low).chain(at(high)).collect();
    held.sort_unstable();
    let handles = Handles::new(held.iter().map(|v| (*v, Constraint::Hard))).expect("each once");
    let moved = |v: &u32| {
        let p = mesh.positions()[*v as usize];
        if p.z > 0.5 * (low + high) { p + Vector3::new(1.0, 0.0, -0.5) } else { p }
    };
    (handles, HandlePose::new(held.iter().map(moved).collect()))
}

fn curve(mesh: &TriMesh) -> CurveSkeleton {
    extract(mesh, &ExtractionOptions::default(), &mut |_| std::ops::ControlFlow::Continue(()), &Run::default())
        .expect("a solid")
        .0
}

fn lens() -> Lens {
    let (projection, size) = (Projection::Equidistant, (640.0, 480.0));
    Lens { projection, focal: Vec2::repeat(300.0), center: Point2::new(320.0, 240.0), size }
}

/// Lines that a wide lens bends.
fn bent_lines() -> Vec<Line> {
    let lens = lens();
    let line = |k: usize| {
        let y = -0.6 + 0.2 * k as f64;
        let at = |i: i32| lens.project(&Vector3::new(0.15 * f64::from(i), y, 1.0)).expect("before the lens");
        Line { name: format!("{k}"), points: (-6..=6).map(at).collect(), orientation: Orientation::Free }
    };
    (0..7).map(line).collect()
}

/// Stripes with a hole in the middle, and what of it is shown.
fn holed(side: usize) -> (Frame, Plane<u8>) {
    let mut frame = Frame::new(PixelFormat::opaque(Layout::Gbr, 8), side, side);
    for plane in 0..3 {
        let mut out = frame.plane8_mut(plane).expect("8 bit");
        for y in 0..side {
            out.row_mut(y).iter_mut().enumerate().for_each(|(x, v)| *v = ((x / 7 + y / 11) % 5 * 50) as u8);
        }
    }
    let middle = side / 4..3 * side / 4;
    (frame, Plane::from_fn(side, side, |x, y| if middle.contains(&x) && middle.contains(&y) { 0 } else { 255 }))
}

fn pixels(frame: &Frame) -> Vec<u8> {
    let plane = frame.plane8(1).expect("8 bit");
    (0..frame.height).flat_map(|y| plane.row(y).to_vec()).collect()
}

/// `true` where `$result` is the error `$variant` of an interruption.
macro_rules! stops {
    ($result:expr, $error:ident) => {
        matches!($result, Err($error::Interrupted(Stopped::Interrupted)))
    };
    ($result:expr) => {
        matches!($result, Err(Stopped::Interrupted))
    };
}

fn assert_all(cases: &[(&str, bool)]) {
    for (name, stopped) in cases {
        assert!(stopped, "{name} does not end with its run");
    }
}

#[test]
fn systems_end_with_their_run() {
    let run = raised();
    let mut builder = SparseBuilder::new(9, 9);
    for i in 0..9 {
        builder.add_entry(i, i, 4.0);
    }
    let matrix = builder.build().expect("in range");
    let methods = [Method::Auto, Method::Cholesky, Method::SimplicialCholesky, Method::Ldlt, Method::Lu, Method::Qr];
    for method in methods {
        assert!(stops!(matrix.factor(method, &Elimination::Amd, &run), SparseError), "{method:?}");
    }
    let soft = (0..3).map(|i| (i, i, 1.0));
    let laplacian = ConstrainedLaplacian::new(3, soft, |_| false).expect("in range");
    let mut program = QuadraticProgram::new(2);
    program.add_square(1.0, Affine::var(0) - Affine::var(1));
    program.require_at_most_zero(Affine::var(0) - Affine::constant(1.0));
    assert_all(&[
        ("normal equations", stops!(matrix.factor_ata(None, &Elimination::Amd, &run), SparseError)),
        ("a Laplacian", stops!(laplacian.factor(&Elimination::Amd, &run), SparseError)),
        ("a quadratic program", stops!(program.solve(&run), QpError)),
    ]);
}

#[test]
fn surfaces_and_characters_end_with_their_run() {
    let run = raised();
    let (mesh, skeleton, skin) = arm(16);
    let (handles, pose) = ends(&mesh);
    let model = Model::of_mesh(mesh.clone());
    let (options, convergence) = (DeformOptions::default(), Convergence::default());
    for method in Deformation::ALL {
        assert!(
            stops!(Deformer::new(method, &mesh, &handles, &options, &run), SurfaceError),
            "binding {}",
            method.name()
        );
        let mut deformer =
            Deformer::new(method, &mesh, &handles, &options, &Run::default()).expect("held at both ends");
        for start in [InitialGuess::Auto, InitialGuess::Coarse, InitialGuess::Spread, InitialGuess::Rest] {
            let stopped = stops!(deformer.deform(&pose, start, &convergence, &run), SurfaceError);
            assert!(stopped, "{} from {start:?}", method.name());
        }
    }
    let matrices = vec![nalgebra::Matrix4::identity(); skeleton.joint_count()];
    let examples = [Example { positions: mesh.positions().to_vec(), matrices }];
    let (weights, learning) = (skin.weights(), RegressionOptions::default());
    let bones = |method| {
        let options = WeightOptions { method, ..WeightOptions::default() };
        stops!(bone_weights(&mesh, &skeleton, &options, &run), CharacterError)
    };
    let observer =
        &mut |_: &plumbline::shape::character::extraction::ContractionStep<'_>| std::ops::ControlFlow::Continue(());
    let curve = curve(&mesh);
    let target = ik::Target::position(3, Point3::new(1.0, 0.0, 2.0));
    let start = Pose { locals: skeleton.joints().iter().map(|j| j.rest).collect() };
    assert_all(&[
        ("modes", stops!(modes(&mesh, 3, &ModesOptions::default(), &run), SurfaceError)),
        ("the hierarchy", stops!(Hierarchy::new(&mesh, &[], 20, &run))),
        ("skeleton extraction", stops!(extract(&mesh, &ExtractionOptions::default(), observer, &run), CharacterError)),
        ("bone heat", bones(WeightMethod::Heat)),
        ("biharmonic weights", bones(WeightMethod::BoundedBiharmonic)),
        ("biharmonic weights", bones(WeightMethod::BoundedBiharmonic)),
        ("weights by distance", bones(WeightMethod::Distance)),
        ("smoothing of weights", stops!(weights.smoothed(&mesh, 2, &run), CharacterError)),
        (
            "regression",
            stops!(RegressionModel::train(&mesh, &skeleton, weights, &examples, &learning, &run), CharacterError),
        ),
        ("centers of rotation", stops!(centers_of_rotation(&mesh, weights, &run))),
        (
            "skinning by centers of rotation",
            stops!(
                Skinner::new(&mesh, None, &skeleton, &skin, SkinningMethod::CentersOfRotation, &run),
                CharacterError
            ),
        ),
        ("refinement", stops!(DetailRefiner::new(&mesh, weights, 1.0, &run), CharacterError)),
        ("template fitting", stops!(fit_template(&skeleton, &curve, &run), CharacterError)),
        (
            "inverse kinematics",
            stops!(ik::solve(&skeleton, &start, &[target], &IkOptions::default(), &run), CharacterError),
        ),
        ("repair", stops!(repair(&mesh, &RepairOptions::default(), &run))),
        ("drawing", {
            let camera =
                SurfaceCamera::fit(mesh.positions(), ViewDirection::degrees(30.0, 20.0), UpAxis::default(), (64, 64));
            stops!(draw(&Surface::new(&mesh), &camera, &Style::default(), &run))
        }),
    ]);
    let formats =
        [MeshFormat::Obj, MeshFormat::Ply, MeshFormat::Off, MeshFormat::Stl, MeshFormat::Gltf, MeshFormat::Glb];
    for format in formats {
        let options = WriteOptions::default();
        assert!(stops!(encode_model(&model, format, &options, &run), MeshError), "writing {format}");
        let bytes = encode_model(&model, format, &options, &Run::default()).expect("a mesh");
        let read = plumbline::shape::mesh::io::decode_model(&bytes, format, None, &ReadLimits::default(), &run);
        assert!(stops!(read, MeshError), "reading {format}");
    }
}

#[test]
fn morphs_end_with_their_run() {
    let run = raised();
    let (first, second) = (shapes::icosphere(3), shapes::icosphere(2));
    let landmarks = [(0, 0), (1, 1), (2, 2), (3, 3)];
    let laid = |method| stops!(correspond(&first, &second, &landmarks, &method, &run), MorphError);
    let sheet = shapes::plane(8);
    let options = TrajectoryOptions::default();
    let moved = sheet.positions().iter().map(|p| p + Vector3::new(p.y, -p.x, p.x * p.x)).collect();
    let other = sheet.with_positions(moved).expect("finite");
    let mut trajectory = Trajectory::new(&sheet, &other, &options, &Run::default()).expect("two poses of one");
    let painted: Vec<Option<f64>> = (0..sheet.vertex_count()).map(|v| (v == 0).then_some(1.0)).collect();
    let plane = |z| Cut::Plane { point: Point3::new(0.0, 0.0, z), normal: Vector3::z() };
    let joining = ComposeOptions { base: plane(0.1), part: plane(-0.1), landmarks: Vec::new(), band: 2 };
    assert_all(&[
        ("registration", laid(CorrespondenceMethod::Registration.into())),
        ("the sphere", laid(CorrespondenceMethod::Sphere.into())),
        ("the disk", stops!(correspond(&sheet, &sheet, &[], &CorrespondenceMethod::Disk.into(), &run), MorphError)),
        ("refinement", stops!(refine(&first, &first, &second, 1e-3, 2, &run), MorphError)),
        ("a trajectory", stops!(Trajectory::new(&sheet, &other, &options, &run), MorphError)),
        ("a shape", stops!(trajectory.at(0.5, &run))),
        ("an untangled shape", stops!(trajectory.untangled(0.5, 3, &run))),
        ("self-intersections", stops!(self_intersections(&first, &run))),
        ("a time field", stops!(time_field(&sheet, &painted, 0.0, &run), MorphError)),
        ("a composition", stops!(compose(&first, &first, &joining, &run), MorphError)),
    ]);
}

#[derive(Debug, PartialEq)]
struct Ended(Stopped);

impl From<Stopped> for Ended {
    fn from(stopped: Stopped) -> Self {
        Self(stopped)
    }
}

#[test]
fn motion_and_paths_end_with_their_run() {
    let run = raised();
    let shot = Shot::new(&ShotOptions { frames: 12, ..ShotOptions::default() });
    let read = |_: std::ops::Range<usize>| Ok::<TrackTable, Ended>(shot.table());
    let windows = reconstruct_shot(0..12, read, &SfmOptions::default(), &Windows::default(), &run);
    let step = plumbline::num::math::Similarity2::IDENTITY;
    let jerk = |t: usize| plumbline::num::math::Similarity2 {
        t: Vec2::new(if t.is_multiple_of(2) { 9.0 } else { -9.0 }, 0.0),
        ..step
    };
    let motion: Vec<InterFrame> = (0..60)
        .map(|t| InterFrame { similarity: jerk(t), homography: jerk(t).to_homography(), reliable: true })
        .collect();
    let times_s: Vec<f64> = (0..60).map(|t| f64::from(t) / 30.0).collect();
    let shot_of_all = std::slice::from_ref(&(0..60));
    let clip =
        path::Clip { width: 640, height: 360, times_s: &times_s, motion: &motion, shots: shot_of_all, beyond: &[] };
    assert!(matches!(windows, Err(Ended(Stopped::Interrupted))));
    assert_all(&[
        ("structure from motion", stops!(reconstruct(&shot.table(), &SfmOptions::default(), &run))),
        ("a path", stops!(path::plan(&clip, &PathOptions::default(), &run), PathError)),
        ("what neighbors show", stops!(path::shown_beyond(&clip, &[], &path::BeyondOptions::default(), &run))),
    ]);
    assert!(average_rotations(0, &[], &run).is_ok(), "nothing to average takes no time");
}

#[test]
fn photos_end_with_their_run() {
    let run = raised();
    let (lens, lines) = (lens(), bent_lines());
    let input = RectifyInput { lens: &lens, lines: &lines, soft_lines: &[], found: false, faces: &[], saliency: None };
    let luma = Plane::from_fn(640, 480, |x, y| ((x / 40 + y / 40) % 2 * 200) as f32);
    let (frame, shown) = holed(96);
    let mut filled = holed(96).0;
    let importance = Importance::even();
    let mut round = Frame::new(PixelFormat::opaque(Layout::Gray, 8), 200, 200);
    for y in 0..200 {
        let inside = |x: usize| (x as f64 - 100.0).hypot(y as f64 - 100.0) < 95.0 + 4.0 * (0.1 * x as f64).sin();
        let mut plane = round.plane8_mut(0).expect("8 bit");
        plane.row_mut(y).iter_mut().enumerate().for_each(|(x, v)| *v = if inside(x) { 90 + (x % 60) as u8 } else { 0 });
    }
    let outline = Outline::of_frame(&round).expect("a border");
    let whole = RectangleInput {
        size: (200, 200),
        outline: &outline,
        luma: round.plane8(0).expect("8 bit"),
        lines: &[],
        faces: &[],
    };
    assert_all(&[
        ("rectification", stops!(rectify(&input, &RectifyOptions::default(), &run), PhotoError)),
        ("line detection", stops!(detect_lines(luma.as_ref(), Some(&lens), &LineDetectionOptions::default(), &run))),
        ("calibration", stops!(calibrate(&lines, lens.size, &CalibrationOptions::default(), &run), PhotoError)),
        ("a rectangle", stops!(rectangle(&whole, &RectangleOptions::default(), &run), PhotoError)),
        (
            "retargeting",
            stops!(
                retarget((640, 480), (400, 480), &importance, &[], &[], &RetargetOptions::default(), &run),
                PhotoError
            ),
        ),
        ("completion", stops!(complete(&mut filled, &shown, &run), RenderError)),
        (
            "importance",
            stops!(Importance::of_frame(&frame, &[], None, &ImportanceOptions::default(), &run), FeatureError),
        ),
        ("faces", stops!(FaceDetector::new(FaceOptions::default()).detect(&frame, &run))),
    ]);
    assert_eq!(pixels(&filled), pixels(&frame), "an interrupted completion changes nothing");
}

/// Calls `work` with a run that is interrupted at its third report: it must end with the interruption, after two further reports
/// at most.
fn stops_midway(name: &str, work: impl FnOnce(&Run) -> bool) {
    let (run, heard) = raised_at(3);
    assert!(work(&run), "{name} does not end with its run");
    let heard = heard.load(Ordering::Relaxed);
    assert!((3..=5).contains(&heard), "{name} reported {heard} times");
}

#[test]
fn long_calls_end_midway_and_soon() {
    let (mesh, _, _) = arm(48);
    let (handles, pose) = ends(&mesh);
    let convergence = Convergence { max_iterations: 1000, tolerance: 0.0 };
    let mut deformer =
        Deformer::new(Deformation::Arap, &mesh, &handles, &DeformOptions::default(), &Run::default()).expect("held");
    let few = Convergence { max_iterations: 5, ..convergence };
    let before = deformer.deform(&pose, InitialGuess::Spread, &few, &Run::default()).expect("held").positions;
    stops_midway("deforming", |run| {
        stops!(deformer.deform(&pose, InitialGuess::Spread, &convergence, run), SurfaceError)
    });
    let after = deformer.deform(&pose, InitialGuess::Spread, &few, &Run::default()).expect("held").positions;
    assert_eq!(before, after, "the deformer may be used again as if nothing had been");
    stops_midway("skeleton extraction", |run| {
        let observer =
            &mut |_: &plumbline::shape::character::extraction::ContractionStep<'_>| std::ops::ControlFlow::Continue(());
        stops!(extract(&mesh, &ExtractionOptions::default(), observer, run), CharacterError)
    });
    stops_midway("a correspondence", |run| {
        let (first, second) = (shapes::icosphere(4), shapes::icosphere(3));
        let method = CorrespondenceOptions::from(CorrespondenceMethod::Registration);
        stops!(correspond(&first, &second, &[(0, 0), (1, 1), (2, 2), (3, 3)], &method, run), MorphError)
    });
    stops_midway("structure from motion", |run| {
        let shot = Shot::new(&ShotOptions { frames: 40, noise_px: 0.2, ..ShotOptions::default() });
        stops!(reconstruct(&shot.table(), &SfmOptions::default(), run))
    });
    stops_midway("completion", |run| {
        let (mut frame, shown) = holed(200);
        let before = pixels(&frame);
        stops!(complete(&mut frame, &shown, run), RenderError) && pixels(&frame) == before
    });
}

#[test]
fn an_interrupted_rectifier_keeps_its_last_solve() {
    let (lens, lines) = (lens(), bent_lines());
    let input = RectifyInput { lens: &lens, lines: &lines, soft_lines: &[], found: false, faces: &[], saliency: None };
    let mut view = Rectifier::new(&input, &RectifyOptions::default(), &Run::default()).expect("a view");
    let before = view.sheet().clone();
    stops_midway("rectification", |run| stops!(view.solve(&lines[..3], run), PhotoError));
    assert_eq!(*view.sheet(), before);
}

#[test]
fn a_call_from_another_thread_ends_when_the_interrupt_is_raised_here() {
    let interrupt = Interrupt::new();
    let run = Run::with_interrupt(&interrupt);
    let (begun, started) = std::sync::mpsc::channel();
    let work = std::thread::spawn(move || {
        let mesh = shapes::icosphere(3);
        begun.send(()).expect("the test waits for it");
        // Until it is stopped.
        loop {
            if let Err(stopped) = self_intersections(&mesh, &run) {
                return stopped;
            }
        }
    });
    started.recv().expect("the thread begins");
    interrupt.stop();
    assert_eq!(work.join().expect("no panic"), Stopped::Interrupted);
}

#[test]
fn a_call_whose_time_is_used_up_says_so() {
    let run = Run { budget: Budget::time(Duration::ZERO), ..Run::default() };
    let found = self_intersections(&shapes::icosphere(1), &run);
    assert_eq!(found, Err(Stopped::OutOfTime));
}
