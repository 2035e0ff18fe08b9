//! The covariates that formulas may use: their units, where they are known, and how they follow from the state of the chain.

use depthcal_model::hook::HookKind;
use depthcal_model::{Context, Covariate, Quantity};

/// A covariate of formulas.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum FormulaCovariate {
    /// Direction of the ray, X / Z.
    X,
    /// Direction of the ray, Y / Z.
    Y,
    /// Distance from the axis, √(x² + y²).
    R,
    /// Column of the depth image, px.
    U,
    /// Row of the depth image, px.
    V,
    /// Depth, mm.
    Z,
    /// Inverse depth, 1/mm.
    Rho,
    /// Distance from the camera's centre, mm.
    Range,
    /// 1 / cos θ − 1 of the angle of incidence θ.
    Incidence,
    /// Infrared amplitude of the pixel, in steps of the image.
    Amplitude,
    /// Mean infrared amplitude around the pixel, in steps of the image.
    Surroundings,
    /// Time since the first frame, s.
    Time,
    /// Temperature, °C.
    Temperature,
    /// Coordinate along a row of the board, mm.
    BoardX,
    /// Coordinate along a column of the board, mm.
    BoardY,
    /// A quantity of the frame, by the name of its column in `frames.csv`.
    Quantity(Quantity),
}

impl FormulaCovariate {
    /// All but the quantities that users name.
    pub const ALL: [Self; 15] = [
        Self::X,
        Self::Y,
        Self::R,
        Self::U,
        Self::V,
        Self::Z,
        Self::Rho,
        Self::Range,
        Self::Incidence,
        Self::Amplitude,
        Self::Surroundings,
        Self::Time,
        Self::Temperature,
        Self::BoardX,
        Self::BoardY,
    ];

    /// Its name in formulas, its name in sentences, and its symbol.
    const fn words_and_symbol(self) -> (&'static str, &'static str, (&'static str, &'static str)) {
        match self {
            Self::X => ("x", "direction x of the ray", ("x", "")),
            Self::Y => ("y", "direction y of the ray", ("y", "")),
            Self::R => ("r", "distance r from the optical axis", ("r", "")),
            Self::U => ("u", "column u (px)", ("u", "")),
            Self::V => ("v", "row v (px)", ("v", "")),
            Self::Z => ("z", "depth (mm)", ("z", "")),
            Self::Rho => ("rho", "inverse depth (1/mm)", ("ρ", "")),
            Self::Range => ("range", "distance from the camera (mm)", ("ℓ", "")),
            Self::Incidence => ("incidence", "1/cos − 1 of the angle of incidence", ("κ", "")),
            Self::Amplitude => ("amplitude", "infrared amplitude (steps)", ("A", "")),
            Self::Surroundings => ("surroundings", "infrared amplitude around the pixel (steps)", ("Ā", "")),
            Self::Time => ("timestamp_s", "time (s)", ("t", "")),
            Self::Temperature => ("temperature_c", "temperature (°C)", ("T", "")),
            Self::BoardX => ("board_x", "x on the board (mm)", ("X", "b")),
            Self::BoardY => ("board_y", "y on the board (mm)", ("Y", "b")),
            Self::Quantity(quantity) => (quantity.name(), quantity.name(), (quantity.name(), "")),
        }
    }

    /// Its name in formulas.
    pub const fn name(self) -> &'static str {
        self.words_and_symbol().0
    }

    /// The covariate of that name: one of [`ALL`](Self::ALL), or a quantity where the name ends in a unit.
    pub fn of(name: &str) -> Option<Self> {
        Self::reserved(name).or_else(|| Quantity::named(name).map(Self::Quantity))
    }

    /// The covariate of that name which is no quantity: nothing else in a formula may have its name.
    pub fn reserved(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|covariate| covariate.name() == name)
    }

    /// Its name in sentences, with its unit.
    pub const fn words(self) -> &'static str {
        self.words_and_symbol().1
    }

    /// Its unit.
    pub const fn unit(self) -> &'static str {
        match self {
            Self::X | Self::Y | Self::R | Self::Incidence | Self::Amplitude | Self::Surroundings => "1",
            Self::U | Self::V => "px",
            Self::Z | Self::Range | Self::BoardX | Self::BoardY => "mm",
            Self::Rho => "1/mm",
            Self::Time => "s",
            Self::Temperature => "°C",
            Self::Quantity(quantity) => quantity.unit(),
        }
    }

    /// Its symbol in print, as a character with an optional index.
    pub(crate) const fn symbol(self) -> (&'static str, &'static str) {
        self.words_and_symbol().2
    }

    /// Whether a piece at a hook knows it.
    pub fn is_known_at(self, hook: HookKind) -> bool {
        match self {
            Self::Quantity(_) => matches!(hook, HookKind::Depth | HookKind::Lens | HookKind::Pixel),
            other => Self::at(hook).contains(&other),
        }
    }

    /// The covariates that a piece at a hook knows, but for quantities.
    pub fn at(hook: HookKind) -> &'static [Self] {
        match hook {
            HookKind::Depth => &[
                Self::X,
                Self::Y,
                Self::R,
                Self::U,
                Self::V,
                Self::Z,
                Self::Rho,
                Self::Range,
                Self::Incidence,
                Self::Amplitude,
                Self::Surroundings,
                Self::Time,
                Self::Temperature,
            ],
            HookKind::Lens => {
                &[Self::X, Self::Y, Self::R, Self::Z, Self::Rho, Self::Range, Self::Time, Self::Temperature]
            }
            HookKind::Pixel => &[Self::U, Self::V, Self::Time, Self::Temperature],
            HookKind::Board => &[Self::BoardX, Self::BoardY],
            HookKind::Pose => &[],
        }
    }

    /// Its usual range: images of 640×480, a field of view of 65°, depths of 0.4 m to 4 m, boards of 0.4 m.
    pub const fn typical_range(self) -> [f64; 2] {
        match self {
            Self::X => [-0.64, 0.64],
            Self::Y => [-0.48, 0.48],
            Self::R => [0.0, 0.8],
            Self::U => [0.0, 639.0],
            Self::V => [0.0, 479.0],
            Self::Z | Self::Range => [400.0, 4000.0],
            Self::Rho => [0.00025, 0.0025],
            Self::Incidence => [0.0, 1.0],
            Self::Amplitude | Self::Surroundings => [50.0, 5000.0],
            Self::Time => [0.0, 2000.0],
            Self::Temperature => [15.0, 45.0],
            Self::BoardX => [0.0, 400.0],
            Self::BoardY => [0.0, 300.0],
            Self::Quantity(quantity) => quantity.typical_range(),
        }
    }

    /// The covariate of effects that has to be recorded or has to vary for this one to be known.
    pub const fn needs(self) -> Option<Covariate> {
        match self {
            Self::Incidence => Some(Covariate::Incidence),
            Self::Amplitude => Some(Covariate::Amplitude),
            Self::Surroundings => Some(Covariate::Surroundings),
            Self::Time => Some(Covariate::Time),
            Self::Temperature => Some(Covariate::Temperature),
            Self::Quantity(quantity) => Some(Covariate::Quantity(quantity)),
            _ => None,
        }
    }

    /// The covariate of effects over which a constant of this one is searched.
    pub(crate) const fn searched(self) -> Option<Covariate> {
        match self {
            Self::Z | Self::Range => Some(Covariate::Depth),
            Self::Rho => Some(Covariate::InverseDepth),
            other => other.needs(),
        }
    }

    /// Whether an observation may lack it.
    pub(crate) const fn may_be_unknown(self) -> bool {
        matches!(self, Self::Amplitude | Self::Surroundings | Self::Temperature | Self::Quantity(_))
    }

    /// Its value for a state of the depth hook (x, y, inverse depth, cosine of the angle of incidence) or of the board hook (x,
    /// y); NaN where it is unknown.
    #[inline]
    pub fn value(self, state: &[f64], context: &Context) -> f64 {
        match self {
            Self::X | Self::BoardX => state[0],
            Self::Y | Self::BoardY => state[1],
            Self::R => state[0].hypot(state[1]),
            Self::Rho => state[2],
            Self::Z => 1.0 / state[2],
            Self::Range => state[0].hypot(state[1]).hypot(1.0) / state[2],
            Self::Incidence => 1.0 / state[3] - 1.0,
            other => other.of_context(context),
        }
    }

    /// Its value where it is part of the context; NaN where it is unknown. A pixel without signal has an amplitude of 0, which
    /// says nothing.
    #[inline]
    pub(crate) fn of_context(self, context: &Context) -> f64 {
        let signal = |amplitude: f64| if amplitude > 0.0 { amplitude } else { f64::NAN };
        match self {
            Self::U => context.pixel[0],
            Self::V => context.pixel[1],
            Self::Amplitude => signal(context.amplitude),
            Self::Surroundings => signal(context.surround),
            Self::Time => context.time_s,
            Self::Temperature => context.temperature_c,
            Self::Quantity(quantity) => context.quantities.value(quantity),
            _ => f64::NAN,
        }
    }
}
