//! Laws of the messages.

use super::*;

#[test]
fn each_message_of_the_contract_is_read() {
    let cases = [
        r#"{"id":7,"edit":{"do":"x"},"newest":true}"#,
        r#"{"id":8,"view":{}}"#,
        r#"{"id":9,"ask":{"ask":"x"}}"#,
        r#"{"id":10,"undo":true}"#,
        r#"{"redo":true}"#,
        r#"{"goto":3}"#,
        r#"{"seal":true}"#,
        r#"{"save":true}"#,
        r#"{"disk":"reload"}"#,
        r#"{"disk":"keep"}"#,
    ];
    for text in cases {
        assert!(read(text).is_ok(), "{text}: {:?}", read(text));
    }
    assert!(matches!(read(cases[0]), Ok((Some(7), Command::Edit { newest: true, .. }))));
}

#[test]
fn malformed_messages_are_refused_with_their_number() {
    let deep = format!(r#"{{"id":1,"edit":{}{}}}"#, "[".repeat(100_000), "]".repeat(100_000));
    let cases = [
        ("", None, "malformed"),
        ("[]", None, "malformed"),
        (r#"{"id":4}"#, Some(4), "none of"),
        (r#"{"id":4,"undo":false}"#, Some(4), "none of"),
        (r#"{"id":4,"undo":true,"redo":true}"#, Some(4), "several of"),
        (r#"{"id":4,"shout":true}"#, Some(4), "shout"),
        (r#"{"id":4,"goto":-1}"#, Some(4), "malformed"),
        (r#"{"id":-4,"undo":true}"#, None, "malformed"),
        (r#"{"id":4,"disk":"burn"}"#, Some(4), "burn"),
        (&deep, None, "recursion"),
    ];
    for (text, id, word) in cases {
        let refused = read(text).expect_err(word);
        assert_eq!(refused.id, id, "{word}: {refused:?}");
        assert!(refused.why.contains(word), "{refused:?}");
    }
}

#[test]
fn replies_say_only_what_they_have() {
    assert_eq!(text(&Reply::done(7)), r#"{"reply":7}"#);
    assert_eq!(text(&Reply::failed(None, "no")), r#"{"reply":null,"error":"no"}"#);
    assert_eq!(text(&Reply::replaced(3)), r#"{"reply":3,"replaced":true}"#);
    assert_eq!(text(&ToPage::Working(true)), r#"{"working":true}"#);
    let notice = Notice { level: Level::Warning, text: "t".into() };
    assert_eq!(text(&ToPage::Notice(notice)), r#"{"notice":{"level":"warning","text":"t"}}"#);
    assert_eq!(text(&ToPage::ChangedOnDisk(vec!["a".into()])), r#"{"changedOnDisk":["a"]}"#);
}

/// All types, in the order of their file.
fn typescript() -> String {
    use ts_rs::TS as _;
    let cfg = ts_rs::Config::default().with_large_int("number");
    let types = [
        DiskChoice::decl(&cfg),
        FromPage::decl(&cfg),
        Hello::decl(&cfg),
        HistoryStep::decl(&cfg),
        HistoryList::decl(&cfg),
        Level::decl(&cfg),
        Notice::decl(&cfg),
        ToPage::decl(&cfg),
        Download::decl(&cfg),
        Reply::decl(&cfg),
    ];
    let types: Vec<String> = types.iter().map(|t| format!("export {t}\n")).collect();
    format!(
        "// Messages of every document. Written by a test of `src/studio`: REGENERATE=1 cargo test -p plumbline-studio\n\n\
         /** Version of the messages. */\nexport const PROTO = {PROTO};\n\n{}",
        types.join("\n")
    )
}

#[test]
fn the_types_of_the_page_are_those_of_the_messages() {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("ui/src/generated/protocol.ts");
    let text = typescript();
    if std::env::var_os("REGENERATE").is_some() {
        std::fs::write(&path, &text).expect("written");
    }
    let known = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(known == text, "{} is out of date: run this test with REGENERATE=1", path.display());
}
