//! Axes: positions of values on the page, and ticks at round numbers.

use super::number;

/// A tick: value and label.
#[derive(Clone, Debug, PartialEq)]
pub struct Tick {
    /// Its value.
    pub value: f64,
    /// Its label.
    pub label: String,
}

/// Linear or logarithmic map of `[low, high]` onto `[from, to]` of the page.
///
/// ```
/// use sastrugi_report::render::axis::Axis;
///
/// // Vertical axes end above where they start: the page counts downwards.
/// let axis = Axis::linear(0.0, 10.0).over(300.0, 100.0);
/// assert_eq!((axis.at(2.5), axis.at(f64::NAN), axis.clamped(12.0)), (Some(250.0), None, Some(100.0)));
/// let labels: Vec<String> = axis.ticks(5).into_iter().map(|tick| tick.label).collect();
/// assert_eq!(labels, ["0", "2", "4", "6", "8", "10"]);
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Axis {
    log: bool,
    low: f64,
    high: f64,
    from: f64,
    to: f64,
}

impl Axis {
    /// A linear axis over `[low, high]`; an empty or invalid range is widened so that the map stays finite.
    pub fn linear(low: f64, high: f64) -> Self {
        let (low, high) = widened(low, high);
        Self { log: false, low, high, from: 0.0, to: 1.0 }
    }

    /// A logarithmic axis over `[low, high]`, both positive; anything else becomes one decade around 1.
    pub fn log(low: f64, high: f64) -> Self {
        let usable = low.is_finite() && high.is_finite() && low > 0.0 && high >= low;
        let (low, high) = match usable {
            false => (0.5, 5.0),
            true if high / low < 1.05 => (low / 2.0, high * 2.0),
            true => (low, high),
        };
        Self { log: true, low, high, from: 0.0, to: 1.0 }
    }

    /// The same axis, mapped onto `[from, to]` of the page.
    pub fn over(self, from: f64, to: f64) -> Self {
        Self { from, to, ..self }
    }

    /// Position of a value on the page; `None` for a value that the axis cannot show (not finite, not positive on a log axis).
    pub fn at(&self, value: f64) -> Option<f64> {
        let share = match self.log {
            true if value > 0.0 => {
                (libm::log(value) - libm::log(self.low)) / (libm::log(self.high) - libm::log(self.low))
            }
            true => f64::NAN,
            false => (value - self.low) / (self.high - self.low),
        };
        share.is_finite().then_some(self.from + share * (self.to - self.from))
    }

    /// Position of a value, clamped to the axis.
    pub fn clamped(&self, value: f64) -> Option<f64> {
        self.at(if value.is_nan() { value } else { value.clamp(self.low, self.high) })
    }

    /// Ends of the axis in values.
    pub fn range(&self) -> (f64, f64) {
        (self.low, self.high)
    }

    /// At most about `most` ticks at round values within the axis.
    pub fn ticks(&self, most: usize) -> Vec<Tick> {
        let linear = || linear_ticks(self.low, self.high, most);
        // Within less than a decade, a logarithmic axis may have one round power or none.
        if self.log {
            Some(log_ticks(self.low, self.high, most)).filter(|t| t.len() > 1).unwrap_or_else(linear)
        } else {
            linear()
        }
    }

    /// True for a logarithmic axis.
    pub fn is_log(&self) -> bool {
        self.log
    }
}

/// `[low, high]` with a positive length.
fn widened(low: f64, high: f64) -> (f64, f64) {
    if !(low.is_finite() && high.is_finite()) || low > high {
        return (0.0, 1.0);
    }
    let least = 1e-9 * low.abs().max(high.abs()).max(1e-6);
    if high - low > least {
        (low, high)
    } else {
        (low - least.max(0.5 * low.abs()), high + least.max(0.5 * high.abs()))
    }
}

/// Exponent of the decade that contains a positive value.
fn decade(value: f64) -> i32 {
    format!("{value:e}").rsplit_once('e').and_then(|(_, e)| e.parse().ok()).unwrap_or(0)
}

/// `digits * 10^exponent`, rounded once.
fn decimal(digits: i64, exponent: i32) -> f64 {
    format!("{digits}e{exponent}").parse().unwrap_or(0.0)
}

/// Ticks at multiples of 1, 2 or 5 times a power of ten: the smallest such step that needs no more than `most`.
fn linear_ticks(low: f64, high: f64, most: usize) -> Vec<Tick> {
    let most = most.max(2) as f64;
    let start = decade((high - low) / most);
    let steps = (start..start + 3).flat_map(|e| [1, 2, 5].map(|m| (m, e)));
    let fits = |&(m, e): &(i64, i32)| (high - low) / decimal(m, e) <= most;
    let (m, e) = steps.into_iter().find(fits).unwrap_or((1, start + 3));
    let step = decimal(m, e);
    let (first, last) = ((low / step - 1e-9).ceil(), (high / step + 1e-9).floor());
    if !(first.abs() < 1e12 && last.abs() < 1e12) {
        return Vec::new();
    }
    let tick = |i: i64| {
        let value = decimal(i * m, e);
        Tick { value, label: tick_label(value, e) }
    };
    (first as i64..=last as i64).map(tick).collect()
}

/// Label of a linear tick whose step has the exponent `exponent`.
fn tick_label(value: f64, exponent: i32) -> String {
    match exponent {
        -5..=5 if value.abs() < 1e6 => number::fixed(value, usize::try_from(-exponent).unwrap_or(0)),
        _ => number::significant(value, 3),
    }
}

/// Ticks at powers of ten, thinned if there are many, with 2 and 5 in between if there are few.
fn log_ticks(low: f64, high: f64, most: usize) -> Vec<Tick> {
    let (first, last) = (decade(low), decade(high));
    let stride = (last - first) / i32::try_from(most.max(1)).unwrap_or(i32::MAX) + 1;
    let between: &[i64] = if last - first <= 1 { &[1, 2, 5] } else { &[1] };
    let aligned = first.div_euclid(stride) * stride;
    let values =
        (aligned..=last).step_by(stride.unsigned_abs() as usize).flat_map(|e| between.iter().map(move |&m| (m, e)));
    let tick = |(m, e): (i64, i32)| Tick { value: decimal(m, e), label: log_label(m, e) };
    values.map(tick).filter(|t| t.value >= low * (1.0 - 1e-9) && t.value <= high * (1.0 + 1e-9)).collect()
}

/// Label of `digits * 10^exponent` on a log axis.
fn log_label(digits: i64, exponent: i32) -> String {
    match exponent {
        -3..=3 => number::fixed(decimal(digits, exponent), usize::try_from(-exponent).unwrap_or(0)),
        _ if digits == 1 => number::power_of_ten(exponent),
        _ => format!("{digits} × {}", number::power_of_ten(exponent)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(axis: Axis, most: usize) -> Vec<String> {
        axis.ticks(most).into_iter().map(|t| t.label).collect()
    }

    #[test]
    fn val_linear_ticks_are_round() {
        assert_eq!(labels(Axis::linear(0.0, 1.0), 5), ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]);
        assert_eq!(labels(Axis::linear(-3.2, 11.0), 5), ["0", "5", "10"]);
        assert_eq!(labels(Axis::linear(36.4, 37.1), 4), ["36.4", "36.6", "36.8", "37.0"]);
        assert_eq!(labels(Axis::linear(0.0, 0.0021), 3), ["0.000", "0.001", "0.002"]);
    }

    #[test]
    fn val_log_ticks() {
        assert_eq!(labels(Axis::log(0.02, 30.0), 6), ["0.1", "1", "10"]);
        assert_eq!(labels(Axis::log(0.9, 8.0), 6), ["1", "2", "5"]);
        // 1 alone would not show the scale.
        assert_eq!(labels(Axis::log(0.99, 1.44), 5), ["1.0", "1.1", "1.2", "1.3", "1.4"]);
        assert_eq!(labels(Axis::log(1e-12, 1e2), 5), ["10⁻¹²", "10⁻⁹", "10⁻⁶", "0.001", "1"]);
    }

    /// By hand: a quarter of the way on a linear axis, a decade of two on a logarithmic one; upside down where `from` exceeds `to`.
    #[test]
    fn val_places_on_the_page() {
        let linear = Axis::linear(-2.0, 6.0).over(10.0, 90.0);
        assert_eq!([-2.0, 0.0, 6.0, 8.0].map(|v| linear.at(v)), [Some(10.0), Some(30.0), Some(90.0), Some(110.0)]);
        let falling = Axis::linear(-2.0, 6.0).over(90.0, 10.0);
        assert_eq!(falling.at(0.0), Some(70.0));
        assert_eq!([-9.0, 0.0, 9.0].map(|v| linear.clamped(v)), [Some(10.0), Some(30.0), Some(90.0)]);
        assert_eq!(linear.clamped(f64::NAN), None);
        let log = Axis::log(0.1, 10.0).over(0.0, 200.0);
        for (value, place) in [(0.1, 0.0), (1.0, 100.0), (10.0, 200.0), (100.0, 300.0)] {
            assert!((log.at(value).unwrap() - place).abs() < 1e-9, "{value}: {:?}", log.at(value));
        }
        assert_eq!([log.at(0.0), log.at(-1.0)], [None, None]);
        assert!((log.clamped(1e9).unwrap() - 200.0).abs() < 1e-9);
    }

    #[test]
    fn prop_ticks_lie_on_the_axis_and_are_few() {
        for exponent in -9..9 {
            for factor in [1.0, 1.7, 3.3, 9.9] {
                let high = factor * libm::pow(10.0, f64::from(exponent));
                for low in [0.0, -high, 0.9 * high] {
                    let ticks = Axis::linear(low, high).ticks(6);
                    assert!((2..=8).contains(&ticks.len()), "{low} {high}: {}", ticks.len());
                    let slack = 1e-8 * (high - low);
                    assert!(ticks.iter().all(|t| t.value >= low - slack && t.value <= high + slack));
                    assert!(ticks.windows(2).all(|w| w[0].value < w[1].value && w[0].label != w[1].label));
                }
            }
        }
    }

    #[test]
    fn prop_any_range_gives_finite_places() {
        for (low, high) in [(f64::NAN, 1.0), (3.0, 3.0), (0.0, 0.0), (5.0, -5.0), (f64::NEG_INFINITY, f64::INFINITY)] {
            for axis in [Axis::linear(low, high).over(10.0, 90.0), Axis::log(low, high).over(10.0, 90.0)] {
                assert!(axis.at(1.0).is_some_and(f64::is_finite));
                assert!(axis.ticks(5).len() < 20);
            }
        }
        assert_eq!(Axis::log(1.0, 10.0).at(-1.0), None);
        assert_eq!(Axis::linear(1.0, 10.0).at(f64::NAN), None);
    }
}
