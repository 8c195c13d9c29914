//! Errors of skeletons, poses, skins, clips, inverse kinematics, editing, fitting and extraction.

use super::ClipError;
use crate::surface::SurfaceError;
use plumbline_num::options::OptionError;
use plumbline_num::run::Stopped;
use plumbline_num::sparse::SparseError;

/// Why an operation on a character failed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CharacterError {
    /// Input: a skeleton without joints.
    #[error("the skeleton has no joint; give it at least one")]
    NoJoints,
    /// Input: more joints than 16-bit joint indices can address.
    #[error("{joints} joints are too many (at most {most})")]
    TooManyJoints {
        /// Number of joints.
        joints: usize,
        /// Largest number allowed.
        most: usize,
    },
    /// Input: the parent index of a joint is out of range.
    #[error("joint {joint:?} has the parent {parent}, but the skeleton has {joints} joints, numbered from 0")]
    NoSuchParent {
        /// Name of the joint.
        joint: String,
        /// Index of its parent.
        parent: u32,
        /// Number of joints.
        joints: usize,
    },
    /// Input: the parent relation has a cycle.
    #[error("joints form a cycle: {cycle}; make one of them a root or give it another parent")]
    Cycle {
        /// Names of the joints, each followed by its parent.
        cycle: String,
    },
    /// Input: two joints with the same name.
    #[error("joints {first} and {second} are both named {name:?}; names must differ")]
    DuplicateName {
        /// The name.
        name: String,
        /// Index of the first joint.
        first: usize,
        /// Index of the second joint.
        second: usize,
    },
    /// Input: a joint name that the skeleton does not have.
    #[error("there is no joint {name:?}{}", known(.nearest.as_deref()))]
    UnknownJoint {
        /// The name given.
        name: String,
        /// The closest existing name by edit distance.
        nearest: Option<String>,
    },
    /// Input: a joint frame with a non-finite value.
    #[error("the {what} of joint {joint:?} is not finite")]
    JointNotFinite {
        /// Which frame.
        what: &'static str,
        /// Name of the joint.
        joint: String,
    },
    /// Input: a joint frame with zero scale, which has no inverse bind matrix.
    #[error("the frame of joint {joint:?} has a scale of 0; a skin cannot be bound to it")]
    FlatJoint {
        /// Name of the joint.
        joint: String,
    },
    /// Input: joint limits out of range.
    #[error("the {what} {value} of joint {joint:?} is invalid (expected {expected})")]
    Limits {
        /// Name of the joint.
        joint: String,
        /// Which limit.
        what: &'static str,
        /// Its value.
        value: String,
        /// Allowed values.
        expected: &'static str,
    },
    /// Input: a pose with the wrong number of joints.
    #[error("a pose of {given} joints does not fit a skeleton of {joints}: give one frame for each")]
    Pose {
        /// Frames of the pose.
        given: usize,
        /// Joints of the skeleton.
        joints: usize,
    },
    /// Input: a weight whose joint index is out of range.
    #[error("vertex {vertex} follows joint {joint}, but the skin has {joints} joints, numbered from 0")]
    NoSuchJoint {
        /// The vertex.
        vertex: usize,
        /// Index of the joint.
        joint: u32,
        /// Joints of the skin.
        joints: usize,
    },
    /// Input: a weight that is negative or not finite.
    #[error("the weight {weight} of vertex {vertex} for joint {joint} is invalid (expected 0 or more, finite)")]
    Weight {
        /// The vertex.
        vertex: usize,
        /// The joint.
        joint: u32,
        /// The weight.
        weight: f64,
    },
    /// Input: the weights of a vertex do not sum to one.
    #[error("the weights of vertex {vertex} sum to {sum} (expected 1 ± {tolerance:e}); normalize them first")]
    WeightSum {
        /// The vertex.
        vertex: usize,
        /// Their sum.
        sum: f64,
        /// Largest allowed distance from 1.
        tolerance: f64,
    },
    /// Input: vertices without any weight.
    #[error("{count} vertices have no weight, the first is vertex {vertex}; give each a weight above 0")]
    Weightless {
        /// The first of these vertices.
        vertex: usize,
        /// Number of these vertices.
        count: usize,
    },
    /// Input: a vertex with more influences than the method supports.
    #[error("vertex {vertex} has {found} influences (at most {most}); limit the weights first")]
    TooManyInfluences {
        /// The vertex.
        vertex: usize,
        /// Number of its influences.
        found: usize,
        /// Largest number allowed.
        most: usize,
    },
    /// Input: the numbers of joints and of matrices differ.
    #[error("the skin has weights for {joints} joints but {matrices} matrices: give one for each joint")]
    Matrices {
        /// Joints of the weights.
        joints: usize,
        /// Matrices given.
        matrices: usize,
    },
    /// Input: a matrix that is not finite or not affine.
    #[error("the matrix of joint {joint} is {what} (expected a finite affine map)")]
    Matrix {
        /// Index of the joint.
        joint: usize,
        /// Why it is invalid.
        what: &'static str,
    },
    /// Input: training without examples.
    #[error("there is no example pose; give one at least")]
    NoExamples,
    /// Input: a per-vertex array of the wrong length.
    #[error("{given} {what} do not fit a mesh of {vertices} vertices: give one for each")]
    PerVertex {
        /// Name of the quantity.
        what: &'static str,
        /// Length of the array.
        given: usize,
        /// Vertices of the mesh.
        vertices: usize,
    },
    /// Input: a clip name that the character does not have.
    #[error("there is no clip {name:?} (known: {})", if known.is_empty() { "none" } else { known.as_str() })]
    UnknownClip {
        /// The name given.
        name: String,
        /// All clip names.
        known: String,
    },
    /// Input: the wrong number of morph weights.
    #[error("{given} weights do not fit {targets} morph targets: give one for each")]
    MorphWeights {
        /// Number of weights.
        given: usize,
        /// Number of morph targets.
        targets: usize,
    },
    /// Settings: an option out of range.
    #[error(transparent)]
    Option(#[from] OptionError),
    /// Numerics: factorization failed.
    #[error(transparent)]
    Solve(SparseError),
    /// An invalid clip.
    #[error(transparent)]
    Clip(#[from] ClipError),
    /// A surface solver failed.
    #[error(transparent)]
    Surface(SurfaceError),
    /// The run was interrupted or exceeded its time budget.
    #[error(transparent)]
    Interrupted(#[from] Stopped),
}

impl CharacterError {
    /// Rejects a per-vertex array of the wrong length.
    pub(super) fn check_per_vertex(what: &'static str, given: usize, vertices: usize) -> Result<(), Self> {
        if given == vertices { Ok(()) } else { Err(Self::PerVertex { what, given, vertices }) }
    }

    /// Rejects a number of matrices that differs from that of the joints.
    pub(super) fn check_matrices(joints: usize, matrices: usize) -> Result<(), Self> {
        if joints == matrices { Ok(()) } else { Err(Self::Matrices { joints, matrices }) }
    }
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
