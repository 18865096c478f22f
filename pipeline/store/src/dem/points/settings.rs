//! Settings for gridding points, and their limits.

use std::str::FromStr;

/// Most points for a median or percentile: 2 GiB.
pub const MAX_RANKED_POINTS: u64 = 1 << 28;
/// Largest distance from points to which a gap is filled, cells.
pub const MAX_FILL_CELLS: u32 = 100;

/// How points are gridded.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GridSettings {
    /// Side of a cell, m; by default the size at which about three quarters of the cells hold a point.
    pub cell_m: Option<f64>,
    /// Statistic that gives the height of a cell.
    pub statistic: Statistic,
    /// Distance from cells with points up to which gaps are filled, cells; 0 fills none.
    pub fill_cells: u32,
    /// Use only points of class 2, ground. Withheld points and the noise classes 7 and 18 are never used.
    pub ground_only: bool,
    /// Most cells of a grid without a given cell size, for which memory was planned. By default only the limit of all rasters applies.
    pub planned_cells: Option<u64>,
}

/// Height of a cell, from the heights of its points.
///
/// # Examples
/// ```
/// use sastrugi_store::dem::points::Statistic;
///
/// assert_eq!("p90".parse::<Statistic>(), Ok(Statistic::Percentile(90.0)));
/// assert_eq!("median".parse::<Statistic>(), Ok(Statistic::Median));
/// assert!("p101".parse::<Statistic>().is_err());
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Statistic {
    /// Mean.
    #[default]
    Mean,
    /// 50th percentile.
    Median,
    /// Percentile, 0 to 100.
    Percentile(f64),
    /// Lowest.
    Min,
    /// Highest.
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
    /// Name of the statistic, for notes.
    pub(super) fn name(self) -> String {
        match self {
            Self::Mean => "mean".to_owned(),
            Self::Median => "median".to_owned(),
            Self::Percentile(p) => format!("percentile {p}"),
            Self::Min => "lowest".to_owned(),
            Self::Max => "highest".to_owned(),
        }
    }
}

/// Refuses settings out of range.
pub(super) fn check(settings: &GridSettings) -> Result<(), String> {
    if let Some(cell) = settings.cell_m.filter(|cell| !(cell.is_finite() && *cell > 0.0)) {
        return Err(format!("the cell size must be above 0, got {cell} m"));
    }
    if let Statistic::Percentile(p) = settings.statistic
        && !(0.0..=100.0).contains(&p)
    {
        return Err(format!("the percentile must be from 0 to 100, got {p}"));
    }
    if settings.fill_cells > MAX_FILL_CELLS {
        return Err(format!("gaps can be filled up to {MAX_FILL_CELLS} cells, got {}", settings.fill_cells));
    }
    Ok(())
}
