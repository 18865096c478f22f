//! MCAP recordings of missions, viewer flavour: the topics of `sastrugi_schemas::topics`.
//!
//! Messages stand in the order of their time; chunks are compressed with Zstandard on one thread and carry checksums;
//! bytes follow from the recording alone. The map frame is the terrain's own coordinates.

mod log;
mod mesh;
mod messages;
mod protobuf;

#[cfg(test)]
mod tests;

pub use log::read_log;

use crate::digest::ContentHash;
use crate::{PROGRAM, atomic};
use foxglove::messages as fox;
use foxglove::messages::Timestamp;
use mcap::records::{MessageHeader, Metadata};
use mcap::{Compression, WriteOptions, Writer};
use sastrugi_numeric::Grid;
use sastrugi_schemas::topics::{Recording, Topic, VIEWER};
use std::collections::BTreeMap;
use std::io::{self, Cursor};
use std::path::{Path, PathBuf};

/// Level of Zstandard.
const ZSTD_LEVEL: u32 = 1;
/// Uncompressed size of a chunk, bytes.
const CHUNK_BYTES: u64 = 4 << 20;

/// Why a recording was not written or read.
#[derive(Debug, thiserror::Error)]
pub enum McapError {
    /// The recording cannot be put into messages.
    #[error("the recording cannot be written: {reason}")]
    Unfit {
        /// What does not fit.
        reason: String,
    },
    /// The file is no MCAP file, or not a whole one.
    #[error("{}: {reason}", path.display())]
    Unusable {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// The MCAP writer failed.
    #[error("the recording could not be encoded: {0}")]
    Encoding(#[from] mcap::McapError),
    /// The file system failed.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What failed.
        source: io::Error,
    },
}

impl McapError {
    fn unfit(reason: impl Into<String>) -> Self {
        Self::Unfit { reason: reason.into() }
    }
}

/// A terrain as its missions' recordings show it: what is the same for all of them is worked out once.
#[derive(Clone, Debug)]
pub struct TerrainView<'a> {
    dem: &'a Grid,
    classes: Option<&'a Grid<u8>>,
    /// Where the heights of `/terrain/mesh` count from, m.
    base_m: f64,
    /// `/terrain/grid` without its time.
    grid: fox::Grid,
}

impl<'a> TerrainView<'a> {
    /// The view of a terrain and, on the same cells, its roughness classes.
    ///
    /// # Errors
    /// [`McapError::Unfit`] for a class map of another shape than the terrain.
    pub fn new(dem: &'a Grid, classes: Option<&'a Grid<u8>>) -> Result<Self, McapError> {
        if classes.is_some_and(|c| (c.rows(), c.cols()) != (dem.rows(), dem.cols())) {
            return Err(McapError::unfit("the class map has another shape than the terrain"));
        }
        let (low_m, high_m) = dem.range().unwrap_or((0.0, 0.0));
        let (base_m, grid) = (mesh::base(low_m, high_m), messages::terrain_grid(dem, classes, low_m));
        Ok(Self { dem, classes, base_m, grid })
    }
}

/// A mission to write.
#[derive(Clone, Copy, Debug)]
pub struct MissionMcap<'a> {
    /// What happened.
    pub recording: &'a Recording,
    /// Terrain it happened on.
    pub terrain: &'a TerrainView<'a>,
    /// Start point, m.
    pub start_m: [f64; 2],
    /// Goal point, m.
    pub goal_m: [f64; 2],
    /// Start of the mission's clock, ns since 1970-01-01 UTC.
    pub epoch_ns: u64,
    /// Metadata records by name: `study`, `terrain`, `mission`, `vehicle`, `outcome`, `hashes` (with the terrain's
    /// SHA-256 in place of an attachment).
    pub metadata: &'a BTreeMap<String, BTreeMap<String, String>>,
}

/// What was written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct McapSummary {
    /// Number of messages.
    pub messages: u64,
    /// Bytes of all messages before compression.
    pub data_bytes: u64,
    /// Hash of the decoded stream: topic, time and data of every message in order.
    pub content_sha256: String,
}

/// A message before it gets its place in the file.
struct Pending {
    /// Position of its topic in [`VIEWER`].
    topic: usize,
    log_time: u64,
    data: Vec<u8>,
}

/// Writes a mission to a file.
///
/// # Errors
/// See [`McapError`].
pub fn write_mission(path: &Path, mission: &MissionMcap) -> Result<McapSummary, McapError> {
    let (bytes, summary) = encode_mission(mission)?;
    atomic::write(path, &bytes).map_err(|source| McapError::Io { path: path.to_owned(), source })?;
    Ok(summary)
}

/// What an MCAP file is, for people: its topics with their message counts, and its length in time.
///
/// # Errors
/// [`McapError::Unusable`] for a file without a readable summary, [`McapError::Io`] for one that cannot be read.
pub fn describe_file(path: &Path) -> Result<serde_json::Value, McapError> {
    let bytes = std::fs::read(path).map_err(|source| McapError::Io { path: path.to_owned(), source })?;
    let unusable = |reason: String| McapError::Unusable { path: path.to_owned(), reason };
    let summary =
        mcap::Summary::read(&bytes).map_err(|e| unusable(format!("no MCAP file, or not a whole one: {e}")))?;
    let summary = summary.ok_or_else(|| unusable("the file has no summary: it was not finished".to_owned()))?;
    let stats = summary.stats.ok_or_else(|| unusable("the summary has no statistics".to_owned()))?;
    let count = |id: &u16| stats.channel_message_counts.get(id).copied().unwrap_or(0);
    let topics: BTreeMap<&str, u64> = summary.channels.iter().map(|(id, c)| (c.topic.as_str(), count(id))).collect();
    let duration_ns = stats.message_end_time.saturating_sub(stats.message_start_time);
    Ok(serde_json::json!({
        "what": "MCAP recording",
        "messages": stats.message_count,
        "duration_s": duration_ns as f64 * 1e-9,
        "topics": topics,
        "metadata": summary.metadata_indexes.iter().map(|m| m.name.as_str()).collect::<Vec<_>>(),
    }))
}

/// A mission as the bytes of an MCAP file.
///
/// # Errors
/// As [`write_mission`], without the file system.
pub fn encode_mission(mission: &MissionMcap) -> Result<(Vec<u8>, McapSummary), McapError> {
    check(mission)?;
    let mut messages = messages::of_mission(mission)?;
    messages.sort_by_key(|m| (m.log_time, m.topic));
    let options = WriteOptions::new()
        .profile("")
        .library(PROGRAM)
        .compression(Some(Compression::Zstd))
        .compression_level(ZSTD_LEVEL)
        .compression_threads(0)
        .chunk_size(Some(CHUNK_BYTES));
    let mut writer = options.create(Cursor::new(Vec::new()))?;
    let channels = VIEWER.iter().map(|topic| add_channel(&mut writer, topic)).collect::<Result<Vec<_>, _>>()?;
    let mut content = ContentHash::new("messages");
    // Counted by topic: the messages of one instant then differ in little but their data.
    let mut sequences = [0; VIEWER.len()];
    for Pending { topic, log_time, data } in &messages {
        let (channel_id, sequence) = (channels[*topic], sequences[*topic]);
        let header = MessageHeader { channel_id, sequence, log_time: *log_time, publish_time: *log_time };
        sequences[*topic] += 1;
        writer.write_to_known_channel(&header, data)?;
        content.text(VIEWER[*topic].name);
        content.u64(*log_time);
        content.bytes(data);
    }
    for (name, metadata) in mission.metadata {
        writer.write_metadata(&Metadata { name: name.clone(), metadata: metadata.clone() })?;
    }
    writer.finish()?;
    let data_bytes = messages.iter().map(|m| m.data.len() as u64).sum();
    let summary = McapSummary { messages: messages.len() as u64, data_bytes, content_sha256: content.finish() };
    Ok((writer.into_inner().into_inner(), summary))
}

fn check(mission: &MissionMcap) -> Result<(), McapError> {
    let recording = mission.recording;
    if recording.states.is_empty() {
        return Err(McapError::unfit("it holds no state"));
    }
    let wheels = recording.vehicle.wheels.len();
    if let Some(sample) = recording.wheels.iter().find(|sample| sample.wheels.len() != wheels) {
        return Err(McapError::unfit(format!("{} of {wheels} wheels at {} s", sample.wheels.len(), sample.time_s)));
    }
    Ok(())
}

fn add_channel(writer: &mut Writer<Cursor<Vec<u8>>>, topic: &Topic) -> Result<u16, McapError> {
    let schema = match messages::public_schema(topic) {
        Some(data) => data,
        None => protobuf::descriptor_set(topic)?,
    };
    let schema = writer.add_schema(topic.schema, "protobuf", &schema)?;
    let description = BTreeMap::from([("description".to_owned(), topic.description.to_owned())]);
    Ok(writer.add_channel(schema, topic.name, "protobuf", &description)?)
}

/// Time of a sample, ns since 1970-01-01 UTC.
fn log_time(epoch_ns: u64, time_s: f64) -> u64 {
    // A negative or NaN time becomes the epoch.
    epoch_ns.saturating_add((time_s * 1e9).round() as u64)
}

fn timestamp(log_time: u64) -> Result<Timestamp, McapError> {
    let seconds = u32::try_from(log_time / 1_000_000_000);
    let seconds = seconds.map_err(|_| McapError::unfit(format!("{log_time} ns is beyond the year 2106")))?;
    Ok(Timestamp::new(seconds, (log_time % 1_000_000_000) as u32))
}
