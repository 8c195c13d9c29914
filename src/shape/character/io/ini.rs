//! Characters described by an `.ini` file that names their parts:
//!
//! ```text
//! SIMMESH      tbone.off
//! SKELETON     tbone.skel
//! ANIMATION    tbone0.anim tbone       and tbone1.anim, tbone2.anim … beside it
//! ```
//!
//! All parts are in the folder of the file.

use std::path::{Component, Path, PathBuf};

use super::text::malformed;
use super::{Rig, parse_anim, parse_skel, text_of};
use crate::character::RigFileError;
use crate::mesh::{Model, ReadLimits, read_model};
use plumbline_num::run::Run;

/// Largest number of animation files searched; bounds the work for a hostile folder.
const MAX_CLIPS: usize = 1000;

/// Reads a surface, its skeleton and its clips; binding them is up to the caller.
///
/// # Errors
/// [`RigFileError`], with the file name.
pub fn read_ini(path: &Path) -> Result<(Model, Rig), RigFileError> {
    let read = || {
        let (mut mesh, mut skeleton, mut movement, mut warnings) = (None, None, None, Vec::new());
        for (k, line) in text_of(path)?.lines().enumerate() {
            let mut words = line.split_whitespace();
            let (key, name) = (words.next(), words.next().map(|name| name.trim_matches('"')));
            let beside = || {
                let name = name.ok_or_else(|| malformed("ini", k + 1, "names no file"))?;
                inside(path, name).ok_or_else(|| {
                    malformed("ini", k + 1, format!("{name:?} leads outside the folder of the file; put it beside"))
                })
            };
            match key {
                None => {}
                Some("SIMMESH") => mesh = Some(beside()?),
                Some("SKELETON") => skeleton = Some(beside()?),
                Some("ANIMATION") => movement = Some((beside()?, words.next().map(str::to_owned))),
                Some(other) => warnings.push(format!("{other} is left out")),
            }
        }
        let missing = |key: &str| malformed("ini", 1, format!("has no line {key}"));
        let model = read_model(&mesh.ok_or_else(|| missing("SIMMESH"))?, &ReadLimits::default(), &Run::default())?;
        let at = skeleton.ok_or_else(|| missing("SKELETON"))?;
        let skeleton = text_of(&at).and_then(|text| parse_skel(&text)).map_err(|e| e.of_file(&at))?;
        let mut clips = Vec::new();
        for at in movement.map(files).unwrap_or_default() {
            let name = at.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
            let clip = text_of(&at).and_then(|text| parse_anim(&text, &name, &skeleton));
            clips.push(clip.map_err(|e| e.of_file(&at))?);
        }
        Ok((model, Rig { skeleton, clips, warnings }))
    };
    read().map_err(|e: RigFileError| e.of_file(path))
}

/// Path of a file in the folder of `path`; `None` if `name` leads outside.
fn inside(path: &Path, name: &str) -> Option<PathBuf> {
    let stays = Path::new(name).components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir));
    (stays && !name.is_empty()).then(|| path.parent().unwrap_or(Path::new("")).join(name))
}

/// The file, and the consecutively numbered files with the same base name.
fn files((first, base): (PathBuf, Option<String>)) -> Vec<PathBuf> {
    let Some(base) = base.filter(|base| Path::new(base).components().count() == 1) else { return vec![first] };
    let numbered = (1..MAX_CLIPS).map(|k| first.with_file_name(format!("{base}{k}.anim")));
    let beside: Vec<PathBuf> = numbered.take_while(|file| file.is_file()).collect();
    std::iter::once(first).chain(beside).collect()
}
