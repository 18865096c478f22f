//! The list of generators.

use crate::cascade::{Cascade, RawCascade};
use crate::compose::{Compose, RawCompose};
use crate::elaborate::{Elaborate, RawElaborate};
use crate::generator::Generator;
use crate::mavs;
use crate::mavs::gap::{Gap, RawGap};
use crate::mavs::octaves::{RawVanDeusen, RawVariable, VanDeusen, Variable};
use crate::mavs::ornstein_uhlenbeck::{Gaussian, OrnsteinUhlenbeck, RawGaussian, RawOrnsteinUhlenbeck};
use crate::mavs::pothole::{Pothole, RawPothole};
use crate::mavs::profile::{Profile, RawProfile};
use crate::mavs::two_layers::{RawTwoLayers, TwoLayers};
use crate::multifractal::{Multifractal, RawMultifractal};
use crate::planetary::{Planetary, RawPlanetary};
use crate::spheroids::{RawSpheroids, Spheroids};
use crate::weierstrass_mandelbrot::{RawWeierstrassMandelbrot, WeierstrassMandelbrot};
use sastrugi_schemas::kind::{read_parameters, schema_of};
use sastrugi_schemas::{Kind, ParameterError};
use schemars::JsonSchema;
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value};

/// One generator.
struct Entry {
    kind: &'static str,
    summary: &'static str,
    source: &'static str,
    parameters: fn() -> Value,
    prepare: fn(&Value) -> Result<Box<dyn Generator>, ParameterError>,
}

const ENTRIES: &[Entry] = &[
    Entry {
        kind: crate::weierstrass_mandelbrot::KIND,
        summary: "monofractal sum of ridged plane waves, with the same fractal dimension everywhere",
        source: "Majhor and Bos, Eq. 1-2; Ausloos and Berman (1985)",
        parameters: schema_of::<RawWeierstrassMandelbrot>,
        prepare: prepare_as::<RawWeierstrassMandelbrot, WeierstrassMandelbrot>,
    },
    Entry {
        kind: crate::multifractal::KIND,
        summary: "product of three filtered Weierstrass-Mandelbrot layers: smooth and rough areas side by side",
        source: "Majhor and Bos, section 2.1 and Table 1",
        parameters: schema_of::<RawMultifractal>,
        prepare: prepare_as::<RawMultifractal, Multifractal>,
    },
    Entry {
        kind: crate::cascade::KIND,
        summary: "true multifractal: fractionally integrated log-normal cascade with prescribed K(q) and zeta(q)",
        source: "Schertzer and Lovejoy (1987); Gagnon, Lovejoy and Schertzer (2006)",
        parameters: schema_of::<RawCascade>,
        prepare: prepare_as::<RawCascade, Cascade>,
    },
    Entry {
        kind: crate::compose::KIND,
        summary: "other generators and surfaces combined step by step: sum, product, blend, mask, clip, scale to relief, trail",
        source: "sastrugi",
        parameters: schema_of::<RawCompose>,
        prepare: prepare_as::<RawCompose, Compose>,
    },
    Entry {
        kind: crate::spheroids::KIND,
        summary: "hills shaped as upper halves of random spheroids, from plain to very rough",
        source: "Bayrak (2008), Algorithm 10",
        parameters: schema_of::<RawSpheroids>,
        prepare: prepare_as::<RawSpheroids, Spheroids>,
    },
    Entry {
        kind: mavs::MAVS_PERLIN,
        summary: "a rough layer of Perlin noise over a gently rolling one",
        source: "Terrain Roughness in MAVS, Algorithm 1",
        parameters: schema_of::<RawTwoLayers>,
        prepare: prepare_as::<RawTwoLayers, TwoLayers>,
    },
    Entry {
        kind: mavs::MAVS_GAUSSIAN,
        summary: "a correlated Gaussian field over rolling ground, or the published listing",
        source: "Terrain Roughness in MAVS, Algorithm 2",
        parameters: schema_of::<RawGaussian>,
        prepare: prepare_as::<RawGaussian, Gaussian>,
    },
    Entry {
        kind: mavs::MAVS_VARIABLE,
        summary: "octaves of Perlin noise with the published amplitudes (profile PSD f^-3), modulated by a field of scales",
        source: "Terrain Roughness in MAVS, Algorithm 3",
        parameters: schema_of::<RawVariable>,
        prepare: prepare_as::<RawVariable, Variable>,
    },
    Entry {
        kind: mavs::VAN_DEUSEN,
        summary: "octaves of Perlin noise with a power-law PSD (natural ground: f^-2), scaled to a roughness in a vehicle's band",
        source: "Terrain Roughness in MAVS, Algorithm 3, corrected; Van Deusen (1967)",
        parameters: schema_of::<RawVanDeusen>,
        prepare: prepare_as::<RawVanDeusen, VanDeusen>,
    },
    Entry {
        kind: mavs::ORNSTEIN_UHLENBECK,
        summary: "stationary Gaussian field with separable or isotropic, exponential or Gaussian covariance",
        source: "Terrain Roughness in MAVS, Algorithm 2, corrected; Dietrich and Newsam (1997)",
        parameters: schema_of::<RawOrnsteinUhlenbeck>,
        prepare: prepare_as::<RawOrnsteinUhlenbeck, OrnsteinUhlenbeck>,
    },
    Entry {
        kind: mavs::GAP,
        summary: "a trench across level or rough ground",
        source: "MAVS random_scene.cpp",
        parameters: schema_of::<RawGap>,
        prepare: prepare_as::<RawGap, Gap>,
    },
    Entry {
        kind: mavs::POTHOLE,
        summary: "round holes in level ground",
        source: "MAVS random_scene.cpp",
        parameters: schema_of::<RawPothole>,
        prepare: prepare_as::<RawPothole, Pothole>,
    },
    Entry {
        kind: mavs::MAVS_PROFILE,
        summary: "one filtered Gaussian profile along x, the same for every y",
        source: "MAVS profile_2d.cpp",
        parameters: schema_of::<RawProfile>,
        prepare: prepare_as::<RawProfile, Profile>,
    },
    Entry {
        kind: crate::planetary::KIND,
        summary: "a patch of a world with texture, craters, rocks and dust, bit-identical however it is cut and zoomed",
        source: "JPL synthetic terrain environment, section 2; Golombek and Rapp (1997)",
        parameters: schema_of::<RawPlanetary>,
        prepare: prepare_as::<RawPlanetary, Planetary>,
    },
    Entry {
        kind: crate::elaborate::KIND,
        summary: "a measured DEM refined below its post spacing: its own background plus fitted texture, bounded craters and rocks",
        source: "JPL synthetic terrain environment, section 1; Keys (1981)",
        parameters: schema_of::<RawElaborate>,
        prepare: prepare_as::<RawElaborate, Elaborate>,
    },
];

/// Every generator, with the JSON Schema of its parameters.
///
/// ```
/// let kinds = sastrugi_terrain::kinds();
/// let cascade = kinds.iter().find(|kind| kind.kind == "cascade").expect("a generator");
/// assert!(cascade.source.contains("Schertzer and Lovejoy"));
/// assert!(cascade.parameters["properties"]["codimension"]["description"].is_string());
/// ```
pub fn kinds() -> Vec<Kind> {
    let describe = |e: &Entry| Kind {
        family: "terrain",
        kind: e.kind,
        summary: e.summary,
        source: e.source,
        parameters: (e.parameters)(),
    };
    ENTRIES.iter().map(describe).collect()
}

/// The generator `kind` with `params`: a JSON object (or null) of the parameters that differ from the defaults.
///
/// # Errors
/// A [`ParameterError`] for an unknown kind, an unknown parameter, or a value out of range.
///
/// # Examples
/// ```
/// use sastrugi_numeric::Streams;
/// use sastrugi_terrain::prepare;
/// use serde_json::json;
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// // A trench with upright walls, half a metre deep and ten cells wide.
/// let params = json!({"size_px": [40, 5], "cell_m": 0.1, "depth_m": 0.5, "width_m": 1.0, "wall_angle_deg": 0.0});
/// let terrain = prepare("gap", &params)?.generate(&Streams::for_seed(1, "terrain"), &[])?;
/// assert_eq!(terrain.heights.row(0).iter().filter(|z| **z == -0.5).count(), 10);
/// // Errors name the parameter.
/// let refused = prepare("gap", &json!({"depth_m": -1.0})).err().map(|error| error.key);
/// assert_eq!(refused.as_deref(), Some("depth_m"));
/// # Ok(())
/// # }
/// ```
pub fn prepare(kind: &str, params: &Value) -> Result<Box<dyn Generator>, ParameterError> {
    match ENTRIES.iter().find(|e| e.kind == kind) {
        Some(entry) => (entry.prepare)(params),
        None => {
            let known: Vec<String> = ENTRIES.iter().map(|e| format!("`{}`", e.kind)).collect();
            let message = format!("`{kind}` is not a terrain generator; the known ones are {}", known.join(", "));
            Err(ParameterError::new("kind", message))
        }
    }
}

/// Whether the generator `kind` has a parameter `name`.
pub(crate) fn has_parameter(kind: &str, name: &str) -> bool {
    ENTRIES.iter().any(|e| e.kind == kind && (e.parameters)()["properties"].get(name).is_some())
}

fn prepare_as<Raw, Checked>(params: &Value) -> Result<Box<dyn Generator>, ParameterError>
where
    Raw: Default + Serialize + DeserializeOwned + JsonSchema,
    Checked: TryFrom<Raw, Error = ParameterError> + Generator + 'static,
{
    Ok(Box::new(Checked::try_from(read::<Raw>(params)?)?))
}

/// Raw parameters: the defaults, overridden by the given ones.
pub(crate) fn read<Raw>(params: &Value) -> Result<Raw, ParameterError>
where
    Raw: Default + Serialize + DeserializeOwned,
{
    read_parameters(&over_defaults::<Raw>(params)?)
}

/// The defaults merged with the given parameters, table by table: setting one parameter of a layer leaves the
/// others at that layer's defaults.
fn over_defaults<Raw: Default + Serialize>(params: &Value) -> Result<Value, ParameterError> {
    let nothing = Map::new();
    let given = match params {
        Value::Object(given) => given,
        Value::Null => &nothing,
        other => return Err(ParameterError::new("", format!("is {other}; it must be a table of parameters"))),
    };
    let mut all = serde_json::to_value(Raw::default()).map_err(|e| ParameterError::new("", e.to_string()))?;
    if let Value::Object(all) = &mut all {
        merge(all, given);
    }
    Ok(all)
}

fn merge(all: &mut Map<String, Value>, given: &Map<String, Value>) {
    for (key, value) in given {
        match (all.get_mut(key), value) {
            (Some(Value::Object(below)), Value::Object(above)) => merge(below, above),
            _ => {
                all.insert(key.clone(), value.clone());
            }
        }
    }
}

#[cfg(test)]
mod tests;
