use serde_json::json;

use super::*;
use crate::mesh::io::{WriteOptions, decode_model, encode_model};
use crate::mesh::shapes::{icosphere, plane};
use crate::mesh::{Group, Model};
use base64::Engine as _;
use plumbline_num::run::Run;

fn decode(bytes: &[u8], format: MeshFormat) -> Result<Model, MeshError> {
    decode_model(
        bytes,
        format,
        None,
        &ReadLimits { max_bytes: 1 << 20, max_elements: 1 << 16, ..ReadLimits::default() },
        &Run::default(),
    )
}

fn fault_of(document: &serde_json::Value) -> String {
    decode(document.to_string().as_bytes(), MeshFormat::Gltf).map(|_| ()).expect_err("to be refused").to_string()
}

/// A modification of a document.
type Change = fn(&mut serde_json::Value);

/// A square of four vertices as floats, two triangles as bytes; one node.
fn square() -> serde_json::Value {
    let mut buffer: Vec<u8> = Vec::new();
    for p in [[0.0_f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]] {
        buffer.extend(p.iter().flat_map(|x| x.to_le_bytes()));
    }
    buffer.extend([0_u8, 1, 2, 2, 1, 3]);
    let uri =
        format!("data:application/octet-stream;base64,{}", base64::engine::general_purpose::STANDARD.encode(&buffer));
    json!({
        "asset": { "version": "2.0" },
        "buffers": [{ "byteLength": buffer.len(), "uri": uri }],
        "bufferViews": [{ "buffer": 0, "byteLength": 48 }, { "buffer": 0, "byteOffset": 48, "byteLength": 6 }],
        "accessors": [
            { "bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3" },
            { "bufferView": 1, "componentType": 5121, "count": 6, "type": "SCALAR" },
        ],
        "meshes": [{ "name": "square", "primitives": [{ "attributes": { "POSITION": 0 }, "indices": 1 }] }],
        "nodes": [{ "mesh": 0 }],
        "scenes": [{ "nodes": [0] }],
    })
}

fn read_square(change: impl FnOnce(&mut serde_json::Value)) -> Model {
    let mut document = square();
    change(&mut document);
    decode(document.to_string().as_bytes(), MeshFormat::Gltf).expect("valid")
}

#[test]
fn triangles_strips_and_fans_are_read() {
    assert_eq!(read_square(|_| ()).mesh().triangles(), [[0, 1, 2], [2, 1, 3]]);
    let strip =
        read_square(|d| d["meshes"][0]["primitives"][0] = json!({ "attributes": { "POSITION": 0 }, "mode": 5 }));
    assert_eq!(strip.mesh().triangles(), [[0, 1, 2], [2, 1, 3]]);
    let fan = read_square(|d| d["meshes"][0]["primitives"][0] = json!({ "attributes": { "POSITION": 0 }, "mode": 6 }));
    assert_eq!(fan.mesh().triangles(), [[0, 1, 2], [0, 2, 3]]);
    let points = read_square(|d| d["meshes"][0]["primitives"][0]["mode"] = json!(0));
    assert_eq!(points.warnings(), ["primitives of points or lines are left out (1)"]);
}

#[test]
fn nodes_move_scale_and_mirror_what_they_hold() {
    let half = 0.5_f64.sqrt();
    let model = read_square(|d| {
        d["nodes"] = json!([
            { "children": [1], "translation": [10, 0, 0] },
            { "mesh": 0, "name": "leaf", "rotation": [0, 0, half, half], "scale": [2, 1, -1] },
        ]);
    });
    let expected = [[10.0, 0.0, 0.0], [10.0, 2.0, 0.0], [9.0, 0.0, 0.0], [9.0, 2.0, 0.0]];
    for (p, q) in model.mesh().positions().iter().zip(expected) {
        assert!((p - nalgebra::Point3::from(q)).norm() < 1e-12, "{p}");
    }
    assert_eq!(model.mesh().triangles()[0], [0, 2, 1], "a mirrored triangle is turned to keep its side");
    assert_eq!(model.groups().all, [Group { object: "leaf".into(), name: String::new() }]);
}

#[test]
fn sparse_values_take_their_places() {
    let model = read_square(|d| {
        let values: Vec<u8> = [7.0_f32, 8.0, 9.0].iter().flat_map(|x| x.to_le_bytes()).chain([2]).collect();
        let uri = format!("data:;base64,{}", base64::engine::general_purpose::STANDARD.encode(&values));
        d["buffers"].as_array_mut().expect("valid").push(json!({ "byteLength": 13, "uri": uri }));
        let views = d["bufferViews"].as_array_mut().expect("valid");
        views.extend([
            json!({ "buffer": 1, "byteLength": 12 }),
            json!({ "buffer": 1, "byteOffset": 12, "byteLength": 1 }),
        ]);
        d["accessors"][0]["sparse"] = json!({
            "count": 1, "indices": { "bufferView": 3, "componentType": 5121 }, "values": { "bufferView": 2 }
        });
    });
    assert_eq!(model.mesh().positions()[2], nalgebra::Point3::new(7.0, 8.0, 9.0));
    assert_eq!(model.mesh().positions()[3], nalgebra::Point3::new(1.0, 1.0, 0.0));
}

#[test]
fn what_is_written_reads_back_the_same() {
    let obj = "o left\nv 0 0 0 1 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvn 0 0 1\nusemtl a\nf 1/1/1 2/2/1 3/3/1\n\
               usemtl b\nf 1/2/1 3/1/1 4/1/1\no right\nv 5 0 0\nv 6 0 0\nv 5 1 0\nf 5/1/1 6/2/1 7/3/1\n";
    let model =
        crate::mesh::io::obj::read(obj.as_bytes(), &Run::default()).and_then(ModelBuilder::finish).expect("valid");
    for format in [MeshFormat::Gltf, MeshFormat::Glb] {
        let bytes = encode_model(&model, format, &WriteOptions::default(), &Run::default()).expect("valid");
        let again = decode(&bytes, format).expect("valid");
        assert_eq!(again.mesh().triangle_count(), 3);
        for t in 0..3 {
            assert_eq!(again.mesh().corners(t), model.mesh().corners(t), "triangle {t}");
            for k in 0..3 {
                let of = |m: &Model| m.triangle_corners()[t][k] as usize;
                assert_eq!(
                    again.texture().expect("valid").get(of(&again)),
                    model.texture().expect("valid").get(of(&model))
                );
                assert_eq!(
                    again.normals().expect("valid").get(of(&again)),
                    model.normals().expect("valid").get(of(&model))
                );
            }
            assert_eq!(again.materials().get(t).expect("valid").name, model.materials().get(t).expect("valid").name);
            assert_eq!(again.groups().get(t), model.groups().get(t));
        }
        assert_eq!(again.colors().expect("valid")[0], [1.0, 0.0, 0.0, 1.0]);
        // Corners 1/1 and 1/2 differ in their texture coordinate alone: a seam.
        assert_eq!(again.mesh().vertex_count(), 9);
    }
    let plain = Model::of_mesh(icosphere(1));
    let bytes = encode_model(&plain, MeshFormat::Glb, &WriteOptions::default(), &Run::default()).expect("valid");
    assert_eq!(decode(&bytes, MeshFormat::Glb).expect("valid").mesh().triangles(), plain.mesh().triangles());
}

#[test]
fn a_mesh_far_from_the_origin_keeps_its_digits() {
    let moved = plane(3).positions().iter().map(|p| p * 0.1 + nalgebra::Vector3::new(1e6, -3e6, 0.0)).collect();
    let model = Model::of_mesh(plane(3).with_positions(moved).expect("valid"));
    let bytes = encode_model(&model, MeshFormat::Glb, &WriteOptions::default(), &Run::default()).expect("valid");
    let again = decode(&bytes, MeshFormat::Glb).expect("valid");
    for (p, q) in again.mesh().positions().iter().zip(model.mesh().positions()) {
        assert!((p - q).norm() < 1e-7 * model.mesh().diagonal() + 1e-9, "{p} {q}");
    }
}

#[test]
fn materials_and_their_pictures_are_carried_along() {
    let model = read_square(|d| {
        d["materials"] = json!([{ "name": "skin", "extras": { "kept": 1 },
            "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } } }]);
        d["textures"] = json!([{ "source": 0 }]);
        d["images"] = json!([{ "bufferView": 1, "mimeType": "image/png" }]);
        d["meshes"][0]["primitives"][0]["material"] = json!(0);
    });
    let bytes = encode_model(&model, MeshFormat::Glb, &WriteOptions::default(), &Run::default()).expect("valid");
    let again = decode(&bytes, MeshFormat::Glb).expect("valid");
    assert_eq!((again.materials(), again.assets()), (model.materials(), model.assets()));
    assert_eq!(again.assets().expect("valid").image_bytes, [Some(vec![0, 1, 2, 2, 1, 3])]);
}

#[test]
fn faults_are_told_with_place_value_and_range() {
    let cases: [(&str, Change); 13] = [
        ("value /asset/version: \"1.0\"; only glTF 2 is read", |d| d["asset"]["version"] = json!("1.0")),
        ("value /extensionsRequired: KHR_draco_mesh_compression is not read", |d| {
            d["extensionsRequired"] = json!(["KHR_draco_mesh_compression"]);
        }),
        ("value /buffers/0/byteLength: 99 bytes are announced, but there are 54", |d| {
            d["buffers"][0]["byteLength"] = json!(99);
        }),
        ("value /bufferViews/1: 60 bytes from byte 48 go beyond the end of buffer 0 (54 bytes)", |d| {
            d["bufferViews"][1]["byteLength"] = json!(60);
        }),
        ("value /accessors/0: 5 items end at byte 60 of a buffer view of 48", |d| {
            d["accessors"][0]["count"] = json!(5);
        }),
        ("number of values of an accessor of 18446744073709551615 is more than the limit", |d| {
            d["accessors"][0]["count"] = json!(u64::MAX);
        }),
        ("value /accessors/0/componentType: 5130 is no type", |d| d["accessors"][0]["componentType"] = json!(5130)),
        ("value /accessors/0/type: \"VEC2\", where VEC3 is needed", |d| d["accessors"][0]["type"] = json!("VEC2")),
        ("value /accessors/7: there is no accessor 7; there are 2", |d| {
            d["meshes"][0]["primitives"][0]["indices"] = json!(7);
        }),
        ("value /nodes/0: has two parents, or is its own ancestor", |d| d["nodes"][0]["children"] = json!([0])),
        ("value /meshes/3: there is no mesh 3; there are 1", |d| d["nodes"][0]["mesh"] = json!(3)),
        ("\"../secret.bin\": other files are not opened here", |d| d["buffers"][0]["uri"] = json!("../secret.bin")),
        ("base64 that cannot be decoded", |d| d["buffers"][0]["uri"] = json!("data:;base64,!!")),
    ];
    for (told, change) in cases {
        let mut document = square();
        change(&mut document);
        let fault = fault_of(&document);
        assert!(fault.contains(told), "{fault}");
    }
    assert!(
        decode(b"glTF\x02\0\0\0\xff\0\0\0", MeshFormat::Glb)
            .expect_err("to be refused")
            .to_string()
            .contains("is cut short")
    );
    assert!(
        decode(b"{]", MeshFormat::Gltf).expect_err("to be refused").to_string().starts_with("glTF, line 1: not glTF")
    );
}

#[test]
fn no_address_leads_out_of_the_folder() {
    let outer = tempfile::tempdir().expect("valid");
    let inner = outer.path().join("inner");
    std::fs::create_dir(&inner).expect("valid");
    std::fs::write(outer.path().join("secret.bin"), [0; 54]).expect("valid");
    let inside: Vec<u8> = std::iter::repeat_n(0, 48).chain([0, 1, 2, 2, 1, 3]).collect();
    std::fs::write(inner.join("my data.bin"), inside).expect("valid");
    #[cfg(unix)]
    std::os::unix::fs::symlink(outer.path().join("secret.bin"), inner.join("link.bin")).expect("valid");
    let absolute = outer.path().join("secret.bin").display().to_string();
    let outside = ["../secret.bin", "%2e%2e/secret.bin", "..\\secret.bin", "file:///secret.bin", "link.bin", &absolute];
    for uri in outside.into_iter().chain(["my%20data.bin"]) {
        let mut document = square();
        document["buffers"][0]["uri"] = json!(uri);
        let read = decode_model(
            document.to_string().as_bytes(),
            MeshFormat::Gltf,
            Some(&inner),
            &ReadLimits::default(),
            &Run::default(),
        );
        match read {
            Ok(_) => assert_eq!(uri, "my%20data.bin"),
            Err(e) => {
                let refused = ["leads outside the folder of the file", "is no relative path of a file"];
                assert!(refused.iter().any(|why| e.to_string().contains(why)), "{uri}: {e}");
            }
        }
    }
}

#[test]
fn a_small_file_cannot_repeat_a_mesh_without_end() {
    let mut document = square();
    document["nodes"] = serde_json::Value::Array(vec![json!({ "mesh": 0 }); 20_000]);
    document["scenes"] = json!([{ "nodes": (0..20_000).collect::<Vec<_>>() }]);
    assert!(fault_of(&document).contains("is more than the limit of 65536"));
}

/// The square with its positions in a stream of an encoder, in a second buffer; the first one is a placeholder.
fn compressed_square() -> serde_json::Value {
    let stream = "oAAAAT8AAAD///8BPwAAAH59fgAAAQwAAAD/AQwAAAB+AAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAA";
    let length = base64::engine::general_purpose::STANDARD.decode(stream).expect("base64").len();
    let mut document = square();
    let indices = document["buffers"][0].clone();
    document["buffers"] = json!([
        { "byteLength": 48 },
        { "byteLength": length, "uri": format!("data:application/octet-stream;base64,{stream}") },
        indices,
    ]);
    document["bufferViews"][0]["extensions"] = json!({ "EXT_meshopt_compression": {
        "buffer": 1, "byteLength": length, "byteStride": 12, "count": 4, "mode": "ATTRIBUTES" } });
    document["bufferViews"][1]["buffer"] = json!(2);
    document["extensionsRequired"] = json!(["EXT_meshopt_compression"]);
    document
}

#[test]
fn compressed_views_are_read_in_place_of_their_placeholder() {
    let document = compressed_square();
    let model = decode(document.to_string().as_bytes(), MeshFormat::Gltf).expect("valid");
    assert_eq!(model.mesh().positions(), read_square(|_| ()).mesh().positions());
    assert_eq!(model.mesh().triangles(), [[0, 1, 2], [2, 1, 3]]);
}

#[test]
fn faults_of_compressed_views_are_named_with_their_place() {
    let changes: [(Change, &str); 5] = [
        (|d| d["bufferViews"][0]["extensions"]["EXT_meshopt_compression"]["count"] = json!(5), "in a view of 48"),
        (|d| d["bufferViews"][0]["extensions"]["EXT_meshopt_compression"]["buffer"] = json!(9), "there is no buffer 9"),
        (|d| d["bufferViews"][0]["extensions"]["EXT_meshopt_compression"]["byteOffset"] = json!(9), "beyond the end"),
        (|d| d["bufferViews"][0]["extensions"] = json!({}), "has no `uri`"),
        (
            |d| {
                let view = d["bufferViews"][0].clone();
                d["bufferViews"].as_array_mut().expect("a list").extend(vec![view; 9]);
            },
            "longer than all buffers",
        ),
    ];
    for (change, told) in changes {
        let mut document = compressed_square();
        change(&mut document);
        let fault = fault_of(&document);
        assert!(fault.contains(told) && fault.contains("/buffer"), "{fault}");
    }
}
