//! The settings by which points are gridded, and the limits of these.

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
    /// What a height is of the points of its cell, in words.
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
