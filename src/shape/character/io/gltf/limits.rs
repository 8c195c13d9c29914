//! Joint limits, which glTF lacks: stored in the `extras` of nodes, with the keys of skeleton files.

use nalgebra::{Unit, Vector3};
use serde_json::{Value, json};

use crate::character::skeleton_file::LimitsEntry;
use crate::character::{CharacterError, Limits};

/// Key in the extras.
const KEY: &str = "plumbline_limits";

/// The extras of a joint with limits.
pub(super) fn written(limits: &Limits) -> Value {
    json!({ KEY: LimitsEntry::of(limits) })
}

/// The limits in the extras, if any.
pub(super) fn read(extras: Option<&Value>, joint: &str) -> Result<Option<Limits>, CharacterError> {
    let Some(entry) = extras.and_then(|extras| extras.get(KEY)) else { return Ok(None) };
    let axis = |v: [f64; 3]| Unit::try_new(Vector3::from(v), 1e-12);
    let read = || {
        let entry: LimitsEntry = serde_json::from_value(entry.clone()).ok()?;
        let [swing, twist] = [entry.swing_deg, entry.twist_deg].map(|v| v.map(f64::to_radians));
        Some(Limits { axis: axis(entry.axis)?, across: axis(entry.across)?, swing, twist })
    };
    let expected = "axis, across, swing_deg and twist_deg";
    let malformed = || format!("the entry {entry} of joint {joint:?} is invalid (expected {expected})");
    read().map(Some).ok_or_else(|| CharacterError::Input(malformed()))
}
