//! Split-half test of a texture: one half of the site is fitted, and textures from the fit are compared with the other half.
//!
//! The site is cut in two across its longer side. The first half is fitted with an anisotropic model. Textures are normal fields with
//! parameters drawn from the fit's parametric bootstrap (so that the uncertainty of the fit is part of the null), on the second
//! half's grid and mask, after the same moving average. The comparison uses statistics that the fit does not set
//! ([`sastrugi_roughness::unfitted_statistics`]): the distance of the second half from the mean of all members, as the root mean square
//! over a statistic's values, relative for those with a unit. Under the null the half is one more member of the ensemble, so that the
//! share of members at least as far from the mean is an exact p-value whatever the statistic's distribution. Sigma and b are not
//! reported, since the texture was given them.
//!
//! Cost: one fit, and per simulation a refit and two surfaces of half a site of at most two million cells.

use super::surfaces::{Side, case};
use super::verdict::{Finding, Null, decide, overall};
use super::{CompareError, CompareSettings, Comparison, Measure};
use crate::covariance::Covariance;
use crate::covariance::bins::Layout;
use crate::fit::case::Case;
use crate::fit::null_surfaces::NullSurfaces;
use crate::fit::resampling::{self, CELLS_MAX};
use rayon::prelude::*;
use sastrugi_numeric::{Grid, Streams, sums};
use sastrugi_roughness::{Statistic, unfitted_statistics};

/// Compares the textures fitted to one half of a site with its other half.
///
/// # Errors
/// A half that cannot be fitted.
pub fn halves(site: &Grid, settings: &CompareSettings, streams: &Streams) -> Result<Comparison, CompareError> {
    let examined = middle(site);
    let (one, other) = cut(&examined);
    let (fitted, judged) = (case("the fitted half", &one, settings)?, case("the other half", &other, settings)?);
    let bins = fitted.bins_of(Layout::DIRECTIONAL);
    let side = Side::new("the fitted half", &fitted, &bins, &settings.form)?;
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
    let residual = judged.residual().map_err(|error| CompareError::Side { side: "the other half", error })?;
    members.push(statistics(&judged, residual));
    let findings = (0..members[0].len()).map(|k| finding(&members, k, parameters.equivalence_agreement)).collect();
    let quantities = decide(findings, parameters.alpha);
    let (answer, sentence) = overall(&quantities);
    let mut notes = vec![format!(
        "A denotes textures of the first half's {} model, B the second half; sigma and b are not compared, since the textures were \
         given them",
        side.long.form.name()
    )];
    if examined.values.len() < site.values.len() {
        notes.push(format!("only the middle {} x {} cells were compared", examined.rows(), examined.cols()));
    }
    Ok(Comparison {
        what: "halves",
        quantities,
        answer,
        sentence,
        alpha: parameters.alpha,
        model: side.long.form.name().to_owned(),
        simulations: count,
        streams: streams.label(),
        notes,
    })
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
fn cut(site: &Grid) -> (Grid, Grid) {
    let (rows, cols) = (site.rows(), site.cols());
    let [width, height] = site.geometry.size();
    match width >= height {
        true => (site.window(0, 0, rows, cols / 2), site.window(0, cols / 2, rows, cols - cols / 2)),
        false => (site.window(0, 0, rows / 2, cols), site.window(rows / 2, 0, rows - rows / 2, cols)),
    }
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
fn finding(members: &[Vec<Statistic>], k: usize, bound: f64) -> Finding {
    let Statistic { name, has_unit, .. } = members[0][k];
    let all: Vec<&[f64]> = members.iter().map(|m| m[k].values.as_slice()).collect();
    // Values that any member lacks (an empty class) are left out.
    let common: Vec<usize> = (0..all[0].len()).filter(|&i| all.iter().all(|v| v[i].is_finite())).collect();
    let known = if common.is_empty() {
        Err(format!("too little data for {name}"))
    } else {
        let means: Vec<f64> =
            common.iter().map(|&i| sums::mean(&all.iter().map(|v| v[i]).collect::<Vec<_>>())).collect();
        let size = if has_unit { root_mean_square(&means) } else { 1.0 };
        let mut distances: Vec<f64> = all
            .iter()
            .map(|v| root_mean_square(&common.iter().zip(&means).map(|(&i, m)| (v[i] - m) / size).collect::<Vec<_>>()))
            .collect();
        let site = distances.pop().unwrap_or(f64::NAN);
        Ok((site, Null::distances(distances, 1.0)))
    };
    Finding {
        name: name.to_owned(),
        values: [None, None],
        measure: Measure::Distance,
        bound,
        known,
        words: format!("the distance of {name} from that of the textures"),
    }
}

fn root_mean_square(values: &[f64]) -> f64 {
    sums::mean(&values.iter().map(|v| v * v).collect::<Vec<_>>()).sqrt()
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
}
