//! Connections: plain on the loopback interface, encrypted beyond it.

use std::io;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use axum::Router;
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::mpsc;
use tokio_rustls::TlsAcceptor;
use tokio_rustls::rustls::ServerConfig;
use tokio_rustls::rustls::crypto::ring;
use tokio_rustls::rustls::pki_types::pem::PemObject as _;
use tokio_rustls::rustls::pki_types::{CertificateDer, PrivateKeyDer};
use tokio_rustls::server::TlsStream;

use crate::error::StudioError;

/// Time for a handshake.
const HANDSHAKE: Duration = Duration::from_secs(10);
/// Handshakes that are finished and wait.
const WAITING: usize = 16;

/// Files of a certificate and of its key, in PEM.
#[derive(Clone, Debug)]
pub struct TlsFiles {
    /// The certificate and those that signed it.
    pub cert: PathBuf,
    /// The private key.
    pub key: PathBuf,
}

impl TlsFiles {
    pub(super) fn acceptor(&self) -> Result<TlsAcceptor, StudioError> {
        let fail = |path: &PathBuf, why: String| StudioError::Input { path: path.clone(), why };
        let chain: Result<Vec<_>, _> = CertificateDer::pem_file_iter(&self.cert).and_then(Iterator::collect);
        let chain = chain.map_err(|e| fail(&self.cert, format!("no certificate in PEM: {e}")))?;
        let key = PrivateKeyDer::from_pem_file(&self.key);
        let key = key.map_err(|e| fail(&self.key, format!("no private key in PEM: {e}")))?;
        let config = ServerConfig::builder_with_provider(Arc::new(ring::default_provider()))
            .with_safe_default_protocol_versions()
            .and_then(|builder| builder.with_no_client_auth().with_single_cert(chain, key))
            .map_err(|e| fail(&self.cert, format!("certificate and key cannot be used: {e}")))?;
        Ok(TlsAcceptor::from(Arc::new(config)))
    }
}

/// Accepts connections.
pub(super) struct Listener {
    tcp: TcpListener,
    acceptor: Option<TlsAcceptor>,
}

impl Listener {
    pub(super) fn new(tcp: TcpListener, acceptor: Option<TlsAcceptor>) -> Self {
        Self { tcp, acceptor }
    }

    /// Serves for ever.
    pub(super) async fn serve(self, router: Router) {
        let served = match self.acceptor {
            None => axum::serve(NoDelay(self.tcp), router).await,
            Some(acceptor) => {
                let address = self.tcp.local_addr().unwrap_or_else(|_| SocketAddr::from(([127, 0, 0, 1], 0)));
                let (give, take) = mpsc::channel(WAITING);
                let accepting = tokio::spawn(accept(self.tcp, acceptor, give));
                let served = axum::serve(Encrypted { take, address }, router).await;
                accepting.abort();
                served
            }
        };
        if let Err(error) = served {
            tracing::error!(%error, "the server has ended");
        }
    }
}

/// Small messages go at once: a reply must not wait for the next one.
struct NoDelay(TcpListener);

impl axum::serve::Listener for NoDelay {
    type Io = TcpStream;
    type Addr = SocketAddr;

    async fn accept(&mut self) -> (TcpStream, SocketAddr) {
        let (stream, from) = axum::serve::Listener::accept(&mut self.0).await;
        let _ = stream.set_nodelay(true);
        (stream, from)
    }

    fn local_addr(&self) -> io::Result<SocketAddr> {
        self.0.local_addr()
    }
}

struct Encrypted {
    take: mpsc::Receiver<(TlsStream<TcpStream>, SocketAddr)>,
    address: SocketAddr,
}

impl axum::serve::Listener for Encrypted {
    type Io = TlsStream<TcpStream>;
    type Addr = SocketAddr;

    async fn accept(&mut self) -> (Self::Io, SocketAddr) {
        match self.take.recv().await {
            Some(accepted) => accepted,
            // The task that accepts ends with this one.
            None => std::future::pending().await,
        }
    }

    fn local_addr(&self) -> io::Result<SocketAddr> {
        Ok(self.address)
    }
}

/// Accepts connections and shakes hands with each on its own, so that a slow one keeps nobody waiting.
async fn accept(mut tcp: TcpListener, acceptor: TlsAcceptor, give: mpsc::Sender<(TlsStream<TcpStream>, SocketAddr)>) {
    loop {
        let (stream, from) = axum::serve::Listener::accept(&mut tcp).await;
        let _ = stream.set_nodelay(true);
        let (acceptor, give) = (acceptor.clone(), give.clone());
        tokio::spawn(async move {
            if let Ok(Ok(stream)) = tokio::time::timeout(HANDSHAKE, acceptor.accept(stream)).await {
                let _ = give.send((stream, from)).await;
            }
        });
    }
}
