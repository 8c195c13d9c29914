//! Files of lines that several processes append to.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::Path;

/// Appends whole lines, each of which ends with `\n`, by one write: the length of the file before, and what was written, bytes.
pub(super) fn append(path: &Path, lines: &str) -> io::Result<(u64, u64)> {
    let mut file = locked(path)?;
    let length = file.seek(SeekFrom::End(0))?;
    // A run that was killed may have left half a line.
    let torn = length > 0 && {
        let mut last = [0];
        file.seek(SeekFrom::End(-1))?;
        file.read_exact(&mut last)?;
        last != *b"\n"
    };
    let text = format!("{}{lines}", if torn { "\n" } else { "" });
    file.write_all(text.as_bytes())?;
    Ok((length, text.len() as u64))
}

/// Opens a file for appending, alone. The lock goes with the file; where there are no locks, appending by one write
/// must do.
pub(super) fn locked(path: &Path) -> io::Result<File> {
    loop {
        if path.metadata().is_ok_and(|meta| !meta.is_file()) {
            return Err(io::Error::other(format!("`{}` is no file", path.display())));
        }
        let file = File::options().read(true).append(true).create(true).open(path)?;
        let _ = file.lock();
        // Another run may have put a shorter file in its place while this one waited.
        if same_file(&file, path) {
            return Ok(file);
        }
    }
}

#[cfg(unix)]
fn same_file(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let of = |meta: io::Result<std::fs::Metadata>| meta.map(|m| (m.dev(), m.ino()));
    match (of(file.metadata()), of(path.metadata())) {
        (Ok(a), Ok(b)) => a == b,
        // It was removed, which ends no run: the next line begins a new one.
        (_, Err(e)) if e.kind() == io::ErrorKind::NotFound => false,
        _ => true,
    }
}

#[cfg(not(unix))]
fn same_file(_: &File, _: &Path) -> bool {
    true
}
