//! Numbers as a reader wants them: as many digits as mean something.

/// `value` with `digits` significant digits; powers of ten outside 10⁻⁴…10⁶.
pub fn significant(value: f64, digits: usize) -> String {
    if value == 0.0 {
        return "0".into();
    }
    if !value.is_finite() {
        return if value.is_nan() { "–".into() } else { format!("{value}") };
    }
    let digits = digits.max(1);
    // The exponent after rounding to the digits wanted: 9.996 to three digits is 10.0.
    let scientific = format!("{value:.*e}", digits - 1);
    let (mantissa, exponent) = scientific.split_once('e').unwrap_or((&scientific, "0"));
    let exponent: i32 = exponent.parse().unwrap_or(0);
    if (-4..6).contains(&exponent) {
        let decimals = usize::try_from(digits as i32 - 1 - exponent).unwrap_or(0);
        format!("{value:.decimals$}")
    } else {
        format!("{mantissa}·10{}", superscript(exponent))
    }
}

/// `estimate ± error`, both to the error's second significant digit; the estimate alone when there is no error.
pub fn with_error(estimate: f64, error: Option<f64>) -> String {
    match error {
        Some(error) if error.is_finite() && error > 0.0 && estimate.is_finite() => {
            let decimals = 1 - error.log10().floor() as i32;
            if (0..=8).contains(&decimals) {
                let decimals = decimals as usize;
                format!("{estimate:.decimals$} ± {error:.decimals$}")
            } else {
                format!("{} ± {}", significant(estimate, 6), significant(error, 2))
            }
        }
        _ => significant(estimate, 5),
    }
}

/// A share as percent with one decimal below ten percent.
pub fn percent(share: f64) -> String {
    if !share.is_finite() {
        return "–".into();
    }
    let percent = 100.0 * share;
    if percent.abs() < 0.1 {
        format!("{} %", significant(percent, 2))
    } else if percent.abs() < 10.0 {
        format!("{percent:.1} %")
    } else {
        format!("{percent:.0} %")
    }
}

/// A span of time in the unit one would say it in.
pub fn seconds(seconds: f64) -> String {
    if seconds.abs() < 1.0 { format!("{} ms", (1e6 * seconds).round() / 1e3) } else { format!("{seconds:.1} s") }
}

/// The decimal prefix with which values as large as `largest` read best in a unit, and its factor: values are divided by it.
///
/// Products of units take it on their first: kN m, mrad/s. What has no unit takes none.
pub fn prefixed(largest: f64, unit: &str) -> (String, f64) {
    const PREFIXES: [(f64, &str); 7] =
        [(1e9, "G"), (1e6, "M"), (1e3, "k"), (1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n")];
    let takes = unit.chars().next().is_some_and(char::is_alphabetic) && !unit.starts_with("kg");
    let found = PREFIXES.iter().find(|(factor, _)| largest.abs() >= 0.5 * factor);
    match found {
        Some((factor, prefix)) if takes && largest.is_finite() => (format!("{prefix}{unit}"), *factor),
        _ => (unit.to_owned(), 1.0),
    }
}

fn superscript(exponent: i32) -> String {
    exponent
        .to_string()
        .chars()
        .map(|c| match c {
            '-' => '⁻',
            '1' => '¹',
            '2' => '²',
            '3' => '³',
            d => char::from_u32('⁰' as u32 + d as u32 - '0' as u32).unwrap_or(d),
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn significant_digits() {
        assert_eq!(significant(448.2391, 5), "448.24");
        assert_eq!(significant(0.0017453, 3), "0.00175");
        assert_eq!(significant(9.996, 3), "10.0");
        assert_eq!(significant(-6.9259e-5, 3), "-6.93·10⁻⁵");
        assert_eq!(significant(123_456_789.0, 2), "1.2·10⁸");
        assert_eq!(significant(0.0, 3), "0");
        assert_eq!(significant(f64::NAN, 3), "–");
    }

    #[test]
    fn the_error_sets_the_digits_of_the_estimate() {
        assert_eq!(with_error(448.239_12, Some(0.1234)), "448.24 ± 0.12");
        assert_eq!(with_error(0.051_941, Some(1.3e-5)), "0.051941 ± 0.000013");
        assert_eq!(with_error(2.5, None), "2.5000");
        assert_eq!(with_error(2.5, Some(f64::INFINITY)), "2.5000");
    }

    #[test]
    fn prefixes_keep_the_largest_between_a_half_and_five_hundred() {
        assert_eq!(prefixed(0.0016, "m"), ("mm".to_owned(), 1e-3));
        assert_eq!(prefixed(91_681.0, "N m"), ("kN m".to_owned(), 1e3));
        assert_eq!(prefixed(-5.3, "N"), ("N".to_owned(), 1.0));
        assert_eq!(prefixed(0.998, "N"), ("N".to_owned(), 1.0));
        assert_eq!(prefixed(2e-5, "rad"), ("µrad".to_owned(), 1e-6));
        for (largest, unit) in
            [(0.0, "rad"), (f64::NAN, "rad"), (f64::INFINITY, "rad"), (1e-3, ""), (5e3, "1"), (1e-3, "kg")]
        {
            assert_eq!(prefixed(largest, unit), (unit.to_owned(), 1.0));
        }
    }

    #[test]
    fn times_and_shares() {
        assert_eq!(seconds(0.5), "500 ms");
        assert_eq!(seconds(0.01), "10 ms");
        assert_eq!(seconds(2.0), "2.0 s");
        assert_eq!(percent(0.153), "15 %");
        assert_eq!(percent(-0.0213), "-2.1 %");
        assert_eq!(percent(0.0003), "0.030 %");
    }
}
