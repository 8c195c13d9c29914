//! Errors of rig files.

use crate::character::skeleton_file::SkeletonFileError;
use crate::character::{CharacterError, ClipError};
use crate::mesh::MeshError;

/// Why a rig file could not be read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RigFileError {
    /// Input: malformed text.
    #[error("{format}, line {line}: {fault}")]
    Malformed {
        /// The format.
        format: &'static str,
        /// Line number, from 1.
        line: usize,
        /// The fault with its value, and the remedy.
        fault: String,
    },
    /// Input: an unknown file extension.
    #[error("unknown skeleton file extension (expected {expected})")]
    UnknownFormat {
        /// Supported extensions.
        expected: &'static str,
    },
    /// Input: a static model.
    #[error(
        "the model has no skin and nothing that moves; give a skeleton and weights (`plumbline skeleton`, `plumbline skin weights` \
         make them)"
    )]
    NoSkin,
    /// Input: a node matrix with shear.
    #[error("the matrix of node {node:?} has shear; a joint supports translation, rotation and scale only")]
    Shear {
        /// Name of the node.
        node: String,
    },
    /// Input: two skins with inconsistent bind matrices for one joint.
    #[error(
        "skin {skin} binds joint {joint:?} otherwise than the skins before it, and not by one map for all its joints"
    )]
    Bindings {
        /// Index of the skin.
        skin: usize,
        /// Name of the joint.
        joint: String,
    },
    /// Input: a skeleton that the format cannot represent.
    #[error("{format} cannot hold the skeleton: {fault}")]
    Unwritable {
        /// The format.
        format: &'static str,
        /// The reason.
        fault: String,
    },
    /// Input: a file above the size limit.
    #[error("{bytes} bytes are too many (at most {most})")]
    TooLarge {
        /// Bytes of the file.
        bytes: u64,
        /// The most there may be.
        most: u64,
    },
    /// Input: invalid joints, weights or frames.
    #[error(transparent)]
    Character(#[from] CharacterError),
    /// Input: an invalid clip.
    #[error(transparent)]
    Clip(#[from] ClipError),
    /// Input: an invalid mesh.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// Input: an invalid skeleton file.
    #[error(transparent)]
    Skeleton(#[from] SkeletonFileError),
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
