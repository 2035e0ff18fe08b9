//! Units of terms as products of powers.

use std::fmt;

/// Units that come first, in this order.
const FIRST: [&str; 4] = ["mm", "s", "px", "°C"];

/// A unit: exponents of its symbols.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Exponents(Vec<(&'static str, i32)>);

impl Exponents {
    /// A symbol to a power; `1` is none.
    pub fn of(symbol: &'static str, power: i32) -> Self {
        Self(if symbol == "1" || power == 0 { Vec::new() } else { vec![(symbol, power)] })
    }

    /// This unit over another one.
    pub fn over(&self, other: &Self) -> Self {
        let mut exponents = self.0.clone();
        for (symbol, power) in &other.0 {
            match exponents.iter_mut().find(|(known, _)| known == symbol) {
                Some((_, exponent)) => *exponent -= power,
                None => exponents.push((symbol, -power)),
            }
        }
        exponents.retain(|(_, exponent)| *exponent != 0);
        Self(exponents)
    }

    /// This unit to a power.
    pub fn power(&self, power: i32) -> Self {
        Self(self.0.iter().map(|(symbol, exponent)| (*symbol, exponent * power)).filter(|(_, e)| *e != 0).collect())
    }
}

/// As files have it.
impl fmt::Display for Exponents {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut sorted = self.0.clone();
        sorted.sort_by_key(|(symbol, _)| {
            (FIRST.iter().position(|first| first == symbol).unwrap_or(FIRST.len()), *symbol)
        });
        let part = |sign: i32| -> Vec<String> {
            let of_sign = sorted.iter().filter(|(_, exponent)| exponent * sign > 0);
            of_sign
                .map(|(name, e)| if e.abs() == 1 { (*name).to_owned() } else { format!("{name}^{}", e.abs()) })
                .collect()
        };
        let (above, below) = (part(1), part(-1));
        let above = if above.is_empty() { "1".to_owned() } else { above.join(" ") };
        match below.as_slice() {
            [] => f.write_str(&above),
            [one] => write!(f, "{above}/{one}"),
            several => write!(f, "{above}/({})", several.join(" ")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_are_written_as_files_have_them() {
        let mm = Exponents::of("mm", 1);
        assert_eq!(mm.over(&Exponents::of("ms", 1)).to_string(), "mm/ms");
        assert_eq!(mm.over(&mm).to_string(), "1");
        let both = Exponents::of("1", 1).over(&Exponents::of("mW", 2)).over(&Exponents::of("s", 1));
        assert_eq!(both.to_string(), "1/(s mW^2)");
        assert_eq!(both.power(-1).to_string(), "s mW^2");
        assert_eq!(both.power(0), Exponents::default());
    }
}
