//! What the page shows in its panels.

use nalgebra::Point3;
use serde::Serialize;

use super::document::MeshDocument;
use super::edit::kind_of;
use super::keys;
use super::message::HandleKind;
use super::overlay::Overlay;
use super::solver::Solver;
use plumbline_shape::mesh::Model;
use plumbline_shape::surface::handle_file::{Interpolation, Track};

/// State of the workspace.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct State {
    /// The mesh.
    pub mesh: MeshInfo,
    /// The handles, in the order of the file.
    pub handles: Vec<HandleState>,
    /// The handle that is edited.
    pub active: Option<usize>,
    /// The selected vertices.
    pub selection: SelectionState,
    /// Named sets: name and number of vertices.
    pub sets: Vec<SetState>,
    /// Vertices outside the region of influence.
    pub outside: usize,
    /// The time that is shown.
    pub time: f64,
    /// First and last key.
    pub times: [f64; 2],
    /// Settings of the deformation, by their names in the pipeline file.
    #[cfg_attr(test, ts(type = "Record<string, unknown>"))]
    pub options: serde_json::Value,
    /// Number of poses that are written.
    pub frames: u32,
    /// Poses that are solved.
    pub frames_ready: usize,
    /// Duration of one file that moves.
    pub seconds: Option<f64>,
    /// The file that `plumbline run` writes.
    pub output: Option<String>,
    /// The solve.
    pub solve: SolveState,
    /// Overlay and its highest value.
    pub overlay: OverlayState,
    /// Names of the pipeline file and of the file of handles.
    pub files: [String; 2],
}

/// The mesh.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct MeshInfo {
    /// Name of its file.
    pub name: String,
    /// Number of vertices of the file.
    pub vertices: usize,
    /// Number of triangles.
    pub triangles: usize,
    /// Diagonal of the bounding box.
    pub diagonal: f64,
    /// Origin of the positions in buffers.
    pub center: [f64; 3],
    /// What repair did for the solver; nothing of it is written.
    pub repair: Vec<String>,
    /// What the file has that was not read.
    pub warnings: Vec<String>,
    /// Number of connected components.
    pub components: usize,
}

/// A handle.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct HandleState {
    /// Its name.
    pub name: String,
    /// How it moves.
    pub kind: HandleKind,
    /// Number of its vertices.
    pub vertices: usize,
    /// Weight of soft constraints.
    pub weight: Option<f64>,
    /// Position of its gizmo at the time that is shown.
    pub position: [f64; 3],
    /// Orientation of its gizmo, `[w, x, y, z]`.
    pub rotation: [f64; 4],
    /// Center of rotation of a rigid handle.
    pub pivot: Option<[f64; 3]>,
    /// Translation from rest of a rigid handle.
    pub translation: Option<[f64; 3]>,
    /// Axis of its rotation from rest, of length 1.
    pub axis: Option<[f64; 3]>,
    /// Angle of its rotation from rest, degrees.
    pub angle_deg: Option<f64>,
    /// Times of its keys.
    pub keys: Vec<f64>,
    /// Zero velocity at the keys.
    pub smooth: bool,
}

/// Selected vertices.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct SelectionState {
    /// Their number.
    pub count: usize,
    /// The first of them.
    pub first: Vec<u32>,
    /// Their centroid, as they are shown.
    pub centroid: Option<[f64; 3]>,
}

/// A named set.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct SetState {
    /// Its name.
    pub name: String,
    /// Number of vertices.
    pub vertices: usize,
}

/// The solve.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct SolveState {
    /// What is computed: `prefactor`, `follow`, `settle`, `exact`, `frames`, `rest`.
    pub phase: &'static str,
    /// The surface that is shown is the one that `plumbline run` writes.
    pub exact: bool,
    /// Energy of the surface that is shown.
    pub energy: Option<f64>,
    /// Iterations of the last solve.
    pub iterations: Option<usize>,
    /// Why it ended.
    pub stop: Option<String>,
    /// Largest distance of a constrained vertex from its target.
    pub constraint_error: Option<f64>,
    /// Largest relative change of an edge length.
    pub worst_stretch: Option<f64>,
    /// Root mean square of the relative changes of all edge lengths.
    pub rms_stretch: Option<f64>,
    /// Faces that are inverted.
    pub flipped: Option<usize>,
    /// Volume over the rest volume.
    pub volume_ratio: Option<f64>,
    /// Edges with a negative weight.
    pub negative_weights: Option<usize>,
    /// Components without a handle, which stay.
    pub fixed_components: Option<usize>,
    /// Time of the last factorization, ms.
    pub prefactor_ms: Option<f64>,
    /// Time of the last slice that followed the handles, ms.
    pub follow_ms: Option<f64>,
    /// Why there is no solution.
    pub error: Option<String>,
}

/// The overlay.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct OverlayState {
    /// What colors mean.
    pub kind: Overlay,
    /// The highest color; the lowest is 0.
    pub high: f64,
}

/// Selected vertices that are listed.
const MAX_LISTED: usize = 200;

impl MeshInfo {
    /// Of a model and what repair did to it.
    pub fn new(name: &str, model: &Model, solver: &Solver, center: &Point3<f64>) -> Self {
        let mesh = model.mesh();
        Self {
            name: name.to_owned(),
            vertices: mesh.vertex_count(),
            triangles: mesh.triangle_count(),
            diagonal: mesh.diagonal(),
            center: (*center).into(),
            repair: solver.solvable.report.changes().collect(),
            warnings: model.warnings().to_vec(),
            components: solver.solvable.report.components.len(),
        }
    }
}

impl HandleState {
    /// Of the handle at a time.
    pub fn new(handle: &plumbline_shape::surface::handle_file::MeshHandle, rest: &[Point3<f64>], time: f64) -> Self {
        let (position, rotation) = keys::frame(handle, rest, time);
        let key = keys::rigid_key(&handle.track, time);
        let pivot = match &handle.track {
            Track::Rigid { pivot, .. } => Some((*pivot).into()),
            Track::Still | Track::Free { .. } => None,
        };
        let (axis, angle) = key.map(|k| axis_angle(k.rotation)).unzip();
        Self {
            name: handle.name.clone(),
            kind: kind_of(&handle.track),
            vertices: handle.vertices.len(),
            weight: handle.weight,
            position: position.into(),
            rotation: [rotation.w, rotation.i, rotation.j, rotation.k],
            pivot,
            translation: key.map(|k| k.translation.into()),
            axis,
            angle_deg: angle,
            keys: keys::times(&handle.track),
            smooth: keys::interpolation(&handle.track) == Interpolation::Smooth,
        }
    }
}

/// Axis and angle, degrees; the y axis without a rotation.
fn axis_angle(rotation: plumbline_shape::surface::handle_file::KeyRotation) -> ([f64; 3], f64) {
    use plumbline_shape::surface::handle_file::KeyRotation;
    let vector = match rotation {
        KeyRotation::AxisAngle(vector) => vector,
        KeyRotation::Quaternion(rotation) => rotation.scaled_axis(),
    };
    match vector.try_normalize(1e-12) {
        Some(axis) => (axis.into(), vector.norm().to_degrees()),
        None => ([0.0, 1.0, 0.0], 0.0),
    }
}

impl SelectionState {
    /// Of selected vertices as they are shown.
    pub fn new(document: &MeshDocument, solver: &Solver) -> Self {
        let selection = &document.selection;
        let at = |v: &u32| {
            let vertex = solver.solvable.vertex_of_source[*v as usize];
            vertex.map(|v| solver.shown()[v as usize])
        };
        let points: Vec<Point3<f64>> = selection.iter().filter_map(at).collect();
        let centroid = (!points.is_empty()).then(|| keys::centroid(points.iter().copied()).into());
        let first = selection.iter().copied().take(MAX_LISTED).collect();
        Self { count: selection.len(), first, centroid }
    }
}

impl SolveState {
    /// Of the solver.
    pub fn new(solver: &Solver) -> Self {
        let report = solver.report.as_ref();
        // While it follows a hand the distortion is not measured.
        let shape = report.filter(|_| solver.exact).map(|r| &r.shape);
        let ms = |time: Option<std::time::Duration>| time.map(|t| (t.as_secs_f64() * 1e4).round() / 10.0);
        Self {
            phase: solver.phase().name(),
            exact: solver.exact,
            energy: report.and_then(|r| r.energies.last().copied()),
            iterations: report.map(|r| r.iterations),
            stop: report.map(|r| r.stop.to_string()),
            constraint_error: report.map(|r| r.constraint_error),
            worst_stretch: shape.map(|s| s.worst_stretch),
            rms_stretch: shape.map(|s| s.rms_stretch),
            flipped: shape.map(|s| s.flipped_faces),
            volume_ratio: shape.and_then(|s| s.volume_ratio),
            negative_weights: report.map(|r| r.negative_weights),
            fixed_components: report.map(|r| r.fixed_components.len()),
            prefactor_ms: ms(solver.prefactored_in),
            follow_ms: ms(solver.followed_in),
            error: solver.error.clone(),
        }
    }
}
