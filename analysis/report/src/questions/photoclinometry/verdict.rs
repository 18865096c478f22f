//! What recovered surfaces have of the true ones, in sentences: at which wavelengths their texture is the truth's, and at which it is not.

use super::covariances::Pair;
use super::surfaces::Surface;
use crate::render::number as set;
use sastrugi_numeric::sums;
use sastrugi_schemas::tables::PhotoclinometryBandRow;

/// Largest deviation of an rms from the truth's that counts as the same.
const ALIKE: f64 = 0.1;
/// Least squared coherence that counts as the same waves.
const COHERENT: f64 = 0.9;
/// Condition number from which the suns hardly tell slopes from albedo.
const CONDITION_MAX: f64 = 20.0;
/// Share of cells leaning on their neighbours that is worth a warning.
const LEANING_MAX: f64 = 0.05;
/// An error of heights over their uncertainty that noise does not explain.
const UNEXPLAINED: f64 = 3.0;
/// Ids named in a warning.
const NAMED_MAX: usize = 4;
/// Plane over the whole error of heights, as variances, from which a tilt is named.
const TILTED: f64 = 0.5;

/// Rms height and rms slope over all octaves, recovered over true; NaN where not known.
fn totals(bands: &[PhotoclinometryBandRow]) -> [f64; 2] {
    let rms = |of: fn(&PhotoclinometryBandRow) -> f64| {
        let squares: Vec<f64> = bands.iter().map(|b| of(b) * of(b)).collect();
        sums::sum(&squares).sqrt()
    };
    [rms(|b| b.recovered_rms_m) / rms(|b| b.truth_rms_m), rms(|b| b.recovered_slope_rms) / rms(|b| b.truth_slope_rms)]
}

/// True where an octave holds the truth's waves with the truth's height and slope.
pub fn alike(band: &PhotoclinometryBandRow) -> bool {
    let near = |recovered: f64, truth: f64| (recovered - truth).abs() <= ALIKE * truth;
    // Octaves of a release that has no slopes are judged by their heights.
    let slopes = !band.truth_slope_rms.is_finite() || near(band.recovered_slope_rms, band.truth_slope_rms);
    band.coherence >= COHERENT && near(band.recovered_rms_m, band.truth_rms_m) && slopes
}

/// The verdict of each surface, a paragraph each.
pub fn paragraphs(surfaces: &[&Surface], pairs: &[Pair]) -> Vec<String> {
    let of = |s: &&Surface| {
        let pair = pairs.iter().find(|p| p.recovered.dem_id == s.id()).map(|p| format!(" {}", p.sentence()));
        format!("{}{}", surface(s), pair.unwrap_or_default())
    };
    surfaces.iter().map(of).collect()
}

fn surface(surface: &Surface) -> String {
    if !surface.compared() || surface.bands.is_empty() {
        return format!("{}: no true surface to compare with.", surface.id());
    }
    let row = surface.row;
    let [height, slope] = totals(surface.bands).map(|ratio| set::percent(ratio, 0));
    let slope = if slope == set::ABSENT { String::new() } else { format!(", rms slope {slope}") };
    let (whole, level) = (row.height_error_rms_m, row.height_error_rms_detrended_m);
    let tilt = if level * level < (1.0 - TILTED) * whole * whole {
        format!("; most of it is a tilt: {} remain less the plane", set::with_unit(level, 3, "m"))
    } else {
        String::new()
    };
    format!(
        "{}: {}. Over all these wavelengths: rms height {height} of the truth's{slope}. Heights are off by {} (rms) where the true ones have {}{tilt}.",
        surface.id(),
        wavelengths(surface.bands),
        set::with_unit(whole, 3, "m"),
        set::with_unit(row.height_rms_m, 3, "m")
    )
}

/// At which wavelengths the texture is the truth's, and what is wrong at the others.
fn wavelengths(bands: &[PhotoclinometryBandRow]) -> String {
    let runs: Vec<&[PhotoclinometryBandRow]> = bands.chunk_by(|a, b| alike(a) == alike(b)).collect();
    let join = |is: bool, words: fn(&[PhotoclinometryBandRow]) -> String| {
        runs.iter().filter(|r| alike(&r[0]) == is).map(|r| words(r)).collect::<Vec<_>>().join(", and ")
    };
    let (good, bad) = (join(true, span), join(false, fault));
    let has = format!("the truth's rms height and slope to {}, on the same waves,", set::percent(ALIKE, 0));
    match (good.is_empty(), bad.is_empty()) {
        (_, true) => format!("{has} at all wavelengths ({good})"),
        (true, _) => format!("the truth's texture at no wavelength: {bad}"),
        _ => format!("{has} at {good}; not at {bad}"),
    }
}

/// Shortest to longest wavelength of a run of octaves.
fn span(run: &[PhotoclinometryBandRow]) -> String {
    let ends = run.first().zip(run.last()).map(|(a, b)| (a.wavelength_min_m, b.wavelength_max_m));
    ends.map_or_else(String::new, |(low, high)| format!("{} to {} m", set::plain(low, 3), set::plain(high, 3)))
}

/// The same with what is wrong there.
fn fault(run: &[PhotoclinometryBandRow]) -> String {
    let ratios: Vec<f64> = run.iter().map(|b| b.recovered_rms_m / b.truth_rms_m).collect();
    let slopes: Vec<f64> =
        run.iter().map(|b| b.recovered_slope_rms / b.truth_slope_rms).filter(|v| v.is_finite()).collect();
    let coherences: Vec<f64> = run.iter().map(|b| b.coherence).collect();
    let range = |values: &[f64], words: &dyn Fn(f64) -> String| {
        let (low, high) = values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(*v), b.max(*v)));
        let (low, high) = (words(low), words(high));
        if low == high { low } else { format!("{low} to {high}") }
    };
    let slopes = match slopes.is_empty() {
        true => String::new(),
        false => format!(", rms slope {}", range(&slopes, &|v| set::percent(v, 0))),
    };
    format!(
        "{} (rms height {}{slopes} of the truth's, squared coherence {})",
        span(run),
        range(&ratios, &|v| set::percent(v, 0)),
        range(&coherences, &|v| set::significant(v, 2))
    )
}

/// What a reader must know of the inversions, one sentence for each cause.
pub fn warnings(surfaces: &[Surface]) -> Vec<String> {
    let ids = |of: &[&Surface]| {
        let mut names: Vec<String> = of.iter().take(NAMED_MAX).map(|s| s.id().to_owned()).collect();
        if of.len() > NAMED_MAX {
            names.push(format!("{} more", set::count(of.len() - NAMED_MAX)));
        }
        names.join(", ")
    };
    let that = |is: &dyn Fn(&Surface) -> bool, words: &dyn Fn(&[&Surface]) -> String| {
        let found: Vec<&Surface> = surfaces.iter().filter(|s| is(s)).collect();
        (!found.is_empty()).then(|| format!("{}: {}", ids(&found), words(&found)))
    };
    let most =
        |of: &[&Surface], figure: fn(&Surface) -> f64| of.iter().map(|s| figure(s)).fold(f64::NEG_INFINITY, f64::max);
    let causes = [
        that(&|s| !s.row.converged, &|of| {
            format!(
                "heights did not settle, they still changed by up to {} in the last round.",
                set::with_unit(most(of, |s| s.row.change_m), 2, "m")
            )
        }),
        that(&|s| s.row.condition > CONDITION_MAX, &|of| {
            format!(
                "the suns hardly tell slopes from albedo (median condition number of a cell up to {}).",
                set::significant(most(of, |s| s.row.condition), 2)
            )
        }),
        that(&|s| s.row.share_leaning > LEANING_MAX, &|of| {
            format!(
                "up to {} of the cells take their albedo from their neighbours, because too few images show them lit or the suns hardly tell slopes from albedo there.",
                set::percent(most(of, |s| s.row.share_leaning), 0)
            )
        }),
        that(&|s| s.row.height_error_rms_detrended_m > UNEXPLAINED * s.row.height_sigma_m, &|_| {
            "heights are off by more than three times their uncertainty, which holds the noise of the images and neither wrong suns or exposures nor relief \
             inside a cell."
                .to_owned()
        }),
    ];
    causes.into_iter().flatten().collect()
}
