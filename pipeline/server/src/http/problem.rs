//! Errors as RFC 9457 problem details.

use axum::http::{HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde_json::{Map, Value, json};

/// Why a request has no answer, in a sentence that says what would be right.
#[derive(Clone, Debug, PartialEq)]
pub struct Problem {
    status: StatusCode,
    detail: String,
    /// Members beyond those of the standard, such as the limit that was passed.
    more: Map<String, Value>,
    hint: Hint,
}

/// What a header says beside the sentence.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Hint {
    None,
    /// Seconds after which the client may try again.
    RetryAfter(u32),
    /// Bytes of the answer that a range lies beyond.
    Length(usize),
}

impl Problem {
    fn new(status: StatusCode, detail: impl Into<String>) -> Self {
        Self { status, detail: detail.into(), more: Map::new(), hint: Hint::None }
    }

    /// 400: a parameter is missing, unknown or out of range.
    pub fn bad_request(detail: impl Into<String>) -> Self {
        Self::new(StatusCode::BAD_REQUEST, detail)
    }

    /// 401: the token is missing or wrong.
    pub fn unauthorized(detail: impl Into<String>) -> Self {
        Self::new(StatusCode::UNAUTHORIZED, detail)
    }

    /// 404: there is no such thing.
    pub fn not_found(detail: impl Into<String>) -> Self {
        Self::new(StatusCode::NOT_FOUND, detail)
    }

    /// 405: the path is right, the method is not.
    pub fn method(detail: impl Into<String>) -> Self {
        Self::new(StatusCode::METHOD_NOT_ALLOWED, detail)
    }

    /// 406: the client takes no encoding that there is.
    pub fn not_acceptable(detail: impl Into<String>) -> Self {
        Self::new(StatusCode::NOT_ACCEPTABLE, detail)
    }

    /// 415: the body is of another type.
    pub fn media(detail: impl Into<String>) -> Self {
        Self::new(StatusCode::UNSUPPORTED_MEDIA_TYPE, detail)
    }

    /// 416: the range lies beyond the end of `length` bytes.
    pub fn range(length: usize) -> Self {
        let detail = format!("the range lies beyond the end of the answer, which has {length} bytes");
        Self { hint: Hint::Length(length), ..Self::new(StatusCode::RANGE_NOT_SATISFIABLE, detail) }
    }

    /// 421: the request is meant for another server.
    pub fn misdirected(detail: impl Into<String>) -> Self {
        Self::new(StatusCode::MISDIRECTED_REQUEST, detail)
    }

    /// 409: it can no longer be done.
    pub fn conflict(detail: impl Into<String>) -> Self {
        Self::new(StatusCode::CONFLICT, detail)
    }

    /// 413: more than a limit; `limit` names it.
    pub fn too_large(detail: impl Into<String>, limit: &str, value: u64) -> Self {
        let mut problem = Self::new(StatusCode::PAYLOAD_TOO_LARGE, detail);
        problem.more.insert(limit.to_owned(), json!(value));
        problem
    }

    /// 414: the address is too long.
    pub fn uri_too_long(detail: impl Into<String>) -> Self {
        Self::new(StatusCode::URI_TOO_LONG, detail)
    }

    /// 422: understood, but there is nothing right to answer.
    pub fn unprocessable(detail: impl Into<String>) -> Self {
        Self::new(StatusCode::UNPROCESSABLE_ENTITY, detail)
    }

    /// 429: the client has too much under way.
    pub fn too_many_requests(detail: impl Into<String>) -> Self {
        Self { hint: Hint::RetryAfter(1), ..Self::new(StatusCode::TOO_MANY_REQUESTS, detail) }
    }

    /// 500: the fault is the server's.
    pub fn internal(detail: impl Into<String>) -> Self {
        Self::new(StatusCode::INTERNAL_SERVER_ERROR, detail)
    }

    /// 503: the server cannot now.
    pub fn unavailable(detail: impl Into<String>) -> Self {
        Self { hint: Hint::RetryAfter(2), ..Self::new(StatusCode::SERVICE_UNAVAILABLE, detail) }
    }

    /// Its status.
    pub fn status(&self) -> StatusCode {
        self.status
    }

    /// Its sentence.
    pub fn detail(&self) -> &str {
        &self.detail
    }
}

impl IntoResponse for Problem {
    fn into_response(self) -> Response {
        let mut body = Map::new();
        body.insert("type".to_owned(), json!("about:blank"));
        body.insert("title".to_owned(), json!(self.status.canonical_reason().unwrap_or("Error")));
        body.insert("status".to_owned(), json!(self.status.as_u16()));
        body.insert("detail".to_owned(), json!(self.detail));
        body.extend(self.more);
        let mut response = (self.status, Value::Object(body).to_string()).into_response();
        let headers = response.headers_mut();
        headers.insert(header::CONTENT_TYPE, HeaderValue::from_static("application/problem+json"));
        headers.insert(header::CACHE_CONTROL, HeaderValue::from_static("no-store"));
        match self.hint {
            Hint::None => {}
            Hint::RetryAfter(seconds) => drop(headers.insert(header::RETRY_AFTER, HeaderValue::from(seconds))),
            Hint::Length(length) => {
                let place = HeaderValue::from_str(&format!("bytes */{length}"));
                headers.extend(place.ok().map(|place| (header::CONTENT_RANGE, place)));
            }
        }
        if self.status == StatusCode::UNAUTHORIZED {
            headers.insert(header::WWW_AUTHENTICATE, HeaderValue::from_static("Bearer"));
        }
        response
    }
}
