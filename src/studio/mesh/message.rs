//! Edits as a page sends them.

use serde::Deserialize;
use serde_json::Value;

use super::vertices::Combine;

/// How a handle moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, serde::Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[serde(rename_all = "snake_case")]
pub enum HandleKind {
    /// Not at all.
    Fixed,
    /// As a rigid body.
    Rigid,
    /// Each vertex by itself.
    Free,
}

/// A key of a handle.
#[derive(Clone, Copy, Debug, Deserialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[serde(deny_unknown_fields)]
pub struct KeyId {
    /// The handle.
    pub handle: usize,
    /// Its time.
    pub time: f64,
}

/// A change of the document.
#[derive(Debug, Deserialize)]
#[cfg_attr(test, derive(ts_rs::TS), ts(optional_fields = nullable))]
#[serde(tag = "do", rename_all = "snake_case", deny_unknown_fields)]
#[expect(missing_docs, reason = "fields are what they are named; what they do is said of the edit")]
pub enum Edit {
    /// Vertices that were clicked, brushed, in a lasso, typed. `stroke`: one step with those before, until it is sealed.
    Select {
        vertices: Vec<u32>,
        #[serde(default)]
        #[cfg_attr(test, ts(optional, as = "Option<Combine>"))]
        how: Combine,
        #[serde(default)]
        stroke: Option<bool>,
    },
    /// All vertices.
    SelectAll,
    /// No vertex.
    SelectNone,
    /// Those that are not selected.
    SelectInverse,
    /// What is connected to the selection.
    SelectConnected,
    /// So many rings more; less where negative.
    SelectRings { rings: i32 },
    /// One side of a plane.
    SelectHalfSpace {
        point: [f64; 3],
        normal: [f64; 3],
        #[serde(default)]
        #[cfg_attr(test, ts(optional, as = "Option<Combine>"))]
        how: Combine,
    },
    /// A named set.
    SelectSet {
        name: String,
        #[serde(default)]
        #[cfg_attr(test, ts(optional, as = "Option<Combine>"))]
        how: Combine,
    },
    /// The vertices of a handle.
    SelectHandle {
        handle: usize,
        #[serde(default)]
        #[cfg_attr(test, ts(optional, as = "Option<Combine>"))]
        how: Combine,
    },
    /// The selection under a name.
    NameSelection { name: String },
    /// Another name.
    RenameSet { from: String, to: String },
    /// The name is forgotten.
    DeleteSet { name: String },
    /// The selection becomes a handle; vertices of other handles are left out.
    AddHandle {
        kind: HandleKind,
        #[serde(default)]
        name: Option<String>,
    },
    /// The handle that is edited.
    Activate { handle: Option<usize> },
    /// Another name.
    RenameHandle { handle: usize, name: String },
    /// They are removed.
    DeleteHandles { handles: Vec<usize> },
    /// Another position in the list.
    ReorderHandle { handle: usize, to: usize },
    /// The selection becomes the vertices of the handle.
    SetVertices { handle: usize },
    /// How it moves.
    SetKind { handle: usize, kind: HandleKind },
    /// Weight of soft constraints; none for hard ones.
    SetWeight { handle: usize, weight: Option<f64> },
    /// Another center of rotation; the motion stays.
    SetPivot { handle: usize, pivot: [f64; 3] },
    /// A drag by hand, since it began: the key at `time` is set. Drags of one `gesture` are one step.
    Drag {
        handle: usize,
        gesture: u32,
        time: f64,
        translation: [f64; 3],
        /// `[w, x, y, z]`.
        rotation: [f64; 4],
        scale: [f64; 3],
    },
    /// Typed numbers: the motion from rest at a time.
    Place {
        handle: usize,
        time: f64,
        #[serde(default)]
        translation: Option<[f64; 3]>,
        /// Axis; the angle is beside it.
        #[serde(default)]
        axis: Option<[f64; 3]>,
        #[serde(default)]
        angle_deg: Option<f64>,
    },
    /// Back to rest at a time.
    Reset { handle: usize, time: f64 },
    /// A key that changes nothing.
    AddKey { handle: usize, time: f64 },
    /// Keys are removed.
    DeleteKeys { keys: Vec<KeyId> },
    /// Keys at other times. Moves of one `gesture` are one step, each by the whole way since it began.
    MoveKeys { keys: Vec<KeyId>, by: f64, gesture: u32 },
    /// Between the keys of a handle.
    SetInterpolation { handle: usize, smooth: bool },
    /// Vertices of the region of influence: inside, or outside, where they are fixed. `stroke` as for `select`.
    PaintRegion {
        vertices: Vec<u32>,
        inside: bool,
        #[serde(default)]
        stroke: Option<bool>,
    },
    /// The selection is the region.
    RegionFromSelection,
    /// All of the surface is the region.
    ClearRegion,
    /// A setting of the deformation; null leaves it to its default.
    SetOption {
        name: String,
        #[cfg_attr(test, ts(type = "unknown"))]
        value: Value,
    },
    /// Number of poses from the first key to the last; `seconds` for one file that moves.
    SetFrames {
        frames: u32,
        #[serde(default)]
        seconds: Option<f64>,
    },
    /// The file that `plumbline run` writes.
    SetOutput { name: String },
}
