//! Coordinate reference systems: interpreted only as far as needed, and passed through unchanged.

/// A coordinate reference system, as described by GeoTIFF keys. The default is a local plane in metres.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Crs {
    /// True if coordinates are degrees of longitude and latitude.
    pub geographic: bool,
    /// EPSG code, if the system has one.
    pub epsg: Option<u16>,
    /// Name; empty if the file gives none.
    pub name: String,
    /// GeoTIFF keys in ascending order, without the raster type, as written to derived rasters.
    pub keys: Vec<(u16, GeoKey)>,
}

/// Value of a GeoTIFF key.
#[derive(Clone, Debug, PartialEq)]
pub enum GeoKey {
    /// Code.
    Short(u16),
    /// Numbers.
    Double(Vec<f64>),
    /// Text.
    Ascii(String),
}

pub(super) const MODEL_TYPE: u16 = 1024;
pub(super) const RASTER_TYPE: u16 = 1025;
const CITATION: u16 = 1026;
const GEODETIC_CRS: u16 = 2048;
const GEODETIC_CITATION: u16 = 2049;
const PROJECTED_CRS: u16 = 3072;
const PROJECTED_CITATION: u16 = 3073;
const LINEAR_UNITS: u16 = 3076;
const VERTICAL_UNITS: u16 = 4099;

const MODEL_GEOGRAPHIC: u16 = 2;
/// Codes for `undefined` and `user-defined`.
const NO_CODE: [u16; 2] = [0, 32767];

impl Crs {
    /// Longitude and latitude on WGS 84.
    pub fn wgs84() -> Self {
        let keys = vec![(MODEL_TYPE, GeoKey::Short(MODEL_GEOGRAPHIC)), (GEODETIC_CRS, GeoKey::Short(4326))];
        Self { geographic: true, epsg: Some(4326), name: "WGS 84".to_owned(), keys }
    }

    /// The system that GeoTIFF keys describe.
    pub(crate) fn from_keys(mut keys: Vec<(u16, GeoKey)>) -> Self {
        keys.retain(|(id, _)| *id != RASTER_TYPE);
        keys.sort_by_key(|(id, _)| *id);
        let mut crs = Self { keys, ..Self::default() };
        crs.geographic = crs.short(MODEL_TYPE) == Some(MODEL_GEOGRAPHIC);
        let code = if crs.geographic { GEODETIC_CRS } else { PROJECTED_CRS };
        crs.epsg = crs.short(code).filter(|code| !NO_CODE.contains(code));
        let citation = if crs.geographic { GEODETIC_CITATION } else { PROJECTED_CITATION };
        let name = [citation, CITATION, GEODETIC_CITATION].into_iter().find_map(|id| crs.ascii(id));
        crs.name = name.unwrap_or_default().trim_matches('|').to_owned();
        crs
    }

    /// Notes on units other than metres.
    pub(crate) fn unit_notes(&self) -> Vec<String> {
        let not_metre = |id| self.short(id).filter(|unit| *unit != 9001 && !NO_CODE.contains(unit));
        let horizontal = not_metre(LINEAR_UNITS).filter(|_| !self.geographic);
        let vertical = not_metre(VERTICAL_UNITS);
        let sentence = |what: &str, unit: u16| format!("{what} are in the unit EPSG:{unit} but are treated as metres");
        let notes = [horizontal.map(|u| sentence("coordinates", u)), vertical.map(|u| sentence("heights", u))];
        notes.into_iter().flatten().collect()
    }

    /// Note on writing to a format without a reference system.
    pub(super) fn loss_notes(&self) -> Vec<String> {
        let known = *self != Self::default();
        known.then(|| "the format does not store the coordinate reference system".to_owned()).into_iter().collect()
    }

    fn get(&self, id: u16) -> Option<&GeoKey> {
        self.keys.iter().find(|(key, _)| *key == id).map(|(_, value)| value)
    }

    fn short(&self, id: u16) -> Option<u16> {
        if let Some(GeoKey::Short(v)) = self.get(id) { Some(*v) } else { None }
    }

    fn ascii(&self, id: u16) -> Option<&str> {
        if let Some(GeoKey::Ascii(v)) = self.get(id) { Some(v) } else { None }
    }
}
