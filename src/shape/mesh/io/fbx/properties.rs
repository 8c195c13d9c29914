//! Named properties of objects (`Properties70`).

use nalgebra::Vector3;

use super::binary::{Tree, Value};

/// The properties of a record: name and numbers. Others have no numbers.
pub(super) fn properties<'t, 'a>(tree: &'t Tree<'a>, record: u32) -> impl Iterator<Item = (&'a [u8], Numbers)> + 't {
    let lists = tree.children(Some(record)).filter(|&r| tree.record(r).name == b"Properties70");
    lists.flat_map(|r| tree.children(Some(r))).filter_map(|r| {
        // P: name, type, label, flags, values.
        let mut values = tree.record(r).values();
        let name = values.next().and_then(Value::text)?;
        let mut numbers = Numbers::default();
        for value in values.skip(3).take(numbers.0.len()).zip(&mut numbers.0) {
            *value.1 = value.0.real();
        }
        Some((name, numbers))
    })
}

/// Up to three numbers of a property.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Numbers([Option<f64>; 3]);

impl Numbers {
    /// Sets `to` where the property is a finite number.
    pub(super) fn set(self, to: &mut f64) {
        if let Some(x) = self.0[0].filter(|x| x.is_finite()) {
            *to = x;
        }
    }

    /// Sets `to` where the property is three finite numbers.
    pub(super) fn set_vector(self, to: &mut Vector3<f64>) {
        if let [Some(x), Some(y), Some(z)] = self.0.map(|n| n.filter(|x| x.is_finite())) {
            *to = Vector3::new(x, y, z);
        }
    }

    /// Sets `to` where the property is a small integer.
    pub(super) fn set_integer(self, to: &mut i32) {
        if let Some(x) = self.0[0].filter(|x| x.fract() == 0.0 && x.abs() < 1e9) {
            *to = x as i32;
        }
    }

    /// Sets `to` where the property is a number: true unless it is 0.
    pub(super) fn set_flag(self, to: &mut bool) {
        if let Some(x) = self.0[0] {
            *to = x != 0.0;
        }
    }
}

/// The record of the default properties of objects of a kind, such as `Model`.
pub(super) fn template(tree: &Tree<'_>, kind: &str) -> Option<u32> {
    let definitions = tree.child(None, "Definitions")?;
    let of_kind = |&r: &u32| {
        let record = tree.record(r);
        record.name == b"ObjectType" && record.text() == Some(kind.as_bytes())
    };
    let of_kind = tree.children(Some(definitions)).find(of_kind)?;
    tree.child(Some(of_kind), "PropertyTemplate")
}
