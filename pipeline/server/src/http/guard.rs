//! Checks on every request (token, limits) and its log entry.

use super::Problem;
use super::answer::Retained;
use super::host::Host;
use super::query::TOKEN;
use super::room::Load;
use super::service::{BODY_BYTES, Service};
use axum::body::Body;
use axum::extract::{MatchedPath, Query, Request, State};
use axum::http::{HeaderName, HeaderValue, Method, StatusCode, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use hyper::body::{Body as HttpBody, Bytes, Frame, SizeHint};
use sastrugi_schemas::counted;
use std::collections::HashMap;
use std::net::{IpAddr, SocketAddr};
use std::pin::Pin;
use std::sync::{Arc, MutexGuard, PoisonError};
use std::task::{Context, Poll, ready};
use std::time::{Duration, Instant};

/// Address of the client.
#[derive(Clone, Copy, Debug)]
pub struct Peer(pub SocketAddr);

/// Content security policy: the page loads everything from this server.
const POLICY: &str =
    "default-src 'self'; img-src 'self' blob: data:; style-src 'self' 'unsafe-inline'; frame-ancestors 'none'";

/// Largest piece of a body that is handed over at once, bytes.
const PIECE: usize = 256 << 10;
/// The last [`TAIL`] bytes of a body are handed over as copies of at most this many bytes. Whatever the connection still holds when the response has
/// ended must not keep the complete response in memory, and it holds at most `TAIL` by then.
const LAST: usize = 16 << 10;
/// See [`LAST`].
const TAIL: usize = 64 << 10;
/// Time limit for a client to read its response.
const SENDING: Duration = Duration::from_secs(600);

/// Refuses requests for another host; counts and logs every request.
pub async fn watch(State(service): State<Arc<Service>>, request: Request, next: Next) -> Response {
    let started = Instant::now();
    let route = request.extensions().get::<MatchedPath>().map_or("none".to_owned(), |p| p.as_str().to_owned());
    let (method, path) = (request.method().clone(), request.uri().path().to_owned());
    let mut response = match check_host(&service, &request) {
        Err(problem) => problem.into_response(),
        Ok(()) => next.run(request).await,
    };
    let headers = response.headers_mut();
    headers.insert(header::X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff"));
    headers.insert(header::CONTENT_SECURITY_POLICY, HeaderValue::from_static(POLICY));
    headers.insert(HeaderName::from_static("referrer-policy"), HeaderValue::from_static("same-origin"));
    let seconds = started.elapsed().as_secs_f64();
    let status = response.status().as_u16();
    service.metrics.count(&route, status, seconds);
    tracing::debug!(%method, path, status, milliseconds = 1e3 * seconds, "request");
    response
}

/// Admits a request or refuses it with a reason.
pub async fn guard(State(service): State<Arc<Service>>, mut request: Request, next: Next) -> Response {
    let seat = match admit(&service, &request) {
        Err(problem) => return problem.into_response(),
        Ok(seat) => seat,
    };
    // A range is a part of what GET returns; other methods ignore it (RFC 9110, section 14.2).
    if request.method() != Method::GET {
        request.headers_mut().remove(header::RANGE);
    }
    match tokio::time::timeout(service.limits.request, next.run(request)).await {
        Ok(response) => send(&service, response, seat),
        Err(_) => late(&service).into_response(),
    }
}

fn late(service: &Service) -> Problem {
    let seconds = service.limits.request.as_secs();
    Problem::unavailable(format!(
        "the request took longer than {seconds} s and was cancelled; request fewer samples, or set `feature_min_m`"
    ))
}

/// One of the client's concurrent requests; released when dropped.
struct Seat {
    service: Arc<Service>,
    client: IpAddr,
}

impl Drop for Seat {
    fn drop(&mut self) {
        let mut under_way = seats(&self.service);
        if let Some(count) = under_way.get_mut(&self.client) {
            *count -= 1;
            if *count == 0 {
                under_way.remove(&self.client);
            }
        }
    }
}

fn seats(service: &Service) -> MutexGuard<'_, HashMap<IpAddr, usize>> {
    service.under_way.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A body that counts as a request in progress, and its bytes as being sent, until it has been sent. Each piece goes out once the previous one has
/// gone.
struct Held {
    body: Body,
    /// Remainder of the last frame.
    rest: Bytes,
    until: Instant,
    _seat: Option<Seat>,
    _load: Load,
}

impl HttpBody for Held {
    type Data = Bytes;
    type Error = axum::Error;

    fn poll_frame(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<Option<Result<Frame<Bytes>, axum::Error>>> {
        if Instant::now() > self.until {
            return Poll::Ready(Some(Err(axum::Error::new("the client read too slowly"))));
        }
        if self.rest.is_empty() {
            match ready!(Pin::new(&mut self.body).poll_frame(cx)) {
                Some(Ok(frame)) => match frame.into_data() {
                    Ok(data) => self.rest = data,
                    Err(other) => return Poll::Ready(Some(Ok(other))),
                },
                other => return Poll::Ready(other),
            }
        }
        Poll::Ready(Some(Ok(Frame::data(piece_of(&mut self.rest)))))
    }

    fn is_end_stream(&self) -> bool {
        self.rest.is_empty() && self.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        let (rest, hint) = (self.rest.len() as u64, self.body.size_hint());
        let mut all = SizeHint::new();
        all.set_lower(hint.lower() + rest);
        if let Some(upper) = hint.upper() {
            all.set_upper(upper + rest);
        }
        all
    }
}

/// Takes the next piece of the remainder.
fn piece_of(rest: &mut Bytes) -> Bytes {
    match rest.len().saturating_sub(TAIL) {
        0 => {
            let last = rest.split_to(rest.len().min(LAST));
            Bytes::copy_from_slice(&last)
        }
        before => rest.split_to(before.min(PIECE)),
    }
}

fn send(service: &Arc<Service>, response: Response, seat: Option<Seat>) -> Response {
    // Small responses are never refused: clients that read nothing cannot block them, and the number of connections bounds them.
    let retained = response.extensions().get::<Retained>().map_or_else(|| response.body().size_hint().lower(), |r| r.0);
    let bytes = Some(retained).filter(|bytes| *bytes > PIECE as u64).unwrap_or(0);
    let Some(load) = service.sending.add(bytes, service.limits.sending) else {
        return Problem::unavailable("too many response bytes are being sent; try again in 2 s").into_response();
    };
    let (rest, until) = (Bytes::new(), Instant::now() + SENDING);
    response.map(|body| Body::new(Held { body, rest, until, _seat: seat, _load: load }))
}

fn admit(service: &Arc<Service>, request: &Request) -> Result<Option<Seat>, Problem> {
    let length = request.uri().to_string().len();
    let most = service.limits.address;
    if length > most {
        return Err(Problem::uri_too_long(format!("the URL has {length} bytes; the limit is {most}")));
    }
    let announced = request.headers().get(header::CONTENT_LENGTH).and_then(|value| value.to_str().ok());
    if announced.and_then(|text| text.parse::<u64>().ok()).is_some_and(|bytes| bytes > BODY_BYTES as u64) {
        return Err(Problem::too_large(
            format!("the body exceeds {BODY_BYTES} bytes"),
            "body_bytes_max",
            BODY_BYTES as u64,
        ));
    }
    let path = request.uri().path();
    if let Some(token) = &service.token
        && (path.starts_with("/v1") || path == "/metrics")
        && !shows(request, token)
    {
        return Err(Problem::unauthorized("the token is missing or wrong; send `Authorization: Bearer TOKEN`"));
    }
    let Some(Peer(peer)) = request.extensions().get::<Peer>() else { return Ok(None) };
    let client = peer.ip();
    let mut under_way = seats(service);
    let count = under_way.entry(client).or_insert(0);
    if *count >= service.limits.per_client {
        let most = counted(service.limits.per_client, "request");
        return Err(Problem::too_many_requests(format!(
            "this client already has {most} in progress, the maximum; wait for one to finish"
        )));
    }
    *count += 1;
    Ok(Some(Seat { service: Arc::clone(service), client }))
}

/// A server without a token that listens on loopback only answers requests whose host names this machine; otherwise a page of another site could
/// reach it through a name of its own (DNS rebinding). Browsers always send a host.
fn check_host(service: &Service, request: &Request) -> Result<(), Problem> {
    let host = Host::of(request.version(), request.uri(), request.headers())?;
    let Some(host) = host.filter(|_| service.address.ip().is_loopback() && service.token.is_none()) else {
        return Ok(());
    };
    let name = host.name;
    if host.is_loopback() || service.hosts.iter().any(|own| own.eq_ignore_ascii_case(name)) {
        return Ok(());
    }
    Err(Problem::misdirected(format!(
        "host \"{name}\" is not allowed: the server listens on loopback only; to allow it, restart with `--cors http://{name}` or set SASTRUGI_TOKEN"
    )))
}

/// Whether a request carries the token, in its header or, for images, in its query.
fn shows(request: &Request, token: &str) -> bool {
    let header = request.headers().get(header::AUTHORIZATION).and_then(|value| value.to_str().ok());
    let of_header = header
        .and_then(|value| value.split_once(' '))
        .is_some_and(|(scheme, own)| scheme.eq_ignore_ascii_case("bearer") && same(own.trim(), token));
    of_header || {
        let pairs = Query::<Vec<(String, String)>>::try_from_uri(request.uri());
        pairs.is_ok_and(|Query(pairs)| pairs.iter().any(|(name, own)| name == TOKEN && same(own, token)))
    }
}

/// Equality in a time that does not depend on where two texts differ.
fn same(a: &str, b: &str) -> bool {
    blake3::hash(a.as_bytes()) == blake3::hash(b.as_bytes())
}

/// Gives each encoding of a response its own tag, because compressed bytes differ.
pub async fn tag_encodings(request: Request, next: Next) -> Response {
    let mut response = next.run(request).await;
    if response.status() == StatusCode::NOT_ACCEPTABLE {
        return Problem::not_acceptable("`Accept-Encoding` must allow gzip, zstd or identity").into_response();
    }
    let headers = response.headers_mut();
    let encoding = headers.get(header::CONTENT_ENCODING).and_then(|v| v.to_str().ok()).map(str::to_owned);
    let tag = headers.get(header::ETAG).and_then(|v| v.to_str().ok()).map(|tag| tag.trim_matches('"').to_owned());
    if let (Some(encoding), Some(tag)) = (encoding, tag)
        && let Ok(value) = HeaderValue::from_str(&format!("\"{tag}-{encoding}\""))
    {
        headers.insert(header::ETAG, value);
    }
    response
}

#[cfg(test)]
mod tests {
    use super::super::room::Sending;
    use super::*;
    use std::task::Waker;

    /// A client that reads too slowly gets no more of its response, and the memory is released.
    #[test]
    fn val_slow_clients_are_cut_off() {
        let sending = Sending::default();
        let next = |late: Duration| {
            let until = (Instant::now() + SENDING).checked_sub(late).unwrap();
            let (body, rest) = (Body::from(vec![7; 2 * PIECE]), Bytes::new());
            let load = sending.add(2 * PIECE as u64, u64::MAX).unwrap();
            let mut held = Held { body, rest, until, _seat: None, _load: load };
            match Pin::new(&mut held).poll_frame(&mut Context::from_waker(Waker::noop())) {
                Poll::Ready(Some(frame)) => frame.map(|frame| frame.into_data().unwrap().len()),
                other => panic!("{other:?}"),
            }
        };
        assert_eq!(next(SENDING - Duration::from_secs(60)).unwrap(), PIECE);
        assert!(next(SENDING + Duration::from_secs(1)).unwrap_err().to_string().contains("too slowly"));
        assert_eq!(sending.bytes(), 0);
    }

    /// The last pieces do not keep the complete response in memory.
    #[test]
    fn val_last_pieces_are_copies() {
        let complete: Bytes = (0..700_000_u32).map(|n| n as u8).collect::<Vec<_>>().into();
        let inside = |piece: &Bytes| complete.as_ptr_range().contains(&piece.as_ptr());
        let (mut rest, mut pieces) = (complete.clone(), Vec::new());
        while !rest.is_empty() {
            pieces.push(piece_of(&mut rest));
        }
        assert_eq!(pieces.concat(), complete);
        let (shared, copied): (Vec<&Bytes>, Vec<&Bytes>) = pieces.iter().partition(|piece| inside(piece));
        assert!(shared.iter().all(|piece| piece.len() <= PIECE) && copied.iter().all(|piece| piece.len() <= LAST));
        assert_eq!(copied.iter().map(|piece| piece.len()).sum::<usize>(), TAIL);
        assert!(pieces[pieces.len() - copied.len()..].iter().all(|piece| !inside(piece)));
    }
}
