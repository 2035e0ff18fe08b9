//! The typed library of functions that formulas are searched in: powers, logarithms, exponentials, waves, steps and hinges of one
//! covariate, alone or times a function without constants of another.

use depthcal_formula::FormulaCovariate as C;

/// A function of one covariate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Function {
    pub covariate: C,
    pub kind: Kind,
    /// The searched constant of the kinds that have one.
    pub constant: f64,
}

/// The shape of a function v ↦ f(v) with constant k.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum Kind {
    /// vⁿ; v⁰ is an offset, which is no term of its own but may be added to one
    Power(i32),
    /// (v − k)ⁿ
    Centred(i32),
    /// ln(v / k)
    Log,
    /// √(k / v)
    InverseRoot,
    /// exp(−v / k)
    Decay,
    /// 1 − exp(−v / k)
    Settling,
    /// v / (v + k)
    Ratio,
    /// |v − k|
    Distance,
    /// sin(2πv / k) and cos(2πv / k): two columns
    Wave,
    /// 1 above k, else 0
    Step,
    /// v − k above k, else 0
    HingeUp,
    /// k − v below k, else 0
    HingeDown,
}

/// Most columns of a function.
pub(super) const MOST_COLUMNS: usize = 2;

impl Kind {
    /// Number of its columns, each with a parameter of its own.
    pub fn columns(self) -> usize {
        if self == Self::Wave { 2 } else { 1 }
    }

    /// Whether its constant is searched.
    pub fn is_searched(self) -> bool {
        !matches!(self, Self::Power(_) | Self::Centred(_) | Self::InverseRoot)
    }

    /// How much has to be said of it: of functions that explain alike the one with the smallest number wins.
    pub fn complexity(self) -> u32 {
        match self {
            Self::Power(0 | 1) | Self::Centred(1) => 1,
            Self::Power(_) | Self::Centred(_) | Self::InverseRoot => 2,
            Self::Log => 2,
            Self::Decay | Self::Settling | Self::Ratio | Self::Step => 3,
            Self::HingeUp | Self::HingeDown | Self::Distance => 3,
            Self::Wave => 4,
        }
    }
}

impl Function {
    /// Its columns at a value of its covariate.
    #[inline]
    pub fn values(&self, v: f64) -> [f64; MOST_COLUMNS] {
        let k = self.constant;
        match self.kind {
            Kind::Power(n) => [v.powi(n), 0.0],
            Kind::Centred(n) => [(v - k).powi(n), 0.0],
            Kind::Log => [(v / k).ln(), 0.0],
            Kind::InverseRoot => [(k / v).sqrt(), 0.0],
            Kind::Decay => [(-v / k).exp(), 0.0],
            Kind::Settling => [1.0 - (-v / k).exp(), 0.0],
            Kind::Ratio => [v / (v + k), 0.0],
            Kind::Distance => [(v - k).abs(), 0.0],
            Kind::Wave => {
                let (sin, cos) = (std::f64::consts::TAU * v / k).sin_cos();
                [sin, cos]
            }
            Kind::Step => [f64::from(u8::from(v > k)), 0.0],
            Kind::HingeUp => [(v - k).max(0.0), 0.0],
            Kind::HingeDown => [(k - v).max(0.0), 0.0],
        }
    }
}

/// The range of a covariate over the observations.
#[derive(Debug, Clone, Copy)]
pub(super) struct Span {
    pub low: f64,
    pub middle: f64,
    pub high: f64,
}

impl Span {
    /// The length of the range.
    pub fn length(self) -> f64 {
        self.high - self.low
    }

    fn at(self, share: f64) -> f64 {
        self.low + share * self.length()
    }
}

/// How densely constants are tried.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Density {
    /// For functions that stand alone.
    Fine,
    /// For those that are multiplied with functions of any other covariate.
    Coarse,
    /// For those that are multiplied with functions of one other covariate: as coarse, but of all shapes.
    Paired,
}

/// Whether a covariate is positive, so that logarithms and inverse powers of it exist.
fn is_positive(covariate: C, span: Span) -> bool {
    match covariate {
        C::Quantity(_) => span.low > 0.0,
        other => matches!(other, C::Z | C::Range | C::Amplitude | C::Surroundings),
    }
}

/// The functions of a covariate over its range.
pub(super) fn functions(covariate: C, span: Span, density: Density) -> Vec<Function> {
    let mut list: Vec<Function> = without_constants(covariate, span);
    let mut add = |kind: Kind, constant: f64| list.push(Function { covariate, kind, constant });
    let fine = density == Density::Fine;
    let all_shapes = density != Density::Coarse;
    let length = span.length();
    // Inverse depth is searched as depth; waves of disparity are another matter.
    let waves_only = matches!(covariate, C::Rho | C::U | C::V | C::Range);
    // Depth cameras err in waves of depth or disparity that are much finer than those over other covariates.
    let is_along_depth = matches!(covariate, C::Z | C::Rho);
    let (waves, cycles) = match (fine, is_along_depth) {
        (true, true) => (120, 0.4),
        (true, false) => (30, 0.4),
        (false, _) => (12, 0.75),
    };
    for i in 1..=waves {
        add(Kind::Wave, length / (cycles * f64::from(i)));
    }
    if waves_only {
        return list;
    }
    let quantiles = if fine { 11 } else { 5 };
    for i in 1..=quantiles {
        let k = span.at(f64::from(i) / f64::from(quantiles + 1));
        add(Kind::Step, k);
        add(Kind::HingeUp, k);
        if all_shapes {
            add(Kind::HingeDown, k);
            add(Kind::Distance, k);
        }
    }
    if is_positive(covariate, span) {
        let shares: &[f64] = if fine { &[0.0, 0.25, 0.5, 0.75, 1.0] } else { &[0.5] };
        shares.iter().for_each(|share| add(Kind::Log, span.low * (span.high / span.low).powf(*share)));
    }
    let lengths: &[f64] = if fine { &[0.1, 0.2, 0.4, 0.8] } else { &[0.3] };
    for share in lengths {
        match covariate {
            C::Time => add(Kind::Settling, share * length),
            C::X | C::Y => {}
            _ => add(Kind::Decay, share * length),
        }
        if all_shapes && matches!(covariate, C::Z | C::R | C::Incidence | C::Amplitude | C::Time) {
            add(Kind::Ratio, share * length);
        }
    }
    list
}

/// The functions of a covariate that have no searched constant: what others are multiplied with.
pub(super) fn without_constants(covariate: C, span: Span) -> Vec<Function> {
    let kinds: &[Kind] = match covariate {
        C::X | C::Y => &[Kind::Power(1), Kind::Power(2), Kind::Power(3)],
        C::R => &[Kind::Power(1), Kind::Power(2), Kind::Power(3), Kind::Power(4)],
        C::Z => &[Kind::Power(1), Kind::Power(2), Kind::Power(3), Kind::Power(-1)],
        C::Incidence => &[Kind::Power(1), Kind::Power(2)],
        C::Amplitude | C::Surroundings => &[Kind::Power(-1), Kind::InverseRoot, Kind::Power(1)],
        C::Time => &[Kind::Power(1), Kind::Power(2)],
        C::Temperature | C::Quantity(_) => &[Kind::Centred(1), Kind::Centred(2)],
        _ => &[],
    };
    let constant = match covariate {
        // A round temperature reads better; D takes up a constant offset, so the data do not tell where the effect is zero.
        C::Temperature => span.middle.round(),
        C::Quantity(_) => three_digits(span.middle),
        _ => span.middle,
    };
    kinds.iter().map(|kind| Function { covariate, kind: *kind, constant }).collect()
}

/// The functions that others are multiplied with: the lowest powers, and the logarithm of amplitudes.
pub(super) fn factors(covariate: C, span: Span) -> Vec<Function> {
    let simple = without_constants(covariate, span);
    let mut list: Vec<Function> = simple
        .into_iter()
        .filter(|f| match f.kind {
            Kind::Power(n) => (1..=2).contains(&n) && !(covariate == C::R && n == 1),
            Kind::Centred(n) => n == 1,
            _ => false,
        })
        .collect();
    if matches!(covariate, C::Amplitude | C::Surroundings) {
        let constant = three_digits((span.low * span.high).sqrt());
        list = vec![Function { covariate, kind: Kind::Log, constant }];
    }
    list
}

/// A number with three significant digits.
pub(super) fn three_digits(value: f64) -> f64 {
    format!("{value:.2e}").parse().unwrap_or(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_function_is_finite_over_its_range() {
        for covariate in C::ALL {
            let [low, high] = covariate.typical_range();
            let span = Span { low, middle: 0.5 * (low + high), high };
            for density in [Density::Fine, Density::Coarse, Density::Paired] {
                for function in functions(covariate, span, density).into_iter().chain(factors(covariate, span)) {
                    for i in 0..=20 {
                        let v = low + (high - low) * f64::from(i) / 20.0;
                        let values = function.values(v);
                        assert!(values.iter().all(|v| v.is_finite()), "{function:?} at {v}: {values:?}");
                    }
                }
            }
        }
    }
}
