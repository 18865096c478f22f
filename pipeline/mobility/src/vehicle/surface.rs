//! Surface of the ground: friction and rolling resistance, by preset, by roughness class, or by raster.
//!
//! The surface of a study is a preset with changes. Roughness classes may have their own surfaces. Rasters of friction and of
//! rolling resistance override the wheel coefficients where they hold data. The ground is rigid: a preset is a set of
//! coefficients, not a soil model.

use sastrugi_numeric::Grid;
use sastrugi_schemas::{ParameterError, RoughnessClass, limits};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Friction and rolling resistance of the ground.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SurfaceParameters {
    /// Material of the ground.
    pub preset: SurfacePreset,
    /// Friction coefficient between tyre and ground; the preset's when absent.
    #[schemars(transform = limits::not_negative)]
    pub wheel_friction: Option<f64>,
    /// Friction coefficient between chassis and ground; the preset's when absent.
    #[schemars(transform = limits::not_negative)]
    pub belly_friction: Option<f64>,
    /// Rolling resistance coefficient (resistance divided by normal force); the preset's when absent.
    #[schemars(transform = limits::not_negative)]
    pub rolling_resistance: Option<f64>,
    /// Surface of cells of low roughness, if it differs.
    pub low: Option<ClassSurfaceParameters>,
    /// Surface of cells of semi roughness, if it differs.
    pub semi: Option<ClassSurfaceParameters>,
    /// Surface of cells of high roughness, if it differs.
    pub high: Option<ClassSurfaceParameters>,
}

/// The surface of one roughness class.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ClassSurfaceParameters {
    /// Material of the ground; the study's surface when absent.
    pub preset: Option<SurfacePreset>,
    /// Friction coefficient between tyre and ground.
    #[schemars(transform = limits::not_negative)]
    pub wheel_friction: Option<f64>,
    /// Friction coefficient between chassis and ground.
    #[schemars(transform = limits::not_negative)]
    pub belly_friction: Option<f64>,
    /// Rolling resistance coefficient (resistance divided by normal force).
    #[schemars(transform = limits::not_negative)]
    pub rolling_resistance: Option<f64>,
}

/// Ground materials.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SurfacePreset {
    /// The ground of Majhor and Bos: the friction of the Husky's URDF.
    #[default]
    Study,
    /// Dry earth road.
    HardSoil,
    /// Dry loose sand.
    Sand,
    /// Hard-packed snow.
    CompactedSnow,
    /// Ice.
    Ice,
    /// Dry rock.
    Rock,
}

/// Name, coefficients and sources of a preset.
pub(crate) struct Material {
    pub preset: SurfacePreset,
    pub name: &'static str,
    pub friction: Friction,
    pub summary: &'static str,
    pub source: &'static str,
}

const fn friction(wheel: f64, belly: f64, rolling: f64) -> Friction {
    Friction { wheel, belly, rolling }
}

/// All presets.
pub(crate) const MATERIALS: [Material; 6] = [
    Material {
        preset: SurfacePreset::Study,
        name: "study",
        friction: friction(1.0, 0.5, 0.03),
        summary: "the ground of Majhor and Bos",
        source: "wheels: husky_description URDF; chassis and rolling resistance assumed (hard soil)",
    },
    Material {
        preset: SurfacePreset::HardSoil,
        name: "hard_soil",
        friction: friction(0.68, 0.5, 0.05),
        summary: "dry earth road",
        source: "Wong (2008), Theory of Ground Vehicles: peak adhesion of a dry earth road, rolling resistance of an unpaved \
                 road; chassis assumed",
    },
    Material {
        preset: SurfacePreset::Sand,
        name: "sand",
        friction: friction(0.53, 0.5, 0.2),
        summary: "dry loose sand, treated as rigid",
        source: "wheels: tangent of the friction angle of dry sand, 28 deg (Wong, 2008, terrain values); rolling resistance \
                 within Wong's 0.1 to 0.35 of a field; chassis assumed",
    },
    Material {
        preset: SurfacePreset::CompactedSnow,
        name: "compacted_snow",
        friction: friction(0.2, 0.1, 0.03),
        summary: "hard-packed snow",
        source: "wheels: Wong (2008), peak adhesion on hard-packed snow; chassis and rolling resistance assumed",
    },
    Material {
        preset: SurfacePreset::Ice,
        name: "ice",
        friction: friction(0.1, 0.05, 0.015),
        summary: "smooth ice near its melting point",
        source: "wheels: Wong (2008), peak adhesion on ice; chassis assumed; rolling resistance as on concrete (Wong, 2008)",
    },
    Material {
        preset: SurfacePreset::Rock,
        name: "rock",
        friction: friction(0.8, 0.5, 0.015),
        summary: "dry rock, with the grip of concrete",
        source: "wheels and rolling resistance: as dry concrete (Wong, 2008: 0.8 to 0.9, 0.013); chassis assumed",
    },
];

/// Coefficients at one place.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(crate) struct Friction {
    /// Between tyre and ground.
    #[serde(rename = "wheel_friction")]
    pub wheel: f64,
    /// Between chassis and ground.
    #[serde(rename = "belly_friction")]
    pub belly: f64,
    /// Rolling resistance coefficient.
    #[serde(rename = "rolling_resistance")]
    pub rolling: f64,
}

impl SurfacePreset {
    /// Source of its coefficients.
    pub(crate) fn source(self) -> &'static str {
        MATERIALS.iter().find(|m| m.preset == self).map_or("", |m| m.source)
    }
}

impl Friction {
    /// Coefficients of a preset.
    fn of(preset: SurfacePreset) -> Self {
        MATERIALS.iter().find(|m| m.preset == preset).map_or(MATERIALS[0].friction, |m| m.friction)
    }

    fn with(self, wheel: Option<f64>, belly: Option<f64>, rolling: Option<f64>) -> Self {
        Self {
            wheel: wheel.unwrap_or(self.wheel),
            belly: belly.unwrap_or(self.belly),
            rolling: rolling.unwrap_or(self.rolling),
        }
    }

    fn check(self) -> Result<(), ParameterError> {
        ParameterError::not_negative("wheel_friction", self.wheel)?;
        ParameterError::not_negative("belly_friction", self.belly)?;
        ParameterError::not_negative("rolling_resistance", self.rolling).map(drop)
    }
}

impl SurfaceParameters {
    pub(crate) fn check(&self) -> Result<(), ParameterError> {
        self.friction().check()?;
        let classes = [("low", &self.low), ("semi", &self.semi), ("high", &self.high)];
        let check = |(name, class): (&str, &Option<ClassSurfaceParameters>)| match class {
            Some(class) => class.friction(self.friction()).check().map_err(|e| e.within(name)),
            None => Ok(()),
        };
        classes.into_iter().try_for_each(check)
    }

    /// Coefficients where no class or raster overrides them.
    pub(crate) fn friction(&self) -> Friction {
        Friction::of(self.preset).with(self.wheel_friction, self.belly_friction, self.rolling_resistance)
    }

    /// Fills in the coefficients of the preset.
    pub(crate) fn fill(&mut self) {
        let Friction { wheel, belly, rolling } = self.friction();
        (self.wheel_friction, self.belly_friction, self.rolling_resistance) = (Some(wheel), Some(belly), Some(rolling));
    }

    /// Whether a class has a surface of its own.
    pub fn differs_by_class(&self) -> bool {
        self.low.is_some() || self.semi.is_some() || self.high.is_some()
    }

    fn by_class(&self) -> [Friction; 3] {
        let all = self.friction();
        [&self.low, &self.semi, &self.high].map(|class| class.as_ref().map_or(all, |class| class.friction(all)))
    }
}

impl ClassSurfaceParameters {
    fn friction(&self, all: Friction) -> Friction {
        let base = self.preset.map_or(all, Friction::of);
        base.with(self.wheel_friction, self.belly_friction, self.rolling_resistance)
    }
}

/// Rasters that override the surface locally; each has its own geometry, in the terrain's coordinates.
#[derive(Clone, Debug, Default)]
pub struct SurfaceLayers {
    /// Codes of [`RoughnessClass`].
    pub classes: Option<Grid<u8>>,
    /// Friction coefficient between tyre and ground; NaN where the surface's own applies.
    pub wheel_friction: Option<Grid>,
    /// Rolling resistance coefficient; NaN where the surface's own applies.
    pub rolling_resistance: Option<Grid>,
}

impl SurfaceLayers {
    /// True when the surface is the same everywhere.
    pub fn is_empty(&self) -> bool {
        self.classes.is_none() && self.wheel_friction.is_none() && self.rolling_resistance.is_none()
    }
}

/// A raster with an invalid coefficient.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("use {value} at ({x_m:.2}, {y_m:.2}) m for {what}: it must be finite and not negative, or no data")]
pub struct SurfaceError {
    /// Quantity that the raster holds.
    pub what: &'static str,
    /// The value.
    pub value: f64,
    /// Easting of the cell centre, m.
    pub x_m: f64,
    /// Northing of the cell centre, m.
    pub y_m: f64,
}

/// The surface at every point of a terrain.
#[derive(Clone, Debug)]
pub struct SurfaceMap {
    all: Friction,
    by_class: [Friction; 3],
    layers: SurfaceLayers,
}

impl SurfaceMap {
    /// The surface from parameters and layers. The value of a layer applies throughout its cell.
    ///
    /// # Errors
    /// A raster with a negative or infinite value.
    ///
    /// ```
    /// use sastrugi_mobility::vehicle::{SurfaceLayers, SurfaceMap, SurfaceParameters};
    /// use sastrugi_numeric::{Geometry, Grid};
    ///
    /// // Ice on one cell of the study's ground.
    /// let mut friction = Grid::filled(Geometry::square(4, 4, 1.0), f64::NAN);
    /// friction.values[5] = 0.1;
    /// let layers = |friction| SurfaceLayers { wheel_friction: Some(friction), ..SurfaceLayers::default() };
    /// assert!(SurfaceMap::new(&SurfaceParameters::default(), layers(friction.clone())).is_ok());
    /// friction.values[5] = -0.1;
    /// let error = SurfaceMap::new(&SurfaceParameters::default(), layers(friction)).unwrap_err();
    /// assert_eq!((error.what, error.value, error.x_m, error.y_m), ("wheel friction", -0.1, 1.5, 2.5));
    /// ```
    pub fn new(parameters: &SurfaceParameters, layers: SurfaceLayers) -> Result<Self, SurfaceError> {
        check_layer("wheel friction", layers.wheel_friction.as_ref())?;
        check_layer("rolling resistance", layers.rolling_resistance.as_ref())?;
        Ok(Self { all: parameters.friction(), by_class: parameters.by_class(), layers })
    }

    /// Coefficients at a point.
    pub(crate) fn at(&self, x: f64, y: f64) -> Friction {
        let class = self.layers.classes.as_ref().and_then(|map| crate::missions::class_at(map, x, y));
        let surface = class.map_or(self.all, |class: RoughnessClass| self.by_class[class as usize]);
        let value = |layer: &Option<Grid>| {
            let grid = layer.as_ref()?;
            let (row, col) = grid.geometry.cell_at(x, y)?;
            Some(grid.at(row, col)).filter(|v| !v.is_nan())
        };
        surface.with(value(&self.layers.wheel_friction), None, value(&self.layers.rolling_resistance))
    }
}

fn check_layer(what: &'static str, layer: Option<&Grid>) -> Result<(), SurfaceError> {
    let Some(grid) = layer else { return Ok(()) };
    match grid.values.iter().position(|v| *v < 0.0 || v.is_infinite()) {
        None => Ok(()),
        Some(k) => {
            let (x_m, y_m) = (grid.geometry.x(k % grid.cols()), grid.geometry.y(k / grid.cols()));
            Err(SurfaceError { what, value: grid.values[k], x_m, y_m })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sastrugi_numeric::Geometry;
    use serde_json::json;

    fn surface(value: serde_json::Value) -> SurfaceParameters {
        serde_json::from_value(value).unwrap()
    }

    #[test]
    fn val_presets_and_changes() {
        assert_eq!(surface(json!({})).friction(), friction(1.0, 0.5, 0.03));
        assert_eq!(surface(json!({"preset": "ice"})).friction(), friction(0.1, 0.05, 0.015));
        assert_eq!(surface(json!({"preset": "sand", "wheel_friction": 0.4})).friction(), friction(0.4, 0.5, 0.2));
        for material in &MATERIALS {
            assert_eq!(Friction::of(material.preset), material.friction);
            assert_eq!(serde_json::to_value(material.preset).unwrap(), material.name);
        }
    }

    #[test]
    fn val_classes_and_rasters() {
        let parameters =
            surface(json!({"preset": "rock", "high": {"preset": "sand"}, "semi": {"wheel_friction": 0.3}}));
        let g = Geometry::square(1, 4, 1.0);
        let layers = SurfaceLayers {
            classes: Some(Grid::new(g, vec![0, 1, 2, 2])),
            wheel_friction: Some(Grid::new(g, vec![f64::NAN, f64::NAN, f64::NAN, 0.9])),
            rolling_resistance: None,
        };
        let map = SurfaceMap::new(&parameters, layers.clone()).unwrap();
        let wheel = |x: f64| map.at(x, 0.5).wheel;
        assert_eq!([wheel(0.5), wheel(1.5), wheel(2.5), wheel(3.5), wheel(9.0)], [0.8, 0.3, 0.53, 0.9, 0.8]);
        assert_eq!(map.at(3.5, 0.5).rolling, 0.2);
        // The belly takes the friction of its class, whatever the raster of the wheels holds.
        assert_eq!([map.at(0.5, 0.5), map.at(3.5, 0.5)], [friction(0.8, 0.5, 0.015), friction(0.9, 0.5, 0.2)]);
        let rolling = SurfaceLayers { rolling_resistance: Some(Grid::filled(g, 0.07)), ..layers.clone() };
        let map = SurfaceMap::new(&parameters, rolling).unwrap();
        assert_eq!([map.at(1.5, 0.5), map.at(9.0, 0.5)], [friction(0.3, 0.5, 0.07), friction(0.8, 0.5, 0.015)]);
        let negative = SurfaceLayers { rolling_resistance: Some(Grid::new(g, vec![0.0, -0.1, 0.0, 0.0])), ..layers };
        let error = SurfaceMap::new(&parameters, negative).unwrap_err().to_string();
        assert!(error.contains("-0.1 at (1.50, 0.50) m for rolling resistance"), "{error}");
    }

    #[test]
    fn val_bad_surfaces_are_refused() {
        let refused = |value| surface(value).check().unwrap_err().key;
        assert_eq!(refused(json!({"wheel_friction": -1})), "wheel_friction");
        assert_eq!(refused(json!({"high": {"rolling_resistance": -1}})), "high.rolling_resistance");
        assert!(serde_json::from_value::<SurfaceParameters>(json!({"preset": "mud"})).is_err());
    }
}
