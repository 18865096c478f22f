//! Answers that are kept: named by the hash of all that they depend on, made once however many ask, sent whole or in part, or not at all where
//! the client has them.

use super::Problem;
use crate::library::undivided;
use axum::body::{Body, Bytes};
use axum::http::{HeaderMap, HeaderName, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use quick_cache::Weighter;
use quick_cache::sync::Cache;
use std::ops::Range;

/// Longer answers are sent as they are: packing them would keep the runtime's threads from other clients, bytes.
const PACKED_MAX: usize = 4 << 20;
/// Longer parts of an answer are not copied, bytes.
const COPIED_MAX: usize = 256 << 10;
/// Endings of the tags of packed answers.
const ENCODINGS: [&str; 2] = ["gzip", "zstd"];

/// Marks a response that is not to be packed.
#[derive(Clone, Copy, Debug)]
pub struct AsItIs;

/// Bytes of memory that a response keeps while it is sent: a packed one all that it is packed from, a part the whole.
#[derive(Clone, Copy, Debug)]
pub struct Behind(pub u64);

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
pub struct Answers {
    kept: Cache<String, Answer, Size>,
    /// Whether they are for those alone who asked: no cache that others share may keep them.
    private: bool,
}

impl Answers {
    /// At most that many bytes are kept; caches that clients share keep none of `private` ones.
    pub fn new(bytes: u64, private: bool) -> Self {
        Self { kept: undivided((bytes / (1 << 16)).max(16) as usize, bytes, Size), private }
    }

    /// Bytes that are kept.
    pub fn bytes(&self) -> u64 {
        self.kept.weight()
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
        let tag = tag(what.as_bytes());
        if let Some(own) = held(headers, &tag) {
            return Ok(self.scoped(not_modified(own)));
        }
        let answer = match self.kept.get_value_or_guard_async(&tag).await {
            Ok(answer) => answer,
            // Who leaves drops the guard, and the next that waits makes it.
            Err(guard) => {
                let Some(made) = make.await? else {
                    return Ok(self.scoped(fresh(StatusCode::NO_CONTENT.into_response(), &format!("\"{tag}\""))));
                };
                // One that is too large to be kept comes back.
                let _ = guard.insert(made.clone());
                made
            }
        };
        let tag = format!("\"{tag}\"");
        if has_any(headers) {
            return Ok(self.scoped(not_modified(tag)));
        }
        Ok(self.scoped(fresh(whole_or_part(headers, &tag, answer), &tag)))
    }

    fn scoped(&self, mut response: Response) -> Response {
        if self.private {
            let freshness = HeaderValue::from_static("private, max-age=60, must-revalidate");
            response.headers_mut().insert(header::CACHE_CONTROL, freshness);
        }
        response
    }
}

/// The name of what depends on these bytes alone.
pub fn tag(what: &[u8]) -> String {
    blake3::hash(what).to_hex()[..32].to_owned()
}

/// The tag by which the client has the answer, in whatever encoding.
pub fn held(headers: &HeaderMap, tag: &str) -> Option<String> {
    let listed = headers.get_all(header::IF_NONE_MATCH).iter().filter_map(|value| value.to_str().ok());
    let mut own = listed.flat_map(|list| list.split(',')).map(|one| one.trim().trim_start_matches("W/"));
    own.find(|own| is_tag(own, tag)).map(str::to_owned)
}

/// Whether the client wants the answer only where there is none, `If-None-Match: *`.
fn has_any(headers: &HeaderMap) -> bool {
    headers.get(header::IF_NONE_MATCH).is_some_and(|value| value.as_bytes() == b"*")
}

fn is_tag(quoted: &str, tag: &str) -> bool {
    let own = quoted.strip_prefix('"').and_then(|own| own.strip_suffix('"'));
    let ending = own.and_then(|own| own.strip_prefix(tag));
    ending.is_some_and(|ending| {
        ending.is_empty() || ending.strip_prefix('-').is_some_and(|encoding| ENCODINGS.contains(&encoding))
    })
}

/// 304: the client has it by this tag.
pub fn not_modified(own: String) -> Response {
    fresh(StatusCode::NOT_MODIFIED.into_response(), &own)
}

/// A client may use an answer for a minute unasked: a server that is started anew with other files serves others under the same address.
fn fresh(mut response: Response, tag: &str) -> Response {
    let headers = response.headers_mut();
    if let Ok(tag) = HeaderValue::from_str(tag) {
        headers.insert(header::ETAG, tag);
    }
    headers.insert(header::CACHE_CONTROL, HeaderValue::from_static("max-age=60, must-revalidate"));
    headers.insert(header::VARY, HeaderValue::from_static("accept-encoding"));
    response
}

/// All of the bytes, or the range that the client asks for.
fn whole_or_part(headers: &HeaderMap, tag: &str, answer: Answer) -> Response {
    let length = answer.body.len();
    // Ranges are those of the bytes as they are: the tag of a packed answer names others.
    let same = headers.get(header::IF_RANGE).is_none_or(|value| value.as_bytes() == tag.as_bytes());
    let asked = headers.get(header::RANGE).and_then(|value| value.to_str().ok()).filter(|_| same);
    let mut behind = length;
    let mut response = match asked.and_then(|text| range(text, length)) {
        None => Body::from(answer.body).into_response(),
        Some(Some(part)) => {
            let place = format!("bytes {}-{}/{length}", part.start, part.end - 1);
            let part = match part.len() {
                // Alone: a slice would keep the whole answer in memory.
                0..=COPIED_MAX => {
                    behind = part.len();
                    Bytes::copy_from_slice(&answer.body[part])
                }
                _ => answer.body.slice(part),
            };
            (StatusCode::PARTIAL_CONTENT, [(header::CONTENT_RANGE, place)], part).into_response()
        }
        Some(None) => return Problem::range(length).into_response(),
    };
    let own = response.headers_mut();
    own.insert(header::CONTENT_TYPE, HeaderValue::from_static(answer.media));
    own.insert(header::ACCEPT_RANGES, HeaderValue::from_static("bytes"));
    own.extend(answer.more);
    response.extensions_mut().insert(Behind(behind as u64));
    if length > PACKED_MAX {
        response.extensions_mut().insert(AsItIs);
    }
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
    fn val_tags_match_in_known_encodings() {
        let headers =
            |value: &'static str| HeaderMap::from_iter([(header::IF_NONE_MATCH, HeaderValue::from_static(value))]);
        for (value, own) in [
            ("\"abc\"", "\"abc\""),
            ("W/\"abc\"", "\"abc\""),
            ("\"x\", \"abc-gzip\"", "\"abc-gzip\""),
            ("\"abc-zstd\"", "\"abc-zstd\""),
        ] {
            assert_eq!(held(&headers(value), "abc").as_deref(), Some(own), "{value}");
        }
        for value in ["\"abcd\"", "abc", "\"abc-nonsense\"", "\"abc-\"", "*"] {
            assert_eq!(held(&headers(value), "abc"), None, "{value}");
        }
        assert_eq!(held(&HeaderMap::new(), "abc"), None);
    }

    /// Behind a token no shared cache may keep an answer.
    #[test]
    fn val_answers_behind_a_token_are_private() {
        let runtime = tokio::runtime::Builder::new_current_thread().build().unwrap();
        for (private, freshness) in
            [(false, "max-age=60, must-revalidate"), (true, "private, max-age=60, must-revalidate")]
        {
            let answers = Answers::new(1 << 20, private);
            let make = async { Ok(Some(Answer::new("text/plain", "ground"))) };
            let response = runtime.block_on(answers.answer(&HeaderMap::new(), "what", make)).unwrap();
            assert_eq!(response.headers()[header::CACHE_CONTROL], freshness);
        }
    }

    /// A part that is not copied keeps the whole in memory.
    #[test]
    fn val_parts_say_what_they_keep() {
        let keeps = |range: &'static str| {
            let headers = HeaderMap::from_iter([(header::RANGE, HeaderValue::from_static(range))]);
            let answer = Answer::new("text/plain", vec![0; 1 << 20]);
            whole_or_part(&headers, "\"tag\"", answer).extensions().get::<Behind>().map(|behind| behind.0)
        };
        assert_eq!(keeps("bytes=0-99"), Some(100));
        assert_eq!(keeps("bytes=0-262144"), Some(1 << 20));
        assert_eq!(keeps("lines=0-99"), Some(1 << 20));
    }

    /// An answer of more than half of the room is kept, on any number of processors.
    #[test]
    fn val_large_answers_are_kept() {
        let runtime = tokio::runtime::Builder::new_current_thread().build().unwrap();
        let answers = Answers::new(1 << 20, false);
        let make = async { Ok(Some(Answer::new("text/plain", vec![0; 600_000]))) };
        runtime.block_on(answers.answer(&HeaderMap::new(), "what", make)).unwrap();
        assert!(answers.bytes() > 600_000, "{}", answers.bytes());
    }

    /// However many ask at once, an answer is made once; where who makes it leaves, the next makes it.
    #[test]
    fn val_answers_are_made_once() {
        use std::sync::atomic::{AtomicU32, Ordering};
        let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build().unwrap();
        runtime.block_on(async {
            let (answers, made) =
                (std::sync::Arc::new(Answers::new(1 << 20, false)), std::sync::Arc::new(AtomicU32::new(0)));
            let ask = || {
                let (answers, made) = (answers.clone(), made.clone());
                tokio::spawn(async move {
                    let make = async {
                        made.fetch_add(1, Ordering::SeqCst);
                        tokio::time::sleep(std::time::Duration::from_millis(50)).await;
                        Ok(Some(Answer::new("text/plain", "ground")))
                    };
                    answers.answer(&HeaderMap::new(), "what", make).await.unwrap().status()
                })
            };
            let first = ask();
            while made.load(Ordering::SeqCst) == 0 {
                tokio::task::yield_now().await;
            }
            let others: Vec<_> = (0..50).map(|_| ask()).collect();
            first.abort();
            for other in others {
                assert_eq!(other.await.unwrap(), StatusCode::OK);
            }
            assert_eq!(made.load(Ordering::SeqCst), 2);
        });
    }
}
