use super::context::Context;
use super::quantity::Quantity;

/// A quantity of an observation that an effect may depend on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Covariate {
    /// True depth, mm.
    Depth,
    /// True inverse depth, 1/mm.
    InverseDepth,
    /// Cosine of the angle between ray and surface normal.
    Incidence,
    /// Temperature, °C.
    Temperature,
    /// Time since the first frame, s.
    Time,
    /// Infrared amplitude of the pixel, in steps of the image.
    Amplitude,
    /// Mean infrared amplitude around the pixel, in steps of the image ([`Context::surround`]).
    Surroundings,
    /// Light of the whole scene at the pixel, as a share of the pixel's own ([`Context::stray`]).
    StrayLight,
    /// A quantity of the frame that the user records.
    Quantity(Quantity),
}

impl Covariate {
    /// All covariates but the quantities that users name.
    pub const ALL: [Self; 8] = [
        Self::Depth,
        Self::InverseDepth,
        Self::Incidence,
        Self::Temperature,
        Self::Time,
        Self::Amplitude,
        Self::Surroundings,
        Self::StrayLight,
    ];

    /// Its name in sentences and tables.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Depth => "depth",
            Self::InverseDepth => "inverse depth",
            Self::Incidence => "angle of incidence",
            Self::Temperature => "temperature",
            Self::Time => "time",
            Self::Amplitude => "infrared amplitude",
            Self::Surroundings => "infrared amplitude around the pixel",
            Self::StrayLight => "infrared amplitude and depth of the whole frame",
            Self::Quantity(quantity) => quantity.name(),
        }
    }

    /// Its value for an observation in the state (x, y, ρ, cos θ) of the depth hook; NaN where it is unknown.
    pub fn value(self, state: &[f64; 4], context: &Context) -> f64 {
        // A pixel without signal has an amplitude of 0, which says nothing.
        let signal = |amplitude: f64| if amplitude > 0.0 { amplitude } else { f64::NAN };
        match self {
            Self::Depth => 1.0 / state[2],
            Self::InverseDepth => state[2],
            Self::Incidence => state[3],
            Self::Temperature => context.temperature_c,
            Self::Time => context.time_s,
            Self::Amplitude => signal(context.amplitude),
            Self::Surroundings => signal(context.surround),
            Self::StrayLight => f64::from(context.stray.near),
            Self::Quantity(quantity) => context.quantities.value(quantity),
        }
    }

    /// Whether it has to be recorded with the frames. The others follow from the board's pose.
    pub const fn is_recorded(self) -> bool {
        !matches!(self, Self::Depth | Self::InverseDepth | Self::Incidence)
    }

    /// The reason why captures cannot show an effect of it, as a clause.
    pub const fn missing(self) -> &'static str {
        match self {
            Self::Depth | Self::InverseDepth => "the frames have no depths that differ",
            Self::Incidence => "the board is never tilted",
            Self::Temperature => "the frames have no temperatures that differ",
            Self::Time => "the frames have no times",
            Self::Amplitude => "the infrared amplitude is not known",
            Self::Surroundings => "the infrared amplitude around the pixels is not known",
            Self::StrayLight => "the infrared amplitude or the depth of whole frames is not known",
            Self::Quantity(_) => "the frames have no values of it that differ",
        }
    }

    /// The instruction to capture it, a clause that follows [`Covariate::missing`] and a semicolon.
    pub const fn how_to_record(self) -> &'static str {
        match self {
            Self::Depth | Self::InverseDepth => "capture the board near and far",
            Self::Incidence => "capture the board tilted by 20° to 45° about both axes",
            Self::Temperature => "record temperature_c in frames.csv while the camera warms up",
            Self::Time => "record timestamp_s in frames.csv, from the moment when the camera is switched on",
            Self::Amplitude | Self::Surroundings => {
                "save the infrared image of every depth image, on the same pixel grid"
            }
            Self::StrayLight => "save whole depth images, and the infrared image of each on the same pixel grid",
            Self::Quantity(_) => "record its column in frames.csv, over different values",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::StrayLight;

    #[test]
    fn values_are_those_of_state_and_context() {
        let context = Context {
            temperature_c: 31.0,
            time_s: 77.0,
            amplitude: 900.0,
            surround: 850.0,
            stray: StrayLight { near: 1.25, ..StrayLight::UNKNOWN },
            ..Context::default()
        };
        let state = [0.1, -0.2, 1.0 / 2048.0, 0.75];
        for (covariate, expected) in [
            (Covariate::Depth, 2048.0),
            (Covariate::InverseDepth, 1.0 / 2048.0),
            (Covariate::Incidence, 0.75),
            (Covariate::Temperature, 31.0),
            (Covariate::Time, 77.0),
            (Covariate::Amplitude, 900.0),
            (Covariate::Surroundings, 850.0),
            (Covariate::StrayLight, 1.25),
        ] {
            assert_eq!(covariate.value(&state, &context), expected, "{covariate:?}");
        }
        let dark = Context { amplitude: 0.0, surround: 0.0, ..context };
        assert!(Covariate::Amplitude.value(&state, &dark).is_nan());
        assert!(Covariate::Surroundings.value(&state, &dark).is_nan());
    }
}
