//! Laws of the letters of a document.

use super::*;

fn command(window: &Window, id: u32, command: Command) -> Letter {
    Letter::Command(Request { window: window.id, id: Some(id), command })
}

fn drag(window: &Window, id: u32) -> Letter {
    command(window, id, Command::Edit { edit: serde_json::Value::Null, newest: true })
}

fn waiting(mailbox: &Mailbox) -> Vec<u32> {
    let next = || mailbox.take(Some(Instant::now()));
    std::iter::from_fn(next)
        .filter_map(|letter| match letter {
            Letter::Command(request) => request.id,
            Letter::Attach(_) | Letter::Detach(_) => None,
        })
        .collect()
}

#[test]
fn a_drag_replaces_the_one_of_its_window_that_waits() {
    let (mailbox, one, two) = (Mailbox::default(), Window::new(), Window::new());
    assert_eq!(mailbox.post(drag(&one, 1)), Posted::Waits);
    assert_eq!(mailbox.post(drag(&two, 1)), Posted::Waits);
    assert_eq!(mailbox.post(drag(&one, 2)), Posted::Replaced(Some(1)));
    assert_eq!(waiting(&mailbox), [1, 2]);
    assert_eq!(mailbox.post(drag(&one, 3)), Posted::Waits);
}

#[test]
fn a_drag_before_another_command_of_its_window_is_kept() {
    let (mailbox, window) = (Mailbox::default(), Window::new());
    mailbox.post(drag(&window, 1));
    mailbox.post(command(&window, 2, Command::Seal));
    assert_eq!(mailbox.post(drag(&window, 3)), Posted::Waits);
    assert_eq!(waiting(&mailbox), [1, 2, 3]);
}

#[test]
fn edits_that_are_no_drags_all_wait() {
    let (mailbox, window) = (Mailbox::default(), Window::new());
    for id in 1..=3 {
        mailbox.post(command(&window, id, Command::Edit { edit: serde_json::Value::Null, newest: false }));
    }
    assert_eq!(waiting(&mailbox), [1, 2, 3]);
}

#[test]
fn letters_beyond_the_bound_are_refused_but_windows_can_leave() {
    let (mailbox, window) = (Mailbox::default(), Window::new());
    for id in 0..MAX_LETTERS as u32 {
        assert_eq!(mailbox.post(command(&window, id, Command::Seal)), Posted::Waits);
    }
    assert_eq!(mailbox.post(command(&window, 0, Command::Seal)), Posted::Refused);
    assert_eq!(mailbox.post(Letter::Detach(window.id)), Posted::Waits);
}

#[test]
fn no_slice_starts_while_a_letter_waits() {
    let (mailbox, window) = (Mailbox::default(), Window::new());
    mailbox.post(command(&window, 1, Command::Undo));
    assert!(mailbox.start_slice(Duration::ZERO, None).is_none());
    waiting(&mailbox);
    let run = mailbox.start_slice(Duration::from_hours(1), None).expect("no letter waits");
    assert!(run.check().is_ok());
    mailbox.post(drag(&window, 2));
    assert!(run.check().is_ok(), "an edit waits for the picture");
    mailbox.post(command(&window, 3, Command::Undo));
    assert!(run.check().is_err(), "other letters do not");
    assert!(mailbox.end_slice());
}

#[test]
fn an_edit_stops_a_slice_once_its_patience_is_over() {
    let (mailbox, window) = (Arc::new(Mailbox::default()), Window::new());
    let pacer = std::thread::spawn({
        let mailbox = Arc::clone(&mailbox);
        move || mailbox.pace()
    });
    let run = mailbox.start_slice(Duration::from_millis(30), None).expect("no letter waits");
    mailbox.post(drag(&window, 1));
    let started = Instant::now();
    while run.check().is_ok() {
        assert!(started.elapsed() < Duration::from_secs(20), "the slice is stopped");
        std::thread::park_timeout(Duration::from_millis(1));
    }
    assert!(started.elapsed() >= Duration::from_millis(20), "{:?}", started.elapsed());
    mailbox.close();
    pacer.join().expect("it ends");
    assert!(mailbox.whole_run().check().is_err());
}
