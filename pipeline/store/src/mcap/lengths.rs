//! Lengths stated within the records of an MCAP file, checked before a record is parsed: the parser of the crate `mcap` allocates as many
//! bytes as a text claims to have, and a failed allocation ends the process.
//!
//! MCAP format specification, "Records" and "Serialization": a text is its length in bytes (32 bits, little-endian) and its bytes; a map of
//! texts is its length in bytes, then keys and values in turn. Records without texts, above all messages, cost nothing here.

use mcap::records::op;
use sastrugi_schemas::counted;

/// Part of a record up to its last text.
enum Part {
    /// Numbers of this many bytes.
    Fixed(usize),
    /// A text.
    Text,
    /// A map of texts.
    Texts,
    /// A map of numbers with entries of this many bytes.
    Numbers(usize),
}

/// Parts of a record; none for a record without texts.
const fn parts(opcode: u8) -> &'static [Part] {
    use Part::{Fixed, Numbers, Text, Texts};
    match opcode {
        op::HEADER => &[Text, Text],
        op::SCHEMA => &[Fixed(2), Text, Text],
        op::CHANNEL => &[Fixed(4), Text, Text, Texts],
        op::CHUNK => &[Fixed(28), Text],
        op::CHUNK_INDEX => &[Fixed(32), Numbers(10), Fixed(8), Text],
        op::ATTACHMENT => &[Fixed(16), Text, Text],
        op::ATTACHMENT_INDEX => &[Fixed(40), Text, Text],
        op::METADATA => &[Text, Texts],
        op::METADATA_INDEX => &[Fixed(16), Text],
        _ => &[],
    }
}

/// Refuses a record with a text that would end beyond it. A record that ends before a text begins is left to the parser.
pub(super) fn check(opcode: u8, data: &[u8]) -> Result<(), String> {
    parts(opcode).iter().try_fold(data, after).map(|_| ())
}

/// The data after a part at their start.
fn after<'a>(data: &'a [u8], part: &Part) -> Result<&'a [u8], String> {
    match part {
        Part::Fixed(bytes) => Ok(skip(data, *bytes)),
        Part::Text => after_text(data),
        Part::Texts => after_texts(data),
        Part::Numbers(entry) => Ok(after_numbers(data, *entry)),
    }
}

fn skip(data: &[u8], bytes: usize) -> &[u8] {
    data.get(bytes..).unwrap_or_default()
}

/// The length at the start of the data, and the rest.
fn length(data: &[u8]) -> Option<(usize, &[u8])> {
    let (bytes, rest) = data.split_first_chunk()?;
    Some((u32::from_le_bytes(*bytes) as usize, rest))
}

fn after_text(data: &[u8]) -> Result<&[u8], String> {
    let Some((bytes, rest)) = length(data) else { return Ok(&[]) };
    rest.get(bytes..).ok_or_else(|| beyond("string", bytes, rest))
}

fn after_texts(data: &[u8]) -> Result<&[u8], String> {
    let Some((bytes, mut rest)) = length(data) else { return Ok(&[]) };
    let after = rest.len().checked_sub(bytes).ok_or_else(|| beyond("map", bytes, rest))?;
    // Like the parser, up to the pair that reaches the end of the map or passes it.
    while rest.len() > after {
        rest = after_text(after_text(rest)?)?;
    }
    Ok(rest)
}

/// Like the parser, up to the entry that reaches the end of the map or passes it.
fn after_numbers(data: &[u8], entry: usize) -> &[u8] {
    let Some((bytes, rest)) = length(data) else { return &[] };
    skip(rest, bytes.div_ceil(entry).saturating_mul(entry))
}

fn beyond(what: &str, bytes: usize, rest: &[u8]) -> String {
    let (claimed, left) = (counted(bytes, "byte"), counted(rest.len(), "byte"));
    format!("a record claims a {what} of {claimed}, but has only {left} left")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(content: &str) -> Vec<u8> {
        [&(content.len() as u32).to_le_bytes(), content.as_bytes()].concat()
    }

    fn sized(content: &[u8]) -> Vec<u8> {
        [&(content.len() as u32).to_le_bytes(), content].concat()
    }

    /// A record in pieces, and the pieces that are texts or maps of texts.
    type InPieces = (u8, Vec<Vec<u8>>, &'static [usize]);

    /// Every record with texts (MCAP format specification, "Records").
    fn records() -> [InPieces; 9] {
        let fixed = |bytes: usize| vec![0; bytes];
        let pairs = sized(&[text("key"), text("value")].concat());
        let offsets = sized(&[&[1_u8; 2][..], &[0; 8], &[2; 2], &[0; 8]].concat());
        [
            (op::HEADER, vec![text("ros2"), text("library")], &[0, 1]),
            (op::SCHEMA, vec![fixed(2), text("name"), text("encoding"), text("definition")], &[1, 2]),
            (op::CHANNEL, vec![fixed(4), text("topic"), text("cdr"), pairs.clone()], &[1, 2, 3]),
            (op::CHUNK, vec![fixed(28), text("zstd"), fixed(8)], &[1]),
            (op::CHUNK_INDEX, vec![fixed(32), offsets, fixed(8), text("zstd"), fixed(16)], &[3]),
            (op::ATTACHMENT, vec![fixed(16), text("name"), text("text/plain"), fixed(12)], &[1, 2]),
            (op::ATTACHMENT_INDEX, vec![fixed(40), text("name"), text("text/plain")], &[1, 2]),
            (op::METADATA, vec![text("name"), pairs], &[0, 1]),
            (op::METADATA_INDEX, vec![fixed(16), text("name")], &[1]),
        ]
    }

    /// Whole records are accepted, and parsed; one with a text longer than what is left of it is refused, and none that ends early panics.
    #[test]
    fn val_texts_end_within_their_records() {
        for (opcode, pieces, texts) in records() {
            let whole = pieces.concat();
            assert_eq!(check(opcode, &whole), Ok(()), "{opcode}");
            assert!(mcap::parse_record(opcode, &whole).is_ok(), "{opcode}");
            for cut in 0..whole.len() {
                let _ = check(opcode, &whole[..cut]);
            }
            for &k in texts {
                let mut longer = pieces.clone();
                longer[k][..4].copy_from_slice(&u32::MAX.to_le_bytes());
                let refused = check(opcode, &longer.concat()).unwrap_err();
                let left = pieces[k..].concat().len() - 4;
                let words = format!("of 4294967295 bytes, but has only {} left", counted(left, "byte"));
                assert!(refused.ends_with(&words), "{opcode}: {refused}");
            }
        }
        // A text within a map.
        let map = sized(&[text("key"), u32::MAX.to_le_bytes().to_vec(), b"value".to_vec()].concat());
        let refused = check(op::METADATA, &[text("name"), map].concat()).unwrap_err();
        assert_eq!(refused, "a record claims a string of 4294967295 bytes, but has only 5 bytes left");
    }

    /// A map of numbers that ends within an entry is read by the parser up to the end of that entry, where the next text begins.
    #[test]
    fn val_maps_of_numbers_end_with_an_entry() {
        let index =
            |bytes: u32| [&[7_u8; 32][..], &bytes.to_le_bytes(), &[7; 20 + 8], &u32::MAX.to_le_bytes()].concat();
        assert!((11..=20).all(|bytes| check(op::CHUNK_INDEX, &index(bytes)).is_err()));
        assert_eq!(check(op::CHUNK_INDEX, &index(u32::MAX)), Ok(()));
        assert!(mcap::parse_record(op::CHUNK_INDEX, &index(u32::MAX)).is_err());
    }
}
