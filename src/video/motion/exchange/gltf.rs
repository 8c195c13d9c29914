//! The cameras and points of a clip as a glTF 2.0 scene: one animated camera and one cloud of points per shot.
//!
//! glTF looks along −z with +y up, we along +z with +y down. With `D = diag(1, −1, −1)` a point `X` of ours is `D X` there, and a
//! camera at `c` with axes `R_wc` (camera to world) becomes
//!
//! ```text
//! translation = D c,      rotation = D R_wc D.
//! ```
//!
//! The projection is symmetric: `yfov = 2 atan(H / 2f)`, of the shot's first camera; glTF has no radial distortion. Each shot has
//! a node and unrelated coordinates of its own; the animation moves each camera during its shot, at the times of the frames
//! relative to the first frame of the clip.
//!
//! # Reference
//! Khronos Group, *glTF 2.0 specification*, sections 3.6 (binary data), 3.10 (cameras), 3.11 (animations).

use std::io::{self, Write};

use nalgebra::UnitQuaternion;
use serde_json::{Value, json};

use crate::motion::sfm::SfmVerdict;
use crate::motion::{ClipCameras, ClipMotion, FrameCamera};
use plumbline_camera::{CameraPose, Point3};
use plumbline_num::document::gltf::GltfBuffer;

/// How the scene is packed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Container {
    /// JSON with its numbers embedded in base64.
    Text,
    /// One binary file.
    Binary,
}

impl Container {
    /// `.glb` is binary, all else text.
    pub fn of(path: &std::path::Path) -> Self {
        let binary = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("glb"));
        if binary { Self::Binary } else { Self::Text }
    }
}

/// Mode of a primitive that is a cloud of points.
const POINTS: u32 = 0;
/// Distance of the near plane, in the unit of the shot; only viewers use it.
const Z_NEAR: f64 = 0.01;

/// Writes the scene of a clip; shots without cameras, or whose cameras failed, are not in it.
///
/// # Errors
/// Those of `out`.
pub fn write_gltf(motion: &ClipMotion, container: Container, mut out: impl Write) -> io::Result<()> {
    let mut scene = Scene::default();
    if let Some(cameras) = &motion.cameras {
        let has_cameras = |shot: &usize| cameras.shots[*shot].verdict != SfmVerdict::Failed;
        (0..cameras.shots.len()).filter(has_cameras).for_each(|shot| scene.push_shot(motion, cameras, shot));
    }
    scene.write(container == Container::Binary, &mut out)?;
    out.flush()
}

/// The parts of a document being built.
#[derive(Default)]
struct Scene {
    buffer: GltfBuffer,
    cameras: Vec<Value>,
    meshes: Vec<Value>,
    nodes: Vec<Value>,
    /// The nodes of the shots.
    roots: Vec<usize>,
    samplers: Vec<Value>,
    channels: Vec<Value>,
}

impl Scene {
    fn push_shot(&mut self, motion: &ClipMotion, cameras: &ClipCameras, shot: usize) {
        let start = motion.frames.first().map_or(0.0, |f| motion.timebase.seconds(f.pts));
        let time = |k: usize| (motion.timebase.seconds(motion.frames[k].pts) - start) as f32;
        let frames = cameras.shots[shot].frames.clone();
        let known = |k: usize| Some((time(k), cameras.frames.get(k).copied().flatten()?));
        let keys: Vec<(f32, FrameCamera)> = frames.filter_map(known).collect();
        let Some((_, first)) = keys.first() else { return };
        let mut children = vec![self.push_camera(motion, shot, first)];
        self.animate(children[0], &keys);
        let points: Vec<[f32; 3]> =
            cameras.points.iter().filter(|p| p.shot as usize == shot).map(|p| flipped(&p.position)).collect();
        if !points.is_empty() {
            children.push(self.push_points(shot, &points));
        }
        self.roots.push(self.nodes.len());
        self.nodes.push(json!({ "name": format!("shot {shot}"), "children": children }));
    }

    /// The node of a camera with its first pose.
    fn push_camera(&mut self, motion: &ClipMotion, shot: usize, first: &FrameCamera) -> usize {
        let (width, height) = (f64::from(motion.width), f64::from(motion.height));
        let yfov = 2.0 * (0.5 * height / first.intrinsics.focal).atan();
        let perspective = json!({ "yfov": yfov, "aspectRatio": width / height, "znear": Z_NEAR });
        self.cameras.push(json!({ "type": "perspective", "perspective": perspective }));
        let (translation, rotation) = node_pose(&first.pose);
        self.nodes.push(json!({
            "name": format!("camera {shot}"),
            "camera": self.cameras.len() - 1,
            "translation": translation,
            "rotation": rotation,
        }));
        self.nodes.len() - 1
    }

    fn push_points(&mut self, shot: usize, points: &[[f32; 3]]) -> usize {
        let position = self.buffer.bounded(points, "VEC3", None);
        let primitive = json!({ "attributes": { "POSITION": position }, "mode": POINTS });
        self.meshes.push(json!({ "name": format!("points {shot}"), "primitives": [primitive] }));
        self.nodes.push(json!({ "name": format!("points {shot}"), "mesh": self.meshes.len() - 1 }));
        self.nodes.len() - 1
    }

    /// Animates a node with the poses of `keys`.
    fn animate(&mut self, node: usize, keys: &[(f32, FrameCamera)]) {
        let times: Vec<[f32; 1]> = keys.iter().map(|(time, _)| [*time]).collect();
        let (translations, mut rotations): (Vec<[f32; 3]>, Vec<[f32; 4]>) =
            keys.iter().map(|(_, camera)| node_pose(&camera.pose)).unzip();
        unify_signs(&mut rotations);
        let input = self.buffer.bounded(&times, "SCALAR", None);
        for (path, output) in [
            ("translation", self.buffer.floats(&translations, "VEC3", None)),
            ("rotation", self.buffer.floats(&rotations, "VEC4", None)),
        ] {
            self.samplers.push(json!({ "input": input, "output": output, "interpolation": "LINEAR" }));
            let target = json!({ "node": node, "path": path });
            self.channels.push(json!({ "sampler": self.samplers.len() - 1, "target": target }));
        }
    }

    fn write(self, binary: bool, out: &mut impl Write) -> io::Result<()> {
        let mut scene = json!({ "name": "clip" });
        let mut animations = vec![];
        if !self.roots.is_empty() {
            scene["nodes"] = json!(self.roots);
            animations.push(json!({ "name": "clip", "samplers": self.samplers, "channels": self.channels }));
        }
        let document = [
            ("asset", json!({ "version": "2.0", "generator": concat!("plumbline ", env!("CARGO_PKG_VERSION")) })),
            ("scene", json!(0)),
            ("scenes", json!([scene])),
            ("animations", Value::Array(animations)),
            ("cameras", Value::Array(self.cameras)),
            ("meshes", Value::Array(self.meshes)),
            ("nodes", Value::Array(self.nodes)),
        ];
        let document = document.into_iter().map(|(name, value)| (name.to_owned(), value));
        self.buffer.write(document.collect(), binary, out)
    }
}

/// `D x`.
fn flipped(x: &Point3) -> [f32; 3] {
    [x.x as f32, -x.y as f32, -x.z as f32]
}

/// Translation and rotation `[x, y, z, w]` of a camera's node.
fn node_pose(pose: &CameraPose) -> ([f32; 3], [f32; 4]) {
    // D is the rotation by π about x, the quaternion i; i q i⁻¹ negates y and z.
    let q: UnitQuaternion<f64> = pose.rotation.inverse();
    (flipped(&pose.center()), [q.i as f32, -q.j as f32, -q.k as f32, q.w as f32])
}

/// Chooses between `q` and `−q`, which are the same rotation, so that neighbors are in one hemisphere.
fn unify_signs(rotations: &mut [[f32; 4]]) {
    for k in 1..rotations.len() {
        let dot: f32 = (0..4).map(|i| rotations[k - 1][i] * rotations[k][i]).sum();
        if dot < 0.0 {
            rotations[k] = rotations[k].map(|v| -v);
        }
    }
}

#[cfg(test)]
mod tests {
    use base64::Engine as _;
    use base64::engine::general_purpose::STANDARD;

    use super::*;
    use crate::motion::exchange::tests::walk;
    use nalgebra::{Quaternion, Vector3};

    fn floats(document: &Value, buffer: &[u8], accessor: usize) -> Vec<f32> {
        let accessor = &document["accessors"][accessor];
        let view = &document["bufferViews"][accessor["bufferView"].as_u64().expect("a view") as usize];
        let (at, length) = (view["byteOffset"].as_u64().expect("at"), view["byteLength"].as_u64().expect("length"));
        let bytes = &buffer[at as usize..(at + length) as usize];
        bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect()
    }

    fn text() -> (Value, Vec<u8>) {
        let mut bytes = Vec::new();
        write_gltf(&walk().0, Container::Text, &mut bytes).expect("memory");
        let document: Value = serde_json::from_slice(&bytes).expect("JSON");
        let uri = document["buffers"][0]["uri"].as_str().expect("embedded");
        let buffer = STANDARD.decode(uri.rsplit(',').next().expect("data")).expect("base64");
        (document, buffer)
    }

    #[test]
    fn a_point_ahead_of_our_camera_is_ahead_of_the_camera_of_the_scene() {
        let (motion, _) = walk();
        let (document, buffer) = text();
        let sampler = |path: &str| {
            let channels = document["animations"][0]["channels"].as_array().expect("channels");
            let channel = channels.iter().find(|c| c["target"]["path"] == path).expect("a channel");
            &document["animations"][0]["samplers"][channel["sampler"].as_u64().expect("a sampler") as usize]
        };
        let output = |path| floats(&document, &buffer, sampler(path)["output"].as_u64().expect("output") as usize);
        let (translations, rotations) = (output("translation"), output("rotation"));
        let position = document["meshes"][0]["primitives"][0]["attributes"]["POSITION"].as_u64().expect("points");
        let points = floats(&document, &buffer, position as usize);
        let cameras = motion.cameras.as_ref().expect("cameras");
        let known: Vec<_> = cameras.frames.iter().flatten().collect();
        assert_eq!(
            (translations.len(), rotations.len(), points.len()),
            (3 * known.len(), 4 * known.len(), 3 * cameras.points.len())
        );
        for (k, camera) in known.iter().enumerate() {
            let q = Quaternion::new(rotations[4 * k + 3], rotations[4 * k], rotations[4 * k + 1], rotations[4 * k + 2]);
            let node = UnitQuaternion::new_normalize(q);
            let at = Vector3::new(translations[3 * k], translations[3 * k + 1], translations[3 * k + 2]);
            for (i, point) in cameras.points.iter().enumerate() {
                let theirs = node.inverse() * (Vector3::new(points[3 * i], points[3 * i + 1], points[3 * i + 2]) - at);
                let ours = camera.pose.apply(&point.position);
                let expected = Vector3::new(ours.x as f32, -ours.y as f32, -ours.z as f32);
                assert!((theirs - expected).norm() < 1e-4, "camera {k}, point {i}");
            }
        }
    }

    #[test]
    fn neighboring_quaternions_are_in_one_hemisphere() {
        let mut rotations =
            [[0.1, 0.0, 0.0, 0.9], [-0.1, 0.0, 0.0, -0.9], [-0.2, 0.0, 0.0, -0.8], [0.3, 0.0, 0.0, 0.7]];
        unify_signs(&mut rotations);
        assert_eq!(rotations, [[0.1, 0.0, 0.0, 0.9], [0.1, 0.0, 0.0, 0.9], [0.2, 0.0, 0.0, 0.8], [0.3, 0.0, 0.0, 0.7]]);
    }

    #[test]
    fn the_field_of_view_and_the_times_are_the_clips() {
        let (motion, _) = walk();
        let (document, buffer) = text();
        let perspective = &document["cameras"][0]["perspective"];
        let focal = motion.cameras.as_ref().expect("cameras").frames[0].expect("a camera").intrinsics.focal;
        let yfov = perspective["yfov"].as_f64().expect("an angle");
        assert!(((0.5 * yfov).tan() - 0.5 * f64::from(motion.height) / focal).abs() < 1e-12);
        assert_eq!(perspective["aspectRatio"], f64::from(motion.width) / f64::from(motion.height));
        let input = document["animations"][0]["samplers"][0]["input"].as_u64().expect("input") as usize;
        let times = floats(&document, &buffer, input);
        let expected: Vec<f32> = [0, 1, 2, 3, 5].iter().map(|k| *k as f32 * 0.04).collect();
        assert!(times.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-6) && times.len() == 5, "{times:?}");
        let accessor = &document["accessors"][input];
        assert_eq!((accessor["min"][0].as_f64(), accessor["max"][0].as_f64()), (Some(0.0), Some(f64::from(times[4]))));
    }

    #[test]
    fn the_binary_container_has_the_same_content_aligned_to_words() {
        let mut bytes = Vec::new();
        write_gltf(&walk().0, Container::Binary, &mut bytes).expect("memory");
        let word = |at: usize| u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]) as usize;
        assert_eq!((&bytes[..4], word(4), word(8)), (&b"glTF"[..], 2, bytes.len()));
        let length = word(12);
        assert_eq!((&bytes[16..20], length % 4), (&b"JSON"[..], 0));
        let document: Value = serde_json::from_slice(&bytes[20..20 + length]).expect("JSON");
        let (expected, buffer) = text();
        assert_eq!(document["accessors"], expected["accessors"]);
        let at = 20 + length;
        assert_eq!((word(at), &bytes[at + 4..at + 8], &bytes[at + 8..]), (buffer.len(), &b"BIN\0"[..], &buffer[..]));
        assert!(document["buffers"][0].get("uri").is_none());
    }

    #[test]
    fn a_clip_without_cameras_is_an_empty_scene() {
        let (known, _) = walk();
        let mut failed = known.clone();
        failed.cameras.as_mut().expect("cameras").shots[0].verdict = SfmVerdict::Failed;
        for motion in [ClipMotion { cameras: None, ..known }, failed] {
            let mut bytes = Vec::new();
            write_gltf(&motion, Container::Text, &mut bytes).expect("memory");
            let document: Value = serde_json::from_slice(&bytes).expect("JSON");
            assert!(document.get("nodes").is_none() && document.get("buffers").is_none());
            assert_eq!(document["scenes"][0].get("nodes"), None);
        }
    }
}
