//! The server: accepts connections, limits them, shuts down.

use crate::collections;
use crate::http::answer::Answers;
use crate::http::guard::Peer;
use crate::http::jobs::Jobs;
use crate::http::metrics::Metrics;
use crate::http::room::{Rooms, Sending};
use crate::http::{Limits, Service, router};
use crate::library::{Library, LibraryError, Settings as LibrarySettings};
use axum::http::HeaderValue;
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::server::graceful::GracefulShutdown;
use hyper_util::service::TowerToHyperService;
use sastrugi_stages::Error;
use std::io::ErrorKind;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::{Arc, Mutex};
use std::time::Duration;
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{Notify, Semaphore};
use tokio_io_timeout::TimeoutStream;
use tower::ServiceExt;

/// Time limit for receiving a request head.
const HEAD: Duration = Duration::from_secs(15);
/// How long a client may stop reading its response.
const STALL: Duration = Duration::from_secs(30);
/// On shutdown: how long open requests may take to finish, then how long the runtime waits for its threads.
const GRACE: Duration = Duration::from_secs(9);
const SHUTDOWN: Duration = Duration::from_secs(1);
/// Largest request head, bytes, and largest number of headers.
const HEAD_BYTES: usize = 32 << 10;
const HEADERS: usize = 64;
/// Memory for cached responses, bytes.
const CACHE_BYTES: u64 = 128 << 20;

/// What to serve, and how.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Files of worlds, studies and releases.
    pub paths: Vec<PathBuf>,
    /// Address to listen on.
    pub listen: SocketAddr,
    /// Tile library: folder, sizes, worker threads.
    pub library: LibrarySettings,
    /// Limits of requests.
    pub limits: Limits,
    /// Bearer token that clients must send.
    pub token: Option<String>,
    /// Origins of other sites whose pages may use this server (CORS).
    pub origins: Vec<String>,
}

/// Handle that stops a server.
#[derive(Clone, Debug, Default)]
pub struct Stop(Arc<Notify>);

impl Stop {
    /// Finishes open requests and accepts no new ones.
    pub fn stop(&self) {
        self.0.notify_one();
    }
}

impl From<LibraryError> for Error {
    fn from(error: LibraryError) -> Self {
        match error {
            LibraryError::Occupied(_) | LibraryError::Version(_) | LibraryError::NoFolder(_) => {
                Self::Usage(error.to_string())
            }
            LibraryError::Io { path, source } => {
                let words = format!(
                    "{}: cannot use the tile library: {source}; choose another folder with --library",
                    path.display()
                );
                match Self::at(&path, source) {
                    Self::Retry(_) => Self::Retry(words),
                    _ => Self::Failed(words),
                }
            }
        }
    }
}

/// Serves until `stop` is triggered; calls `ready` with the address and the collections once the server listens.
///
/// # Errors
/// There is nothing to serve, or the library or the address cannot be used.
pub fn serve(
    settings: &Settings,
    stop: &Stop,
    ready: impl FnOnce(SocketAddr, &collections::Collections),
) -> Result<(), Error> {
    let collections = collections::open(&settings.paths, settings.library.memory_bytes)?;
    let origins = settings.origins.iter().map(|text| origin(text)).collect::<Result<Vec<_>, _>>()?;
    let library = Library::open(&settings.library)?;
    let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build().map_err(Error::io)?;
    let (listener, address) = runtime.block_on(listen(settings.listen))?;
    let service = Arc::new(Service {
        address,
        collections,
        library,
        answers: Answers::new(CACHE_BYTES, settings.token.is_some()),
        limits: settings.limits.clone(),
        token: settings.token.clone(),
        hosts: origins.iter().filter_map(host_of).collect(),
        jobs: Jobs::default(),
        metrics: Metrics::default(),
        under_way: Mutex::default(),
        sending: Sending::default(),
        rooms: Rooms::default(),
        processors: Arc::new(Semaphore::new(settings.library.workers.max(1))),
        tables: Arc::new(Semaphore::new(1)),
    });
    ready(address, &service.collections);
    runtime.block_on(accept(listener, &service, &origins, stop));
    service.jobs.stop();
    service.library.stop();
    runtime.shutdown_timeout(SHUTDOWN);
    Ok(())
}

/// Checks an origin whose pages may use the server.
fn origin(text: &str) -> Result<HeaderValue, Error> {
    let host = ["http://", "https://"].iter().find_map(|scheme| text.strip_prefix(scheme)).unwrap_or_default();
    let plain = |b: u8| b.is_ascii_alphanumeric() || b".:-_[]".contains(&b);
    let is_origin = text == "*" || (!host.is_empty() && host.bytes().all(plain));
    HeaderValue::from_str(text).ok().filter(|_| is_origin).ok_or_else(|| {
        Error::Usage(format!(
            "`--cors {text}`: it must be an origin without a path, for example https://example.org, or `*`"
        ))
    })
}

/// The host of an origin, without its port.
fn host_of(origin: &HeaderValue) -> Option<String> {
    let (_, host) = origin.to_str().ok()?.split_once("://")?;
    let name = match host.rsplit_once(':') {
        // An IPv6 address without a port ends in `]`.
        Some((name, _)) if !host.ends_with(']') => name,
        _ => host,
    };
    Some(name.to_owned())
}

async fn listen(listen: SocketAddr) -> Result<(TcpListener, SocketAddr), Error> {
    let failed = |e: std::io::Error| {
        let words = format!("{listen}: {e}; choose another address with --listen");
        match e.kind() {
            ErrorKind::AddrNotAvailable | ErrorKind::PermissionDenied => Error::Usage(words),
            _ => Error::Retry(words),
        }
    };
    let listener = TcpListener::bind(listen).await.map_err(failed)?;
    let address = listener.local_addr().map_err(failed)?;
    Ok((listener, address))
}

/// Accepts connections until the server is stopped.
async fn accept(listener: TcpListener, service: &Arc<Service>, origins: &[HeaderValue], stop: &Stop) {
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
                // For example too many open files; some will be closed soon.
                tracing::warn!(%error, "a connection could not be accepted");
                tokio::time::sleep(Duration::from_millis(50)).await;
                continue;
            }
        };
        let Ok(seat) = Arc::clone(&seats).try_acquire_owned() else {
            refuse(&stream);
            continue;
        };
        // Small responses must not wait to be batched (Nagle).
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
            // A client that disconnects is not a server error.
            let _ = connection.await;
            service.metrics.connections.dec();
            drop(seat);
        });
    }
    // New connections are refused at once.
    drop(listener);
    tracing::info!("shutting down; finishing open requests");
    let _ = tokio::time::timeout(GRACE, graceful.shutdown()).await;
}

/// Answers 503 in as few bytes as possible and closes the connection.
fn refuse(stream: &TcpStream) {
    let answer =
        b"HTTP/1.1 503 Service Unavailable\r\nRetry-After: 2\r\nContent-Length: 0\r\nConnection: close\r\n\r\n";
    let _ = stream.try_write(answer);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_origins_have_a_scheme_and_no_path() {
        for right in ["*", "http://localhost:3000", "https://example.org", "http://[::1]:8080"] {
            assert_eq!(origin(right).unwrap(), right);
        }
        for wrong in ["", "example.org", "ftp://example.org", "http://", "https://example.org/", "http://a,b"] {
            let said = origin(wrong).unwrap_err().to_string();
            assert!(said.starts_with(&format!("`--cors {wrong}`: it must be an origin")), "{said}");
        }
    }

    #[test]
    fn val_hosts_of_origins_have_no_port() {
        let of = |text: &'static str| host_of(&HeaderValue::from_static(text));
        for (text, host) in [
            ("http://example.org", "example.org"),
            ("https://example.org:8443", "example.org"),
            ("http://[::1]", "[::1]"),
            ("http://[::1]:80", "[::1]"),
        ] {
            assert_eq!(of(text).as_deref(), Some(host));
        }
        assert_eq!(of("*"), None);
    }
}
