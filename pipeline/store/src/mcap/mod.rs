//! MCAP recordings of missions, teams and rovers in two flavours, which are never mixed in a file: for viewers (Foxglove's messages
//! and our own, in protobuf) and for ROS 2 (CDR). The topics are those of `sastrugi_schemas::topics`.
//!
//! Messages are ordered by time; chunks are compressed with Zstandard on one thread and carry checksums; the bytes depend on the
//! recording alone. The map frame is the terrain's own coordinates.

mod frames;
mod lengths;
mod log;
mod mesh;
mod protobuf;
mod ros2;
mod rover;
mod team;
mod viewer;

#[cfg(test)]
mod tests;

pub use frames::{ROCK, SAND};
pub use log::read_log;
pub use rover::{RoverMcap, encode_rover, write_rover};
pub use team::{TeamMcap, encode_team, write_team};

use crate::PROGRAM;
use crate::atomic::{self, Target};
use crate::digest::ContentHash;
use crate::guard::unless_panicking;
use foxglove::messages as fox;
use mcap::records::{MessageHeader, Metadata};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use mcap::sans_io::summary_reader::{SummaryReadEvent, SummaryReader, SummaryReaderOptions};
use mcap::{Compression, WriteOptions, Writer};
use sastrugi_numeric::Grid;
use sastrugi_schemas::study::McapFlavour;
use sastrugi_schemas::topics::{self, Recording, Topic};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, Cursor, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// Layout file with panels for Foxglove and Lichtblick, to import for recordings of the viewer flavour.
pub const VIEWER_LAYOUT: &str = include_str!("viewer-layout.json");

/// File that makes a folder a ROS 2 bag.
pub const BAG: &str = "metadata.yaml";
/// Zstandard level.
const ZSTD_LEVEL: u32 = 1;
/// Uncompressed size of a chunk, bytes.
const CHUNK_BYTES: u64 = 4 << 20;

/// Failure to write or read a recording.
#[derive(Debug, thiserror::Error)]
pub enum McapError {
    /// The recording cannot be expressed in messages.
    #[error("the recording cannot be written: {reason}")]
    Unfit {
        /// What does not fit.
        reason: String,
    },
    /// The file is not a complete MCAP file.
    #[error("{}: {reason}", path.display())]
    Unusable {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// The MCAP writer failed.
    #[error("could not encode the recording: {0}")]
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

/// A terrain for the recordings on it; parts common to all recordings are computed once.
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
    /// [`McapError::Unfit`] for a class map that differs in shape from the terrain.
    pub fn new(dem: &'a Grid, classes: Option<&'a Grid<u8>>) -> Result<Self, McapError> {
        if classes.is_some_and(|c| (c.rows(), c.cols()) != (dem.rows(), dem.cols())) {
            return Err(McapError::unfit("the class map differs in shape from the terrain"));
        }
        let range_m = dem.range().unwrap_or((0.0, 0.0));
        Ok(Self { dem, classes, range_m, grid: OnceLock::new(), grid_map: OnceLock::new() })
    }

    /// South-west corner and lowest height, rounded down to whole metres.
    fn origin_m(&self) -> [f64; 3] {
        let [x, y] = self.dem.geometry.origin;
        [x, y, self.range_m.0].map(f64::floor)
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
    /// Recording.
    pub recording: &'a Recording,
    /// Terrain of the recording.
    pub terrain: &'a TerrainView<'a>,
    /// Start point, m.
    pub start_m: [f64; 2],
    /// Goal point, m.
    pub goal_m: [f64; 2],
    /// Start of the mission's clock, ns since 1970-01-01 UTC.
    pub epoch_ns: u64,
    /// Metadata records by name: `study`, `terrain`, `mission`, `vehicle`, `outcome`, `hashes` (with the terrain's SHA-256
    /// instead of an attachment).
    pub metadata: &'a BTreeMap<String, BTreeMap<String, String>>,
}

/// Summary of a written recording.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct McapSummary {
    /// Number of messages.
    pub messages: u64,
    /// Channels with their numbers of messages.
    pub channels: Vec<ChannelSummary>,
    /// Time of the first message, ns since 1970-01-01 UTC.
    pub start_ns: u64,
    /// Time of the last message, ns since 1970-01-01 UTC.
    pub end_ns: u64,
    /// Bytes of all messages before compression.
    pub data_bytes: u64,
    /// Hash of the decoded stream: topic, time and data of every message in order.
    pub content_sha256: String,
}

/// Summary of a channel.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ChannelSummary {
    /// Name of the topic in the file.
    pub name: String,
    /// The topic.
    pub topic: &'static Topic,
    /// Number of messages.
    pub messages: u64,
}

/// How a flavour encodes messages.
struct Flavour {
    profile: &'static str,
    message_encoding: &'static str,
    schema_encoding: &'static str,
    /// The definition of a topic's messages.
    schema: fn(&Topic) -> Result<Vec<u8>, McapError>,
    channel_metadata: fn(&Topic) -> BTreeMap<String, String>,
}

impl Flavour {
    fn of(flavour: McapFlavour) -> &'static Self {
        match flavour {
            McapFlavour::Viewer => &viewer::FLAVOUR,
            McapFlavour::Ros2 => &ros2::FLAVOUR,
        }
    }
}

/// A topic with its name in the file.
struct Channel {
    name: String,
    topic: &'static Topic,
}

impl Channel {
    fn of(topic: &'static Topic) -> Self {
        Self { name: topic.name.to_owned(), topic }
    }

    /// A topic that every member of a team has.
    fn of_member(topic: &'static Topic, member: &str) -> Self {
        Self { name: topic.of_member(member), topic }
    }
}

/// A message before it is ordered and written.
struct Pending {
    /// Index of its channel in the list.
    channel: usize,
    log_time: u64,
    data: Vec<u8>,
}

/// Messages of a recording, in no particular order.
struct Timeline {
    channels: Vec<Channel>,
    epoch_ns: u64,
    pending: Vec<Pending>,
}

impl Timeline {
    fn new(channels: Vec<Channel>, epoch_ns: u64) -> Self {
        Self { channels, epoch_ns, pending: vec![] }
    }

    /// Adds a message at a time since the start of the recording; `data` receives its time in ns since 1970-01-01 UTC.
    fn add(
        &mut self,
        topic: &Topic,
        time_s: f64,
        data: impl FnOnce(u64) -> Result<Vec<u8>, McapError>,
    ) -> Result<(), McapError> {
        self.add_to(topic.name, time_s, data)
    }

    /// As [`Self::add`], by the name of the channel.
    fn add_to(
        &mut self,
        name: &str,
        time_s: f64,
        data: impl FnOnce(u64) -> Result<Vec<u8>, McapError>,
    ) -> Result<(), McapError> {
        let channel = self.channels.iter().position(|channel| channel.name == name);
        let channel = channel.ok_or_else(|| McapError::unfit("a topic is not in the list of channels"))?;
        let log_time = log_time(self.epoch_ns, time_s);
        self.pending.push(Pending { channel, log_time, data: data(log_time)? });
        Ok(())
    }
}

/// Converts a time since the start of the recording to ns since 1970-01-01 UTC; a negative or NaN time becomes the start.
fn log_time(epoch_ns: u64, time_s: f64) -> u64 {
    epoch_ns.saturating_add((time_s * 1e9).round() as u64)
}

/// Writes a mission to a file.
///
/// # Errors
/// See [`McapError`].
pub fn write_mission<'a>(target: impl Into<Target<'a>>, mission: &MissionMcap<'_>) -> Result<McapSummary, McapError> {
    write(target.into(), encode_mission(mission)?)
}

fn write(target: Target<'_>, (bytes, summary): (Vec<u8>, McapSummary)) -> Result<McapSummary, McapError> {
    atomic::write(target, &bytes).map_err(|source| McapError::Io { path: target.path.to_owned(), source })?;
    Ok(summary)
}

/// The MCAP files of a ROS 2 bag, in recording order.
///
/// # Errors
/// [`McapError::Unusable`] for a folder that is not a bag, or a bag of other files; [`McapError::Io`].
pub fn bag_files(folder: &Path) -> Result<Vec<PathBuf>, McapError> {
    let unusable = |reason: String| McapError::Unusable { path: folder.to_owned(), reason };
    let path = folder.join(BAG);
    let text = crate::file::read_text(&path).map_err(|source| match source.kind() {
        io::ErrorKind::NotFound => unusable(format!("the folder is not a bag: it has no {BAG}; give an .mcap file")),
        _ => McapError::Io { path, source },
    })?;
    let names = ros2::bag_names(&text);
    match names.iter().find(|name| !name.ends_with(".mcap")) {
        Some(other) => Err(unusable(format!(
            "the bag contains {other}; convert it to MCAP without file compression with `ros2 bag convert`"
        ))),
        None if names.is_empty() => Err(unusable(format!("{BAG} lists no files; give an .mcap file"))),
        None => Ok(names.iter().map(|name| folder.join(name)).collect()),
    }
}

/// Human-readable description of a ROS 2 bag: its files in order, each as in [`describe_file`].
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

/// Human-readable description of an MCAP file: its topics with message counts, and its duration.
///
/// # Errors
/// [`McapError::Unusable`] for a file without a readable summary, [`McapError::Io`] for one that cannot be read.
pub fn describe_file(path: &Path) -> Result<serde_json::Value, McapError> {
    let unusable = |reason: String| McapError::Unusable { path: path.to_owned(), reason };
    let incomplete = |reason: String| unusable(format!("not a complete MCAP file: {reason}"));
    let summary = unless_panicking(|| read_summary(path)).unwrap_or_else(|| Ok(Err("malformed record".to_owned())));
    let summary = summary.map_err(|source| McapError::Io { path: path.to_owned(), source })?.map_err(incomplete)?;
    let summary = summary.ok_or_else(|| unusable("the file has no summary: it is incomplete".to_owned()))?;
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

/// The summary at the end of an MCAP file, if it has one, or what is wrong with it; of the rest, nothing is read.
fn read_summary(path: &Path) -> io::Result<Result<Option<mcap::Summary>, String>> {
    let mut file = crate::file::open(path)?;
    let file_bytes = file.metadata()?.len();
    let options = SummaryReaderOptions::default().with_file_size(file_bytes);
    let mut reader = SummaryReader::new_with_options(options);
    while let Some(event) = reader.next_event() {
        match event {
            Ok(SummaryReadEvent::ReadRequest(wanted)) => {
                let read = file.read(reader.insert(wanted))?;
                reader.notify_read(read);
            }
            Ok(SummaryReadEvent::SeekRequest(to)) => {
                let place = file.seek(to)?;
                // The reader parses the records from here on itself.
                if let Err(reason) = check_records(&mut file, file_bytes.saturating_sub(place))? {
                    return Ok(Err(reason));
                }
                file.seek(SeekFrom::Start(place))?;
                reader.notify_seeked(place);
            }
            Err(error) => return Ok(Err(error.to_string())),
        }
    }
    Ok(Ok(reader.finish()))
}

/// Checks the lengths within the records of the `left` bytes to the end of a file, up to the first damage, at which their reader stops too.
fn check_records(file: &mut File, left: u64) -> io::Result<Result<(), String>> {
    let limit = usize::try_from(left).unwrap_or(usize::MAX);
    let options = LinearReaderOptions::default().with_skip_start_magic(true).with_record_length_limit(limit);
    let mut reader = LinearReader::new_with_options(options);
    while let Some(Ok(event)) = reader.next_event() {
        match event {
            LinearReadEvent::ReadRequest(wanted) => {
                let read = file.read(reader.insert(wanted.min(limit)))?;
                reader.notify_read(read);
            }
            LinearReadEvent::Record { opcode, data } => {
                if let Err(reason) = lengths::check(opcode, data) {
                    return Ok(Err(reason));
                }
            }
        }
    }
    Ok(Ok(()))
}

/// The text of `metadata.yaml`, which makes the folder of a ROS 2 recording a bag.
pub fn bag_metadata(file: &str, summary: &McapSummary) -> String {
    ros2::bag_metadata(file, summary)
}

/// A mission as the bytes of an MCAP file.
///
/// # Errors
/// As [`write_mission`], without the file system.
pub fn encode_mission(mission: &MissionMcap) -> Result<(Vec<u8>, McapSummary), McapError> {
    check(mission)?;
    let (listed, messages): (&[&'static Topic], fn(&MissionMcap, &mut Timeline) -> _) = match mission.flavour {
        McapFlavour::Viewer => (&topics::VIEWER, viewer::messages),
        McapFlavour::Ros2 => (&topics::ros2::ROS2, ros2::messages),
    };
    let mut timeline = Timeline::new(listed.iter().map(|topic| Channel::of(topic)).collect(), mission.epoch_ns);
    messages(mission, &mut timeline)?;
    encode(Flavour::of(mission.flavour), timeline, mission.metadata)
}

/// Messages and metadata records as the bytes of an MCAP file.
fn encode(
    flavour: &Flavour,
    timeline: Timeline,
    metadata: &BTreeMap<String, BTreeMap<String, String>>,
) -> Result<(Vec<u8>, McapSummary), McapError> {
    let Timeline { channels, pending: mut messages, .. } = timeline;
    messages.sort_by_key(|m| (m.log_time, m.channel));
    let options = WriteOptions::new()
        .profile(flavour.profile)
        .library(PROGRAM)
        .compression(Some(Compression::Zstd))
        .compression_level(ZSTD_LEVEL)
        .compression_threads(0)
        .chunk_size(Some(CHUNK_BYTES));
    let mut writer = options.create(Cursor::new(Vec::new()))?;
    let ids = channels.iter().map(|channel| add_channel(&mut writer, flavour, channel));
    let ids = ids.collect::<Result<Vec<_>, _>>()?;
    let mut content = ContentHash::new("messages");
    // Counted per channel, so that simultaneous messages differ in little but their data, and compress well.
    let mut counts = vec![0; channels.len()];
    for Pending { channel, log_time, data } in &messages {
        let (channel_id, sequence) = (ids[*channel], counts[*channel] as u32);
        let header = MessageHeader { channel_id, sequence, log_time: *log_time, publish_time: *log_time };
        counts[*channel] += 1;
        writer.write_to_known_channel(&header, data)?;
        content.text(&channels[*channel].name);
        content.u64(*log_time);
        content.bytes(data);
    }
    for (name, metadata) in metadata {
        writer.write_metadata(&Metadata { name: name.clone(), metadata: metadata.clone() })?;
    }
    writer.finish()?;
    let counted = channels.into_iter().zip(counts);
    let counted = counted.map(|(Channel { name, topic }, messages)| ChannelSummary { name, topic, messages });
    let summary = McapSummary {
        messages: messages.len() as u64,
        channels: counted.collect(),
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
        return Err(McapError::unfit("it has no states"));
    }
    let wheels = recording.vehicle.wheels.len();
    if let Some(sample) = recording.wheels.iter().find(|sample| sample.wheels.len() != wheels) {
        let (found, time_s) = (sample.wheels.len(), sample.time_s);
        return Err(McapError::unfit(format!(
            "the vehicle has {wheels} wheels, but the sample at {time_s} s has {found}"
        )));
    }
    Ok(())
}

fn add_channel(writer: &mut Writer<Cursor<Vec<u8>>>, flavour: &Flavour, channel: &Channel) -> Result<u16, McapError> {
    let topic = channel.topic;
    let schema = writer.add_schema(topic.schema, flavour.schema_encoding, &(flavour.schema)(topic)?)?;
    Ok(writer.add_channel(schema, &channel.name, flavour.message_encoding, &(flavour.channel_metadata)(topic))?)
}
