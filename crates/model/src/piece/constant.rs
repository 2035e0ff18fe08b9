use std::collections::BTreeMap;

use super::covariate::Covariate;

/// Constants of a piece by name, as files and the command line give them.
pub type Options = BTreeMap<String, f64>;

/// A side of the rectangle of a board's markers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BoardSide {
    /// Along x.
    Width,
    /// Along y.
    Height,
}

/// A number of a piece that is declared, not fitted: a period, a time constant, a reference value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Constant {
    /// Name in files and on the command line, with its unit as the last part: `period_mm`.
    pub name: &'static str,
    /// Words for people: `period`.
    pub label: &'static str,
    /// Unit for people; `1` for none.
    pub unit: &'static str,
    /// Value where none is given.
    pub default: f64,
    /// Covariate and role by which its value is searched for in data; `None` where data cannot tell it.
    pub search: Option<(Covariate, ScanKind)>,
    /// Side of the rectangle of the board's markers that it is where none is given and the board is known
    /// ([`Register::for_board`](crate::Register::for_board)).
    pub of_board: Option<BoardSide>,
}

impl Constant {
    /// A constant from its name in files, its words for people, its unit and its default value.
    pub const fn new(name: &'static str, label: &'static str, unit: &'static str, default: f64) -> Self {
        Self { name, label, unit, default, search: None, of_board: None }
    }

    /// Makes it a constant whose value can be searched for in data.
    #[must_use]
    pub const fn searched(mut self, covariate: Covariate, kind: ScanKind) -> Self {
        self.search = Some((covariate, kind));
        self
    }

    /// Makes it a side of the rectangle of the board's markers.
    #[must_use]
    pub const fn of_board(mut self, side: BoardSide) -> Self {
        self.of_board = Some(side);
        self
    }

    /// Its value among those that are given, else its default.
    pub fn of(&self, given: &Options) -> f64 {
        given.get(self.name).copied().unwrap_or(self.default)
    }

    /// The search for its value, where data can tell it.
    pub(crate) fn scan(&self) -> Option<Scan> {
        self.search.map(|(covariate, kind)| Scan { constant: self.name, covariate, kind })
    }

    /// A value for people, with three significant digits and its unit: `period 300 mm`.
    pub fn words(&self, value: f64) -> String {
        worded(self.label, value, self.unit)
    }
}

/// `label value unit` with three significant digits.
pub(crate) fn worded(label: &str, value: f64, unit: &str) -> String {
    let unit = if unit == "1" { String::new() } else { format!(" {unit}") };
    format!("{label} {}{unit}", three_digits(value))
}

/// A number with three significant digits, in decimal notation where that is short.
fn three_digits(value: f64) -> String {
    if !value.is_finite() {
        return if value.is_nan() {
            "unknown".to_owned()
        } else {
            format!("{}∞", if value < 0.0 { "−" } else { "" })
        };
    }
    // Through the exponential form, so that rounding is decimal and exact.
    let short = format!("{value:.2e}");
    let rounded: f64 = short.parse().unwrap_or(value);
    match rounded.abs() {
        0.0 => "0".to_owned(),
        1e-3..1e6 => format!("{rounded}"),
        _ => format!("{rounded:e}"),
    }
}

/// A constant of a piece that can be searched for in the data.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Scan {
    /// [`Constant::name`].
    pub constant: &'static str,
    /// The covariate whose range says which values make sense.
    pub covariate: Covariate,
    /// The role of the constant in the equation.
    pub kind: ScanKind,
}

/// The role of a searched constant in its equation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ScanKind {
    /// Period of a wave over the covariate.
    Period,
    /// Time constant of an exponential that settles over the covariate; infinity for a straight line.
    TimeConstant,
    /// Value of the covariate at which the effect is zero.
    Reference,
    /// Distance between camera and projector, mm, of either sign.
    Baseline,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn people_read_three_digits_and_a_unit() {
        let words = |label, unit, value| Constant::new("any", label, unit, 0.0).words(value);
        assert_eq!(words("period", "mm", 299.903_563_139_974_15), "period 300 mm");
        assert_eq!(words("period", "1/mm", 3.996e-5), "period 4e-5 1/mm");
        assert_eq!(words("baseline", "mm", -75.04), "baseline -75 mm");
        assert_eq!(words("columns", "1", 6.0), "columns 6");
        assert_eq!(words("time constant", "s", f64::INFINITY), "time constant ∞ s");
        assert_eq!(words("reference", "1", 0.0), "reference 0");
        assert_eq!(words("reference", "°C", 24.96), "reference 25 °C");
    }
}
