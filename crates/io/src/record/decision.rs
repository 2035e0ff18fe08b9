//! The decision of one round of a diagnosis, as data. The report words it.

use depthcal_model::PieceSpec;
use serde::{Deserialize, Serialize};

use super::covariate::DiagnosisCovariate;

/// The decision that a round took from its score tests. In JSON an object with the field `kind`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum DiagnosisDecision {
    /// Neither an effect nor a free function is significant.
    #[default]
    Nothing,
    /// An effect is missing.
    Add {
        /// Name of the effect.
        effect: String,
        /// The effect as given to `calibrate --with`, constants included.
        #[schemars(with = "String")]
        spec: PieceSpec,
        /// Names of further effects that explain the residuals jointly with it, in descending order of their rank.
        #[serde(default)]
        with: Vec<String>,
        /// Gain of the named effects over the gain of them and the best free function fitted jointly; 1 when no free
        /// function adds anything. Gains are falls of ½ Σ r² on left-out frames. With `despite_unexplained` the
        /// reference may instead be a plane of its own in every frame, as in `Unexplained`.
        explained_share: f64,
        /// Score statistic of these effects over that of a plane of its own in every frame; absent when such planes
        /// explain nothing.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        of_frame_planes: Option<f64>,
        /// Whether something else remains that no named effect explains. The effect is then added because it keeps its
        /// gain when it is fitted jointly with any competing free function, and `explained_share` is below its
        /// threshold.
        #[serde(default)]
        despite_unexplained: bool,
        /// Whether the effect was added, and why not.
        outcome: DiagnosisAddOutcome,
    },
    /// Functions of what the residuals depend on were found, all together, and named where an effect or a formula is as good.
    Explained {
        /// The effects and functions that were added, as given to `calibrate --with`.
        #[schemars(with = "Vec<String>")]
        effects: Vec<PieceSpec>,
        /// Effects of earlier rounds that these made unnecessary.
        #[serde(default)]
        #[schemars(with = "Vec<String>")]
        taken_out: Vec<PieceSpec>,
    },
    /// Something is left that named effects do not explain.
    Unexplained {
        /// Covariate of the free function that explains most.
        along: DiagnosisCovariate,
        /// Share of what `competitor` explains that named effects explain.
        explained_share: f64,
        /// The reference of `explained_share`.
        competitor: DiagnosisCompetitor,
        /// Whether something was added to correct it.
        outcome: DiagnosisUnexplainedOutcome,
    },
}

/// The reference that named effects are compared with.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum DiagnosisCompetitor {
    /// Named effects and the best free function fitted jointly, by their gain: the fall of ½ Σ r² on left-out frames.
    FreeFunction,
    /// A plane of its own in every frame, by the score statistic.
    FramePlanes,
}

/// An effect that a decision disregards.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct DiagnosisRefuted {
    /// Name of the effect.
    pub effect: String,
    /// Why.
    pub because: DiagnosisRefutation,
}

/// Why a decision disregards an effect. In JSON an object with the field `kind`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum DiagnosisRefutation {
    /// It explains too little of what a free function of its covariate explains in its place and form: it is not what depends on
    /// the covariate there.
    OwnFunction {
        /// The covariate.
        along: DiagnosisCovariate,
        /// Gain of the effect over that of both: falls of ½ Σ r² on left-out frames.
        explained_share: f64,
    },
    /// It is one of the lens, and images alone do not show it.
    NotInImages,
}

/// The fate of an effect that a round found missing: added, or not and why. In JSON an object with the field `kind`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum DiagnosisAddOutcome {
    /// It was added to the model.
    Added {
        /// The effects added in this round as given to `calibrate --with`, the found one among them.
        #[schemars(with = "Vec<String>")]
        effects: Vec<PieceSpec>,
        /// Effects of earlier rounds that bring nothing when fitted jointly with these, and were taken out of the
        /// model.
        #[serde(default)]
        #[schemars(with = "Vec<String>")]
        taken_out: Vec<PieceSpec>,
    },
    /// It was fitted, but the errors on held-out frames did not fall.
    NoHeldOutGain,
    /// It was not tried: it could not lower the held-out errors by what counts.
    TooSmall {
        /// Its predicted gain over the residuals' ½ Σ r².
        share_of_cost: f64,
        /// The least share that is tried.
        least_share: f64,
    },
    /// The model with it cannot be fitted.
    NotFitted {
        /// Message of the calibration's error.
        error: String,
    },
    /// It was not tried: the diagnosis had reached its largest number of rounds.
    RoundLimit {
        /// Number of rounds.
        rounds: usize,
    },
    /// It was not tried: too many effects before it had brought nothing.
    RejectionLimit {
        /// Number of effects that were tried without gain since the last one was added.
        rejected: usize,
    },
}

/// The consequence of a decision `unexplained`. In JSON an object with the field `kind`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum DiagnosisUnexplainedOutcome {
    /// It is reported and nothing is added: a map over the image cannot describe it, or brings nothing on held-out
    /// frames.
    Reported,
    /// Effects of the lens that were added before were taken out of the model, because the images alone do not show them.
    TakenOut {
        /// They as given to `calibrate --with`.
        #[schemars(with = "Vec<String>")]
        effects: Vec<PieceSpec>,
    },
    /// A free map over the image was added to the model as a correction.
    FreeMapAdded {
        /// The map as given to `calibrate --with`.
        #[schemars(with = "String")]
        spec: PieceSpec,
    },
    /// It is too small to be reported.
    TooSmall {
        /// Gain of the free function over the residuals' ½ Σ r².
        share_of_cost: f64,
        /// The least share that is reported.
        least_share: f64,
    },
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::*;

    fn reads_back_as(decision: &DiagnosisDecision, expected: Value) {
        let value = serde_json::to_value(decision).unwrap();
        assert_eq!(value, expected);
        assert_eq!(&serde_json::from_value::<DiagnosisDecision>(value).unwrap(), decision);
    }

    fn add(outcome: DiagnosisAddOutcome) -> DiagnosisDecision {
        DiagnosisDecision::Add {
            effect: "cyclic_depth".into(),
            spec: "cyclic_depth@period_mm=300".parse().unwrap(),
            with: vec!["radial_range".into()],
            explained_share: 0.97,
            of_frame_planes: Some(3.2),
            despite_unexplained: false,
            outcome,
        }
    }

    #[test]
    fn nothing_is_a_kind_alone() {
        reads_back_as(&DiagnosisDecision::Nothing, json!({"kind": "nothing"}));
    }

    #[test]
    fn an_added_effect_has_all_its_numbers() {
        let outcome = DiagnosisAddOutcome::Added {
            effects: vec!["cyclic_depth@period_mm=300".parse().unwrap()],
            taken_out: vec!["incidence_bias".parse().unwrap()],
        };
        reads_back_as(
            &add(outcome),
            json!({
                "kind": "add", "effect": "cyclic_depth", "spec": "cyclic_depth@period_mm=300", "with": ["radial_range"],
                "explained_share": 0.97, "of_frame_planes": 3.2, "despite_unexplained": false,
                "outcome": {
                    "kind": "added", "effects": ["cyclic_depth@period_mm=300"], "taken_out": ["incidence_bias"],
                },
            }),
        );
    }

    #[test]
    fn an_effect_that_was_not_added_says_why() {
        let outcomes = [
            (DiagnosisAddOutcome::NoHeldOutGain, json!({"kind": "no_held_out_gain"})),
            (
                DiagnosisAddOutcome::NotFitted { error: "not converged".into() },
                json!({"kind": "not_fitted", "error": "not converged"}),
            ),
            (DiagnosisAddOutcome::RoundLimit { rounds: 9 }, json!({"kind": "round_limit", "rounds": 9})),
            (DiagnosisAddOutcome::RejectionLimit { rejected: 3 }, json!({"kind": "rejection_limit", "rejected": 3})),
        ];
        for (outcome, expected) in outcomes {
            let value = serde_json::to_value(add(outcome.clone())).unwrap();
            assert_eq!(value["outcome"], expected);
            assert_eq!(serde_json::from_value::<DiagnosisDecision>(value).unwrap(), add(outcome));
        }
    }

    #[test]
    fn without_frame_planes_there_is_no_ratio_to_them() {
        let text = r#"{"kind": "add", "effect": "board_bow", "spec": "board_bow", "explained_share": 1.0,
                       "outcome": {"kind": "no_held_out_gain"}}"#;
        let DiagnosisDecision::Add { with, of_frame_planes, despite_unexplained, .. } =
            serde_json::from_str(text).unwrap()
        else {
            panic!("{text} is an addition")
        };
        assert!(with.is_empty() && of_frame_planes.is_none() && !despite_unexplained);
    }

    #[test]
    fn unexplained_says_along_what_and_against_what() {
        let unexplained = |outcome| DiagnosisDecision::Unexplained {
            along: DiagnosisCovariate::Amplitude,
            explained_share: 0.25,
            competitor: DiagnosisCompetitor::FreeFunction,
            outcome,
        };
        let expected = |outcome: Value| {
            json!({"kind": "unexplained", "along": "amplitude", "explained_share": 0.25, "competitor": "free_function",
                   "outcome": outcome})
        };
        reads_back_as(&unexplained(DiagnosisUnexplainedOutcome::Reported), expected(json!({"kind": "reported"})));
        reads_back_as(
            &unexplained(DiagnosisUnexplainedOutcome::FreeMapAdded { spec: "free_map".parse().unwrap() }),
            expected(json!({"kind": "free_map_added", "spec": "free_map"})),
        );
        reads_back_as(
            &unexplained(DiagnosisUnexplainedOutcome::TooSmall { share_of_cost: 0.004, least_share: 0.01 }),
            expected(json!({"kind": "too_small", "share_of_cost": 0.004, "least_share": 0.01})),
        );
        assert_eq!(serde_json::to_value(DiagnosisCompetitor::FramePlanes).unwrap(), json!("frame_planes"));
    }

    #[test]
    fn an_unknown_kind_is_an_error() {
        let error = serde_json::from_str::<DiagnosisDecision>(r#"{"kind": "guess"}"#).unwrap_err().to_string();
        assert!(error.contains("guess") && error.contains("unexplained"), "{error}");
    }
}
