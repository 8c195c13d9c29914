//! What the fuzz targets do with any bytes. The integration tests run the same on mutated examples, for toolchains without a
//! fuzzer.

use std::io::Cursor;

use plumbline::app::pipeline::{Source, print, read};
use plumbline::camera::{ExifFacts, LensFile, parse_lens};
use plumbline::image::still::{ExifTags, LoadOptions, SaveOptions, StillFormat, decode, encode};
use plumbline::num::math::Point2;
use plumbline::num::run::Run;
use plumbline::num::sparse::{Method, Ordering, read_matrix_market, write_matrix_market};
use plumbline::shape::character::Extrapolation;
use plumbline::shape::character::io::{
    Rig, bvh_text, character_of, parse_anim, parse_bvh, parse_skel, parse_tgf, tgf_text,
};
use plumbline::shape::character::regression::SkinModel;
use plumbline::shape::mesh::io::{MeshFormat, ReadLimits, WriteOptions, decode_model, encode_model};
use plumbline::shape::mesh::{HalfEdges, RepairOptions, Weld, repair, shapes};
use plumbline::shape::surface::handle_file::HandleFile;
use plumbline::video::motion::ClipMotion;

/// A motion file of any bytes is refused or read, never a panic; what was read can be written and read again.
pub fn motion_file(bytes: &[u8]) {
    if let Ok(clip) = ClipMotion::from_json(bytes) {
        let mut text = Vec::new();
        if clip.write_json(&mut text).is_ok() {
            ClipMotion::from_json(&text[..]).expect("own files are read");
        }
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
    }
}

/// Any bytes as a mesh file: read or refused without a panic. What was read can be repaired, and written in every format that
/// can hold it and read again.
fn mesh_file(bytes: &[u8], format: MeshFormat) {
    let limits = ReadLimits { max_bytes: 1 << 20, max_elements: 1 << 12 };
    let Ok(model) = decode_model(bytes, format, None, &limits, &Run::default()) else { return };
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
    let limits = ReadLimits { max_bytes: 1 << 20, max_elements: 1 << 12 };
    let Ok(model) = decode_model(bytes, format, None, &limits, &Run::default()) else { return };
    let Ok(character) = character_of(&model) else { return };
    for clip in &character.clips {
        for time in [-1.0, 0.0, 0.3, 1e9] {
            clip.pose(&character.skeleton, time, Extrapolation::Repeat).expect("a clip of its own skeleton");
        }
    }
    write_and_read(&character.to_model(None).expect("a character is a model"));
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
