//! Header of a LAS or LAZ file, checked against the file's length before decoding.
//!
//! ASPRS, "LAS Specification 1.4 - R15" (2019), tables 3 (public header block), 5 and 6 (variable length records) and
//! 7 to 17 (point records); Isenburg, "LASzip: lossless compression of LiDAR data", Photogrammetric Engineering and
//! Remote Sensing 79(2), 2013, and the LASzip sources for the chunk table and the layers of point formats 6 to 10.
//!
//! Decoders allocate memory according to numbers in the file: the length of a record, the number of chunks, the bytes of a layer.
//! Each is checked here against what the file can hold.

use crate::dem::raster::Refusal;
use crate::guard::unless_panicking;
use laz::LazVlr;
use laz::laszip::ChunkTable;
use sastrugi_schemas::counted;
use std::io::{self, Read, Seek, SeekFrom};

/// Longest header of a supported version, bytes.
const HEADER_BYTES: usize = 375;
/// Header lengths by minor version.
const HEADER_SIZES: [u16; 5] = [227, 227, 227, 235, 375];
/// User ids of relevant records, and the longest such record, bytes.
const USERS: [&str; 2] = [PROJECTION, LASZIP];
pub(super) const PROJECTION: &str = "LASF_Projection";
const LASZIP: &str = "laszip encoded";
const LASZIP_ID: u16 = 22204;
const RECORD_BYTES_MAX: u64 = 1 << 20;
const RECORD_HEADER_BYTES: u64 = 54;
const EXTENDED_RECORD_HEADER_BYTES: u64 = 60;
/// Bytes of a point by format (LAS 1.4, tables 7 to 17).
const POINT_BYTES: [u16; 11] = [20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67];
/// Most points per byte of a compressed file: a million equal points take 7 kB.
const MAX_POINTS_PER_BYTE: u64 = 1 << 10;
const COMPRESSED: u8 = 0x80;
/// LASzip compressors: all points in one chunk, in several chunks, and in chunks of layers.
const POINT_WISE: u16 = 1;
const CHUNKED: u16 = 2;
const LAYERED: u16 = 3;

/// First bytes of every LAS and LAZ file.
pub(super) const SIGNATURE: &[u8; 4] = b"LASF";

/// Number, size and scale of the points declared by the header, checked against the length of the file.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct DeclaredSize {
    /// Number of points, at least 1.
    pub points: u64,
    /// Bytes of a decoded point.
    pub point_bytes: u16,
    /// Point format, 0 to 10.
    pub format: u8,
    /// True for LAZ.
    pub compressed: bool,
    /// Factor from stored integers to coordinates, by axis.
    pub scale: [f64; 3],
    /// Coordinates of a stored zero, by axis.
    pub offset: [f64; 3],
    /// Lowest and highest x and y of the points according to the header; see `survey` for the check.
    pub stated_low: [f64; 2],
    pub stated_high: [f64; 2],
    /// True if the reference system is given as well-known text.
    pub well_known_text: bool,
    /// Offset of the points.
    pub data_start: u64,
    /// Offset and number of the records before the points.
    records: (u64, u64),
    /// Offset and number of the records after the points.
    extended_records: (u64, u64),
    /// Length of the file.
    file_bytes: u64,
}

/// A record of a known kind.
#[derive(Debug)]
pub(super) struct Record {
    /// User id, such as `LASF_Projection`.
    pub user: String,
    /// Record id within that user id.
    pub id: u16,
    /// Content.
    pub data: Vec<u8>,
}

/// How a LAZ file stores its points.
#[derive(Debug)]
pub(super) struct Compression {
    /// The LASzip record.
    pub description: LazVlr,
    /// How the points are divided.
    pub chunks: Chunks,
    /// Offset of their end, beyond which the decoder must not read.
    pub end: u64,
}

/// How compressed points are divided.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Chunks {
    /// Formats 0 to 5, in a single chunk.
    One,
    /// Formats 0 to 5, in several chunks.
    Many,
    /// Formats 6 to 10: chunks of layers.
    Layered,
}

/// Little-endian numbers at the offsets of the specification.
struct Header([u8; HEADER_BYTES]);

impl Header {
    fn bytes<const N: usize>(&self, at: usize) -> [u8; N] {
        let mut array = [0; N];
        array.copy_from_slice(&self.0[at..at + N]);
        array
    }

    fn minor_version(&self) -> u8 {
        self.0[25]
    }

    fn u16(&self, at: usize) -> u16 {
        u16::from_le_bytes(self.bytes(at))
    }

    fn u32(&self, at: usize) -> u32 {
        u32::from_le_bytes(self.bytes(at))
    }

    fn u64(&self, at: usize) -> u64 {
        u64::from_le_bytes(self.bytes(at))
    }

    fn f64(&self, at: usize) -> f64 {
        f64::from_le_bytes(self.bytes(at))
    }
}

/// Error for a failed read from an open file.
pub(super) fn unreadable(error: &io::Error) -> Refusal {
    match error.kind() {
        io::ErrorKind::UnexpectedEof => Refusal::new("the point cloud is truncated"),
        io::ErrorKind::InvalidData => Refusal::new(format!("is damaged: {error}")),
        _ => Refusal::new(format!("cannot be read: {error}")),
    }
}

impl DeclaredSize {
    /// Reads the header of a file and checks it.
    pub fn read(file: &mut (impl Read + Seek)) -> Result<Self, Refusal> {
        let file_bytes = file.seek(SeekFrom::End(0)).map_err(|e| unreadable(&e))?;
        file.seek(SeekFrom::Start(0)).map_err(|e| unreadable(&e))?;
        let mut bytes = Vec::with_capacity(HEADER_BYTES);
        file.by_ref().take(HEADER_BYTES as u64).read_to_end(&mut bytes).map_err(|e| unreadable(&e))?;
        if !bytes.starts_with(SIGNATURE) {
            return Err(Refusal::new("not a LAS or LAZ file: it does not start with \"LASF\""));
        }
        let mut header = Header([0; HEADER_BYTES]);
        header.0[..bytes.len()].copy_from_slice(&bytes);
        Self::check(&header, file_bytes)
    }

    fn check(header: &Header, file_bytes: u64) -> Result<Self, Refusal> {
        let (major, minor) = (header.0[24], header.minor_version());
        let least = HEADER_SIZES.get(usize::from(minor)).copied().filter(|_| major == 1);
        let least =
            least.ok_or_else(|| Refusal::new(format!("is LAS {major}.{minor}; versions 1.0 to 1.4 are supported")))?;
        let header_size = header.u16(94);
        if header_size < least || u64::from(header_size) > file_bytes {
            return Err(Refusal::new(format!(
                "its LAS header claims {header_size} bytes in a file of {file_bytes} bytes"
            )));
        }
        let data_start = u64::from(header.u32(96));
        let records = u64::from(header.u32(100));
        let room = data_start.checked_sub(u64::from(header_size)).filter(|_| data_start <= file_bytes);
        if room.is_none_or(|room| records * RECORD_HEADER_BYTES > room) {
            return Err(Refusal::new(format!(
                "claims {} before its points at byte {data_start} in a file of {file_bytes} bytes",
                counted(records, "record")
            )));
        }
        let (format, compressed) = point_format(header.0[104])?;
        let declared = Self {
            points: points(header, minor),
            point_bytes: header.u16(105),
            format,
            compressed,
            scale: [header.f64(131), header.f64(139), header.f64(147)],
            offset: [header.f64(155), header.f64(163), header.f64(171)],
            stated_low: [header.f64(187), header.f64(203)],
            stated_high: [header.f64(179), header.f64(195)],
            well_known_text: minor == 4 && header.u16(6) & 16 != 0,
            data_start,
            records: (u64::from(header_size), records),
            extended_records: if minor == 4 { (header.u64(235), u64::from(header.u32(243))) } else { (0, 0) },
            file_bytes,
        };
        declared.check_points()?;
        declared.check_transform()?;
        Ok(declared)
    }

    fn check_points(&self) -> Result<(), Refusal> {
        let least = POINT_BYTES[usize::from(self.format)];
        if self.point_bytes < least {
            let (format, bytes) = (self.format, counted(self.point_bytes, "byte"));
            return Err(Refusal::new(format!("its points have {bytes}; point format {format} needs at least {least}")));
        }
        if self.points == 0 {
            return Err(Refusal::new("has no points"));
        }
        let room = self.file_bytes - self.data_start;
        let most =
            if self.compressed { room.saturating_mul(MAX_POINTS_PER_BYTE) } else { room / u64::from(self.point_bytes) };
        if self.points > most {
            let (points, room) = (counted(self.points, "point"), counted(room, "byte"));
            return Err(Refusal::new(format!("claims {points} in {room}, which can hold at most {most}")));
        }
        if self.points > u64::from(u32::MAX) {
            return Err(Refusal::new(format!("has {} points; at most {} can be read", self.points, u32::MAX)));
        }
        Ok(())
    }

    fn check_transform(&self) -> Result<(), Refusal> {
        let usable = self.scale.iter().all(|s| s.is_finite() && *s > 0.0) && self.offset.iter().all(|o| o.is_finite());
        if usable {
            return Ok(());
        }
        let (scale, offset) = (self.scale, self.offset);
        Err(Refusal::new(format!(
            "scale {scale:?} and offset {offset:?} of its coordinates must be finite, and the scale above 0"
        )))
    }

    /// Extent east-west and north-south according to the header.
    pub fn stated_extent(&self) -> [f64; 2] {
        [0, 1].map(|axis| self.stated_high[axis] - self.stated_low[axis])
    }

    /// The records needed to interpret coordinates and points.
    pub fn records(&self, file: &mut (impl Read + Seek)) -> Result<Vec<Record>, Refusal> {
        let mut records = Vec::new();
        let (mut at, count) = self.records;
        for _ in 0..count {
            let length = u64::from(u16_at(file, at + 20)?);
            at = self.take_record(file, at, (RECORD_HEADER_BYTES, length), self.data_start, &mut records)?;
        }
        let (mut at, count) = self.extended_records;
        for _ in 0..count {
            let room = self.file_bytes.checked_sub(EXTENDED_RECORD_HEADER_BYTES);
            if room.is_none_or(|room| at > room) {
                return Err(Refusal::new(format!("is truncated before its extended records at byte {at}")));
            }
            let length = u64_at(file, at + 20)?;
            at = self.take_record(file, at, (EXTENDED_RECORD_HEADER_BYTES, length), self.file_bytes, &mut records)?;
        }
        Ok(records)
    }

    /// Reads the record at an offset, if it is relevant, and returns the offset of the next one.
    fn take_record(
        &self,
        file: &mut (impl Read + Seek),
        start: u64,
        (head, length): (u64, u64),
        end: u64,
        records: &mut Vec<Record>,
    ) -> Result<u64, Refusal> {
        let left = end.saturating_sub(start + head);
        if length > left {
            let kind = if head == RECORD_HEADER_BYTES { "a" } else { "an extended" };
            let length = counted(length, "byte");
            return Err(Refusal::new(format!("claims {kind} record of {length}, with only {left} left")));
        }
        let mut user = [0; 16];
        read_at(file, start + 2, &mut user)?;
        let user = String::from_utf8_lossy(&user).trim_end_matches('\0').to_owned();
        if length <= RECORD_BYTES_MAX && USERS.iter().any(|known| user.eq_ignore_ascii_case(known)) {
            let id = u16_at(file, start + 18)?;
            let mut data = vec![0; length as usize];
            read_at(file, start + head, &mut data)?;
            records.push(Record { user, id, data });
        }
        Ok(start + head + length)
    }

    /// How the points of a compressed file are stored, with all values checked that the decoder would trust.
    pub fn compression(&self, file: &mut (impl Read + Seek), records: &[Record]) -> Result<Compression, Refusal> {
        let record = records.iter().find(|record| record.user.eq_ignore_ascii_case(LASZIP) && record.id == LASZIP_ID);
        let record = record.ok_or_else(|| Refusal::new("is compressed but has no LASzip record"))?;
        let layered = self.format >= 6;
        let kind = self.check_items(&record.data, layered)?;
        let description = LazVlr::from_buffer(&record.data)
            .map_err(|error| Refusal::new(format!("its LASzip record cannot be read: {error}")))?;
        if kind == POINT_WISE {
            return Ok(Compression { description, chunks: Chunks::One, end: self.file_bytes });
        }
        if description.chunk_size() == 0 {
            return Err(Refusal::new("its LASzip record describes empty chunks"));
        }
        let end = self.chunk_table(file)?;
        if layered {
            self.check_layers(file, end, &description)?;
        }
        Ok(Compression { description, chunks: if layered { Chunks::Layered } else { Chunks::Many }, end })
    }

    /// Checks that the LASzip record lists the fields of the point format, because the decoder trusts their sizes. Returns the
    /// kind of compressor.
    fn check_items(&self, record: &[u8], layered: bool) -> Result<u16, Refusal> {
        let word = |at: usize| record.get(at..at + 2).map(|b| u16::from_le_bytes([b[0], b[1]]));
        let compressors = if layered { LAYERED..=LAYERED } else { POINT_WISE..=CHUNKED };
        let versions = if layered { 3..=4 } else { 1..=2 };
        let compressor = word(0).filter(|kind| compressors.contains(kind));
        let count = usize::from(word(32).unwrap_or(0));
        let items: Option<Vec<(u16, u16)>> = (0..count).map(|i| Some((word(34 + 6 * i)?, word(36 + 6 * i)?))).collect();
        let known = (0..count).all(|i| word(38 + 6 * i).is_some_and(|version| versions.contains(&version)));
        compressor.filter(|_| known && items.as_ref() == Some(&laszip_items(self.format, self.point_bytes))).ok_or_else(
            || Refusal::new(format!("its LASzip record does not describe points of format {}", self.format)),
        )
    }

    /// Offset of the chunk table.
    fn chunk_table(&self, file: &mut (impl Read + Seek)) -> Result<u64, Refusal> {
        let later = |at: &u64| *at > self.data_start && *at <= i64::MAX as u64;
        // A writer that cannot seek back stores the offset at the end of the file.
        let places = [self.data_start, self.file_bytes - 8];
        let first = u64_at(file, places[0])?;
        let table = if later(&first) { first } else { u64_at(file, places[1])? };
        let table = Some(table).filter(|at| later(at) && *at <= self.file_bytes - 8);
        let table = table.ok_or_else(|| Refusal::new("is truncated: the chunk table is missing"))?;
        // Every chunk starts with an uncompressed point.
        let chunks = u64::from(u32_at(file, table + 4)?);
        if chunks * u64::from(self.point_bytes) > self.file_bytes {
            return Err(Refusal::new(format!("claims {chunks} chunks of points in {} bytes", self.file_bytes)));
        }
        Ok(table)
    }

    /// Walks the chunks of point formats 6 to 10 up to the chunk table: an uncompressed point, the number of points, the bytes
    /// of each layer, the layers. The decoder must find the points that it wants in chunks that were walked.
    fn check_layers(&self, file: &mut (impl Read + Seek), table: u64, description: &LazVlr) -> Result<(), Refusal> {
        let mut sizes = vec![0; 4 * laszip_layers(self.format, self.point_bytes)];
        let mut decoded = self.decoded_points(file, description)?.into_iter();
        let (mut at, mut points) = (self.data_start + 8, 0);
        while at < table {
            let start = at + u64::from(self.point_bytes);
            let in_chunk = u64::from(u32_at(file, start)?);
            file.read_exact(&mut sizes).map_err(|e| unreadable(&e))?;
            let layers: u64 = sizes.as_chunks().0.iter().map(|size| u64::from(u32::from_le_bytes(*size))).sum();
            at = start + 4 + sizes.len() as u64 + layers;
            if at > table {
                let all = counted(self.points, "point");
                return Err(Refusal::new(format!("is damaged after {points} of its {all}")));
            }
            points += in_chunk.min(decoded.next().unwrap_or(0));
        }
        if points < self.points {
            let all = counted(self.points, "point");
            return Err(Refusal::new(format!("claims {all}, but its chunks hold {points}")));
        }
        Ok(())
    }

    /// Numbers of points after which the decoder goes on to the next chunk, whatever the chunks state. The decoder reads the table in the same way;
    /// without a readable one it would go on without these numbers.
    fn decoded_points(&self, file: &mut (impl Read + Seek), description: &LazVlr) -> Result<Vec<u64>, Refusal> {
        file.seek(SeekFrom::Start(self.data_start)).map_err(|e| unreadable(&e))?;
        match unless_panicking(|| ChunkTable::read_from(&mut *file, description)) {
            Some(Ok(table)) => Ok(table.into_iter().map(|chunk| chunk.point_count).collect()),
            _ => Err(Refusal::new("is damaged: its chunk table cannot be read")),
        }
    }
}

fn points(header: &Header, minor: u8) -> u64 {
    // LAS 1.4, "Legacy Number of Point Records": if both are given and differ, the legacy field applies.
    match u64::from(header.u32(107)) {
        0 if minor == 4 => header.u64(247),
        legacy => legacy,
    }
}

fn point_format(byte: u8) -> Result<(u8, bool), Refusal> {
    // LASzip marks a compressed file in the two highest bits.
    let (format, compressed) = (byte & 0x3f, byte & COMPRESSED != 0);
    if format > 10 || (!compressed && byte > 10) {
        return Err(Refusal::new(format!("has point format {byte}; 0 to 10 are supported")));
    }
    Ok((format, compressed))
}

/// LASzip item types and sizes of a point format.
fn laszip_items(format: u8, point_bytes: u16) -> Vec<(u16, u16)> {
    let base: &[(u16, u16)] = match format {
        0 => &[(6, 20)],
        1 => &[(6, 20), (7, 8)],
        2 => &[(6, 20), (8, 6)],
        3 => &[(6, 20), (7, 8), (8, 6)],
        4 => &[(6, 20), (7, 8), (9, 29)],
        5 => &[(6, 20), (7, 8), (8, 6), (9, 29)],
        6 => &[(10, 30)],
        7 => &[(10, 30), (11, 6)],
        8 => &[(10, 30), (12, 8)],
        9 => &[(10, 30), (13, 29)],
        _ => &[(10, 30), (12, 8), (13, 29)],
    };
    let extra = point_bytes - POINT_BYTES[usize::from(format)];
    let kind = if format < 6 { 0 } else { 14 };
    base.iter().copied().chain((extra > 0).then_some((kind, extra))).collect()
}

/// Number of layers in a chunk of point formats 6 to 10: nine for the point, one each for colour, near infrared and wave packet,
/// one for every extra byte.
fn laszip_layers(format: u8, point_bytes: u16) -> usize {
    let extra = usize::from(point_bytes - POINT_BYTES[usize::from(format)]);
    let others = match format {
        7 | 9 => 1,
        8 => 2,
        10 => 3,
        _ => 0,
    };
    9 + others + extra
}

fn u16_at(file: &mut (impl Read + Seek), at: u64) -> Result<u16, Refusal> {
    let mut bytes = [0; 2];
    read_at(file, at, &mut bytes)?;
    Ok(u16::from_le_bytes(bytes))
}

fn u32_at(file: &mut (impl Read + Seek), at: u64) -> Result<u32, Refusal> {
    let mut bytes = [0; 4];
    read_at(file, at, &mut bytes)?;
    Ok(u32::from_le_bytes(bytes))
}

fn u64_at(file: &mut (impl Read + Seek), at: u64) -> Result<u64, Refusal> {
    let mut bytes = [0; 8];
    read_at(file, at, &mut bytes)?;
    Ok(u64::from_le_bytes(bytes))
}

fn read_at(file: &mut (impl Read + Seek), at: u64, bytes: &mut [u8]) -> Result<(), Refusal> {
    file.seek(SeekFrom::Start(at)).and_then(|_| file.read_exact(bytes)).map_err(|e| unreadable(&e))
}
