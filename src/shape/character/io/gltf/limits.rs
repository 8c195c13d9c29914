//! Limits of joints, which the format does not know: as `extras` of the nodes, in the words of skeleton files.

use nalgebra::{Unit, Vector3};
use serde_json::{Value, json};

use crate::character::{CharacterError, Limits};

/// The key among the extras.
const KEY: &str = "plumbline_limits";

/// The extras of a joint with limits.
pub(super) fn written(limits: &Limits) -> Value {
    json!({ KEY: {
        "axis": limits.axis.as_slice(),
        "across": limits.across.as_slice(),
        "swing_deg": limits.swing.map(f64::to_degrees),
        "twist_deg": limits.twist.map(f64::to_degrees),
    } })
}

/// The limits among extras; none where there are none of this shape.
pub(super) fn read(extras: Option<&Value>, joint: &str) -> Result<Option<Limits>, CharacterError> {
    let Some(entry) = extras.and_then(|extras| extras.get(KEY)) else { return Ok(None) };
    let numbers = |key: &str, count: usize| {
        let list: Vec<f64> = entry.get(key)?.as_array()?.iter().filter_map(Value::as_f64).collect();
        (list.len() == count).then_some(list)
    };
    let axis = |key: &str| Unit::try_new(Vector3::from_column_slice(&numbers(key, 3)?), 1e-12);
    let pair = |key: &str| numbers(key, 2).map(|n| [n[0].to_radians(), n[1].to_radians()]);
    let read = || {
        Some(Limits {
            axis: axis("axis")?,
            across: axis("across")?,
            swing: pair("swing_deg")?,
            twist: pair("twist_deg")?,
        })
    };
    let malformed = || CharacterError::Limits {
        joint: joint.to_owned(),
        what: "entry",
        value: entry.to_string(),
        expected: "axis, across, swing_deg and twist_deg",
    };
    read().map(Some).ok_or_else(malformed)
}
