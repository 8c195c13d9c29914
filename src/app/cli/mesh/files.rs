//! Which files are read, and where results go.

use std::path::{Path, PathBuf};

use clap::Args;

use super::super::failure::Failure;
use super::super::target::TargetArgs;
use crate::pipeline::Exit;
use plumbline_num::files::IfExists;
use plumbline_shape::mesh::MeshFormat;

/// Where results go.
#[derive(Debug, Args)]
pub(super) struct MeshTargetArgs {
    #[command(flatten)]
    names: TargetArgs,
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
}

impl MeshTargetArgs {
    /// A target for each input, checked before the first is read.
    pub(super) fn of(&self, inputs: &[PathBuf]) -> Result<Vec<Target>, Failure> {
        let mut targets: Vec<Target> = Vec::new();
        for input in inputs {
            let path = self.path_for(input, inputs.len())?;
            if targets.iter().any(|other| other.path == path) {
                return Err(Failure::usage(format!("two inputs would be written as `{}`", path.display())));
            }
            self.check(&path, inputs)?;
            targets.push(Target { path, ascii: self.ascii, if_exists: IfExists::overwrite(self.overwrite) });
        }
        Ok(targets)
    }

    fn path_for(&self, input: &Path, count: usize) -> Result<PathBuf, Failure> {
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
        let folder = self.names.out_dir.as_deref().or(input.parent()).unwrap_or(Path::new(""));
        let mut path = folder.join(name);
        if let Some(extension) = &self.format {
            path.set_extension(extension);
        }
        Ok(path)
    }

    fn check(&self, path: &Path, inputs: &[PathBuf]) -> Result<(), Failure> {
        let shown = path.display();
        if !MeshFormat::of_name(path).is_some_and(|format| format != MeshFormat::Medit) {
            let message = format!("`{shown}`: the extension is none of obj, ply, off, stl, gltf, glb");
            return Err(Failure::usage(message));
        }
        let same = |input: &PathBuf| match (input.canonicalize(), path.canonicalize()) {
            (Ok(input), Ok(path)) => input == path,
            _ => false,
        };
        if inputs.iter().any(same) {
            return Err(Failure::usage(format!("`{shown}` is an input; results never replace inputs")));
        }
        if !self.overwrite && path.exists() {
            let message = format!("`{shown}` exists; allow to replace it with --overwrite");
            return Err(Failure { exit: Exit::Output, message, drawn: false });
        }
        Ok(())
    }
}

/// The inputs; folders stand for the mesh files in them, in order of their names.
pub(super) fn all_inputs(given: &[PathBuf]) -> Result<Vec<PathBuf>, Failure> {
    let mut inputs = Vec::new();
    for path in given {
        if !path.is_dir() {
            inputs.push(path.clone());
            continue;
        }
        let unreadable = |e: std::io::Error| {
            let message = format!("{}: cannot be read: {e}", path.display());
            Failure { exit: Exit::Input, message, drawn: false }
        };
        let mut inside = Vec::new();
        for entry in std::fs::read_dir(path).map_err(unreadable)? {
            let entry = entry.map_err(unreadable)?.path();
            if entry.is_file() && MeshFormat::of_name(&entry).is_some() {
                inside.push(entry);
            }
        }
        if inside.is_empty() {
            let message = format!("{}: no mesh files in this folder (obj ply off stl gltf glb mesh)", path.display());
            return Err(Failure { exit: Exit::Input, message, drawn: false });
        }
        inside.sort();
        inputs.extend(inside);
    }
    Ok(inputs)
}
