//! Detection of quantised heights, such as those of 16-bit images: over 4 km of relief a step is 61 mm, about the hazard height of a
//! rover.

/// Largest height step on which rovers can drive, m.
pub const HEIGHT_STEP_MAX_M: f64 = 1e-3;
/// Smallest number of distinct heights at which quantisation can be told from ground made of a few terraces. Eight heights of
/// unquantised ground lie whole steps apart with a probability below one in a million: each gap but the smallest would have to be
/// near a whole step, to 4 %.
const LEVELS_MIN: usize = 8;
/// Largest deviation of a height from a whole step, in steps.
const NEAR: f64 = 0.02;

/// The quantisation step of heights that all lie whole steps apart, m; `None` if they do not, or if there are too few to tell. No
/// data is ignored.
pub fn height_step_m(heights_m: &[f32]) -> Option<f64> {
    let mut levels: Vec<f32> = heights_m.iter().copied().filter(|z| z.is_finite()).collect();
    levels.sort_unstable_by(f32::total_cmp);
    levels.dedup();
    if levels.len() < LEVELS_MIN {
        return None;
    }
    let (lowest, highest) = (f64::from(levels[0]), f64::from(levels[levels.len() - 1]));
    let gaps = levels.windows(2).map(|pair| f64::from(pair[1]) - f64::from(pair[0]));
    let least = gaps.clone().fold(f64::INFINITY, f64::min);
    // The mean of the gaps of about one step: individual gaps are off by the rounding of the heights.
    let (count, sum) = gaps.filter(|gap| *gap < 1.5 * least).fold((0.0, 0.0), |(n, sum), gap| (n + 1.0, sum + gap));
    let mut step = sum / count;
    let rounding = f64::from(f32::EPSILON) * lowest.abs().max(highest.abs());
    if rounding >= 0.1 * step {
        return None;
    }
    // From the lowest level up: the step is the least-squares estimate from the levels so far, more accurate the farther they reach.
    let (mut products, mut squares, mut reached) = (0.0, 0.0, 1.0);
    for level in &levels[1..] {
        let above = f64::from(*level) - lowest;
        let steps = (above / step).round();
        if (above - steps * step).abs() > NEAR * step + 2.0 * rounding * (1.0 + steps / reached) {
            return None;
        }
        (products, squares, reached) = (products + steps * above, squares + steps * steps, steps);
        step = products / squares;
    }
    Some(step)
}
