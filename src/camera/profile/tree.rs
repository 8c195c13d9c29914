//! Reading values out of a tree, each error with the path of the key.

use serde_json::Value;

use super::ProfileError;

/// A node of a tree, with its path.
#[derive(Clone)]
pub(super) struct At<'a> {
    pub(super) value: &'a Value,
    path: String,
}

impl<'a> At<'a> {
    pub(super) fn root(value: &'a Value) -> Self {
        Self { value, path: String::new() }
    }

    pub(super) fn path(&self) -> &str {
        &self.path
    }

    fn below(&self, key: &str) -> String {
        if self.path.is_empty() { key.to_owned() } else { format!("{}.{key}", self.path) }
    }

    /// The value of `key`; `None` for null.
    pub(super) fn get(&self, key: &str) -> Option<Self> {
        let value = self.value.get(key).filter(|v| !v.is_null())?;
        Some(Self { value, path: self.below(key) })
    }

    /// The value of the first of `keys` that is present.
    pub(super) fn any(&self, keys: &[&str]) -> Option<Self> {
        keys.iter().find_map(|key| self.get(key))
    }

    pub(super) fn need(&self, key: &str, expected: &'static str) -> Result<Self, ProfileError> {
        self.get(key).ok_or_else(|| ProfileError::Missing { key: self.below(key), expected })
    }

    /// Names and values of a mapping.
    pub(super) fn entries(&self) -> Vec<(&'a str, Self)> {
        let at = |(key, value): (&'a String, &'a Value)| (key.as_str(), Self { value, path: self.below(key) });
        self.value.as_object().map(|o| o.iter().map(at).collect()).unwrap_or_default()
    }

    pub(super) fn text(&self) -> Option<&'a str> {
        self.value.as_str()
    }

    /// A finite number, also one that is written as text.
    pub(super) fn number(&self) -> Result<f64, ProfileError> {
        let number = self.value.as_f64().or_else(|| self.text().and_then(|t| t.trim().parse().ok()));
        number.filter(|n| n.is_finite()).ok_or_else(|| ProfileError::value(&*self.path, self.value, "a number"))
    }

    pub(super) fn need_number(&self, key: &str) -> Result<f64, ProfileError> {
        self.need(key, "a number")?.number()
    }

    /// The number under `key`, or `default` where nothing is there.
    pub(super) fn number_or(&self, key: &str, default: f64) -> Result<f64, ProfileError> {
        self.get(key).map_or(Ok(default), |at| at.number())
    }

    /// All numbers of an array, of an array of rows, of a matrix with `data`, or one number.
    pub(super) fn numbers(&self) -> Result<Vec<f64>, ProfileError> {
        match self.value {
            Value::Array(items) => {
                let mut all = Vec::new();
                for (i, item) in items.iter().enumerate() {
                    let at = At { value: item, path: format!("{}[{i}]", self.path) };
                    all.extend(at.numbers()?);
                }
                Ok(all)
            }
            Value::Object(_) => self.need("data", "the numbers of the matrix")?.numbers(),
            _ => Ok(vec![self.number()?]),
        }
    }

    /// As many numbers as needed.
    pub(super) fn exactly<const N: usize>(&self) -> Result<[f64; N], ProfileError> {
        let numbers = self.numbers()?;
        let count = numbers.len();
        numbers.try_into().map_err(|_| {
            ProfileError::value(&*self.path, format!("a list of {count} numbers"), format!("a list of {N}"))
        })
    }

    /// At most as many numbers, the missing ones 0.
    pub(super) fn at_most<const N: usize>(&self) -> Result<[f64; N], ProfileError> {
        let numbers = self.numbers()?;
        if numbers.len() > N {
            let (value, expected) = (format!("a list of {} numbers", numbers.len()), format!("at most {N}"));
            return Err(ProfileError::value(&*self.path, value, expected));
        }
        let mut all = [0.0; N];
        all[..numbers.len()].copy_from_slice(&numbers);
        Ok(all)
    }
}
