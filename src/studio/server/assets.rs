//! The page: files of `ui/dist`, compressed when it is made and embedded; a page that names the one command where there are none.

use std::borrow::Cow;
use std::io::Read as _;
#[cfg(debug_assertions)]
use std::path::{Component, Path};

use axum::body::Body;
use axum::http::header;
use axum::http::{HeaderMap, StatusCode, Uri};
use axum::response::{IntoResponse, Response};
use rust_embed::RustEmbed;

use super::api::refusal;

/// Files of the page. A checkout without them builds: the page is made by `make studio`.
#[derive(RustEmbed)]
#[folder = "ui/dist"]
#[include = "*.gz"]
#[allow_missing = true]
struct Bundle;

const MISSING: &str = "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><title>plumbline studio</title>\
    <h1>The page is not built</h1><p>This program was built without its page. In a checkout of plumbline this command builds both:</p>\
    <pre>make studio</pre></html>\n";

/// A file of the page.
pub(super) async fn asset(uri: Uri, headers: HeaderMap) -> Response {
    let name = uri.path().trim_start_matches('/');
    let name = name.strip_prefix("assets/").unwrap_or(name);
    let name = if name.is_empty() { "index.html" } else { name };
    match compressed(name) {
        Some(file) => found(name, file, &headers),
        None if name == "index.html" => (StatusCode::OK, [(header::CONTENT_TYPE, HTML)], MISSING).into_response(),
        None => refusal(StatusCode::NOT_FOUND, "there is no such file"),
    }
}

/// A file of the bundle. A debug build prefers the folder that it was embedded from: a page that was built anew needs no new program.
fn compressed(name: &str) -> Option<Cow<'static, [u8]>> {
    let name = format!("{name}.gz");
    #[cfg(debug_assertions)]
    if Path::new(&name).components().all(|part| matches!(part, Component::Normal(_)))
        && let Ok(fresh) = std::fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join("ui/dist").join(&name))
    {
        return Some(fresh.into());
    }
    Bundle::get(&name).map(|file| file.data)
}

const HTML: &str = "text/html; charset=utf-8";

/// Type by extension: exactly those that the page has.
fn content_type(name: &str) -> &'static str {
    match name.rsplit('.').next().unwrap_or_default() {
        "html" => HTML,
        "js" => "text/javascript; charset=utf-8",
        "css" => "text/css; charset=utf-8",
        "svg" => "image/svg+xml",
        "png" => "image/png",
        "json" | "map" => "application/json",
        "woff2" => "font/woff2",
        "txt" => "text/plain; charset=utf-8",
        _ => "application/octet-stream",
    }
}

fn found(name: &str, compressed: Cow<'static, [u8]>, headers: &HeaderMap) -> Response {
    let accepts = headers.get(header::ACCEPT_ENCODING).and_then(|v| v.to_str().ok()).unwrap_or_default();
    let kind = [(header::CONTENT_TYPE, content_type(name))];
    if accepts.contains("gzip") {
        let how = [(header::CONTENT_ENCODING, "gzip")];
        return (kind, how, Body::from(compressed.into_owned())).into_response();
    }
    let mut plain = Vec::new();
    match flate2::read::GzDecoder::new(&*compressed).read_to_end(&mut plain) {
        Ok(_) => (kind, plain).into_response(),
        Err(e) => refusal(StatusCode::INTERNAL_SERVER_ERROR, &format!("{name}: {e}")),
    }
}
