//! Binary format of a tile record: magic, key, shape, fields, and a checksum over all of these. Little-endian.

use crate::samples::Samples;

/// First bytes of a record; the number in it changes with the format.
const MAGIC: &[u8; 16] = b"sastrugi tile 1\n";
/// Length of the checksum.
const CHECKSUM: usize = 32;
/// Largest number of samples along a side.
const SIDE_MAX: usize = 1 << 14;

/// Encodes a tile.
pub fn encode(key: &str, tile: &Samples) -> Vec<u8> {
    let fields = tile.fields();
    let mut bytes = Vec::with_capacity(64 + key.len() + 4 * 4 * tile.heights.len());
    bytes.extend(MAGIC);
    bytes.extend((key.len() as u32).to_le_bytes());
    bytes.extend(key.as_bytes());
    bytes.extend((tile.rows as u32).to_le_bytes());
    bytes.extend((tile.cols as u32).to_le_bytes());
    let present = fields.iter().enumerate().map(|(bit, field)| u32::from(field.is_some()) << bit).sum::<u32>();
    bytes.extend(present.to_le_bytes());
    for values in fields.into_iter().flatten() {
        bytes.extend(values.iter().flat_map(|v| v.to_le_bytes()));
    }
    let checksum = blake3::hash(&bytes);
    bytes.extend(checksum.as_bytes());
    bytes
}

/// Decodes the tile of a key; `None` if the bytes are not an intact record of this key.
pub fn decode(key: &str, bytes: &[u8]) -> Option<Samples> {
    let (content, checksum) = bytes.split_at_checked(bytes.len().checked_sub(CHECKSUM)?)?;
    let mut rest = content.strip_prefix(MAGIC)?;
    let length = word(&mut rest)?;
    let (own, after) = rest.split_at_checked(length)?;
    rest = after;
    let [rows, cols, present] = [word(&mut rest)?, word(&mut rest)?, word(&mut rest)?];
    if own != key.as_bytes() || rows > SIDE_MAX || cols > SIDE_MAX || present >= 16 {
        return None;
    }
    if rest.len() != 4 * rows * cols * present.count_ones() as usize || blake3::hash(content).as_bytes() != checksum {
        return None;
    }
    let mut parts = rest.chunks_exact((4 * rows * cols).max(1));
    let mut field = |bit: usize| -> Option<Vec<f32>> {
        (present >> bit & 1 == 1).then(|| parts.next()).flatten().map(|part| {
            let value = |v: &[u8]| f32::from_le_bytes([v[0], v[1], v[2], v[3]]);
            part.chunks_exact(4).map(value).collect()
        })
    };
    let [heights, albedo, rock, rock_potential] = [field(0), field(1), field(2), field(3)];
    Some(Samples { rows, cols, heights: heights?, albedo, rock, rock_potential })
}

/// Reads the next integer of a record.
fn word(rest: &mut &[u8]) -> Option<usize> {
    let (word, after) = rest.split_first_chunk::<4>()?;
    *rest = after;
    usize::try_from(u32::from_le_bytes(*word)).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tile(present: usize) -> Samples {
        let field = |bit: usize| (present >> bit & 1 == 1).then(|| (0..6).map(|k| (10 * bit + k) as f32).collect());
        let heights = vec![1.5, -2.0, 3e9, 0.0, 7.0, -0.25];
        Samples { rows: 2, cols: 3, heights, albedo: field(0), rock: field(1), rock_potential: field(2) }
    }

    /// Whichever fields a tile has, they come back as the same fields.
    #[test]
    fn prop_records_round_trip() {
        for present in 0..8 {
            assert_eq!(decode("key", &encode("key", &tile(present))), Some(tile(present)), "{present:b}");
        }
    }

    #[test]
    fn prop_other_bytes_are_no_record() {
        let bytes = encode("key", &tile(5));
        assert_eq!(decode("kex", &bytes), None);
        for length in 0..bytes.len() {
            assert_eq!(decode("key", &bytes[..length]), None, "{length} bytes");
        }
        for place in 0..bytes.len() {
            let mut damaged = bytes.clone();
            damaged[place] ^= 0x10;
            assert_eq!(decode("key", &damaged), None, "byte {place}");
        }
        assert_eq!(decode("key", &[bytes.as_slice(), &[0]].concat()), None);
    }
}
