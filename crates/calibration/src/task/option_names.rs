//! How options are called in messages.

/// How the user of a program writes its options; for messages.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct OptionNames {
    /// The depth model.
    pub model: &'static str,
    /// Further effects.
    pub with: &'static str,
    /// The lens model.
    pub lens: &'static str,
    /// The estimator.
    pub estimator: &'static str,
    /// Frames that are held out.
    pub hold_out: &'static str,
    /// The parts of a cross-validation that judges a fit.
    pub cross_validate: &'static str,
    /// The prior of a fleet.
    pub prior: &'static str,
    /// The parts of a cross-validation of a search or a comparison.
    pub folds: &'static str,
    /// Other datasets on which errors are reported.
    pub verify: &'static str,
}

impl OptionNames {
    /// Those of the command line.
    pub const COMMAND_LINE: Self = Self {
        model: "--model",
        with: "--with",
        lens: "--lens",
        estimator: "--estimator",
        hold_out: "--hold-out",
        cross_validate: "--cross-validate",
        prior: "--prior",
        folds: "--folds",
        verify: "--verify",
    };
    /// Those of functions.
    pub const ARGUMENTS: Self = Self {
        model: "model",
        with: "effects",
        lens: "lens",
        estimator: "estimator",
        hold_out: "hold_out",
        cross_validate: "cross_validate",
        prior: "prior",
        folds: "folds",
        verify: "verify",
    };
}
