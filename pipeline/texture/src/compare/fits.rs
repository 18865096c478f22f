//! Compares two fit files by their intervals.

use super::verdict::{Finding, Null, decide, overall};
use super::{CompareParameters, CompareSettings, Comparison, Measure};
use crate::covariance::form::Role;
use crate::covariance::{Covariance, Form, Parameter};
use sastrugi_numeric::Streams;
use sastrugi_schemas::ParameterError;
use sastrugi_schemas::fit::{FitFile, Intervals};
use sastrugi_statistics::normal;

/// Points of a null distribution.
const DRAWS: usize = 1999;
/// Windows that differ by more than this share are noted.
const WINDOW_SHARE: f64 = 0.05;
/// Name of the null in results.
const KIND: &str = "intervals of the fits";

/// Compares two fit files.
///
/// # Errors
/// A fit whose model or parameters are invalid; too few simulations.
pub fn fits(
    a: &FitFile,
    b: &FitFile,
    settings: &CompareSettings,
    streams: &Streams,
) -> Result<Comparison, ParameterError> {
    settings.check_simulations()?;
    let files = [a, b];
    let sides = [Side::new("A", a)?, Side::new("B", b)?];
    let parameters = settings.parameters();
    let mut findings = shared(&sides, parameters);
    findings.push(anisotropy(&sides, parameters, streams));
    findings.push(Finding {
        name: "height_distribution".to_owned(),
        values: [None, None],
        measure: Measure::Distance,
        bound: parameters.equivalence_heights,
        known: Err("a fit file contains no heights: compare the DEMs".to_owned()),
        words: String::new(),
    });
    let quantities = decide(findings, parameters.alpha);
    let (answer, sentence) = overall(&quantities);
    Ok(Comparison {
        what: "fits",
        quantities,
        interleaved: None,
        blocks: None,
        answer,
        sentence,
        alpha: parameters.alpha,
        model: a.model.clone(),
        simulations: 0,
        streams: streams.label(),
        notes: notes(files),
    })
}

struct Side<'a> {
    name: &'static str,
    file: &'a FitFile,
    form: Form,
    covariance: Covariance,
}

impl<'a> Side<'a> {
    fn new(name: &'static str, file: &'a FitFile) -> Result<Self, ParameterError> {
        let covariance = Covariance::of_fit(file).map_err(|e| e.within(name))?;
        Ok(Self { name, file, form: Form::parse(&file.model)?, covariance })
    }

    /// The wider of the parameter's intervals, and its half-width in standard errors of a normal variable.
    fn interval(&self, name: &str) -> Result<([f64; 2], f64), String> {
        let given = || [&self.file.intervals, &self.file.block_intervals].into_iter().flatten();
        if given().filter_map(|i| i.values.get(name)).any(|ends| ends.contains(&None)) {
            return Err(format!("the interval of {name} of {} is open: its data do not bound it", self.name));
        }
        let of = |i: &Intervals| {
            let [low, high] = *i.values.get(name)?;
            Some(([low?, high?], normal::quantile(0.5 + 0.5 * i.level)))
        };
        let width = |(i, _): &([f64; 2], f64)| i[1] - i[0];
        given().filter_map(of).max_by(|x, y| width(x).total_cmp(&width(y))).ok_or_else(|| {
            format!("{} has no interval of {name}: fit it with a bootstrap (`fit --bootstrap 99`)", self.name)
        })
    }

    /// Standard error of the logarithm of a parameter.
    fn log_error(&self, name: &str) -> Result<f64, String> {
        let ([low, high], z) = self.interval(name)?;
        let error = (libm::log(high) - libm::log(low)) / (2.0 * z);
        let sound = low > 0.0 && error.is_finite() && error > 0.0;
        sound
            .then_some(error)
            .ok_or_else(|| format!("the interval of {name} of {} is not positive or has no width", self.name))
    }
}

/// Sigma, b and shapes of two fits with the same model.
fn shared(sides: &[Side; 2], parameters: &CompareParameters) -> Vec<Finding> {
    let [a, b] = sides;
    let one_model = a.form.isotropic().name() == b.form.isotropic().name();
    let mut all = Vec::new();
    for parameter in a.form.parameters() {
        let bound = match parameter.role {
            Role::Sigma(_) => parameters.equivalence_sigma,
            Role::Range(_) => parameters.equivalence_range,
            Role::Shape(_) => parameters.equivalence_shape,
            Role::Nugget | Role::Ratio | Role::Azimuth => continue,
        };
        let other = one_model.then(|| parameter.of(&b.covariance));
        let known = match one_model {
            true => log_ratio(sides, &parameter),
            false => Err(format!(
                "A is {}, B is {}: their parameters are not comparable; fit both with one model",
                a.form.name(),
                b.form.name()
            )),
        };
        all.push(Finding {
            values: [Some(parameter.of(&a.covariance)), other],
            measure: Measure::LogRatio,
            bound: libm::log1p(bound),
            known,
            words: format!("the ratio of {}", parameter.name),
            name: parameter.name,
        });
    }
    all
}

fn log_ratio([a, b]: &[Side; 2], parameter: &Parameter) -> Result<(f64, Null), String> {
    let (p, q) = (a.log_error(&parameter.name)?, b.log_error(&parameter.name)?);
    let error = (p * p + q * q).sqrt();
    let draws = (0..DRAWS).map(|k| error * normal::quantile((k as f64 + 0.5) / DRAWS as f64)).collect();
    let difference = libm::log(parameter.of(&b.covariance) / parameter.of(&a.covariance));
    Ok((difference, Null { kind: KIND, draws, widened: 1.0 }))
}

/// Anisotropy, if both fits are anisotropic. Elongations scatter along the axis like the logarithm of the ratio, and across it
/// like twice the azimuth.
fn anisotropy(sides: &[Side; 2], parameters: &CompareParameters, streams: &Streams) -> Finding {
    let [a, b] = sides;
    let elongations = sides.each_ref().map(|s| elongation(&s.covariance));
    let apart = length([elongations[1][0] - elongations[0][0], elongations[1][1] - elongations[0][1]]);
    let known = || {
        if let Some(side) = sides.iter().find(|s| !s.form.is_anisotropic()) {
            let name = side.form.with_axis();
            return Err(format!(
                "{} is isotropic: fit both with --model {}, or compare the DEMs",
                side.name,
                name.name()
            ));
        }
        let errors = [errors(a)?, errors(b)?];
        let mut stream = streams.stream("anisotropy");
        let draws = (0..DRAWS).map(|_| {
            let ends = [0, 1].map(|k| {
                let [along, across] = errors[k].map(|e| e * stream.normal());
                let (sin, cos) = libm::sincos(2.0 * sides[k].covariance.azimuth_deg.to_radians());
                [along * cos - across * sin, along * sin + across * cos]
            });
            length([ends[1][0] - ends[0][0], ends[1][1] - ends[0][1]])
        });
        Ok((apart, Null { kind: KIND, draws: draws.collect(), widened: 1.0 }))
    };
    Finding {
        name: "anisotropy".to_owned(),
        values: sides.each_ref().map(|s| s.form.is_anisotropic().then_some(s.covariance.ratio)),
        measure: Measure::Distance,
        bound: libm::log1p(parameters.equivalence_anisotropy),
        known: known(),
        words: super::surfaces::elongation_words(&a.covariance, &b.covariance),
    }
}

/// Standard errors of the elongation along and across its axis.
fn errors(side: &Side) -> Result<[f64; 2], String> {
    let along = side.log_error("ratio")?;
    let ([low, high], z) = side.interval("azimuth_deg")?;
    let turn = (high - low).to_radians() / (2.0 * z);
    Ok([along, -2.0 * libm::log(side.covariance.ratio) * turn])
}

fn elongation(covariance: &Covariance) -> [f64; 2] {
    let (sin, cos) = libm::sincos(2.0 * covariance.azimuth_deg.to_radians());
    [cos, sin].map(|v| -libm::log(covariance.ratio) * v)
}

fn length([x, y]: [f64; 2]) -> f64 {
    (x * x + y * y).sqrt()
}

fn notes([a, b]: [&FitFile; 2]) -> Vec<String> {
    let mut notes = Vec::new();
    if let (Some(p), Some(q)) = (a.window_m, b.window_m)
        && (p[0] - q[0]).abs() > WINDOW_SHARE * p[0].max(q[0])
    {
        notes.push(format!(
            "A was fitted with a window of {:.3} m, B with {:.3} m: for a surface without scale separation the parameters differ for \
             that reason alone",
            p[0], q[0]
        ));
    }
    for (side, file) in [("A", a), ("B", b)] {
        if file.mode == "paper" {
            notes
                .push(format!("{side} is a fit in paper mode: its sigma and b are too small, and it has no intervals"));
        }
        notes.extend(file.warnings.iter().map(|w| format!("{side}: {w}")));
    }
    notes
}
