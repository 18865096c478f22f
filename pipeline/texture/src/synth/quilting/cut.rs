//! Least-error cut between a patch and the patches already laid.

/// Widths of the strips of a patch that lie on earlier patches, cells: north and west, then south and east.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Strips {
    /// North, west.
    pub before: [usize; 2],
    /// South, east.
    pub after: [usize; 2],
}

/// The path of least total error along a strip of lines of `width` cells: for each line the cell that the path crosses. Consecutive
/// cells differ by at most 1. Cost: 3 comparisons per cell.
pub fn least_error_path(errors: &[f64], width: usize) -> Vec<usize> {
    // Least error of any path from the first line to each cell.
    let mut totals = errors.to_vec();
    for here in width..totals.len() {
        let (column, above) = (here % width, here - width);
        let west = if column > 0 { totals[above - 1] } else { f64::INFINITY };
        let east = if column + 1 < width { totals[above + 1] } else { f64::INFINITY };
        totals[here] += totals[above].min(west).min(east);
    }
    let least = |line: usize, among: std::ops::Range<usize>| {
        let of = |k: &usize| totals[line * width + k];
        among.min_by(|a, b| of(a).total_cmp(&of(b))).unwrap_or(0)
    };
    let lines = totals.len() / width;
    let mut path = vec![0; lines];
    let mut among = 0..width;
    for line in (0..lines).rev() {
        path[line] = least(line, among);
        among = path[line].saturating_sub(1)..(path[line] + 2).min(width);
    }
    path
}

/// Which cells of a patch of `shape` (rows, cols) replace the earlier ones: all beyond the cut through each of its strips. `errors` holds
/// the squared difference of each cell from the earlier patches, row-major.
pub fn replaced(errors: &[f64], shape: [usize; 2], strips: &Strips) -> Vec<bool> {
    let mut replaced = vec![true; errors.len()];
    for (axis, from_end) in [(0, false), (1, false), (0, true), (1, true)] {
        let width = if from_end { strips.after[axis] } else { strips.before[axis] };
        if width == 0 {
            continue;
        }
        let (across, along) = (shape[axis], shape[1 - axis]);
        // The cell that lies `depth` cells from the outer border, at `k` along it.
        let cell = move |k: usize, depth: usize| {
            let depth = if from_end { across - 1 - depth } else { depth };
            if axis == 0 { depth * shape[1] + k } else { k * shape[1] + depth }
        };
        let strip: Vec<f64> = (0..along).flat_map(|k| (0..width).map(move |depth| errors[cell(k, depth)])).collect();
        for (k, &cut) in least_error_path(&strip, width).iter().enumerate() {
            (0..cut).for_each(|depth| replaced[cell(k, depth)] = false);
        }
    }
    replaced
}
