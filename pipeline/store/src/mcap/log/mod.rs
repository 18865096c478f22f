//! Logs of any origin: reads poses, transforms, inertial measurements and events from an MCAP file.
//!
//! Our own messages and Foxglove's (protobuf) and those of ROS 2 (CDR) are read; see [`decoder`]. The file is streamed, with
//! validation of chunk checksums; memory holds one record and the extracted data. A truncated file is read up to its end.

mod foxglove;
mod ros2;

use super::{McapError, bag_files, lengths};
use crate::guard::unless_panicking;
use mcap::records::Record;
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use sastrugi_schemas::counted;
use sastrugi_schemas::log::{ImuStream, Log, PoseStream, TimedForce, TimedPose, TransformStream};
use std::collections::BTreeMap;
use std::fmt::Display;
use std::io::Read;
use std::path::Path;

/// Longest record of any file, bytes: larger than any message read here, but small enough to be safe.
const RECORD_MAX: u64 = 1 << 30;
/// Longest record of a small file, bytes.
const RECORD_MAX_SMALL: u64 = 1 << 26;
/// Bytes of a record per byte of a larger file: messages do not compress better.
const EXPANSION_MAX: u64 = 1 << 10;
/// Bytes read at once, so that a record only takes memory for bytes that the file actually has.
const READ_BYTES: usize = 1 << 20;

/// Content of one message.
enum Content {
    /// A pose in a frame, of a body (empty if not stated).
    Pose { frame: String, body: String, pose: TimedPose },
    /// Poses of children in parents.
    Transforms(Vec<Transform>),
    /// An inertial measurement in a frame.
    Imu { frame: String, sample: TimedForce },
    /// An event by name.
    Event(i64, String),
}

/// A pose of a child frame in its parent.
struct Transform {
    parent: String,
    child: String,
    pose: TimedPose,
}

/// Decodes a message; `None` for bytes that are not such a message. The given time is that of the log, for messages without a stamp.
type Decoder = fn(&[u8], i64) -> Option<Content>;

/// Decoder for messages of a schema in an encoding; `None` for messages that are not about motion.
fn decoder(schema: &str, encoding: &str) -> Option<Decoder> {
    match encoding {
        "protobuf" => foxglove::decoder(schema),
        "cdr" => ros2::decoder(schema),
        _ => None,
    }
}

/// True for messages that can be read in their usual encoding.
fn is_known(schema: &str) -> bool {
    foxglove::decoder(schema).is_some() || ros2::decoder(schema).is_some()
}

/// Reads a log: a file, or the folder of a ROS 2 bag, whose files are read in sequence.
///
/// # Errors
/// [`McapError::Io`]; [`McapError::Unusable`] for a file that is not MCAP, has wrong checksums, or has a message that does not match
/// its schema, and for a folder that is not a bag of MCAP files. A truncated file is not an error: see [`Log::broken`].
pub fn read_log(path: &Path) -> Result<Log, McapError> {
    if !path.is_dir() {
        let mut gathered = Gathered::default();
        read_file(path, &mut gathered)?;
        return Ok(gathered.log);
    }
    let mut gathered = Gathered::default();
    for file in bag_files(path)? {
        read_file(&file, &mut gathered)?;
        if let Some(broken) = &mut gathered.log.broken {
            // Data after a gap of unknown length does not belong to the drive.
            let name = file.file_name().unwrap_or_default().to_string_lossy();
            *broken = format!("{name}: {broken}");
            break;
        }
        gathered.next_file();
    }
    Ok(gathered.log)
}

fn read_file(path: &Path, gathered: &mut Gathered) -> Result<(), McapError> {
    let unusable = |reason: String| McapError::Unusable { path: path.to_owned(), reason };
    let io = |source| McapError::Io { path: path.to_owned(), source };
    let mut file = crate::file::open(path).map_err(io)?;
    let file_bytes = file.metadata().map_err(io)?.len();
    let record_max = file_bytes.saturating_mul(EXPANSION_MAX).clamp(RECORD_MAX_SMALL, RECORD_MAX);
    let options = LinearReaderOptions::default()
        .with_validate_chunk_crcs(true)
        .with_validate_data_section_crc(true)
        .with_record_length_limit(record_max as usize);
    let mut reader = LinearReader::new_with_options(options);
    while let Some(event) = reader.next_event() {
        match event {
            Ok(LinearReadEvent::ReadRequest(wanted)) => {
                let read = file.read(reader.insert(wanted.min(READ_BYTES))).map_err(io)?;
                reader.notify_read(read);
            }
            Ok(LinearReadEvent::Record { data, opcode }) => {
                let record = parse(opcode, data).map_err(|e| unusable(gathered.damaged(&e)))?;
                gathered.take(&record).map_err(unusable)?;
            }
            Err(mcap::McapError::UnexpectedEof) if gathered.begun => {
                let broken = gathered.broken();
                gathered.log.broken.get_or_insert(broken);
                break;
            }
            Err(mcap::McapError::BadMagic | mcap::McapError::UnexpectedEof) => {
                return Err(unusable("not an MCAP file".to_owned()));
            }
            Err(error) => {
                return Err(unusable(gathered.damaged(&error)));
            }
        }
    }
    Ok(())
}

/// One record.
fn parse(opcode: u8, data: &[u8]) -> Result<Record<'_>, String> {
    lengths::check(opcode, data)?;
    // The parser panics on an attachment that ends within its own header.
    let parsed = unless_panicking(|| mcap::parse_record(opcode, data));
    parsed.ok_or_else(|| "malformed record".to_owned())?.map_err(|e| e.to_string())
}

/// A channel whose messages are read.
struct Known {
    topic: String,
    schema: String,
    decoder: Decoder,
    /// Index of the stream of its poses or measurements.
    place: Option<usize>,
}

#[derive(Default)]
struct Gathered {
    log: Log,
    /// The header has been read.
    begun: bool,
    messages: u64,
    first_ns: Option<u64>,
    last_ns: u64,
    schemas: BTreeMap<u16, String>,
    channels: BTreeMap<u16, Known>,
    /// Streams of the files before, by topic and schema.
    places: Vec<(String, String, usize)>,
    /// Transforms by topic, parent and child.
    links: BTreeMap<(String, String, String), usize>,
}

impl Gathered {
    /// Describes where the file is truncated.
    fn broken(&self) -> String {
        let seconds = self.last_ns.saturating_sub(self.first_ns.unwrap_or(self.last_ns)) as f64 * 1e-9;
        format!("the file is truncated after {}, {seconds:.3} s after the first", counted(self.messages, "message"))
    }

    /// Describes where the file is damaged.
    fn damaged(&self, error: &impl Display) -> String {
        format!("the file is damaged after {}: {error}", counted(self.messages, "message"))
    }

    /// Prepares for the next file of a bag, which renumbers the channels and continues their streams.
    fn next_file(&mut self) {
        self.begun = false;
        self.schemas.clear();
        let channels = std::mem::take(&mut self.channels).into_values();
        self.places.extend(channels.filter_map(|known| Some((known.topic, known.schema, known.place?))));
    }

    /// Index of a stream of the files before; each is continued by one channel.
    fn place_of(&mut self, topic: &str, schema: &str) -> Option<usize> {
        let found = self.places.iter().position(|(t, s, _)| t == topic && s == schema)?;
        Some(self.places.remove(found).2)
    }

    fn take(&mut self, record: &Record<'_>) -> Result<(), String> {
        self.begun = true;
        match record {
            Record::Schema { header, .. } => {
                self.schemas.insert(header.id, header.name.clone());
            }
            Record::Channel(channel) => self.channel(channel),
            Record::Message { header, data } => {
                self.messages += 1;
                self.first_ns.get_or_insert(header.log_time);
                self.last_ns = header.log_time;
                return self.message(header.channel_id, header.log_time, data);
            }
            _ => {}
        }
        Ok(())
    }

    fn channel(&mut self, channel: &mcap::records::Channel) {
        let Some(schema) = self.schemas.get(&channel.schema_id).cloned() else { return };
        if self.channels.contains_key(&channel.id) {
            return;
        }
        let (topic, encoding) = (&channel.topic, &channel.message_encoding);
        if let Some(decoder) = decoder(&schema, encoding) {
            let place = self.place_of(topic, &schema);
            let known = Known { topic: topic.clone(), schema, decoder, place };
            self.channels.insert(channel.id, known);
        } else if is_known(&schema) {
            let unread = format!("{topic} ({schema} in the encoding `{encoding}`)");
            if !self.log.unread.contains(&unread) {
                self.log.unread.push(unread);
            }
        }
    }

    fn message(&mut self, channel: u16, log_time: u64, data: &[u8]) -> Result<(), String> {
        let Some(known) = self.channels.get_mut(&channel) else { return Ok(()) };
        let time_ns = i64::try_from(log_time).unwrap_or(i64::MAX);
        let content = (known.decoder)(data, time_ns).ok_or_else(|| {
            format!("message {} on {} cannot be decoded as {}", self.messages, known.topic, known.schema)
        })?;
        let Log { poses, transforms, imus, events, .. } = &mut self.log;
        match content {
            Content::Pose { frame, body, pose } => {
                let place = *known.place.get_or_insert_with(|| {
                    let (topic, schema) = (known.topic.clone(), known.schema.clone());
                    poses.push(PoseStream { topic, schema, frame, body, poses: Vec::new() });
                    poses.len() - 1
                });
                poses[place].poses.push(pose);
            }
            Content::Imu { frame, sample } => {
                let place = *known.place.get_or_insert_with(|| {
                    let (topic, schema) = (known.topic.clone(), known.schema.clone());
                    imus.push(ImuStream { topic, schema, frame, samples: Vec::new() });
                    imus.len() - 1
                });
                imus[place].samples.push(sample);
            }
            Content::Transforms(all) => {
                for Transform { parent, child, pose } in all {
                    let key = (known.topic.clone(), parent, child);
                    let place = *self.links.entry(key).or_insert_with_key(|(topic, parent, child)| {
                        let [topic, parent, child] = [topic, parent, child].map(Clone::clone);
                        transforms.push(TransformStream { topic, parent, child, poses: Vec::new() });
                        transforms.len() - 1
                    });
                    transforms[place].poses.push(pose);
                }
            }
            Content::Event(time_ns, name) => events.push((time_ns, name)),
        }
        Ok(())
    }
}
