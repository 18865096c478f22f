//! Random field from the Cholesky factor of its covariance matrix.
//!
//! `z = L f`, f independent standard normal values, one per cell, and L the lower Cholesky factor, `L L' = C`, of the matrix of
//! covariances of all pairs of cells. Exact on average on any grid, for any covariance. It needs no torus and is not
//! periodic.
//!
//! Source: Vecherin et al. 2022, section 3.2. The factor is computed in blocks of 64 cells, one column of blocks at a
//! time; each element is the same sum in the same order on any number of threads. 1e-9 of the variance is added to each cell:
//! smooth covariances on fine grids are singular to rounding, and the factorisation would be unstable without it.
//!
//! Cost, for N cells: `N^3 / 3` operations, `4 N^2` bytes (half of the matrix). 100 x 100 cells give a matrix of 0.8 GB, of which
//! 0.4 GB are stored; more than [`CELLS_MAX`] cells are refused at once. [`super::fft_ma`] gives equivalent fields at a
//! millionth of the cost; this method is the reference for it.

use super::tile::{self, Tile};
use super::{Cost, Kernel, Made, MethodParameters, SynthesisError, Wanted};
use crate::covariance::Covariance;
use rayon::prelude::*;
use sastrugi_numeric::{Geometry, Streams};
use sastrugi_schemas::{Kind, ParameterError, counted};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::OnceLock;

/// Most cells: 100 x 100, a matrix of 0.8 GB.
pub const CELLS_MAX: usize = 10_000;
/// Cells per block: a block of 32 kB fits into the level-1 cache.
const BLOCK: usize = 64;
/// White variance added, as a share of the variance.
const JITTER: f64 = 1e-9;

/// A Cholesky texture has no parameters other than those of its tile.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct CholeskyParameters {}

/// The method with checked parameters.
pub struct Cholesky {
    covariance: Covariance,
    tile: Geometry,
    /// Computed once for all realisations.
    factor: OnceLock<Factor>,
}

/// Registry entry.
pub fn kind() -> Kind {
    Kind {
        family: "texture",
        kind: CholeskyParameters::NAME,
        summary: "normal field from the factor of its dense covariance matrix; not periodic; at most 10000 cells",
        source: "Vecherin et al. 2022, section 3.2",
        parameters: tile::schema::<CholeskyParameters>(),
    }
}

impl MethodParameters for CholeskyParameters {
    const NAME: &'static str = "cholesky";
    type Kernel = Cholesky;

    fn is_periodic(&self) -> bool {
        false
    }

    fn check(&self, tile: &Tile) -> Result<(), ParameterError> {
        let cells = tile.geometry.len();
        if cells <= CELLS_MAX {
            return Ok(());
        }
        let gigabytes = 8e-9 * cells as f64 * cells as f64;
        let message = format!(
            "gives {} x {} cells, a covariance matrix of {gigabytes:.1} GB; `cholesky` supports at most {CELLS_MAX} cells \
             (0.8 GB): use `fft_ma` for more",
            tile.geometry.cols, tile.geometry.rows
        );
        Err(ParameterError::new("size_m", message))
    }

    fn cost(&self, tile: &Tile) -> Cost {
        cost(tile.geometry.len())
    }

    fn kernel(&self, tile: &Tile, wanted: &Covariance, _: &Wanted) -> Result<Cholesky, ParameterError> {
        Ok(Cholesky { covariance: wanted.clone(), tile: tile.geometry, factor: OnceLock::new() })
    }
}

fn cost(cells: usize) -> Cost {
    let (bytes, n) = (cells as u64, cells as f64);
    Cost { memory_bytes: 4 * bytes * (bytes + BLOCK as u64) + 8 * bytes, operations: n * n * n / 3.0 }
}

impl Cholesky {
    /// Rows `i` and columns `j` of the covariance matrix, row-major.
    fn block(&self, i: usize, j: usize) -> Vec<f64> {
        let Geometry { cols, cell: [dx, dy], .. } = self.tile;
        let (lines, columns) = (self.cells(i), self.cells(j));
        let mut block = Vec::with_capacity(lines.len() * columns.len());
        for a in lines {
            block.extend(columns.clone().map(|b| {
                let east = (a % cols) as f64 - (b % cols) as f64;
                let south = (a / cols) as f64 - (b / cols) as f64;
                let jitter = if a == b { 1.0 + JITTER } else { 1.0 };
                jitter * self.covariance.at([east * dx, -south * dy])
            }));
        }
        block
    }

    /// Cells of a block.
    fn cells(&self, block: usize) -> std::ops::Range<usize> {
        block * BLOCK..((block + 1) * BLOCK).min(self.tile.len())
    }
}

impl Kernel for Cholesky {
    fn cost(&self) -> Cost {
        cost(self.tile.len())
    }

    fn notes(&self) -> Vec<String> {
        let gigabytes = 1e-9 * self.cost().memory_bytes as f64;
        vec![format!(
            "the covariance matrix of {} needs {gigabytes:.3} GB; the field is not periodic",
            counted(self.tile.len(), "cell")
        )]
    }

    fn achieved(&self) -> Box<dyn Fn([f64; 2]) -> f64 + '_> {
        Box::new(|lag_m| self.covariance.at(lag_m))
    }

    fn make(&self, streams: &Streams) -> Result<Made, SynthesisError> {
        let mut stream = streams.stream("normals");
        let normals: Vec<f64> = (0..self.tile.len()).map(|_| stream.normal()).collect();
        let blocks = self.tile.len().div_ceil(BLOCK);
        let factor = self.factor.get_or_init(|| Factor::new(blocks, |i, j| self.block(i, j)));
        Ok(Made { heights_m: factor.times(&normals), covariance_error_max_m2: None, clip_share: 0.0 })
    }
}

/// A lower factor in blocks: `columns[j][i - j]` is the block of block row i and block column j, row-major.
struct Factor {
    columns: Vec<Vec<Vec<f64>>>,
}

impl Factor {
    /// The factor of the matrix whose block `(i, j)`, `i >= j`, is `matrix(i, j)`.
    fn new(blocks: usize, matrix: impl Fn(usize, usize) -> Vec<f64> + Sync) -> Self {
        let mut columns: Vec<Vec<Vec<f64>>> = Vec::with_capacity(blocks);
        for j in 0..blocks {
            let reduced = |i: usize| {
                let mut block = matrix(i, j);
                columns.iter().enumerate().for_each(|(k, column)| {
                    subtract_product(&mut block, &column[i - k], &column[j - k]);
                });
                block
            };
            let mut column: Vec<Vec<f64>> = (j..blocks).into_par_iter().map(reduced).collect();
            let (diagonal, below) = column.split_at_mut(1);
            factorise(&mut diagonal[0]);
            below.par_iter_mut().for_each(|block| divide(block, &diagonal[0]));
            columns.push(column);
        }
        Self { columns }
    }

    /// `L f`.
    fn times(&self, f: &[f64]) -> Vec<f64> {
        let mut product = vec![0.0; f.len()];
        for (j, column) in self.columns.iter().enumerate() {
            let part = &f[j * BLOCK..f.len().min((j + 1) * BLOCK)];
            for (offset, block) in column.iter().enumerate() {
                let lines = block.chunks_exact(part.len());
                for (sum, line) in product[(j + offset) * BLOCK..].iter_mut().zip(lines) {
                    *sum += line.iter().zip(part).map(|(l, v)| l * v).sum::<f64>();
                }
            }
        }
        product
    }
}

/// `block -= a b'`, all row-major; a and b have [`BLOCK`] columns.
fn subtract_product(block: &mut [f64], a: &[f64], b: &[f64]) {
    let columns = b.len() / BLOCK;
    let mut transposed = vec![0.0; b.len()];
    for (j, line) in b.chunks_exact(BLOCK).enumerate() {
        line.iter().enumerate().for_each(|(k, v)| transposed[k * columns + j] = *v);
    }
    for (sum, line) in block.chunks_exact_mut(columns).zip(a.chunks_exact(BLOCK)) {
        for (four, factors) in transposed.chunks_exact(4 * columns).zip(line.chunks_exact(4)) {
            let (b0, rest) = four.split_at(columns);
            let (b1, rest) = rest.split_at(columns);
            let (b2, b3) = rest.split_at(columns);
            for ((((s, x0), x1), x2), x3) in sum.iter_mut().zip(b0).zip(b1).zip(b2).zip(b3) {
                *s -= factors[0] * x0 + factors[1] * x1 + factors[2] * x2 + factors[3] * x3;
            }
        }
    }
}

/// Replaces a square block by its lower factor, with 0 above the diagonal.
fn factorise(block: &mut [f64]) {
    let n = side(block);
    for j in 0..n {
        for i in 0..n {
            let sum: f64 = (0..j.min(i)).map(|k| block[i * n + k] * block[j * n + k]).sum();
            let rest = block[i * n + j] - sum;
            block[i * n + j] = match i.cmp(&j) {
                std::cmp::Ordering::Less => 0.0,
                std::cmp::Ordering::Equal => {
                    if rest > 0.0 {
                        rest.sqrt()
                    } else {
                        0.0
                    }
                }
                std::cmp::Ordering::Greater => ratio(rest, block[j * n + j]),
            };
        }
    }
}

/// Replaces a block by the X with `X L' = block`.
fn divide(block: &mut [f64], lower: &[f64]) {
    let n = side(lower);
    for line in block.chunks_exact_mut(n) {
        for j in 0..n {
            let sum: f64 = (0..j).map(|k| line[k] * lower[j * n + k]).sum();
            line[j] = ratio(line[j] - sum, lower[j * n + j]);
        }
    }
}

/// `rest / pivot`; 0 if the pivot is lost to rounding.
fn ratio(rest: f64, pivot: f64) -> f64 {
    if pivot > 0.0 { rest / pivot } else { 0.0 }
}

/// Side of a square block.
fn side(block: &[f64]) -> usize {
    (block.len() as f64).sqrt().round() as usize
}

#[cfg(test)]
mod tests;
