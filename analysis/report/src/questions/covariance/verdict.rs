//! How far a fit can be trusted: its parameters with their intervals, and the tests that speak against it, in sentences.

use super::{beside_measured, models, of_dem};
use crate::content::{Numbers, TableBlock, number, slug, text};
use crate::data::Data;
use crate::render::number as set;
use sastrugi_schemas::fit::{FitFile, Quoted};
use sastrugi_schemas::tables::FitRow;

/// Level of tests.
const LEVEL: f64 = 0.01;
/// Standard errors by which fits at other windows may differ.
const WINDOWS_Z: f64 = 2.58;
/// Ratio of the fitted ranges above which anisotropy is called slight, whatever its p value, if Str says so too.
const SLIGHT_RATIO: f64 = 0.9;
/// Str above which it does. Str is the shortest over the longest distance, so it is below 1 for isotropic ground, too: in 200 simulated normal fields
/// with isotropic exponential covariance, detrended by a moving average of 10 ranges, 95 % had at least 0.68, 0.86 and 0.91 on sites of 20, 40 and 80
/// ranges a side (by a plane 0.62, 0.81 and 0.89). A threshold of 0.9 would refuse a third to a half of the isotropic sites of 40 ranges. Of fields whose
/// ranges have a ratio of 0.8, four in ten pass 0.8; at a ratio of 0.7 none of 120 does.
const SLIGHT_STR: f64 = 0.8;
/// Ratio of block sigmas below which their spread is called slight, whatever its p value.
const SLIGHT_SPREAD: f64 = 1.2;
/// Width of an interval, high over low, beyond which a parameter is called poorly known.
const WIDE: f64 = 2.0;
/// Factor by which σ²/b varies between windows above which the paragraph states it.
const SPREAD: f64 = 1.25;

/// A parameter with its intervals: name in words, unit, estimate, parametric and block interval.
type Parameter = (&'static str, &'static str, f64, [f64; 2], [f64; 2]);

fn parameters(fit: &FitRow) -> [Parameter; 3] {
    let f = fit;
    [
        ("σ", "m", f.sigma_m, [f.sigma_low_m, f.sigma_high_m], [f.block_sigma_low_m, f.block_sigma_high_m]),
        ("b", "m", f.range_m, [f.range_low_m, f.range_high_m], [f.block_range_low_m, f.block_range_high_m]),
        (
            "σ²/b",
            "m",
            f.sigma2_over_range_m,
            [f.sigma2_over_range_low_m, f.sigma2_over_range_high_m],
            [f.block_sigma2_over_range_low_m, f.block_sigma2_over_range_high_m],
        ),
    ]
}

fn known([low, high]: [f64; 2]) -> bool {
    low.is_finite() && high.is_finite()
}

/// An interval in words, to follow a value; `None` where there is none.
fn interval_words([low, high]: [f64; 2], unit: &str) -> Option<String> {
    match (low > 0.0, high.is_finite()) {
        _ if low.is_nan() || high.is_nan() => None,
        (true, true) => Some(format!("{} to {}", set::significant(low, 3), set::with_unit(high, 3, unit))),
        (true, false) => Some(format!("at least {}", set::with_unit(low, 3, unit))),
        (false, true) => Some(format!("at most {}", set::with_unit(high, 3, unit))),
        (false, false) => Some("unbounded".to_owned()),
    }
}

/// The paragraph on one fit. `file` is its fit file where the release has it, whose verdict comes first, as `sastrugi fit` prints it.
pub fn paragraph(data: &Data, fit: &FitRow, file: Option<&FitFile>) -> String {
    let beside = beside_measured(data, fit);
    let estimate = estimate(fit, &models::of_fit(data, fit), file);
    let of_model = |name: &str| format!("Parameters of the {name} model beside the measured covariance: ");
    let verdict = file.map(|f| f.verdict.clone()).filter(|verdict| !verdict.is_empty());
    let sentences = [
        verdict.or_else(|| no_scale(fit)),
        Some(beside.map_or_else(String::new, of_model) + &estimate),
        poorly_known(fit, file),
        model(fit, beside),
        window(fit),
        direction(data, fit),
        site(fit),
        distribution(fit),
    ];
    let all: Vec<String> = sentences.into_iter().flatten().collect();
    format!("{} ({} mode, {}): {}", fit.fit_id, fit.mode, fit.model, all.join(" "))
}

/// Quantities that do not depend on the window, where σ and b do.
fn no_scale(fit: &FitRow) -> Option<String> {
    let disagree = fit.window_disagreement_z > WINDOWS_Z;
    disagree.then(|| {
        let below = format!(
            "There is no scale separation: the band RMS below {} is {}",
            set::with_unit(fit.window_x_m, 3, "m"),
            set::with_unit(fit.band_rms_m, 3, "m")
        );
        match fit.hurst.is_finite() {
            true => format!(
                "{below}, and increments grow as {} × (lag / 1 m)^{} (Hurst exponent).",
                set::with_unit(fit.increment_1m_m, 3, "m"),
                set::fixed(fit.hurst, 2)
            ),
            false => format!("{below}."),
        }
    })
}

fn estimate(fit: &FitRow, all: &[(String, &str, f64)], file: Option<&FitFile>) -> String {
    let one = |(name, unit, value, interval, _): Parameter| {
        if let Some(limit) = at_bound(file, name) {
            return limit;
        }
        let value = format!("{name} = {}", set::with_unit(value, 3, unit));
        match interval_words(interval, unit) {
            Some(words) => format!("{value} ({words})"),
            None => value,
        }
    };
    let mut values: Vec<String> = parameters(fit).into_iter().filter(|p| p.2.is_finite()).map(one).collect();
    if values.is_empty() {
        // A sum of models or a self-affine surface has no single σ and b; its intervals are in the fit file.
        values.extend(all.iter().map(|(name, unit, value)| match *unit {
            "1" => format!("{name} = {}", set::significant(*value, 3)),
            unit => format!("{name} = {}", set::with_unit(*value, 3, &set::unit(unit))),
        }));
    }
    if values.is_empty() {
        return "The parameters are in the fit file.".to_owned();
    }
    let values = values.join(", ");
    match fit.replicates {
        0 => format!("{values}, without intervals."),
        n => format!(
            "{values}; {} intervals from {n} surfaces simulated from the fitted model.",
            set::percent(fit.interval_level, 0)
        ),
    }
}

/// σ and b of a fit whose search for the range ended at its bound: only a lower limit is known, if any. `None` for other fits.
pub fn at_bound(file: Option<&FitFile>, name: &str) -> Option<String> {
    let file = file.filter(|f| f.range_at_bound())?;
    let parameter = match name {
        "σ" => "sigma_m",
        "b" => "range_m",
        _ => return None,
    };
    match file.quoted(parameter)? {
        Quoted::AtLeast(low) => Some(format!("{name} at least {}", set::with_unit(low, 3, "m"))),
        Quoted::NotIdentified { .. } => Some(format!("{name} not identified")),
        Quoted::Estimate { .. } => None,
    }
}

fn poorly_known(fit: &FitRow, file: Option<&FitFile>) -> Option<String> {
    let [_, range, ratio] = parameters(fit);
    let wide = |interval: [f64; 2]| interval[1] > WIDE * interval[0];
    let spread = file.and_then(|f| f.diagnostics.sigma2_over_range_spread).unwrap_or(1.0);
    let ratio_words = match spread > SPREAD {
        true => format!(
            "σ²/b is better constrained at this window but varies by a factor of {} between windows",
            set::significant(spread, 2)
        ),
        false => "σ²/b is better constrained".to_owned(),
    };
    (wide(range.3) && known(ratio.3) && !wide(ratio.3)).then(|| match range.3 {
        [low, high] if low > 0.0 && high.is_finite() => {
            let factor = set::significant(high / low, 2);
            format!("b is known only to within a factor of {factor}; {ratio_words}.")
        }
        _ => format!("The data give no upper limit for b; {ratio_words}."),
    })
}

fn model(fit: &FitRow, beside: Option<&str>) -> Option<String> {
    let p = Some(fit.misfit_p).filter(|p| p.is_finite())?;
    Some(match (p <= LEVEL, beside) {
        (true, None) => format!(
            "The model does not describe the residual ({}): intervals that assume it are too narrow.",
            p_value(p)
        ),
        (true, Some(name)) => format!(
            "The {name} model does not describe the residual ({}); textures have the measured covariance, which it only extends to longer waves.",
            p_value(p)
        ),
        (false, None) => format!("The misfit is no larger than expected by chance ({}).", p_value(p)),
        (false, Some(name)) => {
            format!("The misfit of the {name} model is no larger than expected by chance ({}).", p_value(p))
        }
    })
}

fn window(fit: &FitRow) -> Option<String> {
    let z = Some(fit.window_disagreement_z).filter(|z| z.is_finite())?;
    let apart = format!("{} standard errors", set::significant(z, 2));
    Some(match z > WINDOWS_Z {
        true => format!(
            "Fits at other windows disagree ({apart}): the parameters belong to this window, not to the surface."
        ),
        false => format!("Fits at other windows agree within their errors ({apart})."),
    })
}

/// Result of the test of isotropy, with the ratio of ranges of the fitted model and that of the measured correlation.
pub fn direction(data: &Data, fit: &FitRow) -> Option<String> {
    let p = Some(fit.isotropy_p).filter(|p| p.is_finite())?;
    if p > LEVEL {
        return Some(format!("No anisotropy was detected ({}).", p_value(p)));
    }
    let measured = data.surface(&fit.fit_id).map(|s| s.aspect_ratio).filter(|ratio| *ratio > 0.0);
    // Without Str, the measured correlation does not fall to 0.2 in every direction: nothing says that the anisotropy is slight.
    let is_slight = fit.isotropy_ratio >= SLIGHT_RATIO && measured.is_some_and(|ratio| ratio >= SLIGHT_STR);
    let measured = measured.map_or_else(String::new, |ratio| {
        format!(
            "; the measured correlation falls to 0.2 at distances that differ by a factor of {} (Str = {})",
            set::significant(1.0 / ratio, 3),
            set::significant(ratio, 3)
        )
    });
    Some(format!(
        "The residual is {}anisotropic ({}): the fitted range along {}° from north is {} times the range across{measured}.",
        if is_slight { "slightly " } else { "" },
        p_value(p),
        set::fixed(fit.isotropy_azimuth_deg, 0),
        set::significant(1.0 / fit.isotropy_ratio, 3)
    ))
}

fn site(fit: &FitRow) -> Option<String> {
    let p = Some(fit.stationarity_p).filter(|p| p.is_finite())?;
    let apart = set::significant(fit.block_sigma_max_over_min, 3);
    Some(match p <= LEVEL {
        true if fit.block_sigma_max_over_min <= SLIGHT_SPREAD => format!(
            "The site is slightly non-stationary: σ of its blocks differs by a factor of {apart}, more than by chance ({}).",
            p_value(p)
        ),
        true => {
            format!("The site is not stationary: σ of its blocks differs by a factor of {apart} ({}).", p_value(p))
        }
        false => format!(
            "The blocks of the site agree: their σ differs by a factor of {apart}, as expected by chance ({}).",
            p_value(p)
        ),
    })
}

fn distribution(fit: &FitRow) -> Option<String> {
    let p = Some(fit.normality_p).filter(|p| p.is_finite())?;
    Some(match p <= 2.0 * LEVEL {
        true => format!("The heights of the residual are not normally distributed ({}).", p_value(p)),
        false => format!("The heights of the residual are compatible with a normal distribution ({}).", p_value(p)),
    })
}

/// `p = 0.03`, or `p < 0.001` as in the warnings of a fit.
fn p_value(p: f64) -> String {
    if p < 1e-3 { "p < 0.001".into() } else { format!("p = {}", set::significant(p, 2)) }
}

/// Estimates with both kinds of intervals; without rows where no fit has any.
pub fn intervals(dem: &str, fits: &[&FitRow]) -> TableBlock {
    let columns = [
        ("fit", ""),
        ("parameter", ""),
        ("estimate", "m"),
        ("low", "m"),
        ("high", "m"),
        ("low, blocks", "m"),
        ("high, blocks", "m"),
        ("uncorrected", "m"),
    ];
    let mut numbers = Numbers::computed(of_dem(dem), &columns);
    let with_intervals: Vec<&&FitRow> = fits.iter().filter(|f| f.replicates > 0 || f.block_replicates > 0).collect();
    for fit in &with_intervals {
        let naive = [fit.naive_sigma_m, fit.naive_range_m, fit.naive_sigma_m * fit.naive_sigma_m / fit.naive_range_m];
        for ((name, _, value, own, block), naive) in parameters(fit).into_iter().zip(naive) {
            let figures = [value, own[0], own[1], block[0], block[1], naive].map(number);
            numbers.row([text(&fit.fit_id), text(name)].into_iter().chain(figures));
        }
    }
    // A kind of interval that no fit has would be a column of dashes only.
    let alone = with_intervals.len() == 1;
    for column in (0..columns.len()).rev() {
        let absent = numbers.rows.iter().all(|row| row[column] == sastrugi_schemas::Cell::Null);
        if absent || column == 0 && alone {
            numbers.columns.remove(column);
            numbers.rows.iter_mut().for_each(|row| drop(row.remove(column)));
        }
    }
    let caption = match with_intervals.as_slice() {
        [one] => format!("Intervals of {}", one.fit_id),
        _ => format!("Intervals of the fits of {dem}"),
    };
    TableBlock { id: slug(&format!("intervals-of-{dem}")), caption, numbers }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::made_up;
    use sastrugi_schemas::fit::{Diagnostics, Intervals};
    use sastrugi_schemas::tables::SurfaceRow;

    #[test]
    fn val_sentences_agree_with_the_row() {
        let mut data = made_up::full(1, 24);
        let corrected = paragraph(&data, &data.fits[0], None);
        for part in [
            "σ = 21.0 m (19.2 to 24.1 m)",
            "95 % intervals from 99 surfaces",
            "does not describe the residual (p = 0.010)",
            "agree within their errors (1.2 standard errors)",
            "The residual is anisotropic (p < 0.001): the fitted range along 48° from north is 1.41 times the range across",
            "the measured correlation falls to 0.2 at distances that differ by a factor of 1.39 (Str = 0.720).",
            "not stationary: σ of its blocks differs by a factor of 1.60",
            "compatible with a normal distribution (p = 0.40)",
        ] {
            assert!(corrected.contains(part), "{part} in {corrected}");
        }
        assert!(!corrected.contains("to a factor of"));
        let paper = paragraph(&data, &data.fits[1], None);
        assert!(paper.ends_with("σ²/b = 0.613 m, without intervals."), "{paper}");
        let lost = FitRow {
            window_disagreement_z: 9.0,
            hurst: 0.6,
            increment_1m_m: 0.5,
            isotropy_ratio: 0.95,
            sigma_m: f64::NAN,
            range_m: f64::NAN,
            sigma2_over_range_m: f64::NAN,
            ..data.fits[0].clone()
        };
        data.candidates.iter_mut().for_each(|c| c.parameters = r#"{"hurst":0.61}"#.into());
        let lost = paragraph(&data, &lost, None);
        for part in [
            "There is no scale separation: the band RMS below 3034 m is 15.0 m, and increments grow as 0.500 m × \
             (lag / 1 m)^0.60",
            "hurst = 0.610; 95 % intervals from 99 surfaces",
        ] {
            assert!(lost.contains(part), "{part} in {lost}");
        }
        let ends = |name: &str| (name.to_owned(), [Some(0.6), None]);
        let file = FitFile {
            verdict: "No single scale below 12 m: publish band RMS 0.2 m.".into(),
            parameters: [("sigma_m".to_owned(), 21.0), ("range_m".to_owned(), 500.0)].into(),
            intervals: Some(Intervals {
                level: 0.95,
                replicates: 99,
                from_profile: true,
                values: [ends("range_m")].into(),
            }),
            diagnostics: Diagnostics { range_at_search_bound: true, ..Diagnostics::default() },
            ..FitFile::default()
        };
        let bounded = paragraph(&data, &data.fits[0], Some(&file));
        let words =
            "): No single scale below 12 m: publish band RMS 0.2 m. σ not identified, b at least 0.600 m, σ²/b = ";
        assert!(bounded.contains(words), "{bounded}");
        let fits: Vec<&FitRow> = data.fits.iter().collect();
        let table = intervals("jacksboro", &fits).numbers;
        let names: Vec<&str> = table.columns.iter().map(|c| c.name.as_str()).collect();
        assert_eq!((table.rows.len(), names), (3, vec!["parameter", "estimate", "low", "high", "uncorrected"]));
    }

    /// Anisotropy is slight only if neither the fitted ranges nor the measured correlation differ much by direction. Str is below 1 by chance, and unknown
    /// where the correlation stays high in some direction.
    #[test]
    fn val_slight_anisotropy_is_slight_in_both() {
        let mut data = made_up::full(1, 24);
        let fit = FitRow { isotropy_ratio: 0.9028, isotropy_p: 0.005, ..data.fits[0].clone() };
        let mut said = |measured: f64| {
            let own = |s: &&mut SurfaceRow| s.surface_id == fit.fit_id;
            data.surfaces.iter_mut().filter(own).for_each(|s| s.aspect_ratio = measured);
            direction(&data, &fit).unwrap()
        };
        assert!(said(0.668).starts_with("The residual is anisotropic (p = 0.0050): "), "{}", said(0.668));
        assert!(
            said(0.668).contains("1.11 times the range across; the measured correlation falls to 0.2 at distances")
        );
        assert!(said(0.79).starts_with("The residual is anisotropic"), "{}", said(0.79));
        assert!(said(0.81).starts_with("The residual is slightly anisotropic"), "{}", said(0.81));
        let unknown = said(f64::NAN);
        assert!(!unknown.contains("slightly") && unknown.ends_with("1.11 times the range across."), "{unknown}");
    }

    /// What is fitted and tested beside a measured covariance is named.
    #[test]
    fn val_an_empirical_fit_names_the_model_beside_it() {
        let mut data = made_up::full(1, 24);
        let plain = paragraph(&data, &data.fits[0], None);
        assert!(
            plain.contains("The model does not describe the residual")
                && !plain.contains("beside the measured covariance"),
            "{plain}"
        );
        data.fits[0].model = "empirical".into();
        let empirical = paragraph(&data, &data.fits[0], None);
        for part in [
            "(corrected mode, empirical): Parameters of the exponential model beside the measured covariance: σ = 21.0 m",
            "The exponential model does not describe the residual (p = 0.010); textures have the measured covariance",
        ] {
            assert!(empirical.contains(part), "{part} in {empirical}");
        }
        data.fits[0].misfit_p = 0.3;
        let fits = paragraph(&data, &data.fits[0], None);
        assert!(fits.contains("The misfit of the exponential model is no larger than expected"), "{fits}");
        data.candidates.clear();
        assert!(paragraph(&data, &data.fits[0], None).contains("Parameters of the fitted model beside"));
    }
}
