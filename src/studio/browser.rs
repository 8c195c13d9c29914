//! Opening the page in the user's browser.
//!
//! Arguments of processes are visible to all users of a machine, so that the link with its token is not one of them: the browser is
//! given a file that only this user may read, and that leads to the page.

use std::io::{self, Write as _};
use std::process::{Command, Stdio};

use crate::recovery::private_temporary_folder;

/// The program that opens a file with what the user has chosen for it.
const OPENER: &str = if cfg!(target_os = "macos") {
    "open"
} else if cfg!(windows) {
    "explorer"
} else {
    "xdg-open"
};

/// The file that leads to the page; removed when it is dropped.
#[derive(Debug)]
pub(crate) struct Redirect {
    /// Removed when it is dropped.
    _folder: tempfile::TempDir,
}

impl Redirect {
    /// A file in a private folder that leads to `url`.
    fn to(url: &str) -> io::Result<(Self, std::path::PathBuf)> {
        let folder = private_temporary_folder("plumbline-studio-", &std::env::temp_dir())?;
        let path = folder.path().join("open.html");
        let mut options = std::fs::OpenOptions::new();
        options.write(true).create_new(true);
        #[cfg(unix)]
        std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
        let page = format!(
            "<!doctype html><meta charset=\"utf-8\"><title>plumbline studio</title>\
             <meta http-equiv=\"refresh\" content=\"0; url={url}\"><a href=\"{url}\">plumbline studio</a>\n"
        );
        options.open(&path)?.write_all(page.as_bytes())?;
        Ok((Self { _folder: folder }, path))
    }
}

/// Opens the page.
///
/// # Errors
/// A file that cannot be written, or no program that opens it.
pub(crate) fn open(url: &str) -> io::Result<Redirect> {
    let (redirect, path) = Redirect::to(url)?;
    let quiet = Stdio::null;
    let mut child = Command::new(OPENER).arg(&path).stdin(quiet()).stdout(quiet()).stderr(quiet()).spawn()?;
    // Nobody else waits for it; some openers stay as long as the browser.
    std::thread::Builder::new().name("studio opener".to_owned()).spawn(move || child.wait())?;
    Ok(redirect)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[cfg(unix)]
    fn only_the_user_may_read_the_file_with_the_token() {
        use std::os::unix::fs::PermissionsExt as _;
        use std::path::Path;
        let (redirect, path) = Redirect::to("http://127.0.0.1:1/#token=ab").expect("written");
        let mode = |path: &Path| std::fs::metadata(path).expect("a file").permissions().mode() & 0o777;
        assert_eq!((mode(&path), mode(path.parent().expect("its folder"))), (0o600, 0o700));
        assert!(std::fs::read_to_string(&path).expect("a file").contains("url=http://127.0.0.1:1/#token=ab\""));
        drop(redirect);
        assert!(!path.exists());
    }
}
