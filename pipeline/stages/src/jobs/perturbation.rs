//! Designs of a perturbed rover: which parameters of a navigator are varied, and their values. Works on parameters as JSON, for any navigator.
//!
//! A number takes `levels` values between `(1 - share)` and `(1 + share)` times its own value; a list of numbers is scaled as one. Whole numbers
//! are rounded, and left out if rounding leaves a step without a change. Numbers equal to 0 are left out too, because every share of 0 is 0.
//! Effects are divided by the actual change, rounding included. A design that the navigator refuses is an error in the study: values are never
//! clipped.

use super::rover::{self, prepare};
use crate::study::keys::nearest;
use sastrugi_mobility::rover::{Navigator, RoverParameters};
use sastrugi_numeric::Streams;
use sastrugi_schemas::ParameterError;
use sastrugi_schemas::study::Perturb;
use sastrugi_statistics::morris::Trajectory;
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;

/// Maximum number of rovers of a design, unless the study sets `rovers`.
const ROVERS: u32 = 10;
/// Key of a trial whose numbers may also be perturbed.
const NOISE: &str = "noise";
/// Units by the suffix of a name.
const UNITS: [(&str, &str); 7] = [
    ("_m_s", "m/s"),
    ("_deg_s", "deg/s"),
    ("_rad_s", "rad/s"),
    ("_deg", "deg"),
    ("_rad", "rad"),
    ("_s", "s"),
    ("_m", "m"),
];

/// A number that is perturbed.
#[derive(Clone, Debug, PartialEq)]
pub struct Perturbed {
    /// Its name; dotted if it is inside a table.
    pub name: String,
    /// Its value in the study; NaN for lists.
    pub base: f64,
    /// Ratio to the value in the study, by level.
    pub factors: Vec<f64>,
    /// Value, by level.
    values: Vec<Value>,
}

impl Perturbed {
    /// Its unit, from the suffix of its name.
    pub fn unit(&self) -> &'static str {
        UNITS.iter().find(|(end, _)| self.name.ends_with(end)).map_or("1", |(_, unit)| unit)
    }
}

/// One design along a trajectory.
#[derive(Clone, Debug)]
pub struct Design {
    /// The navigator with its perturbed numbers.
    pub navigator: Navigator,
    /// The trial with its perturbed noise.
    pub parameters: RoverParameters,
    /// Ratio of each perturbed number to its value in the study.
    pub factors: Vec<f64>,
}

/// The designs of a trajectory.
#[derive(Clone, Debug)]
pub struct TrajectoryDesigns {
    /// Designs: the number of perturbed parameters plus one.
    pub designs: Vec<Design>,
    /// Index of the number that changes from each design to the next.
    pub order: Vec<usize>,
}

/// All designs of a rover stage.
///
/// ```
/// use sastrugi_numeric::Streams;
/// use sastrugi_schemas::study::Perturb;
/// use sastrugi_stages::jobs::perturbation::Perturbation;
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let settings = Perturb { parameters: vec!["hazard_step_m".to_owned()], trajectories: 2, ..Perturb::default() };
/// let streams = Streams::for_seed(1, "rover_designs");
/// let found = Perturbation::new("sojourner_like", &serde_json::json!({}), &settings, &streams)?;
/// // One number is perturbed, so each trajectory has two designs: before and after its step of 2 x 2 / 3 x 10 %.
/// assert_eq!((found.perturbed.len(), found.perturbed[0].unit()), (1, "m"));
/// for trajectory in &found.trajectories {
///     let step = trajectory.designs[1].factors[0] - trajectory.designs[0].factors[0];
///     assert!((step.abs() - 0.4 / 3.0).abs() < 1e-12);
/// }
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct Perturbation {
    /// How it is perturbed.
    pub settings: Perturb,
    /// Number of rovers of each design on each world.
    pub rovers: u32,
    /// The perturbed numbers, sorted by name.
    pub perturbed: Vec<Perturbed>,
    /// Reasons why numbers were left out, one for each.
    pub left_out: Vec<String>,
    /// Trajectories.
    pub trajectories: Vec<TrajectoryDesigns>,
}

impl Perturbation {
    /// The designs around a trial; `params` are its parameters in the study, and the trajectories are drawn from `streams`.
    ///
    /// # Errors
    /// Settings out of range, an unknown parameter, nothing to perturb, or a design that the navigator refuses.
    pub fn new(kind: &str, params: &Value, settings: &Perturb, streams: &Streams) -> Result<Self, ParameterError> {
        let at = |e: ParameterError| e.within("perturb");
        settings.check().map_err(at)?;
        let (navigator, trial) = prepare(kind, params)?;
        let rovers = settings.rovers.unwrap_or(trial.rovers.min(ROVERS));
        let mut base = params.clone();
        set(&mut base, "rovers", json!(rovers));
        let (mut perturbed, mut left_out) = (Vec::new(), Vec::new());
        for (name, value) in chosen(&navigator, &trial, &settings.parameters).map_err(at)? {
            match moved(&name, &value, settings) {
                Ok(one) => perturbed.push(one),
                Err(reason) => left_out.push(reason),
            }
        }
        if perturbed.is_empty() {
            let reasons = left_out.join("; ");
            return Err(at(ParameterError::new("parameters", format!("leaves nothing to perturb: {reasons}"))));
        }
        let of_number = |number: u32| {
            let mut stream = streams.stream(&format!("trajectory-{:03}", number + 1));
            let Trajectory { levels, order } = Trajectory::draw(perturbed.len(), settings.levels, &mut stream);
            let designs = levels.iter().map(|levels| design(kind, &base, &perturbed, levels));
            Ok(TrajectoryDesigns { designs: designs.collect::<Result<_, ParameterError>>()?, order })
        };
        let trajectories = (0..settings.trajectories).map(of_number).collect::<Result<_, ParameterError>>()?;
        Ok(Self { settings: settings.clone(), rovers, perturbed, left_out, trajectories })
    }

    /// Factors of a design as JSON, for the tables.
    pub fn factors_json(&self, design: &Design) -> String {
        let pairs = self.perturbed.iter().zip(&design.factors).map(|(p, f)| (p.name.clone(), json!(f)));
        Value::Object(pairs.collect::<Map<_, _>>()).to_string()
    }
}

/// The numbers to perturb, by name.
fn chosen(
    navigator: &Navigator,
    trial: &RoverParameters,
    wanted: &[String],
) -> Result<BTreeMap<String, Value>, ParameterError> {
    let mut own = BTreeMap::new();
    collect("", &rover::parameters(navigator), &mut own);
    if wanted.is_empty() {
        return Ok(own);
    }
    let mut all = own;
    collect(NOISE, &json!(trial.noise), &mut all);
    let one = |(k, name): (usize, &String)| match all.get(name) {
        Some(value) => Ok((name.clone(), value.clone())),
        None => {
            let of = format!("names `{name}`, which is not a number of `{}` or its noise", navigator.kind());
            let help = match nearest(name, all.keys().map(String::as_str)) {
                Some(near) => format!("did you mean `{near}`?"),
                None => format!("known numbers: {}", all.keys().cloned().collect::<Vec<_>>().join(", ")),
            };
            Err(ParameterError::new(format!("parameters.{k}"), format!("{of}; {help}")))
        }
    };
    wanted.iter().enumerate().map(one).collect()
}

/// Collects the numbers and lists of numbers inside a value, by dotted name.
fn collect(name: &str, value: &Value, found: &mut BTreeMap<String, Value>) {
    match value {
        Value::Object(map) => {
            for (key, value) in map {
                collect(&if name.is_empty() { key.clone() } else { format!("{name}.{key}") }, value, found);
            }
        }
        Value::Number(_) => drop(found.insert(name.to_owned(), value.clone())),
        Value::Array(list) if !list.is_empty() && list.iter().all(Value::is_f64) => {
            found.insert(name.to_owned(), value.clone());
        }
        _ => {}
    }
}

/// A number with its levels, or the reason why it is left out.
fn moved(name: &str, value: &Value, settings: &Perturb) -> Result<Perturbed, String> {
    let of_level = |level: u32| 1.0 + settings.share * (2.0 * f64::from(level) / f64::from(settings.levels - 1) - 1.0);
    let wanted: Vec<f64> = (0..settings.levels).map(of_level).collect();
    let base = value.as_f64().unwrap_or(f64::NAN);
    let is_zero = value.as_array().map_or(base == 0.0, |list| list.iter().all(|v| v.as_f64() == Some(0.0)));
    if is_zero {
        return Err(format!("`{name}` is 0, so a relative perturbation cannot change it"));
    }
    let factors: Vec<f64> = match value {
        Value::Number(n) if !n.is_f64() => wanted.iter().map(|f| (base * f).round() / base).collect(),
        _ => wanted,
    };
    let half = (settings.levels / 2) as usize;
    if factors.iter().zip(&factors[half..]).any(|(before, after)| before == after) {
        let share = 100.0 * settings.share;
        return Err(format!(
            "`{name}` is {value}, a whole number, and {share} % of it is too little to change it at every step"
        ));
    }
    let values = factors.iter().map(|factor| scaled(value, *factor)).collect();
    Ok(Perturbed { name: name.to_owned(), base, factors, values })
}

fn scaled(value: &Value, factor: f64) -> Value {
    match value {
        Value::Array(list) => list.iter().map(|v| scaled(v, factor)).collect(),
        Value::Number(n) => match n.as_u64() {
            Some(whole) => json!((whole as f64 * factor).round() as u64),
            None => json!(n.as_f64().unwrap_or(f64::NAN) * factor),
        },
        other => other.clone(),
    }
}

/// The design at these levels.
fn design(kind: &str, base: &Value, perturbed: &[Perturbed], levels: &[u32]) -> Result<Design, ParameterError> {
    let mut params = base.clone();
    let mut factors = Vec::with_capacity(levels.len());
    for (one, &level) in perturbed.iter().zip(levels) {
        factors.push(one.factors[level as usize]);
        set(&mut params, &one.name, one.values[level as usize].clone());
    }
    let (navigator, parameters) = prepare(kind, &params).map_err(|e| {
        let advice = "lower `perturb.share`, or list in `perturb.parameters` only those to perturb";
        ParameterError::new("perturb", format!("produces a design that is refused: {e}; {advice}"))
    })?;
    Ok(Design { navigator, parameters, factors })
}

/// Sets a dotted parameter.
fn set(params: &mut Value, dotted: &str, value: Value) {
    let mut at = params;
    for word in dotted.split('.') {
        if !at.is_object() {
            *at = Value::Object(Map::new());
        }
        at = &mut at[word];
    }
    *at = value;
}

#[cfg(test)]
mod tests {
    use super::*;

    fn perturbation(kind: &str, params: Value, settings: Value) -> Result<Perturbation, String> {
        let settings: Perturb = serde_json::from_value(settings).unwrap();
        let streams = Streams::for_seed(1, "perturbation-test");
        Perturbation::new(kind, &params, &settings, &streams).map_err(|e| e.to_string())
    }

    fn names(p: &Perturbation) -> Vec<&str> {
        p.perturbed.iter().map(|one| one.name.as_str()).collect()
    }

    /// Every number of every navigator is perturbed, whatever its type, and nothing else is.
    #[test]
    fn val_every_number_of_a_navigator_is_perturbed() {
        let kinds: Vec<&str> = rover::kinds().iter().map(|k| k.kind).collect();
        assert_eq!(kinds.len(), 3, "{kinds:?}");
        for kind in kinds {
            let p = perturbation(kind, json!({}), json!({"share": 0.1, "trajectories": 3})).unwrap();
            let (navigator, _) = prepare(kind, &json!({})).unwrap();
            let mut own = BTreeMap::new();
            collect("", &rover::parameters(&navigator), &mut own);
            assert_eq!(p.perturbed.len() + p.left_out.len(), own.len(), "{kind}");
            assert_eq!((p.trajectories.len(), p.rovers), (3, 10));
            for trajectory in &p.trajectories {
                assert_eq!(trajectory.designs.len(), p.perturbed.len() + 1);
                for (pair, &k) in trajectory.designs.windows(2).zip(&trajectory.order) {
                    let changed: Vec<usize> =
                        (0..p.perturbed.len()).filter(|&i| pair[0].factors[i] != pair[1].factors[i]).collect();
                    assert_eq!(changed, [k]);
                    let step = (pair[1].factors[k] - pair[0].factors[k]).abs();
                    // Whole numbers are rounded, both before and after the step.
                    let Perturbed { name, base, .. } = &p.perturbed[k];
                    let rounding = if name == "cycle_limit" { 1.0 / base } else { 0.0 };
                    assert!((step - 0.2 * 2.0 / 3.0).abs() < 1e-9 + rounding, "{name}: {step}");
                    let [before, after] = [&pair[0], &pair[1]].map(|design| rover::parameters(&design.navigator));
                    assert_ne!(before, after, "{kind}: {}", p.perturbed[k].name);
                }
            }
        }
    }

    #[test]
    fn val_lists_whole_numbers_zeros_and_noise() {
        let settings = json!({"share": 0.2, "trajectories": 1, "parameters": ["rectangles", "noise.slip", "commit_m", "noise.turn"]});
        let params = json!({"noise": {"slip": 0.1}});
        let p = perturbation("schoppers_like", params.clone(), settings).unwrap();
        assert_eq!(names(&p), ["commit_m", "noise.slip", "rectangles"]);
        assert_eq!(p.left_out, ["`noise.turn` is 0, so a relative perturbation cannot change it"]);
        // 3.2, 3.7, 4.3 and 4.8 rectangles.
        assert_eq!(p.perturbed[2].factors, [0.75, 1.0, 1.0, 1.25]);
        assert_eq!(p.perturbed.iter().map(Perturbed::unit).collect::<Vec<_>>(), ["m", "1", "1"]);
        let p = perturbation("schoppers_like", params, json!({"parameters": ["rectangles", "commit_m"]})).unwrap();
        assert_eq!((names(&p), p.left_out.len()), (vec!["commit_m"], 1));
        let p = perturbation("sojourner_like", json!({}), json!({"levels": 2, "parameters": ["columns_m"]})).unwrap();
        assert!(p.perturbed[0].base.is_nan() && p.perturbed[0].values[0][0] == json!(0.3 * 0.9), "{p:?}");
        assert!(p.factors_json(&p.trajectories[0].designs[0]).starts_with("{\"columns_m\":"));
    }

    /// Adding trajectories does not change the first ones.
    #[test]
    fn prop_trajectories_have_their_own_streams() {
        let of = |n: u32| perturbation("sojourner_like", json!({}), json!({"trajectories": n})).unwrap().trajectories;
        let (few, many) = (of(2), of(5));
        assert_eq!((few.len(), many.len()), (2, 5));
        assert!(few.iter().zip(&many).all(|(a, b)| a.order == b.order && a.designs[0].factors == b.designs[0].factors));
    }

    #[test]
    fn val_refusals() {
        let refused = |params: Value, settings: Value| perturbation("sojourner_like", params, settings).unwrap_err();
        let check = |settings: Value, words: &str| {
            let error = refused(json!({}), settings);
            assert!(error.contains(words), "{error}");
        };
        check(json!({"share": 0.0}), "`perturb.share` is 0; it must lie above 0 and below 1");
        check(json!({"share": 1.0}), "`perturb.share` is 1;");
        check(json!({"trajectories": 0}), "`perturb.trajectories` is 0; it must be 1 to 999");
        check(json!({"levels": 5}), "`perturb.levels` is 5; it must be even");
        check(json!({"rovers": 0}), "`perturb.rovers` is 0");
        check(json!({"parameters": ["hazard_stp_m"]}), "did you mean `hazard_step_m`?");
        check(json!({"parameters": ["starts"]}), "which is not a number of `sojourner_like`");
        check(json!({"parameters": ["noise.slip"]}), "leaves nothing to perturb: `noise.slip` is 0");
        let error = refused(json!({"tilt_max_deg": 88.0}), json!({"share": 0.1}));
        assert!(error.contains("a design that is refused: `tilt_max_deg` is 9"), "{error}");
    }
}
