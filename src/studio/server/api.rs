//! `/api` and downloads: JSON requests of the page.

use std::path::PathBuf;
use std::sync::Arc;

use axum::Json;
use axum::extract::{Path, Query, State};
use axum::http::header;
use axum::http::{HeaderValue, StatusCode};
use axum::response::{IntoResponse, Response};
use serde::Deserialize;
use serde_json::{Value, json};

use super::{Studio, examples};
use crate::content;
use crate::error::StudioError;
use crate::protocol::PROTO;
use crate::session::Document;

type Shared = State<Arc<Studio>>;

/// A refusal with its reason.
pub(super) fn refusal(status: StatusCode, why: &str) -> Response {
    (status, Json(json!({ "error": why }))).into_response()
}

fn refused(error: &StudioError) -> Response {
    let status = match error {
        StudioError::Environment(_) => StatusCode::SERVICE_UNAVAILABLE,
        _ => StatusCode::UNPROCESSABLE_ENTITY,
    };
    refusal(status, &error.to_string())
}

#[derive(Deserialize)]
pub(super) struct Once {
    token: String,
}

/// `POST /api/session`: a session token for a one-time token.
pub(super) async fn session(State(studio): Shared, Json(once): Json<Once>) -> Response {
    match studio.tokens.exchange(&once.token) {
        Some(session) => Json(json!({ "session": session.text() })).into_response(),
        None => refusal(StatusCode::UNAUTHORIZED, "this link was used already: take a new one from the program"),
    }
}

/// `POST /api/link`: a one-time token for another window.
pub(super) async fn link(State(studio): Shared) -> Json<Value> {
    Json(json!({ "token": studio.invite().text() }))
}

/// `GET /api/state`: versions, folders, documents.
pub(super) async fn state(State(studio): Shared) -> Json<Value> {
    let documents: Vec<Value> = studio.documents.all().iter().map(|document| described(document)).collect();
    Json(json!({
        "proto": PROTO,
        "version": env!("CARGO_PKG_VERSION"),
        "folders": studio.folders.named(),
        "documents": documents,
        "recent": studio.recent.that(|path| is_open_to(&studio, path)),
        "examples": examples::all(),
        "file": studio.file,
    }))
}

fn is_open_to(studio: &Studio, path: &std::path::Path) -> bool {
    path.to_str().is_some_and(|text| studio.folders.resolve(text).is_ok())
}

fn described(document: &Document) -> Value {
    let hello = &document.hello;
    json!({ "document": hello.document, "workspace": hello.workspace, "name": hello.name, "path": document.path })
}

#[derive(Deserialize)]
pub(super) struct Open {
    path: String,
    /// `character`: a mesh is opened to be rigged, not to be deformed.
    #[serde(default)]
    workspace: Option<String>,
}

/// `POST /api/open`: opens a file, and answers once it is open.
pub(super) async fn open(State(studio): Shared, Json(request): Json<Open>) -> Response {
    let begin = {
        let studio = Arc::clone(&studio);
        move || begin_to_open(&studio, &request)
    };
    let document = match tokio::task::spawn_blocking(begin).await {
        Ok(Ok(document)) => document,
        Ok(Err(response)) => return *response,
        Err(_) => return refusal(StatusCode::INTERNAL_SERVER_ERROR, "internal error while opening the file"),
    };
    match document.opened().await {
        Ok(()) => {
            studio.recent.add(&document.path, &document.hello.workspace);
            Json(described(&document)).into_response()
        }
        Err(why) => refusal(StatusCode::UNPROCESSABLE_ENTITY, &why),
    }
}

fn begin_to_open(studio: &Studio, request: &Open) -> Result<Arc<Document>, Box<Response>> {
    let path = match examples::find(&request.path) {
        Some((name, bytes)) => studio
            .uploads
            .keep(name, &bytes)
            .map_err(|e| refusal(StatusCode::SERVICE_UNAVAILABLE, &format!("the example cannot be copied: {e}")))?,
        None => found(studio, &request.path).map_err(|why| refusal(StatusCode::NOT_FOUND, &why))?,
    };
    let path = match request.workspace.as_deref() {
        Some("character") => content::rig_of(&path),
        _ => path,
    };
    studio.documents.open(&path).map_err(|error| Box::new(refused(&error)))
}

/// The file of a path. That of a character need not be there yet: it is begun for the mesh beside it.
fn found(studio: &Studio, path: &str) -> Result<PathBuf, String> {
    let file = std::path::Path::new(path);
    match (content::is_rig(file), file.parent(), file.file_name()) {
        (true, Some(folder), Some(name)) if studio.folders.resolve(path).is_err() => {
            Ok(studio.folders.resolve(&folder.to_string_lossy())?.join(name))
        }
        _ => studio.folders.resolve(path),
    }
}

#[derive(Deserialize)]
pub(super) struct Close {
    document: String,
}

/// `POST /api/close`: closes a document in all windows; unsaved changes are restored when it is opened again.
pub(super) async fn close(State(studio): Shared, Json(request): Json<Close>) -> Response {
    match studio.documents.find(&request.document) {
        Some(document) => {
            document.close();
            Json(json!({})).into_response()
        }
        None => refusal(StatusCode::NOT_FOUND, "there is no such document"),
    }
}

#[derive(Deserialize)]
pub(super) struct Files {
    #[serde(default, alias = "path")]
    folder: String,
}

/// `GET /api/files?folder=`: what the picker shows.
pub(super) async fn files(State(studio): Shared, Query(query): Query<Files>) -> Response {
    match studio.folders.list(&query.folder) {
        Ok(listing) => Json(listing).into_response(),
        Err(why) => refusal(StatusCode::NOT_FOUND, &why),
    }
}

/// `GET /api/examples`.
pub(super) async fn examples() -> Response {
    Json(examples::all()).into_response()
}

/// `GET /api/recent`.
pub(super) async fn recent(State(studio): Shared) -> Response {
    Json(studio.recent.that(|path| is_open_to(&studio, path))).into_response()
}

/// `GET /download/NONCE`: a file that was offered, once, as an attachment of no type that a browser would show.
pub(super) async fn download(State(studio): Shared, Path(nonce): Path<String>) -> Response {
    let Some((name, bytes)) = studio.downloads.take(&nonce) else {
        return refusal(StatusCode::NOT_FOUND, "this link was used already");
    };
    let mut response = bytes.into_response();
    let headers = response.headers_mut();
    headers.insert(header::CONTENT_TYPE, HeaderValue::from_static("application/octet-stream"));
    headers.insert(header::CONTENT_DISPOSITION, attachment(&name));
    response
}

/// `attachment` with a name (RFC 6266): ASCII letters for old browsers, and the whole in UTF-8.
fn attachment(name: &str) -> HeaderValue {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_. ".contains(c);
    let plain: String = name.chars().map(|c| if is_plain(c) { c } else { '_' }).collect();
    let encoded: String =
        name.bytes()
            .map(|b| {
                if b.is_ascii_alphanumeric() || b"-_.".contains(&b) {
                    char::from(b).into()
                } else {
                    format!("%{b:02X}")
                }
            })
            .collect();
    let text = format!("attachment; filename=\"{plain}\"; filename*=UTF-8''{encoded}");
    HeaderValue::from_str(&text).unwrap_or(HeaderValue::from_static("attachment"))
}
