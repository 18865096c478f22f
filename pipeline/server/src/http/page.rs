//! The map page, whose files are embedded in the program.

use super::Problem;
use super::answer::{held, not_modified, tag};
use axum::body::Bytes;
use axum::http::{HeaderMap, HeaderValue, Uri, header};
use axum::response::{IntoResponse, Response};

/// Name, media type and bytes of every file.
const FILES: &[(&str, &str, &[u8])] = &[
    ("index.html", "text/html; charset=utf-8", include_bytes!("../../page/dist/index.html")),
    ("page.css", "text/css; charset=utf-8", include_bytes!("../../page/dist/page.css")),
    ("page.js", "text/javascript; charset=utf-8", include_bytes!("../../page/dist/page.js")),
    ("three.js", "text/javascript; charset=utf-8", include_bytes!("../../page/dist/three.js")),
    ("licences.txt", "text/plain; charset=utf-8", include_bytes!("../../page/dist/licences.txt")),
];

/// Paths of the files, and of the page itself.
pub fn paths() -> impl Iterator<Item = String> {
    ["/".to_owned()].into_iter().chain(FILES.iter().map(|(name, ..)| format!("/{name}")))
}

/// A file of the page, `GET /` or `GET /{file}`.
pub async fn file(address: Uri, headers: HeaderMap) -> Result<Response, Problem> {
    let name = Some(address.path().trim_start_matches('/')).filter(|name| !name.is_empty()).unwrap_or("index.html");
    let found = FILES.iter().find(|(own, ..)| *own == name);
    let (_, media, bytes) = found.ok_or_else(|| Problem::not_found("no such page; the API is under /v1"))?;
    let tag = tag(bytes);
    if let Some(own) = held(&headers, &tag) {
        return Ok(not_modified(own));
    }
    let mut response = Bytes::from_static(bytes).into_response();
    let own = response.headers_mut();
    own.insert(header::CONTENT_TYPE, HeaderValue::from_static(media));
    own.insert(header::CACHE_CONTROL, HeaderValue::from_static("no-cache"));
    own.extend(HeaderValue::from_str(&format!("\"{tag}\"")).ok().map(|tag| (header::ETAG, tag)));
    Ok(response)
}
