//! SHA-256 of files and of decoded content.
//!
//! A content hash covers what a reader decodes (heights, rows, messages), not the compressed bytes, so that a new
//! compressor does not look like new data. Every part is preceded by its length or has a fixed one.

use sastrugi_numeric::Grid;
use sha2::{Digest, Sha256};
use std::io::{self, Read, Write};
use std::path::Path;

const BUFFER: usize = 1 << 18;
/// Bytes of content that are collected before they are hashed. Most parts have one to eight, and hashing each by itself takes longer than
/// its share of a block.
const WAITING: usize = 1 << 12;

/// Incremental hash of decoded content.
#[derive(Clone)]
pub struct ContentHash {
    hash: Sha256,
    /// Parts that are not hashed yet.
    waiting: Vec<u8>,
}

impl ContentHash {
    /// A hash for one kind of content, such as `heights` or `table missions`.
    pub fn new(kind: &str) -> Self {
        let mut hash = Self { hash: Sha256::new(), waiting: Vec::with_capacity(WAITING) };
        hash.text(kind);
        hash
    }

    /// Adds bytes, preceded by their length.
    pub fn bytes(&mut self, bytes: &[u8]) {
        self.u64(bytes.len() as u64);
        self.raw(bytes);
    }

    /// Adds text, preceded by its length.
    pub fn text(&mut self, text: &str) {
        self.bytes(text.as_bytes());
    }

    /// Adds a fixed number of bytes.
    pub fn raw(&mut self, bytes: &[u8]) {
        if self.waiting.len() + bytes.len() > WAITING {
            self.hash.update(&self.waiting);
            self.waiting.clear();
        }
        if bytes.len() > WAITING {
            self.hash.update(bytes);
        } else {
            self.waiting.extend_from_slice(bytes);
        }
    }

    /// Adds a number, little-endian.
    pub fn u64(&mut self, value: u64) {
        self.raw(&value.to_le_bytes());
    }

    /// Adds the bits of a float, little-endian.
    pub fn f64(&mut self, value: f64) {
        self.u64(value.to_bits());
    }

    /// The hash in hexadecimal.
    pub fn finish(mut self) -> String {
        self.hash.update(&self.waiting);
        hex(&self.hash.finalize())
    }
}

/// A reader or writer that counts and hashes the bytes that pass through it.
#[derive(Debug)]
pub struct Hashed<T> {
    inner: T,
    hash: Sha256,
    bytes: u64,
}

impl<T> Hashed<T> {
    /// Wraps a reader or writer.
    pub fn new(inner: T) -> Self {
        Self { inner, hash: Sha256::new(), bytes: 0 }
    }

    /// The reader or writer, the number of bytes that passed, and their SHA-256 in hexadecimal.
    pub fn finish(self) -> (T, u64, String) {
        (self.inner, self.bytes, hex(&self.hash.finalize()))
    }

    fn passed(&mut self, bytes: &[u8]) {
        self.hash.update(bytes);
        self.bytes += bytes.len() as u64;
    }
}

impl<T: Read> Read for Hashed<T> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.inner.read(buffer)?;
        self.passed(&buffer[..count]);
        Ok(count)
    }
}

impl<T: Write> Write for Hashed<T> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let count = self.inner.write(bytes)?;
        self.passed(&bytes[..count]);
        Ok(count)
    }
    fn flush(&mut self) -> io::Result<()> {
        self.inner.flush()
    }
}

/// Content hash of heights as a release stores them: shape, cell size and single-precision values, with a single NaN for no
/// data. The position is left out, because formats state it in ways that round differently.
pub fn heights(grid: &Grid) -> String {
    let mut hash = ContentHash::new("heights");
    geometry(&mut hash, grid);
    for row in grid.values.chunks(grid.cols().max(1)) {
        let bytes: Vec<u8> = row.iter().flat_map(|&v| canonical_f32(v).to_le_bytes()).collect();
        hash.raw(&bytes);
    }
    hash.finish()
}

/// Content hash of a class map.
pub fn classes(grid: &Grid<u8>) -> String {
    let mut hash = ContentHash::new("classes");
    geometry(&mut hash, grid);
    hash.raw(&grid.values);
    hash.finish()
}

fn geometry<T>(hash: &mut ContentHash, grid: &Grid<T>) {
    let g = &grid.geometry;
    hash.u64(g.rows as u64);
    hash.u64(g.cols as u64);
    g.cell.iter().for_each(|v| hash.f64(*v));
}

fn canonical_f32(value: f64) -> f32 {
    if value.is_nan() { f32::NAN } else { value as f32 }
}

/// SHA-256 of bytes, in hexadecimal.
///
/// # Examples
/// The first example of FIPS 180-2:
/// ```
/// let sha256 = sastrugi_store::digest::of_bytes(b"abc");
/// assert_eq!(sha256, "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
/// ```
pub fn of_bytes(bytes: &[u8]) -> String {
    hex(&Sha256::digest(bytes))
}

/// SHA-256 of text, in hexadecimal.
pub fn of_text(text: &str) -> String {
    of_bytes(text.as_bytes())
}

/// Size and SHA-256 of a file.
///
/// # Errors
/// The file cannot be read.
pub fn of_file(path: &Path) -> io::Result<(u64, String)> {
    copy(&mut crate::file::open(path)?, &mut io::sink())
}

/// Copies a stream and returns its length and SHA-256.
///
/// # Errors
/// Reading or writing failed.
pub fn copy(from: &mut impl Read, to: &mut impl Write) -> io::Result<(u64, String)> {
    let mut hash = Sha256::new();
    let mut buffer = vec![0; BUFFER];
    let mut total = 0;
    loop {
        match from.read(&mut buffer) {
            Ok(0) => return Ok((total, hex(&hash.finalize()))),
            Ok(n) => {
                hash.update(&buffer[..n]);
                to.write_all(&buffer[..n])?;
                total += n as u64;
            }
            Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
            Err(e) => return Err(e),
        }
    }
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|b| format!("{b:02x}")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Parts of 0 to three buffers, small and large ones mixed, have the hash of all their bytes in one piece.
    #[test]
    fn prop_parts_have_the_hash_of_the_whole() {
        let lengths =
            [0, 1, 8, 1, 4000, 90, 5, WAITING, 1, WAITING + 1, 3, 2 * WAITING, WAITING - 1, 1, 7, 3 * WAITING];
        let part = |k: usize| -> Vec<u8> { (0..lengths[k]).map(|i| (i * 31 + k) as u8).collect() };
        for count in 0..=lengths.len() {
            let mut hash = ContentHash::new("parts");
            let mut whole: Vec<u8> = 5u64.to_le_bytes().into();
            whole.extend(b"parts");
            for k in 0..count {
                hash.raw(&part(k));
                whole.extend(part(k));
            }
            hash.bytes(b"end");
            whole.extend(3u64.to_le_bytes());
            whole.extend(b"end");
            assert_eq!(hash.finish(), of_bytes(&whole), "{count}");
        }
    }
}
