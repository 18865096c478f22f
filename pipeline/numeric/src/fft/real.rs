//! Transforms of real fields.

use super::plane::Plane;
use super::{Complex64, Transform};

/// Two-dimensional transform of real fields of a fixed shape.
///
/// Cost: two complex half transforms. Memory: the field and its half spectrum (only the field for [`RealFft2::inverse_of`]).
///
/// ```
/// use sastrugi_numeric::fft::RealFft2;
///
/// let (rows, cols) = (3, 8);
/// // The same wave of two cells along every row: one mode, at column frequency `cols / 2` and row frequency 0.
/// let field: Vec<f64> = (0..rows * cols).map(|k| if k % cols % 2 == 0 { 1.0 } else { -1.0 }).collect();
/// let fft = RealFft2::new(rows, cols);
/// let spectrum = fft.forward(&field);
/// for (mode, value) in spectrum.values.iter().enumerate() {
///     let expected = if mode == cols / 2 * rows { 24.0 } else { 0.0 };
///     assert!((value.re - expected).abs() < 1e-12 && value.im.abs() < 1e-12);
/// }
/// let back = fft.inverse(spectrum);
/// assert!(back.iter().zip(&field).all(|(a, b)| (a - b).abs() < 1e-12));
/// ```
#[derive(Clone)]
pub struct RealFft2 {
    rows: usize,
    cols: usize,
    kind: Kind,
}

#[derive(Clone)]
enum Kind {
    /// One row or one column, which would leave side-by-side transforms mostly empty.
    Line(Transform),
    Plane(Plane),
}

/// The transform of a real field at non-negative column frequencies. The value at column frequency `kx` in `0..=cols / 2` and
/// row frequency `ky` in `0..rows` is `values[kx * rows + ky]`.
#[derive(Clone, Debug)]
pub struct HalfSpectrum {
    /// Rows of the field.
    pub rows: usize,
    /// Columns of the field.
    pub cols: usize,
    /// `(cols / 2 + 1) * rows` values.
    pub values: Vec<Complex64>,
}

impl HalfSpectrum {
    /// Number of stored column frequencies.
    pub fn half_cols(&self) -> usize {
        self.cols / 2 + 1
    }

    /// Number of times the mode at column frequency `kx` occurs in the full spectrum: 1 in the self-conjugate columns, otherwise 2.
    pub fn multiplicity(&self, kx: usize) -> f64 {
        if kx == 0 || 2 * kx == self.cols { 1.0 } else { 2.0 }
    }
}

impl RealFft2 {
    /// A transform of fields of `rows` by `cols`.
    pub fn new(rows: usize, cols: usize) -> Self {
        let kind = match rows.min(cols) {
            1 => Kind::Line(Transform::new(rows.max(cols))),
            _ => Kind::Plane(Plane::new(rows, cols)),
        };
        Self { rows, cols, kind }
    }

    /// Transform of a row-major real field.
    ///
    /// # Panics
    /// If the field does not have `rows * cols` values.
    pub fn forward(&self, field: &[f64]) -> HalfSpectrum {
        assert_eq!(field.len(), self.rows * self.cols, "field must have the shape of the transform");
        self.forward_rows(field)
    }

    /// Transform of a field of which only the first rows are given; the others are zero, and rows of zeros are not transformed. Equal to that of the
    /// complete field, but zeros may differ in sign.
    ///
    /// ```
    /// use sastrugi_numeric::fft::RealFft2;
    ///
    /// let fft = RealFft2::new(20, 6);
    /// let mut field: Vec<f64> = (0..18).map(|k| f64::from(k % 7)).collect();
    /// let spectrum = fft.forward_rows(&field);
    /// field.resize(120, 0.0);
    /// assert_eq!(spectrum.values, fft.forward(&field).values);
    /// ```
    ///
    /// # Panics
    /// If the field does not consist of at most `rows` complete rows.
    pub fn forward_rows(&self, field: &[f64]) -> HalfSpectrum {
        let Self { rows, cols, .. } = *self;
        assert!(
            field.len() <= rows * cols && field.len().is_multiple_of(cols),
            "field must consist of rows of the transform"
        );
        let values = match &self.kind {
            Kind::Line(transform) => {
                let mut line = field.to_vec();
                line.resize(rows * cols, 0.0);
                self.forward_line(transform, &line)
            }
            Kind::Plane(plane) => plane.forward(field),
        };
        HalfSpectrum { rows, cols, values }
    }

    /// Field of a spectrum. Only the Hermitian part counts: the rest of the stored columns 0 and `cols / 2` is
    /// ignored.
    pub fn inverse(&self, spectrum: HalfSpectrum) -> Vec<f64> {
        self.inverse_rows(spectrum, self.rows)
    }

    /// The first `wanted` rows of [`Self::inverse`], with the same bits. Columns are transformed completely, rows only up to there.
    ///
    /// ```
    /// use sastrugi_numeric::fft::RealFft2;
    ///
    /// let fft = RealFft2::new(20, 6);
    /// let field: Vec<f64> = (0..120).map(|k| f64::from(k % 7)).collect();
    /// let spectrum = fft.forward(&field);
    /// assert_eq!(fft.inverse_rows(spectrum.clone(), 3), fft.inverse(spectrum)[..18]);
    /// ```
    pub fn inverse_rows(&self, spectrum: HalfSpectrum, wanted: usize) -> Vec<f64> {
        assert_eq!(
            (spectrum.rows, spectrum.cols),
            (self.rows, self.cols),
            "spectrum must have the shape of the transform"
        );
        let rows = self.rows;
        self.inverse_rows_of(wanted, |kx, column| column.copy_from_slice(&spectrum.values[kx * rows..(kx + 1) * rows]))
    }

    /// Field of the spectrum whose columns are written by `fill`, each of `rows` values, for column frequencies `0..=cols / 2` in
    /// any order. The half spectrum is never held completely in memory. Only its Hermitian part counts.
    pub fn inverse_of(&self, fill: impl Fn(usize, &mut [Complex64]) + Sync) -> Vec<f64> {
        self.inverse_rows_of(self.rows, fill)
    }

    /// The first `wanted` rows of [`Self::inverse_of`], with the same bits.
    pub fn inverse_rows_of(&self, wanted: usize, fill: impl Fn(usize, &mut [Complex64]) + Sync) -> Vec<f64> {
        match &self.kind {
            Kind::Line(transform) => {
                let mut field = self.inverse_line(transform, fill);
                field.truncate(wanted.min(self.rows) * self.cols);
                field
            }
            Kind::Plane(plane) => plane.inverse_of(wanted, fill),
        }
    }

    fn forward_line(&self, transform: &Transform, field: &[f64]) -> Vec<Complex64> {
        let mut line: Vec<Complex64> = field.iter().map(|&v| Complex64::new(v, 0.0)).collect();
        transform.forward(&mut line, &mut transform.scratch());
        match self.rows {
            // Rounding breaks the symmetry of a row's modes.
            1 => (0..=self.cols / 2).map(|k| (line[k] + line[(self.cols - k) % self.cols].conj()) * 0.5).collect(),
            _ => line,
        }
    }

    fn inverse_line(&self, transform: &Transform, fill: impl Fn(usize, &mut [Complex64])) -> Vec<f64> {
        let Self { rows, cols, .. } = *self;
        let mut line = vec![Complex64::default(); rows * cols];
        let stored = line[..rows * (cols / 2 + 1)].chunks_mut(rows);
        stored.enumerate().for_each(|(kx, column)| fill(kx, column));
        if rows == 1 {
            (1..cols.div_ceil(2)).for_each(|k| line[cols - k] = line[k].conj());
            (0..=cols / 2).filter(|k| 2 * k % cols == 0).for_each(|k| line[k].im = 0.0);
        }
        transform.inverse_unscaled(&mut line, &mut transform.scratch());
        let scale = 1.0 / (rows * cols) as f64;
        line.into_iter().map(|v| v.re * scale).collect()
    }
}
