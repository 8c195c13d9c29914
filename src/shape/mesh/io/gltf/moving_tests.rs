//! Tests of skins, morph targets and animations.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Value, json};

use crate::mesh::io::{MeshFormat, ReadLimits, WriteOptions, decode_model, encode_model, losses};
use crate::mesh::model::articulation::{ChannelInterpolation, Property};
use crate::mesh::{MeshError, Model, RepairOptions, repair};
use plumbline_num::run::Run;

/// A modification of a document.
type Change = fn(&mut Value);

/// Builder of a document.
struct Document(Value);

impl Document {
    /// Adds an accessor with a separate buffer of the given bytes.
    fn accessor(&mut self, bytes: &[u8], component: u32, count: usize, kind: &str) -> usize {
        let d = &mut self.0;
        let uri = format!("data:application/octet-stream;base64,{}", STANDARD.encode(bytes));
        let list = |d: &mut Value, name: &str, item: Value| {
            let list = d[name].as_array_mut().expect("a list");
            list.push(item);
            list.len() - 1
        };
        let buffer = list(d, "buffers", json!({ "byteLength": bytes.len(), "uri": uri }));
        let view = list(d, "bufferViews", json!({ "buffer": buffer, "byteLength": bytes.len() }));
        list(d, "accessors", json!({ "bufferView": view, "componentType": component, "count": count, "type": kind }))
    }

    fn floats(&mut self, values: &[f32], count: usize, kind: &str) -> usize {
        let bytes: Vec<u8> = values.iter().flat_map(|x| x.to_le_bytes()).collect();
        self.accessor(&bytes, 5126, count, kind)
    }
}

/// Accessors: 0 positions, 1 joints, 2 weights, 3 matrices, 4 offsets, 5 key times, 6 rotations, 7 morph weights.
fn moving() -> Value {
    let empty = json!({ "asset": { "version": "2.0" }, "buffers": [], "bufferViews": [], "accessors": [] });
    let mut d = Document(empty);
    d.floats(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0], 4, "VEC3");
    d.accessor(&[0, 1, 0, 0, 1, 0, 0, 0, 1, 1, 0, 0, 0, 9, 9, 9], 5121, 4, "VEC4");
    d.floats(&[0.5, 0.5, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.25, 0.75, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0], 4, "VEC4");
    let mut matrices = [0.0_f32; 32];
    for k in 0..8 {
        matrices[16 * (k / 4) + 5 * (k % 4)] = 1.0;
    }
    matrices[28] = -3.0;
    d.floats(&matrices, 2, "MAT4");
    d.floats(&[0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.5, 0.0, 0.0], 4, "VEC3");
    d.floats(&[0.0, 0.5, 2.0], 3, "SCALAR");
    d.floats(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.6, 0.0, 0.8, 0.0, 0.0, 1.0, 0.0], 3, "VEC4");
    d.floats(&[0.0, 1.0, 0.5], 3, "SCALAR");
    let attributes = json!({ "POSITION": 0, "JOINTS_0": 1, "WEIGHTS_0": 2 });
    let rest = json!({
        "meshes": [{ "name": "sheet", "weights": [0.25], "extras": { "targetNames": ["smile"] },
            "primitives": [{ "attributes": attributes, "mode": 5, "targets": [{ "POSITION": 4 }] }] }],
        "nodes": [
            { "name": "root", "translation": [1, 0, 0], "children": [1] },
            { "name": "tip", "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 2, 0, 0, 1] },
            { "name": "surface", "mesh": 0, "skin": 0 },
        ],
        "skins": [{ "joints": [0, 1], "inverseBindMatrices": 3 }],
        "animations": [{ "name": "nod",
            "channels": [
                { "sampler": 0, "target": { "node": 1, "path": "rotation" } },
                { "sampler": 1, "target": { "node": 2, "path": "weights" } },
                { "sampler": 0, "target": { "path": "pointer" } },
            ],
            "samplers": [{ "input": 5, "output": 6 }, { "input": 5, "output": 7, "interpolation": "STEP" }],
        }],
        "scenes": [{ "nodes": [0, 2] }],
    });
    for (key, value) in rest.as_object().expect("an object") {
        d.0[key] = value.clone();
    }
    d.0
}

fn decode(document: &Value) -> Result<Model, MeshError> {
    let limits = ReadLimits { max_bytes: 1 << 20, max_elements: 1 << 16, ..ReadLimits::default() };
    decode_model(document.to_string().as_bytes(), MeshFormat::Gltf, None, &limits, &Run::default())
}

fn changed(change: Change) -> Value {
    let mut document = moving();
    change(&mut document);
    document
}

#[test]
fn skins_targets_and_animations_are_read_as_they_stand() {
    let model = decode(&moving()).expect("valid");
    assert_eq!(model.warnings(), ["channels of animations that move nothing known are left out (1)"]);
    assert_eq!(model.mesh().positions()[3], nalgebra::Point3::new(1.0, 1.0, 0.0), "in the bind pose");
    let moving = model.articulation().expect("it moves");
    assert_eq!((moving.nodes.len(), moving.nodes[1].parent, &moving.roots), (3, Some(0), &vec![0, 2]));
    assert_eq!((&moving.skins[0].joints, moving.skins[0].inverse_binds[1][(0, 3)]), (&vec![0, 1], -3.0));
    let rows: Vec<Vec<_>> = (0..4).map(|v| moving.influences.row(v).collect()).collect();
    assert_eq!(rows[0], [(0, 0.5), (1, 0.5)]);
    assert_eq!(rows[2], [(1, 1.0)], "a joint that is named twice has both weights");
    assert_eq!(rows[3], [(0, 1.0)], "joints without weight do not count, whatever their number");
    let target = &moving.instances[0].targets[0];
    assert_eq!((target.name.as_deref(), target.weight, &target.vertices), (Some("smile"), 0.25, &vec![0, 3]));
    assert_eq!(target.offsets, [[0.0, 0.0, 1.0], [0.5, 0.0, 0.0]]);
    let [rotation, weight] = &moving.animations[0].channels[..] else { panic!("two channels") };
    assert_eq!(
        (rotation.property, rotation.interpolation, &rotation.times),
        (Property::Rotation, ChannelInterpolation::Linear, &vec![0.0, 0.5, 2.0])
    );
    assert_eq!(
        (weight.property, weight.interpolation, &weight.values),
        (Property::Weights, ChannelInterpolation::Step, &vec![0.0, 1.0, 0.5])
    );
}

#[test]
fn what_moves_is_written_as_it_was_read() {
    let model = decode(&moving()).expect("valid");
    for format in [MeshFormat::Gltf, MeshFormat::Glb] {
        let bytes = encode_model(&model, format, &WriteOptions::default(), &Run::default()).expect("valid");
        let again =
            decode_model(&bytes, format, None, &ReadLimits::default(), &Run::default()).expect("own files are read");
        assert_eq!(again.articulation(), model.articulation());
        assert_eq!(again.mesh(), model.mesh());
    }
    assert!(losses(&model, MeshFormat::Glb).is_empty());
    assert_eq!(losses(&model, MeshFormat::Obj), ["nodes, skins, morph targets and animations"]);
}

#[test]
fn meshes_without_a_skin_are_written_where_their_nodes_hold_them() {
    let model = decode(&changed(|d| {
        let surface = json!({ "name": "surface", "mesh": 0, "translation": [0, 5, 0], "scale": [-1, 1, 1] });
        d["nodes"][2] = surface;
    }))
    .expect("valid");
    assert_eq!(model.mesh().positions()[1], nalgebra::Point3::new(-1.0, 5.0, 0.0));
    let bytes = encode_model(&model, MeshFormat::Glb, &WriteOptions::default(), &Run::default()).expect("valid");
    let again = decode_model(&bytes, MeshFormat::Glb, None, &ReadLimits::default(), &Run::default())
        .expect("own files are read");
    assert_eq!((again.articulation(), again.mesh()), (model.articulation(), model.mesh()));
}

#[test]
fn a_moved_or_repaired_model_still_moves() {
    let model = decode(&moving()).expect("valid");
    let moved = model.with_positions(model.mesh().positions().iter().map(|p| p * 2.0).collect()).expect("finite");
    assert_eq!(moved.articulation(), model.articulation());
    let repaired = model
        .repaired(&repair(model.mesh(), &RepairOptions::default(), &Run::default()).expect("a run that never stops"));
    assert_eq!(repaired.articulation(), model.articulation());
    // Two instances that move in different ways and share an edge: joined, they can be moved as neither.
    let two = decode(&changed(|d| {
        d["nodes"].as_array_mut().expect("a list").push(json!({ "mesh": 0, "translation": [1, 0, 0] }));
        d["scenes"][0]["nodes"] = json!([0, 2, 3]);
    }))
    .expect("valid");
    let joined =
        two.repaired(&repair(two.mesh(), &RepairOptions::default(), &Run::default()).expect("a run that never stops"));
    assert_eq!(joined.articulation(), None);
    assert!(joined.warnings().iter().any(|w| w.contains("repair joined parts that move in different ways")));
}

#[test]
fn weights_are_scaled_to_a_sum_of_one_and_that_is_told() {
    let model = decode(&changed(|d| {
        let weights: Vec<u8> = [0.5_f32, 0.1, 0.0, 0.0].repeat(4).iter().flat_map(|x| x.to_le_bytes()).collect();
        let uri = format!("data:;base64,{}", STANDARD.encode(weights));
        d["buffers"][2] = json!({ "byteLength": 64, "uri": uri });
        d["buffers"][1]["uri"] = json!(format!("data:;base64,{}", STANDARD.encode([0, 1, 0, 0].repeat(4))));
    }))
    .expect("valid");
    assert!(
        model.warnings().contains(&"weights that do not sum to one are scaled so that they do (4 vertices)".to_owned())
    );
    let row: Vec<_> = model.articulation().expect("some").influences.row(2).collect();
    assert!((row[0].1 - 5.0 / 6.0).abs() < 1e-7 && (row[1].1 - 1.0 / 6.0).abs() < 1e-7);
}

#[test]
fn faults_are_told_with_place_value_and_range() {
    let cases: [(&str, Change); 17] = [
        ("/skins/0/joints: names node 7; there are only 3", |d| d["skins"][0]["joints"] = json!([0, 7])),
        ("/skins/0/joints: names node 0 twice", |d| d["skins"][0]["joints"] = json!([0, 0])),
        ("/skins/0/joints: is empty", |d| d["skins"][0]["joints"] = json!([])),
        ("/skins/0: has 3 joints, but only 2 matrices", |d| d["skins"][0]["joints"] = json!([0, 1, 2])),
        ("/accessors/3, item 0: is no affine matrix", |d| {
            d["buffers"][3]["uri"] = json!(format!("data:;base64,{}", STANDARD.encode([0xff; 128])));
        }),
        ("vertex 0 follows joint 1; skin 0 has 1", |d| d["skins"][0]["joints"] = json!([0])),
        ("there is no skin 4; there are 1", |d| d["nodes"][2]["skin"] = json!(4)),
        ("has only one of JOINTS_0 and WEIGHTS_0", |d| {
            d["meshes"][0]["primitives"][0]["attributes"] = json!({ "POSITION": 0, "JOINTS_0": 1 });
        }),
        ("JOINTS_0, WEIGHTS_0: 3, 4 values for 4 vertices", |d| d["accessors"][1]["count"] = json!(3)),
        ("/nodes/0: has two parents, or is its own ancestor", |d| d["nodes"][1]["children"] = json!([0])),
        ("/nodes/1/children: there is no node 9; there are 3", |d| d["nodes"][1]["children"] = json!([9])),
        ("/accessors/5, item 2: key time 0.5 s does not follow 2 s", |d| {
            let times: Vec<u8> = [0.0_f32, 2.0, 0.5].iter().flat_map(|x| x.to_le_bytes()).collect();
            d["buffers"][5]["uri"] = json!(format!("data:;base64,{}", STANDARD.encode(times)));
        }),
        ("/accessors/5, item 1: key time NaN is not finite", |d| {
            let times: Vec<u8> = [0.0_f32, f32::NAN, 0.5].iter().flat_map(|x| x.to_le_bytes()).collect();
            d["buffers"][5]["uri"] = json!(format!("data:;base64,{}", STANDARD.encode(times)));
        }),
        ("/animations/0/samplers/0: 3 keys need 36 numbers, and there are 12", |d| {
            d["animations"][0]["samplers"][0]["interpolation"] = json!("CUBICSPLINE");
        }),
        ("/animations/0/channels/0: there is no sampler 5; there are 2", |d| {
            d["animations"][0]["channels"][0]["sampler"] = json!(5);
        }),
        ("/animations/0/channels/1: a second channel for Rotation of node 1", |d| {
            d["animations"][0]["channels"][1] = json!({ "sampler": 0, "target": { "node": 1, "path": "rotation" } });
        }),
        ("/accessors/40: there is no accessor 40; there are 8", |d| d["skins"][0]["inverseBindMatrices"] = json!(40)),
    ];
    for (expected, change) in cases {
        let told = decode(&changed(change)).map(|_| ()).expect_err(expected).to_string();
        assert!(told.contains(expected), "{told:?} should say {expected:?}");
    }
}

#[test]
fn a_small_file_cannot_name_one_accessor_without_end() {
    let document = changed(|d| {
        let target = json!({ "POSITION": 4 });
        d["meshes"][0]["primitives"][0]["targets"] = Value::Array(vec![target; 400_000]);
        d["meshes"][0]["weights"] = Value::Null;
    });
    let told = decode(&document).expect_err("to be refused").to_string();
    assert!(told.contains("its values would take") || told.contains("is more than the limit of"), "{told}");
}
