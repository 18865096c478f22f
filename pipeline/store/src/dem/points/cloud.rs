//! A LAS or LAZ file as a stream of points.
//!
//! Points of LAS have a fixed length and are read directly; those of LAZ are decoded in `laszip`. Both run only after
//! [`DeclaredSize`] has validated the numbers of the header, and a panic of the decoder is turned into an error.

use super::crs;
use super::header::{Compression, DeclaredSize, unreadable};
use super::laszip;
use crate::dem::crs::Crs;
use crate::dem::raster::Refusal;
use crate::guard::unless_panicking;
use laz::LasZipError;
use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

/// Decoded points held at a time, bytes (one point at least).
const CHUNK_BYTES: u64 = 1 << 22;

/// Classes of noise (LAS 1.4, tables 9 and 17).
const NOISE: [u8; 2] = [7, 18];
const GROUND: u8 = 2;

/// A point cloud file with a checked header.
#[derive(Debug)]
pub(super) struct Cloud {
    path: PathBuf,
    /// Contents of the header.
    pub declared: DeclaredSize,
    /// Coordinate reference system.
    pub crs: Crs,
    /// How LAZ stores its points.
    compression: Option<Compression>,
}

/// A stored point.
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

    /// True for points that the producer withheld or marked as noise.
    pub fn is_noise(&self) -> bool {
        self.withheld || NOISE.contains(&self.class)
    }

    /// True for points on the ground.
    pub fn is_ground(&self) -> bool {
        self.class == GROUND
    }
}

impl Cloud {
    /// Opens a file and checks its header.
    pub fn open(path: &Path, file: File) -> Result<Self, Refusal> {
        let mut file = BufReader::new(file);
        let declared = DeclaredSize::read(&mut file)?;
        let records = declared.records(&mut file)?;
        let crs = crs::of_records(&records, declared.well_known_text)?;
        let compression = declared.compressed.then(|| declared.compression(&mut file, &records)).transpose()?;
        Ok(Self { path: path.to_owned(), declared, crs, compression })
    }

    /// The coordinate of a stored number.
    pub fn coordinate(&self, axis: usize, stored: f64) -> f64 {
        stored * self.declared.scale[axis] + self.declared.offset[axis]
    }

    /// Easting and northing of a point.
    pub fn place(&self, point: &Point) -> [f64; 2] {
        [0, 1].map(|axis| self.coordinate(axis, f64::from(point.stored[axis])))
    }

    /// Calls `f` with every point, in the order of the file.
    pub fn for_each(&self, mut f: impl FnMut(Point)) -> Result<(), Refusal> {
        let declared = &self.declared;
        let mut source = BufReader::new(crate::file::open(&self.path).map_err(|e| unreadable(&e))?);
        if DeclaredSize::read(&mut source)? != *declared {
            return Err(Refusal::new("changed while it was being read"));
        }
        source.seek(SeekFrom::Start(declared.data_start)).map_err(|e| unreadable(&e))?;
        let mut points = match &self.compression {
            None => Points::Plain(source),
            Some(compression) => Points::Packed(guarded(|| laszip::Points::new(source, compression))?),
        };
        let size = usize::from(declared.point_bytes);
        let at_a_time = (CHUNK_BYTES / size as u64).max(1);
        let (mut records, mut left) = (Vec::new(), declared.points);
        while left > 0 {
            let count = at_a_time.min(left);
            records.resize(count as usize * size, 0);
            points.read(&mut records, size)?;
            left -= count;
            records.chunks_exact(size).for_each(|record| f(Point::of_record(record, declared.format >= 6)));
        }
        Ok(())
    }
}

/// Source of points.
enum Points {
    Plain(BufReader<File>),
    Packed(laszip::Points),
}

impl Points {
    fn read(&mut self, records: &mut [u8], point_bytes: usize) -> Result<(), Refusal> {
        match self {
            Self::Plain(source) => source.read_exact(records).map_err(|e| unreadable(&e)),
            Self::Packed(points) => guarded(|| points.read(records, point_bytes)),
        }
    }
}

/// Runs the decoder, which panics on some damaged files, and turns a panic into an error.
fn guarded<T>(decode: impl FnOnce() -> Result<T, LasZipError>) -> Result<T, Refusal> {
    match unless_panicking(decode) {
        Some(Ok(decoded)) => Ok(decoded),
        Some(Err(LasZipError::IoError(error))) => Err(unreadable(&error)),
        Some(Err(error)) => Err(Refusal::new(format!("is damaged or truncated: {error}"))),
        None => Err(Refusal::new("is damaged: its points cannot be decoded")),
    }
}
