//! `plumbline studio`, by running the program; its server and its documents are tested in `src/studio`.

use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Output, Stdio};
use std::time::{Duration, Instant};

use rustix::process::{Pid, Signal, kill_process};

use crate::support::program::{command, err, out, plumbline_in};

/// A studio that runs in a folder; ended when it is dropped.
struct Studio {
    child: Child,
    url: String,
}

impl Studio {
    fn start(folder: &Path, args: &[&str]) -> Self {
        let mut command = command(folder, &["studio", "--no-open"]);
        command.args(args).env("XDG_STATE_HOME", folder.join("state")).stdin(Stdio::null());
        let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("the program starts");
        let mut url = String::new();
        BufReader::new(child.stdout.as_mut().expect("piped")).read_line(&mut url).expect("a line");
        Self { child, url: url.trim_end().to_owned() }
    }

    fn address(&self) -> &str {
        self.url.strip_prefix("http://").and_then(|rest| rest.split_once("/#token=")).expect("an address").0
    }

    /// The answer to a request, whole.
    fn request(&self, first: &str, more: &str, body: &str) -> String {
        let mut stream = TcpStream::connect(self.address()).expect("a connection");
        let host = self.address();
        let length = body.len();
        let head =
            format!("{first} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\nContent-Length: {length}\r\n{more}");
        write!(stream, "{head}\r\n{body}").expect("sent");
        let mut answer = String::new();
        stream.read_to_string(&mut answer).expect("an answer");
        answer
    }
}

impl Drop for Studio {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn folder() -> tempfile::TempDir {
    tempfile::tempdir().expect("a temporary folder")
}

#[test]
fn the_address_is_the_only_result_and_a_signal_ends_it_within_two_seconds() {
    for (signal, status) in [(Signal::INT, 130), (Signal::TERM, 143)] {
        let folder = folder();
        let mut studio = Studio::start(folder.path(), &[]);
        assert!(studio.request("GET /", "", "").starts_with("HTTP/1.1 200 OK\r\n"));
        let token = studio.url.split_once("#token=").expect("a token").1.to_owned();
        assert!(token.len() == 32 && token.bytes().all(|b| b.is_ascii_hexdigit()), "{token}");
        let (started, pid) = (Instant::now(), Pid::from_child(&studio.child));
        kill_process(pid, signal).expect("it runs");
        assert_eq!(studio.child.wait().expect("it ends").code(), Some(status));
        assert!(started.elapsed() < Duration::from_secs(2), "{:?}", started.elapsed());
        let mut rest = String::new();
        studio.child.stdout.take().expect("piped").read_to_string(&mut rest).expect("text");
        assert_eq!(rest, "", "one line of results");
    }
}

#[test]
fn the_token_of_the_address_opens_the_api_and_documents_of_media() {
    let folder = folder();
    let media = Path::new(env!("CARGO_MANIFEST_DIR")).join("media");
    for name in ["mesh-bar.ply", "room-eucm.jpg"] {
        std::fs::copy(media.join(name), folder.path().join(name)).expect("copied");
    }
    let studio = Studio::start(folder.path(), &["mesh-bar.ply"]);
    let token = studio.url.split_once("#token=").expect("a token").1;
    let json = "Content-Type: application/json\r\n";
    let answer = studio.request("POST /api/session", json, &format!("{{\"token\":\"{token}\"}}"));
    let session = answer.split("\"session\":\"").nth(1).and_then(|rest| rest.split('"').next()).expect("a session");
    let session = format!("{json}x-plumbline-session: {session}\r\n");
    for (name, workspace) in [("mesh-bar.ply", "mesh"), ("room-eucm.jpg", "photo")] {
        let answer = studio.request("POST /api/open", &session, &format!("{{\"path\":\"{name}\"}}"));
        assert!(answer.starts_with("HTTP/1.1 200 OK\r\n"), "{answer}");
        assert!(answer.contains(&format!("\"workspace\":\"{workspace}\"")), "{answer}");
    }
    let outside = media.join("giraffe.ply");
    let answer = studio.request("POST /api/open", &session, &format!("{{\"path\":{outside:?}}}"));
    assert!(answer.starts_with("HTTP/1.1 404 "), "{answer}");
}

/// Runs the program to its end, its state in the folder too.
fn refused(folder: &Path, args: &[&str]) -> Output {
    command(folder, args).env("XDG_STATE_HOME", folder.join("state")).output().expect("the program starts")
}

#[test]
fn what_cannot_be_served_is_refused_with_the_status_of_its_kind() {
    let folder = folder();
    std::fs::write(folder.path().join("notes.txt"), "hello").expect("written");
    let cases: [(&[&str], i32, &str); 6] = [
        (&["missing.ply"], 65, "missing.ply: "),
        (&["notes.txt"], 65, "neither a pipeline file, nor a mesh"),
        (&["--host", "0.0.0.0"], 2, "it needs --cert and --key"),
        (&["--cert", "a.pem"], 2, "--key"),
        (&["--host", "0.0.0.0", "--cert", "a.pem", "--key", "a.pem"], 65, "a.pem: no certificate in PEM"),
        (&["--allow-path", "missing"], 65, "missing: "),
    ];
    for (args, status, message) in cases {
        let args: Vec<&str> = ["studio", "--no-open"].iter().chain(args).copied().collect();
        let output = refused(folder.path(), &args);
        assert_eq!(output.status.code(), Some(status), "{args:?}: {}", err(&output));
        assert!(err(&output).starts_with("error: ") && err(&output).contains(message), "{args:?}: {}", err(&output));
        assert_eq!(out(&output), "", "{args:?}");
    }
    let studio = Studio::start(folder.path(), &[]);
    let port = studio.address().rsplit(':').next().expect("a port").to_owned();
    let output = refused(folder.path(), &["studio", "--no-open", "--port", &port]);
    assert_eq!(output.status.code(), Some(75), "{}", err(&output));
    assert!(err(&output).contains("cannot listen on 127.0.0.1"), "{}", err(&output));
}

#[test]
fn the_studio_is_in_the_help_and_in_completions() {
    let help = out(&plumbline_in(Path::new("."), &["--help"]));
    assert!(help.contains("Studio:\n  studio "), "{help}");
    insta::assert_snapshot!("help_studio", out(&plumbline_in(Path::new("."), &["studio", "--help"])));
    let completions = out(&plumbline_in(Path::new("."), &["completions", "bash"]));
    assert!(completions.contains("plumbline,studio)"), "no completions");
}

/// Files of the tests that `docs/STUDIO-SECURITY.md` means by the first part of a name.
fn test_file(module: &str) -> PathBuf {
    let studio = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/studio");
    studio.join(match module {
        "guard_tests" | "tests" | "uploads" => format!("server/{module}.rs"),
        "session" => "session/tests.rs".to_owned(),
        "window" => "session/window_tests.rs".to_owned(),
        "files" | "recovery" => format!("{module}_tests.rs"),
        other => format!("{other}.rs"),
    })
}

#[test]
fn each_threat_has_a_rule_with_a_test_that_exists() {
    let text = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/STUDIO-SECURITY.md"));
    let text = text.expect("the document");
    let rows: Vec<&str> =
        text.lines().filter(|l| l.starts_with("| ") && !l.starts_with("| threat") && !l.starts_with("| ---")).collect();
    assert!(rows.len() >= 15, "{} threats", rows.len());
    for row in rows {
        let tests = row.trim_matches('|').rsplit(" | ").next().expect("cells").split('`').skip(1).step_by(2);
        let mut count = 0;
        for test in tests {
            let (module, name) = test.split_once("::").expect("a module and a name");
            let source = std::fs::read_to_string(test_file(module)).unwrap_or_else(|e| panic!("{test}: {e}"));
            assert!(source.contains(&format!("fn {name}()")), "there is no test {test}");
            count += 1;
        }
        assert!(count > 0, "a threat without a test: {row}");
    }
}
