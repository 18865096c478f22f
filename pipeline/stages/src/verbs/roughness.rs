//! `roughness`: statistics and roughness classes of a DEM, its ride-relevant roughness, and its aerodynamic roughness.

use super::{Read, Reading, parameters, read};
use crate::error::Error;
use crate::operations::roughness::settings;
use crate::study::check_roughness;
use sastrugi_mobility::vehicle::TraverseParameters;
use sastrugi_numeric::Grid;
pub use sastrugi_roughness::{
    AerodynamicRoughness, ArealParameters, Detrender, ObstacleHeight, Ride, WindEstimate, WindSettings,
};
use sastrugi_roughness::{
    BandError, DescribeSettings, Summary, WaveBand, WindError, aerodynamic_roughness, classify, describe,
    moore_gradient,
};
use sastrugi_schemas::kind::{read_parameters, schema_of};
use sastrugi_schemas::study::RoughnessSection;
use sastrugi_store::atomic;
use sastrugi_store::dem as store;
use serde::Serialize;
use serde_json::{Value, json};
use std::fmt::Write;
use std::path::Path;

/// What to describe.
pub struct Request<'a> {
    /// DEM.
    pub dem: &'a Path,
    /// Settings of `[roughness]`.
    pub parameters: Value,
    /// Class map to write.
    pub classes: Option<&'a Path>,
    /// How the DEM is read.
    pub reading: Reading,
    /// Ride roughness to evaluate.
    pub ride: Option<RideRequest<'a>>,
    /// Wind directions for the roughness length.
    pub wind: Option<WindSettings>,
}

/// Source of the wavelength band.
pub enum Bumps<'a> {
    /// A vehicle: `wb=WHEELBASE,r=RADIUS` in m, a name, or a vehicle file.
    Vehicle(&'a str),
    /// `MIN:MAX` in m.
    Band(&'a str),
}

/// Settings for ride roughness.
pub struct RideRequest<'a> {
    /// The band.
    pub bumps: Bumps<'a>,
    /// Detrending.
    pub detrender: Detrender,
    /// Whether cells may be too large for the shortest wavelength.
    pub allow_coarse: bool,
    /// Map of the RMS to write, as text.
    pub map: Option<&'a Path>,
    /// Raster of the predicted RMS.
    pub predicted: Option<&'a Path>,
}

/// Roughness of a DEM.
#[derive(Serialize)]
pub struct Described {
    /// The surface.
    #[serde(flatten)]
    pub summary: Summary,
    /// Ride-relevant roughness.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ride: Option<Ride>,
    /// Roughness length by wind direction.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub aerodynamic: Option<AerodynamicRoughness>,
}

/// Computes the roughness of a DEM; returns it with notes on how the DEM was read.
///
/// # Errors
/// Unknown settings, a DEM that cannot be read or does not contain the band or the outer scale, a map that cannot be written.
pub fn roughness(request: &Request<'_>) -> Result<(Described, Vec<String>), Error> {
    let wanted = Wanted::new(&request.parameters, request.ride.as_ref(), request.wind.as_ref())?;
    let Read { dem, notes, .. } = read(request.dem, &request.reading)?;
    let described = wanted.of(&dem.grid)?;
    if let Some(path) = request.classes {
        let classes = classify(&moore_gradient(&dem.grid), &wanted.settings.thresholds);
        store::write_classes(path, &classes, &dem.info.crs).map_err(Error::failed)?;
    }
    Ok((described, notes))
}

/// What is to be computed of a surface, checked before it is read.
pub(crate) struct Wanted<'a> {
    settings: DescribeSettings,
    ride: Option<(&'a RideRequest<'a>, WaveBand)>,
    wind: Option<&'a WindSettings>,
}

impl<'a> Wanted<'a> {
    /// Checks settings, ride and wind.
    pub(crate) fn new(
        parameters: &Value,
        ride: Option<&'a RideRequest<'a>>,
        wind: Option<&'a WindSettings>,
    ) -> Result<Self, Error> {
        parameters::check_schema(parameters, &schema_of::<RoughnessSection>(), "roughness")?;
        let section: RoughnessSection = read_parameters(parameters)?;
        check_roughness(&section)?;
        let settings = settings(&section)?;
        let ride = ride.map(|ride| Ok::<_, Error>((ride, band(&ride.bumps)?))).transpose()?;
        Ok(Self { settings, ride, wind })
    }

    /// The roughness of a surface in metres; writes the ride's map if there is one.
    pub(crate) fn of(&self, dem: &Grid) -> Result<Described, Error> {
        let ride = self.ride.as_ref().map(|(ride, band)| ride_over(dem, ride, band)).transpose()?;
        let aerodynamic = self.wind.map(|wind| aerodynamic_over(dem, wind)).transpose()?;
        Ok(Described { summary: describe(dem, &self.settings), ride, aerodynamic })
    }
}

/// Roughness length by wind direction.
fn aerodynamic_over(dem: &Grid, wind: &WindSettings) -> Result<AerodynamicRoughness, Error> {
    aerodynamic_roughness(dem, wind).map_err(|e| match e {
        WindError::NoDirection | WindError::Azimuth { .. } => Error::Usage(format!("`--wind-from`: {e}")),
        WindError::OuterScale { .. } => Error::Usage(format!("`--outer-scale`: {e}")),
        WindError::Narrow { .. } | WindError::Wide { .. } => Error::Input(e.to_string()),
    })
}

/// The requested band.
fn band(bumps: &Bumps<'_>) -> Result<WaveBand, Error> {
    let refused = |option: &str, text: &str, e: BandError| Error::Usage(format!("`{option} {text}`: {e}"));
    match bumps {
        Bumps::Band(text) => {
            let [min, max] = super::numbers("--band", &text.replacen(':', ",", 1))
                .map_err(|_| Error::Usage(format!("`--band {text}`: expected two lengths in m, MIN:MAX")))?;
            WaveBand::new(min, max).map_err(|e| refused("--band", text, e))
        }
        Bumps::Vehicle(text) => {
            let [wheelbase, radius] = lengths_of_vehicle(text)?;
            WaveBand::of_vehicle(wheelbase, radius).map_err(|e| refused("--vehicle", text, e))
        }
    }
}

/// Wheelbase and tyre radius, m.
fn lengths_of_vehicle(text: &str) -> Result<[f64; 2], Error> {
    if !text.contains('=') {
        let mut params = json!({});
        parameters::assign_vehicle(&mut params, text)?;
        let (vehicle, _) = read_parameters::<TraverseParameters>(&params)?.prepare()?;
        return Ok([vehicle.wheelbase_m(), vehicle.parameters().wheels.radius_m]);
    }
    let mut lengths = [None; 2];
    for pair in text.split(',') {
        let (place, value) = match pair.split_once('=').map(|(name, value)| (name.trim(), value.trim().parse())) {
            Some(("wb", Ok(value))) => (0, value),
            Some(("r", Ok(value))) => (1, value),
            _ => return Err(not_a_vehicle(text)),
        };
        lengths[place] = Some(value);
    }
    match lengths {
        [Some(wheelbase), Some(radius)] => Ok([wheelbase, radius]),
        _ => Err(not_a_vehicle(text)),
    }
}

fn not_a_vehicle(text: &str) -> Error {
    Error::Usage(format!(
        "`--vehicle {text}`: expected wb=WHEELBASE,r=TYRE_RADIUS in m, the name of a vehicle, or a vehicle file"
    ))
}

/// Computes the ride roughness, and writes its map if requested.
fn ride_over(dem: &Grid, request: &RideRequest<'_>, band: &WaveBand) -> Result<Ride, Error> {
    if request.predicted.is_some() && request.detrender != Detrender::Band {
        let message =
            "predictions exist only for `--detrend band`; results of other detrenders are not comparable with them";
        return Err(Error::Usage(format!("`--rms-predicted`: {message}")));
    }
    let ride = Ride::of(dem, band, request.detrender, request.allow_coarse).map_err(|e| match e {
        BandError::Coarse { .. } => Error::Input(format!("{e} (override with `--allow-coarse`)")),
        e => Error::Input(e.to_string()),
    })?;
    if let Some(path) = request.map {
        let predicted = request.predicted.map(|path| predicted(path, dem)).transpose()?;
        let text = map_as_text(&ride, predicted.as_ref());
        atomic::write(path, text.as_bytes()).map_err(|e| Error::at(path, e))?;
    }
    Ok(ride)
}

/// The raster of predicted RMS, on the cells of the DEM.
fn predicted(path: &Path, dem: &Grid) -> Result<Grid, Error> {
    let grid = read(path, &Reading::default())?.dem.grid;
    if grid.geometry == dem.geometry {
        Ok(grid)
    } else {
        Err(Error::Input(format!("{}: its cells do not match those of the DEM", path.display())))
    }
}

/// A header line, then lines `x y rms_predicted rms_measured` (the third only with a prediction), spaced by the longest wavelength,
/// wherever the window is complete.
fn map_as_text(ride: &Ride, predicted: Option<&Grid>) -> String {
    let g = ride.map.geometry;
    let [min, max] = ride.band_m;
    let columns = if predicted.is_some() { "rms_pred_m rms_meas_m" } else { "rms_meas_m" };
    let mut text = format!(
        "# x_m y_m {columns}; RMS in wavelengths of {min} to {max} m, detrender {}, windows of {:.3} m\n",
        ride.detrender.name(),
        3.0 * max
    );
    let [step_x, step_y] = g.cell.map(|cell| ((max / cell).round() as usize).max(1));
    for row in (step_y / 2..g.rows).step_by(step_y) {
        for col in (step_x / 2..g.cols).step_by(step_x).filter(|&col| ride.map.at(row, col).is_finite()) {
            let before = predicted.map(|p| format!("{:.6} ", p.at(row, col))).unwrap_or_default();
            // Writing to a string cannot fail.
            let _ = writeln!(text, "{:.3} {:.3} {before}{:.6}", g.x(col), g.y(row), ride.map.at(row, col));
        }
    }
    text
}
