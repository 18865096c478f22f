//! Table rows that describe a surface, whichever stage produced it.

use crate::job::{JobError, Outcome, Work};
use sastrugi_numeric::Grid;
use sastrugi_roughness::multifractality::ScalingExponent;
use sastrugi_roughness::{
    ArealParameters, Direction, HistogramBin, ProfileBin, SpectralMap, SpectrumBin, StructureBin, areal_parameters,
    default_slope_band, histogram,
};
use sastrugi_schemas::fit::FitFile;
use sastrugi_schemas::tables::{HeightDistributionRow, ProfilePsdRow, PsdRow, StructureRow, SurfaceRow};

/// Bins of the height distribution of a residual, the same number as for a heightfield.
const HISTOGRAM_BINS: usize = 64;
/// Longest lag for the Hurst exponent of a residual, as a fraction of the window; the structure function levels off at longer lags.
const HURST_WINDOWS: f64 = 0.25;

/// A surface and its origin.
pub struct Surface<'a> {
    /// Its id in the tables.
    pub id: &'a str,
    /// Its value of `stage` in the table `surfaces`.
    pub stage: &'a str,
    /// The fit whose window and trimming were applied to it.
    pub fit_id: Option<&'a str>,
    /// Heights, m.
    pub grid: &'a Grid,
}

/// Rows of the tables `surfaces`, `structure`, `profile_psd`, `psd` and `height_distribution`.
pub struct SurfaceRows {
    surface: SurfaceRow,
    structure: Vec<StructureRow>,
    profile_psd: Vec<ProfilePsdRow>,
    psd: Vec<PsdRow>,
    height_distribution: Vec<HeightDistributionRow>,
}

impl SurfaceRows {
    /// The statistics of a surface as rows.
    pub fn of(
        surface: &Surface<'_>,
        spectrum: &[SpectrumBin],
        histogram: &[HistogramBin],
        areal: &ArealParameters,
    ) -> Self {
        Self {
            surface: row(surface, areal),
            structure: structure_rows(surface.id, &areal.structure),
            profile_psd: profile_rows(surface.id, &areal.profiles),
            psd: psd_rows(surface.id, spectrum),
            height_distribution: height_rows(surface.id, histogram),
        }
    }

    /// The rows of a residual: that of the DEM of a fit, or that of a texture detrended and trimmed in the same way. Both use the same lags
    /// for the Hurst exponent.
    pub fn of_residual(surface: &Surface<'_>, fit: &FitFile) -> Self {
        let map = SpectralMap::of(surface.grid);
        let band = default_slope_band(&surface.grid.geometry);
        let lags = fit
            .cell_m
            .zip(fit.window_m)
            .map(|(cell, window)| [cell[0].max(cell[1]), HURST_WINDOWS * window[0].min(window[1])]);
        let areal = areal_parameters(surface.grid, map.as_ref(), band, lags);
        let spectrum = map.as_ref().map_or_else(Vec::new, SpectralMap::rings);
        Self::of(surface, &spectrum, &histogram(surface.grid, HISTOGRAM_BINS), &areal)
    }

    /// Writes the rows as those of an item.
    ///
    /// # Errors
    /// When a file cannot be written.
    pub fn write(self, work: &Work<'_>, outcome: &mut Outcome) -> Result<(), JobError> {
        outcome.write_rows(work, [self.surface])?;
        outcome.write_rows(work, self.structure)?;
        outcome.write_rows(work, self.profile_psd)?;
        outcome.write_rows(work, self.psd)?;
        outcome.write_rows(work, self.height_distribution)
    }
}

fn row(surface: &Surface<'_>, areal: &ArealParameters) -> SurfaceRow {
    let geometry = &surface.grid.geometry;
    let cells = surface.grid.finite_count();
    let hurst = |f: fn(&sastrugi_roughness::Hurst) -> f64| areal.hurst.as_ref().map_or(f64::NAN, f);
    let zeta =
        |order: usize, f: fn(&ScalingExponent) -> f64| areal.exponents.as_ref().map_or(f64::NAN, |e| f(&e[order - 1]));
    SurfaceRow {
        surface_id: surface.id.to_owned(),
        stage: surface.stage.to_owned(),
        fit_id: surface.fit_id.map(str::to_owned),
        cell_x_m: geometry.cell[0],
        cell_y_m: geometry.cell[1],
        cells: cells as i64,
        valid_share: cells as f64 / geometry.len() as f64,
        sq_m: areal.sq_m,
        sa_m: areal.sa_m,
        ssk: areal.ssk,
        sku: areal.sku,
        sp_m: areal.sp_m,
        sv_m: areal.sv_m,
        sz_m: areal.sz_m,
        sdq: areal.sdq,
        rms_slope_x: areal.rms_slopes[0],
        rms_slope_y: areal.rms_slopes[1],
        sal_m: areal.sal_m,
        aspect_ratio: areal.aspect_ratio,
        direction_deg: areal.direction_deg,
        hurst_exponent: hurst(|h| h.exponent),
        hurst_standard_error: hurst(|h| h.standard_error),
        hurst_lag_min_m: hurst(|h| h.lags_m[0]),
        hurst_lag_max_m: hurst(|h| h.lags_m[1]),
        zeta_1: zeta(1, |e| e.zeta),
        zeta_1_standard_error: zeta(1, |e| e.standard_error),
        zeta_2: zeta(2, |e| e.zeta),
        zeta_2_standard_error: zeta(2, |e| e.standard_error),
        zeta_3: zeta(3, |e| e.zeta),
        zeta_3_standard_error: zeta(3, |e| e.standard_error),
        zeta_4: zeta(4, |e| e.zeta),
        zeta_4_standard_error: zeta(4, |e| e.standard_error),
    }
}

fn structure_rows(id: &str, bins: &[StructureBin]) -> Vec<StructureRow> {
    let row = |(bin, b): (i64, &StructureBin)| StructureRow {
        surface_id: id.to_owned(),
        direction: b.direction.name().to_owned(),
        bin,
        lag_m: b.lag_m,
        value_m2: b.value_m2,
        pairs: b.pairs as i64,
    };
    numbered(bins, |b| b.direction).map(row).collect()
}

fn profile_rows(id: &str, bins: &[ProfileBin]) -> Vec<ProfilePsdRow> {
    let row = |(bin, b): (i64, &ProfileBin)| ProfilePsdRow {
        surface_id: id.to_owned(),
        direction: b.direction.name().to_owned(),
        bin,
        frequency_cycles_m: b.frequency_cycles_m,
        psd_m3: b.psd_m3,
        modes: b.modes as i64,
    };
    numbered(bins, |b| b.direction).map(row).collect()
}

fn psd_rows(id: &str, spectrum: &[SpectrumBin]) -> Vec<PsdRow> {
    let row = |(bin, b): (usize, &SpectrumBin)| PsdRow {
        surface_id: id.to_owned(),
        bin: bin as i64,
        frequency_cycles_m: b.frequency_cycles_m,
        psd_m4: b.psd_m4,
        modes: b.modes as i64,
    };
    spectrum.iter().enumerate().map(row).collect()
}

fn height_rows(id: &str, histogram: &[HistogramBin]) -> Vec<HeightDistributionRow> {
    let row = |(bin, b): (usize, &HistogramBin)| HeightDistributionRow {
        surface_id: id.to_owned(),
        bin: bin as i64,
        low_m: b.low_m,
        high_m: b.high_m,
        cells: b.cells as i64,
        density_per_m: b.density_per_m,
    };
    histogram.iter().enumerate().map(row).collect()
}

/// Bins with their numbers, from 0 in each direction.
fn numbered<T>(bins: &[T], direction: fn(&T) -> Direction) -> impl Iterator<Item = (i64, &T)> {
    bins.chunk_by(move |a, b| direction(a) == direction(b)).flat_map(|run| (0..).zip(run))
}
