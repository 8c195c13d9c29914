use std::fs::File;

use serde_json::{Value as Json, json};

use super::*;

fn cache() -> (tempfile::TempDir, Cache) {
    let folder = tempfile::tempdir().expect("a folder");
    let cache = Cache::open(&folder.path().join("cache"), false).expect("a cache");
    (folder, cache)
}

fn key(of: &str) -> Key {
    Key::new("test", 1, [("of", json!(of)), ("set", json!({"points": 600, "weight": 0.1}))])
}

fn store(cache: &Cache, key: &Key, bytes: &[u8]) {
    let mut entry = cache.begin(key, &[]).expect("begun");
    entry.write("a", bytes).expect("written");
    entry.publish().expect("published");
}

fn found(cache: &Cache, key: &Key) -> Option<Entry> {
    cache.find(key).expect("read")
}

#[test]
fn every_part_of_a_key_makes_another() {
    let all = [
        key("x"),
        key("y"),
        Key::new("other", 1, [("of", json!("x")), ("set", json!({"points": 600, "weight": 0.1}))]),
        Key::new("test", 2, [("of", json!("x")), ("set", json!({"points": 600, "weight": 0.1}))]),
        Key::new("test", 1, [("of", json!("x")), ("set", json!({"points": 601, "weight": 0.1}))]),
        Key::new("test", 1, [("of", json!("x"))]),
    ];
    let mut hashes: Vec<_> = all.iter().map(|key| key.hash.clone()).collect();
    hashes.sort_unstable();
    hashes.dedup();
    assert_eq!(hashes.len(), all.len());
    // The order in which they are named is none.
    let parts = [("a", json!(1)), ("b", json!(2))];
    assert_eq!(Key::new("test", 1, parts.clone()), Key::new("test", 1, parts.into_iter().rev()));
}

#[test]
fn what_was_stored_is_found_and_what_was_not_published_is_not() {
    let (_folder, cache) = cache();
    let key = key("x");
    assert!(found(&cache, &key).is_none());
    let mut dropped = cache.begin(&key, &[]).expect("begun");
    dropped.write("a", b"never").expect("written");
    drop(dropped);
    assert!(found(&cache, &key).is_none());
    store(&cache, &key, b"content");
    // Made again, as by force.
    store(&cache, &key, b"as well");
    let entry = found(&cache, &key).expect("there");
    assert_eq!((entry.len(), entry.read(0).expect("whole")), (1, b"as well".to_vec()));
    assert!(entry.read(1).is_err());
    assert_eq!(cache.usage().expect("read").entries, 1);
    assert_eq!(folders_in(&cache.entries_folder()).expect("read").len(), 1, "nothing is left over");
}

#[test]
fn damage_is_found_when_it_is_read() {
    let (_folder, cache) = cache();
    let key = key("x");
    for change in [b"contenX".as_slice(), b"conten", b"content and more", b""] {
        store(&cache, &key, b"content");
        fs::write(cache.entry_folder(&key.hash).join("a"), change).expect("written");
        let error = found(&cache, &key).expect("there").read(0).expect_err("damaged");
        assert_eq!(error.kind(), io::ErrorKind::InvalidData);
        cache.remove(&key).expect("removed");
    }
    store(&cache, &key, b"content");
    let meta = cache.entry_folder(&key.hash).join(META);
    let good = fs::read_to_string(&meta).expect("read");
    fs::write(&meta, good.replace("\"a\"", "\"../../../secret\"")).expect("written");
    assert!(found(&cache, &key).expect("there").read(0).is_err(), "no file outside is read");
    for text in ["{", "", &good.replace("600", "601"), &good.replace("\"test\"", "\"other\"")] {
        fs::write(&meta, text).expect("written");
        assert_eq!(cache.find(&key).expect_err("damaged").to_string(), "damaged: meta.json", "{text}");
    }
}

#[cfg(unix)]
#[test]
fn what_is_no_file_is_not_waited_for() {
    let (_folder, cache) = cache();
    let key = key("x");
    store(&cache, &key, b"content");
    let file = cache.entry_folder(&key.hash).join("a");
    fs::remove_file(&file).expect("removed");
    let made = std::process::Command::new("mkfifo").arg(&file).status();
    if made.is_ok_and(|status| status.success()) {
        assert!(found(&cache, &key).expect("there").read(0).is_err());
    }
}

#[test]
fn those_not_used_for_longest_go_first() {
    let (_folder, cache) = cache();
    let keys = ["a", "b", "c"].map(key);
    for (age, key) in (1..).zip(&keys) {
        store(&cache, key, &[0; 1000]);
        let meta = File::open(cache.entry_folder(&key.hash).join(META)).expect("there");
        meta.set_modified(SystemTime::now() - Duration::from_secs(1000 * age)).expect("set");
    }
    // Used again: the oldest is now the newest.
    assert!(found(&cache, &keys[2]).is_some());
    let one = cache.usage().expect("read").bytes / 3;
    let removed = cache.shrink(2 * one).expect("shrunk");
    assert_eq!((removed.entries, removed.bytes), (1, one));
    assert_eq!(keys.each_ref().map(|key| found(&cache, key).is_some()), [true, false, true]);
    assert_eq!(cache.clear().expect("cleared").entries, 2);
}

#[test]
fn a_digest_is_of_the_content_and_follows_its_changes() {
    let (folder, cache) = cache();
    let path = folder.path().join("clip.mp4");
    let notes = || folders_in(&cache.folder.join("sources")).expect("read").len();
    let write = |text: &str, age: Duration| {
        fs::write(&path, text).expect("written");
        let file = File::options().write(true).open(&path).expect("there");
        file.set_modified(SystemTime::now() - age).expect("set");
        cache.digest_of(&path).expect("read")
    };
    let old = Duration::from_secs(100);
    let first = write("one", old);
    assert_eq!((first.as_str(), notes()), (blake3::hash(b"one").to_hex().as_str(), 1));
    assert_eq!(cache.digest_of(&path).expect("read"), first);
    assert_ne!(write("three", old), first);
    // The next change of a file that was changed just now may show in none of its times.
    let noted = notes();
    write("four", Duration::ZERO);
    assert_eq!(notes(), noted);
    cache.clear().expect("cleared");
    let shelves = folders_in(&cache.folder.join("sources")).expect("read");
    assert!(shelves.iter().all(|shelf| fs::read_dir(shelf).expect("read").next().is_none()));
}

#[test]
fn a_result_is_explained_by_the_one_that_is_most_like_it() {
    let (folder, cache) = cache();
    let source = folder.path().join("clip.mp4");
    fs::write(&source, "pictures").expect("written");
    for (k, (points, mask)) in [(600, "a"), (800, "a"), (900, "b")].into_iter().enumerate() {
        let key = Key::new("video.track", 1, [("set", json!({"points": points})), ("mask", json!(mask))]);
        let entry = cache.begin(&key, std::slice::from_ref(&source)).expect("begun");
        entry.publish().expect("published");
        // As if time had passed.
        let meta = cache.entry_folder(&key.hash).join(META);
        let mut json: Json = serde_json::from_slice(&fs::read(&meta).expect("read")).expect("JSON");
        json["made"] = json!(1000 + k);
        fs::write(&meta, json.to_string()).expect("written");
    }
    let all = cache.why(&source).expect("read");
    let differences: Vec<Option<Vec<String>>> = all
        .iter()
        .map(|e| Some(e.nearest.as_ref()?.1.iter().map(|d| format!("{} {} {}", d.part, d.now, d.then)).collect()))
        .collect();
    let newest = vec!["mask b a".to_owned(), "set.points 900 800".to_owned()];
    assert_eq!(differences, [Some(newest), Some(vec!["set.points 800 600".to_owned()]), None]);
    assert_eq!(cache.why(folder.path()).expect("read"), []);
}

#[test]
fn looking_into_a_cache_does_not_make_one() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("none");
    assert!(Cache::existing(&path, false).expect("nothing wrong").is_none() && !path.exists());
}

#[cfg(unix)]
#[test]
fn a_cache_that_others_may_write_to_is_refused_unless_it_is_trusted() {
    use std::os::unix::fs::PermissionsExt;
    let (_folder, cache) = cache();
    assert_eq!(cache.folder.metadata().expect("there").permissions().mode() & 0o777, 0o700);
    fs::set_permissions(&cache.folder, fs::Permissions::from_mode(0o777)).expect("set");
    assert_eq!(Cache::open(&cache.folder, false).expect_err("refused").kind(), io::ErrorKind::PermissionDenied);
    assert!(Cache::existing(&cache.folder, false).is_err());
    assert!(Cache::open(&cache.folder, true).is_ok());
}
