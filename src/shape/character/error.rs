//! What a skeleton, a pose or a skin can be refused for.

use crate::surface::SurfaceError;
use plumbline_num::options::OptionError;
use plumbline_num::run::Stopped;
use plumbline_num::sparse::SparseError;

/// Why a character could not be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CharacterError {
    /// Input: a skeleton without joints.
    #[error("the skeleton has no joint; give it one at least")]
    NoJoints,
    /// Input: more joints than numbers for them.
    #[error("{joints} joints are too many (at most {most})")]
    TooManyJoints {
        /// Their number.
        joints: usize,
        /// The most there may be.
        most: usize,
    },
    /// Input: a parent that is no joint.
    #[error("joint {joint:?} has the parent {parent}, but the skeleton has {joints} joints, numbered from 0")]
    NoSuchParent {
        /// Name of the joint.
        joint: String,
        /// Number of its parent.
        parent: u32,
        /// Number of joints.
        joints: usize,
    },
    /// Input: joints that descend from themselves.
    #[error("joints form a cycle: {cycle}; one of them must be a root or hang on another joint")]
    Cycle {
        /// Names of the joints, each followed by its parent.
        cycle: String,
    },
    /// Input: two joints of one name.
    #[error("joints {first} and {second} are both named {name:?}; names must differ")]
    DuplicateName {
        /// The name.
        name: String,
        /// The first of them.
        first: usize,
        /// The next of them.
        second: usize,
    },
    /// Input: a joint that is not there.
    #[error("there is no joint {name:?}{}", known(.nearest.as_deref()))]
    UnknownJoint {
        /// The name asked for.
        name: String,
        /// The joint whose name is most like it.
        nearest: Option<String>,
    },
    /// Input: a frame of a joint with a number that is not finite.
    #[error("the {what} of joint {joint:?} is not finite")]
    JointNotFinite {
        /// What is not finite.
        what: &'static str,
        /// Name of the joint.
        joint: String,
    },
    /// Input: a joint whose frame is flat, so that nothing can be bound to it.
    #[error("the frame of joint {joint:?} has a scale of 0; a skin cannot be bound to it")]
    FlatJoint {
        /// Name of the joint.
        joint: String,
    },
    /// Input: limits that no rotation keeps.
    #[error("the {what} {value} of joint {joint:?} is invalid (expected {expected})")]
    Limits {
        /// Name of the joint.
        joint: String,
        /// Which limit.
        what: &'static str,
        /// Its value.
        value: String,
        /// What it may be.
        expected: &'static str,
    },
    /// Input: a pose for another skeleton.
    #[error("a pose of {given} joints does not fit a skeleton of {joints}: give one frame for each")]
    Pose {
        /// Frames of the pose.
        given: usize,
        /// Joints of the skeleton.
        joints: usize,
    },
    /// Input: a weight that names no joint.
    #[error("vertex {vertex} follows joint {joint}, but the skin has {joints} joints, numbered from 0")]
    NoSuchJoint {
        /// The vertex.
        vertex: usize,
        /// The joint named.
        joint: u32,
        /// Joints of the skin.
        joints: usize,
    },
    /// Input: a negative weight, or one that is not finite.
    #[error("the weight {weight} of vertex {vertex} for joint {joint} is invalid (expected 0 or more, finite)")]
    Weight {
        /// The vertex.
        vertex: usize,
        /// The joint.
        joint: u32,
        /// The weight.
        weight: f64,
    },
    /// Input: weights of a vertex that do not sum to one.
    #[error("the weights of vertex {vertex} sum to {sum} (expected 1 ± {tolerance:e}); normalize them first")]
    WeightSum {
        /// The vertex.
        vertex: usize,
        /// Their sum.
        sum: f64,
        /// How far from 1 it may be.
        tolerance: f64,
    },
    /// Input: vertices that follow no joint.
    #[error("{count} vertices follow no joint, the first is vertex {vertex}; give each a weight above 0")]
    Weightless {
        /// The first of them.
        vertex: usize,
        /// How many there are.
        count: usize,
    },
    /// Input: a vertex that follows more joints than there is room for.
    #[error("vertex {vertex} follows {found} joints (at most {most}); limit the weights first")]
    TooManyInfluences {
        /// The vertex.
        vertex: usize,
        /// Joints that it follows.
        found: usize,
        /// The most there may be.
        most: usize,
    },
    /// Input: weights and matrices that do not belong together.
    #[error("the skin has weights for {joints} joints but {matrices} matrices: give one for each joint")]
    Matrices {
        /// Joints of the weights.
        joints: usize,
        /// Matrices given.
        matrices: usize,
    },
    /// Input: a matrix with a number that is not finite, or that is not affine.
    #[error("the matrix of joint {joint} is {what} (expected a finite affine map)")]
    Matrix {
        /// Number of the joint.
        joint: usize,
        /// What is wrong with it.
        what: &'static str,
    },
    /// Input: nothing to learn from.
    #[error("there is no example pose; give one at least")]
    NoExamples,
    /// Input: something per vertex for another mesh.
    #[error("{given} {what} do not fit a mesh of {vertices} vertices: give one for each")]
    PerVertex {
        /// What was counted.
        what: &'static str,
        /// How many were given.
        given: usize,
        /// Vertices of the mesh.
        vertices: usize,
    },
    /// Input: a movement that is not there.
    #[error("there is no clip {name:?} (known: {})", if known.is_empty() { "none" } else { known.as_str() })]
    UnknownClip {
        /// The name asked for.
        name: String,
        /// The names there are.
        known: String,
    },
    /// Input: weights of other morph targets.
    #[error("{given} weights do not fit {targets} morph targets: give one for each")]
    MorphWeights {
        /// Weights given.
        given: usize,
        /// Morph targets there are.
        targets: usize,
    },
    /// Settings: an option out of its range.
    #[error(transparent)]
    Option(#[from] OptionError),
    /// Numerics: a system could not be factored.
    #[error(transparent)]
    Solve(SparseError),
    /// A surface that could not be refined.
    #[error(transparent)]
    Surface(SurfaceError),
    /// The run was interrupted, or its time is used up.
    #[error(transparent)]
    Interrupted(#[from] Stopped),
}

fn known(nearest: Option<&str>) -> String {
    nearest.map_or_else(String::new, |n| format!("; did you mean {n:?}?"))
}

impl From<SparseError> for CharacterError {
    fn from(error: SparseError) -> Self {
        match error {
            SparseError::Interrupted(stopped) => Self::Interrupted(stopped),
            error => Self::Solve(error),
        }
    }
}

impl From<SurfaceError> for CharacterError {
    fn from(error: SurfaceError) -> Self {
        match error {
            SurfaceError::Interrupted(stopped) => Self::Interrupted(stopped),
            error => Self::Surface(error),
        }
    }
}
