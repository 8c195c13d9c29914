//! The node hierarchy: checked to be a forest before any transform is applied.

use nalgebra::Matrix4;

use super::super::document::{self, Document};
use super::super::{fault, item};
use crate::mesh::MeshError;
use crate::mesh::model::articulation::{Node, NodeTransform, cycle};

/// All nodes of the document.
pub(in super::super) fn read(document: &Document) -> Result<Vec<Node>, MeshError> {
    let mut nodes = Vec::with_capacity(document.nodes.len());
    for (k, node) in document.nodes.iter().enumerate() {
        let transform = transform(node, &format!("/nodes/{k}"))?;
        nodes.push(Node { name: node.name.clone(), parent: None, transform, extras: node.extras.clone() });
    }
    for (k, node) in document.nodes.iter().enumerate() {
        for &child in &node.children {
            item(&nodes, child, format!("/nodes/{k}/children"), "node")?;
            if nodes[child].parent.replace(k as u32).is_some() {
                return Err(fault(format!("/nodes/{child}"), "has two parents, or is its own ancestor"));
            }
        }
    }
    match cycle(&nodes) {
        Some(node) => Err(fault(format!("/nodes/{node}"), "has two parents, or is its own ancestor")),
        None => Ok(nodes),
    }
}

fn transform(node: &document::Node, at: &str) -> Result<NodeTransform, MeshError> {
    let transform = match &node.matrix {
        Some(columns) => NodeTransform::Matrix(Matrix4::from_column_slice(columns)),
        None => NodeTransform::Trs {
            translation: node.translation.unwrap_or([0.0; 3]),
            rotation: node.rotation.unwrap_or([0.0, 0.0, 0.0, 1.0]),
            scale: node.scale.unwrap_or([1.0; 3]),
        },
    };
    if transform.matrix().iter().all(|x| x.is_finite()) {
        Ok(transform)
    } else {
        Err(fault(at, "its transformation is not finite"))
    }
}
