//! Files of depthcal: datasets, images, calibrations, evaluations, observations, exports and point clouds.
//!
//! This crate reads and writes; it computes nothing about cameras. Whatever a user can get wrong is an error that names
//! the file, the field and the remedy, never a panic. Error messages are complete: an operating system's error is part
//! of the text, not a separate source. Every file is written under a temporary name and renamed ([`write_atomically`]),
//! so that an interrupted run leaves no incomplete file.

pub mod dataset;
pub mod export;
pub mod file;
pub mod image;
pub mod ply;
pub mod record;

pub use dataset::{
    CameraHint, DATASET_FILE, Dataset, DatasetError, DatasetFile, DepthSection, Frame, FrameMetadata, FramesSection,
};
pub use export::{Export, ExportCamera, ExportError, ExportFormat, ExportWarning};
pub use file::{FileError, digest_files, read_json, write_atomically, write_json, write_json_compact};
pub use image::{
    DepthImage, GrayImage, ImageError, RgbImage, check_same_size, read_depth, read_gray, read_rgb, write_depth,
    write_gray,
};
pub use ply::{Cloud, PlyFormat, write_ply};
pub use record::{
    BeforeAfter, Calibration, CameraRecord, Comparison, CovarianceRecord, DatasetEvaluation, DeclaredValue,
    DepthSample, DiagnosisAddOutcome, DiagnosisCandidate, DiagnosisCapture, DiagnosisCompetitor, DiagnosisCovariate,
    DiagnosisDecision, DiagnosisDeclaration, DiagnosisFile, DiagnosisFormula, DiagnosisFrame, DiagnosisFrameCause,
    DiagnosisFramePlane, DiagnosisHeldOut, DiagnosisImage, DiagnosisLeftOver, DiagnosisNoiseAtDepth,
    DiagnosisParameter, DiagnosisPlace, DiagnosisPossible, DiagnosisProposedFrame, DiagnosisPureError,
    DiagnosisPureNoise, DiagnosisRefutation, DiagnosisRefuted, DiagnosisReplication, DiagnosisRound, DiagnosisRunnerUp,
    DiagnosisShared, DiagnosisStep, DiagnosisUnexplainedOutcome, DroppedFrame, Errors, Evaluation, FileReference,
    FitRecord, FrameEvaluation, FrameObservations, FrameRecord, GainInterval, HeldOutErrors, Interval, LearningPoint,
    MarkerObservation, MeanStd, ModelComparison, NoiseRecord, Observations, Outliers, ParameterRecord, PieceRecord,
    Rms, Separability, StabilityEstimate, StabilityRecord, Verdict,
};
