//! Counters in the Prometheus text format.

use super::service::Service;
use axum::extract::State;
use axum::http::header;
use axum::response::{IntoResponse, Response};
use prometheus_client::encoding::EncodeLabelSet;
use prometheus_client::encoding::text::encode;
use prometheus_client::metrics::counter::Counter;
use prometheus_client::metrics::family::Family;
use prometheus_client::metrics::gauge::Gauge;
use prometheus_client::metrics::histogram::Histogram;
use prometheus_client::registry::Registry;
use std::sync::Arc;

/// Upper bounds of the histogram of response times, s.
const SECONDS: [f64; 11] = [0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.3, 1.0, 5.0, 30.0];

#[derive(Clone, Debug, PartialEq, Eq, Hash, EncodeLabelSet)]
struct Labels {
    route: String,
    status: u16,
}

type Seconds = Family<Vec<(String, String)>, Histogram, fn() -> Histogram>;

/// Counters and histograms of requests.
pub struct Metrics {
    requests: Family<Labels, Counter>,
    seconds: Seconds,
    /// Open connections.
    pub connections: Gauge,
}

fn histogram() -> Histogram {
    Histogram::new(SECONDS)
}

impl Default for Metrics {
    fn default() -> Self {
        Self {
            requests: Family::default(),
            seconds: Family::new_with_constructor(histogram),
            connections: Gauge::default(),
        }
    }
}

impl Metrics {
    /// Counts a response.
    pub fn count(&self, route: &str, status: u16, seconds: f64) {
        self.requests.get_or_create(&Labels { route: route.to_owned(), status }).inc();
        self.seconds.get_or_create(&vec![("route".to_owned(), route.to_owned())]).observe(seconds);
    }

    fn text(&self, service: &Service) -> Result<String, std::fmt::Error> {
        let mut registry = Registry::with_prefix("sastrugi");
        registry.register("requests", "Responses by route and status", self.requests.clone());
        registry.register("request_seconds", "Time to respond, s", self.seconds.clone());
        registry.register("connections", "Open connections", self.connections.clone());
        for statistic in service.library.statistics().list() {
            let (name, value) = (format!("library_{}", statistic.name), statistic.value);
            if statistic.is_counter {
                let counter: Counter = Counter::default();
                counter.inc_by(value);
                registry.register(name, statistic.help, counter);
            } else {
                let gauge: Gauge = Gauge::default();
                gauge.set(i64::try_from(value).unwrap_or(i64::MAX));
                registry.register(name, statistic.help, gauge);
            }
        }
        let answers: Gauge = Gauge::default();
        answers.set(i64::try_from(service.answers.bytes()).unwrap_or(i64::MAX));
        registry.register("answers_bytes", "Bytes of cached responses", answers);
        let sending: Gauge = Gauge::default();
        sending.set(i64::try_from(service.sending.bytes()).unwrap_or(i64::MAX));
        registry.register("sending_bytes", "Bytes of responses being sent", sending);
        let mut text = String::new();
        encode(&mut text, &registry)?;
        Ok(text)
    }
}

/// `GET /metrics`
pub async fn metrics(State(service): State<Arc<Service>>) -> Response {
    match service.metrics.text(&service) {
        Ok(text) => ([(header::CONTENT_TYPE, "application/openmetrics-text; version=1.0.0; charset=utf-8")], text)
            .into_response(),
        Err(error) => super::Problem::internal(error.to_string()).into_response(),
    }
}
