//! A new name for a file, and never another file's.

use std::fs::File;
use std::io;
use std::path::Path;

/// Renames `from` to `to`, which must not exist: of several that do this at once one succeeds.
///
/// The system does it in one step where it can. File systems without that step (NFS) get a second link, and the first is
/// removed; those without links (FAT under some drivers) an empty file that reserves the name and is replaced at once: there
/// a reader may see the empty file for an instant, and a kill in this instant leaves it.
///
/// # Errors
/// [`io::ErrorKind::AlreadyExists`]; what the system says otherwise.
pub(super) fn rename_new(from: &Path, to: &Path) -> io::Result<()> {
    if let Some(done) = in_one_step(from, to) {
        return done;
    }
    match by_link(from, to) {
        Err(e) if e.kind() == io::ErrorKind::AlreadyExists => Err(e),
        Err(_) => by_reservation(from, to),
        Ok(()) => Ok(()),
    }
}

/// `None` where kernel or file system cannot do it.
#[cfg(target_os = "linux")]
fn in_one_step(from: &Path, to: &Path) -> Option<io::Result<()>> {
    use rustix::fs::{CWD, RenameFlags, renameat_with};
    use rustix::io::Errno;
    match renameat_with(CWD, from, CWD, to, RenameFlags::NOREPLACE) {
        Err(Errno::INVAL | Errno::NOSYS | Errno::NOTSUP) => None,
        done => Some(done.map_err(io::Error::from)),
    }
}

#[cfg(not(target_os = "linux"))]
fn in_one_step(_: &Path, _: &Path) -> Option<io::Result<()>> {
    None
}

fn by_link(from: &Path, to: &Path) -> io::Result<()> {
    std::fs::hard_link(from, to)?;
    // The result has its name; the other one is swept by the next run where it cannot be removed now.
    let _ = std::fs::remove_file(from);
    Ok(())
}

fn by_reservation(from: &Path, to: &Path) -> io::Result<()> {
    File::create_new(to)?;
    std::fs::rename(from, to).inspect_err(|_| {
        let _ = std::fs::remove_file(to);
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_way_to_a_new_name_spares_an_existing_file() {
        type Way = fn(&Path, &Path) -> io::Result<()>;
        let ways: [Way; 4] =
            [rename_new, |a, b| in_one_step(a, b).unwrap_or_else(|| rename_new(a, b)), by_link, by_reservation];
        for (k, way) in ways.into_iter().enumerate() {
            let folder = tempfile::tempdir().expect("temporary folder");
            let [a, b, c] = ["a", "b", "c"].map(|n| folder.path().join(n));
            std::fs::write(&a, b"a").expect("write");
            std::fs::write(&b, b"b").expect("write");
            assert_eq!(way(&a, &b).expect_err("b exists").kind(), io::ErrorKind::AlreadyExists, "way {k}");
            assert_eq!(
                (std::fs::read(&a).expect("kept"), std::fs::read(&b).expect("kept")),
                (b"a".into(), b"b".into())
            );
            way(&a, &c).expect("a new name");
            assert!(!a.exists(), "way {k}");
            assert_eq!(std::fs::read(&c).expect("renamed"), b"a");
        }
    }

    #[test]
    fn of_many_at_once_one_gets_the_name() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let target = folder.path().join("target");
        for way in [rename_new, by_link, by_reservation] {
            let attempt = |k: usize| {
                let from = folder.path().join(format!("{k}"));
                std::fs::write(&from, [k as u8]).expect("write");
                way(&from, &target).is_ok()
            };
            let attempts = std::thread::scope(|scope| {
                let threads: Vec<_> = (0..8).map(|k| scope.spawn(move || attempt(k))).collect();
                threads.into_iter().map(|t| t.join().expect("no panic")).collect::<Vec<bool>>()
            });
            assert_eq!(attempts.iter().filter(|done| **done).count(), 1);
            let winner = attempts.iter().position(|done| *done).expect("one");
            assert_eq!(std::fs::read(&target).expect("published"), [winner as u8]);
            std::fs::remove_file(&target).expect("removed");
        }
    }
}
