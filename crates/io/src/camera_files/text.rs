//! Numbers and strings in a form that every YAML reader accepts.

/// The shortest decimal form that reads back as the same number, with a point and a signed exponent: YAML 1.1 takes
/// `1e-7` for a string.
pub(super) fn number(value: f64) -> String {
    let text = format!("{value:?}");
    match text.split_once('e') {
        None => text,
        Some((mantissa, exponent)) => {
            let point = if mantissa.contains('.') { "" } else { ".0" };
            let sign = if exponent.starts_with('-') { "" } else { "+" };
            format!("{mantissa}{point}e{sign}{exponent}")
        }
    }
}

/// Numbers in brackets.
pub(super) fn list(values: &[f64]) -> String {
    let values: Vec<_> = values.iter().map(|value| number(*value)).collect();
    format!("[{}]", values.join(", "))
}

/// A string in double quotes.
pub(super) fn quoted(text: &str) -> String {
    let escaped: String = text
        .chars()
        .filter(|c| !c.is_control())
        .flat_map(|c| if c == '"' || c == '\\' { vec!['\\', c] } else { vec![c] })
        .collect();
    format!("\"{escaped}\"")
}

/// A number for people: three significant digits.
pub(super) fn shown(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return format!("{value}");
    }
    let digits = (2 - value.abs().log10().floor() as i32).max(0) as usize;
    if digits > 6 { format!("{value:.2e}") } else { format!("{value:.digits$}") }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn has_point_and_signed_exponent() {
        assert_eq!(
            [0.0, 1.0, -476.9, 1e-7, 1.3406e-10, 1e300].map(number),
            ["0.0", "1.0", "-476.9", "1.0e-7", "1.3406e-10", "1.0e+300"]
        );
        assert_eq!(quoted("a \"b\"\n\\"), "\"a \\\"b\\\"\\\\\"");
    }

    #[test]
    fn three_significant_digits() {
        assert_eq!([0.0, 0.01234, 1.2345, 123.45, 1e-9].map(shown), ["0", "0.0123", "1.23", "123", "1.00e-9"]);
    }

    proptest! {
        #[test]
        fn reads_back(bits in any::<u64>()) {
            let value = f64::from_bits(bits);
            prop_assume!(value.is_finite());
            prop_assert_eq!(number(value).parse::<f64>().unwrap().to_bits(), bits);
        }
    }
}
