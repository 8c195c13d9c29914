//! XML: documents with bounds, and OpenCV's storage as a tree.

use roxmltree::{Document, Node, ParsingOptions};
use serde_json::{Map, Value, json};

use super::{MAX_NESTING, ProfileError};

/// Maximum number of elements and texts in a document; the largest lens database has 60 000.
const MAX_NODES: u32 = 1_000_000;

/// The document in a text.
pub(super) fn document(text: &str) -> Result<Document<'_>, ProfileError> {
    // Databases name their DTD; entities are expanded by the parser within bounds of its own.
    let options = ParsingOptions { allow_dtd: true, nodes_limit: MAX_NODES, ..ParsingOptions::default() };
    Document::parse_with_options(text, options).map_err(|e| ProfileError::syntax("XML", e))
}

/// OpenCV's storage.
pub(super) fn storage(root: Node<'_, '_>) -> Result<Value, ProfileError> {
    element(root, 0)
}

fn element(node: Node<'_, '_>, depth: usize) -> Result<Value, ProfileError> {
    if depth > MAX_NESTING {
        return Err(ProfileError::syntax("XML", "elements are nested too deeply"));
    }
    let children: Vec<Node<'_, '_>> = node.children().filter(Node::is_element).collect();
    if children.is_empty() {
        return Ok(words(node.text().unwrap_or("")));
    }
    let items = children.iter().map(|c| Ok((c.tag_name().name().to_owned(), element(*c, depth + 1)?)));
    let items: Vec<(String, Value)> = items.collect::<Result<_, ProfileError>>()?;
    if items.iter().all(|(name, _)| name == "_") {
        return Ok(items.into_iter().map(|(_, value)| value).collect());
    }
    Ok(Value::Object(items.into_iter().collect::<Map<_, _>>()))
}

/// Numbers separated by space, one number, or text.
fn words(text: &str) -> Value {
    let number = |word: &str| word.trim_end_matches('.').parse::<f64>().ok().filter(|n| n.is_finite());
    let numbers: Option<Vec<f64>> = text.split_whitespace().map(number).collect();
    match numbers.as_deref() {
        Some([one]) => json!(one),
        Some([]) => Value::Null,
        Some(many) => json!(many),
        None => Value::String(text.trim().trim_matches('"').to_owned()),
    }
}
