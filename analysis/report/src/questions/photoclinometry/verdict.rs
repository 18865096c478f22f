//! How well recovered surfaces agree with the true ones, in sentences: at which wavelengths the textures match, and at which they do not.

use super::covariances::Pair;
use super::surfaces::Surface;
use crate::render::number as set;
use sastrugi_numeric::sums;
use sastrugi_schemas::tables::PhotoclinometryBandRow;

/// Largest relative deviation of an RMS from the truth's that counts as agreement.
const ALIKE: f64 = 0.1;
/// Smallest squared coherence that counts as coherent.
const COHERENT: f64 = 0.9;
/// Condition number above which the sun positions barely separate slopes from albedo.
const CONDITION_MAX: f64 = 20.0;
/// Share of cells with albedo from their neighbours above which a warning is given.
const LEANING_MAX: f64 = 0.05;
/// Ratio of height error to uncertainty that noise does not explain.
const UNEXPLAINED: f64 = 3.0;
/// Ids named in a warning.
const NAMED_MAX: usize = 4;
/// Share of the plane in the variance of the height error above which a tilt is reported.
const TILTED: f64 = 0.5;

/// RMS height and RMS slope over all octaves, recovered over true; NaN if unknown.
fn totals(bands: &[PhotoclinometryBandRow]) -> [f64; 2] {
    let rms = |of: fn(&PhotoclinometryBandRow) -> f64| {
        let squares: Vec<f64> = bands.iter().map(|b| of(b) * of(b)).collect();
        sums::sum(&squares).sqrt()
    };
    [rms(|b| b.recovered_rms_m) / rms(|b| b.truth_rms_m), rms(|b| b.recovered_slope_rms) / rms(|b| b.truth_slope_rms)]
}

/// True where an octave is coherent with the truth and has its RMS height and slope.
pub fn alike(band: &PhotoclinometryBandRow) -> bool {
    let near = |recovered: f64, truth: f64| (recovered - truth).abs() <= ALIKE * truth;
    // Octaves of a release without slopes are judged by their heights alone.
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
    let slope = if slope == set::ABSENT { String::new() } else { format!(", the RMS slope {slope}") };
    let (whole, level) = (row.height_error_rms_m, row.height_error_rms_detrended_m);
    let tilt = if level * level < (1.0 - TILTED) * whole * whole {
        format!("; most of it is a tilt: {} remain after subtracting the plane", set::with_unit(level, 3, "m"))
    } else {
        String::new()
    };
    format!(
        "{}: {}. Over all these wavelengths, the RMS height is {height} of the truth's{slope}. The RMS height error is {}, for a true RMS height \
         of {}{tilt}.",
        surface.id(),
        wavelengths(surface.bands),
        set::with_unit(whole, 3, "m"),
        set::with_unit(row.height_rms_m, 3, "m")
    )
}

/// At which wavelengths the texture matches the truth, and how it deviates at the others.
fn wavelengths(bands: &[PhotoclinometryBandRow]) -> String {
    let runs: Vec<&[PhotoclinometryBandRow]> = bands.chunk_by(|a, b| alike(a) == alike(b)).collect();
    let join = |is: bool, words: fn(&[PhotoclinometryBandRow]) -> String| {
        runs.iter().filter(|r| alike(&r[0]) == is).map(|r| words(r)).collect::<Vec<_>>().join(", and ")
    };
    let (good, bad) = (join(true, span), join(false, fault));
    let has = format!("RMS height and slope within {} of the truth, and coherent with it,", set::percent(ALIKE, 0));
    match (good.is_empty(), bad.is_empty()) {
        (_, true) => format!("{has} at all wavelengths ({good})"),
        (true, _) => format!("the texture matches the truth at no wavelength: {bad}"),
        _ => format!("{has} at {good}, but not at {bad}"),
    }
}

/// Shortest to longest wavelength of a run of octaves.
fn span(run: &[PhotoclinometryBandRow]) -> String {
    let ends = run.first().zip(run.last()).map(|(a, b)| (a.wavelength_min_m, b.wavelength_max_m));
    ends.map_or_else(String::new, |(low, high)| format!("{} to {} m", set::plain(low, 3), set::plain(high, 3)))
}

/// The same, with the deviations from the truth.
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
        false => format!(", RMS slope {}", range(&slopes, &|v| set::percent(v, 0))),
    };
    format!(
        "{} (RMS height {}{slopes} of the truth's, squared coherence {})",
        span(run),
        range(&ratios, &|v| set::percent(v, 0)),
        range(&coherences, &|v| set::significant(v, 2))
    )
}

/// Warnings about the inversions, one sentence for each cause.
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
                "heights did not converge; they still changed by up to {} in the last round.",
                set::with_unit(most(of, |s| s.row.change_m), 2, "m")
            )
        }),
        that(&|s| s.row.condition > CONDITION_MAX, &|of| {
            format!(
                "the sun positions barely separate slopes from albedo (median condition number of a cell up to {}).",
                set::significant(most(of, |s| s.row.condition), 2)
            )
        }),
        that(&|s| s.row.share_leaning > LEANING_MAX, &|of| {
            format!(
                "up to {} of the cells take their albedo from their neighbours, because too few images show them lit or the sun positions barely \
                 separate slopes from albedo there.",
                set::percent(most(of, |s| s.row.share_leaning), 0)
            )
        }),
        that(&|s| s.row.height_error_rms_detrended_m > UNEXPLAINED * s.row.height_sigma_m, &|_| {
            "height errors exceed three times the uncertainty, which includes image noise but neither wrong sun positions or exposures nor relief \
             within a cell."
                .to_owned()
        }),
    ];
    causes.into_iter().flatten().collect()
}
