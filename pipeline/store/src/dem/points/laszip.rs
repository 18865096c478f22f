//! Sequential decoding of the points in LASzip files.
//!
//! The decoder is `laz` 0.13 (Apache-2.0, pure Rust, maintained). For formats 6 to 10 it decodes only the layers used here, which
//! excludes the times; for formats 0 to 5 it decodes all fields except the times, which `gps` decodes.

use super::gps::GpsTimes;
use super::header::{Chunks, Compression};
use laz::laszip::ChunkTable;
use laz::record::{RecordDecompressor, SequentialPointRecordDecompressor};
use laz::{DecompressionSelection, LasZipDecompressor, LasZipError, LazItem, LazItemType};
use std::fs::File;
use std::io::{self, BufReader, Read, Seek, Take};

type Source = BufReader<File>;

/// Decoder of points.
pub(super) enum Points {
    /// Formats 0 to 5.
    Sequential(Box<Sequential>),
    /// Formats 6 to 10.
    Layered(Box<LasZipDecompressor<'static, Source>>),
}

/// Points stored one after the other; the decoder resets at each chunk.
pub(super) struct Sequential {
    record: SequentialPointRecordDecompressor<'static, Take<Source>>,
    items: Vec<LazItem>,
    /// Numbers of points in the remaining chunks.
    sizes: Box<dyn Iterator<Item = u64>>,
    left_in_chunk: u64,
}

impl Points {
    /// Decoder for a source positioned at the first byte of the point data.
    pub fn new(mut source: Source, compression: &Compression) -> Result<Self, LasZipError> {
        let description = &compression.description;
        let sizes: Box<dyn Iterator<Item = u64>> = match compression.chunks {
            Chunks::Layered => {
                let wanted = DecompressionSelection::base().decompress_z();
                let wanted = wanted.decompress_classification().decompress_flags();
                let points = LasZipDecompressor::selective(source, description.clone(), wanted)?;
                return Ok(Self::Layered(Box::new(points)));
            }
            Chunks::One => Box::new(std::iter::once(u64::MAX)),
            Chunks::Many => {
                let table = ChunkTable::read_from(&mut source, description)?;
                let sizes: Vec<u64> = table.into_iter().map(|chunk| chunk.point_count).collect();
                Box::new(sizes.into_iter())
            }
        };
        let left = compression.end.saturating_sub(source.stream_position()?);
        let record = SequentialPointRecordDecompressor::new(source.take(left));
        let items = description.items().clone();
        Ok(Self::Sequential(Box::new(Sequential { record, items, sizes, left_in_chunk: 0 })))
    }

    /// Decodes points until `records` is full.
    pub fn read(&mut self, records: &mut [u8], point_bytes: usize) -> Result<(), LasZipError> {
        match self {
            Self::Sequential(points) => {
                records.chunks_exact_mut(point_bytes).try_for_each(|record| points.next(record))
            }
            Self::Layered(points) => Ok(points.decompress_many(records)?),
        }
    }
}

impl Sequential {
    fn next(&mut self, record: &mut [u8]) -> Result<(), LasZipError> {
        if self.left_in_chunk == 0 {
            let size = self.sizes.next().filter(|size| *size > 0);
            self.left_in_chunk = size.ok_or_else(|| io::Error::from(io::ErrorKind::UnexpectedEof))?;
            self.record.reset();
            self.add_fields()?;
        }
        self.left_in_chunk -= 1;
        Ok(self.record.decompress_next(record)?)
    }

    fn add_fields(&mut self) -> Result<(), LasZipError> {
        for item in &self.items {
            match (item.item_type(), item.version()) {
                (LazItemType::GpsTime, 2) => self.record.add_field_decompressor(GpsTimes::default()),
                _ => self.record.set_fields_from(&vec![*item])?,
            }
        }
        Ok(())
    }
}
