//! Thresholds of the diagnosis' rules.

/// Thresholds of every rule of a diagnosis. The defaults were set on simulated captures (`studies/src/bin/power_study`).
///
/// *Gain* is the fall of the cost ½ Σ r² of held-out frames; *candidates* are the effects that the model lacks and the free
/// functions that compete with them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Thresholds {
    /// Level of the score tests, corrected for the number of candidates (0.01). Guards against naming an effect where there is
    /// only noise. Minimal detectable sizes are stated for it.
    pub level: f64,
    /// Power for which minimal detectable sizes are stated (0.8). Guards against taking a size that is found half of the time
    /// for one that would have been seen.
    pub power: f64,
    /// Searched values of a constant that count as one independent test (2: neighbouring values are correlated). Guards
    /// against a search over many values finding significance by chance.
    pub values_per_test: f64,
    /// Mean gain per frame over its standard error (1.2). Guards against a gain that one frame has by accident.
    pub least_gain_t: f64,
    /// Gain of a further effect relative to the largest gain before it (0.06). Guards against adding ever smaller effects that
    /// imitate what a large one, imperfectly modelled, has left.
    pub least_relative_gain: f64,

    /// Share that named effects must explain of what they and any free function explain together (0.75). Guards against naming
    /// an effect that resembles only a part of an unknown error.
    pub least_explained: f64,
    /// Share that an effect of one covariate must explain of what it and any function of that covariate explain together in its
    /// place and form (0.97). Guards against the name of an effect for another function of the same covariate.
    pub least_explained_of_own: f64,
    /// Share that named effects must explain of the planes by which single frames deviate (0.7). Guards against naming an
    /// effect where errors change from frame to frame.
    pub least_explained_of_planes: f64,
    /// Standard deviations that are subtracted from the frames' planes before that comparison (1.5). Guards against refusing
    /// an effect because noise makes the planes look larger than they are.
    pub plane_scatter: f64,
    /// Mean over standard error of the paired differences of two effects' gains that distinguishes them (2). Guards against
    /// presenting one of two indistinguishable effects as the only explanation.
    pub distinguishing_t: f64,
    /// Share of its score statistic that an effect may lose in a place and form that still counts as not told apart from the best
    /// one (0.01), and by which it has to explain more in another place and form than in that of its own equation to be added
    /// there. Guards against a certain choice by what the effect's own shape leaves over.
    pub least_placement_gain: f64,
    /// Minimum fraction of its own gain that an effect must retain when fitted jointly with a competing free function (0.25).
    /// Guards against naming an effect that only imitates an unknown map while something is unexplained.
    pub least_kept_gain: f64,
    /// Level of the score test by the scatter between frames, corrected for the number of effects (0.03). Guards against
    /// significance that correlated residuals within a frame feign while something is unexplained.
    pub clustered_level: f64,
    /// Share of the cost that an effect must explain to be named while something else is unexplained (0.01). Guards against
    /// small effects that take up parts of the unexplained error.
    pub least_named_share: f64,
    /// Free functions, by falling merit, that such an effect is fitted jointly with (4). Bounds the time; weaker ones compete
    /// with nothing.
    pub most_competing_functions: usize,

    /// Most effects that are selected to explain the residuals together (3). Guards against a set of effects that fits
    /// anything.
    pub most_joint_effects: usize,
    /// Share of the joint gain that each further effect must add (0.1). Guards against members that explain next to nothing.
    pub least_joint_share: f64,
    /// Passes of selection forwards and backwards (3). Guards against adding and removing the same effects for ever.
    pub most_selection_passes: usize,

    /// Rounds of the loop (9). Guards against a loop that does not end.
    pub most_rounds: usize,
    /// Effects in a row that may fail on held-out frames before the loop ends (3). Guards against trying the whole catalogue on
    /// residuals that no named effect explains.
    pub most_rejected: usize,
    /// Share of the cost below which unexplained structure is not reported (0.01: it raises the error by 0.5 %). Guards against a
    /// verdict "unexplained" for what is certain but without practical importance.
    pub least_unexplained_share: f64,

    /// Share of the mean squared residual that frames must share at the same values of a covariate for it to be reported (0.04:
    /// it raises the error by 2 %). Guards against a verdict "unexplained" for what is certain but without practical importance.
    pub least_shared_share: f64,

    /// Gain in noise-weighted depth error and reprojection error together that counts as one, per cent (0.02). Guards against
    /// adding or keeping what changes nothing.
    pub least_held_out_gain_percent: f64,
    /// Rise of the unweighted depth error that is tolerated for a gain in the weighted one, per cent (0.5). Guards against
    /// improving near pixels, where noise is small, at the expense of far ones.
    pub most_unweighted_loss_percent: f64,

    /// Share of the cost that an added effect gains in first order on left-out frames (0.01), and the mean of these gains per
    /// frame over its standard error (5), from which it is plainly needed after others were added, without fits to parts of the
    /// frames. Bounds the time.
    pub plain_share: f64,
    /// See [`plain_share`](Self::plain_share).
    pub plain_t: f64,

    /// Size of a frame's plane, rms in mm, below which no frame is excluded before the first effect is in the model (5). Guards
    /// against excluding frames whose deviation is a missing effect.
    pub gross_plane_mm: f64,
    /// Rounds of excluding frames that do not fit (3). Guards against excluding frame after frame.
    pub most_exclusion_rounds: usize,
    /// Size of an outlying frame's plane over the noise of single pixels (2). Guards against excluding frames for deviations
    /// that are invisible in single pixels.
    pub outlying_plane_of_noise: f64,
    /// Size of an outlying frame's plane over the median of all frames (6). Guards against excluding the largest of many
    /// similar deviations.
    pub outlying_plane_of_median: f64,
    /// Share of outlying frames beyond which none is excluded (0.15). So many are no exceptions but an error that the model
    /// lacks.
    pub most_outlying_share: f64,
    /// Level, corrected for the number of frames, at which a frame has a plane of its own (0.01). Guards against reporting
    /// noise as a deviation of frames.
    pub own_plane_level: f64,
    /// Size of such a plane over the noise of single pixels (0.5). Guards against reporting planes that are significant only
    /// because a frame has many pixels.
    pub own_plane_of_noise: f64,
    /// Share of frames with a plane of their own from which this is reported as unexplained (0.2). Guards against a verdict
    /// that rests on a few frames.
    pub many_own_planes: f64,
    /// Deviation of a bad frame's depth from the board in another bad frame's pose, over that in its own (0.2), at which the
    /// two depth images count as exchanged. Guards against calling two moved boards an exchange.
    pub exchanged_deviation_ratio: f64,
    /// Markers that must agree to the last digit before two frames count as copies (4). Guards against calling frames equal
    /// that have hardly any marker.
    pub least_identical_markers: usize,

    /// Deviation of the scale of depth from 1 that a camera may have (0.08). A larger scale error indicates a wrong
    /// `spacing_mm` or `unit_mm`, which the depth model's dw would hide.
    pub plausible_scale_deviation: f64,

    /// Least range of ln(amplitude) over which a free function of amplitude is tested (0.05). This and the next three guard
    /// against splines over a covariate that hardly varies, which the data cannot determine.
    pub least_log_amplitude_span: f64,
    /// Least range of the cosine of the angle of incidence (0.02).
    pub least_cos_incidence_span: f64,
    /// Least range of time, s (0.001).
    pub least_time_span_s: f64,
    /// Least range of temperature, °C (0.05).
    pub least_temperature_span_c: f64,

    /// Noncentrality at which two effects count as distinguished (11.7: power 0.8 at level 0.01 with one parameter). Guards
    /// against proposing captures after which the effects would still look alike.
    pub distinguishing_noncentrality: f64,
    /// Least range of temperature, °C, in which a temperature drift can show (0.5). Guards against the conclusion that there is
    /// no drift where the temperature was constant.
    pub informative_temperature_span_c: f64,

    /// Frames that a search for formulas needs (9): a third of them is set aside to confirm what is found.
    pub least_frames_for_formulas: usize,
    /// Share of resamples of the frames in which the best of all terms has the covariates of a formula (0.8). Guards against
    /// formulas that a few frames decide.
    pub least_stability: f64,
    /// Share that a formula explains of what the best free function of its covariates explains (0.75). Guards against formulas
    /// that only resemble a part of what is there.
    pub least_share_of_free_function: f64,
}

impl Default for Thresholds {
    fn default() -> Self {
        Self {
            level: 0.01,
            power: 0.8,
            values_per_test: 2.0,
            least_gain_t: 1.2,
            least_relative_gain: 0.06,
            least_explained: 0.75,
            least_explained_of_own: 0.97,
            least_explained_of_planes: 0.7,
            plane_scatter: 1.5,
            distinguishing_t: 2.0,
            least_placement_gain: 0.01,
            least_kept_gain: 0.25,
            clustered_level: 0.03,
            least_named_share: 0.01,
            most_competing_functions: 4,
            most_joint_effects: 3,
            least_joint_share: 0.1,
            most_selection_passes: 3,
            most_rounds: 9,
            most_rejected: 3,
            least_unexplained_share: 0.01,
            least_shared_share: 0.04,
            least_held_out_gain_percent: 0.02,
            most_unweighted_loss_percent: 0.5,
            plain_share: 0.01,
            plain_t: 5.0,
            gross_plane_mm: 5.0,
            most_exclusion_rounds: 3,
            outlying_plane_of_noise: 2.0,
            outlying_plane_of_median: 6.0,
            most_outlying_share: 0.15,
            own_plane_level: 0.01,
            own_plane_of_noise: 0.5,
            many_own_planes: 0.2,
            exchanged_deviation_ratio: 0.2,
            least_identical_markers: 4,
            plausible_scale_deviation: 0.08,
            least_log_amplitude_span: 0.05,
            least_cos_incidence_span: 0.02,
            least_time_span_s: 1e-3,
            least_temperature_span_c: 0.05,
            distinguishing_noncentrality: 11.7,
            informative_temperature_span_c: 0.5,
            least_frames_for_formulas: 9,
            least_stability: 0.8,
            least_share_of_free_function: 0.75,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Thresholds;
    use crate::calibrate::PLAUSIBLE_SCALE_DEVIATION;

    #[test]
    fn calibrate_and_diagnose_find_the_same_scales_implausible() {
        assert_eq!(Thresholds::default().plausible_scale_deviation, PLAUSIBLE_SCALE_DEVIATION);
    }
}
