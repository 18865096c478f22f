//! The form of a covariance: its terms, with or without nugget and anisotropy, and the names of its parameters.
//!
//! `[anisotropic:]MODEL[+MODEL][+nugget]`, such as `exponential`, `matern+nugget`, `anisotropic:exponential+gaussian`.

use super::{Covariance, MODELS, Model, Structure, model};
use sastrugi_schemas::ParameterError;
use std::collections::BTreeMap;

/// Most terms of a sum.
const TERMS_MAX: usize = 2;
/// Smallest ratio of anisotropy.
const RATIO_MIN: f64 = 0.02;

/// A form of covariance.
#[derive(Clone)]
pub struct Form {
    name: String,
    terms: Vec<&'static dyn Model>,
    nugget: bool,
    anisotropic: bool,
}

/// The role of a parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// Standard deviation of a term.
    Sigma(usize),
    /// Range of a term.
    Range(usize),
    /// Shape of a term.
    Shape(usize),
    /// Nugget.
    Nugget,
    /// Ratio of anisotropy.
    Ratio,
    /// Azimuth of the long axis.
    Azimuth,
}

/// A parameter of a form.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    /// Name in fit files.
    pub name: String,
    /// Its role.
    pub role: Role,
}

impl Parameter {
    /// Its value in a covariance.
    pub fn of(&self, covariance: &Covariance) -> f64 {
        match self.role {
            Role::Sigma(k) => covariance.structures[k].sigma_m,
            Role::Range(k) => covariance.structures[k].range_m,
            Role::Shape(k) => covariance.structures[k].shape,
            Role::Nugget => covariance.nugget_m2,
            Role::Ratio => covariance.ratio,
            Role::Azimuth => covariance.azimuth_deg,
        }
    }
}

impl Form {
    /// Regular expression of the names of forms, for JSON Schemas. It has no place for the rule that `self_affine` cannot be part of a sum.
    ///
    /// ```
    /// use sastrugi_texture::covariance::Form;
    ///
    /// assert!(Form::pattern().starts_with(r"(anisotropic:)?(exponential|gaussian|"));
    /// ```
    pub fn pattern() -> String {
        let names: Vec<&str> = MODELS.iter().map(|model| model.kind().kind).collect();
        let term = format!("({})", names.join("|"));
        format!(r"(anisotropic:)?{term}(\+{term}){{0,{}}}(\+nugget)?", TERMS_MAX - 1)
    }

    /// Parses the name of a form.
    ///
    /// # Errors
    /// An unknown word, with the known ones; more than two terms.
    pub fn parse(name: &str) -> Result<Self, ParameterError> {
        let (anisotropic, rest) = match name.strip_prefix("anisotropic:") {
            Some(rest) => (true, rest),
            None => (false, name),
        };
        let (nugget, rest) = match rest.strip_suffix("+nugget") {
            Some(rest) => (true, rest),
            None => (false, rest),
        };
        let terms = rest.split('+').map(model).collect::<Result<Vec<_>, _>>()?;
        if terms.len() > TERMS_MAX {
            return Err(ParameterError::new("model", format!("is `{name}`; a sum has at most {TERMS_MAX} terms")));
        }
        if terms.len() > 1 && terms.iter().any(|t| t.scale_names().1.is_none()) {
            let message = format!("is `{name}`; a self-affine surface has no variance and cannot be part of a sum");
            return Err(ParameterError::new("model", message));
        }
        Ok(Self { name: name.to_owned(), terms, nugget, anisotropic })
    }

    /// Its name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Its terms.
    pub fn terms(&self) -> &[&'static dyn Model] {
        &self.terms
    }

    /// True if it has a nugget.
    pub fn has_nugget(&self) -> bool {
        self.nugget
    }

    /// True if the range depends on direction.
    pub fn is_anisotropic(&self) -> bool {
        self.anisotropic
    }

    /// The same form without anisotropy.
    pub fn isotropic(&self) -> Self {
        let name = self.name.strip_prefix("anisotropic:").unwrap_or(&self.name).to_owned();
        Self { name, anisotropic: false, ..self.clone() }
    }

    /// The same form with anisotropy.
    pub fn with_axis(&self) -> Self {
        let name = format!("anisotropic:{}", self.isotropic().name);
        Self { name, anisotropic: true, ..self.clone() }
    }

    /// Its parameters in order. Those of a second term have `_2` before the unit, or at the end.
    pub fn parameters(&self) -> Vec<Parameter> {
        let mut all = Vec::new();
        for (k, term) in self.terms.iter().enumerate() {
            let named = |name: &str, role| Parameter { name: numbered(name, k), role };
            let (sigma, range) = term.scale_names();
            all.push(named(sigma, Role::Sigma(k)));
            all.extend(range.map(|r| named(r, Role::Range(k))));
            all.extend(term.shape().map(|s| named(s.name, Role::Shape(k))));
        }
        let other = |name: &str, role| Parameter { name: name.to_owned(), role };
        if self.nugget {
            all.push(other("nugget_m2", Role::Nugget));
        }
        if self.anisotropic {
            all.extend([other("ratio", Role::Ratio), other("azimuth_deg", Role::Azimuth)]);
        }
        all
    }

    /// The covariance with the parameters of a fit file.
    ///
    /// # Errors
    /// A parameter that is missing, unknown or out of range.
    pub fn covariance(&self, values: &BTreeMap<String, f64>) -> Result<Covariance, ParameterError> {
        let known = self.parameters();
        if let Some(key) = values.keys().find(|key| known.iter().all(|p| p.name != **key)) {
            let names: Vec<&str> = known.iter().map(|p| p.name.as_str()).collect();
            let message = format!("is not a parameter of model `{}`, which has {}", self.name, names.join(", "));
            return Err(ParameterError::new(key, message));
        }
        let mut covariance = self.unit();
        for parameter in &known {
            let found = values.get(&parameter.name).copied();
            let value = found.ok_or_else(|| ParameterError::new(&parameter.name, "is missing from the fit file"))?;
            self.set(&mut covariance, parameter, value)?;
        }
        Ok(covariance)
    }

    /// The form with unit parameters.
    pub fn unit(&self) -> Covariance {
        let term = |model: &&'static dyn Model| Structure {
            model: *model,
            sigma_m: 1.0,
            range_m: 1.0,
            shape: model.shape().map_or(0.0, |s| s.start),
        };
        Covariance { structures: self.terms.iter().map(term).collect(), nugget_m2: 0.0, ratio: 1.0, azimuth_deg: 0.0 }
    }

    fn set(&self, covariance: &mut Covariance, parameter: &Parameter, value: f64) -> Result<(), ParameterError> {
        let name = &parameter.name;
        match parameter.role {
            Role::Sigma(k) => covariance.structures[k].sigma_m = ParameterError::positive(name, value)?,
            Role::Range(k) => covariance.structures[k].range_m = ParameterError::positive(name, value)?,
            Role::Shape(k) => {
                let (low, high) = self.terms[k].shape().map_or((0.0, 0.0), |s| s.bounds);
                if !(low..=high).contains(&value) {
                    return Err(ParameterError::new(name, format!("is {value}; it must lie in [{low}, {high}]")));
                }
                covariance.structures[k].shape = value;
            }
            Role::Nugget => covariance.nugget_m2 = ParameterError::not_negative(name, value)?,
            Role::Ratio => {
                if !(RATIO_MIN..=1.0).contains(&value) {
                    return Err(ParameterError::new(name, format!("is {value}; it must lie in [{RATIO_MIN}, 1]")));
                }
                covariance.ratio = value;
            }
            Role::Azimuth => {
                if !value.is_finite() {
                    return Err(ParameterError::new(name, format!("is {value}; it must be finite")));
                }
                covariance.azimuth_deg = half_turn(value);
            }
        }
        Ok(())
    }
}

/// An axis's azimuth reduced to [0, 180).
pub fn half_turn(azimuth_deg: f64) -> f64 {
    let turned = azimuth_deg - 180.0 * (azimuth_deg / 180.0).floor();
    if turned < 180.0 { turned } else { 0.0 }
}

/// The name of a parameter of the term `k`, counted from 0.
fn numbered(name: &str, k: usize) -> String {
    match (k, name.strip_suffix("_m")) {
        (0, _) => name.to_owned(),
        (_, Some(stem)) => format!("{stem}_{}_m", k + 1),
        (_, None) => format!("{name}_{}", k + 1),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(form: &str) -> Vec<String> {
        Form::parse(form).unwrap().parameters().into_iter().map(|p| p.name).collect()
    }

    #[test]
    fn val_names_of_parameters() {
        assert_eq!(names("exponential"), ["sigma_m", "range_m"]);
        assert_eq!(names("matern+nugget"), ["sigma_m", "range_m", "smoothness", "nugget_m2"]);
        assert_eq!(names("self_affine"), ["increment_1m_m", "hurst"]);
        assert_eq!(
            names("anisotropic:exponential+matern+nugget"),
            ["sigma_m", "range_m", "sigma_2_m", "range_2_m", "smoothness_2", "nugget_m2", "ratio", "azimuth_deg"]
        );
        assert_eq!(Form::parse("exponential+nugget").unwrap().with_axis().name(), "anisotropic:exponential+nugget");
    }

    #[test]
    fn val_unknown_forms_are_refused() {
        let message = |name: &str| Form::parse(name).err().unwrap().to_string();
        assert!(message("cubic").contains("spherical") && message("cubic").contains("nugget"));
        assert!(message("exponential+gaussian+spherical").contains("at most 2"));
        assert!(message("self_affine+exponential").contains("no variance"));
        assert!(message("").contains("is ``"));
    }

    #[test]
    fn val_values_are_checked() {
        let form = Form::parse("anisotropic:exponential").unwrap();
        let with = |ratio: f64, azimuth_deg: f64| {
            let values = [("sigma_m", 0.1), ("range_m", 0.3), ("ratio", ratio), ("azimuth_deg", azimuth_deg)];
            form.covariance(&values.map(|(k, v)| (k.to_owned(), v)).into())
        };
        assert!(with(0.0, 10.0).err().unwrap().to_string().contains("ratio"));
        let covariance = with(0.5, 200.0).unwrap();
        assert!((covariance.azimuth_deg - 20.0).abs() < 1e-12);
        // Along the axis, 20 degrees east of north, distances are unchanged; across, they count double.
        let (sin, cos) = libm::sincos(20f64.to_radians());
        assert!((covariance.distance_m([sin, cos]) - 1.0).abs() < 1e-12);
        assert!((covariance.distance_m([cos, -sin]) - 2.0).abs() < 1e-12);
        assert_eq!(covariance.parameters(&form)["ratio"], 0.5);
    }
}
