//! Laws of what waits for a window.

use super::*;
use crate::protocol::{Level, Notice};

fn batch(of: &[(u32, u8)]) -> Vec<Buffer> {
    of.iter().map(|(kind, value)| Buffer { kind: *kind, item: 0, bytes: vec![*value].into() }).collect()
}

/// Kind and payload of the next buffer.
fn next(window: &Window) -> Option<(u32, u8)> {
    match window.try_next()? {
        Outgoing::Buffer(bytes) => Some((u32::from_le_bytes(bytes[..4].try_into().expect("4 bytes")), bytes[16])),
        Outgoing::Text(text) => panic!("{text}"),
    }
}

fn rest(window: &Window) -> Vec<(u32, u8)> {
    std::iter::from_fn(|| next(window)).collect()
}

#[test]
fn a_buffer_has_a_header_of_sixteen_bytes() {
    let window = Window::new();
    window.applied(9);
    window.buffers(&[Buffer { kind: 100, item: 2, bytes: vec![5, 6, 7].into() }]);
    let expected = [100_u32, 2, 9, 3].iter().flat_map(|w| w.to_le_bytes()).chain([5, 6, 7]).collect();
    assert_eq!(window.try_next(), Some(Outgoing::Buffer(expected)));
}

#[test]
fn only_the_newest_buffer_of_a_kind_waits_and_the_order_is_that_of_its_slice() {
    let window = Window::new();
    window.buffers(&batch(&[(2, 1)]));
    window.buffers(&batch(&[(1, 2), (2, 2)]));
    assert_eq!(rest(&window), [(1, 2), (2, 2)]);
}

#[test]
fn no_kind_waits_forever_behind_another() {
    let window = Window::new();
    window.buffers(&batch(&[(1, 0), (2, 0)]));
    let mut seen = Vec::new();
    for k in 1..=6 {
        seen.push(next(&window).expect("a buffer waits").0);
        window.buffers(&batch(&[(1, k), (2, k)]));
    }
    assert_eq!(seen, [1, 2, 1, 2, 1, 2]);
}

#[test]
fn buffers_of_other_items_are_kept() {
    let window = Window::new();
    let item = |item, value: u8| Buffer { kind: 1, item, bytes: vec![value].into() };
    window.buffers(&[item(1, 1), item(2, 2)]);
    window.buffers(&[item(1, 3)]);
    assert_eq!(rest(&window), [(1, 2), (1, 3)]);
}

#[test]
fn texts_keep_their_order_and_only_the_newest_state_waits() {
    let window = Window::new();
    window.send(&ToPage::State(1.into()));
    window.reply(&Reply::done(1));
    window.send(&ToPage::State(2.into()));
    window.send(&ToPage::Notice(Notice { level: Level::Info, text: "a".into() }));
    window.buffers(&batch(&[(1, 1)]));
    window.send(&ToPage::Working(true));
    let texts: Vec<String> = std::iter::from_fn(|| match window.try_next()? {
        Outgoing::Text(text) => Some(text.to_string()),
        Outgoing::Buffer(_) => None,
    })
    .collect();
    let notice = r#"{"notice":{"level":"info","text":"a"}}"#;
    assert_eq!(texts, [r#"{"state":2}"#, r#"{"reply":1}"#, notice, r#"{"working":true}"#]);
}

#[test]
fn a_window_that_never_reads_its_replies_is_closed() {
    let window = Window::new();
    (0..=MAX_TEXTS as u32).for_each(|id| window.reply(&Reply::done(id)));
    assert!(window.is_closed());
}
