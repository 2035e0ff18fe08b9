//! Text for HTML: escaping, and numbers as people write them.

/// Text that is safe in HTML content and in quoted attributes.
pub(super) fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            c => out.push(c),
        }
    }
    out
}

/// JSON that is safe inside a script element: it can neither end the element nor open a comment.
pub(super) fn script_json(value: &serde_json::Value) -> String {
    value.to_string().replace('<', "\\u003c").replace('\u{2028}', "\\u2028").replace('\u{2029}', "\\u2029")
}

/// A number with as many decimals as its size deserves; a dash where there is none.
pub(super) fn number(value: f64) -> String {
    if !value.is_finite() {
        return "–".to_owned();
    }
    let decimals = match value.abs() {
        0.0 => 0,
        a if a >= 99.95 => 0,
        a if a >= 0.995 => 1,
        a if a >= 0.0995 => 2,
        _ => 3,
    };
    fixed(value, decimals)
}

/// A number with a given number of decimals and a true minus sign.
pub(super) fn fixed(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    match text.strip_prefix('-') {
        Some(rest) if rest.chars().all(|c| c == '0' || c == '.') => rest.to_owned(),
        Some(rest) => format!("−{rest}"),
        None => text,
    }
}

/// The same with a sign.
pub(super) fn signed(value: f64) -> String {
    let text = number(value);
    if value > 0.0 { format!("+{text}") } else { text }
}

/// A value with its standard deviation, in digits that the latter justifies: `(1.3406 ± 0.0021) × 10⁻⁴`.
pub(super) fn measured(value: f64, std: Option<f64>) -> String {
    let Some(std) = std.filter(|s| s.is_finite() && *s > 0.0) else { return significant(value, 6) };
    let exponent = scale_exponent(value.abs().max(std));
    let factor = 10_f64.powi(exponent);
    let decimals = (1.0 - (std / factor).log10().floor()).clamp(0.0, 9.0) as usize;
    let (value, std) = (fixed(value / factor, decimals), fixed(std / factor, decimals));
    if exponent == 0 {
        format!("{value} ± {std}")
    } else {
        format!("({value} ± {std}) × 10{}", superscript(exponent))
    }
}

/// A value with a number of significant digits.
pub(super) fn significant(value: f64, digits: usize) -> String {
    if !value.is_finite() {
        return "–".to_owned();
    }
    if value == 0.0 {
        return "0".to_owned();
    }
    let exponent = scale_exponent(value.abs());
    let scaled = value / 10_f64.powi(exponent);
    let decimals = (digits as f64 - 1.0 - scaled.abs().log10().floor()).clamp(0.0, 9.0) as usize;
    let text = fixed(scaled, decimals);
    let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text };
    if exponent == 0 { text } else { format!("{text} × 10{}", superscript(exponent)) }
}

/// The power of ten to take out of a number: none where it reads well as it is.
fn scale_exponent(size: f64) -> i32 {
    if (1e-3..1e6).contains(&size) || size == 0.0 { 0 } else { size.log10().floor() as i32 }
}

fn superscript(exponent: i32) -> String {
    let digit = |c: char| match c {
        '-' => '⁻',
        c => ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'][c.to_digit(10).unwrap_or(0) as usize],
    };
    exponent.to_string().chars().map(digit).collect()
}

/// `1 frame`, `9 frames`.
pub(super) fn count(n: usize, noun: &str) -> String {
    if n == 1 { format!("1 {noun}") } else { format!("{n} {noun}s") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn markup_is_disarmed() {
        assert_eq!(escape("<a href=\"x\">&'"), "&lt;a href=&quot;x&quot;&gt;&amp;&#39;");
        assert!(!script_json(&serde_json::json!("</script><!--")).contains('<'));
    }

    #[test]
    fn numbers_have_the_digits_that_they_deserve() {
        assert_eq!(number(9.713), "9.7");
        assert_eq!(number(0.1234), "0.12");
        assert_eq!(number(-1234.5), "−1234");
        assert_eq!(number(f64::NAN), "–");
        assert_eq!(fixed(-0.0001, 2), "0.00");
        assert_eq!(measured(1.3406e-4, Some(2.1e-7)), "(1.3406 ± 0.0021) × 10⁻⁴");
        assert_eq!(measured(476.9123, Some(0.0412)), "476.912 ± 0.041");
        assert_eq!(measured(0.0, None), "0");
        assert_eq!(significant(1.5e-6, 3), "1.5 × 10⁻⁶");
        assert_eq!(significant(320.0, 6), "320");
    }
}
