//! Exemplar: multiple-point statistics, by direct sampling of the measured residual on ever finer grids.
//!
//! # What
//! The first cells lie on a coarse grid, farther apart than the residual is correlated, and copy random places of the site. Grids of half the spacing follow,
//! down to every cell (`sampling.rs`). Each cell takes its detail from the place of the site whose neighbourhood best matches its own known cells: `neighbours`
//! of them, nearest first. Candidates are the places that continue a neighbour as the site does, and random places: `scan` of them on grids of 8 cells and
//! coarser, an eighth of that on each finer grid, at least 8. Long waves thus come from a wide search, and short waves follow them.
//!
//! A cell gets the detail of that place (its height above the weighted mean of the neighbourhood), added to the level of its own neighbourhood.
//! Copying heights unchanged, as the sources do, lost a third of the standard deviation on two real sites: no place fits a wide neighbourhood well,
//! and flat places fit least badly.
//!
//! # Copies
//! As long as they fit best, places that continue a neighbour copy runs of the site; the first cells, drawn independently, end each run after
//! about one spacing. A run keeps the level at which it began, so it copies details: hardly any cell has exactly the height of its source.
//! [`super::measured::Copies`] reports both.
//!
//! # Sources
//! * Mariethoz, Renard and Straubhaar 2010, The direct sampling method to perform multiple-point geostatistical simulations, Water
//!   Resources Research 46, W11536, doi:10.1029/2008WR007621.
//! * Gravey and Mariethoz 2020, QuickSampling v1.0, Geoscientific Model Development 13, 2611, doi:10.5194/gmd-13-2611-2020: the best of all places
//!   instead of the first one below a threshold.
//! * Ashikhmin 2001, Synthesizing natural textures, I3D, 217, doi:10.1145/364338.364405: places that continue a neighbour.
//!
//! Departures: details instead of heights; grids instead of a random path, so that cells of one pass may be computed on any number of threads;
//! random places are compared for each cell, instead of all places by transforms; the best of them is taken, whereas Gravey and Mariethoz draw
//! one of the k best.
//!
//! # Limits
//! * Features wider than a few spacings are not seen as a whole. [`super::quilting`] keeps them up to the width of a patch.
//! * Pieces from different places meet between the first cells and roughen the smallest increments where the site is smooth: by 29 % along
//!   ridges that are correlated over 3 cells (1 across), which lowered a ratio of increments from 2.4 to 1.9.
//! * A site that is not stationary gives a texture that mixes its kinds of ground. Periodic features (furrows) may fall out of phase.
//! * The standard deviation showed no bias, but a tile with few first cells is a small sample. Tiles of 128 x 128 cells by an independent program had
//!   1.08 +- 0.06 of the site's standard deviation and 1.07 +- 0.06 of its increments on a synthetic site that is rough in patches (spacing 8), and 1.00
//!   +- 0.04 and 0.98 +- 0.01, 0.89 +- 0.15 and 0.97 +- 0.11 on two measured sites (spacing 32). The logarithm of the increments' flatness was lower by
//!   0.1, 0.9 and 0.2. That of the shipped kernel is lower by 0.19 to 0.39 on seven synthetic sites like those of its test: the excess over 3 drops by 28
//!   to 49 %.
//! * Distances are in cells, not in metres: on oblong cells the nearest neighbours are not the nearest on the ground.
//! * A level residual gives a level texture, as with [`super::quilting`]; the methods that use statistics refuse it.
//! * A gap in the site excludes only the places whose neighbourhood it covers by more than 30 %. The DEM licence extends to the
//!   texture.
//!
//! # Cost
//! For each cell of the texture `neighbours` places that continue a neighbour, and with the default `scan` at most 55 at random (23 for first cells
//! 8 apart), each compared at `neighbours` cells: random places are not in the processor's cache, so 1024 x 1024 cells from as large a site
//! take 20 to 40 s (estimated from a sixteenth of them). Memory: 20 bytes per cell of the site, 48 per cell of the texture (14, and up to 32 for the
//! offsets at which the widest grid seeks its neighbours).

pub mod sampling;

use super::fft_ma::{CovarianceOf, without_default};
use super::measured::{self, Collage, Measured};
use super::residual::{ResidualKernel, ResidualParameters, Site};
use super::tile::{self, Tile};
use super::{Cost, SynthesisError};
use sampling::{Field, Sampling};
use sastrugi_numeric::{Counter, Geometry, Streams};
use sastrugi_schemas::{Kind, ParameterError, limits};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Name of the method.
const NAME: &str = "exemplar";
/// Spacing of the first cells in correlation lengths, if not stated.
const SPACING_LENGTHS: usize = 2;
/// Operations for the comparison of two cells: an estimate.
const OPERATIONS_PER_CELL: f64 = 100.0;
/// Fewest cells with data in a site.
const PLACES_MIN: usize = 1000;
/// Grids that the cost counts; wider ones have hardly any cells.
const GRIDS_MAX: usize = 16;

/// Raw parameters of direct sampling, without those of its tile.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ExemplarParameters {
    /// Spacing of the first cells, which copy random places of the site, m; rounded up to a power of 2 in cells. Default: twice the lag at which the
    /// residual's correlation is 1/e. On a periodic tile it is reduced, by half at most, so that at least two of them fit along each side.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(transform = limits::positive)]
    pub spacing_m: Option<f64>,
    /// Known cells around a cell that are compared, in [4, 64]. Default 12.
    #[schemars(range(min = 4, max = 64))]
    pub neighbours: u32,
    /// Places compared at random for each cell of grids of 8 cells and wider, in [1, 100 000]; an eighth on each finer one, at least 8. Default
    /// 2000.
    #[schemars(range(min = 1, max = 100_000))]
    pub scan: u32,
    /// Whether the texture repeats without seams. Default true.
    pub periodic: bool,
    /// Base that the texture is for: with `surface`, for level or synthetic ground, it repeats the residual as it was measured; with `residual`, for a
    /// measured background, wavelengths near the fit's window are amplified, so that background and texture together have the covariance of the site.
    /// Default: `residual` on a measured DEM or the background of a fit, otherwise `surface`.
    #[schemars(transform = without_default)]
    pub covariance: CovarianceOf,
}

impl Default for ExemplarParameters {
    fn default() -> Self {
        Self { spacing_m: None, neighbours: 12, scan: 2000, periodic: true, covariance: CovarianceOf::Surface }
    }
}

impl ResidualParameters for ExemplarParameters {
    const NAME: &'static str = NAME;
    type Source = Measured;
    type Kernel = Sampler;

    fn is_periodic(&self) -> bool {
        self.periodic
    }

    fn covariance(&self) -> CovarianceOf {
        self.covariance
    }

    fn check(&self) -> Result<(), ParameterError> {
        self.spacing_m.map(|m| ParameterError::positive("spacing_m", m)).transpose()?;
        for (key, value, low, high) in [("neighbours", self.neighbours, 4, 64), ("scan", self.scan, 1, 100_000)] {
            if !(low..=high).contains(&value) {
                return Err(ParameterError::new(key, format!("is {value}; it must lie in [{low}, {high}]")));
            }
        }
        Ok(())
    }

    fn cost_of(&self, tile: &Tile, site: &Site) -> Cost {
        self.cost(site.cells, tile.geometry.len() as u64)
    }

    fn kernel(&self, tile: &Tile, measured: &Arc<Measured>) -> Result<Sampler, ParameterError> {
        Ok(Sampler { measured: measured.clone(), tile: tile.clone(), parameters: self.clone() })
    }
}

/// Direct sampling bound to a site.
pub struct Sampler {
    measured: Arc<Measured>,
    tile: Tile,
    parameters: ExemplarParameters,
}

impl ResidualKernel for Sampler {
    fn cost(&self) -> Cost {
        self.parameters.cost(self.measured.residual.geometry.len() as u64, self.tile.geometry.len() as u64)
    }

    fn make(&self, streams: &Streams) -> Result<(Vec<f64>, Vec<String>), SynthesisError> {
        let Collage { heights_m, copies } = synthesise(&self.measured, &self.tile, &self.parameters, streams)?;
        Ok((heights_m, vec![copies.to_string()]))
    }
}

impl ExemplarParameters {
    /// Cost of a tile of `cells` from a site of `places` cells.
    fn cost(&self, places: u64, cells: u64) -> Cost {
        // Three quarters of the cells of a grid are not on the next wider one.
        let at_random =
            |spacing: usize| 0.75 / (spacing * spacing) as f64 * sampling::scan_at(self.scan as usize, spacing) as f64;
        let at_random: f64 = (0..GRIDS_MAX).map(|k| at_random(1 << k)).sum();
        let neighbours = f64::from(self.neighbours);
        let compared = neighbours * (neighbours + at_random);
        let memory_bytes = (20 * places + 48 * cells).max(measured::correlation_bytes(places));
        Cost { memory_bytes, operations: OPERATIONS_PER_CELL * compared * cells as f64 }
    }

    /// Spacing of the first cells, a power of 2, cells.
    fn spacing(&self, measured: &Measured, tile: &Tile) -> Result<usize, SynthesisError> {
        let Geometry { rows, cols, cell: [dx, dy], .. } = tile.geometry;
        let wanted = match self.spacing_m {
            Some(m) => (m / dx.min(dy)).ceil() as usize,
            None => {
                let [south, east] = measured.correlation_cells();
                SPACING_LENGTHS * south.max(east)
            }
        };
        // Beyond the longer side there is one first cell, however far apart they are.
        let spacing = wanted.min(rows.max(cols)).max(2).next_power_of_two();
        if !tile.periodic {
            return Ok(spacing);
        }
        let (shorter, side_m) = if rows < cols { (rows, dy) } else { (cols, dx) };
        let fitting = spacing.min(1 << (shorter / 2).max(2).ilog2());
        if 2 * fitting < wanted {
            let [spacing_m, side_m] = [wanted, shorter].map(|cells| cells as f64 * side_m);
            return Err(SynthesisError::SpacingTooWide { spacing_m, side_m });
        }
        Ok(fitting)
    }
}

/// Registry entry.
pub fn kind() -> Kind {
    Kind {
        family: "texture",
        kind: NAME,
        summary: "direct sampling of the measured residual, grid by grid; needs the DEM, whose licence extends to the texture",
        source: "Mariethoz, Renard and Straubhaar 2010; Gravey and Mariethoz 2020",
        parameters: tile::schema_of_site::<ExemplarParameters>(),
    }
}

/// A texture sampled from a measured residual. Streams: `first`, `places`.
///
/// # Errors
/// Cells that are not the site's; a site with less than 1000 cells of data; first cells too far apart for a periodic tile.
pub fn synthesise(
    measured: &Measured,
    tile: &Tile,
    parameters: &ExemplarParameters,
    streams: &Streams,
) -> Result<Collage, SynthesisError> {
    measured.check(&tile.geometry, NAME)?;
    let site = &measured.residual;
    let spacing = parameters.spacing(measured, tile)?;
    let places: Vec<u32> = (0..site.values.len() as u32).filter(|&k| site.values[k as usize].is_finite()).collect();
    if places.len() < PLACES_MIN {
        let side_m = site.geometry.mean_cell();
        return Err(SynthesisError::FewPlaces { method: NAME, places: places.len(), least: PLACES_MIN, side_m });
    }
    let shape = [tile.geometry.rows, tile.geometry.cols];
    let mut field = Field::new(shape, tile.periodic);
    let mut first = streams.stream("first");
    for row in first_lines(shape[0], spacing, tile.periodic) {
        for col in first_lines(shape[1], spacing, tile.periodic) {
            let source = places[first.below(places.len() as u64) as usize] as usize;
            field.put(row * shape[1] + col, source, site.values[source]);
        }
    }
    drop(places);
    let sampling =
        Sampling { neighbours: parameters.neighbours as usize, scan: parameters.scan as usize, spacing: spacing / 2 };
    let all = vec![true; shape[0] * shape[1]];
    sampling::fill(&mut field, &all, site, sampling, Counter::new(&mut streams.stream("places")));
    Ok(Collage::new(field.heights_m, &field.sources, shape, site))
}

/// Lines of the first cells, a spacing apart, also around the border of a periodic tile: two nearer ones would be unlike, with a step between them.
fn first_lines(side: usize, spacing: usize, periodic: bool) -> impl Iterator<Item = usize> {
    (0..side).step_by(spacing).filter(move |&line| line == 0 || !periodic || line + spacing <= side)
}

#[cfg(test)]
mod tests;
