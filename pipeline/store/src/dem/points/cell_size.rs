//! Default cell size of a cloud: approximately the smallest size, among 1, 2 and 5 times powers of ten, at which three quarters
//! of the cells inside the cloud hold a point.
//!
//! A cell is inside if its block of 4 x 4 cells and the eight neighbouring blocks all hold points, so that neither the outline of
//! the cloud nor its large holes count. Sizes are tried from coarse to fine, starting well above the size that points evenly
//! distributed over their bounding box, or along it if it is thin, would need: with m of n points in each cell,
//!
//! $$ 1 - e^{-m} = 3/4, \qquad c_0 = \max\left( \sqrt{m w h / n}, \; m (w + h) / n \right), $$
//!
//! where w and h are width and height of the box; the grid then has no more than 2 n / m + 1 cells. If the share s of occupied
//! cells passes three quarters between two sizes, the nearer one in the logarithm (s linear in between) is taken: the finer one
//! if the two shares sum to more than 3/2.
//!
//! Cost: one pass over the points for every five sizes; one bit per cell.

use super::lattice::Lattice;
use super::survey::{Chosen, Survey};
use crate::dem::raster::{MAX_CELLS, Refusal};

/// Target share of cells with points.
const SHARE: f64 = 0.75;
/// ln 4 = -ln(1 - 3/4).
const POINTS_PER_CELL: f64 = 1.386_294_361_119_890_6;
/// Sizes tried in one pass.
const AT_A_TIME: i32 = 5;
/// Number of sizes above the first guess at which the search starts.
const START: i32 = 4;
/// Cells along the side of a block.
const SIDE: usize = 4;

/// The cell size, and a note that states it.
pub(super) fn choose(chosen: &Chosen<'_>, survey: &Survey) -> Result<(f64, String), Refusal> {
    let guess = first_guess(survey);
    let mut coarser: Option<(i32, f64)> = None;
    let mut next = guess + START;
    loop {
        let sizes: Vec<i32> = (0..AT_A_TIME).map(|i| next - i).filter(|k| fits(survey, *k)).collect();
        if sizes.is_empty() && next < guess {
            break;
        }
        for (k, share) in sizes.iter().zip(shares(chosen, survey, &sizes)?) {
            // A cloud with few, coarse cells has no inside.
            let Some(share) = share.or((*k <= guess).then_some(0.0)) else { continue };
            match coarser {
                Some((best, above)) if share + above <= 2.0 * SHARE => return Ok(stated(best, Some(above))),
                None if share < SHARE => return Ok(stated(*k, Some(share).filter(|s| *s > 0.0))),
                _ => coarser = Some((*k, share)),
            }
        }
        next -= AT_A_TIME;
    }
    let (k, share) = coarser.map_or((guess, None), |(k, share)| (k, Some(share)));
    Ok(stated(k, share))
}

fn stated(k: i32, share: Option<f64>) -> (f64, String) {
    let size = size(k);
    let why = share.map_or_else(
        || "from the number of points per area".to_owned(),
        |share| format!("{:.0} % of the cells inside the cloud hold a point", 100.0 * share),
    );
    (size, format!("no cell size was given; {size} m was chosen ({why})"))
}

/// 1, 2, 5, 10, 20 ... for k = 0, 1, 2, 3, 4 ...
fn size(k: i32) -> f64 {
    let digit = [1.0, 2.0, 5.0][k.rem_euclid(3) as usize];
    let power = k.div_euclid(3);
    // Powers of ten up to 10^22 are exact, so a size is the number nearest to its decimal form.
    let ten = (0..power.unsigned_abs()).fold(1.0, |ten, _| ten * 10.0);
    if power < 0 { digit / ten } else { digit * ten }
}

/// The first size that would suffice if the points were evenly distributed over their bounding box, or along it.
fn first_guess(survey: &Survey) -> i32 {
    let [width, height] = [0, 1].map(|axis| survey.high[axis] - survey.low[axis]);
    let per_point = POINTS_PER_CELL / survey.points as f64;
    let cell = (per_point * width * height).sqrt().max(per_point * (width + height));
    let cell = if cell > 0.0 { cell } else { 1.0 };
    (-60..60).find(|k| size(*k) >= cell).unwrap_or(60)
}

fn fits(survey: &Survey, k: i32) -> bool {
    Lattice::new(survey, size(k)).is_ok_and(|lattice| lattice.rows * lattice.cols <= MAX_CELLS as usize)
}

/// Share of the cells inside the cloud that hold a point, for several sizes; `None` if no cell is inside.
fn shares(chosen: &Chosen<'_>, survey: &Survey, sizes: &[i32]) -> Result<Vec<Option<f64>>, Refusal> {
    let lattices = sizes.iter().map(|k| Lattice::new(survey, size(*k)));
    let mut maps: Vec<Blocks> = lattices.map(|lattice| lattice.map(Blocks::new)).collect::<Result<_, _>>()?;
    chosen.for_each(|point| {
        let place = chosen.cloud.place(&point);
        maps.iter_mut().for_each(|map| map.add(place));
    })?;
    Ok(maps.iter().map(Blocks::share).collect())
}

/// Occupied cells, as one bit each, 4 x 4 per number.
struct Blocks {
    lattice: Lattice,
    rows: usize,
    cols: usize,
    held: Vec<u16>,
}

impl Blocks {
    fn new(lattice: Lattice) -> Self {
        let (rows, cols) = (lattice.rows.div_ceil(SIDE), lattice.cols.div_ceil(SIDE));
        Self { lattice, rows, cols, held: vec![0; rows * cols] }
    }

    fn add(&mut self, place: [f64; 2]) {
        let (row, col) = self.lattice.cell(place);
        self.held[row / SIDE * self.cols + col / SIDE] |= 1 << (row % SIDE * SIDE + col % SIDE);
    }

    fn share(&self) -> Option<f64> {
        let (mut cells, mut held) = (0_u64, 0_u64);
        for row in 1..self.rows.saturating_sub(1) {
            for col in 1..self.cols.saturating_sub(1) {
                let around = (row - 1..=row + 1).all(|r| {
                    self.held[r * self.cols + col - 1..=r * self.cols + col + 1].iter().all(|block| *block != 0)
                });
                if around {
                    cells += (SIDE * SIDE) as u64;
                    held += u64::from(self.held[row * self.cols + col].count_ones());
                }
            }
        }
        (cells > 0).then(|| held as f64 / cells as f64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_sizes_are_the_decimal_numbers() {
        let sizes: Vec<f64> = (-9..5).map(size).collect();
        assert_eq!(sizes, [0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0]);
        assert_eq!(size(-66), 1e-22);
    }
}
