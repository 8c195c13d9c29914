//! Laws of recovery files.

use super::*;

fn texts(of: &[(&str, &str)]) -> Texts {
    of.iter().map(|(path, text)| (PathBuf::from(path), text.as_bytes().into())).collect()
}

fn recovery() -> (tempfile::TempDir, Recovery) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let recovery = Recovery::in_folder(folder.path().join("a/b")).expect("a folder");
    (folder, recovery)
}

#[test]
fn what_is_kept_is_read_again_and_forgotten_once_it_is_removed() {
    let (_folder, recovery) = recovery();
    let kept = texts(&[("/a/x.toml", "version = 1\n"), ("/a/x.json", ""), ("/a/ü.bin", "\n\0\n")]);
    let opened = Path::new("/a/x.obj");
    assert_eq!(recovery.load(opened).expect("a folder"), None);
    recovery.store(opened, &kept).expect("written");
    assert_eq!(recovery.load(opened).expect("read"), Some(kept));
    assert_eq!(recovery.load(Path::new("/b/x.obj")).expect("a folder"), None);
    recovery.remove(opened).expect("removed");
    recovery.remove(opened).expect("removing twice is no fault");
    assert_eq!(recovery.load(opened).expect("a folder"), None);
}

#[test]
#[cfg(unix)]
fn only_the_user_may_look_into_the_folder() {
    let (_folder, recovery) = recovery();
    let mode =
        std::os::unix::fs::PermissionsExt::mode(&std::fs::metadata(&recovery.folder).expect("a folder").permissions());
    assert_eq!(mode & 0o777, 0o700);
}

#[test]
fn damaged_files_are_refused_and_put_aside() {
    let (_folder, recovery) = recovery();
    let opened = Path::new("/a/x.obj");
    recovery.store(opened, &texts(&[("/a/x.toml", "version = 1\n")])).expect("written");
    let file = recovery.file(opened);
    let good = std::fs::read(&file).expect("the file");
    let huge = String::from_utf8_lossy(&good).replace(",12]", ",18446744073709551615]").into_bytes();
    assert_ne!(huge, good);
    let longer = [good.as_slice(), b"x"].concat();
    for bad in [&good[..good.len() - 1], &huge, &longer, b"", b"\n", b"{}\n"] {
        std::fs::write(&file, bad).expect("written");
        assert!(recovery.load(opened).is_err(), "{}", String::from_utf8_lossy(bad));
    }
    let aside = recovery.put_aside(opened).expect("renamed");
    assert!(aside.is_file());
    assert_eq!(recovery.load(opened).expect("a folder"), None);
}
