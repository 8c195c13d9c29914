//! The server of the page: HTTP and WebSockets on the loopback interface.
//!
//! Who may talk to it is decided in `guard`, before anything else; `docs/STUDIO-SECURITY.md` lists the threats and the rules.

mod api;
mod assets;
mod documents;
mod examples;
mod folders;
mod guard;
mod recent;
mod session_folder;
mod socket;
mod tls;
mod tokens;
mod uploads;

use std::future::Future;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use axum::Router;
use axum::extract::DefaultBodyLimit;
use axum::routing::{get, post};
use tokio::net::TcpListener;

use crate::downloads::Downloads;
use crate::error::StudioError;
use crate::recovery::{Recovery, private_folder};
use crate::secret::Secret;
use crate::session::{Surroundings, Timing};
use documents::Documents;
use folders::Folders;
use guard::Hosts;
use recent::Recent;
pub use tls::TlsFiles;
use tokens::Tokens;
use uploads::Uploads;

/// Maximum size of the body of a request, bytes, but for uploads: paths and tokens.
const MAX_BODY: usize = 64 << 10;

/// What the server serves, and to whom.
#[derive(Debug)]
pub struct Options {
    /// Address that is listened on: `127.0.0.1` unless certificate and key are given.
    pub host: String,
    /// Port; 0 for one that is free.
    pub port: u16,
    /// Certificate and key, for hosts beyond the loopback interface.
    pub tls: Option<TlsFiles>,
    /// Folders that files may be opened from.
    pub folders: Vec<PathBuf>,
    /// The file that is opened first.
    pub file: Option<PathBuf>,
    /// Folder of recovery files and of the list of recent documents; none are kept where this is missing.
    pub state_folder: Option<PathBuf>,
    /// When things happen by themselves.
    pub timing: Timing,
}

/// Everything that requests share.
#[derive(Debug)]
pub(crate) struct Studio {
    pub(crate) hosts: Hosts,
    pub(crate) tokens: Tokens,
    pub(crate) folders: Folders,
    pub(crate) documents: Documents,
    pub(crate) downloads: Arc<Downloads>,
    pub(crate) uploads: Uploads,
    pub(crate) recent: Recent,
    /// The file that was named at start.
    pub(crate) file: Option<PathBuf>,
}

/// A server that listens.
pub struct Server {
    studio: Arc<Studio>,
    listener: tls::Listener,
    address: SocketAddr,
}

impl Server {
    /// Listens. Must be called within a runtime.
    ///
    /// # Errors
    /// [`StudioError::Request`] for a host beyond the loopback interface without certificate and key; an address that cannot be
    /// used, a certificate or a folder that cannot be read.
    pub async fn bind(options: Options) -> Result<Self, StudioError> {
        let hosts = Hosts::new(&options.host, options.tls.is_some())?;
        let acceptor = options.tls.as_ref().map(TlsFiles::acceptor).transpose()?;
        let (host, port) = (options.host.as_str(), options.port);
        let fail = |e: std::io::Error| StudioError::Environment(format!("cannot listen on {host}, port {port}: {e}"));
        let tcp = TcpListener::bind((host.trim_matches(['[', ']']), port)).await.map_err(fail)?;
        let address = tcp.local_addr().map_err(fail)?;
        let listener = tls::Listener::new(tcp, acceptor);
        Ok(Self { studio: Arc::new(Studio::new(hosts, options)?), listener, address })
    }

    /// Address of the page with a token that can be used once.
    pub fn url(&self) -> String {
        let scheme = self.studio.hosts.scheme();
        let (host, port) = (Hosts::shown(self.address.ip()), self.address.port());
        format!("{scheme}://{host}:{port}/#token={}", self.studio.tokens.invite().text())
    }

    /// The address that is listened on.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Serves until `stop` is ready, then closes the documents: unsaved changes are in the recovery folder afterwards.
    pub async fn run(self, stop: impl Future<Output = ()>) {
        let studio = Arc::clone(&self.studio);
        studio.open_first();
        let serving = tokio::spawn(self.listener.serve(router(Arc::clone(&studio))));
        stop.await;
        studio.documents.close_all();
        let closing = tokio::task::spawn_blocking(move || studio.documents.join_all(Instant::now() + CLOSING));
        let _ = closing.await;
        serving.abort();
    }
}

/// Time for documents to end in.
const CLOSING: Duration = Duration::from_millis(1200);

impl Studio {
    fn new(hosts: Hosts, options: Options) -> Result<Self, StudioError> {
        let state = options.state_folder.as_deref();
        let environment = |what: &str, e: std::io::Error| StudioError::Environment(format!("{what}: {e}"));
        if let Some(folder) = state {
            private_folder(folder).map_err(|e| environment(&folder.display().to_string(), e))?;
        }
        let recovery = state.map(|folder| Recovery::in_folder(folder.join("recovery"))).transpose();
        let recovery = recovery.map_err(|e| environment("the folder of unsaved changes cannot be made", e))?;
        let uploads = Uploads::new(state, recovery.clone());
        let uploads = uploads.map_err(|e| environment("no folder for dropped files can be made", e))?;
        let folders = Folders::new(&options.folders, uploads.root())?;
        let downloads = Arc::<Downloads>::default();
        let surroundings = Surroundings {
            recovery,
            downloads: Arc::clone(&downloads),
            allowed: folders.all().into(),
            timing: options.timing,
        };
        Ok(Self {
            hosts,
            tokens: Tokens::default(),
            documents: Documents::new(surroundings),
            downloads,
            uploads,
            recent: Recent::new(state.map(|folder| folder.join("recent.json"))),
            folders,
            file: options.file,
        })
    }

    /// Begins to open the file that was named at start, before the page asks for it. The page's own request says what is wrong.
    fn open_first(self: &Arc<Self>) {
        if let Some(file) = self.file.clone() {
            let studio = Arc::clone(self);
            tokio::task::spawn_blocking(move || studio.documents.open(&file).map(drop));
        }
    }

    /// A link for another window.
    pub(crate) fn invite(&self) -> Secret {
        self.tokens.invite()
    }
}

fn router(studio: Arc<Studio>) -> Router {
    let api = Router::new()
        .route("/session", post(api::session))
        .route("/link", post(api::link))
        .route("/state", get(api::state))
        .route("/open", post(api::open))
        .route("/close", post(api::close))
        .route("/files", get(api::files))
        .route("/examples", get(api::examples))
        .route("/recent", get(api::recent))
        .layer(DefaultBodyLimit::max(MAX_BODY))
        // Its own bound is the free part of the folder.
        .route("/upload", post(uploads::upload).layer(DefaultBodyLimit::disable()));
    Router::new()
        .nest("/api", api)
        .route("/ws", get(socket::connect))
        .route("/download/{nonce}", get(api::download))
        .fallback(get(assets::asset))
        .layer(axum::middleware::from_fn_with_state(Arc::clone(&studio), guard::guard))
        .with_state(studio)
}

#[cfg(test)]
mod test_server;
#[cfg(test)]
mod tests;
