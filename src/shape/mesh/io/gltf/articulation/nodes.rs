//! The node hierarchy: checked to be a forest before any transform is applied.

use nalgebra::Matrix4;

use super::super::document::{self, Document};
use super::super::fault;
use crate::mesh::MeshError;
use crate::mesh::model::articulation::{Node, NodeTransform};

/// All nodes of the document.
pub(in super::super) fn read(document: &Document) -> Result<Vec<Node>, MeshError> {
    let mut nodes = Vec::with_capacity(document.nodes.len());
    for (k, node) in document.nodes.iter().enumerate() {
        let transform = transform(node, &format!("/nodes/{k}"))?;
        nodes.push(Node { name: node.name.clone(), parent: None, transform, extras: node.extras.clone() });
    }
    for (k, node) in document.nodes.iter().enumerate() {
        for &child in &node.children {
            let there = nodes.len();
            let told = || fault(format!("/nodes/{k}/children"), format!("names node {child}; there are only {there}"));
            let parent = &mut nodes.get_mut(child).ok_or_else(told)?.parent;
            if parent.replace(k as u32).is_some() {
                return Err(fault(format!("/nodes/{child}"), "has two parents, or is its own ancestor"));
            }
        }
    }
    ends(&nodes)?;
    Ok(nodes)
}

/// Checks that the chain of parents ends for every node: there is no cycle.
fn ends(nodes: &[Node]) -> Result<(), MeshError> {
    let mut done = vec![false; nodes.len()];
    for start in 0..nodes.len() {
        let (mut way, mut at) = (Vec::new(), Some(start));
        while let Some(node) = at.filter(|&node| !done[node]) {
            if way.len() > nodes.len() {
                return Err(fault(format!("/nodes/{start}"), "has two parents, or is its own ancestor"));
            }
            way.push(node);
            at = nodes[node].parent.map(|p| p as usize);
        }
        for node in way {
            done[node] = true;
        }
    }
    Ok(())
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
