//! The server: connections, their limits, and their end.

use crate::collections;
use crate::http::answer::Answers;
use crate::http::guard::Peer;
use crate::http::jobs::Jobs;
use crate::http::metrics::Metrics;
use crate::http::{Limits, Service, router};
use crate::library::{Library, LibraryError, Settings as LibrarySettings};
use axum::http::HeaderValue;
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::server::graceful::GracefulShutdown;
use hyper_util::service::TowerToHyperService;
use sastrugi_stages::Error;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{Notify, Semaphore};
use tokio_io_timeout::TimeoutStream;
use tower::ServiceExt;

/// How long the head of a request may take.
const HEAD: Duration = Duration::from_secs(15);
/// How long a client may take nothing of its answer.
const STALL: Duration = Duration::from_secs(30);
/// How long requests under way may take to end when the server stops.
const FAREWELL: Duration = Duration::from_secs(10);
/// Most bytes of a head, and most headers.
const HEAD_BYTES: usize = 32 << 10;
const HEADERS: usize = 64;
/// Largest share of memory for answers that were given, bytes.
const ANSWERS: u64 = 128 << 20;

/// What to serve, and how.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Worlds, studies and releases.
    pub paths: Vec<PathBuf>,
    /// Address to listen at.
    pub listen: SocketAddr,
    /// Where tiles are kept.
    pub library: LibrarySettings,
    /// Limits of requests.
    pub limits: Limits,
    /// What clients must show.
    pub token: Option<String>,
    /// Pages of other servers that may use this one.
    pub origins: Vec<String>,
}

/// Tells a server to stop.
#[derive(Clone, Debug, Default)]
pub struct Stop(Arc<Notify>);

impl Stop {
    /// Ends what is under way, and takes nothing new.
    pub fn stop(&self) {
        self.0.notify_one();
    }
}

impl From<LibraryError> for Error {
    fn from(error: LibraryError) -> Self {
        match error {
            LibraryError::Occupied(_) | LibraryError::Version(_) => Self::Usage(error.to_string()),
            LibraryError::Io { path, source } => Self::at(&path, source),
        }
    }
}

/// Serves until it is told to stop; `ready` is called with the address once it listens, with what is served.
///
/// # Errors
/// Nothing to serve, a library or an address that cannot be used.
pub fn serve(
    settings: &Settings,
    stop: &Stop,
    ready: impl FnOnce(SocketAddr, &collections::Collections),
) -> Result<(), Error> {
    let collections = collections::open(&settings.paths)?;
    let origin = |text: &String| {
        HeaderValue::from_str(text)
            .map_err(|_| Error::Usage(format!("`--cors {text}`: it must be an origin, as https://example.org")))
    };
    let origins = settings.origins.iter().map(origin).collect::<Result<Vec<_>, _>>()?;
    let service = Arc::new(Service {
        collections,
        library: Library::open(&settings.library)?,
        answers: Answers::new(ANSWERS),
        limits: settings.limits.clone(),
        token: settings.token.clone(),
        jobs: Jobs::default(),
        metrics: Metrics::default(),
        under_way: std::sync::Mutex::default(),
    });
    let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build().map_err(Error::io)?;
    let result = runtime.block_on(async {
        let listen = settings.listen;
        let listener = TcpListener::bind(listen)
            .await
            .map_err(|e| Error::Retry(format!("{listen}: {e}; choose another address with --listen")))?;
        let address = listener.local_addr().map_err(Error::io)?;
        ready(address, &service.collections);
        accept(&listener, &service, &origins, stop).await;
        Ok(())
    });
    service.jobs.stop();
    service.library.stop();
    runtime.shutdown_timeout(FAREWELL);
    result
}

/// Takes connections until the end.
async fn accept(listener: &TcpListener, service: &Arc<Service>, origins: &[HeaderValue], stop: &Stop) {
    let app = router(service, origins);
    let seats = Arc::new(Semaphore::new(service.limits.connections));
    let graceful = GracefulShutdown::new();
    loop {
        let accepted = tokio::select! {
            accepted = listener.accept() => accepted,
            () = stop.0.notified() => break,
        };
        let (stream, peer) = match accepted {
            Ok(accepted) => accepted,
            Err(error) => {
                // As when there are too many open files: some will be closed.
                tracing::warn!(%error, "a connection could not be taken");
                tokio::time::sleep(Duration::from_millis(50)).await;
                continue;
            }
        };
        let Ok(seat) = Arc::clone(&seats).try_acquire_owned() else {
            refuse(&stream);
            continue;
        };
        // Small answers are not to wait for more.
        let _ = stream.set_nodelay(true);
        let mut stream = TimeoutStream::new(stream);
        stream.set_write_timeout(Some(STALL));
        let own = app.clone().map_request(move |mut request: hyper::Request<hyper::body::Incoming>| {
            request.extensions_mut().insert(Peer(peer));
            request
        });
        let mut builder = http1::Builder::new();
        builder.timer(TokioTimer::new()).header_read_timeout(HEAD).max_buf_size(HEAD_BYTES).max_headers(HEADERS);
        let connection = builder.serve_connection(TokioIo::new(Box::pin(stream)), TowerToHyperService::new(own));
        let connection = graceful.watch(connection);
        let service = Arc::clone(service);
        tokio::spawn(async move {
            service.metrics.connections.inc();
            // A client that breaks off is none of our errors.
            let _ = connection.await;
            service.metrics.connections.dec();
            drop(seat);
        });
    }
    tracing::info!("the server ends what is under way");
    let _ = tokio::time::timeout(FAREWELL, graceful.shutdown()).await;
}

/// Says in as few bytes as can be that there is no room, and closes.
fn refuse(stream: &TcpStream) {
    let answer =
        b"HTTP/1.1 503 Service Unavailable\r\nRetry-After: 2\r\nContent-Length: 0\r\nConnection: close\r\n\r\n";
    let _ = stream.try_write(answer);
}
