//! Maps of roughness by blocks, beside a fit.

use super::write_error;
use crate::error::Error;
use sastrugi_numeric::Grid;
use sastrugi_store::dem::{self, Crs, Values, WriteOptions};
use sastrugi_texture::{FitOutcome, Heights, LocalMaps};
use std::path::{Path, PathBuf};

/// Maps that are asked for.
pub struct Local<'a> {
    /// Start of the names of the maps.
    pub prefix: &'a Path,
    /// Width of a block, m; four windows where it is `None`.
    pub block_m: Option<f64>,
}

/// End of a map's name, and what it holds.
const BAND_RMS: (&str, &str) = ("band-rms.tif", "root mean square of the residual before trimming");
const SIGMA: (&str, &str) = ("sigma.tif", "standard deviation of the texture, range held at the fit's");
const SIGMA2_OVER_B: (&str, &str) = ("sigma2-over-b.tif", "sigma squared over b, range held at the fit's");

impl Local<'_> {
    /// Every file that may be written.
    pub fn files(&self) -> Vec<PathBuf> {
        [BAND_RMS, SIGMA, SIGMA2_OVER_B].into_iter().map(|(end, _)| self.file(end)).collect()
    }

    fn file(&self, end: &str) -> PathBuf {
        let mut name = self.prefix.as_os_str().to_owned();
        name.push(format!(".{end}"));
        name.into()
    }

    /// Writes the maps of a fit, and says what they hold in a sentence.
    ///
    /// # Errors
    /// Blocks that do not fit, heights that cannot be read, files that cannot be written.
    pub fn write(&self, outcome: &FitOutcome, heights: &dyn Heights, crs: &Crs) -> Result<String, Error> {
        let maps = outcome.local_maps(heights, self.block_m).map_err(super::fit::refused)?;
        let LocalMaps { band_rms_m, sigma_m, sigma2_over_range_m, .. } = &maps;
        let all =
            [(BAND_RMS, Some(band_rms_m)), (SIGMA, sigma_m.as_ref()), (SIGMA2_OVER_B, sigma2_over_range_m.as_ref())];
        for ((end, description), map) in all {
            let Some(map) = map else { continue };
            let values = Values::Figures { unit: "m".into(), description: description.into() };
            let options = WriteOptions { values, ..WriteOptions::default() };
            dem::write(&self.file(end), map, crs, &options).map_err(write_error)?;
        }
        Ok(sentence(&maps))
    }
}

fn sentence(maps: &LocalMaps) -> String {
    let geometry = &maps.band_rms_m.geometry;
    let [x, y] = geometry.cell.map(|side_m| (1e6 * side_m).round() / 1e6);
    let range = |name: &str, map: &Grid| match map.range() {
        Some((low, high)) => format!("; {name} {low:.5} to {high:.5} m"),
        None => String::new(),
    };
    let sigma = maps.sigma_m.as_ref().map_or_else(String::new, |map| {
        let error =
            format!(" (standard error of a whole block {:.1} %, if the model is right)", 100.0 * maps.sigma_error);
        range("sigma", map) + &error
    });
    format!(
        "local maps of {} x {} blocks of {x} x {y} m, {} with data{}{sigma}",
        geometry.rows,
        geometry.cols,
        maps.band_rms_m.finite_count(),
        range("band RMS", &maps.band_rms_m),
    )
}
