//! Split-half test of a texture: one half of the site is fitted, and textures from the fit are compared with the other half.
//!
//! The site is cut in two across its longer side. The first half is fitted with an anisotropic model. Textures are normal fields with
//! parameters drawn from the fit's parametric bootstrap (so that the uncertainty of the fit is part of the null), on the second
//! half's grid and mask, after the same moving average. The comparison uses statistics that the fit does not set
//! ([`sastrugi_roughness::unfitted_statistics`]): the distance of the second half from the mean of all members, as the root mean square
//! over a statistic's values, relative for those with a unit. Under the null the half is one more member of the ensemble, so that the
//! share of members at least as far from the mean is an exact p-value whatever the statistic's distribution. Sigma and b are not
//! reported, since the texture was generated with them.
//!
//! Halves of a site differ from each other. Every distance is therefore shown beside the distance of the two halves, and beside the same
//! test with the site split into interleaved blocks, black and white like a chessboard, each set of which contains what differs from half to
//! half. Answers, bounds and p-values do not depend on these.
//!
//! Cost: one fit, and per simulation a refit and two surfaces of half a site of at most two million cells; for the interleaved blocks the
//! same again, with surfaces of the complete site.

use super::surfaces::{Side, case};
use super::verdict::{Finding, Null, decide, overall};
use super::{CompareError, CompareSettings, Comparison, Measure, Quantity, SiteDistances};
use crate::covariance::Covariance;
use crate::covariance::bins::Layout;
use crate::fit::case::Case;
use crate::fit::null_surfaces::NullSurfaces;
use crate::fit::resampling::{self, CELLS_MAX};
use rayon::prelude::*;
use sastrugi_numeric::{Grid, Streams, sums};
use sastrugi_roughness::background::BoxWindow;
use sastrugi_roughness::{Scale, Statistic, unfitted_statistics};

/// Least width of an interleaved block, windows: the residual of half of its cells then has a complete window.
const INTERLEAVED_WINDOWS: usize = 4;
/// Most interleaved blocks along one side.
const INTERLEAVED_ALONG: usize = 8;

/// Compares the textures fitted to one half of a site with its other half.
///
/// # Errors
/// A half that cannot be fitted; too few simulations.
pub fn halves(site: &Grid, settings: &CompareSettings, streams: &Streams) -> Result<Comparison, CompareError> {
    settings.check_simulations()?;
    let examined = middle(site);
    let (one, other) = cut(&examined);
    let Judged { mut quantities, apart, model } =
        judge([&one, &other], ["the fitted half", "the other half"], settings, streams)?;
    let interleaved = interleave(&examined, settings).and_then(|[black, white]| {
        let names = ["the fitted blocks", "the other blocks"];
        judge([&black, &white], names, settings, &streams.child("interleaved")).map_err(|error| error.to_string())
    });
    let (answer, sentence) = overall(&quantities);
    let mut notes = vec![format!(
        "A is a set of textures from the {model} model of the first half, B the second half; sigma and b are not compared, because the \
         textures were generated with them"
    )];
    if examined.values.len() < site.values.len() {
        notes.push(format!("only the central {} x {} cells were compared", examined.rows(), examined.cols()));
    }
    if let Err(reason) = &interleaved {
        notes.push(format!("interleaved blocks were not judged: {reason}"));
    }
    let interleaved = interleaved.ok();
    for (k, quantity) in quantities.iter_mut().enumerate() {
        let interleaved = interleaved.as_ref().and_then(|judged| judged.apart[k]);
        quantity.site = Some(SiteDistances { halves: apart[k], interleaved });
    }
    Ok(Comparison {
        what: "halves",
        quantities,
        interleaved: interleaved.map(|judged| judged.quantities),
        blocks: None,
        answer,
        sentence,
        alpha: settings.parameters().alpha,
        model,
        simulations: settings.parameters().simulations as usize,
        streams: streams.label(),
        notes,
    })
}

/// Textures fitted to one part of a site, judged on another.
struct Judged {
    quantities: Vec<Quantity>,
    /// Distance of the fitted part from the other, by statistic.
    apart: Vec<Option<f64>>,
    /// Covariance model.
    model: String,
}

/// Fits one part, and compares its textures with the other.
fn judge(
    [fitted, judged]: [&Grid; 2],
    names: [&'static str; 2],
    settings: &CompareSettings,
    streams: &Streams,
) -> Result<Judged, CompareError> {
    let (fitted, judged) = (case(names[0], fitted, settings)?, case(names[1], judged, settings)?);
    let bins = fitted.bins_of(Layout::DIRECTIONAL);
    let side = Side::new(names[0], &fitted, &bins, &settings.form)?;
    let parameters = settings.parameters();
    let count = parameters.simulations as usize;
    let fits = resampling::parametric(&side.directions, &side.long, count, &streams.child("fits")).at;
    let coordinates = fitted.coordinates(&side.long.form);
    let surfaces = streams.child("surfaces");
    let mut members: Vec<Vec<Statistic>> = fits
        .par_iter()
        .enumerate()
        .map(|(k, at)| texture_statistics(&judged, &coordinates.decode(at), &surfaces.child(&k.to_string())))
        .collect();
    let [own, site] = [(&fitted, names[0]), (&judged, names[1])].map(|(case, side)| {
        case.residual().map(|residual| statistics(case, residual)).map_err(|error| CompareError::Side { side, error })
    });
    let own = own?;
    members.push(site?);
    let ensembles: Vec<Option<Ensemble>> = (0..own.len()).map(|k| Ensemble::of(&members, k)).collect();
    let finding = |(k, ensemble): (usize, &Option<Ensemble>)| {
        finding(own[k].name, ensemble.as_ref(), &members, k, parameters.equivalence_agreement)
    };
    let findings = ensembles.iter().enumerate().map(finding).collect();
    let apart = |(k, ensemble): (usize, &Option<Ensemble>)| {
        ensemble.as_ref()?.between(&own[k].values, &members.last()?[k].values)
    };
    Ok(Judged {
        quantities: decide(findings, parameters.alpha),
        apart: ensembles.iter().enumerate().map(apart).collect(),
        model: side.long.form.name().to_owned(),
    })
}

/// One statistic over all members: what they have in common.
struct Ensemble {
    scale: Scale,
    /// Values that every member has; a value that any member lacks (an empty class) is left out.
    common: Vec<usize>,
    mean: Vec<f64>,
}

impl Ensemble {
    /// `None` if the members have no value in common.
    fn of(members: &[Vec<Statistic>], k: usize) -> Option<Self> {
        let all: Vec<&[f64]> = members.iter().map(|m| m[k].values.as_slice()).collect();
        let common: Vec<usize> = (0..all[0].len()).filter(|&i| all.iter().all(|v| v[i].is_finite())).collect();
        let mean = common.iter().map(|&i| sums::mean(&all.iter().map(|v| v[i]).collect::<Vec<_>>())).collect();
        (!common.is_empty()).then_some(Self { scale: members[0][k].scale, common, mean })
    }

    fn picked(&self, values: &[f64]) -> Vec<f64> {
        self.common.iter().map(|&i| values[i]).collect()
    }

    /// Distance from the mean.
    fn distance(&self, values: &[f64]) -> f64 {
        self.scale.distance(&self.picked(values), &self.mean, &self.mean)
    }

    /// Distance of two sets of values, on the same scale; `None` if one lacks a value that the members have.
    fn between(&self, a: &[f64], b: &[f64]) -> Option<f64> {
        let distance = self.scale.distance(&self.picked(a), &self.picked(b), &self.mean);
        distance.is_finite().then_some(distance)
    }
}

/// The complete site, or its middle.
fn middle(site: &Grid) -> Grid {
    let share = (2.0 * CELLS_MAX as f64 / site.values.len() as f64).sqrt();
    if share >= 1.0 {
        return site.clone();
    }
    let [rows, cols] = [site.rows(), site.cols()].map(|n| (n as f64 * share) as usize);
    site.window((site.rows() - rows) / 2, (site.cols() - cols) / 2, rows, cols)
}

/// Splits a site across its longer side: west and east, or north and south.
pub(super) fn cut(site: &Grid) -> (Grid, Grid) {
    let (rows, cols) = (site.rows(), site.cols());
    let [width, height] = site.geometry.size();
    match width >= height {
        true => (site.window(0, 0, rows, cols / 2), site.window(0, cols / 2, rows, cols - cols / 2)),
        false => (site.window(0, 0, rows / 2, cols), site.window(rows / 2, 0, rows - rows / 2, cols)),
    }
}

/// The site with its white blocks masked, and with its black ones: a chessboard of at least four blocks, each at least
/// [`INTERLEAVED_WINDOWS`] wide. The reason, if the site is too small.
fn interleave(site: &Grid, settings: &CompareSettings) -> Result<[Grid; 2], String> {
    let window = BoxWindow::nearest(settings.parameters().outer_scale_m, site.geometry.cell).cells();
    let shape = [site.rows(), site.cols()];
    let along = [0, 1].map(|k| (shape[k] / (INTERLEAVED_WINDOWS * window[k])).clamp(1, INTERLEAVED_ALONG));
    if along[0] * along[1] < 4 {
        return Err(format!(
            "the site is smaller than four blocks of {INTERLEAVED_WINDOWS} windows ({} x {} cells) each",
            INTERLEAVED_WINDOWS * window[0],
            INTERLEAVED_WINDOWS * window[1]
        ));
    }
    let colour = |k: usize| {
        let [row, col] = [k / shape[1] * along[0] / shape[0], k % shape[1] * along[1] / shape[1]];
        (row + col) % 2
    };
    Ok([0, 1].map(|own| {
        let values = site.values.iter().enumerate().map(|(k, &z)| if colour(k) == own { z } else { f64::NAN });
        Grid::new(site.geometry, values.collect())
    }))
}

/// Statistics of a texture on the grid and mask of a case.
fn texture_statistics(case: &Case, covariance: &Covariance, streams: &Streams) -> Vec<Statistic> {
    let g = case.geometry;
    let trusted = case.survey.trusted(0..g.rows, 0..g.cols);
    statistics(case, NullSurfaces::new(case, covariance, [g.rows, g.cols], trusted).one(streams).residual)
}

fn statistics(case: &Case, residual: Vec<f64>) -> Vec<Statistic> {
    let lag_max = case.max_lag[0].min(case.max_lag[1]);
    unfitted_statistics(&Grid::new(case.geometry, residual), lag_max)
}

/// One statistic over all members, the last of which is the site.
fn finding(name: &str, ensemble: Option<&Ensemble>, members: &[Vec<Statistic>], k: usize, bound: f64) -> Finding {
    let known = ensemble.ok_or_else(|| format!("too little data for {name}")).map(|ensemble| {
        let mut distances: Vec<f64> = members.iter().map(|m| ensemble.distance(&m[k].values)).collect();
        let site = distances.pop().unwrap_or(f64::NAN);
        (site, Null::distances(distances, 1.0))
    });
    Finding {
        name: name.to_owned(),
        values: [None, None],
        measure: Measure::Distance,
        bound,
        known,
        words: format!("the distance of {name} from that of the textures"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sastrugi_numeric::Geometry;

    /// A site is cut across its longer side, in metres and not in cells, and the odd row or column goes to the second half.
    #[test]
    fn val_sites_are_cut_across_their_longer_side() {
        let numbered = |rows: usize, cols: usize, cell: [f64; 2]| {
            let geometry = Geometry { rows, cols, cell, origin: [0.0; 2] };
            Grid::new(geometry, (0..rows * cols).map(|k| k as f64).collect())
        };
        let (west, east) = cut(&numbered(2, 5, [1.0, 1.0]));
        assert_eq!((west.values, east.values), (vec![0.0, 1.0, 5.0, 6.0], vec![2.0, 3.0, 4.0, 7.0, 8.0, 9.0]));
        // Five columns of 1 m, two rows of 4 m.
        let (north, south) = cut(&numbered(2, 5, [1.0, 4.0]));
        assert_eq!((north.values[4], south.values[0], north.rows(), south.rows()), (4.0, 5.0, 1, 1));
        assert_eq!((north.geometry.origin, south.geometry.origin), ([0.0, 4.0], [0.0, 0.0]));
    }

    /// A window of 3 cells: blocks of at least 12 cells, so that 24 x 50 cells are 2 x 4 blocks. The two grids have every cell once, by the colours
    /// of a chessboard; 20 x 30 cells would be 1 x 2 blocks.
    #[test]
    fn val_interleaved_blocks_are_a_chessboard() {
        let parameters = super::super::CompareParameters { outer_scale_m: 3.0, ..Default::default() };
        let settings = CompareSettings::try_from(parameters).unwrap();
        let site = Grid::filled(Geometry::square(24, 50, 1.0), 1.0);
        let [black, white] = interleave(&site, &settings).unwrap();
        assert!(black.values.iter().zip(&white.values).all(|(a, b)| a.is_finite() != b.is_finite()));
        let at = |r: usize, c: usize| black.at(r, c).is_finite();
        assert!(
            at(0, 0) && at(11, 12) && !at(0, 13) && !at(12, 12) && at(12, 13) && at(0, 25) && !at(0, 49) && at(23, 49)
        );
        let small = Grid::filled(Geometry::square(20, 30, 1.0), 1.0);
        assert!(interleave(&small, &settings).unwrap_err().contains("12 x 12 cells"));
    }
}
