//! The fuzz targets' bodies on mutated examples: flipped, cut, doubled, moved and spliced bytes, and words of the formats.

#[path = "../../fuzz/bodies.rs"]
#[expect(unreachable_pub, reason = "elsewhere it is a library")]
mod bodies;

use std::io::Cursor;
use std::path::Path;

use crate::fbx::writer::{Form, character, stored};
use crate::support::clips::{make, workshop};
use plumbline::app::pipeline::tasks::TaskPlan;
use plumbline::image::still::{GainMap, Photo, SaveOptions, StillFormat, Xmp, encode, frame_of_rgb};
use plumbline::num::run::Run;
use plumbline::num::time::{Timebase, Timestamp};
use plumbline::shape::character::SkinWeights;
use plumbline::shape::character::io::parse_skel;
use plumbline::shape::character::regression::{Example, RegressionModel, RegressionOptions, SkinModel};
use plumbline::shape::mesh::io::{WriteOptions, decode_model, encode_model};
use plumbline::shape::mesh::{MeshFormat, Model, ReadLimits, shapes};
use plumbline::video::motion::{ClipMotion, FrameMotion, MotionQuality};
use plumbline::video::track::{FrameQuality, FrameTracks, Observation, TrackStore, WindowTracks};

/// Mutated inputs for each target.
const ROUNDS: usize = 30_000;
/// Mutated inputs for the side files: their parsers share most of their code, and the smoke test of all targets is to stay near 20 s.
const FEW_ROUNDS: usize = 5_000;

/// Pieces that get further into a parser than single bytes do.
const WORDS: [&str; 28] = [
    "[",
    "]",
    "{",
    "}",
    "\"",
    "'''",
    "=",
    "#",
    "\n",
    "${",
    "${item.stem}",
    "${vars.out}",
    "${env.HOME}",
    "[stage.x]",
    "[[stage]]",
    "use = \"video.encode\"",
    "inputs = [\"x\"]",
    "inputs = { frames = \"x\" }",
    "enabled = false",
    "null",
    "-1",
    "1e308",
    "nan",
    "1e-400",
    "18446744073709551616",
    "\u{0}",
    "\u{feff}",
    "ä",
];

/// One example changed in one to four places.
fn mutated(examples: &[Vec<u8>], random: &mut fastrand::Rng) -> Vec<u8> {
    let mut bytes = random.choice(examples).cloned().unwrap_or_default();
    for _ in 0..random.usize(1..=4) {
        let at = random.usize(0..=bytes.len());
        let end = (at + random.usize(1..40)).min(bytes.len());
        match random.u8(0..7) {
            0 if at < bytes.len() => bytes[at] ^= 1 << random.u8(0..8),
            1 if at < bytes.len() => bytes[at] = random.u8(..),
            2 => drop(bytes.drain(at..end)),
            3 => bytes.truncate(at),
            4 => {
                let piece = bytes[at..end].to_vec();
                let to = random.usize(0..=bytes.len());
                bytes.splice(to..to, piece);
            }
            5 => {
                let other = random.choice(examples).cloned().unwrap_or_default();
                let from = random.usize(0..=other.len());
                let piece = other[from..(from + random.usize(0..200)).min(other.len())].to_vec();
                bytes.splice(at..at, piece);
            }
            _ => {
                let word = random.choice(&WORDS).copied().unwrap_or_default();
                bytes.splice(at..at, word.bytes());
            }
        }
    }
    bytes
}

/// Runs `body` on the examples and on their mutants.
fn hammer(examples: &[Vec<u8>], body: fn(&[u8]), seed: u64) {
    hammer_times(ROUNDS, examples, body, seed);
}

/// Writes the examples as files into the folder `PLUMBLINE_SEEDS`, where that is set: a fuzzer starts from there.
fn keep_as_seeds(examples: &[Vec<u8>], seed: u64) {
    let Some(folder) = std::env::var_os("PLUMBLINE_SEEDS").map(std::path::PathBuf::from) else { return };
    std::fs::create_dir_all(&folder).expect("a folder for seeds");
    for (k, example) in examples.iter().enumerate() {
        std::fs::write(folder.join(format!("{seed}-{k}")), example).expect("a seed");
    }
}

/// [`hammer`] with a number of mutants, `PLUMBLINE_FUZZ_TIMES` as many where that is set. A mutant on which the body panics is kept.
fn hammer_times(rounds: usize, examples: &[Vec<u8>], body: fn(&[u8]), seed: u64) {
    let times = std::env::var("PLUMBLINE_FUZZ_TIMES").ok().map_or(1, |n| n.parse().expect("a number of times"));
    keep_as_seeds(examples, seed);
    let mut random = fastrand::Rng::with_seed(seed);
    for example in examples {
        body(example);
    }
    for round in 0..rounds * times {
        let bytes = mutated(examples, &mut random);
        if std::panic::catch_unwind(|| body(&bytes)).is_err() {
            let kept = std::env::temp_dir().join(format!("plumbline-fuzz-{seed}-{round}"));
            std::fs::write(&kept, &bytes).expect("a temporary file");
            panic!("round {round} panicked on the bytes in {}", kept.display());
        }
    }
}

#[test]
fn no_pipeline_file_makes_the_reader_panic() {
    let mut examples: Vec<Vec<u8>> = vec![
        std::fs::read("pipeline/stabilize.toml").expect("the shipped pipeline"),
        b"version = 1\n[stage.a]\nuse = \"video.decode\"\npath = \"a.mp4\"\n[stage.b]\nuse = \"video.encode\"\n\
          inputs = [\"a\"]\npath = \"b.mp4\"\ncrf = 18\n"
            .to_vec(),
    ];
    let all = ["plumbline", "stabilize", "f/%d.png", "-o", "x.mkv", "--fps", "29.97", "--border", "fill", "--compare"];
    let built = plumbline::app::cli::pipeline_of(all).expect("options in order");
    examples.push(plumbline::app::pipeline::print(&built).into_bytes());
    hammer(&examples, bodies::pipeline_file, 1);
}

#[test]
fn no_plan_makes_the_reader_panic() {
    let examples = ["rectify", "stabilize", "rig-and-pose"].map(|name| {
        let source = plumbline::app::pipeline::shipped::find_source(name).expect("shipped");
        let pipeline = plumbline::app::pipeline::read(source, &["batch.foreach=item.x".to_owned()]).expect("no faults");
        let instances = pipeline.instances().expect("one item");
        let plan = TaskPlan::of(&pipeline, &instances, Path::new("."), &plumbline::app::stages::BuiltinStages)
            .expect("a plan");
        plan.to_text().expect("plain data").into_bytes()
    });
    hammer_times(FEW_ROUNDS, &examples, bodies::plan_file, 31);
}

/// Fewer than of the others: each opens decoders and encoders.
const CLIP_ROUNDS: usize = 300;

#[test]
fn no_clip_makes_the_reader_or_the_copier_panic_or_hang() {
    let Some(folder) = workshop() else { return };
    let source = "-f lavfi -i testsrc2=size=64x48:rate=25:duration=0.2 -f lavfi -i sine=duration=0.2:sample_rate=16000";
    let made = [
        ("a.mkv", "-c:v mpeg4 -c:a pcm_s16le"),
        ("a.mp4", "-c:v libx264 -preset ultrafast -c:a aac -movflags +faststart"),
        ("a.ts", "-c:v mpeg2video -c:a mp2"),
        ("a.flv", "-c:v flv1 -c:a aac"),
        ("a.avi", "-c:v mjpeg -c:a pcm_s16le"),
        ("a.ogv", "-c:v libtheora -c:a libopus -ar 48000"),
    ];
    let read = |(name, args): &(&str, &str)| {
        std::fs::read(make(folder.path(), name, &format!("{source} {args}"))).expect("read")
    };
    hammer_times(CLIP_ROUNDS, &made.iter().map(read).collect::<Vec<_>>(), bodies::clip_file, 14);
}

#[test]
fn no_motion_file_makes_the_reader_panic() {
    let frame = |k: i64| FrameMotion::still(Timestamp(k * 512), MotionQuality::Measured);
    let clip = ClipMotion::new(640, 360, Timebase { num: 1, den: 12800 }, (0..4).map(frame).collect());
    let mut text = Vec::new();
    clip.write_json(&mut text).expect("a small file");
    let mut store = TrackStore::new().expect("a temporary folder");
    for frame in &clip.frames {
        let observations = (0..5).map(|id| Observation { id, x: 30.5, y: 7.25, background: id != 3 }).collect();
        store.push(&FrameTracks { pts: frame.pts, observations, quality: FrameQuality::default() }).expect("in range");
    }
    let mut with_tracks = Vec::new();
    clip.write_json_with_tracks(&mut with_tracks, &store).expect("a small file");
    hammer(&[text, with_tracks, b"{}".to_vec(), b"[]".to_vec()], bodies::motion_file, 2);
}

#[test]
fn no_file_of_cameras_or_of_importance_makes_its_reader_panic() {
    let camera = r#"{"q":[0.8,0.0,0.6,0.0],"t":[0.1,2.5,-3.0],"focal":600.0,"center":[320.0,180.0],"k1":-0.01}"#;
    let point = r#"{"shot":0,"id":7,"at":[0.5,1.0,3.0]}"#;
    let figures = serde_json::to_string(&plumbline::video::motion::sfm::SfmFigures::default()).expect("plain data");
    let shot = format!(r#"{{"frames":[0,2],"verdict":"3d","reason":"seen","figures":{figures}}}"#);
    let cameras = format!(
        r#"{{"format":"plumbline.cameras","version":1,"found":{{"cameras":[{camera},null],"points":[{point}],"reconstruction":[{shot}]}}}}"#
    );
    plumbline::video::motion::ClipCameras::from_json(&cameras).expect("a file of cameras");
    let mut importance = plumbline::photo::temporal::ClipImportance::new((64, 48));
    for frame in [0, 5] {
        importance.push(frame, &plumbline::image::feature::Importance::even());
    }
    hammer_times(FEW_ROUNDS, &[cameras.into_bytes(), importance.to_bytes()], bodies::kept_file, 61);
}

#[test]
fn no_window_file_makes_the_reader_or_the_joiner_panic() {
    let tracks = |k: u16| {
        let at = |id: u32| Observation { id, x: (id * 9 % 60) as f32, y: 0.5 * f32::from(k), background: true };
        let observations = (0..7).map(at).collect();
        FrameTracks { pts: Timestamp(i64::from(k)), observations, quality: FrameQuality::default() }
    };
    // The second window begins with its warm-up, the last frame of the first.
    let frames = [0, 1, 1, 2, 3].map(tracks).to_vec();
    let window = |window| {
        let mut bytes = Vec::new();
        WindowTracks { size: (64, 48), window, frames: frames.clone() }.write(&mut bytes).expect("memory");
        bytes
    };
    hammer_times(FEW_ROUNDS, &[window(0), window(3)], bodies::window_file, 60);
}

#[test]
fn no_lens_file_makes_the_reader_panic() {
    let examples = [
        &b"%YAML:1.0\n---\nimage_width: 640\nimage_height: 480\nK: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [ 300., \
          0., 320., 0., 310., 240., 0., 0., 1. ]\nD: [0.1, 0.02, -0.01, 0.001]\nxi: 1.2\n"[..],
        b"<?xml version=\"1.0\"?><opencv_storage><image_width>640</image_width><image_height>480</image_height><camera_matrix \
          type_id=\"opencv-matrix\"><rows>3</rows><cols>3</cols><dt>d</dt><data>300. 0. 320. 0. 310. 240. 0. 0. 1.</data>\
          </camera_matrix><distortion_coefficients>-0.3 0.1 0.001 -0.002 0.05 0.1 0.1 0.1</distortion_coefficients>\
          </opencv_storage>",
        b"cam0:\n  camera_model: omni\n  distortion_coeffs: [-0.3, 0.1, 0.001, -0.002]\n  distortion_model: radtan\n  \
          intrinsics: [1.3, 500.0, 510.0, 320.0, 240.0]\n  resolution: [640, 480]\n",
        b"#polynomial coefficients for the DIRECT mapping function\n3 -300.0 0.0 0.0008\n2 400.0 200.0\n240.0 330.0\n1.01 0.02 \
          -0.03\n480 640\n",
        b"{\"calib_dimension\": {\"w\": 640, \"h\": 480}, \"fisheye_params\": {\"camera_matrix\": [[300, 0, 320], [0, 300, 240], [0, 0, \
          1]], \"distortion_coeffs\": [0.1, 0.02, -0.03, 0.004]}, \"distortion_model\": \"opencv_standard\"}",
        b"1 THIN_PRISM_FISHEYE 640 480 300 310 320 240 0.1 0.02 0.001 -0.002 0.03 0.004 0.0003 0.0004\n",
        b"{\"version\": 1, \"model\": \"unified\", \"width\": 640, \"height\": 480, \"fx\": 300, \"alpha\": 0.6, \"xi\": 0.1}",
        b"<lensdatabase version=\"1\"><lens><maker>Canon</maker><model>Canon EF-S 10-22mm f/3.5-4.5 USM</model><cropfactor>1.6\
          </cropfactor><type>equisolid</type><calibration><distortion model=\"ptlens\" focal=\"10\" a=\"0.01\" b=\"-0.03\" \
          c=\"0.005\"/><distortion model=\"poly5\" focal=\"22\" k1=\"0.1\" k2=\"0.1\"/></calibration></lens></lensdatabase>",
    ];
    hammer(&examples.map(<[u8]>::to_vec), bodies::lens_file, 3);
}

#[test]
fn no_picture_makes_the_reader_panic() {
    let samples: Vec<u8> = (0..24 * 16 * 3).map(|i| (i * 7 % 251) as u8).collect();
    let frame = frame_of_rgb(&samples, 24, 16).expect("as many as it takes");
    let exif = Some(b"II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0\x06\0\0\0\0\0\0\0".to_vec());
    let map = frame_of_rgb(&samples[..6 * 4 * 3], 6, 4).expect("as many as it takes");
    let gain_map = Some(GainMap { frame: map, xmp: Some(PACKET.into()), iso: Some(vec![0; 4]) });
    let (xmp, iptc) =
        (Some(Xmp { packet: PACKET.into(), extended: Some(vec![b'a'; 80]) }), Some(b"\x1c\x02x\0\x01a".to_vec()));
    let photo = Photo { exif, xmp, iptc, gain_map, ..Photo::new(frame) };
    let file = |format| {
        let mut out = Cursor::new(Vec::new());
        encode(&photo, format, SaveOptions::default(), &mut out).expect("it can be written");
        out.into_inner()
    };
    let formats = [StillFormat::Jpeg, StillFormat::Png, StillFormat::Tiff, StillFormat::WebP];
    hammer(&formats.map(file), bodies::still_file, 3);
    let mut inks = Vec::new();
    let encoder = jpeg_encoder::Encoder::new(&mut inks, 90);
    encoder.encode(&samples[..24 * 12 * 4], 24, 12, jpeg_encoder::ColorType::CmykAsYcck).expect("memory");
    hammer(&[inks, floats()], bodies::still_file, 4);
}

/// XMP that is corrected, and describes a gain map.
const PACKET: &str = r#"<rdf:RDF xmlns:rdf="r"><rdf:Description xmlns:t="http://ns.adobe.com/tiff/1.0/" t:Orientation="6"
 xmlns:hdrgm="http://ns.adobe.com/hdr-gain-map/1.0/" xmlns:xmpNote="http://ns.adobe.com/xmp/note/" hdrgm:Version="1.0"
 xmpNote:HasExtendedXMP="0123456789ABCDEF0123456789ABCDEF"><t:ImageWidth>9</t:ImageWidth></rdf:Description></rdf:RDF>"#;

/// A TIFF file of two gray pixels, floating-point.
fn floats() -> Vec<u8> {
    let mut file = b"II*\0\x10\0\0\0".to_vec();
    file.extend([0.25_f32.to_le_bytes(), 4_f32.to_le_bytes()].concat());
    let entries: [(u16, u16); 10] =
        [(256, 2), (257, 1), (258, 32), (259, 1), (262, 1), (273, 8), (277, 1), (278, 1), (279, 8), (339, 3)];
    file.extend((entries.len() as u16).to_le_bytes());
    for (tag, value) in entries {
        file.extend([tag.to_le_bytes(), [3, 0], [1, 0], [0, 0], value.to_le_bytes(), [0, 0]].concat());
    }
    file.extend([0; 4]);
    file
}

/// A square of two materials and three vertices of color, in every format.
fn mesh_examples(format: MeshFormat) -> Vec<Vec<u8>> {
    let obj = b"o a\nv 0 0 0 1 0 0\nv 1 0 0\nv 1 1 0.5\nv 0 1 0\nvt 0 0\nvt 1 1\nvn 0 0 1\nusemtl m\ng p\nf 1/1/1 2/2/1 3/1/1 4/2/1\n\
                usemtl n\nf -4 3 2\nf 4//1 2//1 \\\n1//1\n";
    let square = decode_model(obj, MeshFormat::Obj, None, &ReadLimits::default(), &Run::default()).expect("a mesh");
    let plain = Model::of_mesh(shapes::disjoint(&[shapes::moebius(5, 1), shapes::hourglass(), shapes::book(4)]));
    let encoded = |model: &Model, ascii: bool| {
        encode_model(model, format, &WriteOptions { ascii }, &Run::default()).expect("it can be written")
    };
    let mut examples: Vec<_> =
        [&square, &plain].into_iter().flat_map(|m| [encoded(m, true), encoded(m, false)]).collect();
    match format {
        MeshFormat::Obj => examples.push(obj.to_vec()),
        MeshFormat::Off => examples.push(b"STCNOFF 3 1 0\n0 0 0 0 0 1 1 0 0 1 0 0\n1 0 0 0 0 1 1 0 0 1 1 0\n0 1 0 0 0 1 1 0 0 1 0 1\n3 0 1 2\n".to_vec()),
        MeshFormat::Ply => examples.push(
            b"ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\nelement tristrips 1\n\
              property list int int vertex_indices\nelement extra 2\nproperty list uchar float w\nend_header\n0 0 0\n1 0 0\n0 1 0\n\
              1 1 0\n4 0 1 2 3\n1 2\n0\n"
                .to_vec(),
        ),
        _ => {}
    }
    examples
}

/// A triangle on two joints with a morph target and a movement, in both forms.
fn moving_examples() -> Vec<Vec<u8>> {
    let identity = "1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,1";
    let numbers = format!(
        "0,0,0, 1,0,0, 0,1,0, {identity}, {identity}, 0.5,0.5,0,0, 1,0,0,0, 0.2,0.8,0,0, 0,1, 0,0,0,1, 0,0.6,0,0.8, 0,1"
    );
    let mut buffer: Vec<u8> = Vec::new();
    for word in numbers.split(',') {
        buffer.extend(word.trim().parse::<f32>().expect("a number").to_le_bytes());
    }
    buffer.extend([0_u8, 1, 0, 0].repeat(3));
    let view = |from: usize, bytes: usize| format!("{{\"buffer\":0,\"byteOffset\":{from},\"byteLength\":{bytes}}}");
    let views =
        [view(0, 36), view(36, 128), view(164, 48), view(212, 8), view(220, 32), view(252, 8), view(260, 12)].join(",");
    let json = format!(
        "{{\"asset\":{{\"version\":\"2.0\"}},\"buffers\":[{{\"byteLength\":{}}}],\"bufferViews\":[{views}],\"accessors\":[\
         {{\"bufferView\":0,\"componentType\":5126,\"count\":3,\"type\":\"VEC3\"}},\
         {{\"bufferView\":1,\"componentType\":5126,\"count\":2,\"type\":\"MAT4\"}},\
         {{\"bufferView\":2,\"componentType\":5126,\"count\":3,\"type\":\"VEC4\"}},\
         {{\"bufferView\":3,\"componentType\":5126,\"count\":2,\"type\":\"SCALAR\"}},\
         {{\"bufferView\":4,\"componentType\":5126,\"count\":2,\"type\":\"VEC4\"}},\
         {{\"bufferView\":5,\"componentType\":5126,\"count\":2,\"type\":\"SCALAR\"}},\
         {{\"bufferView\":6,\"componentType\":5121,\"count\":3,\"type\":\"VEC4\"}}],\
         \"meshes\":[{{\"primitives\":[{{\"attributes\":{{\"POSITION\":0,\"JOINTS_0\":6,\"WEIGHTS_0\":2}},\"targets\":[{{\"POSITION\":0}}]}}]}}],\
         \"nodes\":[{{\"children\":[1]}},{{\"translation\":[1,0,0]}},{{\"mesh\":0,\"skin\":0}}],\
         \"skins\":[{{\"joints\":[0,1],\"inverseBindMatrices\":1}}],\"animations\":[{{\"channels\":[\
         {{\"sampler\":0,\"target\":{{\"node\":1,\"path\":\"rotation\"}}}},{{\"sampler\":1,\"target\":{{\"node\":2,\"path\":\"weights\"}}}}],\
         \"samplers\":[{{\"input\":3,\"output\":4}},{{\"input\":3,\"output\":5}}]}}],\"scenes\":[{{\"nodes\":[0,2]}}]}}",
        buffer.len()
    );
    let mut json = json.into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut glb = b"glTF\x02\0\0\0".to_vec();
    glb.extend((28 + json.len() as u32 + buffer.len() as u32).to_le_bytes());
    for (bytes, kind) in [(&json, b"JSON"), (&buffer, b"BIN\0")] {
        glb.extend((bytes.len() as u32).to_le_bytes());
        glb.extend(kind);
        glb.extend(bytes);
    }
    let model =
        decode_model(&glb, MeshFormat::Glb, None, &ReadLimits::default(), &Run::default()).expect("a character");
    assert!(model.articulation().is_some());
    let text =
        encode_model(&model, MeshFormat::Gltf, &WriteOptions::default(), &Run::default()).expect("it can be written");
    vec![glb, text]
}

#[test]
fn no_file_of_a_skeleton_makes_a_reader_panic() {
    let examples = [
        "HIERARCHY\nROOT a\n{\n OFFSET 0 1 0\n CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation\n JOINT b\n {\n \
         OFFSET 0 1 0\n CHANNELS 3 Zrotation Xrotation Yrotation\n End Site\n {\n OFFSET 0 1 0\n }\n }\n}\nMOTION\nFrames: 2\nFrame \
         Time: 0.04\n0 1 2 3 4 5 6 7 8\n8 7 6 5 4 3 2 1 0\n",
        "1 0 0 0\n2 1 0 0\n3 1 1 0\n#\n1 2\n2 3\n",
        "2\n0 0 0 a root\n1 0 0 b a\n",
        "2 2\n0\n1 0 0\n1 0 0\n0 0\n1\n0 0 1\n0 1 0\n0.5 0.7\n",
    ];
    hammer(&examples.map(|e| e.as_bytes().to_vec()), bodies::rig_file, 23);
}

#[test]
fn no_trained_skin_makes_the_reader_panic() {
    let skeleton = parse_skel("2\n0 0 0 a root\n1 0 0 b a\n").expect("a skeleton");
    let mesh = shapes::plane(2);
    let halves: Vec<u32> = mesh.positions().iter().map(|p| u32::from(p.x > 0.5)).collect();
    let weights = SkinWeights::rigid(2, &halves).expect("two joints");
    let example = |angle: f64| {
        let turn = nalgebra::Rotation3::from_axis_angle(&nalgebra::Vector3::y_axis(), angle);
        let place = |p: &nalgebra::Point3<f64>| if p.x > 0.5 { turn * p } else { *p };
        let matrices = vec![nalgebra::Matrix4::identity(), turn.to_homogeneous()];
        Example { matrices, positions: mesh.positions().iter().map(place).collect() }
    };
    let examples = [example(0.0), example(0.5), example(1.0)];
    let options = RegressionOptions::default();
    let (model, _) =
        RegressionModel::train(&mesh, &skeleton, &weights, &examples, &options, &Run::default()).expect("trained");
    let samples: Vec<_> = examples.iter().map(|e| e.matrices.clone()).collect();
    let reduced = model.reduced(&samples, 2, &Run::default()).expect("of the same joints");
    let files = [
        SkinModel::of(&mesh, &skeleton, &model).expect("its own"),
        SkinModel::of_reduced(&mesh, &skeleton, &reduced).expect("its own"),
    ];
    hammer(&files.map(|f| f.to_bytes()), bodies::skin_model, 24);
}

#[test]
fn no_mesh_file_makes_a_reader_panic() {
    type Body = fn(&[u8]);
    let bodies: [(MeshFormat, Body); 5] = [
        (MeshFormat::Obj, bodies::obj_file),
        (MeshFormat::Ply, bodies::ply_file),
        (MeshFormat::Off, bodies::off_file),
        (MeshFormat::Stl, bodies::stl_file),
        (MeshFormat::Glb, bodies::gltf_file),
    ];
    for (seed, (format, body)) in bodies.into_iter().enumerate() {
        hammer(&mesh_examples(format), body, 10 + seed as u64);
    }
    hammer(&mesh_examples(MeshFormat::Gltf), bodies::gltf_file, 20);
    hammer(&moving_examples(), bodies::gltf_file, 22);
    let forms = [Form { version: 7400, pack: None }, Form { version: 7700, pack: Some(stored) }];
    hammer(&forms.map(|form| character().bytes(form)), bodies::fbx_file, 25);
    let medit = b"MeshVersionFormatted 1\nDimension 3\nVertices\n4\n0 0 0 1\n1 0 0 1\n0 1 0 1\n0 0 1 1\nTriangles\n2\n1 2 3 0\n1 3 4 0\n\
                  Quadrilaterals 1 1 2 3 4 0\nTetrahedra\n1\n1 2 3 4 7\nEnd\n";
    hammer(&[medit.to_vec()], bodies::medit_file, 21);
}

#[test]
fn no_matrix_file_makes_the_reader_or_a_solver_panic() {
    let examples = [
        &b"%%MatrixMarket matrix coordinate real general\n% a remark\n3 3 5\n1 1 2.5\n2 2 -1e2\n3 3 4\n3 1 1\n1 2 0.5\n"[..],
        b"%%MatrixMarket matrix coordinate real symmetric\n4 4 7\n1 1 2\n2 2 2\n3 3 2\n4 4 2\n2 1 -1\n3 2 -1\n4 3 -1\n",
        b"%%MatrixMarket matrix coordinate real symmetric\n4 4 4\n3 1 1\n4 2 1\n1 1 1\n2 2 -1\n",
        b"%%MatrixMarket matrix coordinate integer skew-symmetric\n3 3 2\n2 1 1\n3 2 -7\n",
        b"%%MatrixMarket matrix coordinate pattern symmetric\n2 2 2\n1 1\n2 1\n",
        b"%%MatrixMarket matrix array real general\n4 2\n1\n0\n2\n0\n3\n4\n0\n1\n",
        b"%%MatrixMarket matrix array real symmetric\n2 2\n2\n-1\n2\n",
    ]
    .map(<[u8]>::to_vec);
    hammer(&examples, bodies::matrix_file, 30);
    hammer(&examples, bodies::matrix_file, 31);
}

#[test]
fn no_file_of_handles_makes_the_reader_panic() {
    let examples = [
        r#"{"format": "plumbline.handles", "version": 1, "sets": {"a": {"half_space": {"point": [0, 0.1, 0], "normal": [0, -1, 0]}},
            "b": {"union": ["a", {"not": {"box": {"low": [0, 0, 0], "high": [1, 1, 1]}}}]}}, "handles": [{"name": "foot", "vertices":
            "a"}, {"vertices": {"nearest": [[1, 1, 0]]}, "weight": 10, "rigid": {"pivot": [0, 0, 1], "rotation": {"axis": [0, 0, 1],
            "angle_deg": 270}, "translation": [0.3, 0, 0]}}], "region": {"not": "a"}}"#,
        r#"{"format": "plumbline.handles", "version": 1, "handles": [{"vertices": {"indices": [3, 5]}, "positions": {"keys": [{"time": 0,
            "positions": [[0, 0, 0], [1, 0, 0]]}, {"time": 2, "positions": [[0, 0, 1], [1, 0, 1]]}]}}, {"vertices": {"range": [6, 8]},
            "rigid": {"interpolation": "smooth", "keys": [{"time": -1}, {"time": 1, "rotation": {"quaternion": [0.5, 0.5, 0.5,
            0.5]}}]}}, {"vertices": {"intersection": [{"sphere": {"center": [0, 0, 0], "radius": 0.2}}, {"indices": [0]}]}}]}"#,
    ];
    hammer(&examples.map(|text| text.as_bytes().to_vec()), bodies::handle_file, 22);
}

/// Hammers a body with texts.
fn hammer_texts(examples: &[&str], body: fn(&[u8]), seed: u64) {
    let examples: Vec<Vec<u8>> = examples.iter().map(|text| text.as_bytes().to_vec()).collect();
    hammer_times(FEW_ROUNDS, &examples, body, seed);
}

#[test]
fn no_file_of_marks_makes_the_reader_panic() {
    let lines = [
        r#"{"format": "plumbline.lines", "version": 1, "pixel_center": 0.5, "source": {"width": 640, "height": 480}, "lines": [
            {"name": "edge", "points": [[10, 20], [300, 25.5], [600, 30]], "orientation": "horizontal"},
            {"points": [[50, 400], [52, 40]], "orientation": "vertical", "off": true}]}"#,
        r#"[{"id": 3, "points": [[1, 2], [630, 470]]}, {"name": "b", "points": [[5, 5], [6, 400]], "orientation": "v"}]"#,
    ];
    hammer_texts(&lines, bodies::lines_file, 40);
    let faces = [
        r#"{"format": "plumbline.faces", "version": 1, "source": {"width": 640, "height": 480}, "faces": [
            {"name": "left", "x": 10, "y": 20.5, "w": 100, "h": 120}, {"x": 300, "y": 200, "w": 50, "h": 60, "off": true}]}"#,
        r#"[{"id": 1, "x": 1, "y": 2, "w": 30, "h": 40}]"#,
    ];
    hammer_texts(&faces, bodies::faces_file, 41);
}

#[test]
fn no_path_file_makes_the_reader_panic() {
    let examples = [
        r#"{"wanted": [{"q": [1, 0, 0, 0], "t": [0, 0, 0]}, {"q": [0.6, 0, 0.8, 0], "t": [1, 2, 3]}],
            "input": [{"R": [[1, 0, 0], [0, 1, 0], [0, 0, 1]], "t": [0, 0, 0.5]}, {"q": [1, 0, 0, 0], "t": [0, 0, 1]}]}"#,
        r#"{"stable": [{"time_s": 0, "q": [1, 0, 0, 0], "t": [0, 0, 0]}, {"time_s": 0.1, "q": [0, 1, 0, 0], "t": [1e3, 0, 0]}],
            "shaky": [{"q": [1, 0, 0, 0], "t": [0, 0, 0]}]}"#,
    ];
    hammer_texts(&examples, bodies::path_file, 42);
}

#[test]
fn no_file_of_a_character_makes_a_reader_panic() {
    let poses = [
        r#"{"format": "plumbline.pose", "version": 1, "from": {"clip": "motion", "time": 0.25},
            "joints": {"b": {"turn_deg": [0, 0, 45]}, "a": {"rotation": [1, 0, 0, 0], "translation": [0, 0.1, 0]}}}"#,
        r#"{"format": "plumbline.pose", "version": 1, "targets": [{"joint": "b", "position": [0.5, 0.5, 0]}], "locked": ["a"]}"#,
    ];
    hammer_texts(&poses, bodies::pose_file, 43);
    let skeletons = [
        r#"{"format": "plumbline.skeleton", "version": 1, "joints": [{"name": "hip", "translation": [0, 1, 0]},
            {"name": "knee", "parent": "hip", "translation": [0, -0.5, 0], "rotation": [1, 0, 0, 0]}],
            "curve": {"nodes": [[0, 1, 0], [0, 0.5, 0]], "edges": [[0, 1]], "radius": [0.1, 0.2], "node_of_vertex": [0, 1, 1]}}"#,
        r#"{"format": "plumbline.skeleton", "version": 1, "joints": [{"name": "a"}]}"#,
    ];
    hammer_texts(&skeletons, bodies::skeleton_file, 44);
    let weights = [r#"{"format": "plumbline.weights", "version": 1, "joints": ["a", "b"],
        "rows": [[0, 1], [1, 0.7, 0, 0.3], [1, 1]]}"#];
    hammer_texts(&weights, bodies::weights_file, 45);
}

#[test]
fn no_file_of_a_morph_makes_a_reader_panic() {
    let landmarks = [
        r#"{"format": "plumbline.landmarks", "version": 1, "pairs": [[0, 1], [[0, 0, 0], 4], [3, [1, 0, 0]]]}"#,
        "2\n0 1\n2 3\n",
        "# marks\nmarkers:\n0: 1\n2: 3\n",
    ];
    hammer_texts(&landmarks, bodies::landmarks_file, 46);
    let paint = [r#"{"format": "plumbline.paint", "version": 1, "elsewhere": 0.5, "paint": [
        {"time": 0, "half_space": {"point": [0, 0, -0.5], "normal": [0, 0, -1]}},
        {"time": 1, "sphere": {"center": [0, 0, 1], "radius": 0.6}}, {"time": 0.25, "vertices": [0, [1, 0, 0]]}]}"#];
    hammer_texts(&paint, bodies::paint_file, 47);
    let seams = [
        r#"{"format": "plumbline.seam", "version": 1, "base": {"plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}},
            "part": {"loop": {"vertices": [0, 1, [0, 0, 1]], "keep": 5}}, "landmarks": [[0, 1]], "band": 4}"#,
        r#"{"format": "plumbline.seam", "version": 1, "base": {"boundary": [0, 0, 0]},
            "part": {"lasso": {"vertices": [1, 2, 3], "keep": [0, 1, 0]}}}"#,
    ];
    hammer_texts(&seams, bodies::seam_file, 48);
}

#[test]
fn no_colmap_model_makes_the_reader_panic() {
    use plumbline::camera::{CameraPose, Intrinsics, Point3};
    use plumbline::num::math::Point2;
    use plumbline::video::motion::exchange::colmap::{Camera, FILES, Image, ImageObservation, Model as Colmap, Point};
    let intrinsics = Intrinsics { focal: 500.0, center: Point2::new(320.0, 240.0), k1: 0.01 };
    let image = |id: u32| Image {
        id,
        camera: 1,
        name: format!("frame_{id:06}.png"),
        pose: CameraPose::identity(),
        observations: vec![
            ImageObservation { at: Point2::new(10.5, 20.25), point: Some(7) },
            ImageObservation { at: Point2::new(100.0, 200.0), point: None },
        ],
    };
    let point = Point { id: 7, position: Point3::new(0.0, 0.1, 2.0), error_px: 0.5, track: vec![(0, 0), (1, 0)] };
    let camera = Camera { id: 1, width: 640, height: 480, intrinsics };
    let model = Colmap { cameras: vec![camera], images: vec![image(0), image(1)], points: vec![point] };
    for (extension, body, seed) in
        [(".txt", bodies::colmap_text as fn(&[u8]), 49), (".bin", bodies::colmap_binary as fn(&[u8]), 50)]
    {
        let mut files = Vec::new();
        for (_, write) in FILES.iter().filter(|(name, _)| name.ends_with(extension)) {
            let mut bytes = Vec::new();
            write(&model, &mut bytes).expect("memory");
            files.push(bytes);
        }
        hammer_times(FEW_ROUNDS, &[files.join(bodies::SEPARATOR)], body, seed);
    }
}

#[test]
fn no_mask_makes_the_reader_panic() {
    let samples: Vec<u8> = (0..24 * 16 * 3).map(|i| if i % 72 < 36 { 255 } else { 0 }).collect();
    let frame = frame_of_rgb(&samples, 24, 16).expect("as many as it takes");
    let photo = Photo::new(frame);
    let file = |format| {
        let mut out = Cursor::new(Vec::new());
        encode(&photo, format, SaveOptions::default(), &mut out).expect("it can be written");
        out.into_inner()
    };
    let formats = [StillFormat::Jpeg, StillFormat::Png, StillFormat::Tiff, StillFormat::WebP];
    hammer_times(FEW_ROUNDS, &formats.map(file), bodies::mask_file, 51);
}
