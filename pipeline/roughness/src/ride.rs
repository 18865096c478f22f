//! Ride-relevant roughness: band RMS, PSD slope, ISO 8608 class and IRI.

use crate::detrend::{BandError, Detrended, Detrender, WaveBand};
use crate::iri::{Iri, iri};
use crate::plane::level;
use crate::power_law::{PowerLaw, iso_8608_class};
use crate::profiles::profile_spectra;
use crate::structure::Direction;
use sastrugi_numeric::Grid;
use serde::Serialize;

/// Ride-relevant roughness of the profiles of a surface in a band of wavelengths. Undefined values are NaN.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Ride {
    /// Shortest and longest wavelength, m.
    pub band_m: [f64; 2],
    /// How the local mean was removed; results of different detrenders are not comparable.
    pub detrender: Detrender,
    /// RMS about the local mean, m.
    pub rms_m: f64,
    /// RMS of the profiles along x and along y, m; one value for both with the moving average.
    pub rms_along_m: Vec<f64>,
    /// Power law fitted to the PSD of the profiles in the band.
    pub power_law: Option<PowerLaw>,
    /// Density of the power law at 0.1 cycles/m, m3; extrapolated if the fitted frequencies do not reach there.
    pub iso_8608_psd_m3: f64,
    /// ISO 8608 class of that density.
    pub iso_8608_class: Option<char>,
    /// International Roughness Index.
    pub iri: Iri,
    /// RMS in a window of three times the longest wavelength about each cell, m.
    #[serde(skip)]
    pub map: Grid,
}

impl Ride {
    /// Ride-relevant roughness of a DEM; `allow_coarse` accepts cells that are too large for the shortest wavelength.
    ///
    /// # Errors
    /// Cells that are too large; a surface shorter than four times the longest wavelength.
    ///
    /// # Examples
    /// ```
    /// use sastrugi_numeric::{Geometry, Grid};
    /// use sastrugi_roughness::{Detrender, Ride, WaveBand};
    /// use std::f64::consts::TAU;
    ///
    /// # fn main() -> Result<(), Box<dyn std::error::Error>> {
    /// // Waves along x, 2 m long and 2 cm high above the mean, on 40 x 20 m in cells of 10 cm.
    /// let geometry = Geometry::square(200, 400, 0.1);
    /// let heights = (0..geometry.len()).map(|k| 0.02 * (TAU * geometry.x(k % 400) / 2.0).sin()).collect();
    /// let dem = Grid::new(geometry, heights);
    /// let ride = Ride::of(&dem, &WaveBand::new(1.0, 4.0)?, Detrender::Band, false)?;
    /// // A profile along x has the RMS of a sine, one along y none.
    /// assert!((ride.rms_along_m[0] / (0.02 / 2_f64.sqrt()) - 1.0).abs() < 0.02);
    /// assert!(ride.rms_along_m[1] < 1e-9);
    /// // Waves shorter than two cells cannot be seen.
    /// assert!(Ride::of(&dem, &WaveBand::new(0.15, 4.0)?, Detrender::Band, false).is_err());
    /// # Ok(())
    /// # }
    /// ```
    pub fn of(dem: &Grid, band: &WaveBand, detrender: Detrender, allow_coarse: bool) -> Result<Self, BandError> {
        let [dx, dy] = dem.geometry.cell;
        if !allow_coarse {
            band.fits_cells(dx.max(dy))?;
        }
        let [x, y] = dem.geometry.size();
        band.fits_length(x.max(y))?;
        let detrended = Detrended::of(dem, band, detrender);
        let power_law = PowerLaw::fit(&profile_spectra(&level(dem)), Direction::All, band.frequencies());
        let iso_8608_psd_m3 = power_law.as_ref().map_or(f64::NAN, PowerLaw::iso_8608_psd_m3);
        Ok(Self {
            band_m: [band.min_m(), band.max_m()],
            detrender,
            rms_m: detrended.rms_m(),
            rms_along_m: detrended.rms_along_m(),
            power_law,
            iso_8608_psd_m3,
            iso_8608_class: iso_8608_class(iso_8608_psd_m3),
            iri: iri(dem),
            map: detrended.rms_map(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sastrugi_numeric::{Geometry, Streams};

    /// White noise on cells of 0.1 m: the density is flat, and the band holds its share of the variance. n = 400 x 400;
    /// threshold above 10 standard errors.
    #[test]
    fn stat_white_noise() {
        let mut s = Streams::for_seed(1, "ride-test").stream("noise");
        let g = Geometry::square(400, 400, 0.1);
        let dem = Grid::new(g, (0..g.len()).map(|_| 0.01 * s.normal()).collect());
        let ride = Ride::of(&dem, &WaveBand::new(0.2, 5.0).unwrap(), Detrender::Band, false).unwrap();
        let wanted = 0.01 * ((5.0f64 - 0.2) / 5.0).sqrt();
        assert!((ride.rms_m / wanted - 1.0).abs() < 0.03, "{}", ride.rms_m);
        let law = ride.power_law.unwrap();
        assert!(law.n.abs() < 0.1 && (law.c / (2.0 * 1e-4 * 0.1) - 1.0).abs() < 0.1, "{law:?}");
        assert_eq!((ride.iso_8608_psd_m3, ride.iso_8608_class), (law.psd_m3(0.1), Some('A')));
        assert_eq!(ride.iri, iri(&dem));
        // Both directions have the same roughness, and so has a window of 15 m: 22 801 cells, known to 1 %.
        assert!(ride.rms_along_m.len() == 2 && ride.rms_along_m.iter().all(|r| (r / wanted - 1.0).abs() < 0.03));
        let (row, col) = (200, 200);
        assert!((ride.map.at(row, col) / wanted - 1.0).abs() < 0.1, "{}", ride.map.at(row, col));
    }

    /// A surface given in feet has its RMS in feet and its density in cubic feet; converted to metres, both match the surface
    /// given in metres.
    #[test]
    fn val_feet() {
        const FOOT_M: f64 = 0.3048;
        let mut s = Streams::for_seed(2, "ride-test").stream("noise");
        let metres = Geometry::square(120, 150, 0.15);
        let feet = Geometry::square(120, 150, 0.15 / FOOT_M);
        let heights: Vec<f64> = (0..metres.len()).map(|_| 0.01 * s.normal()).collect();
        let ride = |g: Geometry, unit: f64| {
            let dem = Grid::new(g, heights.iter().map(|z| z / unit).collect());
            Ride::of(&dem, &WaveBand::new(0.33 / unit, 5.4 / unit).unwrap(), Detrender::Band, false).unwrap()
        };
        let (in_metres, in_feet) = (ride(metres, 1.0), ride(feet, FOOT_M));
        assert!((in_feet.rms_m * FOOT_M / in_metres.rms_m - 1.0).abs() < 1e-12);
        let (a, b) = (in_metres.power_law.unwrap(), in_feet.power_law.unwrap());
        assert!((a.n - b.n).abs() < 1e-9);
        assert!((b.c * libm::pow(FOOT_M, 3.0 - b.n) / a.c - 1.0).abs() < 1e-9);
    }

    #[test]
    fn val_cells_and_surfaces_that_do_not_fit_the_band_are_refused() {
        let dem = Grid::filled(Geometry::square(100, 100, 0.2), 1.0);
        let ride = |min, max, coarse| Ride::of(&dem, &WaveBand::new(min, max).unwrap(), Detrender::Band, coarse);
        assert!(matches!(ride(0.33, 5.0, false), Err(BandError::Coarse { .. })));
        assert!(matches!(ride(0.4, 5.1, false), Err(BandError::Short { .. })));
        let flat = ride(0.33, 5.0, true).unwrap();
        assert!(flat.rms_m == 0.0 && flat.power_law.is_none() && flat.iso_8608_class.is_none());
    }
}
