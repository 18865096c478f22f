//! Transects: heights along straight lines, as text.
//!
//! One column of heights per profile and one line per point, evenly spaced, in metres.
//!
//! * Columns are separated by `;`, or else `,`, tabs or blanks, whichever occurs first in that order. Decimals use a point.
//! * A first line whose first field is not a number names the columns. Lines that start with `#` and empty lines are skipped.
//! * The first column holds distances, not heights, if its name says so (distance, chainage, station, position, or `x`), or if
//!   there are no names and it rises or falls in even steps; [`TransectOptions::distance_column`] overrides this.
//! * A height that is empty, `nan`, `NA`, `-` or -9999 is missing. (In a file with a single column, empty lines are skipped.)
//!
//! Distances may deviate from even spacing by a fiftieth of the spacing, which allows for rounding to two digits.
//! Memory: the text and 8 bytes per height.

use crate::dem::{DemError, NO_DATA, Refusal};
use sastrugi_schemas::counted;
use std::path::Path;

#[cfg(test)]
mod tests;

/// Largest deviation from even spacing, in spacings.
const UNEVEN: f64 = 0.02;
/// Fewest lines from which even steps identify a column of distances.
const EVEN_LINES_MIN: usize = 3;
/// Words in the name of a column of distances; `x` alone also counts.
const DISTANCE_WORDS: [&str; 4] = ["dist", "chainage", "station", "position"];
/// File name endings of transects.
const ENDINGS: [&str; 4] = ["csv", "txt", "tsv", "dat"];

/// Information that the file itself does not contain.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TransectOptions {
    /// Spacing of the heights, m, for files without distances.
    pub spacing_m: Option<f64>,
    /// Whether the first column holds distances; detected if `None`.
    pub distance_column: Option<bool>,
}

/// Profiles of equal spacing.
#[derive(Clone, Debug, PartialEq)]
pub struct Transects {
    /// Distance from one height to the next, m.
    pub spacing_m: f64,
    /// Heights of each profile, m; `NaN` if missing. All profiles have the same length.
    pub profiles: Vec<Vec<f64>>,
    /// Name of each profile; `profile 1` ... if the file gives none.
    pub names: Vec<String>,
}

/// True for a file that may hold transects, by its ending, unless it is an ESRI ASCII grid.
pub fn looks_like(path: &Path) -> bool {
    let ending = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
    ENDINGS.contains(&ending.as_str()) && !crate::file::read(path).is_ok_and(|bytes| crate::dem::is_grid_text(&bytes))
}

/// Reads transects.
///
/// # Errors
/// A file that is missing or cannot be parsed (the message gives line and column); [`DemError::Unfit`] if the spacing is
/// neither in the file nor given, or if the two disagree.
///
/// # Examples
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use sastrugi_store::transect::{TransectOptions, read};
///
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("profiles.csv");
/// std::fs::write(&path, "distance_m, west, east\n0, 1.5, 2\n0.5, NA, 2.25\n1, 1, -3\n")?;
/// let found = read(&path, &TransectOptions::default())?;
/// assert_eq!((found.spacing_m, found.names), (0.5, vec!["west".to_owned(), "east".to_owned()]));
/// assert_eq!(found.profiles[1], [2.0, 2.25, -3.0]);
/// assert!(found.profiles[0][1].is_nan());
///
/// // Heights alone need a spacing.
/// std::fs::write(&path, "1.5\n2\n1\n")?;
/// assert!(read(&path, &TransectOptions::default()).is_err());
/// assert_eq!(read(&path, &TransectOptions { spacing_m: Some(2.0), ..TransectOptions::default() })?.spacing_m, 2.0);
/// # Ok(())
/// # }
/// ```
pub fn read(path: &Path, options: &TransectOptions) -> Result<Transects, DemError> {
    let bytes = crate::file::read(path).map_err(|e| DemError::reading(path, e))?;
    let columns = Columns::parse(&bytes).map_err(|refusal| refusal.about(path))?;
    columns.transects(options).map_err(|trouble| match trouble {
        Trouble::File(reason) => Refusal::new(reason).about(path),
        Trouble::Options(reason) => DemError::Unfit { path: path.to_owned(), reason },
    })
}

enum Trouble {
    /// The file is invalid.
    File(String),
    /// An option is missing or wrong.
    Options(String),
}

/// The parsed text.
struct Columns {
    names: Option<Vec<String>>,
    /// Values by column.
    values: Vec<Vec<f64>>,
    /// Number of each line of values, from 1.
    lines: Vec<usize>,
}

impl Columns {
    fn parse(bytes: &[u8]) -> Result<Self, Refusal> {
        let text = std::str::from_utf8(bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes))
            .map_err(|e| Refusal::new(format!("not text: byte {} is not UTF-8", e.valid_up_to())))?;
        let mut found = Self { names: None, values: vec![], lines: vec![] };
        let has_values = |(_, line): &(usize, &str)| !line.is_empty() && !line.starts_with('#');
        let lines = text.lines().enumerate().map(|(k, line)| (k + 1, line.trim())).filter(has_values);
        for (place, (number, line)) in lines.enumerate() {
            let fields = fields(line);
            if place == 0 && height(fields[0]).is_err() {
                found.names = Some(fields.iter().map(|name| name.trim_matches('"').trim().to_owned()).collect());
            } else {
                found.push(number, &fields)?;
            }
        }
        found.check_names()?;
        Ok(found)
    }

    fn push(&mut self, number: usize, fields: &[&str]) -> Result<(), Refusal> {
        if self.lines.is_empty() {
            self.values = vec![vec![]; fields.len()];
        }
        if fields.len() != self.values.len() {
            let (found, before) = (counted(fields.len(), "column"), self.values.len());
            return Err(Refusal::new(format!("line {number} has {found}; the lines before it have {before}")));
        }
        for (column, (values, field)) in self.values.iter_mut().zip(fields).enumerate() {
            let value =
                height(field).map_err(|why| Refusal::new(format!("line {number}, column {}: {why}", column + 1)))?;
            values.push(value);
        }
        self.lines.push(number);
        Ok(())
    }

    fn check_names(&self) -> Result<(), Refusal> {
        if self.lines.is_empty() {
            return Err(Refusal::new("has no lines of heights"));
        }
        match self.names.as_ref().map(Vec::len) {
            Some(names) if names != self.values.len() => Err(Refusal::new(format!(
                "the first line names {}, but line {} has {}",
                counted(names, "column"),
                self.lines[0],
                self.values.len()
            ))),
            _ => Ok(()),
        }
    }

    fn transects(mut self, options: &TransectOptions) -> Result<Transects, Trouble> {
        let given = options.spacing_m.map(|spacing| {
            let usable = spacing.is_finite() && spacing > 0.0;
            usable
                .then_some(spacing)
                .ok_or_else(|| Trouble::Options(format!("the spacing must be above 0, got {spacing} m")))
        });
        let given = given.transpose()?;
        let spacing_m = if self.starts_with_distances(options.distance_column) {
            let spacing = self.take_spacing().map_err(Trouble::File)?;
            match given {
                Some(given) if (given - spacing).abs() > UNEVEN * spacing => {
                    let reason = format!("the distances in the file are {spacing} m apart, not {given} m as given");
                    return Err(Trouble::Options(reason));
                }
                _ => spacing,
            }
        } else {
            let reason = "has no column of distances; give the spacing of the heights (cell size)";
            given.ok_or_else(|| Trouble::Options(reason.to_owned()))?
        };
        self.check_heights().map_err(Trouble::File)?;
        let names = self.names.unwrap_or_else(|| (1..=self.values.len()).map(|k| format!("profile {k}")).collect());
        Ok(Transects { spacing_m, profiles: self.values, names })
    }

    fn starts_with_distances(&self, given: Option<bool>) -> bool {
        let first = self.names.as_ref().map(|names| names[0].to_lowercase());
        given.unwrap_or_else(|| match first {
            _ if self.values.len() < 2 => false,
            Some(name) => name == "x" || DISTANCE_WORDS.iter().any(|word| name.contains(word)),
            None => self.lines.len() >= EVEN_LINES_MIN && self.uneven(&self.values[0]).is_none(),
        })
    }

    /// The line of the first value that deviates from even spacing between the first and the last.
    fn uneven(&self, values: &[f64]) -> Option<usize> {
        let step = spacing(values);
        let even = |(k, value): (usize, &f64)| (value - (values[0] + k as f64 * step)).abs() <= UNEVEN * step.abs();
        // NaN counts as uneven.
        let first = values.iter().enumerate().position(|at| step == 0.0 || !even(at));
        first.map(|k| self.lines[k])
    }

    /// Removes the column of distances and returns its spacing.
    fn take_spacing(&mut self) -> Result<f64, String> {
        let distances = self.values.remove(0);
        if let Some(names) = &mut self.names {
            names.remove(0);
        }
        if self.values.is_empty() {
            return Err("has only distances, no column of heights".to_owned());
        }
        if distances.len() < 2 {
            return Err("has only one line; a profile needs at least two".to_owned());
        }
        let step = spacing(&distances);
        match self.uneven(&distances) {
            None => Ok(step.abs()),
            Some(line) => Err(format!(
                "line {line}, column 1: distances are not evenly spaced ({} m per step on average); mark a missing height by an \
                 empty field, not by a missing line",
                step.abs()
            )),
        }
    }

    fn check_heights(&self) -> Result<(), String> {
        match self.values.iter().position(|heights| heights.iter().all(|z| z.is_nan())) {
            Some(profile) => Err(format!("profile {} has no heights", profile + 1)),
            None => Ok(()),
        }
    }
}

/// Mean step; `NaN` for a single value.
fn spacing(values: &[f64]) -> f64 {
    (values[values.len() - 1] - values[0]) / (values.len() - 1) as f64
}

pub(crate) fn fields(line: &str) -> Vec<&str> {
    match [';', ',', '\t'].into_iter().find(|mark| line.contains(*mark)) {
        Some(mark) => line.split(mark).map(str::trim).collect(),
        None => line.split_whitespace().collect(),
    }
}

/// A height; `NaN` if missing.
fn height(field: &str) -> Result<f64, String> {
    if ["", "-", "na", "nan"].contains(&field.to_ascii_lowercase().as_str()) {
        return Ok(f64::NAN);
    }
    match field.parse::<f64>() {
        Ok(value) if value == NO_DATA => Ok(f64::NAN),
        Ok(value) if value.is_finite() => Ok(value),
        Ok(_) => Err(format!("\"{field}\" is not finite")),
        Err(_) if field.contains(',') => Err(format!("\"{field}\" is not a number; use a decimal point")),
        Err(_) => Err(format!("\"{field}\" is not a number")),
    }
}
