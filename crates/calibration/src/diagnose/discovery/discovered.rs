//! A formula that was found.

use depthcal_formula::FormulaEffect;
use depthcal_io::{DiagnosisComponent, DiagnosisPlace};
use depthcal_model::PieceSpec;

/// A formula that was found, with what speaks for it.
#[derive(Debug, Clone)]
pub struct Discovery {
    /// The formula as an effect.
    pub effect: FormulaEffect,
    /// Names of its covariates, sorted.
    pub covariates: Vec<String>,
    /// Covariates that may stand for one of these: the formula's own, and the other one. The frames do not tell which of them it
    /// is.
    pub covariates_not_told_apart: Vec<[String; 2]>,
    /// Place and form.
    pub place: DiagnosisPlace,
    /// Places and forms that the frames cannot tell from it.
    pub places_not_told_apart: Vec<DiagnosisPlace>,
    /// How often the best of all terms explains as much where the signs of the frames are drawn at random.
    pub p_value: f64,
    /// Share of resamples of the frames in which the best term has the same covariates, or ones that are not told apart from
    /// them.
    pub stability: f64,
    /// Whether the frames that the search did not see confirm sign and size.
    pub confirmed: bool,
    /// Size in these frames over that in the others, with its standard error.
    pub replication: Option<[f64; 2]>,
    /// Share that it explains of what the best free function of its covariates explains, on left-out frames.
    pub share_of_free_function: f64,
    /// Effects of the catalogue that explain nearly as much.
    pub resembles: Vec<String>,
    /// The best formulas of other covariates.
    pub runners_up: Vec<RunnerUp>,
    /// Number of terms that were scored.
    pub terms: usize,
    /// Effects that it took the place of: they imitated it.
    pub replaced: Vec<PieceSpec>,
    /// The residuals without it and its value in the last model, over its covariates.
    pub components: Vec<DiagnosisComponent>,
}

/// Share of the size of an effect that frames which the search has not seen have to leave possible …
const LEAST_SIZE: f64 = 0.5;
/// … within so many standard errors.
const CERTAIN: f64 = 3.0;

impl Discovery {
    /// Whether it is a smooth function without a name, rather than a formula of few parameters.
    pub fn is_smooth_function(&self) -> bool {
        !self.effect.definition().smooth.is_empty()
    }

    /// Whether frames that the search has not seen do not have the effect. A model may predict them better with it all the same,
    /// since without it the other parameters describe it in the frames of the search.
    pub fn is_refuted(&self) -> bool {
        self.replication.is_some_and(|[size, standard_error]| size + CERTAIN * standard_error < LEAST_SIZE)
    }
}

/// A formula that lost.
#[derive(Debug, Clone)]
pub struct RunnerUp {
    /// The formula as an effect.
    pub effect: FormulaEffect,
    /// Names of its covariates, sorted.
    pub covariates: Vec<String>,
    /// Its gain on left-out frames, over that of the winner.
    pub gain_share: f64,
}
