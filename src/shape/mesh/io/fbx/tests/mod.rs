use nalgebra::{Matrix3, Matrix4, Point3, Rotation3, UnitQuaternion, Vector3};

use super::*;
use crate::mesh::io::decode_model;
use crate::mesh::{Model, NO_VALUE};
use writer::{Form, Key, Node, Scene, Value, character, file, leaf, linear, node, p, properties, whole};

mod hostile;
mod motion;
mod writer;

const PLAIN: Form = Form { version: 7400, pack: None };

fn zlib(bytes: &[u8]) -> Vec<u8> {
    use std::io::Write as _;
    let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::default());
    encoder.write_all(bytes).expect("a vector");
    encoder.finish().expect("a vector")
}

fn decode(bytes: &[u8]) -> Result<Model, MeshError> {
    let limits = ReadLimits { max_bytes: 1 << 24, max_elements: 1 << 20, ..ReadLimits::default() };
    decode_model(bytes, MeshFormat::Fbx, None, &limits, &Run::default())
}

fn read_scene(scene: &Scene) -> Model {
    decode(&scene.bytes(PLAIN)).expect("valid")
}

fn fault_of(bytes: &[u8]) -> String {
    decode(bytes).map(|_| ()).expect_err("to be refused").to_string()
}

const TRIANGLE: [[f64; 3]; 3] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 2.0, 3.0]];

/// A triangle at a node in meters, y up.
fn triangle_at(parts: Vec<Node>) -> Scene {
    let mut scene = Scene { settings: vec![p("UnitScaleFactor", &[100.0])], ..Scene::default() };
    let model = scene.model("tri", 0, parts);
    scene.mesh(model, &TRIANGLE, &[&[0, 1, 2]], Vec::new());
    scene
}

fn about(axis: usize, degrees: f64) -> Matrix4<f64> {
    UnitQuaternion::from_axis_angle(&Vector3::ith_axis(axis), degrees.to_radians()).to_homogeneous()
}

fn moved(v: [f64; 3]) -> Matrix4<f64> {
    Matrix4::new_translation(&v.into())
}

fn scaled(v: [f64; 3]) -> Matrix4<f64> {
    Matrix4::new_nonuniform_scaling(&v.into())
}

fn assert_positions(model: &Model, points: &[[f64; 3]], map: &Matrix4<f64>) {
    for (k, (p, q)) in model.mesh().positions().iter().zip(points).enumerate() {
        let expected = map.transform_point(&Point3::from(*q));
        assert!((p - expected).norm() < 1e-12 * (1.0 + expected.coords.norm()), "{k}: {p}, {expected}");
    }
}

#[test]
fn narrow_and_wide_records_raw_and_compressed_arrays_are_the_same_file() {
    let scene = character();
    let model = read_scene(&scene);
    assert_eq!((model.mesh().vertex_count(), model.faces().len()), (6, 2));
    for version in [7100, 7300, 7400, 7500, 7700] {
        for pack in [None, Some(zlib as writer::Pack), Some(writer::stored)] {
            let again = decode(&scene.bytes(Form { version, pack })).expect("valid");
            assert_eq!(again, model, "{version} {}", pack.is_some());
        }
    }
}

#[test]
fn polygons_keep_their_corners_and_layers() {
    let model = read_scene(&character());
    assert_eq!(model.faces().vertices(), [0, 1, 4, 3, 1, 2, 5, 4]);
    assert_eq!(model.mesh().triangle_count(), 4);
    let texture = model.texture().expect("texture coordinates");
    let uv: Vec<_> = (0..8).map(|corner| texture.get(corner).expect("a value")).collect();
    assert_eq!(uv[..4], [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 0.0]]);
    assert_eq!(model.normals().expect("normals").get(5), Some([0.0, 0.0, 1.0]));
    assert_eq!(model.colors().expect("colors")[2], [1.0, 0.5, 0.0, 1.0]);
    assert_eq!(model.materials().get(1).map(|m| m.name.as_str()), Some("skin"));
    assert_eq!(model.groups().get(0).map(|g| g.object.as_str()), Some("body"));
    assert!(model.warnings().is_empty(), "{:?}", model.warnings());
}

#[test]
fn layers_by_polygon_and_of_one_value_reach_every_corner() {
    let points = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
    let layer = |mapping: &str, normals: Vec<f64>| {
        let described = [leaf("MappingInformationType", mapping), leaf("ReferenceInformationType", "Direct")];
        let all = described.into_iter().chain([leaf("Normals", Value::Doubles(normals))]).collect();
        vec![node("LayerElementNormal", Vec::new(), all)]
    };
    let read = |layers: Vec<Node>| {
        let mut scene = Scene::default();
        let model = scene.model("a", 0, Vec::new());
        scene.mesh(model, &points, &[&[0, 1], &[0, 1, 2], &[0, 2, 3]], layers);
        read_scene(&scene)
    };
    // The first polygon has two corners: it is left out, and the layer goes on.
    let model = read(layer("ByPolygon", vec![1.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, -3.0]));
    let normals = model.normals().expect("normals");
    assert_eq!([normals.get(0), normals.get(3)], [Some([0.0, 1.0, 0.0]), Some([0.0, 0.0, -1.0])]);
    assert_eq!(model.warnings(), ["polygons of fewer than three corners are left out (1)"]);
    let model = read(layer("AllSame", vec![0.0, 0.0, 1.0]));
    assert!(model.normals().expect("normals").of_corner.iter().all(|&k| k == 0));
    // Fewer values than items, and a mapping that is not read.
    let model = read(layer("ByPolygon", vec![1.0, 0.0, 0.0, 0.0, 1.0, 0.0]));
    assert_eq!(model.normals().expect("normals").of_corner, [1, 1, 1, NO_VALUE, NO_VALUE, NO_VALUE]);
    let model = read(layer("ByEdge", vec![1.0, 0.0, 0.0]));
    assert!(model.normals().is_none() && model.warnings()[1].contains("by edge"), "{:?}", model.warnings());
}

#[test]
fn the_transform_of_a_node_is_that_of_the_sdk() {
    // Order 1: x, z, y.
    let parts = vec![
        p("Lcl Translation", &[1.0, 2.0, 3.0]),
        p("Lcl Rotation", &[10.0, 20.0, 30.0]),
        p("Lcl Scaling", &[2.0, 3.0, 0.5]),
        p("PreRotation", &[-90.0, 15.0, 5.0]),
        p("PostRotation", &[7.0, -8.0, 9.0]),
        p("RotationOffset", &[0.1, 0.2, 0.3]),
        p("RotationPivot", &[1.0, -1.0, 0.5]),
        p("ScalingOffset", &[0.4, 0.5, 0.6]),
        p("ScalingPivot", &[-0.7, 0.8, 0.9]),
        p("GeometricTranslation", &[5.0, 0.0, -5.0]),
        p("GeometricRotation", &[0.0, 90.0, 45.0]),
        p("GeometricScaling", &[1.0, -2.0, 1.0]),
        whole("RotationOrder", 1),
    ];
    let xyz = |r: [f64; 3]| about(2, r[2]) * about(1, r[1]) * about(0, r[0]);
    let node = moved([1.0, 2.0, 3.0])
        * moved([0.1, 0.2, 0.3])
        * moved([1.0, -1.0, 0.5])
        * xyz([-90.0, 15.0, 5.0])
        * about(1, 20.0)
        * about(2, 30.0)
        * about(0, 10.0)
        * xyz([7.0, -8.0, 9.0]).transpose()
        * moved([-1.0, 1.0, -0.5])
        * moved([0.4, 0.5, 0.6])
        * moved([-0.7, 0.8, 0.9])
        * scaled([2.0, 3.0, 0.5])
        * moved([0.7, -0.8, -0.9]);
    let geometric = moved([5.0, 0.0, -5.0]) * xyz([0.0, 90.0, 45.0]) * scaled([1.0, -2.0, 1.0]);
    let model = read_scene(&triangle_at(parts.clone()));
    assert_positions(&model, &TRIANGLE, &(node * geometric));
    // The map mirrors: the face is reversed.
    assert_eq!(model.mesh().triangles(), [[0, 2, 1]]);
    // A child does not inherit the geometric part.
    let mut scene = triangle_at(parts.clone());
    let child = scene.model("child", 1000, vec![p("Lcl Translation", &[0.0, 1.0, 0.0]), whole("InheritType", 1)]);
    scene.mesh(child, &TRIANGLE, &[&[0, 1, 2]], Vec::new());
    let model = read_scene(&scene);
    let positions = model.mesh().positions()[3..].to_vec();
    for (p, q) in positions.iter().zip(TRIANGLE) {
        assert!((p - (node * moved([0.0, 1.0, 0.0])).transform_point(&q.into())).norm() < 1e-12);
    }
    // Without the flag for rotations their order, and pre- and post-rotations, do not act.
    let plain = vec![
        p("Lcl Rotation", &[10.0, 20.0, 30.0]),
        p("PreRotation", &[-90.0, 15.0, 5.0]),
        whole("RotationOrder", 1),
        whole("RotationActive", 0),
    ];
    assert_positions(&read_scene(&triangle_at(plain)), &TRIANGLE, &xyz([10.0, 20.0, 30.0]));
}

#[test]
fn properties_of_the_template_hold_where_a_node_has_none() {
    let template = |kind: &str, parts: Vec<Node>| {
        node(
            "ObjectType",
            vec![kind.into()],
            vec![node("PropertyTemplate", vec!["FbxNode".into()], vec![properties(parts)])],
        )
    };
    let mut scene = triangle_at(vec![p("Lcl Scaling", &[2.0, 2.0, 2.0])]);
    scene.definitions = vec![
        template("Geometry", vec![p("Lcl Scaling", &[7.0, 7.0, 7.0])]),
        template("Model", vec![p("Lcl Translation", &[1.0, 1.0, 1.0]), p("Lcl Scaling", &[5.0, 5.0, 5.0])]),
    ];
    assert_positions(&read_scene(&scene), &TRIANGLE, &(moved([1.0, 1.0, 1.0]) * scaled([2.0, 2.0, 2.0])));
}

#[test]
fn units_and_axes_become_meters_and_y_up() {
    let axes = |right: i32, up: i32, front: i32, signs: [i32; 3], unit: f64| {
        let mut scene = triangle_at(vec![p("Lcl Translation", &[10.0, 20.0, 30.0])]);
        scene.settings = vec![
            whole("CoordAxis", right),
            whole("UpAxis", up),
            whole("FrontAxis", front),
            whole("CoordAxisSign", signs[0]),
            whole("UpAxisSign", signs[1]),
            whole("FrontAxisSign", signs[2]),
            p("UnitScaleFactor", &[unit]),
        ];
        scene
    };
    let at = moved([10.0, 20.0, 30.0]);
    // z up, the front toward -y, centimeters.
    let turned = Matrix3::new(1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, -1.0, 0.0).to_homogeneous();
    let model = read_scene(&axes(0, 2, 1, [1, 1, -1], 1.0));
    assert_positions(&model, &TRIANGLE, &(scaled([0.01; 3]) * turned * at));
    assert_eq!(model.mesh().triangles(), [[0, 1, 2]]);
    // A left-handed file in inches: mirrored, and its faces reversed.
    let model = read_scene(&axes(0, 1, 2, [1, 1, -1], 2.54));
    assert_positions(&model, &TRIANGLE, &(scaled([0.0254, 0.0254, -0.0254]) * at));
    assert_eq!(model.mesh().triangles(), [[0, 2, 1]]);
    // Two axes in one direction.
    let model = read_scene(&axes(0, 1, 1, [1; 3], 100.0));
    assert_positions(&model, &TRIANGLE, &at);
    assert!(model.warnings()[0].contains("not valid"));
    // Centimeters where the file does not say.
    assert_positions(
        &read_scene(&Scene { settings: Vec::new(), ..triangle_at(Vec::new()) }),
        &TRIANGLE,
        &scaled([0.01; 3]),
    );
}

#[test]
fn several_nodes_may_have_one_mesh_and_nodes_without_one_are_no_part_of_the_surface() {
    let mut scene = triangle_at(Vec::new());
    let other = scene.model("other", 1000, vec![p("Lcl Translation", &[0.0, 0.0, 5.0])]);
    scene.connect(1001, other);
    scene.model("empty", other, Vec::new());
    let model = read_scene(&scene);
    assert_eq!((model.mesh().vertex_count(), model.faces().len()), (6, 2));
    assert_eq!(model.mesh().positions()[5].z, 8.0);
    assert!(model.articulation().is_none());
}

#[test]
fn detection_is_by_the_first_bytes() {
    use crate::mesh::io::detect_format;
    use std::path::Path;
    let bytes = character().bytes(PLAIN);
    assert_eq!(detect_format(&bytes, Path::new("a.obj")).expect("known"), MeshFormat::Fbx);
    assert_eq!(MeshFormat::of_name(Path::new("A.FBX")), Some(MeshFormat::Fbx));
    let text = b"; FBX 7.4.0 project file\n; ----\nFBXHeaderExtension:  {\n";
    assert_eq!(detect_format(text, Path::new("a")).expect("known"), MeshFormat::Fbx);
}
