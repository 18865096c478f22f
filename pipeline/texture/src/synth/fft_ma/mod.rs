//! FFT moving average: a random field from the square root of its spectrum.
//!
//! `z = IDFT[ sqrt(lambda M) Q ]`, `lambda = DFT(C)` the spectrum of the covariance C on a torus of M cells, every lag
//! taken the shorter way around, and Q random with `Q(-k)` the conjugate of `Q(k)`:
//! * `phase = "unit"`: `Q = exp(i theta)`, theta uniform (\[P\], section 3.3). The covariance of the field on the torus,
//!   `1 / M * sum of z(i) z(i + h)`, is C(h) in every realisation.
//! * `phase = "gaussian"`: Q complex normal. The field is normal, and its covariance is C only on average.
//!
//! Source: \[P\] = Vecherin et al. 2022, Eqs. 11 and 12; Oliver 1995, Mathematical Geology 27, 939. Departures from \[P\]:
//! * the spectrum is the DFT of the covariance, not Eq. 10 sampled: Eq. 10 lacks a factor 2 pi under the paper's own
//!   Eqs. 8 and 11, and sampled at the wavenumbers of a grid it loses 2 to 10 % of the variance;
//! * the mean over the tile is not removed: the mode at k = 0 belongs to the covariance.
//!
//! `spectrum = "eq10"` uses that equation (with its 2 pi) for comparison: isotropic exponentials only, and the
//! loss of variance is reported.
//!
//! Supports covariances of any model, sums, nugget, anisotropy at any azimuth, oblong cells. A self-affine covariance is replaced by
//! its stationary counterpart (see [`super::tile`]).
//!
//! A covariance truncated to a torus may have negative eigenvalues (none found for an exponential on a side of 14 ranges or more;
//! at 10 ranges 2e-6 on 400 cells, 2e-5 on 2000). They are set to 0 if they are at most [`CLIP_SHARE_MAX`] of the
//! spectrum; the largest error of the covariance, at lag 0, is then their sum over M, and is reported.
//! Otherwise `periodic = true` is refused.
//!
//! `periodic = true`: the tile is the torus and repeats without seams. `periodic = false`: the field is cropped from a torus
//! at least twice as wide (so that no lag within the crop wraps around) and wide enough for the covariance
//! ([`super::reach`]: 16 ranges of an exponential). If more than [`CLIP_SHARE_MAX`] is negative there, the sides are enlarged by a
//! half, up to three times and to no more cells than a texture may have (Wood and Chan 1994, J. Comput. Graph. Stat. 3, 409; Dietrich and
//! Newsam 1997, SIAM J. Sci. Comput. 18, 1088). That happens if the axes of anisotropy are oblique to the grid's and the
//! cells fine: C(x, y) differs from C(-x, y), so that the covariance jumps half way around, and the spectrum of a jump falls more slowly than
//! its own. Measured for Matern smoothness 0.3 to 1, ratios 0.05 to 0.84 and up to 120 cells to a range: up to 1.7e-4 is negative on the
//! first torus, and at most 1.2e-7 on the second.
//!
//! Unit phases are exact only on the complete torus. Crops scatter like any sample, and the spread over an ensemble of
//! unit-phase tiles is too small: Monte Carlo work needs `gaussian`.
//!
//! The spectrum of what a background lacks, or of a measured covariance, is `lambda` itself, computed once for each texture on cells no larger than the fit's.
//! `periodic = true`: the tile is the torus. `periodic = false`: the torus is at least twice as wide as the tile, and as two windows of the
//! background or twice the measured lags, whatever the range of the model. What a background lacks is not confined to the window: a spectrum that falls as
//! `k^-(2 + 2 nu)`, times `1 - D^2 ~ k^2`, leaves a correlation that falls as `h^-(2 - 2 nu)` (nu < 1) up to the range b, and as the model beyond. Of an exponential with b of 20
//! windows 9.5 % of the variance are left at 1.5 windows, 2.7 % at 4 and 0.8 % at 8, with b of 0.56 windows 1.9, 0.03 and 0.00003 %. A torus of a crop and 1.5
//! windows, the reach of a measured covariance, would give the longest lags of the crop errors of 2 to 7 % of the variance
//! (`val_what_a_background_lacks_reaches_beyond_the_window`).
//!
//! Cost: a quarter of a complex transform for the spectrum (half of one if the axes of anisotropy are not the grid's),
//! half of one for the field, a square root and a phase per mode. For what a background lacks or a measured covariance: half a transform of the finer cells for
//! each of measured covariance and model. If the model reaches across the torus, 81 aliases for each mode that takes it instead of its transform: all modes if the
//! covariance is a model's, long waves if it was measured. Textures whose sides are no product of 2, 3 and 5 take up to twice as long.
//!
//! Peak memory per torus cell: 10 bytes, 2 for a quarter of the spectrum and 8 for the field, which is transformed in place; 16 if the axes
//! of anisotropy are not the grid's, while both the covariance (8) and its half transform (8) are held. Including thread buffers, 175 MB
//! were measured for 4096 x 4096 cells, 10.4 bytes each. A cost states 18 for both, which leaves room for those buffers on small tori, and 8
//! more for each cell of the tile (`tests/memory.rs`). The spectrum of what a background lacks, or of a measured covariance, takes 24 bytes for each
//! finer cell while it is computed, for which a cost states 40, and 4 for each torus cell for as long as the texture exists.

mod aim;
mod spectrum;

use super::tile::{self, CELLS_MAX, Tile, TileParameters};
use super::{Cost, Kernel, Made, MethodParameters, Prospect, SynthesisError, Texture, Wanted, reach};
use crate::covariance::Covariance;
use crate::covariance::empirical::Purpose;
use aim::{Aim, Aimed, Lattice};
use rayon::prelude::*;
use sastrugi_numeric::fft::{Complex64, HalfSpectrum, RealFft2, is_smooth, smooth_length};
use sastrugi_numeric::{Geometry, Grid, Stream, Streams, sums, turns};
use sastrugi_schemas::{Kind, ParameterError};
use schemars::{JsonSchema, Schema};
use serde::{Deserialize, Serialize};
use spectrum::Spectrum;
use std::borrow::Cow;

/// Largest negative share of the spectrum that is set to 0; more is refused.
pub const CLIP_SHARE_MAX: f64 = 1e-6;
/// Factor on both sides of a torus on which more of the spectrum is negative.
const ENLARGEMENT: f64 = 1.5;
/// Most cells of an enlarged torus, relative to the first: three enlargements.
const ENLARGED_CELLS: f64 = 16.0;
/// Most cells of a torus whose spectrum is computed just to state the cost; a plan does so for every value of a sweep.
const TRIED_CELLS_MAX: usize = 1 << 18;
/// Width of a tile, in ranges, below which it is noted.
const TILE_RANGES_NOTE: f64 = 4.0;
/// Note on a texture of a measured covariance whose long waves, and with them its relief, are those of a model.
pub const MOSTLY_EXTRAPOLATED: &str = "most of the variance comes from the model, at wavelengths that the background removed, and was not measured: add a \
     texture with covariance = \"residual\" to a measured background instead";
/// Share of the variance extrapolated by the model above which it is noted.
const CONTINUED_SHARE_NOTE: f64 = 0.5;
/// Bytes per torus cell during the synthesis of a field: an upper bound of the 10 or 16 of the module header.
const BYTES_PER_CELL: u64 = 18;

/// The same for each cell on which the spectrum of a residual or of a measured covariance is computed.
const AIM_BYTES_PER_CELL: u64 = 40;

/// Random part of the spectrum.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Phase {
    /// Unit magnitude, uniform phase: the covariance is exact in every realisation of a tile.
    #[default]
    Unit,
    /// Complex normal: the covariance is exact on average.
    Gaussian,
}

/// Source of the eigenvalues.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum SpectrumOf {
    /// Transform of the covariance on the torus: exact.
    #[default]
    Covariance,
    /// Vecherin et al. 2022, Eq. 10 at the wavenumbers of the torus: loses 2 to 10 % of the variance.
    Eq10,
}

/// Base for which a texture is made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum CovarianceOf {
    /// For level or synthetic ground, or no base.
    #[default]
    Surface,
    /// For a measured background.
    Residual,
}

/// The default depends on the base of the texture; the description tells how.
pub(super) fn without_default(schema: &mut Schema) {
    schema.remove("default");
}

/// Raw parameters of an FFT-MA texture, without those of its tile.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct FftMaParameters {
    /// `unit` (default, Vecherin et al. 2022, section 3.3) or `gaussian`.
    pub phase: Phase,
    /// Whether the texture repeats without seams. Default true.
    pub periodic: bool,
    /// `covariance` (default) or `eq10` (the published spectrum of an isotropic exponential, which loses variance).
    pub spectrum: SpectrumOf,
    /// Base that the texture is for: with `surface`, for level or synthetic ground, it has the covariance of the fit; with `residual`, for a measured
    /// background, the part of it that a moving average over the fit's window lacks, so that background and texture together have that covariance.
    /// Default: `residual` on a measured DEM or the background of a fit, otherwise `surface`.
    #[schemars(transform = without_default)]
    pub covariance: CovarianceOf,
}

impl Default for FftMaParameters {
    fn default() -> Self {
        Self { phase: Phase::Unit, periodic: true, spectrum: SpectrumOf::Covariance, covariance: CovarianceOf::Surface }
    }
}

/// FFT-MA with checked parameters.
pub struct FftMa {
    parameters: FftMaParameters,
    covariance: Covariance,
    /// The target on the torus, if it is not the model of the surface.
    aimed: Option<Aimed>,
    tile: Geometry,
    /// Rows and columns of the torus, or of the first that is tried.
    torus: [usize; 2],
}

/// Registry entry.
pub fn kind() -> Kind {
    Kind {
        family: "texture",
        kind: FftMaParameters::NAME,
        summary: "random field from the square root of its spectrum; periodic, exact on the torus with unit phases",
        source: "Vecherin et al. 2022, Eqs. 11-12; Oliver 1995",
        parameters: tile::schema::<FftMaParameters>(),
    }
}

/// The texture of a covariance.
///
/// # Errors
/// Parameters out of range.
pub fn texture(
    of_tile: TileParameters,
    own: &FftMaParameters,
    covariance: Covariance,
) -> Result<Texture<FftMa>, ParameterError> {
    let tile = Tile::check(of_tile, own.periodic)?;
    own.check(&tile)?;
    Texture::new(&tile, own, covariance.into())
}

impl MethodParameters for FftMaParameters {
    const NAME: &'static str = "fft_ma";
    type Kernel = FftMa;

    fn is_periodic(&self) -> bool {
        self.periodic
    }

    fn check(&self, tile: &Tile) -> Result<(), ParameterError> {
        if self.spectrum == SpectrumOf::Eq10 && self.covariance == CovarianceOf::Residual {
            return Err(not_of_a_surface());
        }
        if self.spectrum == SpectrumOf::Eq10 && tile.stated_ratio().is_some_and(|ratio| ratio != 1.0) {
            return Err(ParameterError::new("spectrum", "is `eq10`, which is isotropic; remove `ratio`"));
        }
        let cells = self.torus_of_any(tile).map(|n| n as f64);
        if cells[0] * cells[1] > CELLS_MAX as f64 {
            let message = format!(
                "is false, which needs a torus of {:.1e} cells; the limit is {CELLS_MAX}: use larger cells or a smaller texture",
                cells[0] * cells[1]
            );
            return Err(ParameterError::new("periodic", message));
        }
        Ok(())
    }

    fn cost(&self, tile: &Tile) -> Cost {
        // As for a measured covariance or a residual, which costs most.
        cost(self.rounded(self.enough(tile, [0.0; 2])), tile.geometry.len(), Some([1, 1]))
    }

    fn cost_of(&self, tile: &Tile, prospect: &Prospect) -> Cost {
        let cells = tile.geometry.len();
        let within = |sides: [f64; 2], oversampling: f64| oversampling * sides[0] * sides[1] <= CELLS_MAX as f64;
        if let Some(lattice) = Lattice::planned(prospect, self.purpose(), tile.geometry.cell) {
            let sides = self.enough(tile, lattice.torus_m(tile.geometry.cell));
            return match within(sides, lattice.oversampling()) {
                true => cost(self.rounded(sides), cells, Some(lattice.times)),
                // Refused when it is bound to its fit.
                false => self.cost(tile),
            };
        }
        let (least, sides) = (self.enough(tile, [0.0; 2]), self.enough(tile, [prospect.torus_m; 2]));
        let memory_bytes = match within(sides, 1.0) {
            true => cost(self.rounded(sides), cells, None).memory_bytes,
            // A larger torus would be refused.
            false => BYTES_PER_CELL * CELLS_MAX + 8 * cells as u64,
        };
        Cost {
            memory_bytes: memory_bytes.max(self.cost(tile).memory_bytes),
            // Time is estimated for the usual, shorter range.
            operations: cost(self.rounded(least), cells, None).operations,
        }
    }

    fn check_measured(&self, tile: &Tile, measured_m: [f64; 2]) -> Result<(), ParameterError> {
        aim::multiples(tile.geometry.cell, measured_m).map(drop)
    }

    /// Refuses Eq. 10 for anything but an isotropic exponential, a residual if the fit has no window, and cells that are not
    /// multiples of the measured ones.
    fn kernel(&self, tile: &Tile, wanted: &Covariance, fitted: &Wanted) -> Result<FftMa, ParameterError> {
        let aim = Aim::of(fitted, self.purpose(), tile.geometry.cell)?;
        if self.spectrum == SpectrumOf::Eq10 && aim.is_some() {
            return Err(not_of_a_surface());
        }
        if fitted.map.is_some() && tile.turns() {
            let message = "cannot be set: the fit's covariance is empirical and keeps its measured direction";
            return Err(ParameterError::new("azimuth_deg", message));
        }
        if self.spectrum == SpectrumOf::Eq10 && !is_plain_exponential(wanted) {
            let message = "is `eq10`, which needs an isotropic exponential fit without nugget; use `covariance`";
            return Err(ParameterError::new("spectrum", message));
        }
        if let Some(aim) = aim.as_ref().filter(|_| self.periodic) {
            aim.check_tile(&tile.geometry)?;
        }
        let torus = self.torus(tile, wanted, aim.as_ref().map(Aim::lattice))?;
        let aimed = aim.map(|aim| aim.on_torus(wanted, torus, tile.geometry.cell));
        Ok(FftMa { parameters: self.clone(), covariance: wanted.clone(), aimed, tile: tile.geometry, torus })
    }
}

impl FftMaParameters {
    fn purpose(&self) -> Purpose {
        match self.covariance {
            CovarianceOf::Surface => Purpose::Surface,
            CovarianceOf::Residual => Purpose::Residual,
        }
    }

    /// Rows and columns of the smallest torus for a tile, whatever the covariance.
    fn torus_of_any(&self, tile: &Tile) -> [usize; 2] {
        let least = [tile.geometry.rows, tile.geometry.cols];
        if self.periodic { least } else { least.map(|n| 2 * n) }
    }

    /// Fewest rows and columns of the torus for a tile, for a covariance that needs a torus of `least_m`, east-west and north-south.
    fn enough(&self, tile: &Tile, [width_m, height_m]: [f64; 2]) -> [f64; 2] {
        let ([dx, dy], [rows, cols]) = (tile.geometry.cell, self.torus_of_any(tile).map(|n| n as f64));
        [(rows, height_m, dy), (cols, width_m, dx)].map(|(n, side_m, cell_m)| match self.periodic {
            true => n,
            false => n.max((side_m / cell_m).ceil()),
        })
    }

    /// Rows and columns of the torus of which these are enough: a periodic tile, or lengths that transform fast.
    fn rounded(&self, enough: [f64; 2]) -> [usize; 2] {
        enough.map(|n| if self.periodic { n as usize } else { smooth_length(n as usize) })
    }

    /// Rows and columns of the torus for a tile with a given covariance.
    fn torus(&self, tile: &Tile, wanted: &Covariance, aim: Option<Lattice>) -> Result<[usize; 2], ParameterError> {
        let least_m = aim.map_or_else(|| reach::torus_m(wanted), |lattice| lattice.torus_m(tile.geometry.cell));
        let enough = self.enough(tile, least_m);
        let cells = aim.map_or(1.0, |lattice| lattice.oversampling()) * enough[0] * enough[1];
        if cells > CELLS_MAX as f64 {
            let (whose, advice) = match aim {
                // The range of a fit may be the bound of its search.
                None => (
                    format!("for which the range of {:.4} m", wanted.range_m()),
                    "use larger cells, a shorter range or, with a fit, `covariance = \"residual\"`, whose waves end at its window",
                ),
                Some(_) => ("which".to_owned(), "use larger cells or a smaller texture"),
            };
            let needed = format!("needs a torus of {cells:.1e} cells; the limit is {CELLS_MAX}");
            return Err(ParameterError::new("periodic", format!("is false, {whose} {needed}: {advice}")));
        }
        Ok(self.rounded(enough))
    }
}

/// The error for Eq. 10 with a residual or a measured covariance.
fn not_of_a_surface() -> ParameterError {
    ParameterError::new("spectrum", "is `eq10`, which supports only the exponential covariance of a surface")
}

/// Cost of a tile from a torus of `[rows, cols]`; with `times`, for the spectrum of a residual or of a measured covariance on cells so much finer,
/// north-south and east-west.
fn cost([rows, cols]: [usize; 2], tile: usize, times: Option<[usize; 2]>) -> Cost {
    /// Operations for covariance, root and phase of one cell.
    const PER_CELL: f64 = 60.0;
    /// Operations for rings, responses and folding of one fine cell.
    const PER_FINE_CELL: f64 = 80.0;
    let torus = rows * cols;
    let (fine, spectrum) = match times {
        None => (0, 0.0),
        Some([down, across]) => {
            let shape = [down * rows, across * cols];
            let fine = shape[0] * shape[1];
            // The measured covariance is transformed, and usually that of the model.
            (fine, fine as f64 * (5.0 * octaves(shape) + PER_FINE_CELL))
        }
    };
    Cost {
        memory_bytes: BYTES_PER_CELL * torus as u64 + AIM_BYTES_PER_CELL * fine as u64 + 8 * tile as u64,
        operations: torus as f64 * (3.75 * octaves([rows, cols]) + PER_CELL) + spectrum,
    }
}

/// Base-2 logarithm of the number of cells, to which the operations of a transform of one cell are proportional, and more for sides that are no product of 2, 3
/// and 5: their transform takes two of a length at least twice as long (Bluestein).
fn octaves([rows, cols]: [usize; 2]) -> f64 {
    /// Time of one operation of those two, relative to the others of a texture. Measured: tori of 2252 and 2027 cells take 0.15 to 0.3 s longer than
    /// tori of 2048.
    const RELATIVE_TIME: f64 = 0.35;
    let more = |n: usize| {
        if is_smooth(n) {
            return 0.0;
        }
        let padded = smooth_length(2 * n - 1) as f64;
        RELATIVE_TIME * (2.0 * padded / n as f64 * libm::log2(padded) - libm::log2(n as f64))
    };
    libm::log2((rows * cols) as f64) + (more(rows) + more(cols))
}

impl FftMa {
    /// The spectrum on a torus of `[rows, cols]`; that of a residual or of a measured covariance is known on one torus only.
    fn spectrum(&self, torus: [usize; 2]) -> Cow<'_, Spectrum> {
        let term = &self.covariance.structures[0];
        match (self.parameters.spectrum, &self.aimed) {
            (SpectrumOf::Covariance, Some(aimed)) => Cow::Borrowed(&aimed.spectrum),
            (SpectrumOf::Covariance, None) => Cow::Owned(Spectrum::of(&self.covariance, torus, self.tile.cell)),
            (SpectrumOf::Eq10, _) => Cow::Owned(Spectrum::eq10(term.sigma_m, term.range_m, torus, self.tile.cell)),
        }
    }

    /// A torus with its south-west corner as the origin.
    fn geometry_of(&self, [rows, cols]: [usize; 2]) -> Geometry {
        Geometry { rows, cols, ..self.tile }
    }

    /// The smallest torus tried on which the covariance is positive definite, and the spectrum there.
    ///
    /// # Errors
    /// A periodic tile on which it is not; none of the sizes tried.
    fn embedding(&self) -> Result<([usize; 2], Cow<'_, Spectrum>), SynthesisError> {
        let mut torus = self.torus;
        loop {
            let spectrum = self.spectrum(torus);
            let clip_share = spectrum.negative_share();
            if clip_share <= CLIP_SHARE_MAX {
                return Ok((torus, spectrum));
            }
            // Freed before the next, larger one.
            drop(spectrum);
            torus = self.larger(torus).ok_or_else(|| self.refusal(torus, clip_share))?;
        }
    }

    /// The next torus to try, if there is one.
    fn larger(&self, torus: [usize; 2]) -> Option<[usize; 2]> {
        let larger = torus.map(|n| smooth_length((ENLARGEMENT * n as f64).ceil() as usize));
        let cells = |[rows, cols]: [usize; 2]| rows as f64 * cols as f64;
        let most = (ENLARGED_CELLS * cells(self.torus)).min(CELLS_MAX as f64);
        (!self.parameters.periodic && self.aimed.is_none() && cells(larger) <= most).then_some(larger)
    }

    /// The torus to state the cost for. A small one is tried; a larger one with an oblique covariance is assumed to be enlarged once.
    fn expected_torus(&self) -> [usize; 2] {
        let is_oblique = spectrum::is_oblique(&self.covariance);
        let Some(larger) = self.larger(self.torus).filter(|_| is_oblique) else { return self.torus };
        let is_small = self.torus[0] * self.torus[1] <= TRIED_CELLS_MAX;
        match is_small && self.spectrum(self.torus).negative_share() <= CLIP_SHARE_MAX {
            true => self.torus,
            false => larger,
        }
    }

    /// Notes on a residual or measured covariance.
    fn aim_notes(&self) -> Vec<String> {
        let Some(Aimed { spectrum, shares, .. }) = &self.aimed else { return Vec::new() };
        let rms_m = (spectrum.total() / (self.torus[0] * self.torus[1]) as f64).sqrt();
        let of = match self.parameters.covariance {
            CovarianceOf::Surface => "the surface",
            CovarianceOf::Residual => "the part of the surface that a background over the fit's window lacks",
        };
        let mut notes = vec![format!("covariance of {of}: RMS {rms_m:.3e} m")];
        if let Some(shares) = shares {
            notes.push(format!(
                "measured covariance: {:.2} % of its spectrum was negative and set to 0, {:.1} % of the variance is extrapolated by \
                 the model",
                100.0 * shares.clipped,
                100.0 * shares.continued
            ));
            if shares.continued > CONTINUED_SHARE_NOTE {
                notes.push(MOSTLY_EXTRAPOLATED.to_owned());
            }
        }
        notes
    }

    fn refusal(&self, torus: [usize; 2], clip_share: f64) -> SynthesisError {
        let (limit, [width_m, height_m]) = (CLIP_SHARE_MAX, self.geometry_of(torus).size());
        if !self.parameters.periodic {
            let size_m = self.tile.size();
            return SynthesisError::NoTorus { size_m, torus_m: [width_m, height_m], clip_share, limit };
        }
        // A tile of this size may be refused already.
        let mut needed_m = reach::torus_m(&self.covariance).into_iter().fold(0.0, f64::max);
        while needed_m <= width_m.min(height_m) {
            needed_m *= ENLARGEMENT;
        }
        SynthesisError::NegativeSpectrum { width_m, height_m, clip_share, limit, needed_m }
    }
}

fn is_plain_exponential(covariance: &Covariance) -> bool {
    let exponential = |name: &str| name == "exponential";
    let [term] = &covariance.structures[..] else { return false };
    exponential(term.model.kind().kind) && covariance.is_isotropic() && covariance.nugget_m2 == 0.0
}

/// Notes on cells that are too coarse and tiles that are too small for the covariance.
pub(super) fn size_notes(covariance: &Covariance, tile: &Geometry, periodic: bool) -> Vec<String> {
    let ranges = reach::extent(covariance).map(|e| super::tidy(e * covariance.range_m()));
    let ([dx, dy], [width_m, height_m]) = (tile.cell, tile.size());
    let mut notes = Vec::new();
    if let Some((cell_m, range_m)) = [(dx, ranges[0]), (dy, ranges[1])].into_iter().find(|(c, b)| *c > 0.5 * b) {
        notes.push(format!(
            "the cell of {cell_m} m is more than half the range of {range_m} m: most of the texture is smaller than a cell"
        ));
    }
    let narrow = |(side, range): &(f64, f64)| *side < TILE_RANGES_NOTE * range;
    if let Some((_, range_m)) = [(width_m, ranges[0]), (height_m, ranges[1])].into_iter().find(narrow)
        && periodic
    {
        notes.push(format!("the tile of {width_m} m x {height_m} m is less than four ranges of {range_m} m wide"));
    }
    notes
}

impl Kernel for FftMa {
    fn cost(&self) -> Cost {
        cost(self.expected_torus(), self.tile.len(), self.aimed.as_ref().map(|aimed| aimed.lattice.times))
    }

    fn notes(&self) -> Vec<String> {
        let FftMaParameters { phase, periodic, spectrum, .. } = self.parameters;
        let mut notes =
            if self.aimed.is_none() { size_notes(&self.covariance, &self.tile, periodic) } else { Vec::new() };
        if !periodic && phase == Phase::Unit {
            notes.push(
                "unit phases are exact only on the complete torus; the covariance of this crop scatters between realisations".to_owned(),
            );
        }
        notes.extend(self.aim_notes());
        if spectrum == SpectrumOf::Eq10 {
            let made_m2 = self.spectrum(self.torus).total() / (self.torus[0] * self.torus[1]) as f64;
            let share = 100.0 * made_m2 / self.covariance.at_distance(0.0);
            notes.push(format!(
                "Eq. 10 of the paper (with its missing factor 2 pi) on this grid gives {share:.1} % of the variance"
            ));
        }
        notes
    }

    fn achieved(&self) -> Box<dyn Fn([f64; 2]) -> f64 + '_> {
        if self.parameters.spectrum == SpectrumOf::Covariance && self.aimed.is_none() {
            return Box::new(|lag_m| self.covariance.at(lag_m));
        }
        let ([rows, cols], [dx, dy]) = (self.torus, self.tile.cell);
        let covariance = self.spectrum(self.torus).covariance();
        let cell = |lag: f64, side: f64, n: usize| ((lag / side).round() as isize).rem_euclid(n as isize) as usize;
        Box::new(move |[x, y]| covariance[cell(y, dy, rows) * cols + cell(x, dx, cols)])
    }

    fn aims_at_a_model(&self) -> bool {
        self.aimed.is_none()
    }

    fn make(&self, streams: &Streams) -> Result<Made, SynthesisError> {
        let (torus, spectrum) = self.embedding()?;
        let ([rows, cols], clip_share) = (torus, spectrum.negative_share());
        let cells = (rows * cols) as f64;
        let exact = self.parameters.spectrum == SpectrumOf::Covariance;
        let covariance_error_max_m2 = exact.then(|| spectrum.negative() / cells);
        let amplitudes = spectrum.into_owned().amplitudes();
        let field = RealFft2::new(rows, cols).inverse_of(|kx, column| {
            random_column(kx, cols, |ky| amplitudes.at(kx, ky), self.parameters.phase, streams, column);
        });
        let heights_m = match self.parameters.periodic {
            true => field,
            false => Grid::new(self.geometry_of(torus), field).window(0, 0, self.tile.rows, self.tile.cols).values,
        };
        Ok(Made { heights_m, covariance_error_max_m2, clip_share })
    }
}

/// Spectrum of a field on a torus of `[rows, cols]`: `amplitude(kx, ky) Q` on the stored half, the amplitude being
/// `sqrt(lambda M)`. One stream per column of modes.
pub(crate) fn random_spectrum(
    [rows, cols]: [usize; 2],
    amplitude: impl Fn(usize, usize) -> f64 + Sync,
    phase: Phase,
    streams: &Streams,
) -> HalfSpectrum {
    let mut half = HalfSpectrum { rows, cols, values: vec![Complex64::default(); (cols / 2 + 1) * rows] };
    half.values.par_chunks_mut(rows).enumerate().for_each(|(kx, column)| {
        random_column(kx, cols, |ky| amplitude(kx, ky), phase, streams, column);
    });
    half
}

/// Column `kx` of such a spectrum with `cols` columns.
pub(crate) fn random_column(
    kx: usize,
    cols: usize,
    amplitude: impl Fn(usize) -> f64,
    phase: Phase,
    streams: &Streams,
    column: &mut [Complex64],
) {
    let mut stream = streams.stream(&format!("modes-{kx}"));
    match kx == 0 || 2 * kx == cols {
        true => fill_conjugate_column(column, phase, &mut stream),
        false => phase.fill(column, &mut stream),
    }
    column.iter_mut().enumerate().for_each(|(ky, q)| *q *= amplitude(ky));
}

/// Fills a column of Q that is its own conjugate mirror image: `Q(-ky)` is the conjugate of `Q(ky)`.
fn fill_conjugate_column(column: &mut [Complex64], phase: Phase, stream: &mut Stream) {
    let rows = column.len();
    for ky in 0..=rows / 2 {
        let own = ky == 0 || 2 * ky == rows;
        column[ky] = if own { Complex64::new(phase.draw_real(stream), 0.0) } else { phase.draw(stream) };
        column[(rows - ky) % rows] = column[ky].conj();
    }
}

impl Phase {
    /// Draws Q of a mode that has a conjugate partner; mean square 1.
    fn draw(self, stream: &mut Stream) -> Complex64 {
        let mut one = [Complex64::default()];
        self.fill(&mut one, stream);
        one[0]
    }

    /// Draws Q for many modes.
    fn fill(self, modes: &mut [Complex64], stream: &mut Stream) {
        match self {
            Self::Unit => fill_unit(modes, stream),
            Self::Gaussian => fill_gaussian(modes, stream),
        }
    }

    /// Draws Q of a mode that is its own conjugate; mean square 1.
    fn draw_real(self, stream: &mut Stream) -> f64 {
        match self {
            Self::Unit => 1.0 - 2.0 * (stream.bits() >> 63) as f64,
            Self::Gaussian => stream.normal(),
        }
    }
}

/// Number of modes drawn at once.
const RUN: usize = 64;

/// `exp(2 pi i u)`, u uniform.
fn fill_unit(modes: &mut [Complex64], stream: &mut Stream) {
    let [mut turns, mut sin, mut cos] = [[0.0; RUN]; 3];
    for run in modes.chunks_mut(RUN) {
        let (turns, sin, cos) = (&mut turns[..run.len()], &mut sin[..run.len()], &mut cos[..run.len()]);
        stream.fill_uniform(turns);
        turns::sincos_each(turns, sin, cos);
        run.iter_mut().zip(sin.iter().zip(cos.iter())).for_each(|(q, (sin, cos))| *q = Complex64::new(*cos, *sin));
    }
}

/// `sqrt(-ln(1 - u)) exp(2 pi i v)`, u and v uniform (Box and Muller 1958).
fn fill_gaussian(modes: &mut [Complex64], stream: &mut Stream) {
    let (mut draws, [mut turns, mut sin, mut cos]) = ([0.0; 2 * RUN], [[0.0; RUN]; 3]);
    for run in modes.chunks_mut(RUN) {
        let (turns, sin, cos) = (&mut turns[..run.len()], &mut sin[..run.len()], &mut cos[..run.len()]);
        let draws = &mut draws[..2 * run.len()];
        stream.fill_uniform(draws);
        let pairs = draws.as_chunks::<2>().0;
        turns.iter_mut().zip(pairs).for_each(|(turn, [_, v])| *turn = *v);
        turns::sincos_each(turns, sin, cos);
        for (((q, [u, _]), sin), cos) in run.iter_mut().zip(pairs).zip(sin.iter()).zip(cos.iter()) {
            // 1 - u lies in (0, 1], so the logarithm is finite.
            *q = Complex64::new(*cos, *sin) * (-libm::log(1.0 - u)).sqrt();
        }
    }
}

/// Covariance of a field on its torus, `1 / M * sum of z(i) z(i + h)` about zero, for every lag `h` (row-major, lag 0
/// first).
pub fn torus_covariance(field: &Grid) -> Vec<f64> {
    let fft = RealFft2::new(field.rows(), field.cols());
    let mut spectrum = fft.forward(&field.values);
    let cells = field.values.len() as f64;
    spectrum.values.iter_mut().for_each(|v| *v = Complex64::new(v.norm_sqr() / cells, 0.0));
    fft.inverse(spectrum)
}

#[cfg(test)]
mod tests;
