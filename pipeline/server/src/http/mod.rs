//! The service: addresses, parameters, answers and their limits.

pub mod answer;
pub mod guard;
pub mod jobs;
pub mod metrics;
pub mod ogc;
pub mod openapi;
pub mod page;
pub mod patch;
pub mod problem;
pub mod query;
pub mod service;
pub mod tiles;
pub mod values;

pub use problem::Problem;
pub use query::Query;
pub use service::{Limits, Service};

use axum::extract::DefaultBodyLimit;
use axum::http::{HeaderValue, Method, header};
use axum::middleware::{from_fn, from_fn_with_state};
use axum::response::{IntoResponse, Response};
use axum::routing::{MethodRouter, get};
use axum::{Json, Router};
use std::sync::Arc;
use tower_http::catch_panic::CatchPanicLayer;
use tower_http::compression::CompressionLayer;
use tower_http::cors::{AllowOrigin, CorsLayer};

/// The parameters of an address, as they stand there.
#[derive(Clone, Debug)]
pub struct Pairs(pub Vec<(String, String)>);

type Route = (&'static str, fn() -> MethodRouter<Arc<Service>>);

/// Every address of the API; `openapi.rs` describes them.
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

/// The service as a router; `origins` may use it from their pages.
pub fn router(service: &Arc<Service>, origins: &[HeaderValue]) -> Router {
    let mut router = Router::new();
    for (path, handlers) in ROUTES {
        router = router.route(path, handlers());
    }
    router = router
        .route("/healthz", get(async || "ok\n"))
        .route("/", get(page::index))
        .route("/{*file}", get(page::file))
        .method_not_allowed_fallback(async || Problem::method("this address takes another method"))
        .layer(DefaultBodyLimit::max(service.limits.body));
    if !origins.is_empty() {
        let cors = CorsLayer::new()
            .allow_origin(AllowOrigin::list(origins.iter().cloned()))
            .allow_methods([Method::GET, Method::HEAD, Method::POST, Method::DELETE])
            .allow_headers([header::AUTHORIZATION, header::CONTENT_TYPE, header::IF_NONE_MATCH, header::RANGE])
            .expose_headers(tower_http::cors::Any);
        router = router.layer(cors);
    }
    router
        .layer(CompressionLayer::new())
        .layer(from_fn(guard::tag_encodings))
        .layer(CatchPanicLayer::custom(panicked))
        .layer(from_fn_with_state(Arc::clone(service), guard::guard))
        .with_state(Arc::clone(service))
}

fn panicked(_: Box<dyn std::any::Any + Send>) -> Response {
    Problem::internal("a fault of the server; its log says more").into_response()
}

/// `GET /v1/library`
async fn library(
    axum::extract::State(service): axum::extract::State<Arc<Service>>,
    pairs: Pairs,
) -> Result<Json<serde_json::Value>, Problem> {
    service::checked(pairs, &[])?;
    let s = service.library.statistics();
    Ok(Json(serde_json::json!({
        "memory_hits": s.memory_hits, "disk_hits": s.disk_hits, "made": s.made, "cancelled": s.cancelled, "failed": s.failed,
        "damaged": s.damaged, "evicted": s.evicted, "unwritten": s.unwritten, "disk_bytes": s.disk_bytes,
        "memory_bytes": s.memory_bytes, "queued": s.queued,
    })))
}
