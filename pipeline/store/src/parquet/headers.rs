//! The footer and the page headers of a Parquet file: structures of the Thrift compact protocol, checked before the crate `parquet` reads them.
//!
//! The crate skips an unknown field element by element, up to the number claimed, and elements of a list of booleans take no bytes there. It also
//! accepts known fields of any type. A few damaged bytes can therefore keep it busy for hours. A structure that passes this check has only known
//! fields of the right types, so the crate skips only values that exist. Cost: one pass over the bytes of each structure.

use bytes::Bytes;
use parquet::errors::Result as ParquetResult;
use parquet::file::reader::{ChunkReader, Length};
use std::fs::File;
use std::io::{self, Cursor, ErrorKind, Read, Seek, SeekFrom};

/// What a field holds.
enum Kind {
    Bool,
    Byte,
    I16,
    I32,
    I64,
    /// Bytes of a page, an `I32` from 0 to [`PAGE_MAX`].
    PageSize,
    Binary,
    List(&'static Kind),
    Struct(&'static [(i16, Kind)]),
}

use Kind::{Binary, Bool, Byte, I16, I32, I64, List, PageSize, Struct};

// Fields by number, from the definition of the format (`parquet.thrift` of Apache Parquet), without encryption and geometry.
const UNIT: Kind = Struct(&[(1, EMPTY), (2, EMPTY), (3, EMPTY)]);
const EMPTY: Kind = Struct(&[]);
const TIME: Kind = Struct(&[(1, Bool), (2, UNIT)]);
const LOGICAL_TYPE: Kind = Struct(&[
    (1, EMPTY),
    (2, EMPTY),
    (3, EMPTY),
    (4, EMPTY),
    (5, Struct(&[(1, I32), (2, I32)])),
    (6, EMPTY),
    (7, TIME),
    (8, TIME),
    (10, Struct(&[(1, Byte), (2, Bool)])),
    (11, EMPTY),
    (12, EMPTY),
    (13, EMPTY),
    (14, EMPTY),
    (15, EMPTY),
]);
const SCHEMA_ELEMENT: Kind = Struct(&[
    (1, I32),
    (2, I32),
    (3, I32),
    (4, Binary),
    (5, I32),
    (6, I32),
    (7, I32),
    (8, I32),
    (9, I32),
    (10, LOGICAL_TYPE),
]);
const STATISTICS: Kind =
    Struct(&[(1, Binary), (2, Binary), (3, I64), (4, I64), (5, Binary), (6, Binary), (7, Bool), (8, Bool), (9, I64)]);
const KEY_VALUE: Kind = Struct(&[(1, Binary), (2, Binary)]);
const COLUMN_METADATA: Kind = Struct(&[
    (1, I32),
    (2, List(&I32)),
    (3, List(&Binary)),
    (4, I32),
    (5, I64),
    (6, I64),
    (7, I64),
    (8, List(&KEY_VALUE)),
    (9, I64),
    (10, I64),
    (11, I64),
    (12, STATISTICS),
    (13, List(&Struct(&[(1, I32), (2, I32), (3, I32)]))),
    (14, I64),
    (15, I32),
    (16, Struct(&[(1, I64), (2, List(&I64)), (3, List(&I64))])),
]);
const COLUMN_CHUNK: Kind =
    Struct(&[(1, Binary), (2, I64), (3, COLUMN_METADATA), (4, I64), (5, I32), (6, I64), (7, I32)]);
const ROW_GROUP: Kind = Struct(&[
    (1, List(&COLUMN_CHUNK)),
    (2, I64),
    (3, I64),
    (4, List(&Struct(&[(1, I32), (2, Bool), (3, Bool)]))),
    (5, I64),
    (6, I64),
    (7, I16),
]);
const FILE_METADATA: Kind = Struct(&[
    (1, I32),
    (2, List(&SCHEMA_ELEMENT)),
    (3, I64),
    (4, List(&ROW_GROUP)),
    (5, List(&KEY_VALUE)),
    (6, Binary),
    (7, List(&Struct(&[(1, EMPTY), (2, EMPTY)]))),
]);
const PAGE_HEADER: Kind = Struct(&[
    (1, I32),
    (2, PageSize),
    (3, PageSize),
    (4, I32),
    (5, Struct(&[(1, I32), (2, I32), (3, I32), (4, I32), (5, STATISTICS)])),
    (6, EMPTY),
    (7, Struct(&[(1, I32), (2, I32), (3, Bool)])),
    (8, Struct(&[(1, I32), (2, I32), (3, I32), (4, I32), (5, I32), (6, I32), (7, Bool), (8, STATISTICS)])),
]);

/// Bytes after the footer: its length and the mark of the format.
const TAIL: usize = 8;
/// Largest page, compressed or not, bytes; pages of writers have about 1 MiB. The crate reserves what a header claims.
const PAGE_MAX: u64 = 1 << 28;
/// Bytes in which a page header is looked for: most have less than 100, those with long texts as statistics more.
const HEADER_BYTES: [u64; 2] = [1 << 12, 1 << 22];

/// Whether the footer of a file has known fields alone. A file without a footer passes: it is refused as it is read.
///
/// # Errors
/// I/O errors.
fn is_sound(file: &mut File) -> io::Result<bool> {
    let about = file.metadata()?;
    let Some(start) = about.len().checked_sub(TAIL as u64).filter(|_| about.is_file()) else { return Ok(true) };
    let mut tail = [0; TAIL];
    file.seek(SeekFrom::Start(start))?;
    file.read_exact(&mut tail)?;
    let [a, b, c, d, mark @ ..] = tail;
    let length = u64::from(u32::from_le_bytes([a, b, c, d]));
    if mark != *b"PAR1" || length > start {
        return Ok(true);
    }
    file.seek(SeekFrom::Start(start - length))?;
    let mut footer = Vec::new();
    Read::by_ref(file).take(length).read_to_end(&mut footer)?;
    Ok(Walk(&footer).value(&FILE_METADATA).is_some())
}

/// A Parquet file whose footer was checked, and whose page headers are checked as they are read.
pub(super) struct Checked(File);

impl Checked {
    /// Checks the footer; `None` if it has unknown fields.
    ///
    /// # Errors
    /// I/O errors.
    pub(super) fn of(mut file: File) -> io::Result<Option<Self>> {
        Ok(is_sound(&mut file)?.then_some(Self(file)))
    }
}

impl Length for Checked {
    fn len(&self) -> u64 {
        Length::len(&self.0)
    }
}

impl ChunkReader for Checked {
    type T = Header;

    /// The crate reads the length of the footer and page headers from what this returns, nothing else. Readers are built without a page index, with
    /// which page headers would come from `get_bytes`, unchecked.
    fn get_read(&self, start: u64) -> ParquetResult<Header> {
        let is_tail = start.checked_add(TAIL as u64) == Some(Length::len(self));
        Ok(Header { file: self.0.try_clone()?, start, is_tail, bytes: None })
    }

    fn get_bytes(&self, start: u64, length: usize) -> ParquetResult<Bytes> {
        self.0.get_bytes(start, length)
    }
}

/// The header of a page, or the end of the file. It is checked once it is read: the crate also asks for it where it has read it before.
pub(super) struct Header {
    file: File,
    start: u64,
    is_tail: bool,
    bytes: Option<Cursor<Vec<u8>>>,
}

impl Header {
    fn checked(&mut self) -> io::Result<Vec<u8>> {
        let mut bytes = Vec::new();
        for length in HEADER_BYTES {
            bytes.clear();
            self.file.seek(SeekFrom::Start(self.start))?;
            Read::by_ref(&mut self.file).take(length).read_to_end(&mut bytes)?;
            if self.is_tail || Walk(&bytes).value(&PAGE_HEADER).is_some() {
                return Ok(bytes);
            }
            if (bytes.len() as u64) < length {
                break;
            }
        }
        let message = format!(
            "the file is damaged: no valid page header at byte {}, or one that claims more than {PAGE_MAX} bytes",
            self.start
        );
        Err(io::Error::new(ErrorKind::InvalidData, message))
    }
}

impl Read for Header {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if self.bytes.is_none() {
            self.bytes = Some(Cursor::new(self.checked()?));
        }
        self.bytes.as_mut().map_or(Ok(0), |bytes| bytes.read(buffer))
    }
}

/// The bytes that are left of a structure. `None` stands for bytes that do not hold what is expected.
struct Walk<'a>(&'a [u8]);

impl Walk<'_> {
    fn byte(&mut self) -> Option<u8> {
        let (first, rest) = self.0.split_first()?;
        self.0 = rest;
        Some(*first)
    }

    /// A number of up to 64 bits, seven in each byte.
    fn varint(&mut self) -> Option<u64> {
        let mut number = 0;
        for shift in (0..64).step_by(7) {
            let byte = self.byte()?;
            number |= u64::from(byte & 0x7f) << shift;
            if byte & 0x80 == 0 {
                return Some(number);
            }
        }
        None
    }

    /// A value outside a structure's header.
    fn value(&mut self, kind: &Kind) -> Option<()> {
        match kind {
            // In the type of its field.
            Bool => Some(()),
            Byte => self.byte().map(drop),
            I16 | I32 | I64 => self.varint().map(drop),
            // Signs are folded in: an even number is twice the value.
            PageSize => self.varint().filter(|folded| folded % 2 == 0 && folded / 2 <= PAGE_MAX).map(drop),
            Binary => {
                let length = usize::try_from(self.varint()?).ok()?;
                self.0 = self.0.get(length..)?;
                Some(())
            }
            List(of) => self.list(of),
            Struct(fields) => self.fields(fields),
        }
    }

    fn list(&mut self, of: &Kind) -> Option<()> {
        let header = self.byte()?;
        let size = if header >> 4 == 15 { self.varint()? } else { u64::from(header >> 4) };
        if size > 0 && !of.has_type(header & 15) {
            return None;
        }
        // Each element takes a byte or more, so the loop ends with the bytes.
        (0..size).try_for_each(|_| self.value(of))
    }

    fn fields(&mut self, known: &[(i16, Kind)]) -> Option<()> {
        let mut number = 0;
        loop {
            let header = self.byte()?;
            if header == 0 {
                return Some(());
            }
            number = match header >> 4 {
                0 => {
                    let folded = i64::try_from(self.varint()?).ok()?;
                    i16::try_from((folded >> 1) ^ -(folded & 1)).ok()?
                }
                step => i16::checked_add(number, i16::from(step))?,
            };
            let (_, kind) = known.iter().find(|(known, _)| *known == number)?;
            if !kind.has_type(header & 15) {
                return None;
            }
            self.value(kind)?;
        }
    }
}

impl Kind {
    /// True for the number of the type in the compact protocol.
    fn has_type(&self, number: u8) -> bool {
        match self {
            Bool => matches!(number, 1 | 2),
            Byte => number == 3,
            I16 => number == 4,
            I32 | PageSize => number == 5,
            I64 => number == 6,
            Binary => number == 8,
            List(_) => number == 9,
            Struct(_) => number == 12,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn walked(bytes: &[u8]) -> bool {
        Walk(bytes).value(&FILE_METADATA).is_some()
    }

    /// Bytes by the definition of the compact protocol.
    #[test]
    fn val_known_fields_of_their_types_pass() {
        // Version 1 (field 1, i32), 300 rows (field 3, i64), one pair "k" (field 5, list of structures), writer "w" (field 6).
        let footer = [0x15, 2, 0x26, 0xd8, 4, 0x29, 0x1c, 0x18, 1, b'k', 0, 0x18, 1, b'w', 0];
        assert!(walked(&footer));
        assert!((0..footer.len()).all(|cut| !walked(&footer[..cut])));
        // The same field by its full number, 1 folded to 2.
        assert!(walked(&[0x05, 2, 2, 0]));
        assert!(walked(&[0x29, 0x0c, 0]), "an empty list");
        assert!(!walked(&[0xf5, 2, 0]), "field 15 is unknown");
        assert!(!walked(&[0x19, 0x11, 0]), "field 1 is not a list");
        assert!(!walked(&[0x29, 0xf1, 0xff, 0xff, 0xff, 0xff, 7, 0]), "field 2 is not a list of booleans");
        assert!(!walked(&[0x29, 0xfc, 0xff, 0xff, 0xff, 0xff, 7, 0, 0]), "more structures than bytes");
        assert!(
            !walked(&[0x05, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 1]),
            "no number is so long"
        );
    }

    /// A data page (type 0) of 10 bytes, 8 of them stored, with 3 values, plain (0), levels of the kind 3.
    const PAGE: [u8; 17] = [0x15, 0, 0x15, 20, 0x15, 16, 0x2c, 0x15, 6, 0x15, 0, 0x15, 6, 0x15, 6, 0, 0];

    /// Page headers by the definition of the compact protocol.
    #[test]
    fn val_page_headers_claim_no_more_than_a_page() {
        let is_page = |bytes: &[u8]| Walk(bytes).value(&PAGE_HEADER).is_some();
        assert!(is_page(&PAGE));
        assert!((0..PAGE.len()).all(|cut| !is_page(&PAGE[..cut])));
        let with_size = |size: &[u8]| [&PAGE[..3], size, &PAGE[4..]].concat();
        // 2^28 and one more, folded: 2^29 and 2^29 + 2.
        assert!(is_page(&with_size(&[0x80, 0x80, 0x80, 0x80, 2])));
        assert!(!is_page(&with_size(&[0x82, 0x80, 0x80, 0x80, 2])));
        assert!(!is_page(&with_size(&[1])), "-1 bytes");
        // Field 4, a checksum, as a list of booleans.
        let lists = [&PAGE[..6], &[0x19, 0xf1, 0xff, 0xff, 0xff, 0xff, 7, 0]].concat();
        assert!(!is_page(&lists));
    }

    /// A header is checked when it is read, however long its statistics are; the end of the file passes as it is.
    #[test]
    fn val_headers_are_checked_as_they_are_read() {
        let folder = tempfile::tempdir().unwrap();
        // Statistics (field 5 of the data page) with a smallest value (field 6) of 5000 bytes; then a header with an unknown field 9.
        let long = [&PAGE[..15], &[0x1c, 0x68, 0x88, 0x27], &[b'a'; 5000][..], &[0, 0, 0]].concat();
        let unknown = [0x95, 2, 0];
        let path = folder.path().join("pages");
        std::fs::write(&path, [&long[..], &unknown, &[0; 5]].concat()).unwrap();
        let file = Checked(File::open(&path).unwrap());
        let read = |start: usize| {
            let mut first = [0];
            file.get_read(start as u64).unwrap().read(&mut first).map(|_| first[0])
        };
        assert_eq!(read(0).unwrap(), 0x15);
        assert_eq!(read(long.len()).unwrap(), 0x95, "the last 8 bytes are no page header");
        assert!(
            read(2).unwrap_err().to_string().contains("no valid page header at byte 2, or one that claims more than")
        );
    }
}
