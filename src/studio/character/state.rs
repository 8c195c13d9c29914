//! What the panels show.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::CharacterWorkspace;
use super::document::{CharacterDocument, ClipDocument, NamedTarget, SkeletonSource, WeightSource};
use super::edit::{from_rest, model_fault};
use super::message::{
    ExtractionState, InterpolationKind, JointState, Limits, MeshState, ModelState, RunState, State, Target, TargetKind,
    Track, UnkeyedState, WeightMethod, WeightsState,
};
use super::rig::TEMPLATES;
use plumbline_shape::character::ik::Goal;
use plumbline_shape::character::weights::WeightMethod as Library;
use plumbline_shape::character::{Curve, Interpolation, Skeleton};

/// Most keys that a panel is sent: a recorded motion has more, and is shown without them.
const MAX_KEYS: usize = 20_000;

impl CharacterWorkspace {
    pub(super) fn state_of(&self, document: &CharacterDocument) -> State {
        let skeleton = self.rigs.skeleton(&document.skeleton);
        let clip = document.shown_clip();
        let last =
            clip.iter().flat_map(|c| &c.curves).filter_map(|c| c.curve.times().last().copied()).fold(0.0, f64::max);
        State {
            name: self.name.clone(),
            mesh: self.mesh_state(),
            joints: skeleton.as_deref().map(|s| joints(s, &document.pose.locked)).unwrap_or_default(),
            templates: TEMPLATES.to_vec(),
            extraction: self.extraction_state(document),
            weights: WeightsState { running: self.rigs.progress()[1], ..weights_state(&document.weights) },
            skinning: document.skinning,
            targets: document.pose.targets.iter().filter_map(|t| target(skeleton.as_deref()?, t)).collect(),
            poses: document.poses.keys().cloned().collect(),
            clips: document.clips.iter().map(|c| c.name.clone()).collect(),
            clip: document.clip.clone(),
            duration: last,
            tracks: skeleton.as_deref().map(|s| tracks(s, document)).unwrap_or_default(),
            unkeyed: clip.map(|c| unkeyed(c)).unwrap_or_default(),
            run: RunState {
                clip: document.pipeline.settings().clip.clone(),
                frames: document.pipeline.settings().frames,
            },
            model: document.model.as_ref().map(|trained| ModelState {
                name: trained.0.name.clone(),
                fault: skeleton.as_deref().and_then(|s| model_fault(document, &self.mesh, s)),
            }),
            compare: self.compared.clone(),
        }
    }

    fn mesh_state(&self) -> MeshState {
        let (low, high) = self.mesh.bounding_box().unwrap_or_default();
        let size = high - low;
        MeshState {
            vertices: self.mesh.vertex_count(),
            triangles: self.mesh.triangle_count(),
            diagonal: self.mesh.diagonal(),
            center: self.center.coords.into(),
            // A body stands: the longer of the two axes that formats use for up.
            up: if size.z > size.y { "z" } else { "y" },
        }
    }

    fn extraction_state(&self, document: &CharacterDocument) -> ExtractionState {
        let finding = &document.finding;
        let report = match &document.skeleton {
            SkeletonSource::Found(of) => self.rigs.report(of),
            _ => None,
        };
        let report = report.map(|found| {
            let r = &found.report;
            BTreeMap::from([("parts", r.parts), ("ends", r.ends), ("junctions", r.junctions), ("loops", r.loops)])
        });
        ExtractionState {
            options: finding.options,
            joints: finding.joints,
            ends: finding.ends.clone(),
            running: self.rigs.progress()[0],
            report,
        }
    }

    /// The command that does the same as the saved document.
    pub(super) fn command(document: &CharacterDocument) -> String {
        let name = |path: &std::path::Path| quoted(&path.file_name().unwrap_or_default().to_string_lossy());
        let pipeline = document.pipeline.path();
        let stem = pipeline.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let stem = stem.split('.').next().unwrap_or_default();
        let side = |given: &Option<String>, ending: &str| match given {
            Some(path) => name(std::path::Path::new(path)),
            None => quoted(&format!("{stem}{ending}")),
        };
        let settings = document.pipeline.settings();
        let pose = match &settings.clip {
            Some(clip) => format!("--clip {} --frames {}", quoted(clip), settings.frames),
            None => format!("--pose {}", side(&settings.pose, ".pose.json")),
        };
        let method = super::METHODS.iter().find(|m| m.0 == document.skinning).map(|m| m.1);
        let surface = match method.map(|m| serde_json::to_value(m).unwrap_or_default()) {
            None => format!("--skinning regression --model {}", side(&settings.model, ".skin")),
            Some(method) => {
                let weights = side(&settings.weights, ".weights.json");
                format!("--weights {weights} --skinning {}", method.as_str().unwrap_or_default())
            }
        };
        let output = document.pipeline.output().map(|o| o.path.clone()).unwrap_or_default();
        format!(
            "plumbline pose {} --skeleton {} {pose} {surface} -o {}",
            name(document.pipeline.mesh()),
            name(document.pipeline.skeleton()),
            name(std::path::Path::new(&output)),
        )
    }
}

/// A word of a shell.
fn quoted(text: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "._-/".contains(c);
    if !text.is_empty() && text.chars().all(plain) {
        text.to_owned()
    } else {
        format!("'{}'", text.replace('\'', "'\\''"))
    }
}

fn unkeyed(clip: &ClipDocument) -> Vec<UnkeyedState> {
    let state = |pose: &super::document::Unkeyed| UnkeyedState {
        time: pose.time,
        joints: pose.joints.keys().cloned().collect(),
    };
    clip.unkeyed.iter().map(state).collect()
}

fn joints(skeleton: &Skeleton, locked: &[String]) -> Vec<JointState> {
    let limits = |l: &plumbline_shape::character::Limits| Limits {
        axis: l.axis.into_inner().into(),
        across: l.across.into_inner().into(),
        swing: l.swing,
        twist: l.twist,
    };
    let joint = |j: &plumbline_shape::character::Joint| JointState {
        name: j.name.clone(),
        parent: j.parent,
        limits: j.limits.as_ref().map(limits),
        locked: locked.contains(&j.name),
    };
    skeleton.joints().iter().map(joint).collect()
}

fn weights_state(source: &WeightSource) -> WeightsState {
    let options = source.options();
    let method = match options.method {
        Library::Heat => WeightMethod::Heat,
        Library::BoundedBiharmonic => WeightMethod::Biharmonic,
        Library::Distance => WeightMethod::Distance,
    };
    let painted = u32::from(matches!(source, WeightSource::Given(..)));
    let (influences, smooth) = (options.influences as u32, options.smooth as u32);
    WeightsState { method, influences, smooth, painted, running: None }
}

fn target(skeleton: &Skeleton, named: &NamedTarget) -> Option<Target> {
    let target = named.resolved(skeleton)?;
    let (kind, at) = match &target.goal {
        Goal::Position { at, .. } => (TargetKind::Position, at.coords.into()),
        Goal::Orientation(_) => (TargetKind::Orientation, [0.0; 3]),
        Goal::LookAt { at, .. } => (TargetKind::LookAt, at.coords.into()),
        Goal::Pole { at, .. } => (TargetKind::Pole, at.coords.into()),
    };
    Some(Target { joint: target.joint, kind, at, weight: target.weight })
}

/// Keys of the rotations of the clip that is shown.
fn tracks(skeleton: &Skeleton, document: &CharacterDocument) -> Vec<Track> {
    let Some(clip) = document.shown_clip() else { return Vec::new() };
    if clip.curves.iter().map(|c| c.curve.times().len()).sum::<usize>() > MAX_KEYS {
        return Vec::new();
    }
    let track = |c: &Arc<super::document::NamedCurve>| {
        let joint = skeleton.find(&c.joint)?;
        let Curve::Rotation(curve) = &c.curve else { return None };
        let rest = skeleton.joints()[joint as usize].rest.rotation;
        let times = curve.keys().times().to_vec();
        let rotations = (0..times.len()).map(|k| from_rest(&rest, &curve.key(k))).collect();
        let interpolation = match curve.keys().interpolation() {
            Interpolation::Step => InterpolationKind::Step,
            Interpolation::Linear => InterpolationKind::Linear,
            Interpolation::Smooth | Interpolation::Cubic { .. } => InterpolationKind::Spline,
        };
        Some(Track { joint, times, rotations, interpolation })
    };
    clip.curves.iter().filter_map(track).collect()
}
