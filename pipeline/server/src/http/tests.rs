//! Requests to the router of a service without collections, without a network.

use super::answer::Answers;
use super::guard::Peer;
use super::jobs::Jobs;
use super::metrics::Metrics;
use super::room::{Rooms, Sending};
use super::*;
use crate::collections::Collections;
use crate::library::{Library, Settings};
use axum::body::Body;
use std::net::SocketAddr;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use tokio::sync::Semaphore;
use tower::ServiceExt;

/// A service on loopback that also goes by the name `example.org`.
fn service(change: impl FnOnce(&mut Service)) -> Arc<Service> {
    let library = Settings { folder: None, disk_bytes: 0, memory_bytes: 1 << 20, workers: 1, queue: 1 };
    let mut service = Service {
        address: SocketAddr::from(([127, 0, 0, 1], 8080)),
        collections: Collections::new(),
        library: Library::open(&library).unwrap(),
        answers: Answers::new(1 << 20, false),
        limits: Limits::default(),
        token: None,
        hosts: vec!["example.org".to_owned()],
        jobs: Jobs::default(),
        metrics: Metrics::default(),
        under_way: Mutex::default(),
        sending: Sending::default(),
        rooms: Rooms::default(),
        processors: Arc::new(Semaphore::new(1)),
        tables: Arc::new(Semaphore::new(1)),
    };
    change(&mut service);
    Arc::new(service)
}

/// Sends a request to `localhost`, unless the headers name another host.
fn send(service: &Arc<Service>, method: &str, uri: &str, headers: &[(&str, &str)]) -> Response {
    let named = headers.iter().any(|(name, _)| *name == "host");
    let own = [("host", "localhost")].into_iter().filter(|_| !named);
    let mut request = axum::http::Request::builder().method(method).uri(uri);
    for (name, value) in headers.iter().copied().chain(own) {
        request = request.header(name, value);
    }
    let peer = Peer(SocketAddr::from(([127, 0, 0, 1], 9)));
    let request = request.extension(peer).body(Body::empty()).unwrap();
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
    runtime.block_on(router(service, &[]).oneshot(request)).unwrap()
}

fn status(service: &Arc<Service>, method: &str, uri: &str, headers: &[(&str, &str)]) -> u16 {
    send(service, method, uri, headers).status().as_u16()
}

#[test]
fn val_requests_are_answered_or_refused() {
    let service = service(|_| ());
    let long = format!("/healthz?{}", "a".repeat(9000));
    for (method, uri, expected) in [
        ("GET", "/healthz", 200),
        ("GET", "/", 200),
        ("GET", "/v1", 200),
        ("GET", "/v1/openapi.json", 200),
        ("GET", "/v1/collections", 200),
        ("GET", "/metrics", 200),
        ("GET", "/v1?x=1", 400),
        ("GET", "/v1/nothing", 404),
        ("GET", "/v1/collections/none", 404),
        ("GET", "/v1/jobs/1", 404),
        ("GET", "/page.js", 200),
        ("GET", "/page.js/", 404),
        ("GET", "/%ff", 404),
        ("POST", "/v1", 405),
        ("POST", "/page.js", 405),
        ("POST", "/v1/nothing", 404),
        ("POST", "/nothing", 404),
        // Without --cors, no other method is answered.
        ("OPTIONS", "/v1", 405),
        ("OPTIONS", "/nothing", 404),
        ("GET", long.as_str(), 414),
        ("POST", "/v1/jobs", 415),
    ] {
        assert_eq!(status(&service, method, uri, &[]), expected, "{method} {uri}");
    }
    assert_eq!(status(&service, "POST", "/v1/jobs", &[("content-length", "65537")]), 413);
    assert_eq!(status(&service, "OPTIONS", "/v1", &[("host", "evil.example")]), 421);
    for (encodings, expected) in
        [("identity;q=0", 406), ("identity;q=0, br", 406), ("identity;q=0, gzip", 200), ("br", 200)]
    {
        assert_eq!(status(&service, "GET", "/v1", &[("accept-encoding", encodings)]), expected, "{encodings}");
    }
    let response = send(&service, "GET", "/v1/collections/none", &[]);
    assert_eq!(response.headers()[header::CONTENT_TYPE], "application/problem+json");
    assert_eq!(response.headers()[header::X_CONTENT_TYPE_OPTIONS], "nosniff");
}

/// A server on loopback without a token answers only to names of this machine; with a token, to any.
#[test]
fn val_other_hosts_are_refused_on_loopback() {
    let open = service(|_| ());
    for (host, expected) in [
        ("localhost", 200),
        ("LOCALHOST:8080", 200),
        ("127.0.0.1:8080", 200),
        ("[::1]:8080", 200),
        ("example.org:3000", 200),
        ("evil.example", 421),
        ("192.168.0.7", 421),
        ("localhost.evil.example", 421),
        ("localhost.:8080", 200),
        ("EXAMPLE.org.", 200),
        // Browsers send these characters; a malformed host is refused too.
        ("a!b.evil.example", 421),
        ("a~b$c,d.evil.example:80", 421),
        ("", 400),
        ("evil.example@localhost", 400),
    ] {
        assert_eq!(status(&open, "GET", "/v1", &[("host", host)]), expected, "{host}");
    }
    assert_eq!(status(&open, "GET", "/v1", &[("host", "localhost"), ("host", "evil.example")]), 400);
    assert_eq!(status(&open, "GET", "http://evil.example/v1", &[("host", "localhost")]), 421);
    assert_eq!(status(&open, "GET", "http://localhost/v1", &[("host", "evil.example")]), 200);
    let secret = service(|service| service.token = Some("secret".to_owned()));
    let headers = [("host", "evil.example"), ("authorization", "Bearer secret")];
    assert_eq!(status(&secret, "GET", "/v1", &headers), 200);
}

#[test]
fn val_a_token_is_shown_in_the_header_or_the_query() {
    let secret = service(|service| service.token = Some("secret".to_owned()));
    for (uri, authorization, expected) in [
        ("/v1", "", 401),
        ("/metrics", "", 401),
        ("/healthz", "", 200),
        ("/v1", "Bearer secret", 200),
        ("/v1", "bearer  secret", 200),
        ("/v1", "Basic secret", 401),
        ("/v1", "secret", 401),
        ("/v1", "Bearer secre", 401),
        ("/v1?token=secret", "", 200),
        ("/v1?token=wrong", "", 401),
        ("/v1?tokens=secret", "", 401),
    ] {
        let headers = [("authorization", authorization)];
        let headers = if authorization.is_empty() { &headers[..0] } else { &headers[..] };
        assert_eq!(status(&secret, "GET", uri, headers), expected, "{uri} {authorization}");
    }
}

/// A client's request counts as in progress until its response has been read or dropped.
#[test]
fn val_requests_per_client_are_bounded() {
    let service = service(|service| service.limits.per_client = 1);
    let first = send(&service, "GET", "/healthz", &[]);
    let second = send(&service, "GET", "/healthz", &[]);
    assert_eq!((first.status().as_u16(), second.status().as_u16()), (200, 429));
    assert_eq!(second.headers()[header::RETRY_AFTER], "1");
    drop(first);
    assert_eq!(status(&service, "GET", "/healthz", &[]), 200);
}

/// Reading tables stops when the client leaves, and does not hold up work on ground.
#[test]
fn val_reading_stops_with_its_request() {
    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build().unwrap();
    let (begin, begun) = std::sync::mpsc::channel();
    let (end, ended) = std::sync::mpsc::channel();
    let service = service(|_| ());
    let reader = Arc::clone(&service);
    let request = runtime.spawn(async move {
        let read = move |stop: &AtomicBool| {
            begin.send(()).unwrap();
            while !stop.load(Ordering::Relaxed) {
                std::thread::sleep(Duration::from_millis(1));
            }
            end.send(()).unwrap();
            Ok(())
        };
        reader.reading(read).await
    });
    let patience = Duration::from_secs(60);
    begun.recv_timeout(patience).unwrap();
    assert_eq!(runtime.block_on(service.blocking(|| Ok(7))).unwrap(), 7);
    assert!(ended.try_recv().is_err());
    request.abort();
    ended.recv_timeout(patience).unwrap();
    // The seat is free again.
    runtime.block_on(service.reading(|_| Ok(()))).unwrap();
}
