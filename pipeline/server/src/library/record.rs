//! A tile as bytes: magic, key, shape, fields, and a checksum over all of it. Little-endian.

use crate::samples::Samples;

/// Start of a record; its number changes with the form.
const MAGIC: &[u8; 16] = b"sastrugi tile 1\n";
/// Length of the checksum.
const CHECKSUM: usize = 32;
/// Most samples along a side.
const SIDE_MAX: usize = 1 << 14;

/// The bytes of a tile.
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

/// The tile of a key from its bytes; `None` where these are not its record, whole and undamaged.
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

/// The next number of a record.
fn word(rest: &mut &[u8]) -> Option<usize> {
    let (word, after) = rest.split_first_chunk::<4>()?;
    *rest = after;
    usize::try_from(u32::from_le_bytes(*word)).ok()
}
