//! HTTP service: routes, parameters, responses and their limits.

pub mod answer;
pub mod extract;
pub mod guard;
pub mod host;
pub mod jobs;
pub mod metrics;
pub mod ogc;
pub mod openapi;
pub mod page;
pub mod patch;
pub mod problem;
pub mod query;
pub mod room;
pub mod service;
pub mod tiles;
pub mod values;

pub use extract::{Base, On, Pairs, Plain, Segments};
pub use problem::Problem;
pub use query::Query;
pub use service::{Limits, Service};

use answer::SkipCompression;
use axum::extract::{DefaultBodyLimit, State};
use axum::http::{HeaderMap, HeaderValue, Method, StatusCode, Version, header};
use axum::middleware::{from_fn, from_fn_with_state};
use axum::response::{IntoResponse, Response};
use axum::routing::{MethodRouter, get};
use axum::{Json, Router};
use std::sync::Arc;
use tower_http::catch_panic::CatchPanicLayer;
use tower_http::compression::CompressionLayer;
use tower_http::compression::predicate::{DefaultPredicate, Predicate};
use tower_http::cors::{AllowOrigin, CorsLayer};

#[cfg(test)]
mod tests;

type Route = (&'static str, fn() -> MethodRouter<Arc<Service>>);

/// All routes of the API; `openapi.rs` describes them.
pub const ROUTES: [Route; 22] = [
    ("/v1", || get(ogc::landing)),
    ("/v1/conformance", || get(ogc::conformance)),
    ("/v1/openapi.json", || get(openapi::description)),
    ("/v1/library", || get(library)),
    ("/v1/collections", || get(ogc::collections)),
    ("/v1/collections/{id}", || get(ogc::collection)),
    ("/v1/collections/{id}/patch", || get(patch::patch)),
    ("/v1/collections/{id}/study", || get(patch::snippet)),
    ("/v1/collections/{id}/point", || get(values::point)),
    ("/v1/collections/{id}/profile", || get(values::profile)),
    ("/v1/collections/{id}/tracks", || get(values::tracks)),
    ("/v1/collections/{id}/tracks/{track}", || get(values::track)),
    ("/v1/collections/{id}/styles/{layer}/map/tiles", || get(ogc::tile_sets)),
    ("/v1/collections/{id}/styles/{layer}/map/tiles/{tms}", || get(ogc::tile_set)),
    ("/v1/collections/{id}/styles/{layer}/map/tiles/{tms}/{level}/{row}/{col}", || get(tiles::tile)),
    ("/v1/collections/{id}/xyz/{layer}/tilejson.json", || get(tiles::tilejson)),
    ("/v1/collections/{id}/xyz/{layer}/{z}/{x}/{y}", || get(tiles::xyz)),
    ("/v1/tileMatrixSets", || get(ogc::matrix_sets)),
    ("/v1/tileMatrixSets/{id}", || get(ogc::matrix_set)),
    ("/v1/jobs", || get(jobs::list).post(jobs::order)),
    ("/v1/jobs/{id}", || get(jobs::one).delete(jobs::cancel)),
    ("/metrics", || get(metrics::metrics)),
];

/// Builds the router; pages of `origins` may use it (CORS).
pub fn router(service: &Arc<Service>, origins: &[HeaderValue]) -> Router {
    let mut router = Router::new();
    for (path, handlers) in ROUTES {
        router = router.route(path, handlers());
    }
    for path in page::paths() {
        router = router.route(&path, get(page::file));
    }
    let router = router
        .route("/healthz", get(async || "ok\n"))
        .fallback(async || Problem::not_found("no such page; the API is under /v1"))
        .method_not_allowed_fallback(async |method: Method| {
            Problem::method(format!("method {method} is not allowed here; the `Allow` header lists those that are"))
        })
        .layer(DefaultBodyLimit::max(service::BODY_BYTES))
        .layer(CompressionLayer::new().compress_when(DefaultPredicate::new().and(is_compressed)))
        .layer(from_fn(guard::tag_encodings))
        .layer(CatchPanicLayer::custom(panicked))
        .layer(from_fn_with_state(Arc::clone(service), guard::guard));
    // Outside the limits, so that pages of other origins can read refusals too.
    let router = if origins.is_empty() { router } else { router.layer(cors(origins)) };
    router.layer(from_fn_with_state(Arc::clone(service), guard::watch)).with_state(Arc::clone(service))
}

/// Whether to compress a response for clients that accept it.
fn is_compressed(_: StatusCode, _: Version, _: &HeaderMap, extensions: &axum::http::Extensions) -> bool {
    extensions.get::<SkipCompression>().is_none()
}

fn cors(origins: &[HeaderValue]) -> CorsLayer {
    let allowed = match origins {
        some if some.iter().any(|origin| origin == "*") => AllowOrigin::any(),
        some => AllowOrigin::list(some.iter().cloned()),
    };
    CorsLayer::new()
        .allow_origin(allowed)
        .allow_methods([Method::GET, Method::HEAD, Method::POST, Method::DELETE])
        .allow_headers([
            header::AUTHORIZATION,
            header::CONTENT_TYPE,
            header::IF_NONE_MATCH,
            header::IF_RANGE,
            header::RANGE,
        ])
        .expose_headers(tower_http::cors::Any)
}

fn panicked(_: Box<dyn std::any::Any + Send>) -> Response {
    Problem::internal("internal error; see the server log").into_response()
}

/// `GET /v1/library`
async fn library(State(service): State<Arc<Service>>, _: Plain) -> Json<serde_json::Value> {
    let values = service.library.statistics().list().map(|s| (s.name.to_owned(), s.value.into()));
    Json(serde_json::Value::Object(values.into_iter().collect()))
}
