//! Errors as RFC 9457 problem details.

use axum::http::{HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde_json::{Map, Value, json};

/// Why a request failed: an HTTP status, and a sentence that states what would be accepted.
#[derive(Clone, Debug, PartialEq)]
pub struct Problem {
    status: StatusCode,
    detail: String,
    /// Members beyond the standard ones, such as the limit that was exceeded.
    more: Map<String, Value>,
    hint: Hint,
}

/// The beginning of a text that a client sent, for a message about it.
pub fn shortened(text: &str) -> String {
    text.chars().take(60).collect()
}

/// An additional header.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Hint {
    None,
    /// Seconds to wait before a retry.
    RetryAfter(u32),
    /// Length of the complete response, bytes, for a range beyond its end.
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

    /// 404: no such resource, or no data.
    pub fn not_found(detail: impl Into<String>) -> Self {
        Self::new(StatusCode::NOT_FOUND, detail)
    }

    /// 405: the route does not support the method.
    pub fn method(detail: impl Into<String>) -> Self {
        Self::new(StatusCode::METHOD_NOT_ALLOWED, detail)
    }

    /// 406: none of the available encodings is acceptable to the client.
    pub fn not_acceptable(detail: impl Into<String>) -> Self {
        Self::new(StatusCode::NOT_ACCEPTABLE, detail)
    }

    /// 415: unsupported content type of the body.
    pub fn media(detail: impl Into<String>) -> Self {
        Self::new(StatusCode::UNSUPPORTED_MEDIA_TYPE, detail)
    }

    /// 416: the range starts beyond the end of the `length` bytes.
    pub fn range(length: usize) -> Self {
        let detail = format!("the range starts beyond the end of the response, which has {length} bytes");
        Self { hint: Hint::Length(length), ..Self::new(StatusCode::RANGE_NOT_SATISFIABLE, detail) }
    }

    /// 421: the `Host` is not one of this server's.
    pub fn misdirected(detail: impl Into<String>) -> Self {
        Self::new(StatusCode::MISDIRECTED_REQUEST, detail)
    }

    /// 409: the state of the resource no longer permits it.
    pub fn conflict(detail: impl Into<String>) -> Self {
        Self::new(StatusCode::CONFLICT, detail)
    }

    /// 413: a limit is exceeded; `limit` names it.
    ///
    /// # Examples
    /// ```
    /// use sastrugi_server::http::Problem;
    ///
    /// let problem = Problem::too_large("5000 samples exceed the limit of 4096", "samples_max", 4096);
    /// assert_eq!(problem.status().as_u16(), 413);
    /// assert!(problem.detail().contains("4096"));
    /// ```
    pub fn too_large(detail: impl Into<String>, limit: &str, value: u64) -> Self {
        let mut problem = Self::new(StatusCode::PAYLOAD_TOO_LARGE, detail);
        problem.more.insert(limit.to_owned(), json!(value));
        problem
    }

    /// 414: the URL is too long.
    pub fn uri_too_long(detail: impl Into<String>) -> Self {
        Self::new(StatusCode::URI_TOO_LONG, detail)
    }

    /// 422: the request is valid but has no result.
    pub fn unprocessable(detail: impl Into<String>) -> Self {
        Self::new(StatusCode::UNPROCESSABLE_ENTITY, detail)
    }

    /// 429: the client has too many requests in progress.
    pub fn too_many_requests(detail: impl Into<String>) -> Self {
        Self { hint: Hint::RetryAfter(1), ..Self::new(StatusCode::TOO_MANY_REQUESTS, detail) }
    }

    /// 500: a fault of the server.
    pub fn internal(detail: impl Into<String>) -> Self {
        Self::new(StatusCode::INTERNAL_SERVER_ERROR, detail)
    }

    /// 503: the server is busy.
    pub fn unavailable(detail: impl Into<String>) -> Self {
        Self { hint: Hint::RetryAfter(2), ..Self::new(StatusCode::SERVICE_UNAVAILABLE, detail) }
    }

    /// HTTP status.
    pub fn status(&self) -> StatusCode {
        self.status
    }

    /// The sentence.
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Status, header and body of a problem.
    fn sent(problem: Problem, name: &str) -> (u16, Option<String>, Value) {
        let response = problem.into_response();
        let own = response.headers().get(name).map(|value| value.to_str().unwrap().to_owned());
        assert_eq!(response.headers()[header::CONTENT_TYPE], "application/problem+json");
        assert_eq!(response.headers()[header::CACHE_CONTROL], "no-store");
        let status = response.status().as_u16();
        let runtime = tokio::runtime::Builder::new_current_thread().build().unwrap();
        let body = runtime.block_on(axum::body::to_bytes(response.into_body(), usize::MAX)).unwrap();
        (status, own, serde_json::from_slice(&body).unwrap())
    }

    #[test]
    fn val_problems_are_sent_with_their_headers() {
        let some = |text: &str| Some(text.to_owned());
        for (problem, status, name, value) in [
            (Problem::bad_request("why"), 400, "retry-after", None),
            (Problem::unauthorized("why"), 401, "www-authenticate", some("Bearer")),
            (Problem::range(10), 416, "content-range", some("bytes */10")),
            (Problem::too_many_requests("why"), 429, "retry-after", some("1")),
            (Problem::unavailable("why"), 503, "retry-after", some("2")),
        ] {
            let (sent_status, sent_value, body) = sent(problem, name);
            assert_eq!((sent_status, sent_value), (status, value));
            assert_eq!(body["status"], status);
        }
    }

    #[test]
    fn val_problems_state_the_limit() {
        let (_, _, body) = sent(Problem::too_large("too many samples", "samples_max", 4), "retry-after");
        let expected = json!({
            "type": "about:blank", "title": "Payload Too Large", "status": 413, "detail": "too many samples",
            "samples_max": 4,
        });
        assert_eq!(body, expected);
    }
}
