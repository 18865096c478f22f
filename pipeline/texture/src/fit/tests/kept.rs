//! Partial windows are kept from one estimator to the next.
//!
//! They take most of the time of a fit without replicates. The fields of a study that have neither holes nor objects have the same ones, as has a
//! field with holes on level ground and on a slope.

use crate::bitmap::Bitmap;
use crate::covariance::LagBins;
use crate::covariance::partial::{DetrendedCells, PartialWindows};
use sastrugi_roughness::background::BoxWindow;
use std::sync::Mutex;

/// Most partial windows kept: most have up to 5 MB.
const KEPT_MAX: usize = 24;

/// Those kept, the one used last at the end.
static KEPT: Mutex<Vec<(Origin, PartialWindows)>> = Mutex::new(Vec::new());

/// All that partial windows follow from.
#[derive(PartialEq)]
struct Origin {
    side: [usize; 2],
    half: [usize; 2],
    /// Bits of the number of pairs.
    pairs: u64,
    /// Cells with a residual, and with a partial window.
    counts: [usize; 2],
    lags: Vec<([isize; 2], usize)>,
    trusted: Bitmap,
    used: Bitmap,
}

/// As [`PartialWindows::new`], unless they are known.
pub fn partial_windows(cells: &DetrendedCells, window: BoxWindow, bins: &LagBins, pairs: f64) -> PartialWindows {
    let origin = Origin {
        side: [cells.rows, cells.cols],
        half: window.half,
        pairs: pairs.to_bits(),
        counts: [cells.detrended, cells.partial],
        lags: bins.members.iter().map(|m| (m.lag, m.bin)).collect(),
        trusted: cells.trusted.clone(),
        used: cells.used.clone(),
    };
    known(&origin).unwrap_or_else(|| {
        // The lock is free meanwhile: a thread that waits for others may take up another field.
        let windows = PartialWindows::new(cells, window, bins, pairs);
        let mut kept = KEPT.lock().unwrap();
        if kept.len() == KEPT_MAX {
            kept.remove(0);
        }
        kept.push((origin, windows.clone()));
        windows
    })
}

fn known(origin: &Origin) -> Option<PartialWindows> {
    let mut kept = KEPT.lock().unwrap();
    let place = kept.iter().position(|(other, _)| other == origin)?;
    kept[place..].rotate_left(1);
    kept.last().map(|(_, windows)| windows.clone())
}
