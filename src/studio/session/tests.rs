//! Laws of a document's thread, with the tiny workspace of numbers.

use std::time::{Duration, Instant};

use serde_json::{Value, json};

use super::test_document::{Client, drag, eventually, file_in, open_again, opened, pause, set, three};
use super::*;
use crate::fake::{Fake, NUMBERS};

#[test]
fn a_new_window_is_sent_everything_that_is_known() {
    let opened = three();
    let mut window = opened.window();
    let hello = window.read();
    assert_eq!(hello["hello"], json!({"proto": 1, "workspace": "fake", "document": "1", "name": "a.fake"}));
    window.rest();
    assert_eq!(window.state["sum"], 6.0);
    assert_eq!((window.labels(), &window.history["savedAt"]), (vec!["Opened".to_owned()], &json!(0)));
    eventually("a buffer", || {
        matches!(window.window.try_next(), Some(Outgoing::Buffer(_))) || !window.buffers.is_empty()
    });
}

#[test]
fn what_was_to_be_said_before_a_window_was_there_is_said_to_the_first() {
    let opened = opened(r#"{"numbers":[-1]}"#);
    pause(100);
    let mut window = opened.window();
    let notice = window.until(|m| m.get("notice").is_some());
    assert_eq!(notice["notice"]["text"], "the sum is negative");
    let mut second = opened.window();
    second.send(json!({"ask": {"ask": "sum"}}));
    let next = second.until(|m| m.get("notice").is_some() || m.get("reply").is_some());
    assert!(next.get("notice").is_none(), "it is said once: {next}");
}

#[test]
fn the_state_after_an_edit_comes_before_its_reply() {
    let opened = three();
    let mut window = opened.window();
    window.done(set(0, 11.0));
    assert_eq!(window.state["sum"], 16.0);
    assert_eq!(window.labels(), ["Opened", "Set number 0"]);
}

#[test]
fn who_sees_a_state_can_undo_it() {
    let opened = three();
    let mut window = opened.window();
    window.rest();
    window.send(set(0, 11.0));
    let first = window.until(|m| m.get("state").is_some() || m.get("history").is_some());
    assert!(first.get("history").is_some(), "{first}");
}

#[test]
fn a_refused_edit_changes_nothing_and_says_why() {
    let opened = three();
    let mut window = opened.window();
    for (message, word) in [
        (set(3, 0.0), "there is no number 3 (expected 0 to 3)"),
        (json!({"edit": {"do": "fly"}}), "malformed message: unknown variant `fly`"),
        (json!({"edit": 3}), "malformed message"),
        (json!({"view": {"scale": "x"}}), "malformed message"),
        (json!({"ask": {"ask": "why"}}), "malformed message"),
        (json!({"undo": true}), "nothing to undo"),
        (json!({"goto": 9}), "there is no such step"),
    ] {
        let reply = window.ask(message);
        assert!(reply["error"].as_str().is_some_and(|e| e.contains(word)), "{word}: {reply}");
    }
    assert_eq!((window.sum(), window.labels().len()), (6.0, 1));
}

#[test]
fn an_edit_that_changes_nothing_is_no_step() {
    let opened = three();
    let mut window = opened.window();
    window.done(set(0, 1.0));
    assert_eq!(window.labels(), ["Opened"]);
}

#[test]
fn undo_and_redo_give_the_same_file_byte_for_byte() {
    let opened = three();
    let mut window = opened.window();
    let mut texts = Vec::new();
    let saved = |window: &mut Client<'_>| {
        window.done(json!({"save": true}));
        opened.on_disk()
    };
    for k in 0..20 {
        window.done(json!({"edit": {"do": "append", "number": f64::from(k) / 3.0}}));
        texts.push(saved(&mut window));
    }
    for text in texts.iter().rev().skip(1) {
        window.done(json!({"undo": true}));
        assert_eq!(saved(&mut window), *text);
    }
    for text in &texts[1..] {
        window.done(json!({"redo": true}));
        assert_eq!(saved(&mut window), *text);
    }
    window.done(json!({"goto": 5}));
    assert_eq!(saved(&mut window), texts[4]);
}

#[test]
fn drags_are_one_step_until_the_pointer_is_released() {
    let opened = three();
    let mut window = opened.window();
    for k in 0..5 {
        window.done(drag(1, f64::from(k)));
    }
    assert_eq!(window.labels(), ["Opened", "Set number 1"]);
    window.done(json!({"seal": true}));
    window.done(drag(1, 50.0));
    assert_eq!(window.labels(), ["Opened", "Set number 1", "Set number 1"]);
    window.done(json!({"undo": true}));
    assert_eq!(window.sum(), 8.0);
}

#[test]
fn a_letter_stops_the_running_slice() {
    let opened = three();
    let mut window = opened.window();
    window.done(json!({"edit": {"do": "slow", "ms": 5000}}));
    window.until_it_works();
    let started = Instant::now();
    assert_eq!(window.sum(), 6.0);
    assert!(started.elapsed() < Duration::from_secs(3), "{:?}", started.elapsed());
    window.done(json!({"undo": true}));
    window.until(|m| m["working"] == false);
    assert!(window.state["stopped"].as_u64() >= Some(1), "{}", window.state);
}

#[test]
fn a_new_edit_stops_a_long_slice_soon() {
    let opened = three();
    let mut window = opened.window();
    window.done(json!({"edit": {"do": "slow", "ms": 5000}}));
    window.until_it_works();
    let started = Instant::now();
    window.done(json!({"edit": {"do": "slow", "ms": 0}}));
    assert!(started.elapsed() < Duration::from_secs(3), "{:?}", started.elapsed());
}

#[test]
fn edits_faster_than_pictures_do_not_keep_pictures_from_being_made() {
    let opened = opened(r#"{"numbers":[1,2,3],"slice_ms":100}"#);
    let mut window = opened.window();
    window.rest();
    let before = window.state["slices"].as_u64().expect("a count");
    let mut k = 0.0;
    eventually("six pictures of 100 ms while an edit comes every other millisecond", || {
        k += 1.0;
        window.send(drag(0, k));
        while let Some(outgoing) = window.window.try_next() {
            if let Outgoing::Text(text) = outgoing {
                window.note(serde_json::from_str(&text).expect("JSON"));
            }
        }
        window.state["slices"].as_u64().expect("a count") >= before + 6
    });
}

#[test]
fn every_message_is_answered_once_also_drags_that_were_replaced() {
    let opened = opened(r#"{"numbers":[1,2,3],"slice_ms":30}"#);
    let mut window = opened.window();
    let ids: Vec<u32> = (0..40).map(|k| window.send(drag(0, f64::from(k)))).collect();
    let last = window.send(json!({"ask": {"ask": "sum"}}));
    let mut answered = vec![0; ids.len() + 2];
    loop {
        let message = window.read();
        if let Some(id) = message["reply"].as_u64() {
            answered[id as usize] += 1;
        }
        if message["working"] == false && answered[last as usize] > 0 {
            break;
        }
    }
    assert_eq!(answered[1..], vec![1; ids.len() + 1]);
    assert_eq!(window.sum(), 44.0, "the last drag is the one that counts");
}

#[test]
fn a_window_that_does_not_read_gets_fewer_pictures_and_no_heap_of_them() {
    let opened = three();
    let (mut quick, slow) = (opened.window(), opened.window());
    quick.rest();
    for k in 0..300 {
        quick.done(set(0, f64::from(k)));
    }
    let (mut texts, mut pictures) = (0, 0);
    while let Some(outgoing) = slow.window.try_next() {
        match outgoing {
            Outgoing::Text(_) => texts += 1,
            Outgoing::Buffer(bytes) => {
                assert_eq!(bytes[..4], NUMBERS.to_le_bytes());
                pictures += 1;
            }
        }
    }
    assert!(texts <= 5 && pictures <= 2, "{texts} texts, {pictures} pictures");
}

#[test]
fn both_windows_of_a_document_see_an_edit_and_each_its_own_number() {
    let opened = three();
    let (mut one, mut two) = (opened.window(), opened.window());
    let picture_of = |window: &mut Client<'_>, first: f64, edit: u32| {
        let matches = |bytes: &Vec<u8>| bytes[16..24] == first.to_le_bytes() && bytes[8..12] == edit.to_le_bytes();
        eventually("the picture", || {
            while let Some(outgoing) = window.window.try_next() {
                match outgoing {
                    Outgoing::Text(text) => drop(window.note(serde_json::from_str(&text).expect("JSON"))),
                    Outgoing::Buffer(bytes) => window.buffers.push(bytes),
                }
            }
            window.buffers.iter().any(matches)
        });
    };
    one.next = 70;
    one.done(set(0, 10.0));
    picture_of(&mut one, 10.0, 70);
    picture_of(&mut two, 10.0, 0);
    assert_eq!(two.state["sum"], 15.0);
    two.done(json!({"undo": true}));
    picture_of(&mut one, 1.0, 70);
    assert_eq!(one.state["sum"], 6.0);
}

#[test]
fn a_panic_in_a_workspace_is_an_error_and_the_document_stays() {
    let opened = three();
    let mut window = opened.window();
    window.done(set(0, 4.0));
    for message in [json!({"edit": {"do": "panic"}}), json!({"ask": {"ask": "panic"}})] {
        let reply = window.ask(message);
        assert!(reply["error"].as_str().is_some_and(|e| e.starts_with("internal error: asked to")), "{reply}");
    }
    assert_eq!(window.sum(), 9.0);
    window.done(json!({"undo": true}));
    assert_eq!(window.sum(), 6.0);
    window.done(json!({"save": true}));
}

#[test]
fn unsaved_changes_outlive_the_program() {
    let opened = three();
    let mut window = opened.window();
    window.done(set(0, 4.0));
    let disk = opened.on_disk();
    let folder = opened.end();
    let opened = open_again(folder);
    let mut window = opened.window();
    let notice = window.until(|m| m.get("notice").is_some());
    assert!(notice["notice"]["text"].as_str().is_some_and(|t| t.contains("have been restored")), "{notice}");
    assert_eq!((window.sum(), &window.history["savedAt"]), (9.0, &Value::Null));
    assert_eq!(opened.on_disk(), disk, "restoring does not save");
    window.done(json!({"save": true}));
    let opened = open_again(opened.end());
    let mut window = opened.window();
    assert_eq!((window.sum(), window.labels()), (9.0, vec!["Opened".to_owned()]));
}

#[test]
fn unsaved_changes_are_kept_soon_after_a_change_and_not_only_at_the_end() {
    let opened = three();
    let kept = || std::fs::read_dir(opened.folder.path().join("state")).expect("a folder").count();
    let mut window = opened.window();
    assert_eq!(kept(), 0);
    window.done(set(0, 4.0));
    eventually("a copy of the change", || kept() == 1);
    window.done(json!({"undo": true}));
    eventually("nothing is unsaved", || kept() == 0);
    window.done(json!({"redo": true}));
    eventually("a copy of the change", || kept() == 1);
    window.done(json!({"save": true}));
    eventually("nothing is unsaved", || kept() == 0);
}

#[test]
fn unsaved_changes_are_kept_while_a_long_slice_runs() {
    let opened = three();
    let mut window = opened.window();
    window.done(json!({"edit": {"do": "slow", "ms": 5000}}));
    window.until_it_works();
    let started = Instant::now();
    eventually("a copy", || std::fs::read_dir(opened.folder.path().join("state")).expect("a folder").count() == 1);
    assert!(started.elapsed() < Duration::from_secs(3), "{:?}", started.elapsed());
}

#[test]
fn a_copy_that_cannot_be_restored_is_put_aside_and_the_file_is_opened() {
    let opened = three();
    let mut window = opened.window();
    window.done(set(0, 4.0));
    let folder = opened.end();
    let kept =
        std::fs::read_dir(folder.path().join("state")).expect("a folder").next().expect("a copy").expect("a copy");
    let text = std::fs::read_to_string(kept.path()).expect("a copy");
    std::fs::write(kept.path(), text.replace("numbers", "nvmbers")).expect("written");
    let opened = open_again(folder);
    let mut window = opened.window();
    let notice = window.until(|m| m.get("notice").is_some());
    assert!(notice.to_string().contains(".unreadable"), "{notice}");
    assert_eq!(window.sum(), 6.0);
}

#[test]
fn files_that_another_program_changed_are_reported_and_saving_waits_for_the_choice() {
    let opened = three();
    let mut window = opened.window();
    window.done(set(0, 4.0));
    std::fs::write(file_in(&opened.folder), r#"{"numbers":[100]}"#).expect("written");
    let said = window.until(|m| m.get("changedOnDisk").is_some());
    assert_eq!(said["changedOnDisk"], json!([file_in(&opened.folder)]));
    let reply = window.ask(json!({"save": true}));
    assert!(reply["error"].as_str().is_some_and(|e| e.contains("choose to reload or to keep")), "{reply}");
    window.done(json!({"disk": "keep"}));
    window.done(json!({"save": true}));
    assert_eq!(opened.on_disk(), r#"{"numbers":[4.0,2.0,3.0],"slice_ms":0}"#);
}

#[test]
fn reading_the_files_again_is_a_step_that_can_be_undone() {
    let opened = three();
    let mut window = opened.window();
    window.done(set(0, 4.0));
    for (text, sum, count) in [(r#"{"numbers":[100]}"#, 100.0, 3), (r#"{"numbers":[7,8]}"#, 15.0, 2)] {
        std::fs::write(file_in(&opened.folder), text).expect("written");
        window.until(|m| m["changedOnDisk"].as_array().is_some_and(|list| list.len() == 1));
        window.done(json!({"disk": "reload"}));
        assert_eq!((window.sum(), window.labels().len()), (sum, count));
        assert_eq!(window.history["savedAt"], window.history["at"]);
    }
    window.done(json!({"undo": true}));
    assert_eq!(window.sum(), 100.0);
    window.done(json!({"redo": true}));
    assert_eq!(window.sum(), 15.0);
}

#[test]
fn a_file_that_cannot_be_written_is_an_error_and_nothing_is_lost() {
    let opened = three();
    let mut window = opened.window();
    window.done(set(0, 4.0));
    let path = file_in(&opened.folder);
    std::fs::remove_file(&path).expect("removed");
    std::fs::create_dir(&path).expect("a folder where the file was");
    window.until(|m| m.get("changedOnDisk").is_some());
    window.done(json!({"disk": "keep"}));
    let reply = window.ask(json!({"save": true}));
    assert!(reply["error"].as_str().is_some_and(|e| e.contains("a.fake")), "{reply}");
    assert_eq!((window.sum(), &window.history["savedAt"]), (9.0, &Value::Null));
    std::fs::remove_dir(&path).expect("removed");
    window.until(|m| m.get("changedOnDisk").is_some());
    window.done(json!({"disk": "keep"}));
    window.done(json!({"save": true}));
    assert_eq!(opened.on_disk(), r#"{"numbers":[4.0,2.0,3.0],"slice_ms":0}"#);
}

#[test]
fn a_file_that_is_no_document_is_refused_with_its_path() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    std::fs::write(file_in(&folder), "[").expect("written");
    let document = Document::open::<Fake>("1", &file_in(&folder), Surroundings::default()).expect("threads");
    eventually("refusal", || document.status() != Status::Opening);
    let Status::Gone(why) = document.status() else { panic!("{:?}", document.status()) };
    assert!(why.contains("a.fake: "), "{why}");
}

#[test]
fn windows_of_a_closed_document_are_told() {
    let opened = three();
    let mut window = opened.window();
    window.rest();
    opened.document.close();
    window.until(|m| m["closed"] == true);
    let id = window.send(json!({"undo": true}));
    assert!(window.until(|m| m["reply"] == id).get("error").is_some());
    opened.end();
}

#[test]
fn a_download_is_offered_by_a_link() {
    let opened = three();
    let mut window = opened.window();
    let reply = window.ask(json!({"ask": {"ask": "export"}}));
    assert_eq!(reply["download"]["name"], "numbers.txt");
    assert!(reply["download"]["url"].as_str().is_some_and(|url| url.starts_with("/download/")), "{reply}");
}
