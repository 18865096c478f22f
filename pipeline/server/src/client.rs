//! HTTP client of the server; returns patches as grids.
//!
//! ```no_run
//! use sastrugi_server::client::{Client, Patch};
//!
//! let client = Client::new("http://127.0.0.1:8080");
//! let patch = Patch { resolution_m: Some(0.02), ..Patch::new("planet", [0.0, 0.0], [512, 512]) };
//! let heights = client.patch(&patch)?;
//! println!("{} x {} samples", heights.cols(), heights.rows());
//! # Ok::<(), sastrugi_server::client::ClientError>(())
//! ```

use sastrugi_numeric::{Geometry, Grid, GroundGrid};
use serde::Deserialize;
use std::time::Duration;
use ureq::Agent;
use ureq::http::{HeaderMap, Response};

/// Attempts at a request while the server is busy.
const TRIES: u32 = 10;
/// Longest wait between two attempts, s.
const WAIT_MAX_S: u64 = 30;
/// Time limit of a request, s.
const REQUEST_S: u64 = 600;
/// A sample is rock if rocks cover at least this share of it.
const ROCK: f32 = 0.5;

/// Why a request failed.
#[derive(Debug, thiserror::Error)]
pub enum ClientError {
    /// The server refused the request.
    #[error("{status}: {detail}")]
    Refused {
        /// HTTP status.
        status: u16,
        /// Detail of the server's error.
        detail: String,
    },
    /// No response arrived.
    #[error("{0}")]
    Transport(#[from] ureq::Error),
    /// The response is not in the format of this server.
    #[error("{0}")]
    Answer(String),
}

/// A field of a collection.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Field {
    /// Heights, m.
    #[default]
    Elevation,
    /// Albedo, 0 to 1.
    Albedo,
    /// Share of the cell that rocks cover, 0 to 1.
    Class,
    /// Potential rock cover: share of the ground that rocks of all sizes may cover, 0 to 1.
    RockPotential,
}

impl Field {
    fn name(self) -> &'static str {
        match self {
            Self::Elevation => "elevation",
            Self::Albedo => "albedo",
            Self::Class => "class",
            Self::RockPotential => "rock_potential",
        }
    }
}

/// A request for a patch.
#[derive(Clone, Debug, PartialEq)]
pub struct Patch {
    /// Id of the collection.
    pub collection: String,
    /// Position of the south-west sample, m.
    pub origin_m: [f64; 2],
    /// Columns and rows.
    pub size: [usize; 2],
    /// Sample spacing, m; the collection's own if absent.
    pub resolution_m: Option<f64>,
    /// Field to return.
    pub field: Field,
    /// Numbers of the processes to apply, from 1; all if absent.
    pub phenomena: Option<Vec<usize>>,
    /// Craters and rocks up to this width are left out, m.
    pub feature_min_m: f64,
}

impl Patch {
    /// Requests heights on `size` (columns, rows) with the south-west sample at `origin_m`.
    pub fn new(collection: &str, origin_m: [f64; 2], size: [usize; 2]) -> Self {
        Self {
            collection: collection.to_owned(),
            origin_m,
            size,
            resolution_m: None,
            field: Field::default(),
            phenomena: None,
            feature_min_m: 0.0,
        }
    }

    /// Path and query of the request.
    fn address(&self) -> String {
        // `{:?}` prints the shortest digits that identify the number, so the server reads the same value.
        let Self { collection, origin_m: [x, y], size: [cols, rows], field, .. } = self;
        let mut text = format!(
            "/v1/collections/{collection}/patch?origin={x:?},{y:?}&size={cols},{rows}&field={}&format=raw",
            field.name()
        );
        if let Some(resolution_m) = self.resolution_m {
            text.push_str(&format!("&resolution_m={resolution_m:?}"));
        }
        if let Some(phenomena) = &self.phenomena {
            let numbers: Vec<String> = phenomena.iter().map(usize::to_string).collect();
            text.push_str(&format!("&phenomena={}", numbers.join(",")));
        }
        if self.feature_min_m > 0.0 {
            text.push_str(&format!("&feature_min_m={:?}", self.feature_min_m));
        }
        text
    }
}

/// A collection as described by the server.
#[derive(Clone, Debug, Deserialize)]
pub struct CollectionSummary {
    /// Id in URLs.
    pub id: String,
    /// Display name.
    pub title: String,
    /// West, south, east and north, m.
    pub bounds_m: [f64; 4],
    /// Default sample spacing, m.
    pub cell_m: f64,
    /// Finest sample spacing, m.
    pub spacing_m: f64,
    /// Available fields.
    pub fields: Vec<String>,
}

/// Connection to a server.
#[derive(Clone, Debug)]
pub struct Client {
    agent: Agent,
    base: String,
    token: Option<String>,
}

impl Client {
    /// Client of the server at an address such as `http://127.0.0.1:8080`.
    pub fn new(base: &str) -> Self {
        let config = Agent::config_builder()
            .http_status_as_error(false)
            .timeout_global(Some(Duration::from_secs(REQUEST_S)))
            .build();
        Self { agent: config.into(), base: base.trim_end_matches('/').to_owned(), token: None }
    }

    /// Sends this bearer token with each request.
    #[must_use]
    pub fn with_token(self, token: &str) -> Self {
        Self { token: Some(token.to_owned()), ..self }
    }

    /// Lists the collections.
    ///
    /// # Errors
    /// See [`ClientError`].
    pub fn collections(&self) -> Result<Vec<CollectionSummary>, ClientError> {
        #[derive(Deserialize)]
        struct All {
            collections: Vec<CollectionSummary>,
        }
        let (_, body) = self.get("/v1/collections")?;
        let all: All = serde_json::from_slice(&body).map_err(|e| ClientError::Answer(format!("collections: {e}")))?;
        Ok(all.collections)
    }

    /// Fetches a patch: row 0 in the north, each sample at the centre of its cell, NaN where there is no data.
    ///
    /// # Errors
    /// See [`ClientError`].
    pub fn patch(&self, patch: &Patch) -> Result<Grid<f32>, ClientError> {
        let (head, body) = self.get(&patch.address())?;
        let numbers = |name: &str| -> Option<Vec<f64>> {
            head.get(name)?.to_str().ok()?.split(',').map(|text| text.parse().ok()).collect()
        };
        let number = |name: &str| numbers(name).filter(|all| all.len() == 1).map(|all| all[0]);
        let read = || -> Option<(usize, usize, f64, [f64; 2])> {
            let (rows, cols) = (number("grid-rows")? as usize, number("grid-columns")? as usize);
            let origin = numbers("grid-origin-m").filter(|all| all.len() == 2)?;
            Some((rows, cols, number("grid-resolution-m")?, [origin[0], origin[1]]))
        };
        let fits = |(rows, cols, ..): &(usize, usize, f64, [f64; 2])| {
            rows.checked_mul(*cols).and_then(|count| count.checked_mul(4)) == Some(body.len())
        };
        let (rows, cols, cell, south_west) = read()
            .filter(fits)
            .ok_or_else(|| ClientError::Answer("the response is not a patch; is this a terrain server?".to_owned()))?;
        let origin = south_west.map(|at| at - 0.5 * cell);
        let values = body.chunks_exact(4).map(|v| f32::from_le_bytes([v[0], v[1], v[2], v[3]])).collect();
        Ok(Grid::new(Geometry { rows, cols, cell: [cell; 2], origin }, values))
    }

    /// Fetches heights, with rock and albedo if the collection has them, as ground to drive on; `patch.field` is ignored.
    ///
    /// # Errors
    /// See [`ClientError`].
    pub fn ground(&self, patch: &Patch) -> Result<GroundGrid, ClientError> {
        let collections = self.collections()?;
        let own = collections.iter().find(|c| c.id == patch.collection);
        let has = |field: Field| own.is_some_and(|c| c.fields.iter().any(|name| name == field.name()));
        let of = |field: Field| self.patch(&Patch { field, ..patch.clone() });
        let some = |field: Field| has(field).then(|| of(field)).transpose();
        let class = some(Field::Class)?.map(|g| g.values.iter().map(|share| u8::from(*share >= ROCK)).collect());
        let albedo = some(Field::Albedo)?.map(|g| g.values);
        Ok(GroundGrid { heights: of(Field::Elevation)?, class, albedo })
    }

    /// Fetches headers and body; retries while the server is busy.
    fn get(&self, path: &str) -> Result<(HeaderMap, Vec<u8>), ClientError> {
        let mut tries = 1;
        loop {
            let mut request = self.agent.get(format!("{}{path}", self.base));
            if let Some(token) = &self.token {
                request = request.header("authorization", format!("Bearer {token}"));
            }
            let mut answer = request.call()?;
            if let Some(seconds) = wait_s(&answer).filter(|_| tries < TRIES) {
                tries += 1;
                std::thread::sleep(Duration::from_secs(seconds));
                continue;
            }
            let status = answer.status().as_u16();
            let body = answer.body_mut().with_config().limit(u64::MAX).read_to_vec()?;
            if status == 200 {
                return Ok((answer.headers().clone(), body));
            }
            let problem: Option<serde_json::Value> = serde_json::from_slice(&body).ok();
            let detail = problem.as_ref().and_then(|p| p["detail"].as_str()).unwrap_or("no reason given");
            return Err(ClientError::Refused { status, detail: detail.to_owned() });
        }
    }
}

/// Seconds to wait before a retry; `None` if the server is not busy.
fn wait_s<B>(answer: &Response<B>) -> Option<u64> {
    let busy = matches!(answer.status().as_u16(), 429 | 503);
    let asked = answer.headers().get("retry-after").and_then(|value| value.to_str().ok());
    busy.then(|| asked.and_then(|text| text.parse().ok()).unwrap_or(1).min(WAIT_MAX_S))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_requests_state_what_is_wanted() {
        let plain = Patch::new("planet", [-1.5, 2.0], [512, 256]);
        assert_eq!(
            plain.address(),
            "/v1/collections/planet/patch?origin=-1.5,2.0&size=512,256&field=elevation&format=raw"
        );
        let all = Patch {
            resolution_m: Some(0.02),
            field: Field::RockPotential,
            phenomena: Some(vec![1, 3]),
            feature_min_m: 0.5,
            ..plain.clone()
        };
        let more = "&field=rock_potential&format=raw&resolution_m=0.02&phenomena=1,3&feature_min_m=0.5";
        assert!(all.address().ends_with(more), "{}", all.address());
        // No processes at all is not the same as all of them.
        assert!(Patch { phenomena: Some(Vec::new()), ..plain }.address().ends_with("&format=raw&phenomena="));
    }

    /// A busy server is asked again after the time that it states, at most 30 s; other answers are final.
    #[test]
    fn val_the_client_waits_while_the_server_is_busy() {
        let wait = |status: u16, seconds: Option<&str>| {
            let mut answer = Response::builder().status(status);
            if let Some(seconds) = seconds {
                answer = answer.header("retry-after", seconds);
            }
            wait_s(&answer.body(()).unwrap())
        };
        assert_eq!([wait(503, Some("7")), wait(429, Some("600"))], [Some(7), Some(30)]);
        assert_eq!([wait(503, None), wait(503, Some("soon"))], [Some(1), Some(1)]);
        assert_eq!([wait(200, Some("7")), wait(404, None), wait(500, Some("7"))], [None; 3]);
    }
}
