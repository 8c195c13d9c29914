//! The paths among the settings of a stage, as its schema marks them.

use serde_json::Value as Json;

/// How a setting names a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum PathSetting {
    /// It is a path.
    Path,
    /// It is a path or a word, as that of a lens.
    PathOrWord,
}

/// Calls `each` for every path in `settings`, at any depth, with what its schema says of it; empty ones are left out.
///
/// # Errors
/// The first one of `each`.
pub(super) fn for_each_path<E>(
    schema: &Json,
    settings: &mut Json,
    each: &mut impl FnMut(&mut String, PathSetting) -> Result<(), E>,
) -> Result<(), E> {
    let of_schema = match schema["format"].as_str() {
        Some("path") => Some(PathSetting::Path),
        Some("lens") => Some(PathSetting::PathOrWord),
        _ => None,
    };
    match (settings, of_schema) {
        (Json::String(text), Some(setting)) if !text.is_empty() => each(text, setting),
        (Json::Array(list), Some(setting)) => list.iter_mut().try_for_each(|value| match value {
            Json::String(text) if !text.is_empty() => each(text, setting),
            _ => Ok(()),
        }),
        (Json::Array(list), None) => list.iter_mut().try_for_each(|value| for_each_path(&schema["items"], value, each)),
        (Json::Object(object), None) if schema["properties"].is_object() => {
            object.iter_mut().try_for_each(|(name, value)| for_each_path(&schema["properties"][name], value, each))
        }
        (value, None) => {
            let choices = ["anyOf", "oneOf"].iter().flat_map(|key| schema[*key].as_array().into_iter().flatten());
            choices.into_iter().try_for_each(|choice| for_each_path(choice, value, each))
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stages::find_in_task;
    use serde_json::json;

    #[test]
    fn paths_are_found_at_any_depth_and_once() {
        let kind = find_in_task("part.chunk").expect("a kind");
        let mut settings =
            json!({"folder": "out/parts", "chunk": 3, "encode": {"path": "out/a.mp4", "preset": "fast"}});
        let mut found = Vec::new();
        let each = &mut |text: &mut String, setting: PathSetting| {
            found.push((text.clone(), setting));
            text.insert(0, '/');
            Ok::<(), ()>(())
        };
        for_each_path(&kind.json_schema(), &mut settings, each).expect("no fault");
        found.sort_by(|a, b| a.0.cmp(&b.0));
        let path = |text: &str| (text.to_owned(), PathSetting::Path);
        assert_eq!(found, [path("out/a.mp4"), path("out/parts")]);
        assert_eq!(settings["encode"]["path"], "/out/a.mp4");
    }
}
