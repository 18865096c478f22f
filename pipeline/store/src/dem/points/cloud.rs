//! A LAS or LAZ file as a stream of points.
//!
//! The decoder is `las` 0.11 (MIT) with `laz` 0.13 (Apache-2.0), pure Rust and maintained. It sees a file only after
//! [`DeclaredSize`] found its numbers possible, reads no further than the points reach, and a panic of it is an error.

use super::crs;
use super::header::{DeclaredSize, unreadable};
use crate::dem::crs::Crs;
use crate::dem::raster::Refusal;
use las::{PointDataBuilder, Reader};
use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// Decoded points held at a time, bytes (one point at least).
const CHUNK_BYTES: u64 = 1 << 22;

/// Classes of noise (LAS 1.4, tables 9 and 17).
const NOISE: [u8; 2] = [7, 18];
const GROUND: u8 = 2;

/// A file whose header was checked.
#[derive(Debug)]
pub(super) struct Cloud {
    path: PathBuf,
    /// What the header says.
    pub declared: DeclaredSize,
    /// Coordinate reference system.
    pub crs: Crs,
    /// Where the decoder must stop.
    end: u64,
}

/// A point as it is stored.
#[derive(Clone, Copy, Debug)]
pub(super) struct Point {
    /// Coordinates before scale and offset.
    pub stored: [i32; 3],
    class: u8,
    withheld: bool,
}

impl Point {
    fn of_record(record: &[u8], extended: bool) -> Self {
        let stored = |at: usize| i32::from_le_bytes([record[at], record[at + 1], record[at + 2], record[at + 3]]);
        let stored = [stored(0), stored(4), stored(8)];
        // Formats 0 to 5: five bits of class and three flags in one byte (LAS 1.4, table 8). Later: a byte each.
        let flags = record[15];
        if extended {
            Self { stored, class: record[16], withheld: flags & 0b100 != 0 }
        } else {
            Self { stored, class: flags & 0b1_1111, withheld: flags & 0b1000_0000 != 0 }
        }
    }

    /// True for points that their producer withdrew or marked as noise.
    pub fn is_noise(&self) -> bool {
        self.withheld || NOISE.contains(&self.class)
    }

    /// True for points on the ground.
    pub fn is_ground(&self) -> bool {
        self.class == GROUND
    }
}

impl Cloud {
    /// Opens a file and checks what its header says.
    pub fn open(path: &Path, file: File) -> Result<Self, Refusal> {
        let mut file = BufReader::new(file);
        let declared = DeclaredSize::read(&mut file)?;
        file.seek(SeekFrom::Start(0)).map_err(|e| unreadable(&e))?;
        let header = guarded(|| las::Header::new(&mut file))?;
        let crs = crs::of_header(&header, declared.well_known_text)?;
        let end = if declared.compressed {
            let record = header.vlrs().iter().find(|vlr| las::laz::is_laszip_vlr(vlr)).map(|vlr| vlr.data.as_slice());
            declared.check_compression(&mut file, record)?
        } else {
            u64::MAX
        };
        Ok(Self { path: path.to_owned(), declared, crs, end })
    }

    /// The coordinate that a stored number stands for.
    pub fn coordinate(&self, axis: usize, stored: f64) -> f64 {
        stored * self.declared.scale[axis] + self.declared.offset[axis]
    }

    /// Easting and northing of a point.
    pub fn place(&self, point: &Point) -> [f64; 2] {
        [0, 1].map(|axis| self.coordinate(axis, f64::from(point.stored[axis])))
    }

    /// Calls `f` with every point, in the order of the file.
    pub fn for_each(&self, mut f: impl FnMut(Point)) -> Result<(), Refusal> {
        let file = File::open(&self.path).map_err(|e| unreadable(&e))?;
        let end = Arc::new(AtomicU64::new(u64::MAX));
        let fenced = Fenced { file: BufReader::new(file), at: 0, end: end.clone() };
        let mut reader = guarded(|| Reader::new(fenced))?;
        end.store(self.end, Ordering::Relaxed);
        let mut points = PointDataBuilder::new().for_header(reader.header()).build();
        let (size, declared) = (points.record_len(), &self.declared);
        if size != usize::from(declared.point_bytes) || reader.header().number_of_points() != declared.points {
            return Err(Refusal::new("changed while it was read"));
        }
        let at_a_time = (CHUNK_BYTES / size as u64).max(1);
        let extended = declared.format >= 6;
        let mut left = declared.points;
        while left > 0 {
            let read = guarded(|| reader.fill_points(at_a_time.min(left), &mut points))?;
            if read == 0 {
                return Err(Refusal::new(format!("breaks off {left} points before its end")));
            }
            left -= read;
            points.raw_bytes().chunks_exact(size).for_each(|record| f(Point::of_record(record, extended)));
        }
        Ok(())
    }
}

/// Runs the decoder, which panics on some damaged files, and turns a panic into an error.
fn guarded<T>(decode: impl FnOnce() -> las::Result<T>) -> Result<T, Refusal> {
    match catch_unwind(AssertUnwindSafe(decode)) {
        Ok(Ok(decoded)) => Ok(decoded),
        Ok(Err(las::Error::Io(error))) => Err(unreadable(&error)),
        Ok(Err(error)) => Err(Refusal::new(format!("is damaged or breaks off: {error}"))),
        Err(_) => Err(Refusal::new("is damaged: the decoder of its points gave up")),
    }
}

/// A file that ends where its points do, once `end` says where that is.
struct Fenced {
    file: BufReader<File>,
    at: u64,
    end: Arc<AtomicU64>,
}

impl Read for Fenced {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let left = self.end.load(Ordering::Relaxed).saturating_sub(self.at);
        let most = usize::try_from(left).map_or(buffer.len(), |left| left.min(buffer.len()));
        let read = self.file.read(&mut buffer[..most])?;
        self.at += read as u64;
        Ok(read)
    }
}

impl Seek for Fenced {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.at = self.file.seek(to)?;
        Ok(self.at)
    }
}
