//! Verbs that produce or describe one file.

use super::coregister::describe;
use super::fits::{self, fit_parameters, fit_reading};
use super::shown::ShownFiles;
use super::{options, reading};
use crate::Verdict;
use crate::args::{Common, Detrend, Fit, Obstacles, Roughness, Terrain, Texture};
use crate::failure::{Code, Failure};
use crate::output::{columns, print, significant, warn};
use crate::progress::waiting;
use sastrugi_schemas::fit::{FitFile, Quoted, SILL_OVER_RANGE, Source};
use sastrugi_stages::Error;
use sastrugi_stages::verbs::local::Local;
use sastrugi_stages::verbs::roughness::{
    AerodynamicRoughness, ArealParameters, Bumps, Detrender, ObstacleHeight, Ride, RideRequest, WindEstimate,
    WindSettings,
};
use sastrugi_stages::verbs::texture::{Amplitude, Exemplar};
use sastrugi_stages::verbs::{self, numbers, parameters};
use serde_json::{Value, json};
use std::path::Path;

/// `terrain`.
pub fn terrain(args: &Terrain, common: &Common) -> Verdict {
    let options = options(&args.writing, &args.output)?;
    let request =
        verbs::terrain::Request { spec: &args.spec, set: &args.set, seed: args.seed, output: &args.output, options };
    print_summary(common, &waiting("generating", common.quiet, || verbs::terrain::terrain(&request))?)
}

/// `texture`.
pub fn texture(args: &Texture, common: &Common) -> Verdict {
    let mut params = json!({});
    parameters::assign(&mut params, &args.set)?;
    if let Some(size) = &args.size {
        params["size_m"] = json!(numbers::<2>("--size", size)?);
    }
    if let Some(cell) = args.cell {
        params["cell_m"] = json!(cell);
    }
    if let Some(phase) = &args.phase {
        params["phase"] = json!(phase);
    }
    if let Some(covariance) = &args.covariance {
        params["covariance"] = json!(covariance);
    }
    if let Some(tile) = &args.tile {
        params["tile"] = json!(numbers::<2>("--tile", tile)?.map(whole));
    }
    let request = verbs::texture::Request {
        fit: &args.fit,
        method: &args.method,
        parameters: params,
        seed: args.seed.unwrap_or(0),
        exemplar: args.exemplar.as_deref().map(|dem| Exemplar { dem, masks: args.masks.all() }),
        onto: args.onto.as_deref(),
        amplitude: args.amplitude.as_deref().map(amplitude),
        fill: args.fill.as_deref(),
        output: &args.output,
        options: options(&args.writing, &args.output)?,
    };
    let made = waiting("synthesising", common.quiet, || verbs::texture::texture(&request))?;
    // Also with --quiet: a warning says that the texture is hardly what was measured.
    let warnings = made["warnings"].as_array().into_iter().flatten().filter_map(Value::as_str);
    warnings.for_each(|warning| warn(&format!("sastrugi: warning: {warning}")));
    print_summary(common, &made)
}

/// A number, else a raster.
fn amplitude(text: &str) -> Amplitude<'_> {
    text.parse().map_or_else(|_| Amplitude::Raster(Path::new(text)), Amplitude::Factor)
}

/// A number as JSON; as an integer if it is one, so that it can be read as a count.
fn whole(number: f64) -> Value {
    if number.fract() == 0.0 && number.abs() < 1e9 { json!(number as i64) } else { json!(number) }
}

/// Prints a summary of the result.
fn print_summary(common: &Common, result: &Value) -> Verdict {
    let grid = &result["grid"];
    let number = |v: &Value| v.as_f64().map_or_else(|| "none".to_owned(), |x| format!("{x:.4}"));
    let text = format!(
        "{}: {} x {} cells of {} x {} m, heights {} to {} m{}{}",
        result["file"].as_str().unwrap_or_default(),
        grid["rows"],
        grid["cols"],
        grid["cell"][0],
        grid["cell"][1],
        number(&grid["height_min_m"]),
        number(&grid["height_max_m"]),
        maps(&result["maps"]),
        notes(&result["notes"]),
    );
    print(common.json, result, &text)?;
    Ok(Code::Done)
}

/// Map files written with the heights.
fn maps(all: &Value) -> String {
    let text = |map: &Value, key: &str| map[key].as_str().unwrap_or_default().to_owned();
    let lines = all.as_object().into_iter().flatten().map(|(_, map)| (text(map, "file"), text(map, "description")));
    lines.map(|(file, description)| format!("\n  {file}: {description}")).collect()
}

fn notes(list: &Value) -> String {
    let lines = list.as_array().into_iter().flatten().filter_map(Value::as_str);
    lines.map(|note| format!("\n  note: {note}")).collect()
}

/// `fit`.
pub fn fit(args: &Fit, common: &Common) -> Verdict {
    let ([dem], Some(output), None) = (&args.dems[..], &args.output, &args.table) else {
        return fits::fits(args, common);
    };
    let (params, reading) = (fit_parameters(args)?, fit_reading(args)?);
    let shown = ShownFiles::of(&args.shown)?;
    let request = verbs::fit::Request {
        dem,
        output: Some(output),
        parameters: params,
        seed: args.seed,
        reading,
        minus: args.minus.as_deref(),
        difference: args.difference.as_deref(),
        map: args.map.as_deref(),
        background: args.background.as_deref(),
        local: args.shown.local.as_deref().map(|prefix| Local { prefix, block_m: args.shown.local_block }),
        beside: shown.files(),
    };
    let verbs::fit::Done { fit, source, notes: read_notes } =
        waiting("fitting", common.quiet, || verbs::fit::fit(&request))?;
    let fit = match fit {
        Ok(fit) => fit,
        Err(error) => return fit_failed(&source, error, common),
    };
    shown.write(&fit)?;
    let mut text = format!("{}: {} ({})", output.display(), fit.model, fit.mode);
    if !fit.verdict.is_empty() {
        text.push_str(&format!("\n  {}", fit.verdict));
    }
    text.push_str(&format!("\n  {}", fitted_parameters(&fit)));
    read_notes.iter().for_each(|note| text.push_str(&format!("\n  note: {note}")));
    fit.warnings.iter().for_each(|warning| text.push_str(&format!("\n  warning: {warning}")));
    print(common.json, &serde_json::to_value(&fit).map_err(Failure::failed)?, &text)?;
    Ok(Code::Done)
}

/// Prints the co-registration even though the difference could not be fitted; its place in the JSON is that of a fit file.
fn fit_failed(source: &Source, error: Error, common: &Common) -> Verdict {
    if let Some(minus) = &source.minus {
        let value = json!({ "error": error.to_string(), "source": source });
        let text = format!(
            "co-registration of {} (the difference could not be fitted):\n{}",
            minus.file,
            describe(&minus.coregistration)
        );
        print(common.json, &value, &text)?;
    }
    Err(error.into())
}

/// Parameters with the intervals to quote, and sigma^2 / b if it has an interval. If the search for the range ended at its bound,
/// only lower limits are known.
fn fitted_parameters(fit: &FitFile) -> String {
    let kind = fit
        .quoted_intervals()
        .map_or_else(String::new, |(intervals, kind)| format!(" ({:.0} %, {kind})", 100.0 * intervals.level));
    let sill = match fit.quoted(SILL_OVER_RANGE) {
        Some(quoted @ Quoted::Estimate { interval: Some(_), .. }) => {
            Some(parameter("sigma^2/b_m", quoted, significant))
        }
        _ => None,
    };
    let one = |name: &String| Some(parameter(name, fit.quoted(name)?, |v| format!("{v:.6}")));
    let all: Vec<String> = fit.parameters.keys().filter_map(one).chain(sill).collect();
    format!("{}{kind}", all.join(", "))
}

fn parameter(name: &str, quoted: Quoted, number: impl Fn(f64) -> String) -> String {
    let end = |end: Option<f64>| end.map_or_else(|| "open".to_owned(), &number);
    match quoted {
        Quoted::Estimate { value, interval: Some([low, high]) } => {
            format!("{name} = {} [{}, {}]", number(value), end(low), end(high))
        }
        Quoted::Estimate { value, interval: None } => format!("{name} = {}", number(value)),
        Quoted::AtLeast(low) => format!("{name} at least {}", number(low)),
        Quoted::NotIdentified { ended } => {
            format!("{name} not identified (the search ended at {})", number(ended))
        }
    }
}

/// Areal parameters relative to the least-squares plane, as lines.
fn areal(f: &ArealParameters) -> [(&'static str, String); 6] {
    let known = |value: f64, text: String| if value.is_finite() { text } else { "none".to_owned() };
    let hurst = f.hurst.as_ref().map_or_else(
        || "none".to_owned(),
        |h| format!("{:.3} +- {:.3} from {:.4} to {:.4} m", h.exponent, h.standard_error, h.lags_m[0], h.lags_m[1]),
    );
    let ratio = if f.aspect_ratio.is_finite() { format!("{:.3}", f.aspect_ratio) } else { "not known".to_owned() };
    let [x, y] = f.rms_slopes;
    [
        ("Sq, Sa", known(f.sq_m, format!("{:.5}, {:.5} m relative to the least-squares plane", f.sq_m, f.sa_m))),
        ("Ssk, Sku", known(f.ssk, format!("{:.3}, {:.3}", f.ssk, f.sku))),
        ("Sp, Sv, Sz", known(f.sz_m, format!("{:.5}, {:.5}, {:.5} m", f.sp_m, f.sv_m, f.sz_m))),
        ("Sdq", known(f.sdq, format!("{:.4}; along x {x:.4}, along y {y:.4}", f.sdq))),
        ("Sal, Str, Std", known(f.sal_m, format!("{:.4} m, {ratio}, azimuth {:.0} degrees", f.sal_m, f.direction_deg))),
        ("Hurst exponent", hurst),
    ]
}

/// Ride-relevant roughness, as lines.
fn ride(f: &Ride) -> Vec<(&'static str, String)> {
    let known = |value: f64, text: String| if value.is_finite() { text } else { "none".to_owned() };
    let both = |[x, y]: [f64; 2], digits: usize| {
        let one = |value: f64| known(value, format!("{value:.digits$}"));
        format!("{} along x, {} along y", one(x), one(y))
    };
    let [min, max] = f.band_m;
    let along = match f.rms_along_m[..] {
        [x, y] => format!(" ({})", both([x, y], 5)),
        _ => String::new(),
    };
    let law = f.power_law.as_ref().map_or_else(
        || "none".to_owned(),
        |l| {
            let [low, high] = l.frequencies_cycles_m;
            let (c, n, error) = (l.c, l.n, l.n_standard_error);
            format!("{c:.4e} f^-{n:.3} m3 (n +- {error:.3}, r2 {:.4}), f from {low:.3} to {high:.3} cycles/m", l.r2)
        },
    );
    let class = f.iso_8608_class.map_or_else(|| "none".to_owned(), |c| format!("{c}, {:.3e} m3", f.iso_8608_psd_m3));
    let extrapolated = f.power_law.as_ref().is_some_and(|law| !law.reaches_iso_8608());
    let beyond = if extrapolated { ", beyond the fitted frequencies" } else { "" };
    let iri = [f.iri.along_x_m_km, f.iri.along_y_m_km];
    vec![
        ("RMS in the band", known(f.rms_m, format!("{:.5} m{along}", f.rms_m))),
        ("band", format!("wavelengths {min} to {max} m, detrending {}", f.detrender.name())),
        ("PSD", law),
        ("ISO 8608 class", format!("{class} at 0.1 cycles/m{beyond}")),
        ("IRI", known(iri[0].max(iri[1]), format!("{} m/km", both(iri, 2)))),
    ]
}

/// The options for ride roughness.
fn ride_request(args: &Roughness) -> Option<RideRequest<'_>> {
    let bumps = match (&args.vehicle, &args.band) {
        (Some(vehicle), _) => Bumps::Vehicle(vehicle),
        (None, Some(band)) => Bumps::Band(band),
        (None, None) => return None,
    };
    let detrender = match args.detrend {
        Detrend::Band => Detrender::Band,
        Detrend::Ma => Detrender::MovingAverage,
        Detrend::Exp => Detrender::Exponential,
    };
    let (map, predicted) = (args.rms_map.as_deref(), args.rms_predicted.as_deref());
    Some(RideRequest { bumps, detrender, allow_coarse: args.allow_coarse, map, predicted })
}

/// The options for wind.
fn wind_settings(args: &Roughness) -> Option<WindSettings> {
    let azimuths_deg = match args.wind {
        Some(count) => WindSettings::sectors(count).azimuths_deg,
        None if args.wind_from.is_empty() => return None,
        None => args.wind_from.clone(),
    };
    let obstacle_height = match args.obstacle_height {
        Obstacles::TwoSigma => ObstacleHeight::TwoSigma,
        Obstacles::MeanAbove => ObstacleHeight::MeanAbove,
    };
    Some(WindSettings { azimuths_deg, outer_scale_m: args.outer_scale, obstacle_height })
}

/// Roughness length by wind direction, as a table with notes.
fn aerodynamic(roughness: &AerodynamicRoughness) -> String {
    let known = |value: f64, text: String| if value.is_finite() { text } else { "none".to_owned() };
    let millimetres = |value_m: f64, error_m: f64| {
        let error = if error_m.is_finite() { format!(" +- {:.3}", 1e3 * error_m) } else { String::new() };
        known(value_m, format!("{:.3}{error}", 1e3 * value_m))
    };
    let row = |wind: String, estimate: &WindEstimate| {
        let (m, e) = (&estimate.measures, &estimate.standard_errors);
        vec![
            wind,
            known(m.frontal_area_index, format!("{:.4}", m.frontal_area_index)),
            known(m.upcrossings_per_m, format!("{:.3}", m.upcrossings_per_m)),
            millimetres(m.z0_lettau_m, e.z0_lettau_m),
            millimetres(m.z0_munro_m, e.z0_munro_m),
            millimetres(m.z0_macdonald_m, e.z0_macdonald_m),
        ]
    };
    let head = ["wind from", "lambda_f", "f/X 1/m", "z0 Lettau mm", "z0 Munro mm", "z0 Macdonald mm"];
    let mut rows = vec![head.map(str::to_owned).to_vec()];
    rows.extend(roughness.directions.iter().map(|d| row(format!("{:.4}", d.azimuth_deg), &d.estimate)));
    rows.push(row("mean".to_owned(), &roughness.mean));
    let kind = match roughness.obstacle_height {
        ObstacleHeight::TwoSigma => "twice the standard deviation",
        ObstacleHeight::MeanAbove => "mean above zero",
    };
    let height = known(roughness.obstacle_height_m, format!("{:.5} m ({kind})", roughness.obstacle_height_m));
    let mut text = format!("\n\nobstacle height h*  {height}\n{}", columns(&rows));
    roughness.notes.iter().for_each(|note| text.push_str(&format!("\n  note: {note}")));
    text
}

/// `roughness`.
pub fn roughness(args: &Roughness, common: &Common) -> Verdict {
    let mut params = json!({});
    parameters::assign(&mut params, &args.set)?;
    let reading = reading(&args.reading)?;
    let request = verbs::roughness::Request {
        dem: &args.dem,
        parameters: params,
        classes: args.classes.as_deref(),
        reading,
        ride: ride_request(args),
        wind: wind_settings(args),
    };
    let (described, read_notes) = waiting("measuring", common.quiet, || verbs::roughness::roughness(&request))?;
    let summary = &described.summary;
    let h = &summary.heights;
    let percent = |share: f64| if share.is_nan() { "none".to_owned() } else { format!("{:.2} %", 100.0 * share) };
    let rows = [
        ("cells with data", percent(summary.valid_share)),
        ("height", format!("{:.4} to {:.4} m, relief {:.4} m", h.min_m, h.max_m, h.relief_m)),
        ("RMS height", format!("{:.5} m, skewness {:.3}, kurtosis {:.3}", h.rms_m, h.skewness, h.kurtosis)),
        ("RMS slope", format!("{:.4}", summary.rms_slope)),
        ("band RMS", format!("{:.5} m below {:.3} m", summary.band_rms_m, summary.band_window_m)),
        ("low roughness", percent(summary.shares.low)),
        ("semi roughness", percent(summary.shares.semi)),
        (
            "high roughness",
            format!("{}, excluding a border of {} m", percent(summary.shares.high), summary.share_border_m),
        ),
        ("PSD slope", format!("{:.3}", summary.psd_slope)),
    ];
    let rows = rows.into_iter().chain(areal(&summary.areal)).chain(described.ride.iter().flat_map(ride));
    let rows: Vec<Vec<String>> = rows.map(|(name, value)| vec![name.to_owned(), value]).collect();
    let mut text = columns(&rows);
    described.aerodynamic.iter().for_each(|roughness| text.push_str(&aerodynamic(roughness)));
    read_notes.iter().for_each(|note| text.push_str(&format!("\n  note: {note}")));
    print(common.json, &serde_json::to_value(&described).map_err(Failure::failed)?, &text)?;
    Ok(Code::Done)
}
