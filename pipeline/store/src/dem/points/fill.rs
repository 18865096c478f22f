//! Filling of small gaps between cells with data.
//!
//! An empty cell counts as a gap, and is filled, if it lies within `reach` cells of data (along rows, columns and diagonals) and
//! is not covered by any data-free square of 2 `reach` + 1 cells per side. This is the morphological closing of the cells with
//! data (Serra, Image Analysis and Mathematical Morphology, 1982). It bridges channels up to 2 `reach` cells wide and leaves a
//! straight or convex outline of the data unchanged.
//!
//! Heights are computed in repeated steps: in each, every empty cell with data among its 8 neighbours takes the mean of the
//! neighbours that had a height before the step.
//!
//! Cost: O(cells) for the closing, at most 9 additions per empty cell and step; 2 bytes per cell, including a margin of `reach`.

use crate::dem::raster::{MAX_CELLS, Refusal};
use sastrugi_schemas::counted;

/// Fills the gaps of a row-major grid and returns the number of filled cells.
///
/// # Errors
/// A margin of `reach` cells around the grid would take more memory than [`MAX_CELLS`] allows.
pub(super) fn fill(values: &mut [f64], rows: usize, cols: usize, reach: u32) -> Result<usize, Refusal> {
    if reach == 0 {
        return Ok(0);
    }
    let margin = reach as usize;
    if (rows + 2 * margin) as u64 * (cols + 2 * margin) as u64 > 2 * MAX_CELLS {
        return Err(Refusal::new(format!(
            "gaps in {rows} x {cols} cells cannot be filled up to {}: not enough memory",
            counted(reach, "cell")
        )));
    }
    let closed = closing(values, rows, cols, margin);
    let mut spread = values.to_vec();
    for _ in 0..margin {
        if !step(&mut spread, rows, cols) {
            break;
        }
    }
    let mut filled = 0;
    for ((value, spread), _) in
        values.iter_mut().zip(&spread).zip(&closed).filter(|((v, _), closed)| v.is_nan() && **closed)
    {
        *value = *spread;
        filled += 1;
    }
    Ok(filled)
}

/// One step; false if nothing changed.
fn step(values: &mut [f64], rows: usize, cols: usize) -> bool {
    let mut found = vec![];
    for row in 0..rows {
        for col in (0..cols).filter(|col| values[row * cols + col].is_nan()) {
            let (mut sum, mut n) = (0.0, 0.0);
            for r in row.saturating_sub(1)..(row + 2).min(rows) {
                for value in &values[r * cols + col.saturating_sub(1)..r * cols + (col + 2).min(cols)] {
                    if value.is_finite() {
                        sum += value;
                        n += 1.0;
                    }
                }
            }
            if n > 0.0 {
                found.push((row * cols + col, sum / n));
            }
        }
    }
    found.iter().for_each(|&(cell, value)| values[cell] = value);
    !found.is_empty()
}

/// Cells that are not covered by any data-free square.
fn closing(values: &[f64], rows: usize, cols: usize, margin: usize) -> Vec<bool> {
    let (tall, wide) = (rows + 2 * margin, cols + 2 * margin);
    let mut cells = vec![false; tall * wide];
    for row in 0..rows {
        for col in 0..cols {
            cells[(row + margin) * wide + col + margin] = values[row * cols + col].is_finite();
        }
    }
    // Beyond the margin there is no data, which dilation treats as `false`. Erosion must ignore it: the dilation of the
    // unbounded plane extends to the margin, and no cell of the grid looks beyond the margin.
    for target in [true, false] {
        cells = along_rows(&cells, wide, margin, target);
        cells = transposed(&cells, tall, wide);
        cells = along_rows(&cells, tall, margin, target);
        cells = transposed(&cells, wide, tall);
    }
    let row = |row: usize| &cells[(row + margin) * wide + margin..][..cols];
    (0..rows).flat_map(|r| row(r).iter().copied()).collect()
}

/// Sets every cell with a cell of value `target` within `reach` along its row to `target`.
fn along_rows(cells: &[bool], wide: usize, reach: usize, target: bool) -> Vec<bool> {
    let mut out = vec![!target; cells.len()];
    for (row, out) in cells.chunks_exact(wide).zip(out.chunks_exact_mut(wide)) {
        // First cell that is not yet set.
        let mut next = 0;
        for at in (0..wide).filter(|at| row[*at] == target) {
            let end = (at + reach + 1).min(wide);
            let start = next.max(at.saturating_sub(reach));
            if start < end {
                out[start..end].fill(target);
            }
            next = end;
        }
    }
    out
}

fn transposed(cells: &[bool], rows: usize, cols: usize) -> Vec<bool> {
    let mut out = vec![false; cells.len()];
    for row in 0..rows {
        for col in 0..cols {
            out[col * rows + row] = cells[row * cols + col];
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Reference: the definition, cell by cell.
    fn slow(values: &[f64], rows: usize, cols: usize, reach: isize) -> Vec<f64> {
        let held = |r: isize, c: isize| {
            let inside = r >= 0 && c >= 0 && r < rows as isize && c < cols as isize;
            inside && values[r as usize * cols + c as usize].is_finite()
        };
        let free = |row: isize, col: isize| {
            (row - reach..=row + reach).all(|r| (col - reach..=col + reach).all(|c| !held(r, c)))
        };
        let gap = |row: isize, col: isize| {
            !(row - reach..=row + reach).any(|r| (col - reach..=col + reach).any(|c| free(r, c)))
        };
        let mut spread = values.to_vec();
        for _ in 0..reach {
            let before = spread.clone();
            for row in 0..rows as isize {
                for col in 0..cols as isize {
                    let near = (row - 1..=row + 1).flat_map(|r| (col - 1..=col + 1).map(move |c| (r, c)));
                    let near = near.filter(|(r, c)| *r >= 0 && *c >= 0 && *r < rows as isize && *c < cols as isize);
                    let near: Vec<f64> = near.map(|(r, c)| before[r as usize * cols + c as usize]).collect();
                    let near: Vec<f64> = near.into_iter().filter(|v| v.is_finite()).collect();
                    let cell = row as usize * cols + col as usize;
                    if before[cell].is_nan() && !near.is_empty() {
                        spread[cell] = near.iter().sum::<f64>() / near.len() as f64;
                    }
                }
            }
        }
        let cells = (0..rows * cols).map(|i| (i, (i / cols) as isize, (i % cols) as isize));
        cells.map(|(i, r, c)| if values[i].is_nan() && !gap(r, c) { f64::NAN } else { spread[i] }).collect()
    }

    #[test]
    fn val_a_gap_is_bridged_and_an_outline_stays() {
        const EMPTY: f64 = f64::NAN;
        let mut values = [EMPTY, 1.0, 1.0, EMPTY, 3.0, 3.0, EMPTY, 1.0, 1.0, EMPTY, 3.0, 3.0];
        assert_eq!(fill(&mut values, 2, 6, 1).unwrap(), 2);
        assert!(values[0].is_nan() && values[6].is_nan());
        assert_eq!((values[3], values[9]), (2.0, 2.0));
        let mut single = [EMPTY, 5.0, EMPTY];
        assert_eq!(fill(&mut single, 1, 3, 2).unwrap(), 0);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(200))]

        #[test]
        fn prop_filling_agrees_with_the_definition(rows in 1usize..14, cols in 1usize..14, reach in 1u32..5, seed in prop::collection::vec(0u8..100, 196), share in 1u8..60) {
            let values: Vec<f64> = seed[..rows * cols].iter().map(|&v| if v < share { f64::from(v) } else { f64::NAN }).collect();
            let mut fast = values.clone();
            let filled = fill(&mut fast, rows, cols, reach).unwrap();
            let expected = slow(&values, rows, cols, reach as isize);
            prop_assert!(fast.iter().zip(&expected).all(|(a, b)| a == b || (a.is_nan() && b.is_nan())));
            prop_assert_eq!(filled, values.iter().zip(&fast).filter(|(a, b)| a.is_nan() && b.is_finite()).count());
        }
    }
}
