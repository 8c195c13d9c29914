//! Laws of the history.

use super::*;

fn step(value: i32) -> Step<i32> {
    Step::new(value, format!("set {value}"))
}

fn history(values: &[i32]) -> History<i32> {
    let mut history = History::new(values[0], "Opened", true);
    values[1..].iter().for_each(|v| history.push(step(*v)));
    history
}

fn labels(history: &History<i32>) -> Vec<&str> {
    history.labels().collect()
}

#[test]
fn undo_and_redo_walk_over_the_same_documents() {
    let mut history = history(&[0, 1, 2]);
    let mut seen = vec![*history.current()];
    while history.undo() {
        seen.push(*history.current());
    }
    assert_eq!(seen, [2, 1, 0]);
    while history.redo() {}
    assert_eq!((*history.current(), history.at()), (2, 2));
}

#[test]
fn a_step_after_undo_drops_what_was_undone() {
    let mut history = history(&[0, 1, 2]);
    history.undo();
    history.push(step(7));
    assert_eq!(labels(&history), ["Opened", "set 1", "set 7"]);
    assert!(!history.redo());
}

#[test]
fn steps_with_one_key_are_one_step_until_it_is_sealed() {
    let mut history = history(&[0]);
    for value in 1..=3 {
        history.push(step(value).merged("drag 4"));
    }
    assert_eq!((labels(&history), *history.current()), (vec!["Opened", "set 3"], 3));
    history.seal();
    history.push(step(4).merged("drag 4"));
    history.push(step(5).merged("drag 5"));
    assert_eq!(labels(&history), ["Opened", "set 3", "set 4", "set 5"]);
}

#[test]
fn a_step_does_not_merge_with_one_that_was_gone_back_to() {
    let mut history = history(&[0]);
    history.push(step(1).merged("drag"));
    history.seal();
    history.push(step(2).merged("drag"));
    history.undo();
    history.push(step(3).merged("drag"));
    assert_eq!(labels(&history), ["Opened", "set 1", "set 3"]);
}

#[test]
fn steps_without_a_key_never_merge() {
    let history = history(&[0, 1, 1, 1]);
    assert_eq!(labels(&history).len(), 4);
}

#[test]
fn going_to_a_step_that_is_not_there_changes_nothing() {
    let mut history = history(&[0, 1]);
    assert!(!history.go_to(2));
    assert_eq!((history.at(), *history.current()), (1, 1));
    assert!(history.go_to(0));
    assert_eq!(*history.current(), 0);
}

#[test]
fn the_saved_step_follows_the_documents() {
    let mut history = history(&[0, 1, 2]);
    history.go_to(1);
    history.mark_saved();
    assert!(history.is_saved());
    history.redo();
    assert!(!history.is_saved());
    history.undo();
    assert!(history.is_saved());
    history.undo();
    history.push(step(9));
    assert_eq!(history.saved_at(), None, "the saved document was dropped with what was undone");
}

#[test]
fn a_drag_after_saving_is_a_step_of_its_own() {
    let mut history = history(&[0]);
    history.push(step(1).merged("drag"));
    history.mark_saved();
    history.push(step(2).merged("drag"));
    assert_eq!((history.at(), history.saved_at()), (2, Some(1)));
}

#[test]
fn the_oldest_steps_go_where_there_are_too_many() {
    let mut history = History::new(0, "Opened", true).with_max_steps(3);
    (1..=5).for_each(|v| history.push(step(v)));
    assert_eq!(labels(&history), ["set 3", "set 4", "set 5"]);
    assert_eq!((history.at(), history.saved_at(), *history.current()), (2, None, 5));
    assert!(history.undo() && history.undo() && !history.undo());
}

#[test]
fn a_history_shares_the_parts_that_steps_did_not_change() {
    let part = std::sync::Arc::new(vec![0_u8; 1000]);
    let mut history = History::new((part.clone(), 0), "Opened", true).with_max_steps(100);
    for k in 1..200 {
        let (shared, _) = history.current().clone();
        history.push(Step::new((shared, k), "option"));
    }
    assert_eq!(std::sync::Arc::strong_count(&part), 101, "100 steps and the test hold one part");
}
