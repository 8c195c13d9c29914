//! Messages of the character workspace. Points are those of the model, quaternions are `[x, y, z, w]`, angles rad, joints indices.

use serde::{Deserialize, Serialize};

use plumbline_shape::character::skinning::SkinningMethod as Method;
use plumbline_shape::character::weights as library;

/// A point or a direction.
pub type V3 = [f64; 3];
/// A rotation, `[x, y, z, w]`.
pub type Q4 = [f64; 4];

/// What a brush does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[serde(rename_all = "snake_case")]
pub enum BrushOp {
    /// Raises the weight.
    Add,
    /// Lowers it.
    Subtract,
    /// Draws all weights toward those of the neighbors.
    Smooth,
    /// Draws the weight toward a value.
    Replace,
}

/// How weights are computed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[serde(rename_all = "snake_case")]
pub enum WeightMethod {
    /// Bone heat.
    #[default]
    Heat,
    /// Bounded biharmonic weights.
    Biharmonic,
    /// Distance to the bones.
    Distance,
}

impl From<WeightMethod> for library::WeightMethod {
    fn from(method: WeightMethod) -> Self {
        match method {
            WeightMethod::Heat => Self::Heat,
            WeightMethod::Biharmonic => Self::BoundedBiharmonic,
            WeightMethod::Distance => Self::Distance,
        }
    }
}

/// How the surface follows the joints.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[serde(rename_all = "kebab-case")]
pub enum SkinningMethod {
    /// Linear blend.
    Linear,
    /// Dual quaternions.
    DualQuaternion,
    /// Centers of rotation.
    Centers,
    /// Dual quaternions for twists, linear blend for swings.
    Mixed,
    /// As a trained model says; shown where the document has one.
    Regression,
}

/// All methods without a trained model, in the order of the page.
pub const METHODS: [(SkinningMethod, Method); 4] = [
    (SkinningMethod::Linear, Method::LinearBlend),
    (SkinningMethod::DualQuaternion, Method::DualQuaternion),
    (SkinningMethod::Centers, Method::CentersOfRotation),
    (SkinningMethod::Mixed, Method::TwistSwing),
];

/// How keys are joined.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[serde(rename_all = "snake_case")]
pub enum InterpolationKind {
    /// The key before.
    Step,
    /// Slerp.
    Linear,
    /// A quaternion spline through the keys.
    Spline,
}

/// Options of the extraction.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[serde(deny_unknown_fields)]
pub struct ExtractionOptions {
    /// Weight of the contraction.
    pub contraction: f64,
    /// Weight of the last positions.
    pub attraction: f64,
    /// Weight of the medial axis.
    pub medial: f64,
    /// Branches shorter than so many local radii are pruned.
    pub prune: f64,
    /// Largest number of iterations.
    pub iterations: u32,
}

/// Ends of the curve that stay: those of the tips (`"extrema"`), or vertices.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[serde(untagged)]
pub enum Ends {
    /// `"extrema"`.
    Word(EndsWord),
    /// Vertices of the mesh.
    Vertices(Vec<u32>),
}

/// The tips of the surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[serde(rename_all = "snake_case")]
pub enum EndsWord {
    /// Found by geodesic distance.
    Extrema,
}

/// Limits of a joint, in its frame at rest.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[serde(deny_unknown_fields)]
pub struct Limits {
    /// Axis of the twist.
    pub axis: V3,
    /// First axis of the swing.
    pub across: V3,
    /// Largest swing about both axes.
    pub swing: [f64; 2],
    /// Smallest and largest twist.
    pub twist: [f64; 2],
}

/// Kinds of targets.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[serde(rename_all = "snake_case")]
pub enum TargetKind {
    /// The joint stays at a position.
    Position,
    /// The joint keeps its rotation.
    Orientation,
    /// The joint looks at a point.
    LookAt,
    /// The two bones above the joint bend toward a point.
    Pole,
}

/// A target of inverse kinematics.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[serde(deny_unknown_fields)]
pub struct Target {
    /// The joint.
    pub joint: u32,
    /// What it does.
    pub kind: TargetKind,
    /// The point; not used for an orientation.
    pub at: V3,
    /// Weight relative to the others.
    pub weight: f64,
}

/// A change of the document.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[cfg_attr(test, derive(ts_rs::TS), ts(optional_fields))]
#[serde(tag = "do", rename_all = "snake_case", deny_unknown_fields)]
#[expect(missing_docs, reason = "fields are what they are named; what they do is said of the edit")]
pub enum Edit {
    /// The skeleton that the extraction finds.
    Extract {
        options: ExtractionOptions,
        #[cfg_attr(test, ts(optional = nullable))]
        joints: Option<u32>,
        #[cfg_attr(test, ts(optional = nullable))]
        ends: Option<Ends>,
    },
    /// The skeleton of a template, fitted to the surface.
    Template { name: String },
    /// The skeleton of a file, fitted to the surface.
    TemplateFile { path: String },
    /// A joint in the middle of the volume that a ray enters.
    AddAlong {
        origin: V3,
        direction: V3,
        #[cfg_attr(test, ts(optional = nullable))]
        parent: Option<u32>,
    },
    /// A joint at a point.
    Add {
        at: V3,
        #[cfg_attr(test, ts(optional = nullable))]
        parent: Option<u32>,
        #[cfg_attr(test, ts(optional = nullable))]
        name: Option<String>,
    },
    /// A child with the frame of its parent.
    Extrude {
        joint: u32,
        at: V3,
        #[cfg_attr(test, ts(optional = nullable))]
        name: Option<String>,
    },
    /// A joint on the bone above.
    Split { joint: u32, fraction: f64 },
    /// Joints go, their children stay.
    Dissolve { joints: Vec<u32> },
    /// Joints go with all below.
    Remove { joints: Vec<u32> },
    /// Another parent; none makes a root.
    Reparent {
        joints: Vec<u32>,
        #[cfg_attr(test, ts(optional = nullable))]
        parent: Option<u32>,
    },
    /// Another name.
    Rename { joint: u32, name: String },
    /// The other side of a joint and all below.
    Mirror { joint: u32 },
    /// A joint moves at rest.
    Move { joint: u32, to: V3, with_children: bool },
    /// The frame of a joint rotates about its bone.
    Roll { joint: u32, angle: f64 },
    /// Limits of a joint.
    Limit {
        joint: u32,
        #[cfg_attr(test, ts(optional = nullable))]
        limits: Option<Limits>,
    },
    /// Weights are computed.
    ComputeWeights { method: WeightMethod, influences: u32, smooth: u32 },
    /// A touch of the brush.
    Paint { joint: u32, op: BrushOp, center: V3, radius: f64, strength: f64, value: f64, mirror: bool },
    /// Largest number of joints per vertex.
    Influences { max: u32 },
    /// The rotation of a joint from rest.
    Rotate { joint: u32, rotation: Q4 },
    /// A point of a joint's frame is dragged to a point of the model.
    Drag { joint: u32, point: V3, to: V3 },
    /// The translation of a joint from rest.
    Translate { joint: u32, translation: V3 },
    /// Pins a joint where it is, or lets it go.
    Pin { joint: u32, orientation: bool },
    /// Joints that inverse kinematics does not rotate, or rotates again.
    Lock { joints: Vec<u32>, locked: bool },
    /// Another target.
    AddTarget { target: Target },
    /// A target changes.
    SetTarget { index: usize, target: Target },
    /// A target goes.
    RemoveTarget { index: usize },
    /// Joints, or all, are at rest.
    ResetPose {
        #[cfg_attr(test, ts(optional = nullable))]
        joints: Option<Vec<u32>>,
    },
    /// Left and right of the pose are exchanged.
    MirrorPose,
    /// The pose of the text of a pose file, for some joints or all.
    PastePose {
        text: String,
        mirrored: bool,
        #[cfg_attr(test, ts(optional = nullable))]
        joints: Option<Vec<u32>>,
    },
    /// The pose of the clip that is shown becomes that of the document.
    TakePose,
    /// The pose stays as it is without its targets.
    BakePose,
    /// The pose goes into the library.
    StorePose { name: String },
    /// A pose of the library.
    ApplyPose { name: String },
    /// A pose of the library goes.
    RemovePose { name: String },
    /// How the surface follows.
    Skinning { method: SkinningMethod },
    /// A clip without keys.
    AddClip { name: String },
    /// Another name for the clip that is chosen.
    RenameClip { name: String },
    /// A clip goes.
    RemoveClip { name: String },
    /// The clip that is shown.
    SelectClip { name: String },
    /// The pose that is shown becomes keys.
    Key { joints: Vec<u32>, time: f64 },
    /// What is not keyed at a time becomes keys.
    KeyUnkeyed { time: f64 },
    /// What is not keyed at a time goes.
    DiscardUnkeyed { time: f64 },
    /// A run of the saved file writes so many poses of the clip that is shown; none: the pose of the document.
    RunWrites {
        #[cfg_attr(test, ts(optional = nullable))]
        frames: Option<u32>,
    },
    /// One key, as a rotation from rest.
    SetKey { joint: u32, time: f64, rotation: Q4 },
    /// Keys (joint, time) move in time.
    MoveKeys { keys: Vec<(u32, f64)>, by: f64 },
    /// Keys (joint, time) go.
    RemoveKeys { keys: Vec<(u32, f64)> },
    /// How the keys of joints, or of all, are joined.
    Interpolation { joints: Vec<u32>, kind: InterpolationKind },
    /// Skeleton and movements of a file, weights, or a trained skin.
    Import { path: String },
}

/// The panel that is open.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[serde(rename_all = "snake_case")]
pub enum Tab {
    /// Joints at rest.
    #[default]
    Skeleton,
    /// Weights.
    Weights,
    /// The pose.
    Pose,
    /// The clip.
    Animate,
    /// Skinning methods side by side.
    Compare,
}

/// What the windows look at; what is left out stays.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[cfg_attr(test, derive(ts_rs::TS), ts(optional_fields))]
#[serde(default, deny_unknown_fields)]
pub struct View {
    /// The open panel.
    pub tab: Option<Tab>,
    /// The joint whose weights are shown.
    #[cfg_attr(test, ts(optional = nullable))]
    pub joint: Option<u32>,
    /// Time in the clip, s.
    pub time: Option<f64>,
    /// Poses before and after, and how far apart they are, s; 0 of them: none.
    pub onion: Option<(u32, f64)>,
}

/// Formats of an export.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[serde(rename_all = "snake_case")]
pub enum Format {
    /// The character with skeleton, skin and clips, in the pose.
    Glb,
    /// Skeleton and clip.
    Bvh,
    /// The surface in the pose.
    Obj,
}

/// A question.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[serde(tag = "ask", rename_all = "snake_case", deny_unknown_fields)]
pub enum Ask {
    /// A file of the character.
    Export {
        /// Its format.
        format: Format,
    },
    /// The surface in the poses of the clip that is shown, so many each second, as OBJ files in one archive.
    ExportFrames {
        /// Frames per second.
        rate: f64,
    },
    /// The pose that is shown, as the text of a pose file.
    CopyPose,
    /// The command line that does the same as the saved document.
    Command,
}

/// The mesh.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[expect(missing_docs, reason = "named by what they are")]
pub struct MeshState {
    pub vertices: usize,
    pub triangles: usize,
    pub diagonal: f64,
    pub center: V3,
    pub up: &'static str,
}

/// A joint.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[expect(missing_docs, reason = "named by what they are")]
pub struct JointState {
    pub name: String,
    pub parent: Option<u32>,
    pub limits: Option<Limits>,
    pub locked: bool,
}

/// Keys of a joint: rotations from rest.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[expect(missing_docs, reason = "named by what they are")]
pub struct Track {
    pub joint: u32,
    pub times: Vec<f64>,
    pub rotations: Vec<Q4>,
    pub interpolation: InterpolationKind,
}

/// The last extraction.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[expect(missing_docs, reason = "named by what they are")]
pub struct ExtractionState {
    pub options: ExtractionOptions,
    pub joints: Option<u32>,
    pub ends: Option<Ends>,
    /// The fraction that is done of an extraction that runs.
    pub running: Option<f64>,
    #[cfg_attr(test, ts(type = "Record<string, number> | null"))]
    pub report: Option<std::collections::BTreeMap<&'static str, usize>>,
}

/// How weights were found.
#[derive(Clone, Copy, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[expect(missing_docs, reason = "named by what they are")]
pub struct WeightsState {
    pub method: WeightMethod,
    pub influences: u32,
    pub smooth: u32,
    /// Whether they were painted or read: other than computed.
    pub painted: u32,
    /// The fraction that is done of a computation that runs.
    pub running: Option<f64>,
}

/// A skinning method, measured in the pose.
#[derive(Clone, Copy, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[expect(missing_docs, reason = "named by what they are")]
pub struct Compared {
    pub method: SkinningMethod,
    /// Volume over that at rest; 1 where the surface is open.
    pub volume: f64,
    /// Root mean square of relative changes of edge lengths.
    pub stretch: f64,
}

/// The trained skin.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[expect(missing_docs, reason = "named by what they are")]
pub struct ModelState {
    pub name: String,
    /// Why it does not fit the mesh and the skeleton; none where it does.
    pub fault: Option<String>,
}

/// A pose at a time of the clip that is not keyed.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[expect(missing_docs, reason = "named by what they are")]
pub struct UnkeyedState {
    pub time: f64,
    pub joints: Vec<String>,
}

/// What a run of the saved file writes.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[expect(missing_docs, reason = "named by what they are")]
pub struct RunState {
    /// The clip; none: the pose.
    pub clip: Option<String>,
    pub frames: u32,
}

/// What the panels show.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[expect(missing_docs, reason = "named by what they are")]
pub struct State {
    pub name: String,
    pub mesh: MeshState,
    pub joints: Vec<JointState>,
    pub templates: Vec<&'static str>,
    pub extraction: ExtractionState,
    pub weights: WeightsState,
    pub skinning: SkinningMethod,
    pub targets: Vec<Target>,
    pub poses: Vec<String>,
    pub clips: Vec<String>,
    pub clip: Option<String>,
    pub duration: f64,
    pub tracks: Vec<Track>,
    pub unkeyed: Vec<UnkeyedState>,
    pub run: RunState,
    pub model: Option<ModelState>,
    pub compare: Vec<Compared>,
}

/// Kinds of buffers. Positions are relative to the center of the mesh; frames are `world_from_joint`, 16 `f32` column by column.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[repr(u32)]
pub enum BufferKind {
    /// Three `u32` per triangle.
    Triangles = 200,
    /// Three `f32` per vertex at rest.
    Rest = 201,
    /// Four `u16` per vertex: joints of the largest weights.
    SkinJoints = 202,
    /// Four `f32` per vertex: their weights.
    SkinWeights = 203,
    /// Frames at rest.
    RestFrames = 204,
    /// Frames of the pose.
    PosedFrames = 205,
    /// One `f32` per vertex: the weight of the joint that is shown; empty without one.
    Heat = 206,
    /// Three `f32` per vertex in the pose; empty for linear blend, which the page does.
    Positions = 207,
    /// Frames of a pose before or after.
    Onion = 208,
    /// Three `f32` per vertex of a skinning method, the item.
    Compared = 209,
}

impl BufferKind {
    /// Its number in the header of a buffer.
    pub fn number(self) -> u32 {
        self as u32
    }
}
