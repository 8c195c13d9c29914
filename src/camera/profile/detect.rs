//! Which format a text has.

use serde_json::Value;

use super::tree::At;
use super::{
    ExifFacts, Profile, ProfileError, colmap, gyroflow, json, kalibr, lensfun, ocam, opencv, woodscape, xml, yaml,
};

/// The lens that a text describes, as in [`super::read_lens`].
///
/// # Errors
/// [`ProfileError`] with what is wrong and where.
pub fn parse_lens(text: &str, picture: &ExifFacts) -> Result<Profile, ProfileError> {
    let text = text.trim_start_matches('\u{feff}');
    let start = text.trim_start();
    if start.starts_with('{') {
        let tree: Value = serde_json::from_str(text).map_err(|e| ProfileError::syntax("JSON", e))?;
        return from_tree(&tree, text, picture);
    }
    if start.starts_with('<') {
        let document = xml::document(start)?;
        return match document.root_element().tag_name().name() {
            "opencv_storage" => opencv::lens(&xml::storage(document.root_element())?, picture),
            "lensdatabase" => lensfun::lens_of_documents(&[document], picture),
            _ => Err(ProfileError::UnknownFormat),
        };
    }
    if ocam::is_calibration(text) {
        return ocam::lens(text);
    }
    if colmap::is_camera_list(text) {
        return colmap::lens(text, picture);
    }
    if !text.lines().any(|line| line.contains(':')) {
        return Err(ProfileError::UnknownFormat);
    }
    from_tree(&yaml::tree(text)?, text, picture)
}

/// The lens in a tree, recognized by its keys.
fn from_tree(tree: &Value, text: &str, picture: &ExifFacts) -> Result<Profile, ProfileError> {
    let root = At::root(tree);
    let has = |key: &str| root.get(key).is_some();
    if has("fisheye_params") || has("calib_params") {
        gyroflow::lens(&root)
    } else if has("intrinsic") || has("poly_order") {
        woodscape::lens(&root)
    } else if has("fx") || has("version") && has("model") {
        json::lens(&root, text)
    } else if has("parameter") || kalibr::cameras(&root).next().is_some() {
        kalibr::lens(&root, picture)
    } else {
        opencv::lens(tree, picture)
    }
}
