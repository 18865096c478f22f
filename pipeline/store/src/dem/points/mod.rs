//! Point clouds (LAS 1.0 to 1.4, LAZ), gridded to a DEM.
//!
//! Cell (i, j), i and j integers, covers x from i c to (i + 1) c and y from j c to (j + 1) c, with c the cell size: clouds of
//! one site gridded with the same cell size share their cells. A point on a border belongs to the eastern or southern cell, as
//! in `Geometry::cell_at`; points on the southern border of the grid belong to the last row. The height of a cell is a
//! [`Statistic`] of its points; a cell without points has no data, unless [`GridSettings::fill_cells`] requests filling of
//! small gaps (see `fill.rs`).
//!
//! Statistics are computed from the integers stored in the file, so that a mean is rounded only once, independently of the order
//! of the points. A percentile p of n sorted heights is interpolated at (n - 1) p / 100 (Hyndman and Fan 1996, definition 7, as
//! in numpy).
//!
//! Memory: 4 MiB of decoded points and, for LAZ of point formats 6 to 10, one compressed chunk of the file; 20 bytes per cell, 40
//! while gaps are filled; for medians and percentiles also 8 bytes per point; while searching for a cell size, up to 64 MiB. The
//! file is decoded twice, and once or twice more if no cell size is given (3.5 s per pass for 10^7 points of LAZ).
//!
//! Without a given cell size, memory is planned for four cells per point ([`super::claimed`]). That is enough for a square at 45 degrees, which
//! fills half of its box, if half of its cells have a point. A narrow strip across its box needs more, and is refused where memory was planned
//! ([`GridSettings::planned_cells`]).
//!
//! Points outside the box that the header states, by more than a cell, are refused before any cell is held: the box is what memory
//! is planned for ([`super::claimed`]), and a flipped bit of a single point could make the grid any size. Boxes that other programs
//! rounded, or that are too large, are accepted.
//!
//! Heights and coordinates in feet are treated as metres, with a note. The reference system is taken from the GeoTIFF keys or the
//! well-known text in the records before or after the points.

mod cell_size;
mod cloud;
mod crs;
mod fill;
mod gps;
mod grid;
mod header;
mod laszip;
mod lattice;
mod settings;
mod survey;

#[cfg(test)]
mod tests;

pub use settings::{GridSettings, MAX_FILL_CELLS, MAX_RANKED_POINTS, Statistic};

use super::band::Values;
use super::checks::checked;
use super::raster::{Claimed, Dem, DemError, DemInfo, Format, MAX_CELLS, ReadOptions, Refusal};
use cloud::Cloud;
use grid::Cells;
use header::DeclaredSize;
use lattice::Lattice;
use sastrugi_numeric::Grid;
use sastrugi_schemas::counted;
use std::fs::File;
use std::path::Path;
use survey::{Chosen, check_stated, survey};

/// Cells per point for which memory is planned without a given cell size.
const PLANNED_CELLS_PER_POINT: u64 = 4;
/// Fewest cells for which memory is planned: a few points may need more than four each.
const PLANNED_CELLS_MIN: u64 = 1 << 10;

/// Memory of a cell whose points are averaged, bytes: their sum and number, and its height.
pub(super) const BYTES_PER_CELL: u64 = 8 + 4 + 8;
/// Memory of the search for a cell size, bytes: one bit for each cell of five grids, of which the finest has at most [`MAX_CELLS`] (43 MiB in
/// all), and decoded points.
pub(super) const SEARCH_BYTES: u64 = 64 << 20;

/// A gridded cloud.
#[derive(Clone, Debug, PartialEq)]
pub struct Gridded {
    /// Heights and metadata.
    pub dem: Dem,
    /// Number of points in each cell; 0 where a height was filled in.
    pub counts: Grid<u32>,
    /// Number of cells that were filled.
    pub filled: usize,
}

/// Reads and grids a point cloud.
///
/// # Errors
/// [`DemError::Unfit`] for settings out of range; otherwise as [`super::read`]: a file that is damaged, has no usable points, is in
/// degrees, or covers more than [`MAX_CELLS`] cells.
///
/// # Examples
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use las::{Builder, Point, Transform, Vector, Writer};
/// use sastrugi_store::dem::points::{GridSettings, Statistic, read};
///
/// let mut builder = Builder::from((1, 4));
/// let millimetres = Transform { scale: 0.001, offset: 0.0 };
/// builder.transforms = Vector { x: millimetres, y: millimetres, z: millimetres };
/// let mut writer = Writer::new(std::io::Cursor::new(vec![]), builder.into_header()?)?;
/// for (x, y, z) in [(0.2, 0.3, 1.0), (0.8, 0.9, 3.0), (2.5, 0.5, 7.0)] {
///     writer.write_point(Point { x, y, z, return_number: 1, number_of_returns: 1, ..Point::default() })?;
/// }
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("cloud.las");
/// std::fs::write(&path, writer.into_inner()?.into_inner())?;
///
/// let gridded = read(&path, &GridSettings { cell_m: Some(1.0), ..GridSettings::default() })?;
/// assert_eq!(gridded.counts.values, [2, 0, 1]);
/// assert!((gridded.dem.grid.values[0] - 2.0).abs() < 1e-12 && gridded.dem.grid.values[1].is_nan());
///
/// let highest = GridSettings { cell_m: Some(1.0), statistic: Statistic::Max, ..GridSettings::default() };
/// assert!((read(&path, &highest)?.dem.grid.values[0] - 3.0).abs() < 1e-12);
/// # Ok(())
/// # }
/// ```
pub fn read(path: &Path, settings: &GridSettings) -> Result<Gridded, DemError> {
    let file = crate::file::open(path).map_err(|e| DemError::reading(path, e))?;
    read_open(path, file, settings)
}

/// The DEM of a cloud whose file is open. The cell size is that of the settings, or else that of the options.
pub(super) fn read_dem(
    path: &Path,
    file: File,
    options: &ReadOptions,
    settings: &GridSettings,
) -> Result<Dem, DemError> {
    let square = || square_cell(options).map_err(|refusal| refusal.unfit(path));
    let cell_m = settings.cell_m.map_or_else(square, |cell| Ok(Some(cell)))?;
    Ok(read_open(path, file, &GridSettings { cell_m, ..*settings })?.dem)
}

fn square_cell(options: &ReadOptions) -> Result<Option<f64>, Refusal> {
    match options.cell_m {
        Some([x, y]) if x != y => {
            Err(Refusal::new(format!("a point cloud can only be gridded to square cells, got {x} x {y} m")))
        }
        cell => Ok(cell.map(|[side, _]| side)),
    }
}

/// As [`read`], for a file that is already open.
fn read_open(path: &Path, file: File, settings: &GridSettings) -> Result<Gridded, DemError> {
    settings::check(settings).map_err(|reason| DemError::Unfit { path: path.to_owned(), reason })?;
    Cloud::open(path, file).and_then(|cloud| gridded(&cloud, settings)).map_err(|refusal| refusal.about(path))
}

/// Size of the grid according to the header of a cloud, for a given cell size; without one, the number of cells that are planned for.
pub(super) fn claimed(mut file: File, cell_m: Option<f64>) -> Option<Claimed> {
    let declared = DeclaredSize::read(&mut file).ok()?;
    let (points, extent) = (declared.points, declared.stated_extent());
    let cells = match cell_m {
        // A NaN extent is detected when the cloud is read.
        Some(cell) => ((extent[0] / cell + 1.0) * (extent[1] / cell + 1.0)) as u64,
        None => points.saturating_mul(PLANNED_CELLS_PER_POINT).max(PLANNED_CELLS_MIN),
    };
    Some(Claimed::size(cells.min(MAX_CELLS), points, cell_m))
}

/// True for the first bytes of a point cloud.
pub(super) fn looks_like(bytes: &[u8]) -> bool {
    bytes.starts_with(header::SIGNATURE)
}

fn gridded(cloud: &Cloud, settings: &GridSettings) -> Result<Gridded, Refusal> {
    let chosen = Chosen { cloud, ground_only: settings.ground_only };
    let (survey, mut notes) = survey(&chosen)?;
    let cell_m = match settings.cell_m {
        Some(cell_m) => cell_m,
        None => {
            let (cell_m, note) = cell_size::choose(&chosen, &survey)?;
            notes.push(note);
            cell_m
        }
    };
    let lattice = Lattice::new(&survey, cell_m)?;
    // Memory was planned for the extent that the header states, or for a number of cells.
    check_stated(&survey, &cloud.declared, cell_m)?;
    if let (None, Some(planned)) = (settings.cell_m, settings.planned_cells) {
        lattice.check_planned(survey.points, planned)?;
    }
    let Cells { mut heights, counts } = grid::cells(&chosen, &lattice, settings.statistic, survey.points)?;
    let (held, cells) = (counts.iter().filter(|n| **n > 0).count(), counts.len());
    let statistic = settings.statistic.name();
    notes.push(format!(
        "gridded {} into {held} of {} ({statistic} of each cell of {cell_m} m)",
        counted(survey.points, "point"),
        counted(cells, "cell")
    ));
    let geometry = lattice.geometry();
    let filled = fill::fill(&mut heights, geometry.rows, geometry.cols, settings.fill_cells)?;
    if settings.fill_cells > 0 {
        let (gaps, reach) = (counted(filled, "gap cell"), counted(settings.fill_cells, "cell"));
        notes.push(format!("filled {gaps}, up to {reach} from points"));
    }
    let info = DemInfo {
        format: Format::Las,
        dtype: "int32",
        nodata: None,
        crs: cloud.crs.clone(),
        values: Values::Heights,
        placed: true,
        pixel_is_point: false,
        notes,
    };
    let dem = checked(Dem { grid: Grid::new(geometry, heights), info })?;
    Ok(Gridded { dem, counts: Grid::new(geometry, counts), filled })
}
