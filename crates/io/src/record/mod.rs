//! The records: JSON files that commands write and later commands and the report read.

mod board;
mod calibration;
mod calibration_file;
mod camera;
mod camera_diagnosis;
mod comparison;
mod component;
mod covariate;
mod decision;
mod diagnosis;
mod difference;
mod evaluation;
mod extrinsics;
mod findings;
mod fleet;
mod interval;
mod lens_comparison;
mod observations;
mod options;
mod prior;
mod pure_error;
mod reference;
mod result_file;
mod scores;
mod searched;

#[cfg(test)]
pub(crate) use calibration::example;
pub use calibration::{Calibration, CovarianceRecord, DroppedFrame, FitRecord, FrameRecord};
pub use camera::{CameraRecord, LeftOpen, NoiseRecord, ParameterRecord, PieceRecord};
pub use camera_diagnosis::{
    CameraDiagnosis, DiagnosisCandidate, DiagnosisExchange, DiagnosisFormula, DiagnosisFrame, DiagnosisFramePlane,
    DiagnosisHeldOut, DiagnosisParameter, DiagnosisPlace, DiagnosisPossible, DiagnosisReplication, DiagnosisRound,
    DiagnosisRunnerUp, DiagnosisStep, GainInterval, HeldOutErrors, Separability, Verdict,
};
pub use comparison::{
    Comparison, Errors, LearningPoint, ModelComparison, StabilityEstimate, StabilityRecord, recommended,
};
pub use component::{DiagnosisComponent, DiagnosisComponentBin, DiagnosisCovariatePart};
pub use covariate::DiagnosisCovariate;
pub use decision::{
    DiagnosisAddOutcome, DiagnosisCompetitor, DiagnosisDecision, DiagnosisRefutation, DiagnosisRefuted,
    DiagnosisUnexplainedOutcome,
};
pub(crate) use diagnosis::RigDiagnosis;
pub use diagnosis::{DiagnosedCamera, Diagnosis, RigDriftTest, RigEffect, RigFindings, RigHeldOut, RigLeftOut};
pub use difference::{
    CameraDifference, ClearestDifference, DepthDifference, Difference, DifferenceSide, DifferenceSize,
    ExtrinsicsDifference, ParameterDifference, ProjectionDifference, grid_pixel,
};
pub use evaluation::{
    BeforeAfter, DatasetEvaluation, ErrorIntervals, Evaluation, FrameDeviation, FrameEvaluation, MeanStd, Outliers,
    Rms, Spread, TransferAtDistance, TransferError, WholeFrames,
};
pub use extrinsics::{DriftOver, DriftRecord, ExtrinsicsRecord, ExtrinsicsStdDev, TimeOffsetRecord};
pub use findings::{
    DeclaredValue, DiagnosisCapture, DiagnosisDeclaration, DiagnosisFrameCause, DiagnosisImage, DiagnosisLeftOver,
    DiagnosisProposedFrame,
};
pub use fleet::{
    Fleet, FleetEffect, FleetEffectUnit, FleetLeftOut, FleetOnDepth, FleetOutlier, FleetOutlierPart, FleetParameter,
    FleetReplication, FleetUnit, FleetUnitOnDepth, FleetUnitValue,
};
pub use interval::Interval;
pub use lens_comparison::{ComparedLens, LensComparison};
pub use observations::{DepthSample, FrameObservations, MarkerObservation, Observations};
pub use prior::{Prior, PriorUse, UsedPriorParameter};
pub use pure_error::{DiagnosisNoiseAtDepth, DiagnosisPureError, DiagnosisPureNoise, DiagnosisShared};
pub use reference::FileReference;
pub use scores::{ModelValue, ScoredEffect, ScoredParameter, Scores};
pub use searched::DiagnosisSearched;
