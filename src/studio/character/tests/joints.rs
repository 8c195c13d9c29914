//! Several joints in one edit.

use super::*;

#[test]
fn joints_that_are_removed_together_are_those_that_were_chosen_whatever_goes_with_them() {
    let mut opened = Opened::bar();
    opened.edit(json!({"do": "add", "at": [0.5, 0.5, 1], "name": "hip"})).unwrap();
    for (z, name) in [(2, "a"), (3, "b"), (4, "c"), (5, "d")] {
        opened.edit(json!({"do": "extrude", "joint": 0, "at": [0.5, 0.5, z], "name": name})).unwrap();
    }
    // A child whose number is below that of its parent goes with it.
    opened.edit(json!({"do": "reparent", "joints": [1], "parent": 3})).unwrap();
    opened.edit(json!({"do": "remove", "joints": [2, 3]})).unwrap();
    assert_eq!(opened.state().joints.iter().map(|j| j.name.as_str()).collect::<Vec<_>>(), ["hip", "d"]);
}
