//! What every request passes: the token, the limits, and the books.

use super::query::TOKEN;
use super::service::Service;
use super::{Pairs, Problem};
use axum::extract::{FromRequestParts, MatchedPath, Query, Request, State};
use axum::http::{HeaderName, HeaderValue, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use std::collections::HashMap;
use std::net::{IpAddr, SocketAddr};
use std::sync::{Arc, MutexGuard, PoisonError};
use std::time::Instant;

/// Where a request comes from.
#[derive(Clone, Copy, Debug)]
pub struct Peer(pub SocketAddr);

/// The page takes everything from here.
const POLICY: &str =
    "default-src 'self'; img-src 'self' blob: data:; style-src 'self' 'unsafe-inline'; frame-ancestors 'none'";

/// Lets a request through, or says why not.
pub async fn guard(State(service): State<Arc<Service>>, request: Request, next: Next) -> Response {
    let started = Instant::now();
    let route = request.extensions().get::<MatchedPath>().map_or("none".to_owned(), |p| p.as_str().to_owned());
    let (method, path) = (request.method().clone(), request.uri().path().to_owned());
    let mut response = match admit(&service, &request) {
        Err(problem) => problem.into_response(),
        Ok(seat) => {
            let answer = tokio::time::timeout(service.limits.request, next.run(request)).await;
            drop(seat);
            answer.unwrap_or_else(|_| {
                let seconds = service.limits.request.as_secs();
                let detail = format!(
                    "the answer took longer than {seconds} s and was given up; ask for fewer samples, or for `feature_min_m`"
                );
                Problem::unavailable(detail).into_response()
            })
        }
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

/// A place among the requests of a client; given back when dropped.
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

fn admit(service: &Arc<Service>, request: &Request) -> Result<Option<Seat>, Problem> {
    let length = request.uri().to_string().len();
    let most = service.limits.address;
    if length > most {
        return Err(Problem::uri_too_long(format!("the address has {length} bytes; at most {most} are read")));
    }
    if let Some(token) = &service.token
        && request.uri().path().starts_with("/v1")
        && request.method() != axum::http::Method::OPTIONS
        && !shows(request, token)
    {
        return Err(Problem::unauthorized("this server asks for a token: send `Authorization: Bearer ...`"));
    }
    let Some(Peer(peer)) = request.extensions().get::<Peer>() else { return Ok(None) };
    let client = peer.ip();
    let mut under_way = seats(service);
    let count = under_way.entry(client).or_insert(0);
    if *count >= service.limits.per_client {
        let most = service.limits.per_client;
        return Err(Problem::too_many_requests(format!(
            "{most} requests of this client are under way, the most that may be"
        )));
    }
    *count += 1;
    Ok(Some(Seat { service: Arc::clone(service), client }))
}

/// Whether a request shows the token, in its header or, for pictures, in its address.
fn shows(request: &Request, token: &str) -> bool {
    let header = request.headers().get(header::AUTHORIZATION).and_then(|value| value.to_str().ok());
    let of_header = header.and_then(|value| value.strip_prefix("Bearer ")).is_some_and(|own| same(own, token));
    of_header || {
        let pairs = Query::<Vec<(String, String)>>::try_from_uri(request.uri());
        pairs.is_ok_and(|Query(pairs)| pairs.iter().any(|(name, own)| name == TOKEN && same(own, token)))
    }
}

/// Equality in a time that does not tell where two texts differ.
fn same(a: &str, b: &str) -> bool {
    blake3::hash(a.as_bytes()) == blake3::hash(b.as_bytes())
}

impl<S: Sync> FromRequestParts<S> for Pairs {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut axum::http::request::Parts, _: &S) -> Result<Self, Problem> {
        let pairs = Query::<Vec<(String, String)>>::try_from_uri(&parts.uri);
        pairs
            .map(|Query(pairs)| Self(pairs))
            .map_err(|e| Problem::bad_request(format!("the query cannot be read: {e}")))
    }
}

/// One tag for each encoding of an answer: compressed bytes are others.
pub async fn tag_encodings(request: Request, next: Next) -> Response {
    let mut response = next.run(request).await;
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
