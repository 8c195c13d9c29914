//! Errors of characters: of operations on them, and of their files.

use crate::mesh::MeshError;
use crate::surface::SurfaceError;
use plumbline_num::document::DocumentError;
use plumbline_num::options::OptionError;
use plumbline_num::run::Stopped;
use plumbline_num::sparse::SparseError;

/// Why an operation on a character failed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CharacterError {
    /// Input: joints, weights, matrices, a pose, a clip, a target, a curve or an edit that is invalid. The message says which, its value
    /// and what is expected.
    #[error("{0}")]
    Input(String),
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
    /// Input: a template skeleton that fits no curve.
    #[error("{0}")]
    Template(String),
    /// Settings: an option out of range.
    #[error(transparent)]
    Option(#[from] OptionError),
    /// Numerics: a linear system could not be solved.
    #[error("the equations of the surface could not be solved ({0}); repair or remesh it")]
    Solve(#[source] SparseError),
    /// Input: a system too dense for this method, and what to do instead of remeshing.
    #[error("{reason}, or {instead}")]
    TooDense {
        /// [`SparseError::TooDense`].
        #[source]
        reason: SparseError,
        /// Another method that does not take as much.
        instead: &'static str,
    },
    /// A surface solver failed.
    #[error(transparent)]
    Surface(SurfaceError),
    /// The run or an observer was interrupted, or the time budget was exceeded.
    #[error(transparent)]
    Interrupted(#[from] Stopped),
}

impl CharacterError {
    /// The error of a system; of one that is too dense it names another method.
    pub(super) fn of_system(error: SparseError, instead: &'static str) -> Self {
        match error {
            reason @ SparseError::TooDense { .. } => Self::TooDense { reason, instead },
            other => other.into(),
        }
    }

    /// Rejects a per-vertex array of the wrong length.
    pub(super) fn check_per_vertex(what: &'static str, given: usize, vertices: usize) -> Result<(), Self> {
        if given == vertices { Ok(()) } else { Err(Self::PerVertex { what, given, vertices }) }
    }

    /// Rejects a number of matrices that differs from that of the joints.
    pub(super) fn check_matrices(joints: usize, matrices: usize) -> Result<(), Self> {
        if joints == matrices { Ok(()) } else { Err(Self::wrong_matrices(joints, matrices)) }
    }

    pub(super) fn wrong_matrices(joints: usize, matrices: usize) -> Self {
        Self::Input(format!(
            "the skin has weights for {joints} joints but {matrices} matrices: give one for each joint"
        ))
    }

    /// Rejects a pose with the wrong number of joints.
    pub(super) fn check_pose(given: usize, joints: usize) -> Result<(), Self> {
        if given == joints {
            return Ok(());
        }
        let fault = format!("a pose of {given} joints does not fit a skeleton of {joints}: give one frame for each");
        Err(Self::Input(fault))
    }

    /// A frame without an inverse.
    pub(super) fn flat_joint(joint: &str) -> Self {
        Self::Input(format!("the frame of joint {joint:?} has a scale of 0; a skin cannot be bound to it"))
    }
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

/// Why a file of a skeleton, pose, weights, trained skin or clip could not be read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RigFileError {
    /// Input: not a readable document of the format.
    #[error(transparent)]
    Document(#[from] DocumentError),
    /// Input: invalid content, or content that the format cannot represent. The message says where, the value and what is expected.
    #[error("{0}")]
    Content(String),
    /// Input: a static model.
    #[error(
        "the model has no skin and nothing that moves; give a skeleton and weights (`plumbline skeleton`, `plumbline skin weights` \
         make them)"
    )]
    NoSkin,
    /// Input: invalid joints, weights, targets or clips. The solver was interrupted.
    #[error(transparent)]
    Character(#[from] CharacterError),
    /// Input: an invalid mesh.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// Environment: the file cannot be read.
    #[error("cannot be read: {0}")]
    Io(#[from] std::io::Error),
    /// Any other error, with the file name.
    #[error("{path}: {fault}")]
    InFile {
        /// The file.
        path: String,
        /// The fault.
        fault: Box<RigFileError>,
    },
}

impl RigFileError {
    /// Adds the file name, unless the error has one.
    pub(super) fn of_file(self, path: &std::path::Path) -> Self {
        match self {
            Self::Mesh(MeshError::InFile { .. }) | Self::InFile { .. } => self,
            fault => Self::InFile { path: path.display().to_string(), fault: Box::new(fault) },
        }
    }
}
