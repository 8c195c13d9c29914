//! Which files are read, and where results go.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use clap::Args;

use super::super::failure::Failure;
use super::super::target::NameArgs;
use crate::pipeline::Exit;
use crate::pipeline::items::{Found, MESH_EXTENSIONS, Search};
use crate::pipeline::paths::shown;
use plumbline_num::files::IfExists;
use plumbline_shape::mesh::MeshFormat;

/// Where results go.
#[derive(Debug, Args)]
pub(super) struct MeshTargetArgs {
    #[command(flatten)]
    names: NameArgs,
    /// Format of results that are named after their inputs; that of the input if left out
    #[arg(long, value_name = "EXT", conflicts_with = "output", value_parser = ["obj", "ply", "off", "stl", "gltf", "glb"])]
    format: Option<String>,
    /// Write PLY and STL as text
    #[arg(long)]
    ascii: bool,
    /// Replace existing files
    #[arg(short = 'y', visible_short_alias = 'f', long)]
    overwrite: bool,
}

/// A file to write.
pub(super) struct Target {
    pub(super) path: PathBuf,
    pub(super) ascii: bool,
    pub(super) if_exists: IfExists,
    /// It is in a folder of results, which is made where it is missing.
    pub(super) in_folder: bool,
}

impl MeshTargetArgs {
    /// A target for each input, checked before the first is read.
    pub(super) fn of(&self, inputs: &[Found]) -> Result<Vec<Target>, Failure> {
        let read: HashSet<PathBuf> = inputs.iter().filter_map(|input| input.path.canonicalize().ok()).collect();
        let (mut targets, mut seen) = (Vec::with_capacity(inputs.len()), HashSet::new());
        for input in inputs {
            let path = self.path_for(input, inputs.len())?;
            if !seen.insert(path.clone()) {
                return Err(Failure::usage(format!("two inputs would be written as `{}`", path.display())));
            }
            self.check(&path, &read)?;
            targets.push(Target {
                path,
                ascii: self.ascii,
                if_exists: IfExists::overwrite(self.overwrite),
                in_folder: self.names.out_dir.is_some(),
            });
        }
        Ok(targets)
    }

    fn path_for(&self, found: &Found, count: usize) -> Result<PathBuf, Failure> {
        let input = &found.path;
        if let Some(output) = &self.names.output {
            let several = || Failure::usage(format!("{count} inputs and one --output; give --out-dir or --suffix"));
            return if count == 1 { Ok(output.clone()) } else { Err(several()) };
        }
        let mut name = input.file_stem().unwrap_or_default().to_owned();
        name.push(self.names.suffix.as_deref().unwrap_or_default());
        if let Some(extension) = input.extension() {
            name.push(".");
            name.push(extension);
        }
        // In a folder of results the folders of the inputs are kept.
        let folder = match &self.names.out_dir {
            Some(folder) if found.rel == Path::new(".") => folder.clone(),
            Some(folder) => folder.join(&found.rel),
            None => input.parent().unwrap_or(Path::new("")).to_owned(),
        };
        let mut path = folder.join(name);
        if let Some(extension) = &self.format {
            path.set_extension(extension);
        }
        Ok(path)
    }

    fn check(&self, path: &Path, inputs: &HashSet<PathBuf>) -> Result<(), Failure> {
        let shown = path.display();
        if !MeshFormat::of_name(path).is_some_and(MeshFormat::is_writable) {
            let message = format!("`{shown}`: the extension is none of obj, ply, off, stl, gltf, glb");
            return Err(Failure::usage(message));
        }
        if path.canonicalize().is_ok_and(|path| inputs.contains(&path)) {
            return Err(Failure::usage(format!("`{shown}` is an input; results never replace inputs")));
        }
        // What is no file is refused by its kind where the result is written: it is never replaced.
        if !self.overwrite && path.is_file() {
            let message = format!("`{shown}` exists; allow to replace it with --overwrite");
            return Err(Failure { exit: Exit::Output, message, drawn: false });
        }
        Ok(())
    }
}

/// The inputs; folders stand for the mesh files below them, in order of their names.
pub(super) fn all_inputs(given: &[String], recurse: bool) -> Result<Vec<Found>, Failure> {
    let search = Search { extensions: &MESH_EXTENSIONS, recurse, ..Search::default() };
    let mut inputs: Vec<Found> = Vec::new();
    for pattern in given {
        let found = search.expand(std::slice::from_ref(pattern)).map_err(|bad| Failure::usage(bad[0].to_string()))?;
        if found.is_empty() {
            let shown = shown(pattern);
            let message = format!("{shown}: no mesh files here (obj ply off stl gltf glb fbx mesh)");
            return Err(Failure { exit: Exit::Input, message, drawn: false });
        }
        inputs.extend(found);
    }
    Ok(inputs)
}
