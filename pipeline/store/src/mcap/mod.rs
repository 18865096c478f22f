//! MCAP recordings of missions in two flavours, which never mix in a file: for viewers (Foxglove's messages and our own, in
//! protobuf) and for ROS 2 (CDR). The topics are those of `sastrugi_schemas::topics`.
//!
//! Messages stand in the order of their time; chunks are compressed with Zstandard on one thread and carry checksums;
//! bytes follow from the recording alone. The map frame is the terrain's own coordinates.

mod frames;
mod log;
mod mesh;
mod protobuf;
mod ros2;
mod viewer;

#[cfg(test)]
mod tests;

pub use log::read_log;

use crate::PROGRAM;
use crate::atomic::{self, Target};
use crate::digest::ContentHash;
use foxglove::messages as fox;
use mcap::records::{MessageHeader, Metadata};
use mcap::{Compression, WriteOptions, Writer};
use sastrugi_numeric::Grid;
use sastrugi_schemas::study::McapFlavour;
use sastrugi_schemas::topics::{Recording, Topic};
use std::collections::BTreeMap;
use std::io::{self, Cursor};
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// Panels of Foxglove and Lichtblick for recordings of the viewer flavour: a layout file to import.
pub const VIEWER_LAYOUT: &str = include_str!("viewer-layout.json");

/// What makes a bag of a folder.
pub const BAG: &str = "metadata.yaml";
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
    /// Lowest and highest height, m.
    range_m: (f64, f64),
    /// `/terrain/grid` of the viewer flavour, without its time.
    grid: OnceLock<fox::Grid>,
    /// `/terrain` of the ROS 2 flavour, without its time.
    grid_map: OnceLock<ros2::GridMap>,
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
        let range_m = dem.range().unwrap_or((0.0, 0.0));
        Ok(Self { dem, classes, range_m, grid: OnceLock::new(), grid_map: OnceLock::new() })
    }

    fn grid(&self) -> &fox::Grid {
        self.grid.get_or_init(|| viewer::terrain_grid(self.dem, self.classes, self.range_m.0))
    }

    fn grid_map(&self) -> &ros2::GridMap {
        self.grid_map.get_or_init(|| ros2::grid_map(self.dem, self.classes))
    }
}

/// A mission to write.
#[derive(Clone, Copy, Debug)]
pub struct MissionMcap<'a> {
    /// Messages and their encoding.
    pub flavour: McapFlavour,
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
    /// Number of messages of each of the flavour's topics.
    pub counts: Vec<u64>,
    /// Time of the first message, ns since 1970-01-01 UTC.
    pub start_ns: u64,
    /// Time of the last message, ns since 1970-01-01 UTC.
    pub end_ns: u64,
    /// Bytes of all messages before compression.
    pub data_bytes: u64,
    /// Hash of the decoded stream: topic, time and data of every message in order.
    pub content_sha256: String,
}

/// What a flavour is made of.
struct Flavour {
    profile: &'static str,
    message_encoding: &'static str,
    schema_encoding: &'static str,
    topics: &'static [&'static Topic],
    /// The definition of a topic's messages.
    schema: fn(&Topic) -> Result<Vec<u8>, McapError>,
    channel_metadata: fn(&Topic) -> BTreeMap<String, String>,
    messages: fn(&MissionMcap, &mut Timeline) -> Result<(), McapError>,
}

impl Flavour {
    fn of(flavour: McapFlavour) -> &'static Self {
        match flavour {
            McapFlavour::Viewer => &viewer::FLAVOUR,
            McapFlavour::Ros2 => &ros2::FLAVOUR,
        }
    }
}

/// A message before it gets its place in the file.
struct Pending {
    /// Position of its topic in the flavour's list.
    topic: usize,
    log_time: u64,
    data: Vec<u8>,
}

/// Messages of a mission, in no particular order.
struct Timeline {
    topics: &'static [&'static Topic],
    epoch_ns: u64,
    pending: Vec<Pending>,
}

impl Timeline {
    /// Adds a message at a time since the mission's start, made for its time in ns since 1970-01-01 UTC.
    fn add(
        &mut self,
        topic: &Topic,
        time_s: f64,
        data: impl FnOnce(u64) -> Result<Vec<u8>, McapError>,
    ) -> Result<(), McapError> {
        // A negative or NaN time becomes the epoch.
        let log_time = self.epoch_ns.saturating_add((time_s * 1e9).round() as u64);
        let topic = self.topics.iter().position(|t| t.name == topic.name);
        let topic = topic.ok_or_else(|| McapError::unfit("a topic is not listed"))?;
        self.pending.push(Pending { topic, log_time, data: data(log_time)? });
        Ok(())
    }
}

/// Writes a mission to a file.
///
/// # Errors
/// See [`McapError`].
pub fn write_mission<'a>(target: impl Into<Target<'a>>, mission: &MissionMcap<'_>) -> Result<McapSummary, McapError> {
    let target = target.into();
    let (bytes, summary) = encode_mission(mission)?;
    atomic::write(target, &bytes).map_err(|source| McapError::Io { path: target.path.to_owned(), source })?;
    Ok(summary)
}

/// The MCAP files of a ROS 2 bag, in the order in which they were recorded.
///
/// # Errors
/// [`McapError::Unusable`] for a folder that is no bag, or a bag of other files; [`McapError::Io`].
pub fn bag_files(folder: &Path) -> Result<Vec<PathBuf>, McapError> {
    let unusable = |reason: String| McapError::Unusable { path: folder.to_owned(), reason };
    let path = folder.join(BAG);
    let text = std::fs::read_to_string(&path).map_err(|source| match source.kind() {
        io::ErrorKind::NotFound => unusable(format!("the folder is no bag, it has no {BAG}; name an .mcap file")),
        _ => McapError::Io { path, source },
    })?;
    let names = ros2::bag_names(&text);
    match names.iter().find(|name| !name.ends_with(".mcap")) {
        Some(other) => Err(unusable(format!(
            "the bag holds {other}; `ros2 bag convert` makes MCAP without file compression of it"
        ))),
        None if names.is_empty() => Err(unusable(format!("its {BAG} names no files; name an .mcap file"))),
        None => Ok(names.iter().map(|name| folder.join(name)).collect()),
    }
}

/// What a ROS 2 bag is, for people: its files in order, each as [`describe_file`] does.
///
/// # Errors
/// As [`bag_files`] and [`describe_file`].
pub fn describe_bag(folder: &Path) -> Result<serde_json::Value, McapError> {
    let mut described = serde_json::Map::from_iter([("what".to_owned(), "ROS 2 bag".into())]);
    for file in bag_files(folder)? {
        let name = file.file_name().unwrap_or_default().to_string_lossy().into_owned();
        described.insert(name, describe_file(&file)?);
    }
    Ok(described.into())
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

/// The text of `metadata.yaml`, which makes a bag of the folder that holds a ROS 2 recording.
pub fn bag_metadata(file: &str, summary: &McapSummary) -> String {
    ros2::bag_metadata(file, summary)
}

/// A mission as the bytes of an MCAP file.
///
/// # Errors
/// As [`write_mission`], without the file system.
pub fn encode_mission(mission: &MissionMcap) -> Result<(Vec<u8>, McapSummary), McapError> {
    check(mission)?;
    let flavour = Flavour::of(mission.flavour);
    let mut timeline = Timeline { topics: flavour.topics, epoch_ns: mission.epoch_ns, pending: vec![] };
    (flavour.messages)(mission, &mut timeline)?;
    let mut messages = timeline.pending;
    messages.sort_by_key(|m| (m.log_time, m.topic));
    let options = WriteOptions::new()
        .profile(flavour.profile)
        .library(PROGRAM)
        .compression(Some(Compression::Zstd))
        .compression_level(ZSTD_LEVEL)
        .compression_threads(0)
        .chunk_size(Some(CHUNK_BYTES));
    let mut writer = options.create(Cursor::new(Vec::new()))?;
    let channels = flavour.topics.iter().map(|topic| add_channel(&mut writer, flavour, topic));
    let channels = channels.collect::<Result<Vec<_>, _>>()?;
    let mut content = ContentHash::new("messages");
    // Counted by topic: the messages of one instant then differ in little but their data.
    let mut counts = vec![0; flavour.topics.len()];
    for Pending { topic, log_time, data } in &messages {
        let (channel_id, sequence) = (channels[*topic], counts[*topic] as u32);
        let header = MessageHeader { channel_id, sequence, log_time: *log_time, publish_time: *log_time };
        counts[*topic] += 1;
        writer.write_to_known_channel(&header, data)?;
        content.text(flavour.topics[*topic].name);
        content.u64(*log_time);
        content.bytes(data);
    }
    for (name, metadata) in mission.metadata {
        writer.write_metadata(&Metadata { name: name.clone(), metadata: metadata.clone() })?;
    }
    writer.finish()?;
    let summary = McapSummary {
        messages: messages.len() as u64,
        counts,
        start_ns: messages.first().map_or(0, |m| m.log_time),
        end_ns: messages.last().map_or(0, |m| m.log_time),
        data_bytes: messages.iter().map(|m| m.data.len() as u64).sum(),
        content_sha256: content.finish(),
    };
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

fn add_channel(writer: &mut Writer<Cursor<Vec<u8>>>, flavour: &Flavour, topic: &Topic) -> Result<u16, McapError> {
    let schema = writer.add_schema(topic.schema, flavour.schema_encoding, &(flavour.schema)(topic)?)?;
    Ok(writer.add_channel(schema, topic.name, flavour.message_encoding, &(flavour.channel_metadata)(topic))?)
}
