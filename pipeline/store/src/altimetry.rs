//! Sparse altimetry: measured points as text.
//!
//! One line per point, in metres, in the coordinates of the surface that passes through them.
//!
//! * Columns are separated by `;`, or else `,`, tabs or blanks, whichever occurs first in that order. Decimals use a point.
//! * A first line whose first field is not a number names the columns: `x`, `y`, `z` and, where known, `sigma`, the standard error
//!   of z. Each may end in `_m`; case does not matter; other columns are ignored. Without names, the first three or four columns
//!   are these, in that order.
//! * Lines that start with `#` and empty lines are skipped.
//! * A missing sigma is 0: the point counts as exact. A missing coordinate is an error.
//!
//! Memory: the text and 32 bytes per point ([`reading_bytes`]).

use crate::dem::{DemError, Refusal};
use crate::transect::fields;
use std::io;
use std::path::Path;

#[cfg(test)]
mod tests;

/// Most memory for each byte of a text, bytes: itself, and 32 for each point of at least 6, in a list allocated for up to twice as many.
const BYTES_PER_BYTE: u64 = 12;
/// Column names; the last column may be missing.
const NAMES: [&str; 4] = ["x", "y", "z", "sigma"];

/// Reads points `[x, y, z, sigma]`, m.
///
/// # Errors
/// A file that is missing or cannot be parsed (the message gives line and column).
///
/// # Examples
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("laser.csv");
/// std::fs::write(&path, "z_m,x_m,y_m,sigma_m\n12.5,100,200,0.25\n13,110,200,\n")?;
/// assert_eq!(sastrugi_store::altimetry::read(&path)?, [[100.0, 200.0, 12.5, 0.25], [110.0, 200.0, 13.0, 0.0]]);
/// # Ok(())
/// # }
/// ```
pub fn read(path: &Path) -> Result<Vec<[f64; 4]>, DemError> {
    let bytes = crate::file::read(path).map_err(|e| DemError::reading(path, e))?;
    parse(&bytes).map_err(|refusal| refusal.about(path))
}

/// Most memory that [`read`] needs, bytes, from the size of the file.
///
/// # Errors
/// A file that cannot be opened.
pub fn reading_bytes(path: &Path) -> io::Result<u64> {
    Ok(BYTES_PER_BYTE * crate::file::open(path)?.metadata()?.len())
}

fn parse(bytes: &[u8]) -> Result<Vec<[f64; 4]>, Refusal> {
    let text = std::str::from_utf8(bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes))
        .map_err(|e| Refusal::new(format!("not text: byte {} is not UTF-8", e.valid_up_to())))?;
    let has_values = |(_, line): &(usize, &str)| !line.is_empty() && !line.starts_with('#');
    let mut lines = text.lines().enumerate().map(|(k, line)| (k + 1, line.trim())).filter(has_values).peekable();
    let first = lines.peek().map(|(_, line)| fields(line)).unwrap_or_default();
    let named = first.first().is_some_and(|field| field.parse::<f64>().is_err());
    let columns = if named { of_names(&first)? } else { [Some(0), Some(1), Some(2), (first.len() > 3).then_some(3)] };
    let points: Vec<[f64; 4]> =
        lines.skip(usize::from(named)).map(|(number, line)| point(number, line, &columns)).collect::<Result<_, _>>()?;
    if points.is_empty() { Err(Refusal::new("has no points")) } else { Ok(points) }
}

/// Indices of the columns, by name.
fn of_names(names: &[&str]) -> Result<[Option<usize>; 4], Refusal> {
    let plain = |name: &str| {
        let name = name.trim_matches('"').trim().to_lowercase();
        name.strip_suffix("_m").map(str::to_owned).unwrap_or(name)
    };
    let found = NAMES.map(|wanted| names.iter().position(|name| plain(name) == wanted));
    match found[..3].iter().position(Option::is_none) {
        Some(k) => Err(Refusal::new(format!(
            "has no column `{}`; found {}, expected x, y, z and optionally sigma",
            NAMES[k],
            names.join(", ")
        ))),
        None => Ok(found),
    }
}

fn point(number: usize, line: &str, columns: &[Option<usize>; 4]) -> Result<[f64; 4], Refusal> {
    let fields = fields(line);
    let mut point = [0.0; 4];
    for (k, column) in columns.iter().enumerate() {
        let Some(column) = *column else { continue };
        let field = fields.get(column).copied().unwrap_or_default();
        // Only the standard error may be missing.
        if k == 3 && field.is_empty() {
            continue;
        }
        point[k] = field.parse::<f64>().ok().filter(|v| v.is_finite()).ok_or_else(|| {
            Refusal::new(format!("line {number}, column {}: \"{field}\" is not a finite number", column + 1))
        })?;
    }
    Ok(point)
}
