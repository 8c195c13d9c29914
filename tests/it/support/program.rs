//! Runs the built program.

use std::io::Write;
use std::path::Path;
use std::process::{Command, Output, Stdio};

/// The program in `folder`, without color, and without the cache of the user who runs the tests.
pub(crate) fn command(folder: &Path, args: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_plumbline"));
    command.args(args).current_dir(folder).env("NO_COLOR", "1").env("PLUMBLINE_CACHE", "");
    command
}

/// Runs it to its end, with all details printed.
pub(crate) fn plumbline_in(folder: &Path, args: &[&str]) -> Output {
    command(folder, args).arg("-v").output().expect("the program starts")
}

/// Runs it with `input` on standard input.
pub(crate) fn plumbline_fed(folder: &Path, args: &[&str], input: &[u8]) -> Output {
    let mut command = command(folder, args);
    let piped = command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = piped.spawn().expect("the program starts");
    let mut stdin = child.stdin.take().expect("piped");
    stdin.write_all(input).expect("the program reads");
    drop(stdin);
    child.wait_with_output().expect("the program ends")
}

/// Runs it and insists on success.
pub(crate) fn succeed(folder: &Path, args: &[&str]) -> Output {
    let output = plumbline_in(folder, args);
    assert_eq!(output.status.code(), Some(0), "{args:?}: {}", err(&output));
    output
}

/// What it wrote to standard output.
pub(crate) fn out(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// What it wrote to standard error.
pub(crate) fn err(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Names of the files in `folder`, sorted; the record of a batch is left out.
pub(crate) fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).expect("a folder");
    let mut names: Vec<_> = entries.map(|e| e.expect("an entry").file_name().into_string().expect("UTF-8")).collect();
    names.retain(|name| name != ".plumbline");
    names.sort();
    names
}
