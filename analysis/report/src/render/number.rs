//! Numbers as text. A value that is not finite is printed as [`ABSENT`], never as `NaN`.

/// Printed in place of an unknown number.
pub const ABSENT: &str = "–";
/// Group separator of large counts: narrow no-break space.
const SEPARATOR: char = '\u{202f}';

/// `value` with a fixed number of decimals.
pub fn fixed(value: f64, decimals: usize) -> String {
    if !value.is_finite() {
        return ABSENT.into();
    }
    let text = format!("{value:.decimals$}");
    match text.strip_prefix('-') {
        Some(digits) if digits.chars().all(|c| c == '0' || c == '.') => digits.into(),
        Some(digits) => format!("−{digits}"),
        None => text,
    }
}

/// `value` to `digits` significant digits, with a power of ten if it is very large or small.
///
/// ```
/// use sastrugi_report::render::number::{ABSENT, significant};
///
/// assert_eq!([0.05, -12.345, 1.2345e9].map(|v| significant(v, 3)), ["0.0500", "−12.3", "1.23 × 10⁹"]);
/// assert_eq!(significant(f64::NAN, 3), ABSENT);
/// ```
pub fn significant(value: f64, digits: usize) -> String {
    if !value.is_finite() {
        return ABSENT.into();
    }
    if value == 0.0 {
        return "0".into();
    }
    let digits = digits.max(1);
    let scientific = format!("{value:.*e}", digits - 1);
    let Some((mantissa, exponent)) = scientific.split_once('e') else { return ABSENT.into() };
    match exponent.parse::<i32>() {
        Ok(e) if (-4..6).contains(&e) => fixed(value, usize::try_from(digits as i32 - 1 - e).unwrap_or(0)),
        Ok(e) => format!("{} × {}", mantissa.replace('-', "−"), power_of_ten(e)),
        Err(_) => ABSENT.into(),
    }
}

/// Magnitude below which values of these units are rounding noise. Smooth ground has a σ²/b below 1e-9 m, which is not (σ 0.1 mm, b 20 m).
const NOISE: f64 = 1e-11;
/// Units of quantities that have rounding noise, as columns state them.
const WITH_NOISE: [&str; 9] = ["1", "%", "points", "m", "s", "m/s", "m/s2", "deg", "deg/s"];

/// The value, or 0 where it is below 1e-11 of its unit: rounding noise. Powers (m², m⁴) may be that small, and so may numbers without a unit,
/// such as p: they stay as they are.
///
/// ```
/// use sastrugi_report::render::number::without_noise;
///
/// assert_eq!([1.1e-12, 5e-10].map(|v| without_noise(v, "m")), [0.0, 5e-10]);
/// assert_eq!(["m2", ""].map(|unit| without_noise(3e-15, unit)), [3e-15; 2]);
/// ```
pub fn without_noise(value: f64, unit: &str) -> f64 {
    if value.abs() < NOISE && WITH_NOISE.contains(&unit) { 0.0 } else { value }
}

/// As [`significant`], without trailing zeros of a decimal fraction.
pub fn plain(value: f64, digits: usize) -> String {
    let text = significant(value, digits);
    if text.contains('.') && !text.contains(' ') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}

/// A count with its thousands separated.
pub fn count(n: impl TryInto<u64>) -> String {
    let Ok(n) = n.try_into() else { return ABSENT.into() };
    let digits = n.to_string();
    let mut out = String::new();
    for (i, c) in digits.chars().enumerate() {
        if i > 0 && digits.len() > 4 && (digits.len() - i).is_multiple_of(3) {
            out.push(SEPARATOR);
        }
        out.push(c);
    }
    out
}

/// A count, with its thousands separated, and the word it counts: `1 terrain`, `2 terrains`.
pub fn counted(n: usize, word: &str) -> String {
    sastrugi_schemas::counted(count(n), word)
}

/// Words as a list: `a`, `a and b`, `a, b and c`; empty without any.
pub fn listed<S: AsRef<str>>(words: &[S]) -> String {
    match words {
        [] => String::new(),
        [only] => only.as_ref().to_owned(),
        [first @ .., last] => {
            let first: Vec<&str> = first.iter().map(S::as_ref).collect();
            format!("{} and {}", first.join(", "), last.as_ref())
        }
    }
}

/// A file size in decimal units.
pub fn bytes(n: u64) -> String {
    let units = ["kB", "MB", "GB", "TB"];
    if n < 1000 {
        return format!("{n} B");
    }
    let mut value = n as f64 / 1000.0;
    let mut unit = 0;
    while value >= 1000.0 && unit + 1 < units.len() {
        value /= 1000.0;
        unit += 1;
    }
    format!("{} {}", significant(value, 3), units[unit])
}

/// A share as a percentage.
pub fn percent(share: f64, decimals: usize) -> String {
    if share.is_finite() { format!("{} %", fixed(100.0 * share, decimals)) } else { ABSENT.into() }
}

/// `value unit`, or [`ABSENT`] alone.
pub fn with_unit(value: f64, digits: usize, unit: &str) -> String {
    let text = significant(value, digits);
    if text == ABSENT { text } else { before_unit(&text, unit) }
}

/// A number as text and its unit, if it has one: degrees follow it without a space.
pub fn before_unit(number: &str, unit: &str) -> String {
    match unit {
        "" => number.to_owned(),
        _ if unit.starts_with('°') => format!("{number}{unit}"),
        _ => format!("{number} {unit}"),
    }
}

/// `10` with a raised exponent.
pub fn power_of_ten(exponent: i32) -> String {
    let raised = |c| match c {
        '-' => '⁻',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        '4' => '⁴',
        '5' => '⁵',
        '6' => '⁶',
        '7' => '⁷',
        '8' => '⁸',
        '9' => '⁹',
        _ => '⁰',
    };
    format!("10{}", exponent.to_string().chars().map(raised).collect::<String>())
}

/// A unit of a column as set in text (`m/s2` becomes `m/s²`).
pub fn unit(unit: &str) -> String {
    match unit {
        "1" => String::new(),
        other => other.replace('2', "²").replace('4', "⁴").replace("deg", "°"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_numbers_are_formatted() {
        assert_eq!(significant(0.838, 3), "0.838");
        assert_eq!(significant(-12.345, 3), "−12.3");
        assert_eq!(significant(1.234e-7, 3), "1.23 × 10⁻⁷");
        assert_eq!(significant(99.96, 3), "100");
        assert_eq!(
            (plain(0.05, 4).as_str(), plain(640.0, 4).as_str(), plain(1e-9, 2).as_str()),
            ("0.05", "640", "1.0 × 10⁻⁹")
        );
        assert_eq!(significant(0.0, 3), "0");
        assert_eq!(fixed(-0.04, 1), "0.0");
        assert_eq!(count(1_234_567_i64), "1\u{202f}234\u{202f}567");
        assert_eq!(count(-1_i64), ABSENT);
        assert_eq!((counted(1, "terrain"), counted(2, "terrain")), ("1 terrain".into(), "2 terrains".into()));
        let lists = ["", "a", "a b", "a b c"].map(|words| listed(&words.split_whitespace().collect::<Vec<_>>()));
        assert_eq!(lists, ["", "a", "a and b", "a, b and c"]);
        assert_eq!(bytes(8_123_456), "8.12 MB");
        assert_eq!(percent(0.875, 1), "87.5 %");
        assert_eq!(unit("m/s2"), "m/s²");
        assert_eq!([unit("m4"), unit("deg"), unit("1")], ["m⁴", "°", ""]);
    }

    /// Ends of the ranges in which numbers are written without a power of ten, counts without a separator, sizes in one unit.
    #[test]
    fn val_formats_change_at_their_limits() {
        assert_eq!([1e-4, 9.99e-5].map(|v| significant(v, 3)), ["0.000100", "9.99 × 10⁻⁵"]);
        assert_eq!([999_999.0, 1e6].map(|v| significant(v, 6)), ["999999", "1.00000 × 10⁶"]);
        assert_eq!([9_999_u64, 10_000].map(count), ["9999", "10\u{202f}000"]);
        assert_eq!([999, 1_000, 999_000, 1_000_000].map(bytes), ["999 B", "1.00 kB", "999 kB", "1.00 MB"]);
        assert_eq!(bytes(5_000_000_000_000_000), "5000 TB");
        assert_eq!((with_unit(2.0, 2, "m"), with_unit(2.0, 2, "")), ("2.0 m".into(), "2.0".into()));
        assert_eq!([before_unit("2", "°"), before_unit("2", "%"), before_unit("2", "")], ["2°", "2 %", "2"]);
    }

    #[test]
    fn prop_non_finite_values_are_absent() {
        for v in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            assert_eq!(significant(v, 3), ABSENT);
            assert_eq!(fixed(v, 2), ABSENT);
            assert_eq!(percent(v, 1), ABSENT);
            assert_eq!(with_unit(v, 3, "m"), ABSENT);
        }
    }
}
