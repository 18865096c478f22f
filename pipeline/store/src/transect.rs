//! Transects: heights along straight lines, as text.
//!
//! One column of heights for each profile, one line for each place, all evenly spaced; m.
//!
//! * Columns are parted by `;`, else `,`, else tabs, else blanks, whichever the line holds. Decimals are written with a point.
//! * A first line whose first field is no number names the columns. Lines that start with `#` and empty lines are skipped.
//! * The first column holds distances, not heights, when its name says so (distance, chainage, station, position, or `x`), or
//!   when there are no names and it rises or falls in even steps; [`TransectOptions::distance_column`] decides otherwise.
//! * A height that is empty, `nan`, `NA`, `-` or -9999 is missing. (Of a single column, an empty line is none.)
//!
//! Distances may be off their even places by a fiftieth of the spacing, which is the rounding of two digits.
//! Memory: the text and 8 bytes a height.

use crate::dem::{DemError, NO_DATA, Refusal};
use std::path::Path;

#[cfg(test)]
mod tests;

/// Largest distance from an even place, in spacings.
const UNEVEN: f64 = 0.02;
/// Fewest lines of which even steps say that they are distances.
const LINES_TELLING: usize = 3;
/// Words that name a column of distances; `x` alone does too.
const DISTANCE_WORDS: [&str; 4] = ["dist", "chainage", "station", "position"];
/// Endings of files that may hold transects.
const ENDINGS: [&str; 4] = ["csv", "txt", "tsv", "dat"];

/// What a caller knows about a file that the file does not say.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TransectOptions {
    /// Spacing of the heights, m, for files without distances.
    pub spacing_m: Option<f64>,
    /// Whether the first column holds distances; found out when absent.
    pub distance_column: Option<bool>,
}

/// Profiles with one spacing.
#[derive(Clone, Debug, PartialEq)]
pub struct Transects {
    /// Distance from one height to the next, m.
    pub spacing_m: f64,
    /// Heights of each profile, m; `NaN` where one is missing. All have the same length.
    pub profiles: Vec<Vec<f64>>,
    /// Name of each profile; `profile 1` ... where the file gives none.
    pub names: Vec<String>,
}

/// True for a file that may hold transects: by its name's ending, unless it is an ESRI ASCII grid.
pub fn looks_like(path: &Path) -> bool {
    let ending = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
    ENDINGS.contains(&ending.as_str()) && !crate::file::read(path).is_ok_and(|bytes| crate::dem::is_grid_text(&bytes))
}

/// Reads transects.
///
/// # Errors
/// A file that is missing, or holds no such text (the message names line and column); [`DemError::Unfit`] when the spacing
/// is neither in the file nor given, or given otherwise than the file says.
pub fn read(path: &Path, options: &TransectOptions) -> Result<Transects, DemError> {
    let bytes = crate::file::read(path).map_err(|e| DemError::reading(path, e))?;
    let columns = Columns::parse(&bytes).map_err(|refusal| refusal.about(path))?;
    columns.transects(options).map_err(|trouble| match trouble {
        Trouble::File(reason) => Refusal::new(reason).about(path),
        Trouble::Options(reason) => DemError::Unfit { path: path.to_owned(), reason },
    })
}

enum Trouble {
    /// The file is wrong.
    File(String),
    /// What the caller says of it is missing or wrong.
    Options(String),
}

/// The text as numbers.
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
            .map_err(|e| Refusal::new(format!("is no text: byte {} is not UTF-8", e.valid_up_to())))?;
        let mut found = Self { names: None, values: vec![], lines: vec![] };
        let told = |(_, line): &(usize, &str)| !line.is_empty() && !line.starts_with('#');
        let lines = text.lines().enumerate().map(|(k, line)| (k + 1, line.trim())).filter(told);
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
            let (found, before) = (fields.len(), self.values.len());
            return Err(Refusal::new(format!("line {number} has {found} columns; the lines before have {before}")));
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
            return Err(Refusal::new("holds no line of heights"));
        }
        match self.names.as_ref().map(Vec::len) {
            Some(names) if names != self.values.len() => Err(Refusal::new(format!(
                "its first line names {names} columns; line {} has {}",
                self.lines[0],
                self.values.len()
            ))),
            _ => Ok(()),
        }
    }

    fn transects(mut self, options: &TransectOptions) -> Result<Transects, Trouble> {
        let told = options.spacing_m.map(|spacing| {
            let usable = spacing.is_finite() && spacing > 0.0;
            usable
                .then_some(spacing)
                .ok_or_else(|| Trouble::Options(format!("the spacing is {spacing} m; it must be above 0")))
        });
        let told = told.transpose()?;
        let spacing_m = if self.starts_with_distances(options.distance_column) {
            let spacing = self.take_spacing().map_err(Trouble::File)?;
            match told {
                Some(told) if (told - spacing).abs() > UNEVEN * spacing => {
                    let reason = format!("its distances are {spacing} m apart, not {told} m");
                    return Err(Trouble::Options(reason));
                }
                _ => spacing,
            }
        } else {
            let reason = "holds no column of distances, so the spacing of its heights (cell size) must be given";
            told.ok_or_else(|| Trouble::Options(reason.to_owned()))?
        };
        self.check_heights().map_err(Trouble::File)?;
        let names = self.names.unwrap_or_else(|| (1..=self.values.len()).map(|k| format!("profile {k}")).collect());
        Ok(Transects { spacing_m, profiles: self.values, names })
    }

    fn starts_with_distances(&self, told: Option<bool>) -> bool {
        let first = self.names.as_ref().map(|names| names[0].to_lowercase());
        told.unwrap_or_else(|| match first {
            _ if self.values.len() < 2 => false,
            Some(name) => name == "x" || DISTANCE_WORDS.iter().any(|word| name.contains(word)),
            None => self.lines.len() >= LINES_TELLING && self.uneven(&self.values[0]).is_none(),
        })
    }

    /// The line of the first value that is not at its even place between the first and the last.
    fn uneven(&self, values: &[f64]) -> Option<usize> {
        let step = spacing(values);
        let even = |(k, value): (usize, &f64)| (value - (values[0] + k as f64 * step)).abs() <= UNEVEN * step.abs();
        // Not a number is not even.
        let first = values.iter().enumerate().position(|at| step == 0.0 || !even(at));
        first.map(|k| self.lines[k])
    }

    /// Takes the column of distances away.
    fn take_spacing(&mut self) -> Result<f64, String> {
        let distances = self.values.remove(0);
        if let Some(names) = &mut self.names {
            names.remove(0);
        }
        if self.values.is_empty() {
            return Err("holds distances only, no column of heights".to_owned());
        }
        if distances.len() < 2 {
            return Err("holds one line only; a profile has at least two".to_owned());
        }
        let step = spacing(&distances);
        match self.uneven(&distances) {
            None => Ok(step.abs()),
            Some(line) => Err(format!(
                "line {line}, column 1: the distance is off its even place ({} m a step on average); a missing height is an \
                 empty field, not a missing line",
                step.abs()
            )),
        }
    }

    fn check_heights(&self) -> Result<(), String> {
        match self.values.iter().position(|heights| heights.iter().all(|z| z.is_nan())) {
            Some(profile) => Err(format!("its profile {} has no height", profile + 1)),
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

/// A height, `NaN` where it is missing.
fn height(field: &str) -> Result<f64, String> {
    if ["", "-", "na", "nan"].contains(&field.to_ascii_lowercase().as_str()) {
        return Ok(f64::NAN);
    }
    match field.parse::<f64>() {
        Ok(value) if value == NO_DATA => Ok(f64::NAN),
        Ok(value) if value.is_finite() => Ok(value),
        Ok(_) => Err(format!("\"{field}\" is not finite")),
        Err(_) if field.contains(',') => Err(format!("\"{field}\" is no number; decimals are written with a point")),
        Err(_) => Err(format!("\"{field}\" is no number")),
    }
}
