//! Largest crater or rock that may be added to a site.
//!
//! A feature that the DEM or images of the site would show is either in the DEM already or does not exist. A feature shows when two samples
//! fall on it. So nothing wider than two posts of the DEM is added (section 5 of the paper's scheme), and nothing wider than `image_pixels`
//! pixels of the images; the default of two is the sampling theorem's bound. Whether an observer can see a rock of two pixels also depends
//! on light and contrast; surveys that count rocks require more pixels.

use crate::planetary::RawProcess;
use sastrugi_schemas::counted;

/// Largest crater or rock, posts of the DEM.
pub const DIAMETER_POSTS: f64 = 2.0;
/// Widest crater or rock that images do not show, pixels.
pub const DIAMETER_PIXELS: f64 = 2.0;

/// The widest crater or rock that may be added, and why.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Bound {
    /// The DEM, with this distance between its posts, m.
    Posts(f64),
    /// Images: metres per pixel, and the largest width of a feature in pixels.
    Pixels(f64, f64),
}

impl Bound {
    /// Widest crater or rock, m.
    pub fn most_m(self) -> f64 {
        match self {
            Self::Posts(post_m) => DIAMETER_POSTS * post_m,
            Self::Pixels(resolution_m, pixels) => pixels * resolution_m,
        }
    }

    /// The stricter of two bounds.
    pub fn and(self, other: Option<Self>) -> Self {
        other.filter(|other| other.most_m() < self.most_m()).unwrap_or(self)
    }

    /// A note on the bound; `None` for a list without craters and rocks.
    pub fn note(self, processes: &[RawProcess]) -> Option<String> {
        let why = match self {
            Self::Posts(post_m) => format!("the DEM, with posts {post_m:.3} m apart"),
            Self::Pixels(resolution_m, pixels) => {
                format!("images with {resolution_m} m pixels ({})", counted(pixels, "pixel"))
            }
        };
        let bounded = processes.iter().any(|p| diameter_min_m(p).is_some());
        bounded
            .then(|| format!("craters and rocks are at most {:.3} m wide: {why} would show wider ones", self.most_m()))
    }

    /// The processes, limited to this width.
    ///
    /// # Errors
    /// The index of a process whose craters or rocks are all wider, and its smallest diameter, m.
    pub fn apply(self, processes: &[RawProcess]) -> Result<Vec<RawProcess>, (usize, f64)> {
        let most_m = self.most_m();
        let one = |(n, process): (usize, &RawProcess)| match diameter_min_m(process) {
            Some(low_m) if low_m > most_m => Err((n, low_m)),
            _ => Ok(narrowed(process, most_m)),
        };
        processes.iter().enumerate().map(one).collect()
    }
}

/// The smallest crater or rock of a process, m.
fn diameter_min_m(process: &RawProcess) -> Option<f64> {
    match process {
        RawProcess::PrimaryCraters(p) => Some(p.diameter_min_m),
        RawProcess::SecondaryCraters(p) => Some(p.diameter_min_m),
        RawProcess::Rocks(p) => Some(p.diameter_min_m),
        _ => None,
    }
}

/// A process limited to craters or rocks up to `most_m` wide.
fn narrowed(process: &RawProcess, most_m: f64) -> RawProcess {
    let mut process = process.clone();
    let widest_m = match &mut process {
        RawProcess::PrimaryCraters(p) => &mut p.diameter_max_m,
        RawProcess::SecondaryCraters(p) => &mut p.diameter_max_m,
        RawProcess::Rocks(p) => &mut p.diameter_max_m,
        _ => return process,
    };
    *widest_m = widest_m.min(most_m);
    process
}
