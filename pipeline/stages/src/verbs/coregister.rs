//! `coregister`: the shift, raise and tilt that bring one DEM onto another, and their difference.

use super::{Read, Reading, check_distinct, check_output, describe_grid, read_as_it_is, write_error};
use crate::error::Error;
use crate::operations::coregistration::{IN_DEGREES, coregistered, verdict};
use sastrugi_schemas::coregistration::Coregistration;
use sastrugi_store::dem::{self, WriteOptions};
use sastrugi_texture::coregister;
use serde::Serialize;
use serde_json::Value;
use std::path::Path;

/// What to co-register.
pub struct Request<'a> {
    /// Reference DEM.
    pub a: &'a Path,
    /// DEM to move.
    pub b: &'a Path,
    /// DEM to write with A minus the moved B.
    pub output: Option<&'a Path>,
    /// How it is written.
    pub options: WriteOptions,
    /// How both are read. Window and masks are A's; masks restrict where B is fitted to A, and the difference covers the window.
    pub reading: Reading,
}

/// The result.
#[derive(Clone, Debug, Serialize)]
pub struct Done {
    /// File of A.
    pub a: String,
    /// File of B.
    pub b: String,
    /// How B was moved.
    pub coregistration: Coregistration,
    /// The verdict, in one sentence.
    pub verdict: String,
    /// File and grid of the difference, if written.
    pub difference: Option<Value>,
    /// Notes on how the DEMs were read and written.
    pub notes: Vec<String>,
}

/// Co-registers B to A, and writes their difference if requested.
///
/// # Errors
/// DEMs that cannot be read or co-registered; an output of unknown format, that is an input, or that cannot be written.
pub fn coregister(request: &Request<'_>) -> Result<Done, Error> {
    if let Some(output) = request.output {
        check_output(output)?;
        check_distinct(&[output], &[request.a, request.b])?;
    }
    let (a, b) = pair(request.a, request.b, &request.reading)?;
    let found = coregistered(&a.dem, &b.dem)?;
    let mut done = Done {
        a: request.a.display().to_string(),
        b: request.b.display().to_string(),
        verdict: verdict(&found.coregistration),
        coregistration: found.coregistration,
        difference: None,
        notes: a.notes.into_iter().chain(b.notes.into_iter().map(|n| format!("B: {n}"))).collect(),
    };
    if let Some(output) = request.output {
        let difference = if request.reading.masks.is_empty() {
            found.difference
        } else {
            let unmasked = Reading { masks: Vec::new(), ..request.reading.clone() };
            let whole = read_as_it_is(request.a, &unmasked)?.dem.grid;
            coregister::difference(&whole, &b.dem.grid, &done.coregistration)
        };
        let lost = dem::write(output, &difference, &a.dem.info.crs, &request.options).map_err(write_error)?;
        done.notes.extend(lost);
        let mut described = describe_grid(&difference);
        described["file"] = output.display().to_string().into();
        done.difference = Some(described);
    }
    Ok(done)
}

/// Reads two DEMs in metres: the first as requested, the second in full.
pub(super) fn pair(a: &Path, b: &Path, reading: &Reading) -> Result<(Read, Read), Error> {
    let whole = Reading { cell_m: reading.cell_m, gridding: reading.gridding, ..Reading::default() };
    let metric = |path: &Path, reading: &Reading| {
        let read = read_as_it_is(path, reading)?;
        match read.dem.info.crs.geographic {
            true => Err(Error::Input(format!("{}: {IN_DEGREES}", path.display()))),
            false => Ok(read),
        }
    };
    Ok((metric(a, reading)?, metric(b, &whole)?))
}
