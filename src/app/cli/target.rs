//! Where the results of a command go: one file, or a name for each input.

use std::path::{Path, PathBuf};

use clap::{ArgGroup, Args};

use super::failure::Failure;
use super::job::{may_be_many, only_input};
use crate::pipeline::file::{entries_of, literal_path};
use crate::pipeline::options::{BatchSettings, Foreach};
use crate::pipeline::reference::escape;
use crate::pipeline::syntax::Entry;

/// Options of pipelines that take one input or many.
#[derive(Debug, Args)]
pub(super) struct TargetArgs {
    #[command(flatten)]
    names: NameArgs,
    /// Write all results directly to --out-dir, whatever folders their inputs are in
    #[arg(id = "flat_tree", long = "flat", requires = "out_dir")]
    flat: bool,
    /// Of a folder, take only the files directly in it; by default folders are searched at any depth
    #[arg(long)]
    pub(super) no_recurse: bool,
}

/// The names of results.
#[derive(Debug, Args)]
#[command(group = ArgGroup::new("target").required(true).multiple(true).args(["output", "out_dir", "suffix"]))]
pub(super) struct NameArgs {
    /// The file to write, for one input; its extension chooses the format; - for standard output, of clips
    #[arg(short, long, value_name = "OUTPUT", conflicts_with_all = ["out_dir", "suffix"])]
    pub(super) output: Option<PathBuf>,
    /// The folder to write to; results keep the names of their inputs, and the folders below a folder or glob that was given
    #[arg(long, value_name = "DIR")]
    pub(super) out_dir: Option<PathBuf>,
    /// Text after the name of each input, such as _steady; without --out-dir results are written beside their inputs
    #[arg(long, value_name = "TEXT", value_parser = suffix, allow_hyphen_values = true)]
    pub(super) suffix: Option<String>,
}

/// What is read and what is written, as templates.
pub(super) struct Names {
    /// The input.
    pub(super) source: String,
    /// The result.
    pub(super) output: String,
}

impl TargetArgs {
    /// The file, where one is named.
    pub(super) fn file(&self) -> Option<&Path> {
        self.names.output.as_deref()
    }

    /// One run for each input where results have names of their own; `jobs` at once, 0 for as many as processors and memory
    /// allow.
    pub(super) fn batch(&self, inputs: &[String], jobs: u32) -> Option<Vec<Entry>> {
        let patterns: Vec<String> = inputs.iter().map(|i| escape(i)).collect();
        let foreach = match patterns.as_slice() {
            [one] => Foreach::One(one.clone()),
            _ => Foreach::List(patterns),
        };
        let batch = BatchSettings { foreach, jobs, recurse: !self.no_recurse, ..BatchSettings::default() };
        self.names.output.is_none().then(|| entries_of(&batch, &BatchSettings::default()))
    }

    /// Input and result of a command; `many` says what its inputs are, such as `meshes`, and `extension` which extension
    /// results get that are named after them.
    pub(super) fn names(&self, inputs: &[String], many: &str, extension: &str) -> Result<Names, Failure> {
        match &self.names.output {
            Some(output) => Ok(Names { source: escape(only_input(inputs, many)?), output: literal_path(output) }),
            None => Ok(Names { source: "${item.path}".to_owned(), output: self.template(extension) }),
        }
    }

    /// The name of each result.
    pub(super) fn template(&self, extension: &str) -> String {
        let folder =
            self.names.out_dir.as_deref().map_or_else(|| "${item.dir}".to_owned(), |folder| self.mirrored(folder));
        format!("{folder}/{}.{extension}", self.stem())
    }

    /// There may be more than one input.
    pub(super) fn is_many(&self, inputs: &[String]) -> bool {
        let many = if let [one] = inputs { may_be_many(one) } else { true };
        self.names.output.is_none() && many
    }

    /// The name of a further file of each item: `given` itself for one input, in the folder `given` for many.
    pub(super) fn beside(&self, given: &Path, inputs: &[String], extension: &str) -> String {
        if !self.is_many(inputs) {
            return literal_path(given);
        }
        let dot = if extension.is_empty() { "" } else { "." };
        format!("{}/{}{dot}{extension}", self.mirrored(given), self.stem())
    }

    /// The folder of a result in `folder`, as a template: folders of the inputs are kept.
    fn mirrored(&self, folder: &Path) -> String {
        let folder = folder_of(folder);
        if self.flat { folder } else { format!("{folder}/${{item.rel}}") }
    }

    fn stem(&self) -> String {
        format!("${{item.stem}}{}", escape(self.names.suffix.as_deref().unwrap_or_default()))
    }
}

/// A folder as the beginning of a template.
fn folder_of(path: &Path) -> String {
    literal_path(path).trim_end_matches('/').to_owned()
}

/// Refuses a suffix that would be another folder, or no suffix.
fn suffix(text: &str) -> Result<String, String> {
    if text.is_empty() || text.contains(['/', '\\', '\0']) {
        return Err("expected text that can be a part of a file's name, such as _steady".to_owned());
    }
    Ok(text.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn target(out_dir: Option<&str>, suffix: Option<&str>) -> TargetArgs {
        let out_dir = out_dir.map(PathBuf::from);
        let names = NameArgs { output: None, out_dir, suffix: suffix.map(str::to_owned) };
        TargetArgs { names, flat: false, no_recurse: false }
    }

    #[test]
    fn a_suffix_goes_behind_the_name_beside_the_input_or_in_the_folder() {
        assert_eq!(target(None, Some("_steady")).template("mp4"), "${item.dir}/${item.stem}_steady.mp4");
        assert_eq!(target(Some("d/"), Some("-x")).template("mp4"), "d/${item.rel}/${item.stem}-x.mp4");
        assert_eq!(target(Some("d"), None).template("${item.ext}"), "d/${item.rel}/${item.stem}.${item.ext}");
        let flat = TargetArgs { flat: true, ..target(Some("d"), None) };
        assert_eq!(flat.template("mp4"), "d/${item.stem}.mp4");
        assert_eq!(target(None, Some("${x}")).template("mp4"), "${item.dir}/${item.stem}$${x}.mp4");
        for bad in ["", "a/b", "\\"] {
            assert!(suffix(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn further_files_are_named_for_one_input_and_lie_in_a_folder_for_many() {
        let inputs = |names: &[&str]| names.iter().map(|n| (*n).to_owned()).collect::<Vec<_>>();
        let beside = |inputs: &[String]| target(Some("d"), Some("_s")).beside(Path::new("r.html"), inputs, "html");
        assert_eq!(beside(&inputs(&["a.mp4"])), "r.html");
        assert_eq!(beside(&inputs(&["a.mp4", "b.mp4"])), "r.html/${item.rel}/${item.stem}_s.html");
        assert_eq!(beside(&inputs(&["*.mp4"])), "r.html/${item.rel}/${item.stem}_s.html");
    }
}
