//! Maps of local roughness, block by block, written with a fit.

use super::write_error;
use crate::error::Error;
use sastrugi_numeric::Grid;
use sastrugi_roughness::background::BoxWindow;
use sastrugi_schemas::shown;
use sastrugi_store::dem::{self, Crs, Values, WriteOptions};
use sastrugi_texture::fit::Mode;
use sastrugi_texture::{FitOutcome, FitSettings, Heights, LocalMaps};
use std::path::{Path, PathBuf};

/// The requested maps.
pub struct Local<'a> {
    /// Prefix of the map names.
    pub prefix: &'a Path,
    /// Width of a block, m; four windows if `None`.
    pub block_m: Option<f64>,
}

/// Default and minimum width of a block, in windows; as in `FitOutcome::local_maps`.
const BLOCK_WINDOWS: f64 = 4.0;
const BLOCK_WINDOWS_MIN: f64 = 2.0;

/// Suffix and description of a map.
const BAND_RMS: (&str, &str) = ("band-rms.tif", "root mean square of the residual before trimming");
const SIGMA: (&str, &str) = ("sigma.tif", "standard deviation of the texture, range fixed at that of the fit");
const SIGMA2_OVER_B: (&str, &str) = ("sigma2-over-b.tif", "sigma squared over b, range fixed at that of the fit");

impl Local<'_> {
    /// All files that may be written.
    pub fn files(&self) -> Vec<PathBuf> {
        [BAND_RMS, SIGMA, SIGMA2_OVER_B].into_iter().map(|(end, _)| self.file(end)).collect()
    }

    /// Refuses, before the fit, maps that its mode does not support.
    ///
    /// # Errors
    /// Mode `paper`.
    pub fn check_mode(&self, settings: &FitSettings) -> Result<(), Error> {
        match settings.parameters().mode {
            Mode::Corrected => Ok(()),
            Mode::Paper => Err(Error::Usage("`--local` requires mode `corrected`, not `paper`".to_owned())),
        }
    }

    /// Refuses, before the fit, maps of transects and blocks that do not fit the DEM.
    ///
    /// # Errors
    /// Transects; blocks below two windows or wider than the DEM.
    pub fn check(&self, settings: &FitSettings, heights: &dyn Heights) -> Result<(), Error> {
        if heights.are_profiles() {
            return Err(Error::Usage("`--local` requires a raster, not transects".to_owned()));
        }
        let geometry = heights.geometry();
        let [x_m, y_m] = BoxWindow::nearest(settings.parameters().outer_scale_m, geometry.cell).size_m(geometry.cell);
        let window_m = 0.5 * (x_m + y_m);
        let [width_m, height_m] = geometry.size();
        let (least_m, most_m) = (BLOCK_WINDOWS_MIN * window_m, width_m.max(height_m));
        let block_m = self.block_m.unwrap_or(BLOCK_WINDOWS * window_m);
        // If no block fits, the outer scale is too large for the DEM, and the fit reports that.
        if block_m >= least_m * (1.0 - 1e-9) && block_m <= most_m || least_m > most_m {
            return Ok(());
        }
        let [block, least, most] = [block_m, least_m, most_m].map(|m| shown((1e6 * m).round() / 1e6));
        let given = match self.block_m {
            Some(_) => format!("`--local-block` is {block} m"),
            None => format!("the default block of `--local` is four windows, {block} m"),
        };
        Err(Error::Usage(format!(
            "{given}; blocks must be at least two windows ({least} m) and at most the DEM ({most} m) wide"
        )))
    }

    fn file(&self, end: &str) -> PathBuf {
        let mut name = self.prefix.as_os_str().to_owned();
        name.push(format!(".{end}"));
        name.into()
    }

    /// Writes the maps of a fit, and describes them in one sentence.
    ///
    /// # Errors
    /// Blocks that do not fit, heights that cannot be read, files that cannot be written.
    pub fn write(&self, outcome: &FitOutcome, heights: &dyn Heights, crs: &Crs) -> Result<String, Error> {
        let maps = outcome.local_maps(heights, self.block_m)?;
        let LocalMaps { band_rms_m, sigma_m, sigma2_over_range_m, .. } = &maps;
        let all =
            [(BAND_RMS, Some(band_rms_m)), (SIGMA, sigma_m.as_ref()), (SIGMA2_OVER_B, sigma2_over_range_m.as_ref())];
        for ((end, description), map) in all {
            let Some(map) = map else { continue };
            let values = Values::Quantity { unit: "m".into(), description: description.into() };
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
            format!(" (standard error of a full block {:.1} %, if the model is right)", 100.0 * maps.sigma_error);
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
