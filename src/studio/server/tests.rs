//! The server, with real requests and WebSockets: a test for each rule of `docs/STUDIO-SECURITY.md`.

use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::path::Path;

use futures_util::{SinkExt as _, StreamExt as _};
use serde_json::{Value, json};
use tokio_tungstenite::tungstenite::Message;

use super::test_server::{SECRET, options, running, runtime, send, serve, start_in, status_of, until};
use super::*;

#[test]
fn the_one_time_token_is_exchanged_once_and_the_session_token_opens_the_api() {
    let server = running();
    assert_eq!(server.exchange().status, 401, "it was used already");
    let state = server.get("/api/state");
    assert_eq!(state.status, 200);
    assert_eq!(state.json()["proto"], 1);
    assert_eq!(state.json()["version"], env!("CARGO_PKG_VERSION"));
    let link = server.post("/api/link", &json!({})).json();
    let body = json!({ "token": link["token"] }).to_string();
    let other = server.request("POST", "/api/session", &[("Content-Type", "application/json")], &body);
    assert_eq!(other.status, 200, "another window gets a session of its own");
    assert_ne!(other.json()["session"].as_str(), Some(server.session.as_str()));
}

#[test]
fn requests_without_a_session_are_refused() {
    let server = running();
    let paths = ["state", "files", "examples", "recent", "open", "close", "upload?name=a.fake", "link", "nothing"];
    for path in paths {
        for method in ["GET", "POST"] {
            let path = format!("/api/{path}");
            let wrong = [("x-plumbline-session", server.once.as_str())];
            for headers in [&[][..], &wrong[..], &[("x-plumbline-session", "")][..], &[("Cookie", "a=b")][..]] {
                assert_eq!(server.request(method, &path, headers, "").status, 401, "{method} {path} {headers:?}");
            }
        }
    }
    for token in ["", "0", "null"] {
        let body = json!({ "token": token }).to_string();
        let answer = server.request("POST", "/api/session", &[("Content-Type", "application/json")], &body);
        assert_eq!(answer.status, 401, "{token}");
    }
}

#[test]
fn foreign_hosts_and_origins_and_sites_are_refused_on_every_path() {
    let server = running();
    let session = ("x-plumbline-session", server.session.as_str());
    for path in ["/", "/assets/main.js", "/api/state", "/api/session", "/ws?document=a", "/download/a"] {
        for header in [
            ("Host", "evil.example"),
            ("Origin", "null"),
            ("Origin", "http://evil.example"),
            ("Sec-Fetch-Site", "cross-site"),
            ("Sec-Fetch-Site", "same-site"),
        ] {
            assert_eq!(server.request("GET", path, &[session, header], "").status, 403, "{path} {header:?}");
        }
    }
    let own = format!("http://{}", server.address);
    let same = [session, ("Origin", own.as_str()), ("Sec-Fetch-Site", "same-origin")];
    assert_eq!(server.request("GET", "/api/state", &same, "").status, 200);
}

#[test]
fn the_page_may_be_opened_from_the_redirect_file_but_in_no_frame() {
    let server = running();
    let open = |dest| {
        let headers = [("Sec-Fetch-Site", "cross-site"), ("Sec-Fetch-Mode", "navigate"), ("Sec-Fetch-Dest", dest)];
        server.request("GET", "/", &headers, "").status
    };
    assert_eq!((open("document"), open("iframe")), (200, 403));
}

#[test]
fn every_response_forbids_inline_scripts_guessing_and_frames() {
    let server = running();
    for answer in [
        server.get("/"),
        server.get("/api/state"),
        server.get("/nothing"),
        server.request("GET", "/api/state", &[], ""),
        server.request("GET", "/", &[("Host", "evil.example")], ""),
    ] {
        let policy = answer.head.lines().find(|l| l.starts_with("content-security-policy:")).expect("a policy");
        let scripts = policy.split(';').find(|part| part.trim().starts_with("script-src")).expect("script-src");
        assert_eq!(scripts.trim(), "script-src 'self'");
        assert!(policy.contains("default-src 'self'") && policy.contains("frame-ancestors 'none'"), "{policy}");
        assert!(answer.head.contains("x-content-type-options: nosniff"), "{}", answer.head);
        assert!(answer.head.contains("referrer-policy: no-referrer"), "{}", answer.head);
        assert!(
            !answer.head.contains("access-control-allow") && !answer.head.contains("set-cookie"),
            "{}",
            answer.head
        );
    }
}

#[test]
fn files_outside_the_folders_are_refused_also_through_links() {
    let server = running();
    let secret = server.folder.path().join("secret.fake");
    let absolute = secret.display().to_string();
    #[cfg(unix)]
    for (link, to) in [("link.fake", secret.as_path()), ("up", server.folder.path())] {
        std::os::unix::fs::symlink(to, server.folder.path().join("project").join(link)).expect("a link");
    }
    for path in [
        absolute.as_str(),
        "../secret.fake",
        "below/../../secret.fake",
        "link.fake",
        "up/secret.fake",
        "/etc/passwd",
        "~/.ssh/id_rsa",
        "missing.fake",
        "",
        "a.fake\0",
    ] {
        let answer = server.post("/api/open", &json!({ "path": path }));
        assert!([404, 422].contains(&answer.status), "{path}: {} {}", answer.status, answer.json());
        assert!(!answer.json().to_string().contains(&SECRET.to_string()), "{path}: {}", answer.json());
    }
    // The file of a character that is begun need not be there, but its folder must be one of ours.
    for path in
        ["../new.character.toml", "/etc/new.character.toml", "up/new.character.toml", "below/../../new.character.toml"]
    {
        let answer = server.post("/api/open", &json!({ "path": path }));
        assert_eq!(answer.status, 404, "{path}: {}", answer.json());
    }
    for folder in ["..", "/", "/etc", "up", "below/../.."] {
        assert_eq!(server.get(&format!("/api/files?folder={folder}")).status, 404, "{folder}");
    }
    let listing = server.get("/api/files").json();
    let names: Vec<&str> =
        listing["entries"].as_array().expect("a list").iter().filter_map(|e| e["name"].as_str()).collect();
    assert_eq!(names, ["below", "a.fake"], "links out of the folder are not shown");
    assert_eq!(listing["parent"], Value::Null);
    let below = server.get("/api/files?folder=below").json();
    assert_eq!(below["parent"], listing["path"]);
}

#[test]
fn a_file_of_the_project_is_never_served_as_a_page() {
    let server = running();
    for path in [
        "/a.fake",
        "/project/a.fake",
        "/../project/a.fake",
        "/assets/../a.fake",
        "/%2e%2e/%2e%2e/secret.fake",
        "/assets//etc/passwd",
    ] {
        assert_eq!(server.get(path).status, 404, "{path}");
    }
}

#[test]
fn a_download_is_an_attachment_and_its_link_works_once() {
    let server = running();
    let id = server.open("a.fake");
    let url = runtime().block_on(async {
        let mut socket = server.socket(&id, &[]).await.expect("a socket");
        send(&mut socket, json!({"id": 1, "ask": {"ask": "export"}})).await;
        let reply = until(&mut socket, |m| m["reply"] == 1).await;
        reply["download"]["url"].as_str().expect("a link").to_owned()
    });
    // The link is the right to fetch it: a browser cannot add a header to it.
    let first = server.request("GET", &url, &[], "");
    assert_eq!((first.status, first.body.as_slice()), (200, b"[1.0, 2.0, 3.0]".as_slice()));
    assert!(first.head.contains("content-disposition: attachment; filename=\"numbers.txt\""), "{}", first.head);
    assert!(first.head.contains("content-type: application/octet-stream"), "{}", first.head);
    assert_eq!(server.request("GET", &url, &[], "").status, 404, "it was used already");
    assert_eq!(server.get("/download/0123").status, 404);
}

#[test]
fn sockets_need_session_host_origin_and_site() {
    let server = running();
    let id = server.open("a.fake");
    let own = format!("http://{}", server.address);
    runtime().block_on(async {
        let with = |headers: Vec<(&'static str, String)>| {
            let (server, id) = (&server, &id);
            async move {
                let headers: Vec<_> = headers.iter().map(|(name, value)| (*name, value.as_str())).collect();
                status_of(server.socket(id, &headers).await)
            }
        };
        assert_eq!(with(vec![]).await, 101);
        assert_eq!(with(vec![("origin", own.clone()), ("sec-fetch-site", "same-origin".into())]).await, 101);
        assert_eq!(with(vec![("sec-websocket-protocol", "plumbline".into())]).await, 401);
        assert_eq!(with(vec![("sec-websocket-protocol", "plumbline, token.0".into())]).await, 401);
        assert_eq!(with(vec![("origin", "null".into())]).await, 403);
        assert_eq!(with(vec![("origin", "http://evil.example".into())]).await, 403);
        assert_eq!(with(vec![("sec-fetch-site", "cross-site".into())]).await, 403);
        assert_eq!(with(vec![("host", "evil.example".into())]).await, 403);
        assert_eq!(status_of(server.socket("nothing", &[]).await), 404);
    });
}

#[test]
fn malformed_messages_are_answered_and_the_connection_stays() {
    let server = running();
    let id = server.open("a.fake");
    runtime().block_on(async {
        let mut socket = server.socket(&id, &[]).await.expect("a socket");
        for text in ["", "{", "null", "[]", "{\"id\":5}", "{\"id\":5,\"edit\":{\"do\":\"fly\"}}", "\u{1F980}"] {
            socket.send(Message::text(text)).await.expect("sent");
            let reply = until(&mut socket, |m| m.get("reply").is_some()).await;
            assert!(reply["error"].as_str().is_some_and(|e| e.contains("malformed")), "{text}: {reply}");
        }
        socket.send(Message::binary(vec![1, 2, 3])).await.expect("sent");
        until(&mut socket, |m| m["error"].as_str().is_some_and(|e| e.contains("binary"))).await;
        send(&mut socket, json!({"id": 9, "ask": {"ask": "sum"}})).await;
        assert_eq!(until(&mut socket, |m| m["reply"] == 9).await["result"], 6.0);
    });
}

#[test]
fn a_message_that_is_too_long_ends_its_connection_and_no_other() {
    let server = running();
    let id = server.open("a.fake");
    runtime().block_on(async {
        let mut other = server.socket(&id, &[]).await.expect("a socket");
        let mut socket = server.socket(&id, &[]).await.expect("a socket");
        let long = format!("{{\"id\":1,\"edit\":\"{}\"}}", "x".repeat(socket::MAX_MESSAGE));
        let _ = socket.send(Message::text(long)).await;
        let end = async {
            while let Some(Ok(message)) = socket.next().await {
                if message.is_close() {
                    break;
                }
                assert!(!message.to_string().contains("\"reply\""), "{message}");
            }
        };
        tokio::time::timeout(Duration::from_secs(20), end).await.expect("it is closed");
        send(&mut other, json!({"id": 9, "ask": {"ask": "sum"}})).await;
        assert_eq!(until(&mut other, |m| m["reply"] == 9).await["result"], 6.0);
    });
    assert_eq!(server.get("/api/state").status, 200);
}

#[test]
fn bodies_that_are_too_long_are_refused() {
    let server = running();
    let answer = server.post("/api/open", &json!({ "path": "x".repeat(MAX_BODY) }));
    assert_eq!(answer.status, 413);
    for body in ["", "{", "[]", "{\"path\":3}", "\u{0}"] {
        let headers = [("x-plumbline-session", server.session.as_str()), ("Content-Type", "application/json")];
        let answer = server.request("POST", "/api/open", &headers, body);
        assert!((400..500).contains(&answer.status), "{body}: {}", answer.status);
    }
    let form = [("x-plumbline-session", server.session.as_str()), ("Content-Type", "text/plain")];
    assert_eq!(server.request("POST", "/api/open", &form, "{\"path\":\"a.fake\"}").status, 415, "what a form can send");
}

#[test]
fn two_windows_on_one_document_see_each_others_edits() {
    let server = running();
    let id = server.open("a.fake");
    assert_eq!(server.open("below/../a.fake"), id, "one file is one document");
    runtime().block_on(async {
        let mut one = server.socket(&id, &[]).await.expect("a socket");
        let mut two = server.socket(&id, &[]).await.expect("a socket");
        let hello = until(&mut two, |m| m.get("hello").is_some()).await;
        assert_eq!(hello["hello"]["workspace"], "fake");
        send(&mut one, json!({"id": 1, "edit": {"do": "set", "at": 0, "to": 10}})).await;
        until(&mut two, |m| m["state"]["sum"] == 15.0).await;
        send(&mut two, json!({"id": 1, "undo": true})).await;
        until(&mut one, |m| m["state"]["sum"] == 6.0).await;
    });
    assert_eq!(server.get("/api/state").json()["documents"].as_array().map(Vec::len), Some(1));
    assert_eq!(server.get("/api/recent").json()[0]["workspace"], "fake");
}

#[test]
fn the_page_is_connected_to_the_same_document_after_the_program_was_started_again() {
    let mut server = running();
    let id = server.open("a.fake");
    runtime().block_on(async {
        let mut socket = server.socket(&id, &[]).await.expect("a socket");
        send(&mut socket, json!({"id": 1, "edit": {"do": "append", "number": 10}})).await;
        until(&mut socket, |m| m["reply"] == 1).await;
    });
    let old = server.session.clone();
    server.end();
    let folder = std::mem::replace(&mut server.folder, tempfile::tempdir().expect("a temporary folder"));
    let options = options(folder.path());
    let server = start_in(folder, options);
    assert_eq!(server.request("GET", "/api/state", &[("x-plumbline-session", &old)], "").status, 401);
    assert_eq!(server.get("/api/state").json()["recent"][0]["workspace"], "fake");
    assert_eq!(server.open("a.fake"), id);
    runtime().block_on(async {
        let mut socket = server.socket(&id, &[]).await.expect("a socket");
        send(&mut socket, json!({"id": 1, "ask": {"ask": "sum"}})).await;
        assert_eq!(until(&mut socket, |m| m["reply"] == 1).await["result"], 16.0);
    });
}

#[test]
fn dropped_files_go_to_a_folder_of_the_session_whatever_their_name_is() {
    let mut server = running();
    let session = [("x-plumbline-session", server.session.as_str())];
    let drop_file =
        |name: &str| server.request("POST", &format!("/api/upload?name={name}"), &session, "{\"numbers\":[5]}");
    let answer = drop_file("..%2F..%2Fb.fake");
    assert_eq!(answer.status, 200, "{}", answer.json());
    let path = answer.json()["path"].as_str().expect("a path").to_owned();
    assert!(
        Path::new(&path).starts_with(server.folder.path().join("state/dropped")) && path.ends_with("/b.fake"),
        "{path}"
    );
    for name in ["", "..", ".hidden", "a%2F.."] {
        assert_eq!(drop_file(name).status, 422, "{name}");
    }
    assert_ne!(drop_file("b.fake").json()["path"], answer.json()["path"], "a second file of this name is another file");
    server.open(&path);
    server.end();
    assert!(!Path::new(&path).exists(), "the folder is removed at the end");
}

#[test]
fn a_mesh_that_is_dropped_with_the_files_it_names_is_opened_with_them() {
    let server = running();
    let session = [("x-plumbline-session", server.session.as_str())];
    let scene = json!({
        "asset": {"version": "2.0"},
        "buffers": [{"uri": "points.bin", "byteLength": 36}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [0, 0, 0]}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "nodes": [{"mesh": 0}],
        "scenes": [{"nodes": [0]}],
    });
    // Corners (0, 0, 0), (2, 0, 0), (0, 2, 0) as 32-bit numbers, whose bytes are letters.
    let (zero, two) = ("\0\0\0\0", "\0\0\0@");
    let points = [zero, zero, zero, two, zero, zero, zero, two, zero].concat();
    let drop_file = |name: &str, drop: &str, body: &str| {
        let answer = server.request("POST", &format!("/api/upload?name={name}{drop}"), &session, body);
        assert_eq!(answer.status, 200, "{}", answer.json());
        answer.json()["path"].as_str().expect("a path").to_owned()
    };
    let alone = drop_file("a.gltf", "", &scene.to_string());
    let refused = server.post("/api/open", &json!({ "path": alone }));
    assert!(refused.json()["error"].as_str().is_some_and(|e| e.contains("points.bin")), "{}", refused.json());
    let mesh = drop_file("a.gltf", "&drop=1", &scene.to_string());
    drop_file("points.bin", "&drop=1", &points);
    server.open(&mesh);
}

#[test]
fn opening_something_that_is_no_document_says_why() {
    let server = running();
    let project = server.folder.path().join("project");
    for (name, content, why) in [
        ("bad.fake", "[", "bad.fake: "),
        ("notes.txt", "hello", "neither a pipeline file"),
        ("a.toml", "version = ", "a.toml: "),
        ("stabilize.toml", "[stage.a]\nuse = \"video.load\"", "no workspace opens"),
    ] {
        std::fs::write(project.join(name), content).expect("written");
        let answer = server.post("/api/open", &json!({ "path": name }));
        assert_eq!(answer.status, 422, "{name}");
        assert!(answer.json()["error"].as_str().is_some_and(|e| e.contains(why)), "{name}: {}", answer.json());
    }
}

#[test]
fn a_named_pipe_in_the_folder_keeps_nobody_waiting() {
    let server = running();
    let pipe = server.folder.path().join("project/pipe.fake");
    let made = std::process::Command::new("mkfifo").arg(&pipe).status();
    if made.is_ok_and(|status| status.success()) {
        assert_eq!(server.post("/api/open", &json!({ "path": "pipe.fake" })).status, 422);
    }
}

#[test]
fn a_closed_document_ends_its_windows_and_can_be_opened_again() {
    let server = running();
    let id = server.open("a.fake");
    runtime().block_on(async {
        let mut socket = server.socket(&id, &[]).await.expect("a socket");
        assert_eq!(server.post("/api/close", &json!({ "document": id })).status, 200);
        until(&mut socket, |m| m["closed"] == true).await;
    });
    assert_eq!(server.post("/api/close", &json!({ "document": "nothing" })).status, 404);
    let end = Instant::now() + Duration::from_secs(20);
    while server.post("/api/close", &json!({ "document": id })).status == 200 {
        assert!(Instant::now() < end, "the document ends");
    }
    assert_eq!(server.open("a.fake"), id);
}

#[test]
fn a_host_beyond_this_machine_without_a_certificate_is_refused() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let bound = |options| runtime().block_on(Server::bind(options)).map(|server| server.address());
    let refused = bound(Options { host: "0.0.0.0".into(), ..options(folder.path()) }).expect_err("no certificate");
    assert!(matches!(refused, StudioError::Request(_)) && refused.to_string().contains("--cert"), "{refused}");
    let missing = TlsFiles { cert: "/missing.pem".into(), key: "/missing.pem".into() };
    let refused = bound(Options { tls: Some(missing), ..options(folder.path()) }).expect_err("no such file");
    assert!(refused.to_string().contains("/missing.pem"), "{refused}");
}

#[test]
fn with_a_certificate_the_server_speaks_tls_and_nothing_else() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let fixture = |name: &str| Path::new(env!("CARGO_MANIFEST_DIR")).join("server/fixtures").join(name);
    let tls = TlsFiles { cert: fixture("localhost.cert.pem"), key: fixture("localhost.key.pem") };
    let options = Options { host: "0.0.0.0".into(), tls: Some(tls), ..options(folder.path()) };
    let (url, stop, thread) = serve(options);
    let address = url.strip_prefix("https://").and_then(|u| u.split_once("/#")).expect("an address").0.to_owned();
    let mut plain = TcpStream::connect(&address).expect("a connection");
    plain.write_all(b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n").expect("sent");
    let mut answer = Vec::new();
    let _ = plain.read_to_end(&mut answer);
    assert!(!answer.starts_with(b"HTTP"), "no plain answer");
    let page = runtime().block_on(encrypted_page(&address));
    assert!(page.starts_with("HTTP/1.1 200"), "{page}");
    drop(stop);
    thread.join().expect("the server ends");
}

/// The page over TLS, its certificate trusted.
async fn encrypted_page(address: &str) -> String {
    use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
    use tokio_rustls::rustls::pki_types::{CertificateDer, ServerName, pem::PemObject as _};
    use tokio_rustls::rustls::{ClientConfig, RootCertStore, crypto::ring};
    let mut roots = RootCertStore::empty();
    let pem = include_bytes!("fixtures/localhost.cert.pem");
    roots.add(CertificateDer::from_pem_slice(pem).expect("a certificate")).expect("a certificate");
    let config = ClientConfig::builder_with_provider(Arc::new(ring::default_provider()))
        .with_safe_default_protocol_versions()
        .expect("versions")
        .with_root_certificates(roots)
        .with_no_client_auth();
    let stream = tokio::net::TcpStream::connect(address).await.expect("a connection");
    let name = ServerName::try_from("localhost").expect("a name");
    let mut stream = tokio_rustls::TlsConnector::from(Arc::new(config)).connect(name, stream).await.expect("TLS");
    stream.write_all(b"GET / HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n").await.expect("sent");
    let mut text = Vec::new();
    let _ = stream.read_to_end(&mut text).await;
    String::from_utf8_lossy(&text).into_owned()
}

#[test]
fn the_page_is_there_also_where_it_was_not_built() {
    let server = running();
    let page = server.get("/");
    assert_eq!(page.status, 200);
    let text = String::from_utf8_lossy(&page.body);
    assert!(text.contains("<!doctype html>") && !text.contains("<script>"), "{text}");
    assert!(text.contains("make studio") || text.contains("main.js"), "{text}");
}

#[test]
fn an_example_is_opened_as_a_copy() {
    let server = running();
    let examples = server.get("/api/examples").json();
    let shown: Vec<&str> =
        examples.as_array().expect("a list").iter().filter_map(|e| e["workspace"].as_str()).collect();
    assert_eq!(shown, ["mesh", "character", "photo"]);
    let answer = server.post("/api/open", &json!({ "path": "example:giraffe.ply" }));
    assert_eq!(answer.status, 200, "{}", answer.json());
    let path = answer.json()["path"].as_str().expect("a path").to_owned();
    assert!(Path::new(&path).starts_with(server.folder.path().join("state/dropped")), "{path}");
    assert_eq!(server.post("/api/open", &json!({ "path": "example:../Cargo.toml" })).status, 404);
}
