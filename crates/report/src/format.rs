//! Numbers as people read them: on the terminal and in the report.
//!
//! Records keep full precision; nothing here is meant to be parsed. Every number has the minus sign (−), in its exponent too.

/// Shown for a number that does not exist.
const NONE: &str = "–";
/// p-values below this are shown as a bound: the approximations behind them hold no further.
const LEAST_P: f64 = 1e-16;
/// Decimal numbers lie between these sizes; others are in e-notation.
const DECIMAL: std::ops::Range<f64> = 1e-3..1e6;

/// The text of a number with minus signs instead of hyphens.
pub fn minus(text: &str) -> String {
    text.replace('-', "−")
}

/// Three significant digits; integers of more digits are shown whole. A dash for NaN and infinity.
///
/// ```
/// use depthcal_report::format::number;
/// assert_eq!([9.7134, 0.12345, -1234.5, 1.5e-6].map(number), ["9.71", "0.123", "−1234", "1.50e−6"]);
/// ```
pub fn number(value: f64) -> String {
    if !value.is_finite() {
        return NONE.to_owned();
    }
    let decimals = match value.abs() {
        0.0 => 0,
        a if !DECIMAL.contains(&a) => return minus(&format!("{value:.2e}")),
        // Each bound is where rounding carries into the next digit: 9.996 becomes 10.0.
        a if a >= 99.95 => 0,
        a if a >= 9.995 => 1,
        a if a >= 0.9995 => 2,
        a if a >= 0.09995 => 3,
        a if a >= 0.009995 => 4,
        _ => 5,
    };
    fixed(value, decimals)
}

/// [`number`] with a unit; a bare dash where there is no number.
pub fn quantity(value: f64, unit: &str) -> String {
    let text = number(value);
    if value.is_finite() && !unit.is_empty() { format!("{text} {unit}") } else { text }
}

/// A unit of the model or of a record as it is shown: that of numbers without a unit, `1`, is empty.
pub fn shown_unit(unit: &str) -> &str {
    if unit == "1" { "" } else { unit }
}

/// [`number`] with a plus or minus sign; zero has none.
pub fn signed(value: f64) -> String {
    let text = number(value);
    if value > 0.0 { format!("+{text}") } else { text }
}

/// A number with a given number of decimals. Never "−0.00".
pub fn fixed(value: f64, decimals: usize) -> String {
    if !value.is_finite() {
        return NONE.to_owned();
    }
    let text = format!("{value:.decimals$}");
    match text.strip_prefix('-') {
        Some(rest) if rest.chars().all(|c| c == '0' || c == '.') => rest.to_owned(),
        Some(_) => minus(&text),
        None => text,
    }
}

/// A percentage (of a value that is in per cent already): three significant digits, two decimals at most.
pub fn percent(value: f64) -> String {
    let decimals = match value.abs() {
        a if a >= 99.95 => 0,
        a if a >= 9.995 => 1,
        _ => 2,
    };
    if value.is_finite() { format!("{} %", fixed(value, decimals)) } else { NONE.to_owned() }
}

/// `1.90 to 2.41 mm`.
pub fn interval(low: f64, high: f64, unit: &str) -> String {
    format!("{} to {}", number(low), quantity(high, unit))
}

/// A p-value on its own: `0.012`, `3e−7`, `< 1e−16`.
pub fn p_value(p: f64) -> String {
    match p {
        p if p.is_nan() => NONE.to_owned(),
        p if p < LEAST_P => minus(&format!("< {LEAST_P:e}")),
        p if p < 1e-3 => minus(&format!("{p:.0e}")),
        p => format!("{p:.3}"),
    }
}

/// A p-value in a sentence: `p = 0.012`, `p < 1e−16`.
pub fn p_equals(p: f64) -> String {
    let text = p_value(p);
    if text.starts_with('<') { format!("p {text}") } else { format!("p = {text}") }
}

/// A value with its standard deviation; [`ToString`] gives `476.912 ± 0.041`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Measured {
    /// The value, to the last place of the standard deviation.
    pub value: String,
    /// The standard deviation with two significant digits; absent where it is not known.
    pub std: Option<String>,
}

impl std::fmt::Display for Measured {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match &self.std {
            Some(std) => write!(f, "{} ± {std}", self.value),
            None => f.write_str(&self.value),
        }
    }
}

/// A value with its standard deviation: the latter with two significant digits, the value to the same place. Without a
/// positive standard deviation the value has up to six significant digits.
///
/// ```
/// use depthcal_report::format::measured;
/// assert_eq!(measured(476.9123, Some(0.0412)).to_string(), "476.912 ± 0.041");
/// assert_eq!(measured(1.3406e-4, Some(2.1e-7)).to_string(), "1.3406e−4 ± 2.1e−7");
/// ```
pub fn measured(value: f64, std: Option<f64>) -> Measured {
    let Some(std) = std.filter(|s| value.is_finite() && s.is_finite() && *s > 0.0) else {
        return Measured { value: significant(value, 6), std: None };
    };
    // Two significant digits end one place after the first digit of the rounded standard deviation.
    let last_place = exponent(std, 1) - 1;
    if DECIMAL.contains(&value.abs().max(std)) {
        let decimals = (-last_place).max(0) as usize;
        return Measured { value: fixed(value, decimals), std: Some(fixed(std, decimals)) };
    }
    let steps = (value / 10_f64.powi(last_place)).round().abs();
    let text = match steps {
        0.0 => "0".to_owned(),
        _ => format!("{value:.*e}", format!("{steps}").len() - 1),
    };
    Measured { value: minus(&text), std: Some(minus(&format!("{std:.1e}"))) }
}

/// The decimal exponent of a number that is rounded to `digits` digits after the first one.
fn exponent(value: f64, digits: usize) -> i32 {
    format!("{value:.digits$e}").rsplit_once('e').and_then(|(_, e)| e.parse().ok()).unwrap_or(0)
}

/// A number with at most `digits` significant digits, without trailing zeros.
pub fn significant(value: f64, digits: usize) -> String {
    if !value.is_finite() {
        return NONE.to_owned();
    }
    let after_first = digits.saturating_sub(1);
    let trim = |text: &str| match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
        false => text.to_owned(),
    };
    if value == 0.0 || DECIMAL.contains(&value.abs()) {
        let decimals = (after_first as i32 - exponent(value, after_first)).max(0) as usize;
        return trim(&fixed(value, decimals));
    }
    let text = format!("{value:.after_first$e}");
    let (mantissa, exponent) = text.split_once('e').unwrap_or((&text, "0"));
    minus(&format!("{}e{exponent}", trim(mantissa)))
}

/// `1 frame`, `9 frames`.
pub fn count(n: usize, noun: &str) -> String {
    if n == 1 { format!("1 {noun}") } else { format!("{n} {noun}s") }
}

/// `a`, `a and b`, `a, b and c`.
pub fn join<S: AsRef<str>>(words: &[S]) -> String {
    match words {
        [] => String::new(),
        [one] => one.as_ref().to_owned(),
        [rest @ .., last] => {
            format!("{} and {}", rest.iter().map(AsRef::as_ref).collect::<Vec<_>>().join(", "), last.as_ref())
        }
    }
}

/// A sentence's first letter as a capital.
pub fn capital(text: &str) -> String {
    let mut chars = text.chars();
    chars.next().map_or(String::new(), |c| c.to_uppercase().collect::<String>() + chars.as_str())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_three_significant_digits() {
        let shown = [9.713, 0.1234, -1234.5, 9.996, 99.96, 0.9996, 0.001234, 0.0, f64::NAN, 2.5e7].map(number);
        assert_eq!(shown, ["9.71", "0.123", "−1234", "10.0", "100", "1.00", "0.00123", "0", "–", "2.50e7"]);
        assert_eq!((signed(2.0), signed(-2.0), signed(0.0)), ("+2.00".into(), "−2.00".into(), "0".into()));
        assert_eq!((quantity(2.5, "mm"), quantity(f64::NAN, "mm")), ("2.50 mm".into(), "–".into()));
        assert_eq!(fixed(-0.0001, 2), "0.00");
        assert_eq!([16.54, 0.123, -4.0, 120.0].map(percent), ["16.5 %", "0.12 %", "−4.00 %", "120 %"]);
        assert_eq!(interval(-1.2, 2.41, "mm"), "−1.20 to 2.41 mm");
    }

    #[test]
    fn values_end_where_their_standard_deviations_do() {
        let shown = |value, std| measured(value, Some(std)).to_string();
        assert_eq!(shown(1.3406e-4, 2.1e-7), "1.3406e−4 ± 2.1e−7");
        assert_eq!(shown(-1.3406e-4, 2.1e-7), "−1.3406e−4 ± 2.1e−7");
        assert_eq!(shown(476.9123, 0.0412), "476.912 ± 0.041");
        assert_eq!(shown(476.9123, 0.0996), "476.91 ± 0.10");
        assert_eq!(shown(-0.03861, 0.0021), "−0.0386 ± 0.0021");
        assert_eq!(shown(3e-9, 2.1e-7), "0 ± 2.1e−7");
        assert_eq!(shown(3e-8, 2.1e-7), "3e−8 ± 2.1e−7");
        assert_eq!(shown(1234.5, 321.0), "1234 ± 321");
        assert_eq!(measured(0.0, None).to_string(), "0");
        assert_eq!(measured(300.0, Some(f64::NAN)).to_string(), "300");
    }

    #[test]
    fn significant_digits_without_trailing_zeros() {
        assert_eq!(significant(1.5e-6, 3), "1.5e−6");
        assert_eq!(significant(320.0, 6), "320");
        assert_eq!(significant(299.90356, 3), "300");
        assert_eq!(significant(0.00123456, 3), "0.00123");
        assert_eq!(significant(2e6, 1), "2e6");
    }

    #[test]
    fn p_values_are_numbers_or_bounds() {
        assert_eq!(
            [0.5, 0.0123, 3.2e-7, 1e-20, 0.0, f64::NAN].map(p_value),
            ["0.500", "0.012", "3e−7", "< 1e−16", "< 1e−16", "–"]
        );
        assert_eq!((p_equals(0.5), p_equals(0.0)), ("p = 0.500".into(), "p < 1e−16".into()));
    }

    #[test]
    fn words() {
        assert_eq!((count(1, "frame"), count(2, "frame")), ("1 frame".into(), "2 frames".into()));
        assert_eq!(join(&["a", "b", "c"]), "a, b and c");
        assert_eq!(capital("ärger"), "Ärger");
    }
}
