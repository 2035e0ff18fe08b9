//! A unit as a product of powers of millimetre, second, pixel, degree Celsius and the units of columns of `frames.csv`, and of
//! units that are not known yet.

use std::collections::BTreeMap;
use std::fmt;

use depthcal_model::Quantity;

use crate::syntax::{Factor, SyntaxError, parse_unit};

/// Symbols of units and what they are powers of; `None` for those without a unit.
const SYMBOLS: [(&str, Option<Base>); 8] = [
    ("mm", Some(Base::Millimetre)),
    ("s", Some(Base::Second)),
    ("px", Some(Base::Pixel)),
    ("°C", Some(Base::Celsius)),
    ("degC", Some(Base::Celsius)),
    ("K", Some(Base::Celsius)),
    ("rad", None),
    ("step", None),
];

/// A base unit; units are products of powers of them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Base {
    Millimetre,
    Second,
    Pixel,
    Celsius,
    /// A unit of columns of `frames.csv` that is none of the others, by its symbol. Units of one kind are not converted.
    OfColumns(&'static str),
    /// The unit of a constant that has none declared, by its number.
    Unknown(usize),
}

/// A unit: exponents of its bases. Without any it is a plain number.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Unit {
    pub exponents: BTreeMap<Base, f64>,
}

/// Exponents nearer to zero than this are zero: they are small fractions.
const ROUNDING: f64 = 1e-9;

impl Unit {
    /// No unit.
    pub fn one() -> Self {
        Self::default()
    }

    /// A base itself.
    pub fn base(base: Base) -> Self {
        Self { exponents: BTreeMap::from([(base, 1.0)]) }
    }

    /// From text such as `1/mm`.
    pub fn parse(text: &str) -> Result<Self, SyntaxError> {
        let mut unit = Self::one();
        for Factor { symbol, exponent, span } in parse_unit(text)? {
            let known = SYMBOLS.iter().find(|(name, _)| *name == symbol).map(|(_, base)| *base);
            let of_columns = || Quantity::units().find(|(_, unit)| *unit == symbol);
            let Some(base) = known.or_else(|| of_columns().map(|(_, unit)| Some(Base::OfColumns(unit)))) else {
                let problem = match symbol.as_str() {
                    "m" | "cm" | "um" | "µm" => format!("the unit '{symbol}' is not used here: lengths are in mm"),
                    "min" | "h" => format!("the unit '{symbol}' is not used here: times are in s"),
                    _ => format!(
                        "there is no unit '{symbol}'; known are mm, s, px, °C, 1 and the units of columns of \
                         frames.csv, such as ms and mW"
                    ),
                };
                return Err(SyntaxError { problem, span });
            };
            if let Some(base) = base {
                unit = unit.times(&Self::base(base).power(f64::from(exponent)));
            }
        }
        Ok(unit)
    }

    /// The product of two units.
    pub fn times(&self, other: &Self) -> Self {
        let mut exponents = self.exponents.clone();
        for (base, exponent) in &other.exponents {
            *exponents.entry(*base).or_insert(0.0) += exponent;
        }
        exponents.retain(|_, exponent| exponent.abs() > ROUNDING);
        Self { exponents }
    }

    /// This unit to a power.
    pub fn power(&self, power: f64) -> Self {
        let exponents = self.exponents.iter().map(|(base, exponent)| (*base, exponent * power));
        Self { exponents: exponents.filter(|(_, exponent)| exponent.abs() > ROUNDING).collect() }
    }

    /// The quotient of two units.
    pub fn over(&self, other: &Self) -> Self {
        self.times(&other.power(-1.0))
    }

    /// Whether it is no unit at all.
    pub fn is_one(&self) -> bool {
        self.exponents.is_empty()
    }
}

impl fmt::Display for Unit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let symbol = |base: &Base| match base {
            Base::Millimetre => "mm".to_owned(),
            Base::Second => "s".to_owned(),
            Base::Pixel => "px".to_owned(),
            Base::Celsius => "°C".to_owned(),
            Base::OfColumns(symbol) => (*symbol).to_owned(),
            Base::Unknown(_) => "?".to_owned(),
        };
        let written = |power: f64| {
            let part = |(base, exponent): (&Base, &f64)| match exponent * power {
                e if (e - 1.0).abs() < ROUNDING => symbol(base),
                e if (e - 2.0).abs() < ROUNDING => format!("{}²", symbol(base)),
                e if (e - 3.0).abs() < ROUNDING => format!("{}³", symbol(base)),
                e => format!("{}^{}", symbol(base), (e * 1e6).round() / 1e6),
            };
            let parts: Vec<String> =
                self.exponents.iter().filter(|(_, exponent)| **exponent * power > 0.0).map(part).collect();
            parts
        };
        let (above, below) = (written(1.0), written(-1.0));
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
    fn units_are_read_multiplied_and_printed() {
        let unit = |text: &str| Unit::parse(text).unwrap();
        assert_eq!(unit("mm*mm"), unit("mm²"));
        assert_eq!(unit("1/mm").times(&unit("mm")), Unit::one());
        assert_eq!(unit("rad"), Unit::one());
        for text in ["1", "1/mm", "mm²", "mm/°C", "1/(mm s)"] {
            assert_eq!(unit(&text.replace("mm s", "mm*s")).to_string(), text);
        }
        assert_eq!(unit("mm").power(0.5).to_string(), "mm^0.5");
        assert!(Unit::parse("m").unwrap_err().problem.contains("lengths are in mm"));
        assert!(Unit::parse("furlong").unwrap_err().problem.contains("no unit 'furlong'"));
    }
}
