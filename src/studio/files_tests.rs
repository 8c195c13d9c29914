//! Laws of the files of a document.

use super::*;

fn folder() -> tempfile::TempDir {
    tempfile::tempdir().expect("a temporary folder")
}

fn files(folder: &Path) -> DocumentFiles {
    std::fs::write(folder.join("a.obj"), "v 0 0 0\n").expect("written");
    DocumentFiles::new(folder.join("a.obj"), BTreeMap::new())
}

#[test]
fn what_waits_is_read_before_what_is_on_the_disk() {
    let folder = folder();
    let mut files = files(folder.path());
    let side = files.side_file(".deform.toml");
    assert_eq!(side, folder.path().join("a.deform.toml"));
    assert_eq!(files.read(&side, 100).expect("no file"), None);
    files.write(&side, *b"x");
    assert_eq!(files.read(&side, 100).expect("what waits").as_deref(), Some(b"x".as_slice()));
    assert!(!side.exists());
    files.publish().expect("written");
    assert_eq!(std::fs::read(&side).expect("the file"), b"x");
    assert!(files.pending().is_empty());
}

#[test]
fn files_that_are_too_large_are_refused() {
    let folder = folder();
    let files = files(folder.path());
    let refused = files.read(files.opened(), 7).expect_err("8 bytes");
    assert!(refused.to_string().contains("larger than 7 bytes"), "{refused}");
    assert!(files.read(files.opened(), 8).expect("8 bytes").is_some());
}

#[test]
fn files_outside_the_folders_are_neither_read_nor_written() {
    let (folder, other) = (folder(), folder());
    let secret = other.path().join("secret");
    std::fs::write(&secret, "s").expect("written");
    let mut files = files(folder.path());
    assert!(files.read(&secret, 100).is_err());
    assert!(files.confined(Path::new("../secret")).is_err());
    files.write(&secret, *b"x");
    assert!(files.publish().is_err());
    assert_eq!(files.pending().len(), 1, "what waits is not lost");
    assert_eq!(std::fs::read(&secret).expect("the file"), b"s");
    let allowed = files.clone().with_allowed(vec![other.path().to_owned()].into());
    assert!(allowed.read(&secret, 100).is_ok());
}

#[test]
fn no_file_is_replaced_where_another_one_cannot_be_written() {
    let folder = folder();
    let mut files = files(folder.path());
    let [first, taken] = ["a.json", "b.json"].map(|name| folder.path().join(name));
    std::fs::write(&first, "before").expect("written");
    std::fs::create_dir(&taken).expect("a folder of this name");
    files.write(&first, *b"after");
    files.write(&taken, *b"after");
    let refused = files.publish().expect_err("a folder is no file").to_string();
    assert!(refused.contains("b.json: cannot be saved: "), "{refused}");
    assert_eq!(std::fs::read(&first).expect("the file"), b"before");
    assert_eq!(folder.path().read_dir().expect("the folder").count(), 3, "nothing unfinished stays");
    std::fs::remove_dir(&taken).expect("removed");
    files.publish().expect("what waited is written");
    assert_eq!(std::fs::read(&first).expect("the file"), b"after");
}

#[test]
#[cfg(unix)]
fn links_out_of_the_folder_are_neither_read_nor_written() {
    let (folder, other) = (folder(), folder());
    let secret = other.path().join("secret");
    std::fs::write(&secret, "s").expect("written");
    let link = folder.path().join("link");
    std::os::unix::fs::symlink(&secret, &link).expect("a link");
    let mut files = files(folder.path());
    assert!(files.read(&link, 100).is_err());
    files.write(&link, *b"x");
    assert!(files.publish().is_err());
    assert_eq!(std::fs::read(&secret).expect("the file"), b"s");
}

#[test]
fn a_change_by_another_program_is_seen_and_one_of_ours_is_not() {
    let folder = folder();
    let mut files = files(folder.path());
    let side = files.side_file(".json");
    files.read(&side, 100).expect("no file yet");
    assert!(files.changed_on_disk().is_empty());
    files.write(&side, *b"ours");
    files.publish().expect("written");
    assert!(files.changed_on_disk().is_empty());
    std::fs::write(&side, "of another").expect("written");
    assert_eq!(files.changed_on_disk(), std::slice::from_ref(&side));
    files.accept_disk();
    assert!(files.changed_on_disk().is_empty());
    std::fs::remove_file(&side).expect("removed");
    assert_eq!(files.changed_on_disk(), [side]);
}
