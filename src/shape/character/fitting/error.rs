//! Errors of template fitting.

use crate::character::CharacterError;
use plumbline_num::run::Stopped;

/// Why a template could not be fitted.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FitError {
    /// Input: a template without extent.
    #[error("the template has {joints} joints at one position; fitting needs two joints apart")]
    Template {
        /// Number of joints.
        joints: usize,
    },
    /// Input: a curve without limbs.
    #[error(
        "the curve skeleton has {nodes} nodes and no limb longer than its radius: a template needs a surface with limbs; omit the template, or fit it \
        to another mesh"
    )]
    Curve {
        /// Number of nodes.
        nodes: usize,
    },
    /// Input: a node position that is not finite.
    #[error("node {node} of the curve is not finite")]
    NotFinite {
        /// Index of the node.
        node: usize,
    },
    /// Input: an edge with a node index out of range.
    #[error("an edge of the curve ends at node {node}, but there are {nodes}, numbered from 0")]
    NoSuchNode {
        /// The index.
        node: u32,
        /// Number of nodes.
        nodes: usize,
    },
    /// Numerics: singular frames.
    #[error(transparent)]
    Character(#[from] CharacterError),
    /// The run was interrupted or exceeded its time budget.
    #[error(transparent)]
    Interrupted(#[from] Stopped),
}
