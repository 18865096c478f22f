//! Extractors of the handlers; whatever they cannot extract becomes a problem response.

use super::host::Host;
use super::query::Query;
use super::{Problem, Service};
use crate::collections::Collection;
use axum::extract::{FromRequest, FromRequestParts, Path, Request};
use axum::http::HeaderMap;
use axum::http::request::Parts;
use hyper::body::Bytes;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value};
use std::sync::Arc;

/// The query parameters as given.
#[derive(Clone, Debug)]
pub struct Pairs(pub Vec<(String, String)>);

impl Pairs {
    /// Checks the parameters; `known` are those that the route takes.
    ///
    /// # Errors
    /// A parameter that the route does not take.
    pub fn checked(self, known: &[&[&str]]) -> Result<Query, Problem> {
        Query::new(self.0, &known.concat())
    }
}

impl<S: Sync> FromRequestParts<S> for Pairs {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, _: &S) -> Result<Self, Problem> {
        let pairs = axum::extract::Query::<Vec<(String, String)>>::try_from_uri(&parts.uri);
        pairs
            .map(|pairs| Self(pairs.0))
            .map_err(|e| Problem::bad_request(format!("the query string cannot be parsed: {e}")))
    }
}

/// A URL without query parameters.
pub struct Plain;

impl<S: Sync> FromRequestParts<S> for Plain {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, Problem> {
        Pairs::from_request_parts(parts, state).await?.checked(&[]).map(|_| Self)
    }
}

/// Segments of the path.
pub struct Segments<T>(pub T);

impl<T: DeserializeOwned + Send, S: Send + Sync> FromRequestParts<S> for Segments<T> {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, Problem> {
        let path = Path::from_request_parts(parts, state).await;
        path.map(|Path(own)| Self(own)).map_err(|_| Problem::bad_request("the path cannot be parsed; it must be UTF-8"))
    }
}

/// The collection named in the path.
pub struct On(pub Arc<Collection>);

#[derive(serde::Deserialize)]
struct Id {
    id: String,
}

impl FromRequestParts<Arc<Service>> for On {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, service: &Arc<Service>) -> Result<Self, Problem> {
        let Segments(Id { id }) = Segments::from_request_parts(parts, service).await?;
        service.collection(&id).map(|found| Self(Arc::clone(found)))
    }
}

/// Base URL of the server as the client addresses it.
pub struct Base(pub String);

impl FromRequestParts<Arc<Service>> for Base {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, service: &Arc<Service>) -> Result<Self, Problem> {
        let host = Host::of(parts.version, &parts.uri, &parts.headers)?;
        let host = host.map_or_else(|| service.address.to_string(), |host| host.text.to_owned());
        // Set by a proxy that terminates TLS.
        let scheme = match text(&parts.headers, "x-forwarded-proto") {
            Some("https") => "https",
            _ => "http",
        };
        Ok(Self(format!("{scheme}://{host}")))
    }
}

fn text<'a>(headers: &'a HeaderMap, name: &str) -> Option<&'a str> {
    headers.get(name).and_then(|value| value.to_str().ok())
}

/// The body of a request: a JSON object.
pub struct Body(pub Map<String, Value>);

impl<S: Send + Sync> FromRequest<S> for Body {
    type Rejection = Problem;

    async fn from_request(request: Request, state: &S) -> Result<Self, Problem> {
        // Without a CORS preflight, pages of other sites can send any content type but this one.
        let media = text(request.headers(), "content-type").unwrap_or_default();
        if media.split(';').next().is_none_or(|own| !own.trim().eq_ignore_ascii_case("application/json")) {
            return Err(Problem::media("the body must be JSON, with `Content-Type: application/json`"));
        }
        let bytes = Bytes::from_request(request, state).await.map_err(|e| {
            if e.status() == axum::http::StatusCode::PAYLOAD_TOO_LARGE {
                Problem::too_large("the body is too large", "body_bytes_max", super::service::BODY_BYTES as u64)
            } else {
                Problem::bad_request("the body ends early")
            }
        })?;
        let value: serde_json::Result<Value> = serde_json::from_slice(&bytes);
        match value.map_err(|e| Problem::bad_request(format!("the body is not JSON: {e}")))? {
            Value::Object(members) => Ok(Self(members)),
            _ => Err(Problem::bad_request("the body must be a JSON object")),
        }
    }
}
