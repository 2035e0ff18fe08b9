//! Findings of a diagnosis other than effects, as data: what is left, implausible declarations, bad frames, and the
//! captures that would help. The report words them.

use serde::{Deserialize, Serialize};

use super::covariate::DiagnosisCovariate;
use super::pure_error::DiagnosisShared;

/// Something left in the residuals of the last model that no effect explains. In JSON an object with the field `kind`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum DiagnosisLeftOver {
    /// A free function of a covariate explains more than named effects do.
    FreeFunction {
        /// The covariate.
        along: DiagnosisCovariate,
        /// Root mean square of the part of the free function that the model's own parameters do not absorb, mm; absent
        /// when the data do not determine it.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        rms_mm: Option<f64>,
        /// Share of it that the best named effects explain.
        explained_share: f64,
    },
    /// A smooth function of two covariates together explains something for certain on left-out frames, though no function of one
    /// does, nor a formula.
    Together {
        /// Names of the covariates, as in formulas.
        covariates: Vec<String>,
        /// Share of the squared residuals of left-out frames that it explains.
        share_of_cost: f64,
    },
    /// Frames deviate from the board's depth each by a plane of its own.
    FramePlanes {
        /// Share of the frames with a significant plane, from 0 to 1.
        share_of_frames: f64,
        /// Root mean square of the planes over all frames, mm.
        rms_mm: f64,
    },
    /// Frames share residuals at the same values of covariates, finer than any free function: see
    /// [`DiagnosisPureError`](super::pure_error::DiagnosisPureError).
    Shared(DiagnosisShared),
}

/// A declared value, and the value with which the depth would agree.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct DeclaredValue {
    /// The value that `dataset.toml` declares.
    pub declared: f64,
    /// The value at which measured depth would match the board's depth, all other declarations being right.
    pub fitting: f64,
}

/// A declaration that is implausible. In JSON an object with the field `kind`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum DiagnosisDeclaration {
    /// Measured depth is a multiple of the depth at which the images see the board; the board's spacing or the depth
    /// unit is wrong.
    DepthScale {
        /// Median of measured depth over the board's depth.
        scale: f64,
        /// `board.spacing_mm`, mm.
        spacing_mm: DeclaredValue,
        /// `depth.unit_mm`, mm per step.
        unit_mm: DeclaredValue,
    },
}

/// An image of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum DiagnosisImage {
    /// The image that shows the markers.
    Image,
    /// The depth image.
    Depth,
}

/// Why a frame was left out. In JSON an object with the field `kind`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum DiagnosisFrameCause {
    /// One of its images equals that of an earlier frame.
    Duplicate {
        /// Name of the earlier frame.
        of: String,
        /// The image that they share.
        image: DiagnosisImage,
    },
    /// Its depth image fits the pose of another bad frame: the two depth images seem to be exchanged.
    ExchangedDepth {
        /// Name of the other frame.
        with: String,
    },
    /// Its depth deviates from the pose that its image gives by a plane: board or camera seem to have moved between the
    /// two.
    Moved {
        /// Mean of the plane over the frame's depth samples, mm; positive where measured depth is too large.
        offset_mm: f64,
        /// Root mean square of the plane over the frame's depth samples, mm.
        rms_mm: f64,
    },
}

/// A frame that could be captured: where the board would be.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct DiagnosisProposedFrame {
    /// Depth of the board's middle, mm.
    pub distance_mm: f64,
    /// Position of the board's middle in the image [u, v], as fractions of width and height.
    pub image_position: [f64; 2],
    /// Rotation of the board out of the image plane, degrees about the camera's x axis and y axis.
    pub turned_deg: [f64; 2],
    /// Temperature above that of the warmest captured frame, °C; absent for a frame at the temperature of the others.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub warmer_c: Option<f64>,
}

/// A capture that would answer a question these captures leave open. In JSON an object with the field `kind`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum DiagnosisCapture {
    /// Frames that would distinguish an added effect from another that explains the residuals about as well.
    TellApart {
        /// Name of the added effect.
        effect: String,
        /// Name of the other effect.
        rival: String,
        /// The frame that separates the two best.
        frame: DiagnosisProposedFrame,
        /// Number of such frames that would be enough.
        frames: u64,
        /// Noncentrality parameter (squared distance in standard deviations) of the effect with its rival in the model,
        /// of the present captures.
        noncentrality: f64,
        /// `noncentrality` with one such frame more.
        noncentrality_with_frame: f64,
        /// Noncentrality parameter from which the two count as distinguishable.
        noncentrality_needed: f64,
    },
    /// A covariate without which effects cannot be seen at all: the frames lack it, or it does not vary.
    Record {
        /// The covariate.
        covariate: DiagnosisCovariate,
        /// Names of the effects that depend on it.
        effects: Vec<String>,
    },
}

#[cfg(test)]
mod tests {
    use std::fmt::Debug;

    use serde::de::DeserializeOwned;
    use serde_json::{Value, json};

    use super::*;

    fn reads_back_as<T: Serialize + DeserializeOwned + PartialEq + Debug>(finding: T, expected: Value) {
        let value = serde_json::to_value(&finding).unwrap();
        assert_eq!(value, expected);
        assert_eq!(serde_json::from_value::<T>(value).unwrap(), finding);
    }

    #[test]
    fn what_is_left() {
        reads_back_as(
            DiagnosisLeftOver::FreeFunction {
                along: DiagnosisCovariate::Pixel,
                rms_mm: Some(1.25),
                explained_share: 0.5,
            },
            json!({"kind": "free_function", "along": "pixel", "rms_mm": 1.25, "explained_share": 0.5}),
        );
        reads_back_as(
            DiagnosisLeftOver::FreeFunction { along: DiagnosisCovariate::Board, rms_mm: None, explained_share: 0.0 },
            json!({"kind": "free_function", "along": "board", "explained_share": 0.0}),
        );
        reads_back_as(
            DiagnosisLeftOver::Together { covariates: vec!["r".to_owned(), "z".to_owned()], share_of_cost: 0.02 },
            json!({"kind": "together", "covariates": ["r", "z"], "share_of_cost": 0.02}),
        );
        reads_back_as(
            DiagnosisLeftOver::FramePlanes { share_of_frames: 0.3, rms_mm: 2.5 },
            json!({"kind": "frame_planes", "share_of_frames": 0.3, "rms_mm": 2.5}),
        );
    }

    #[test]
    fn an_implausible_declaration_has_declared_and_fitting_values() {
        reads_back_as(
            DiagnosisDeclaration::DepthScale {
                scale: 1.25,
                spacing_mm: DeclaredValue { declared: 20.0, fitting: 25.0 },
                unit_mm: DeclaredValue { declared: 1.0, fitting: 0.8 },
            },
            json!({
                "kind": "depth_scale", "scale": 1.25, "spacing_mm": {"declared": 20.0, "fitting": 25.0},
                "unit_mm": {"declared": 1.0, "fitting": 0.8},
            }),
        );
    }

    #[test]
    fn causes_of_bad_frames() {
        reads_back_as(
            DiagnosisFrameCause::Duplicate { of: "0001".into(), image: DiagnosisImage::Depth },
            json!({"kind": "duplicate", "of": "0001", "image": "depth"}),
        );
        reads_back_as(
            DiagnosisFrameCause::ExchangedDepth { with: "0007".into() },
            json!({"kind": "exchanged_depth", "with": "0007"}),
        );
        reads_back_as(
            DiagnosisFrameCause::Moved { offset_mm: -12.5, rms_mm: 14.0 },
            json!({"kind": "moved", "offset_mm": -12.5, "rms_mm": 14.0}),
        );
    }

    #[test]
    fn captures_that_would_help() {
        let frame = DiagnosisProposedFrame {
            distance_mm: 600.0,
            image_position: [0.2, 0.5],
            turned_deg: [0.0, 45.0],
            warmer_c: Some(10.0),
        };
        reads_back_as(
            DiagnosisCapture::TellApart {
                effect: "incidence_bias".into(),
                rival: "radial_range".into(),
                frame,
                frames: 3,
                noncentrality: 4.5,
                noncentrality_with_frame: 7.0,
                noncentrality_needed: 11.7,
            },
            json!({
                "kind": "tell_apart", "effect": "incidence_bias", "rival": "radial_range",
                "frame": {
                    "distance_mm": 600.0, "image_position": [0.2, 0.5], "turned_deg": [0.0, 45.0], "warmer_c": 10.0,
                },
                "frames": 3, "noncentrality": 4.5, "noncentrality_with_frame": 7.0, "noncentrality_needed": 11.7,
            }),
        );
        let unchanged = serde_json::to_value(DiagnosisProposedFrame { warmer_c: None, ..frame }).unwrap();
        assert!(unchanged.get("warmer_c").is_none());
        reads_back_as(
            DiagnosisCapture::Record {
                covariate: DiagnosisCovariate::Temperature,
                effects: vec!["temperature_drift".into()],
            },
            json!({"kind": "record", "covariate": "temperature", "effects": ["temperature_drift"]}),
        );
    }
}
