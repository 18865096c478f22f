//! Verbatim copies: which neighbourhoods of one surface occur in another, cell by cell.
//!
//! # What
//! A neighbourhood of [`COPY_SIDE`] x [`COPY_SIDE`] cells is a copy if the Laplacians (five points) of its cells are those of a neighbourhood
//! of the other surface, up to [`COPY_TOLERANCE`] of their root mean square. Laplacians do not change with an offset or a tilt, so a patch is
//! recognised on any base whose curvature is small against that of the texture. Mirrored and rotated copies are not searched for.
//!
//! # How
//! The signs of its Laplacians, 49 bits, are the key of a neighbourhood. A neighbourhood is compared with the one that continues the copy of its
//! western or northern neighbour, then with up to [`CANDIDATES`] of those with its key. A sign that rounding has flipped costs a cell at the
//! edge of a copied patch, not the patch.
//!
//! # When not to use it
//! Surfaces that are flat or rounded to few heights (integer metres, filled holes) contain equal neighbourhoods by chance: compare with the
//! share of copies between two parts of the site.
//!
//! # Cost
//! One sort of the other surface's keys; at most `49 (CANDIDATES + 2)` products per cell; some 50 bytes per cell.

use sastrugi_numeric::Grid;
use serde::Serialize;

/// Side of a neighbourhood, cells.
pub const COPY_SIDE: usize = 7;
/// Largest root mean square difference of the Laplacians of a copy, as a share of their root mean square.
pub const COPY_TOLERANCE: f64 = 0.05;
/// Most neighbourhoods of one key that are compared.
const CANDIDATES: usize = 32;

/// Copies found in a surface.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Copies {
    /// Neighbourhoods examined: those with data throughout, their Laplacians included.
    pub examined: usize,
    /// Share of them that are copies; NaN if none was examined.
    pub share: f64,
    /// Length of the longest run of cells, along a row or a column, copied in one piece; 0 without copies.
    pub longest_run_cells: usize,
}

/// Copies in `surface` of neighbourhoods of `source`; both have cells of one size.
///
/// ```
/// use sastrugi_numeric::{Geometry, Grid, Streams};
/// use sastrugi_roughness::copies;
///
/// let noise = |seed| {
///     let mut stream = Streams::for_seed(seed, "example").stream("noise");
///     Grid::new(Geometry::square(40, 40, 0.1), (0..1600).map(|_| stream.normal()).collect())
/// };
/// let (site, other) = (noise(1), noise(2));
/// // Twenty columns of the site, laid at the same place of the other surface.
/// let mut quilt = other.clone();
/// for row in 0..40 {
///     quilt.values[40 * row..][..20].copy_from_slice(&site.values[40 * row..][..20]);
/// }
/// assert_eq!(copies(&other, &site).share, 0.0);
/// let found = copies(&quilt, &site);
/// assert!(found.share > 0.2 && found.share < 0.6 && found.longest_run_cells >= 18, "{found:?}");
/// ```
pub fn copies(surface: &Grid, source: &Grid) -> Copies {
    find(surface, source, |_, _| true)
}

/// Copies in `surface` of its own neighbourhoods that do not overlap: ground that occurs twice.
pub fn repeats(surface: &Grid) -> Copies {
    let cols = surface.cols();
    let apart = |a: usize, b: usize| a.abs_diff(b) >= COPY_SIDE;
    find(surface, surface, |to, from| apart(to / cols, from / cols) || apart(to % cols, from % cols))
}

/// Copies whose place and source, as numbers of the cells in their centres, are `allowed`.
fn find(surface: &Grid, source: &Grid, allowed: impl Fn(usize, usize) -> bool) -> Copies {
    let (to, from) = (Bends::of(surface), Bends::of(source));
    let mut keys: Vec<(u64, usize)> = from.centres().filter_map(|cell| Some((from.key(cell)?, cell))).collect();
    keys.sort_unstable();
    let cols = to.cols;
    let (mut sources, mut examined, mut copied) = (vec![None; surface.values.len()], 0, 0);
    for cell in to.centres() {
        let Some(key) = to.key(cell) else { continue };
        examined += 1;
        let first = keys.partition_point(|(k, _)| *k < key);
        let alike = keys[first..].iter().take_while(|(k, _)| *k == key).take(CANDIDATES).map(|(_, from)| *from);
        let continued = continued(&sources, cell, [cols, from.cols]);
        sources[cell] =
            continued.into_iter().flatten().chain(alike).find(|&s| allowed(cell, s) && to.equals(cell, &from, s));
        copied += usize::from(sources[cell].is_some());
    }
    let longest = longest_run(&sources, [cols, from.cols]);
    Copies { examined, share: copied as f64 / examined as f64, longest_run_cells: longest }
}

/// The sources that continue those of the western and the northern neighbour.
fn continued(sources: &[Option<usize>], cell: usize, [cols, source_cols]: [usize; 2]) -> [Option<usize>; 2] {
    let [west, north] = [1, cols].map(|back| cell.checked_sub(back).and_then(|k| sources[k]));
    [west.map(|s| s + 1), north.map(|s| s + source_cols)]
}

/// Cells of the longest run, from edge to edge of its neighbourhoods.
fn longest_run(sources: &[Option<usize>], [cols, source_cols]: [usize; 2]) -> usize {
    let (mut longest, mut east, mut south) = (0, 0, vec![0; cols]);
    for (cell, source) in sources.iter().enumerate() {
        let column = &mut south[cell % cols];
        let [west, north] = continued(sources, cell, [cols, source_cols]);
        let length = |run: usize, before: Option<usize>| match source {
            None => 0,
            Some(_) if *source == before => run + 1,
            Some(_) => 1,
        };
        east = length(east, west);
        *column = length(*column, north);
        longest = longest.max(east).max(*column);
    }
    if longest == 0 { 0 } else { longest + COPY_SIDE - 1 }
}

/// Laplacians of a surface, NaN at its border and beside cells without data.
struct Bends {
    values: Vec<f64>,
    rows: usize,
    cols: usize,
}

impl Bends {
    fn of(z: &Grid) -> Self {
        let (rows, cols) = (z.rows(), z.cols());
        let [x, y] = z.geometry.cell;
        let mut values = vec![f64::NAN; rows * cols];
        for r in 1..rows.saturating_sub(1) {
            let (above, row, below) = (z.row(r - 1), z.row(r), z.row(r + 1));
            for c in 1..cols.saturating_sub(1) {
                values[r * cols + c] =
                    (row[c + 1] - 2.0 * row[c] + row[c - 1]) / (x * x) + (above[c] - 2.0 * row[c] + below[c]) / (y * y);
            }
        }
        Self { values, rows, cols }
    }

    /// Cells whose neighbourhood, with its Laplacians, lies within the surface.
    fn centres(&self) -> impl Iterator<Item = usize> + use<> {
        let (margin, rows, cols) = (COPY_SIDE / 2 + 1, self.rows, self.cols);
        (margin..rows.saturating_sub(margin))
            .flat_map(move |r| (margin..cols.saturating_sub(margin)).map(move |c| r * cols + c))
    }

    /// The rows of a cell's neighbourhood.
    fn around(&self, cell: usize) -> impl Iterator<Item = &[f64]> {
        let corner = cell - (COPY_SIDE / 2) * (self.cols + 1);
        (0..COPY_SIDE).map(move |r| &self.values[corner + r * self.cols..][..COPY_SIDE])
    }

    /// The signs of a cell's neighbourhood; `None` without data.
    fn key(&self, cell: usize) -> Option<u64> {
        self.around(cell).flatten().try_fold(0, |key, v| v.is_finite().then_some((key << 1) | u64::from(*v > 0.0)))
    }

    /// Whether the neighbourhood of a cell is that of a cell of another surface.
    fn equals(&self, cell: usize, other: &Self, source: usize) -> bool {
        // A continued copy may leave the source.
        let margin = COPY_SIDE / 2 + 1;
        let inside = |at: usize, end: usize| at >= margin && at + margin < end;
        if !(inside(source / other.cols, other.rows) && inside(source % other.cols, other.cols)) {
            return false;
        }
        let pairs = self.around(cell).flatten().zip(other.around(source).flatten());
        let [apart, size] = pairs.fold([0.0; 2], |[d, s], (a, b)| [d + (a - b) * (a - b), s + b * b]);
        // NaN is not equal.
        size > 0.0 && apart <= COPY_TOLERANCE * COPY_TOLERANCE * size
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sastrugi_numeric::{Geometry, Streams};

    fn noise(rows: usize, cols: usize, name: &str) -> Grid {
        let mut s = Streams::for_seed(1, "copies-test").stream(name);
        Grid::new(Geometry::square(rows, cols, 0.5), (0..rows * cols).map(|_| s.normal()).collect())
    }

    /// Copies a part of `source` into `surface`, raised and tilted.
    fn paste(surface: &mut Grid, at: [usize; 2], source: &Grid, from: [usize; 2], [rows, cols]: [usize; 2]) {
        let width = surface.cols();
        for r in 0..rows {
            for c in 0..cols {
                let base = 300.0 + 0.2 * c as f64 - 0.1 * r as f64;
                surface.values[(at[0] + r) * width + at[1] + c] = source.at(from[0] + r, from[1] + c) + base;
            }
        }
    }

    /// A patch of 20 x 30 cells from elsewhere, raised and tilted, stored in single precision, has 12 x 22 neighbourhoods with their Laplacians
    /// (one cell more on each side); they run over 22 + 6 cells. Independent noise has none.
    #[test]
    fn val_a_patch_is_found_on_a_slope() {
        let (source, mut surface) = (noise(60, 50, "source"), noise(50, 70, "surface"));
        assert_eq!(copies(&surface, &source), Copies { examined: 42 * 62, share: 0.0, longest_run_cells: 0 });
        paste(&mut surface, [11, 23], &source, [33, 7], [20, 30]);
        let found = copies(&surface.as_stored(), &source);
        assert_eq!(found, Copies { examined: 42 * 62, share: 12.0 * 22.0 / (42.0 * 62.0), longest_run_cells: 28 });
        // Turned round: the patch is found in the source too, and its longest side is now north-south.
        let turned = |z: &Grid| {
            let geometry = Geometry::square(z.cols(), z.rows(), 0.5);
            let values = (0..z.values.len()).map(|k| z.at(k % z.rows(), k / z.rows())).collect();
            Grid::new(geometry, values)
        };
        let other = copies(&turned(&surface), &turned(&source));
        assert_eq!((other.share, other.longest_run_cells), (found.share, 28));
    }

    /// Slow reference: every neighbourhood with every other, by the definition. Heights of few values, so that there are chance copies, and a hole.
    #[test]
    fn prop_copies_are_those_of_the_definition() {
        let coarse = |z: Grid| z.map(|v| f64::from(u8::from(v > 2.0)));
        let (source, mut surface) = (coarse(noise(22, 25, "coarse source")), coarse(noise(24, 21, "coarse surface")));
        surface.values[200] = f64::NAN;
        let (to, from) = (Bends::of(&surface), Bends::of(&source));
        let complete: Vec<usize> = to.centres().filter(|&c| to.around(c).flatten().all(|v| v.is_finite())).collect();
        let copied = complete.iter().filter(|&&c| {
            from.centres().any(|s| {
                let pairs: Vec<(f64, f64)> =
                    to.around(c).flatten().copied().zip(from.around(s).flatten().copied()).collect();
                let apart: f64 = pairs.iter().map(|(a, b)| (a - b) * (a - b)).sum();
                let size: f64 = pairs.iter().map(|(_, b)| b * b).sum();
                size > 0.0 && apart.sqrt() <= 0.05 * size.sqrt()
            })
        });
        let copied = copied.count();
        let found = copies(&surface, &source);
        assert!(complete.len() < to.centres().count() && copied > 0);
        assert_eq!((found.examined, found.share), (complete.len(), copied as f64 / complete.len() as f64));
    }

    /// Ground that occurs twice is found at both places; noise has no copies of itself, and its own place does not count.
    #[test]
    fn val_a_repeated_patch_is_found_twice() {
        let mut surface = noise(50, 70, "own");
        assert_eq!(repeats(&surface).share, 0.0);
        let own = surface.clone();
        paste(&mut surface, [25, 40], &own, [2, 3], [20, 20]);
        let found = repeats(&surface);
        assert_eq!(found.share, 2.0 * 12.0 * 12.0 / (42.0 * 62.0));
        assert_eq!(found.longest_run_cells, 18);
    }

    /// A plane has no Laplacian to copy; a surface smaller than a neighbourhood has none.
    #[test]
    fn val_planes_and_small_surfaces_have_no_copies() {
        let geometry = Geometry::square(20, 20, 1.0);
        let plane = Grid::new(geometry, (0..400).map(|k| geometry.x(k % 20)).collect());
        assert_eq!(copies(&plane, &plane), Copies { examined: 144, share: 0.0, longest_run_cells: 0 });
        let small = noise(6, 6, "small");
        let none = copies(&small, &plane);
        assert!(none.examined == 0 && none.share.is_nan() && none.longest_run_cells == 0);
    }
}
