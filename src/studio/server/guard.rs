//! Who may send a request: checked before anything else happens.
//!
//! `Host` must be a name of this machine: a page of another name that was made to resolve to it (DNS rebinding) sends its own.
//! `Origin` and `Sec-Fetch-Site` must be those of our page, on every request and on the WebSocket; `null` is refused. One request may
//! come from elsewhere: opening the page itself, which says nothing. All of `/api` but the exchange of the token needs a session.

use std::net::{IpAddr, Ipv4Addr};
use std::sync::Arc;

use axum::extract::{Request, State};
use axum::http::header::{self, HeaderName, HeaderValue};
use axum::http::{HeaderMap, Method, StatusCode, Uri};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};

use super::Studio;
use super::api::refusal;
use crate::error::StudioError;

/// The header of the session token.
pub(crate) const SESSION: HeaderName = HeaderName::from_static("x-plumbline-session");

/// Names under which the server may be called.
#[derive(Debug)]
pub(crate) struct Hosts {
    names: Vec<String>,
    secure: bool,
}

impl Hosts {
    /// For a server that listens on `host`.
    ///
    /// # Errors
    /// A host beyond the loopback interface without TLS.
    pub(crate) fn new(host: &str, secure: bool) -> Result<Self, StudioError> {
        let bare = host.trim_matches(['[', ']']).to_lowercase();
        let address: Option<IpAddr> = bare.parse().ok();
        let loopback = bare == "localhost" || address.is_some_and(|a| a.is_loopback());
        if !loopback && !secure {
            return Err(StudioError::request(format!(
                "--host {host} can be reached by other machines: it needs --cert and --key (or use an SSH tunnel to 127.0.0.1)"
            )));
        }
        let mut names: Vec<String> = ["localhost", "127.0.0.1", "[::1]"].map(str::to_owned).into();
        match address {
            // Each address of the machine: pages may call it by its number only, which no other name can be made to be.
            Some(address) if address.is_unspecified() => names.push("*".to_owned()),
            Some(IpAddr::V6(address)) => names.push(format!("[{address}]")),
            _ => names.push(bare),
        }
        Ok(Self { names, secure })
    }

    pub(crate) fn scheme(&self) -> &'static str {
        if self.secure { "https" } else { "http" }
    }

    /// The name for links: the address, but for the unspecified one, which nobody can call.
    pub(crate) fn shown(address: IpAddr) -> String {
        match address {
            IpAddr::V4(address) if address.is_unspecified() => Ipv4Addr::LOCALHOST.to_string(),
            IpAddr::V4(address) => address.to_string(),
            IpAddr::V6(address) if address.is_unspecified() => "[::1]".to_owned(),
            IpAddr::V6(address) => format!("[{address}]"),
        }
    }

    /// Whether a `Host` (`name` or `name:port`) is one of ours. The port is that of a tunnel, perhaps.
    fn allow(&self, host: &str) -> bool {
        let Ok(uri) = format!("http://{host}/").parse::<Uri>() else { return false };
        let plain = uri.authority().is_some_and(|a| a.as_str() == host && !host.contains('@'));
        let Some(name) = uri.host().map(str::to_lowercase) else { return false };
        let by_number = name.trim_matches(['[', ']']).parse::<IpAddr>().is_ok();
        plain && self.names.iter().any(|own| *own == name || (own == "*" && by_number))
    }

    /// Whether a request comes from our page, or from no page.
    fn check(&self, method: &Method, path: &str, headers: &HeaderMap) -> Result<(), &'static str> {
        let text = |name: HeaderName| headers.get(name).map(|value| value.to_str().unwrap_or("?"));
        let host = text(header::HOST).filter(|host| self.allow(host)).ok_or("this Host is not allowed")?;
        if headers.get_all(header::HOST).iter().count() > 1 {
            return Err("several Hosts");
        }
        if text(header::ORIGIN).is_some_and(|origin| origin != format!("{}://{host}", self.scheme())) {
            return Err("this Origin is not allowed");
        }
        let fetch = |name: &'static str| text(HeaderName::from_static(name));
        let opens_page = method == Method::GET
            && path == "/"
            && fetch("sec-fetch-mode") == Some("navigate")
            && fetch("sec-fetch-dest") == Some("document");
        match fetch("sec-fetch-site") {
            None | Some("same-origin" | "none") => Ok(()),
            Some(_) if opens_page => Ok(()),
            Some(_) => Err("requests of other sites are not allowed"),
        }
    }
}

/// The session token of a request: its header, or one of the subprotocols of a WebSocket.
fn session_of(headers: &HeaderMap) -> Vec<&str> {
    let text = |name: HeaderName| headers.get_all(name).into_iter().filter_map(|value| value.to_str().ok());
    let protocols = text(header::SEC_WEBSOCKET_PROTOCOL).flat_map(|list| list.split(',')).map(str::trim);
    let protocols = protocols.map(|p| p.strip_prefix("token.").unwrap_or(p));
    text(SESSION).chain(protocols).collect()
}

/// Whether requests for a path need a session token.
fn is_protected(path: &str) -> bool {
    path == "/ws" || (path.starts_with("/api") && path != "/api/session")
}

/// Refuses a request, or passes it on.
pub(crate) async fn guard(State(studio): State<Arc<Studio>>, request: Request, next: Next) -> Response {
    let path = request.uri().path();
    let headers = request.headers();
    let mut response = if let Err(why) = studio.hosts.check(request.method(), path, headers) {
        refusal(StatusCode::FORBIDDEN, why)
    } else if is_protected(path) && !session_of(headers).iter().any(|text| studio.tokens.is_session(text)) {
        refusal(StatusCode::UNAUTHORIZED, "no valid session: open the link that plumbline studio printed")
    } else {
        next.run(request).await.into_response()
    };
    for (name, value) in HEADERS {
        let name = HeaderName::from_static(name);
        response.headers_mut().entry(name).or_insert(HeaderValue::from_static(value));
    }
    response
}

/// Headers of each response: no code but our own, nothing guessed from content, no other page around ours, nothing kept.
const HEADERS: [(&str, &str); 8] = [
    (
        "content-security-policy",
        "default-src 'self'; script-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' blob: data:; font-src 'self' data:; \
         connect-src 'self'; worker-src 'self' blob:; object-src 'none'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    ),
    ("x-content-type-options", "nosniff"),
    ("x-frame-options", "DENY"),
    ("referrer-policy", "no-referrer"),
    ("cross-origin-opener-policy", "same-origin"),
    ("cross-origin-resource-policy", "same-origin"),
    ("permissions-policy", "camera=(), microphone=(), geolocation=()"),
    ("cache-control", "no-store"),
];

#[cfg(test)]
#[path = "guard_tests.rs"]
mod tests;
