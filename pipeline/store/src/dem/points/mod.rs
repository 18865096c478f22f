//! Point clouds (LAS 1.0 to 1.4, LAZ), gridded to a DEM.
//!
//! Cell (i, j), i and j whole numbers, covers x from i c to (i + 1) c and y from j c to (j + 1) c, c being the cell size:
//! clouds of one site that are gridded with one cell size have their cells in common. A point on a border belongs to the
//! eastern or southern cell, as in `Geometry::cell_at`; points on the southern border of all belong to the last row. The
//! height of a cell is a [`Statistic`] of its points; a cell without points has none, unless [`GridSettings::fill_cells`]
//! asks for small gaps to be filled (`fill.rs` says how).
//!
//! Statistics are taken of the integers that the file stores, so that a mean is rounded once, whatever the order of the
//! points. A percentile p of n sorted heights is interpolated at (n - 1) p / 100 (Hyndman and Fan 1996, definition 7, as
//! numpy does).
//!
//! Memory: 4 MiB of decoded points and, for LAZ of point formats 6 to 10, one compressed chunk of the file; 20 bytes per
//! cell, 40 while gaps are filled; for medians and percentiles also 8 bytes per point; while a cell size is sought, up to 64 MiB. The file is decoded
//! twice, and once or twice more when no cell size is given (3.5 s per pass and 10^7 points of LAZ).
//!
//! Heights and coordinates in feet are taken as metres, with a note. The reference system is found in the GeoTIFF keys or
//! the well-known text of the records before the points or the first one after them.

mod cell_size;
mod cloud;
mod crs;
mod fill;
mod grid;
mod header;
mod lattice;

#[cfg(test)]
mod tests;

use super::band::Values;
use super::checks::checked;
use super::crs::Crs;
use super::raster::{Claimed, Dem, DemError, DemInfo, Format, MAX_CELLS, ReadOptions, Refusal};
use cloud::{Cloud, Point};
use grid::Cells;
use header::Claims;
use lattice::Lattice;
use sastrugi_numeric::Grid;
use std::fs::File;
use std::path::Path;
use std::str::FromStr;

/// Most points of which a median or a percentile is taken: 2 GiB.
pub const MAX_RANKED_POINTS: u64 = 1 << 28;
/// Furthest that a gap is filled, cells.
pub const MAX_FILL_CELLS: u32 = 100;

/// How points become cells.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GridSettings {
    /// Side of a cell, m; without it, the size at which about three quarters of the cells hold a point.
    pub cell_m: Option<f64>,
    /// Which height a cell takes.
    pub statistic: Statistic,
    /// How far from a cell with points a gap is filled, cells; 0 fills none.
    pub fill_cells: u32,
    /// Take only points of class 2, ground. Withheld points and those of the noise classes 7 and 18 are never taken.
    pub ground_only: bool,
}

/// The height of a cell, from those of its points.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Statistic {
    /// Their mean.
    #[default]
    Mean,
    /// The 50th percentile.
    Median,
    /// A percentile, 0 to 100.
    Percentile(f64),
    /// The lowest.
    Min,
    /// The highest.
    Max,
}

impl FromStr for Statistic {
    type Err = String;

    /// `mean`, `median`, `min`, `max`, or `p` and a percentage.
    fn from_str(text: &str) -> Result<Self, String> {
        let percentile = || text.strip_prefix('p')?.parse().ok().filter(|p| (0.0..=100.0).contains(p));
        match text {
            "mean" => Ok(Self::Mean),
            "median" => Ok(Self::Median),
            "min" => Ok(Self::Min),
            "max" => Ok(Self::Max),
            _ => percentile().map(Self::Percentile).ok_or_else(|| {
                format!("is \"{text}\"; it must be mean, median, min, max, or p0 to p100 for a percentile")
            }),
        }
    }
}

impl Statistic {
    fn name(self) -> String {
        match self {
            Self::Mean => "mean".to_owned(),
            Self::Median => "median".to_owned(),
            Self::Percentile(p) => format!("percentile {p}"),
            Self::Min => "lowest".to_owned(),
            Self::Max => "highest".to_owned(),
        }
    }
}

/// A gridded cloud.
#[derive(Clone, Debug, PartialEq)]
pub struct Gridded {
    /// Heights and what the file says.
    pub dem: Dem,
    /// Points of every cell; 0 where a height was filled in.
    pub counts: Grid<u32>,
    /// Number of cells that were filled.
    pub filled: usize,
}

/// Reads and grids a point cloud.
///
/// # Errors
/// [`DemError::Unfit`] for settings out of range; otherwise as [`super::read`]: a file that is damaged, holds no usable point,
/// lies in degrees, or covers more than [`MAX_CELLS`] cells.
pub fn read(path: &Path, settings: &GridSettings) -> Result<Gridded, DemError> {
    let file = File::open(path).map_err(|e| DemError::reading(path, e))?;
    read_open(path, file, settings)
}

/// The DEM of a cloud whose file is open. Its cell size is that of the settings, or else that of the options.
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
            Err(Refusal::new(format!("a point cloud is gridded to square cells, not to cells of {x} x {y} m")))
        }
        cell => Ok(cell.map(|[side, _]| side)),
    }
}

/// As [`read`], with the file open already.
fn read_open(path: &Path, file: File, settings: &GridSettings) -> Result<Gridded, DemError> {
    check(settings).map_err(|reason| DemError::Unfit { path: path.to_owned(), reason })?;
    Cloud::open(path, file).and_then(|cloud| gridded(&cloud, settings)).map_err(|refusal| refusal.about(path))
}

/// What the header of a cloud says it will be gridded to, with cells of a given size.
pub(super) fn claimed(mut file: File, cell_m: Option<f64>) -> Option<Claimed> {
    let Claims { points, extent, .. } = Claims::read(&mut file).ok()?;
    let cells = match cell_m {
        Some(cell) => (extent[0] / cell + 1.0) * (extent[1] / cell + 1.0),
        // Without a size, three quarters of the cells hold a point.
        None => points as f64 / 0.75,
    };
    // An extent that is no number is found out when the cloud is read.
    Some(Claimed { cells: (cells as u64).min(MAX_CELLS), points, cell_m })
}

/// True for the first bytes of a point cloud.
pub(super) fn looks_like(bytes: &[u8]) -> bool {
    bytes.starts_with(header::SIGNATURE)
}

fn check(settings: &GridSettings) -> Result<(), String> {
    if let Some(cell) = settings.cell_m.filter(|cell| !(cell.is_finite() && *cell > 0.0)) {
        return Err(format!("the cell size is {cell} m; it must be above 0"));
    }
    if let Statistic::Percentile(p) = settings.statistic
        && !(0.0..=100.0).contains(&p)
    {
        return Err(format!("the percentile is {p}; it must be 0 to 100"));
    }
    if settings.fill_cells > MAX_FILL_CELLS {
        return Err(format!("gaps are filled up to {} cells; at most {MAX_FILL_CELLS} can be", settings.fill_cells));
    }
    Ok(())
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
    let Cells { mut heights, counts } = grid::cells(&chosen, &lattice, settings.statistic, survey.points)?;
    let (held, cells) = (counts.iter().filter(|n| **n > 0).count(), counts.len());
    let statistic = settings.statistic.name();
    notes.push(format!(
        "{} points were gridded ({statistic} of each cell of {cell_m} m); {held} of {cells} cells hold points",
        survey.points
    ));
    let geometry = lattice.geometry();
    let filled = fill::fill(&mut heights, geometry.rows, geometry.cols, settings.fill_cells)?;
    if settings.fill_cells > 0 {
        notes.push(format!("{filled} cells in gaps were filled, up to {} cells from points", settings.fill_cells));
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

/// The points of a cloud that are wanted.
struct Chosen<'a> {
    cloud: &'a Cloud,
    ground_only: bool,
}

impl Chosen<'_> {
    fn for_each(&self, mut f: impl FnMut(Point)) -> Result<(), Refusal> {
        self.cloud.for_each(|point| {
            if !point.is_noise() && (point.is_ground() || !self.ground_only) {
                f(point);
            }
        })
    }
}

/// Where the wanted points lie.
#[derive(Clone, Copy, Debug)]
struct Survey {
    points: u64,
    /// Lowest and highest x and y.
    low: [f64; 2],
    high: [f64; 2],
}

/// Looks at every point once; also returns what a user must know of those that are left out.
fn survey(chosen: &Chosen<'_>) -> Result<(Survey, Vec<String>), Refusal> {
    let cloud = chosen.cloud;
    let (mut points, mut noise, mut other) = (0_u64, 0_u64, 0_u64);
    let (mut low, mut high) = ([i32::MAX; 2], [i32::MIN; 2]);
    cloud.for_each(|point| {
        if point.is_noise() {
            noise += 1;
        } else if chosen.ground_only && !point.is_ground() {
            other += 1;
        } else {
            points += 1;
            for axis in 0..2 {
                low[axis] = low[axis].min(point.stored[axis]);
                high[axis] = high[axis].max(point.stored[axis]);
            }
        }
    })?;
    let total = cloud.claims.points;
    if points == 0 && other > 0 {
        return Err(Refusal::new(format!("none of its {total} points is of class 2, ground")));
    }
    if points == 0 {
        return Err(Refusal::new(format!("all of its {total} points are withheld or noise")));
    }
    let place = |stored: [i32; 2]| [0, 1].map(|axis| cloud.coordinate(axis, f64::from(stored[axis])));
    let survey = Survey { points, low: place(low), high: place(high) };
    let mut notes = cloud.crs.unit_notes();
    if cloud.crs == Crs::default() {
        notes.push("the file names no reference system; coordinates are taken as metres".to_owned());
    }
    if noise > 0 {
        notes.push(format!("{noise} points that are withheld or noise (classes 7 and 18) were left out"));
    }
    if other > 0 {
        notes.push(format!("{other} points of other classes than ground (2) were left out"));
    }
    Ok((survey, notes))
}
