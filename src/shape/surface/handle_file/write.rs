//! Handles as the text of a file.

use std::collections::BTreeMap;

use nalgebra::{Point3, Unit};
use serde_json::{Map, Value, json};

use super::track::{Interpolation, KeyRotation, RigidKey, Track};
use super::{KIND, MeshHandle, MeshHandles};

impl MeshHandles {
    /// The text of a file that gives these handles on the same mesh: vertices by index, rotations up to rounding, everything else
    /// exactly. A file needs at least one handle.
    ///
    /// ```
    /// use plumbline_shape::mesh::shapes;
    /// use plumbline_shape::surface::handle_file::{HandleFile, MeshHandle, MeshHandles, Track};
    ///
    /// let foot = MeshHandle { name: "foot".into(), vertices: vec![0, 3], weight: None, track: Track::Still };
    /// let handles = MeshHandles { handles: vec![foot], outside: vec![] };
    /// let file = HandleFile::parse(&handles.to_json())?;
    /// assert_eq!(file.of_mesh(shapes::bar([1, 1, 2], [1.0, 1.0, 2.0]).positions())?, handles);
    /// # Ok::<(), plumbline_shape::surface::handle_file::HandleFileError>(())
    /// ```
    pub fn to_json(&self) -> String {
        self.to_json_with_sets(&BTreeMap::new())
    }

    /// The same with named sets of vertices beside the handles: [`HandleFile::sets_of_mesh`](super::HandleFile::sets_of_mesh) reads them.
    pub fn to_json_with_sets(&self, sets: &BTreeMap<String, Vec<u32>>) -> String {
        let mut document = Map::new();
        document.insert("format".into(), KIND.format.into());
        document.insert("version".into(), 1.into());
        if !sets.is_empty() {
            let indices = |(name, vertices): (&String, &Vec<u32>)| (name.clone(), json!({ "indices": vertices }));
            document.insert("sets".into(), Value::Object(sets.iter().map(indices).collect()));
        }
        document.insert("handles".into(), self.handles.iter().map(entry).collect());
        if !self.outside.is_empty() {
            document.insert("region".into(), json!({ "not": { "indices": self.outside } }));
        }
        format!("{}\n", Value::Object(document))
    }
}

fn entry(handle: &MeshHandle) -> Value {
    let mut entry = Map::new();
    entry.insert("name".into(), handle.name.clone().into());
    entry.insert("vertices".into(), json!({ "indices": handle.vertices }));
    if let Some(weight) = handle.weight {
        entry.insert("weight".into(), weight.into());
    }
    match &handle.track {
        Track::Still => {}
        Track::Rigid { pivot, keys, interpolation } => {
            let keys: Vec<Value> = keys.iter().map(rigid_key).collect();
            let motion = json!({ "pivot": coordinates(pivot), "keys": keys, "interpolation": word(*interpolation) });
            entry.insert("rigid".into(), motion);
        }
        Track::Free { keys, interpolation } => {
            let key = |(time, targets): &(f64, Vec<Point3<f64>>)| {
                let targets: Vec<_> = targets.iter().map(coordinates).collect();
                json!({ "time": time, "positions": targets })
            };
            let keys: Vec<Value> = keys.iter().map(key).collect();
            entry.insert("positions".into(), json!({ "keys": keys, "interpolation": word(*interpolation) }));
        }
    }
    entry.into()
}

fn rigid_key(key: &RigidKey) -> Value {
    let mut entry = Map::new();
    entry.insert("time".into(), key.time.into());
    let rotation = match key.rotation {
        KeyRotation::AxisAngle(vector) => Unit::try_new_and_get(vector, 0.0)
            .map(|(axis, angle)| json!({ "axis": axis.as_slice(), "angle_deg": angle.to_degrees() })),
        KeyRotation::Quaternion(q) => Some(json!({ "quaternion": [q.w, q.i, q.j, q.k] })),
    };
    if let Some(rotation) = rotation {
        entry.insert("rotation".into(), rotation);
    }
    entry.insert("translation".into(), key.translation.as_slice().into());
    entry.into()
}

fn coordinates(p: &Point3<f64>) -> [f64; 3] {
    [p.x, p.y, p.z]
}

fn word(interpolation: Interpolation) -> &'static str {
    match interpolation {
        Interpolation::Linear => "linear",
        Interpolation::Smooth => "smooth",
    }
}
