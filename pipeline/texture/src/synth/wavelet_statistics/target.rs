//! The target covariance of a field on a torus: given at the lags of a table, unspecified beyond them.
//!
//! Each mode is multiplied by the root of the wanted power over the field's own, both smoothed in the same way: their covariances are
//! multiplied by Bartlett's window over the lags of the table, whose transform is nowhere negative. A field whose covariance is the table's at
//! these lags stays as it is.

use crate::synth::statistics::lags;
use sastrugi_numeric::fft::{Complex64, HalfSpectrum, RealFft2};
use sastrugi_schemas::statistics::LagCovariances;

/// Smallest and largest factor of the power of a mode in one step.
const POWER: [f64; 2] = [0.25, 4.0];

/// The covariance to be met.
pub struct Target {
    torus: [usize; 2],
    /// Largest lags, rows and columns, cells; less than half the torus.
    reach: [usize; 2],
    /// Wanted power of each mode, smoothed, in the order of a half spectrum.
    power: Vec<f64>,
}

impl Target {
    /// A table on a torus with the given transform.
    pub fn new(table: &LagCovariances, fft: &RealFft2, torus: [usize; 2]) -> Self {
        let longest = lags::reach(table);
        let reach = [0, 1].map(|axis| longest[axis].min(torus[axis].saturating_sub(1) / 2));
        let mut own = Self { torus, reach, power: Vec::new() };
        own.power = own.smoothed(lags::on_torus(table, torus, |_| 1.0), fft).into_iter().map(|v| v.max(0.0)).collect();
        own
    }

    /// The factors of the modes of a field that has this power in each.
    pub fn factors(&self, power: &[f64], fft: &RealFft2) -> Vec<f64> {
        let [rows, cols] = self.torus;
        let values = power.iter().map(|p| Complex64::new(*p, 0.0)).collect();
        let own = self.smoothed(fft.inverse(HalfSpectrum { rows, cols, values }), fft);
        let factor = |(wanted, found): (&f64, f64)| match found {
            // Where the field has no power, no factor gives it any.
            found if found <= 0.0 => 1.0,
            found => (wanted / found).clamp(POWER[0], POWER[1]).sqrt(),
        };
        self.power.iter().zip(own).map(factor).collect()
    }

    /// The spectrum of a covariance, tapered.
    fn smoothed(&self, mut covariance: Vec<f64>, fft: &RealFft2) -> Vec<f64> {
        lags::taper_torus(&mut covariance, self.torus, self.reach, lags::bartlett);
        fft.forward(&covariance).values.iter().map(|v| v.re).collect()
    }
}

/// The power of each mode of a field with a spectrum: that of its covariance on the torus.
pub fn power(spectrum: &HalfSpectrum) -> Vec<f64> {
    let cells = (spectrum.rows * spectrum.cols) as f64;
    spectrum.values.iter().map(|v| v.norm_sqr() / cells).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synth::fft_ma::torus_covariance;
    use sastrugi_numeric::filters::gaussian_low_pass;
    use sastrugi_numeric::{Geometry, Grid, Streams};

    fn noise(rows: usize, cols: usize, purpose: &str) -> Grid {
        let mut stream = Streams::for_seed(1, "target-test").stream(purpose);
        Grid::new(Geometry::square(rows, cols, 1.0), (0..rows * cols).map(|_| stream.normal()).collect())
    }

    /// White noise is brought to the covariance of a smooth field at the lags of its table, 2 % of the variance, also where the table is longer
    /// than half the torus; a field of a tenth of the height first gains the largest factor.
    #[test]
    fn prop_fields_are_brought_to_a_covariance() {
        let table = lags::measure(&gaussian_low_pass(&noise(200, 200, "measured"), 1.5), [20, 20]);
        for [rows, cols] in [[96, 80], [48, 30]] {
            let fft = RealFft2::new(rows, cols);
            let target = Target::new(&table, &fft, [rows, cols]);
            let mut spectrum = fft.forward(&noise(rows, cols, "field").values);
            for _ in 0..30 {
                let factors = target.factors(&power(&spectrum), &fft);
                spectrum.values.iter_mut().zip(&factors).for_each(|(v, f)| *v *= *f);
            }
            let field = Grid::new(Geometry::square(rows, cols, 1.0), fft.inverse(spectrum.clone()));
            let (found, wanted) = (torus_covariance(&field), lags::on_torus(&table, [rows, cols], |_| 1.0));
            for at in [0, 1, 2, 4, cols, 2 * cols + 1, 5 * cols - 2] {
                assert!((found[at] - wanted[at]).abs() < 0.02 * wanted[0], "{at}: {} {}", found[at], wanted[at]);
            }
            let low: Vec<f64> = power(&spectrum).iter().map(|p| 0.01 * p).collect();
            let factors = target.factors(&low, &fft);
            assert!((factors[0] - 2.0).abs() < 1e-12);
        }
    }
}
