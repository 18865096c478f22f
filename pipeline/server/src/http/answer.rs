//! Answers that are kept: named by the hash of all that they depend on, sent whole or in part, or not at all where the client has them.

use super::Problem;
use axum::body::{Body, Bytes};
use axum::http::{HeaderMap, HeaderName, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use quick_cache::Weighter;
use quick_cache::sync::Cache;
use std::ops::Range;

/// How long a client may use an answer unasked, s. A server that is started anew with other files serves others under the same address.
const FRESH_S: u32 = 60;

/// What is sent.
#[derive(Clone, Debug)]
pub struct Answer {
    /// Media type.
    pub media: &'static str,
    /// The bytes.
    pub body: Bytes,
    /// Headers beyond those of every answer.
    pub more: Vec<(HeaderName, HeaderValue)>,
}

impl Answer {
    /// An answer without more headers.
    pub fn new(media: &'static str, body: impl Into<Bytes>) -> Self {
        Self { media, body: body.into(), more: Vec::new() }
    }
}

#[derive(Clone)]
struct Size;

impl Weighter<String, Answer> for Size {
    fn weight(&self, key: &String, answer: &Answer) -> u64 {
        (256 + key.len() + answer.body.len()) as u64
    }
}

/// Answers that were given.
pub struct Answers(Cache<String, Answer, Size>);

impl Answers {
    /// At most that many bytes are kept.
    pub fn new(bytes: u64) -> Self {
        Self(Cache::with_weighter((bytes / (1 << 16)).max(16) as usize, bytes, Size))
    }

    /// Bytes that are kept.
    pub fn bytes(&self) -> u64 {
        self.0.weight()
    }

    /// The answer to a request that depends on `what` alone: none where the client has it, the one that was given before, or a new one.
    ///
    /// # Errors
    /// Those of `make`, which gives `None` where there is nothing: 204.
    pub async fn answer(
        &self,
        headers: &HeaderMap,
        what: &str,
        make: impl Future<Output = Result<Option<Answer>, Problem>>,
    ) -> Result<Response, Problem> {
        let tag = blake3::hash(what.as_bytes()).to_hex()[..32].to_owned();
        if has(headers, &tag) {
            return Ok(with_tag(StatusCode::NOT_MODIFIED.into_response(), &tag));
        }
        let answer = match self.0.get(&tag) {
            Some(answer) => answer,
            None => {
                let Some(made) = make.await? else { return Ok(StatusCode::NO_CONTENT.into_response()) };
                self.0.insert(tag.clone(), made.clone());
                made
            }
        };
        Ok(with_tag(whole_or_part(headers, &tag, answer), &tag))
    }
}

/// Whether the client names the answer among those that it has, in whatever encoding.
fn has(headers: &HeaderMap, tag: &str) -> bool {
    let listed = headers.get_all(header::IF_NONE_MATCH).iter().filter_map(|value| value.to_str().ok());
    listed.flat_map(|list| list.split(',')).any(|one| one.trim() == "*" || is_tag(one, tag))
}

fn is_tag(text: &str, tag: &str) -> bool {
    let own = text.trim().trim_start_matches("W/").trim_matches('"');
    own.split('-').next() == Some(tag)
}

fn with_tag(mut response: Response, tag: &str) -> Response {
    let headers = response.headers_mut();
    for (name, value) in [
        (header::ETAG, HeaderValue::from_str(&format!("\"{tag}\""))),
        (header::CACHE_CONTROL, HeaderValue::from_str(&format!("max-age={FRESH_S}, must-revalidate"))),
    ] {
        // Hexadecimal digits and words are valid headers.
        let _ = value.map(|value| headers.insert(name, value));
    }
    response
}

/// All of the bytes, or the range that the client asks for.
fn whole_or_part(headers: &HeaderMap, tag: &str, answer: Answer) -> Response {
    let length = answer.body.len();
    let same = headers.get(header::IF_RANGE).is_none_or(|value| value.to_str().is_ok_and(|v| is_tag(v, tag)));
    let asked = headers.get(header::RANGE).and_then(|value| value.to_str().ok()).filter(|_| same);
    let mut response = match asked.and_then(|text| range(text, length)) {
        None => Body::from(answer.body).into_response(),
        Some(Some(part)) => {
            let place = format!("bytes {}-{}/{length}", part.start, part.end - 1);
            (StatusCode::PARTIAL_CONTENT, [(header::CONTENT_RANGE, place)], answer.body.slice(part)).into_response()
        }
        Some(None) => {
            let place = format!("bytes */{length}");
            return (StatusCode::RANGE_NOT_SATISFIABLE, [(header::CONTENT_RANGE, place)]).into_response();
        }
    };
    let own = response.headers_mut();
    own.insert(header::CONTENT_TYPE, HeaderValue::from_static(answer.media));
    own.insert(header::ACCEPT_RANGES, HeaderValue::from_static("bytes"));
    own.extend(answer.more);
    response
}

/// One range of bytes: `None` where the header asks for none that is understood, `Some(None)` where it lies beyond the end.
fn range(text: &str, length: usize) -> Option<Option<Range<usize>>> {
    let (from, to) = text.strip_prefix("bytes=")?.trim().split_once('-')?;
    let number = |text: &str| text.parse::<usize>().ok();
    if from.is_empty() {
        let last = number(to)?;
        return Some((last > 0 && length > 0).then(|| length.saturating_sub(last)..length));
    }
    let start = number(from)?;
    let end = if to.is_empty() { length } else { number(to)?.checked_add(1)?.min(length) };
    if start >= length {
        return Some(None);
    }
    (start < end).then_some(Some(start..end))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_ranges_of_bytes() {
        assert_eq!(range("bytes=0-3", 10), Some(Some(0..4)));
        assert_eq!(range("bytes=4-", 10), Some(Some(4..10)));
        assert_eq!(range("bytes=-3", 10), Some(Some(7..10)));
        assert_eq!(range("bytes=-30", 10), Some(Some(0..10)));
        assert_eq!(range("bytes=5-99", 10), Some(Some(5..10)));
        assert_eq!(range("bytes=10-", 10), Some(None));
        assert_eq!(range("bytes=-0", 10), Some(None));
        for text in ["bytes=3-2", "bytes=0-1,4-5", "lines=0-1", "bytes=a-b", "bytes=0-18446744073709551615"] {
            assert_eq!(range(text, 10), None, "{text}");
        }
    }

    #[test]
    fn val_tags_match_in_any_encoding() {
        let headers =
            |value: &'static str| HeaderMap::from_iter([(header::IF_NONE_MATCH, HeaderValue::from_static(value))]);
        for value in ["\"abc\"", "W/\"abc\"", "\"x\", \"abc-gzip\"", "*"] {
            assert!(has(&headers(value), "abc"), "{value}");
        }
        assert!(!has(&headers("\"abcd\""), "abc") && !has(&HeaderMap::new(), "abc"));
    }
}
