//! What the fuzz targets do with any bytes. The integration tests run the same on mutated examples, for toolchains without a
//! fuzzer.

use std::io::Cursor;
use std::path::Path;

use plumbline::app::pipeline::tasks::{PathMap, PathRule, TaskFormat, TaskPlan, export};
use plumbline::app::pipeline::{Source, print, read};
use plumbline::camera::{ExifFacts, LensFile, parse_lens};
use plumbline::image::feature::Mask;
use plumbline::image::still::{ExifTags, LoadOptions, SaveOptions, StillFormat, decode, encode};
use plumbline::media::{
    Input, Output, ReadOptions, SpoolOptions, VideoReader, VideoWriter, WriteOptions as ClipOptions, probe,
};
use plumbline::num::math::Point2;
use plumbline::num::run::Run;
use plumbline::num::sparse::{Method, Ordering, read_matrix_market, write_matrix_market};
use plumbline::photo::marks::{FacesFile, LinesFile};
use plumbline::photo::temporal::ClipImportance;
use plumbline::shape::character::io::{
    Rig, bvh_text, character_of, parse_anim, parse_bvh, parse_skel, parse_tgf, tgf_text,
};
use plumbline::shape::character::pose_file::TargetPose;
use plumbline::shape::character::regression::SkinModel;
use plumbline::shape::character::skeleton_file::SkeletonFile;
use plumbline::shape::character::{Character, Extrapolation, Skin, SkinWeights, WeightsFile};
use plumbline::shape::mesh::io::{MeshFormat, ReadLimits, WriteOptions, decode_model, encode_model};
use plumbline::shape::mesh::{HalfEdges, RepairOptions, Weld, repair, shapes};
use plumbline::shape::morph::composition::SeamFile;
use plumbline::shape::morph::correspondence::Landmarks;
use plumbline::shape::morph::paint::Paint;
use plumbline::shape::surface::handle_file::HandleFile;
use plumbline::video::motion::exchange::colmap;
use plumbline::video::motion::{ClipCameras, ClipMotion};
use plumbline::video::stabilize::PathFile;
use plumbline::video::track::{AnalysisWindows, TrackJoiner, WindowTracks};

/// A motion file of any bytes is refused or read, never a panic; what was read can be written and read again.
pub fn motion_file(bytes: &[u8]) {
    if let Ok(clip) = ClipMotion::from_json(bytes) {
        let mut text = Vec::new();
        if clip.write_json(&mut text).is_ok() {
            ClipMotion::from_json(&text[..]).expect("own files are read");
        }
    }
}

/// A window file of any bytes is refused or read, never a panic; what was read is written as it was, and joins or is refused.
pub fn window_file(bytes: &[u8]) {
    let Ok(window) = WindowTracks::read(bytes) else { return };
    let mut again = Vec::new();
    window.write(&mut again).expect("memory");
    let mut twice = Vec::new();
    WindowTracks::read(&again[..]).expect("own files are read").write(&mut twice).expect("memory");
    assert!(again == twice);
    // As the first window and the next, of two frames each with a warm-up of one.
    let mut joiner = TrackJoiner::new(AnalysisWindows::new(2, 1).expect("in range"), window.size, window.size.0);
    for (index, frame) in window.frames.into_iter().enumerate() {
        if joiner.push(usize::from(index >= 2), frame).is_err() {
            return;
        }
    }
    joiner.finish().for_each(drop);
}

/// A file of cameras, or of the importance of a clip, of any bytes is refused or read, never a panic; what was read is written as it was.
pub fn kept_file(bytes: &[u8]) {
    if let Ok(cameras) = ClipCameras::from_json(&String::from_utf8_lossy(bytes)) {
        let text = cameras.to_json().expect("what was read is finite");
        assert_eq!(ClipCameras::from_json(&text).expect("own files are read"), cameras);
        let _ = (0..=cameras.frames.len()).filter(|frame| cameras.is_rotation_only(*frame)).count();
    }
    if let Some(importance) = ClipImportance::from_bytes(bytes) {
        assert_eq!(importance.to_bytes(), bytes);
    }
}

/// A clip of any bytes is refused or read, never a panic or a hang. What is read is encoded with everything else of it copied,
/// and a file that was finished can be read.
pub fn clip_file(bytes: &[u8]) {
    let Ok(input) = Input::spool(bytes, &SpoolOptions::default()) else { return };
    let known = probe(&input);
    let options = ReadOptions { threads: 1, ..ReadOptions::default() };
    let Ok(mut reader) = VideoReader::open(&input, &options) else { return };
    assert!(known.is_ok_and(|known| known.video.is_some()), "what can be opened can be probed");
    if reader.info().width * reader.info().height > 1 << 20 {
        return;
    }
    let folder = tempfile::tempdir().expect("a temporary folder");
    for name in ["out.mkv", "out.mp4"] {
        let path = folder.path().join(name);
        let options = ClipOptions { preset: Some("ultrafast".to_owned()), threads: 1, ..ClipOptions::default() };
        let Ok(mut writer) = VideoWriter::create(&Output::parse(&path), &input, reader.info(), &options) else {
            continue;
        };
        let mut whole = true;
        while let (true, Ok(Some(frame))) = (whole, reader.next_frame()) {
            whole = writer.write(frame).is_ok();
        }
        if whole && writer.finish().is_ok_and(|report| report.frames > 0) {
            let result = Input::parse(&path).expect("a file");
            VideoReader::open(&result, &ReadOptions::default()).expect("own files are read");
        }
        let Ok(again) = VideoReader::open(&input, &ReadOptions { threads: 1, ..ReadOptions::default() }) else {
            return;
        };
        reader = again;
    }
}

/// Any bytes as a pipeline file: checked without a panic, every fault renderable, and what is accepted prints to itself.
pub fn pipeline_file(bytes: &[u8]) {
    let source = |text: String| Source { name: "fuzz.toml".into(), text, base: None };
    match read(source(String::from_utf8_lossy(bytes).into_owned()), &[]) {
        Err(problems) => {
            assert!(!problems.problems.is_empty());
            let _ = (problems.render(false, 80), problems.to_json());
        }
        Ok(pipeline) => {
            let again = read(source(print(&pipeline.file)), &[]).expect("what is printed is accepted");
            assert_eq!(again, pipeline);
        }
    }
}

/// A plan of any bytes is refused or read, never a panic; its tasks have instances or are refused, and what is read can be exported and
/// reads back as the same.
pub fn plan_file(bytes: &[u8]) {
    let Ok(plan) = TaskPlan::parse(&String::from_utf8_lossy(bytes)) else { return };
    let map = PathMap::new(vec![PathRule::parse("/=/elsewhere").expect("a rule")]).expect("a map");
    for task in &plan.tasks {
        let _ = task.clone().map_paths(&map);
        if let Ok(instance) = task.instance() {
            let _ = (instance.inputs(), instance.outputs(), task.output_outside(&[]));
        }
    }
    for format in [TaskFormat::Make, TaskFormat::Slurm, TaskFormat::Hq, TaskFormat::Dot] {
        assert!(!export(&plan, Path::new("plan.json"), Path::new("."), &map, format).is_empty());
    }
    assert_eq!(TaskPlan::parse(&plan.to_text().expect("plain data")), Ok(plan));
}

/// A lens file of any bytes is refused or read, never a panic; the lens that was read can be used, written and read again.
pub fn lens_file(bytes: &[u8]) {
    let text = String::from_utf8_lossy(bytes);
    let zoom = ExifFacts {
        size: Some((640.0, 480.0)),
        model: Some("Canon EOS 7D".to_owned()),
        lens: Some("EF-S10-22mm f/3.5-4.5 USM".to_owned()),
        focal_mm: Some(16.0),
        ..ExifFacts::default()
    };
    for picture in [ExifFacts::default(), zoom] {
        let Ok(profile) = parse_lens(&text, &picture) else { continue };
        for p in [Point2::new(0.0, 0.0), Point2::new(320.0, 470.0)] {
            let seen = profile.lens.unproject(p).and_then(|ray| profile.lens.project(&ray));
            assert!(seen.is_none_or(|q| q.x.is_finite() && q.y.is_finite()));
        }
        let own = serde_json::to_string(&LensFile::of(&profile.lens, "")).expect("plain data");
        parse_lens(&own, &picture).expect("own files are read");
    }
}

/// Any bytes as a picture, and as an EXIF block: read or refused without a panic; what was read can be written and read again.
pub fn still_file(bytes: &[u8]) {
    let _ = ExifTags::of(bytes);
    let options = LoadOptions { max_pixels: 1 << 18 };
    if let Ok(photo) = decode(Cursor::new(bytes), options) {
        let mut file = Cursor::new(Vec::new());
        encode(&photo, StillFormat::Tiff, SaveOptions::default(), &mut file).expect("any picture fits into TIFF");
        let again = decode(Cursor::new(file.into_inner()), options).expect("own files are read");
        assert_eq!((again.frame.width, again.frame.height), (photo.frame.width, photo.frame.height));
        if photo.frame.width.max(photo.frame.height) <= 65_500 {
            let mut file = Cursor::new(Vec::new());
            let saved =
                encode(&photo, StillFormat::Jpeg, SaveOptions::default(), &mut file).expect("it has few pixels");
            let again = decode(Cursor::new(file.into_inner()), options).expect("own files are read");
            let whole =
                again.gain_map.is_some() == photo.gain_map.is_some() && again.xmp.is_some() >= photo.xmp.is_some();
            assert!(whole || !saved.warnings.is_empty(), "what is lost is said");
        }
    }
}

/// Small files; vertices of every second one are mended.
fn limits(bytes: &[u8]) -> ReadLimits {
    let mend_vertices = bytes.len().is_multiple_of(2);
    ReadLimits { max_bytes: 1 << 20, max_elements: 1 << 12, mend_vertices, ..ReadLimits::default() }
}

/// Any bytes as a mesh file: read or refused without a panic. What was read can be repaired, and written in every format that
/// can hold it and read again.
fn mesh_file(bytes: &[u8], format: MeshFormat) {
    let Ok(model) = decode_model(bytes, format, None, &limits(bytes), &Run::default()) else { return };
    for weld in [Weld::Exact, Weld::Within(1e-3)] {
        let options = RepairOptions { weld, ..RepairOptions::default() };
        let repaired = repair(model.mesh(), &options, &Run::default()).expect("a run that never stops");
        HalfEdges::new(&repaired.mesh).expect("repair makes oriented manifolds");
        write_and_read(&model.repaired(&repaired));
    }
    write_and_read(&model);
    let moved = model.mesh().positions().iter().map(|p| p * 0.5).collect();
    write_and_read(&model.with_positions(moved).expect("half of a number is one"));
}

fn write_and_read(model: &plumbline::shape::mesh::Model) {
    use MeshFormat::{Glb, Gltf, Obj, Off, Ply, Stl};
    for (format, ascii) in
        [(Obj, true), (Ply, true), (Ply, false), (Off, true), (Stl, true), (Stl, false), (Gltf, true), (Glb, false)]
    {
        let Ok(file) = encode_model(model, format, &WriteOptions { ascii }, &Run::default()) else { continue };
        let again = decode_model(&file, format, None, &ReadLimits::default(), &Run::default());
        // OBJ without a vertex is taken for something else.
        if format == Obj && model.mesh().vertex_count() == 0 {
            continue;
        }
        let again = again.unwrap_or_else(|e| panic!("own files are read: {e}\n{}", String::from_utf8_lossy(&file)));
        assert_eq!(again.mesh().triangle_count(), model.mesh().triangle_count(), "{format}");
    }
}

/// [`mesh_file`] as OBJ.
pub fn obj_file(bytes: &[u8]) {
    mesh_file(bytes, MeshFormat::Obj);
}

/// [`mesh_file`] as PLY.
pub fn ply_file(bytes: &[u8]) {
    mesh_file(bytes, MeshFormat::Ply);
}

/// [`mesh_file`] as OFF.
pub fn off_file(bytes: &[u8]) {
    mesh_file(bytes, MeshFormat::Off);
}

/// [`mesh_file`] as STL.
pub fn stl_file(bytes: &[u8]) {
    mesh_file(bytes, MeshFormat::Stl);
}

/// [`mesh_file`] as glTF, in JSON or binary as the bytes begin; as a character too, which is posed and written.
pub fn gltf_file(bytes: &[u8]) {
    let format = if bytes.starts_with(b"glTF") { MeshFormat::Glb } else { MeshFormat::Gltf };
    mesh_file(bytes, format);
    character_file(bytes, format);
}

/// Any bytes as a character of a mesh format: refused or read without a panic; what was read can be posed and written.
fn character_file(bytes: &[u8], format: MeshFormat) {
    let Ok(model) = decode_model(bytes, format, None, &limits(bytes), &Run::default()) else { return };
    let Ok(character) = character_of(&model) else { return };
    for clip in &character.clips {
        for time in [-1.0, 0.0, 0.3, 1e9] {
            clip.pose(&character.skeleton, time, Extrapolation::Repeat).expect("a clip of its own skeleton");
        }
    }
    write_and_read(&character.to_model(None).expect("a character is a model"));
}

/// [`mesh_file`] as FBX; as a character too, which is posed and written.
pub fn fbx_file(bytes: &[u8]) {
    mesh_file(bytes, MeshFormat::Fbx);
    character_file(bytes, MeshFormat::Fbx);
}

/// Any bytes as a skeleton or a movement of any text format: read or refused without a panic; what was read can be written and
/// read again.
pub fn rig_file(bytes: &[u8]) {
    let text = String::from_utf8_lossy(bytes);
    let one = parse_skel("2\n0 0 0 a root\n1 0 0 b a\n").expect("a skeleton");
    let _ = parse_anim(&text, "x", &one);
    let alone = |skeleton| Rig { skeleton, clips: Vec::new(), warnings: Vec::new() };
    for rig in [parse_bvh(&text), parse_tgf(&text), parse_skel(&text).map(alone)].into_iter().flatten() {
        parse_tgf(&tgf_text(&rig.skeleton)).expect("own files are read");
        if let Ok((text, _)) = bvh_text(&rig.skeleton, rig.clips.first()) {
            parse_bvh(&text).expect("own files are read");
        }
    }
}

/// Any bytes as a trained skin: refused or read without a panic; what was read is written, read back as the same, and puts a mesh of
/// its own into a pose.
pub fn skin_model(bytes: &[u8]) {
    let Ok(model) = SkinModel::from_bytes(bytes) else { return };
    assert!(SkinModel::from_bytes(&model.to_bytes()).is_ok_and(|again| again == model), "own files are read back");
    let one = parse_skel("2\n0 0 0 a root\n1 0 0 b a\n").expect("a skeleton");
    if let Ok(mut bound) = model.bound(&shapes::plane(2), &one, &Run::default()) {
        let still = bound.positions(&one.rest_globals()).expect("of two joints");
        assert_eq!(still.len(), shapes::plane(2).vertex_count());
    }
}

/// [`mesh_file`] as Medit.
pub fn medit_file(bytes: &[u8]) {
    mesh_file(bytes, MeshFormat::Medit);
}

/// Any bytes as a Matrix Market file: read or refused without a panic, no larger than the file. What was read can be written and
/// read again, and every method solves it or says why not.
pub fn matrix_file(bytes: &[u8]) {
    let text = String::from_utf8_lossy(bytes);
    let Ok(a) = read_matrix_market(&text) else { return };
    assert!(a.nnz() <= 2 * text.lines().count() && a.entries().all(|(_, _, v)| v.is_finite()));
    if a.rows().max(a.columns()) > 32 || a.columns() == 0 {
        return;
    }
    let mut columns = vec![0.0; a.rows() * a.columns()];
    a.entries().for_each(|(i, j, v)| columns[j * a.rows() + i] = v);
    let again = read_matrix_market(&write_matrix_market(a.rows(), &columns)).expect("own files are read");
    let without_zeros = || a.entries().filter(|(_, _, v)| *v != 0.0);
    assert!(a.rows() == 0 || again.entries().eq(without_zeros()));
    let methods = [Method::Cholesky, Method::SimplicialCholesky, Method::Ldlt, Method::Lu, Method::Qr, Method::Auto];
    for method in methods {
        if let Ok(mut factor) = a.factor(method, &Ordering::Amd, &Run::default()) {
            let b = vec![1.0; a.rows()];
            assert_eq!(factor.solve(&b).expect("one column").len(), if a.rows() == 0 { 0 } else { a.columns() });
        }
    }
}

/// A file of handles of any bytes, for a small mesh: refused or understood, never a panic. What is understood names vertices
/// of the mesh, each once, and has a place for each at any time.
pub fn handle_file(bytes: &[u8]) {
    let Ok(file) = HandleFile::parse(&String::from_utf8_lossy(bytes)) else { return };
    let mesh = shapes::plane(3);
    let Ok(understood) = file.of_mesh(mesh.positions()) else { return };
    let (first, last) = understood.times();
    let mut named = vec![false; mesh.vertex_count()];
    for handle in &understood.handles {
        for &v in &handle.vertices {
            assert!(!std::mem::replace(&mut named[v as usize], true), "vertex {v} is held twice");
        }
        for time in [first, 0.3 * first + 0.7 * last, last, -1e300, 1e300] {
            let places = handle.track.positions(&handle.vertices, mesh.positions(), time);
            assert_eq!(places.len(), handle.vertices.len());
            let _ = handle.track.rotation(time);
        }
    }
    assert!(understood.outside.iter().all(|&v| !named[v as usize]));
}

/// Size of the pictures of the bodies of marks, px.
const SIZE: (u32, u32) = (640, 480);

/// Marked lines of any bytes: refused or read without a panic. What was read is finite, and is written and read again.
pub fn lines_file(bytes: &[u8]) {
    let Ok(file) = LinesFile::parse(&String::from_utf8_lossy(bytes), SIZE) else { return };
    assert!(file.lines.iter().flat_map(|m| &m.line.points).all(|p| p.x.is_finite() && p.y.is_finite()));
    let again = LinesFile::parse(&file.to_json(), SIZE).expect("own files are read");
    assert_eq!(again.lines.len(), file.lines.len());
}

/// Marked faces of any bytes: as [`lines_file`].
pub fn faces_file(bytes: &[u8]) {
    let Ok(file) = FacesFile::parse(&String::from_utf8_lossy(bytes), SIZE) else { return };
    let again = FacesFile::parse(&file.to_json(), SIZE).expect("own files are read");
    assert_eq!(again.faces.len(), file.faces.len());
}

/// A path file of any bytes: refused or read without a panic; its poses at the frames of a clip are finite.
pub fn path_file(bytes: &[u8]) {
    let Ok(file) = PathFile::parse(bytes) else { return };
    for frames in [0, 1, 2, 3, 7] {
        let times_s: Vec<f64> = (0..frames).map(|k| f64::from(k) / 30.0).collect();
        let Ok((wanted, input)) = file.at_frames(&times_s) else { continue };
        for pose in wanted.iter().chain(input) {
            let numbers = pose.rotation.coords.iter().chain(&pose.translation).all(|v| v.is_finite());
            assert!(numbers, "{pose:?}");
        }
    }
}

/// A character of two joints on a small plane, with a morph target and a clip.
fn small_character() -> Character {
    let rig = parse_bvh(
        "HIERARCHY\nROOT a\n{\nOFFSET 0 0 0\nCHANNELS 3 Zrotation Xrotation Yrotation\nJOINT b\n{\nOFFSET 1 0 0\nCHANNELS 3 \
         Zrotation Xrotation Yrotation\n}\n}\nMOTION\nFrames: 2\nFrame Time: 0.5\n0 0 0 0 0 0\n0 0 0 90 0 0\n",
    )
    .expect("a skeleton");
    let mesh = shapes::plane(2);
    let halves: Vec<u32> = mesh.positions().iter().map(|p| u32::from(p.x > 0.5)).collect();
    let weights = SkinWeights::rigid(2, &halves).expect("two joints");
    let skin = Skin::bound(weights, &rig.skeleton).expect("of this skeleton");
    let model = plumbline::shape::mesh::Model::of_mesh(mesh);
    let mut character = Character::new(model, rig.skeleton, skin.into()).expect("of this mesh");
    character.clips = rig.clips;
    character
}

/// A pose file of any bytes for a small character: refused or read without a panic; its targets are solved or refused.
pub fn pose_file(bytes: &[u8]) {
    use plumbline::shape::character::ik::IkMethod;
    let character = small_character();
    let Ok(pose) = TargetPose::parse(&String::from_utf8_lossy(bytes), &character) else { return };
    let Ok(found) = pose.solve(&character, IkMethod::default(), 5, &Run::default()) else { return };
    let globals = character.skeleton.globals(&found.pose).expect("a pose of this skeleton");
    assert!(globals.iter().flatten().all(|x| x.is_finite()));
}

/// A skeleton of any bytes as our own JSON: refused or read without a panic, and restored from its own text.
pub fn skeleton_file(bytes: &[u8]) {
    let Ok(file) = SkeletonFile::parse(&String::from_utf8_lossy(bytes)) else { return };
    assert_eq!(SkeletonFile::parse(&file.to_json()).expect("own files are read"), file);
}

/// Skinning weights of any bytes: refused or read without a panic, and restored from their own text.
pub fn weights_file(bytes: &[u8]) {
    let Ok(file) = WeightsFile::parse(&String::from_utf8_lossy(bytes)) else { return };
    assert_eq!(WeightsFile::parse(&file.to_json()).expect("own files are read"), file);
    let one = parse_skel("2\n0 0 0 a root\n1 0 0 b a\n").expect("a skeleton");
    if let Ok(weights) = file.for_skeleton(&one) {
        assert_eq!(weights.joint_count(), 2);
    }
}

/// Landmarks of any bytes for two small meshes: refused or understood; each names a vertex once.
pub fn landmarks_file(bytes: &[u8]) {
    let Ok(landmarks) = Landmarks::parse(&String::from_utf8_lossy(bytes)) else { return };
    let (first, second) = (shapes::plane(2), shapes::icosphere(1));
    let Ok(pairs) = landmarks.vertices(&first, &second) else { return };
    for (a, b) in pairs {
        assert!((a as usize) < first.vertex_count() && (b as usize) < second.vertex_count());
    }
}

/// Painted times of any bytes for a small mesh: refused or understood; times are 0 to 1.
pub fn paint_file(bytes: &[u8]) {
    let Ok(paint) = Paint::parse(&String::from_utf8_lossy(bytes)) else { return };
    let mesh = shapes::plane(2);
    let Ok(times) = paint.of_mesh(&mesh) else { return };
    assert_eq!(times.len(), mesh.vertex_count());
    assert!(times.iter().flatten().all(|t| (0.0..=1.0).contains(t)));
}

/// A file of seams of any bytes for two small meshes: refused or understood without a panic.
pub fn seam_file(bytes: &[u8]) {
    let Ok(file) = SeamFile::parse(&String::from_utf8_lossy(bytes)) else { return };
    let Ok(options) = file.of_meshes(&shapes::plane(2), &shapes::icosphere(1)) else { return };
    assert!((1..=1000).contains(&options.band));
}

/// What separates the three files of a COLMAP model in one input.
pub const SEPARATOR: &[u8] = b"~~~~";

fn colmap_model(bytes: &[u8], read: fn([&[u8]; 3]) -> Result<colmap::Model, colmap::ColmapError>, extension: &str) {
    let at = |bytes: &[u8]| bytes.windows(SEPARATOR.len()).position(|w| w == SEPARATOR);
    let split = |bytes: &'_ [u8]| at(bytes).map_or((bytes.len(), bytes.len()), |k| (k, k + SEPARATOR.len()));
    let (end, next) = split(bytes);
    let (cameras, rest) = (&bytes[..end], &bytes[next..]);
    let (end, next) = split(rest);
    let Ok(model) = read([cameras, &rest[..end], &rest[next..]]) else { return };
    let written: Vec<Vec<u8>> = colmap::FILES
        .iter()
        .filter(|(name, _)| name.ends_with(extension))
        .map(|(_, write)| {
            let mut out = Vec::new();
            write(&model, &mut out).expect("memory");
            out
        })
        .collect();
    // A name of an image with a line break is no name in the text form.
    let names = model
        .images
        .iter()
        .all(|i| i.name.trim() == i.name && !i.name.is_empty() && !i.name.contains(['\n', '\0', '\u{fffd}']));
    if names {
        let again = read([&written[0], &written[1], &written[2]]).expect("own files are read");
        assert_eq!((again.images.len(), again.points.len()), (model.images.len(), model.points.len()));
    }
    for frames in [1, 2, 5] {
        if let Ok(clip) = colmap::ImportedClip::new(std::slice::from_ref(&model), frames, SIZE) {
            assert_eq!(clip.tracks.len(), frames);
        }
    }
}

/// A COLMAP model of any bytes as text, its three files separated by [`SEPARATOR`]: refused or read without a panic, written and read
/// again, and assigned to a clip or refused.
pub fn colmap_text(bytes: &[u8]) {
    colmap_model(bytes, colmap::Model::from_text, ".txt");
}

/// [`colmap_text`] in the binary form.
pub fn colmap_binary(bytes: &[u8]) {
    colmap_model(bytes, colmap::Model::from_binary, ".bin");
}

/// A mask of any bytes: refused or read without a panic; a mask covers less than the whole picture.
pub fn mask_file(bytes: &[u8]) {
    if let Ok(mask) = Mask::decode(bytes, 64, 36, 3) {
        let plane = mask.plane();
        assert_eq!((plane.width(), plane.height()), (64, 36));
        assert!((0..36).any(|y| plane.row(y).contains(&0)));
    }
}
