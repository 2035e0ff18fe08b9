//! Files of depthcal: datasets, images, calibrations, evaluations, observations, exports and point clouds.
//!
//! What a user can get wrong ends in an error that names the file, the field and the remedy, never in a panic. The
//! messages are complete in themselves: an operating system's error is part of the text, not a separate source. Every
//! file is written to a temporary name and renamed ([`write_atomically`]), so that an interrupted run leaves no half
//! file. This crate reads and writes; it computes nothing about cameras.

pub mod calibration;
mod camera_hint;
mod comparison;
pub mod dataset;
mod dataset_error;
pub mod dataset_file;
pub mod diagnosis;
pub mod digest;
pub mod evaluation;
pub mod export;
mod file_error;
mod finite;
pub mod frame_table;
pub mod image;
mod image_error;
mod jpeg;
pub mod json;
mod natural;
pub mod observations;
mod pgm;
pub mod ply;
mod png16;
pub mod read_image;
mod suggest;
mod toml_section;
pub mod write;

pub use calibration::{
    Calibration, CameraRecord, CovarianceRecord, DroppedFrame, FileReference, FitRecord, FrameRecord, NoiseRecord,
    ParameterRecord, PieceRecord,
};
pub use camera_hint::CameraHint;
pub use comparison::{
    Comparison, Errors, Interval, LearningPoint, ModelComparison, StabilityEstimate, StabilityRecord,
};
pub use dataset::{Dataset, Frame};
pub use dataset_error::DatasetError;
pub use dataset_file::{DatasetFile, DepthSection, FramesSection};
pub use diagnosis::{
    DiagnosisCandidate, DiagnosisFile, DiagnosisFrame, DiagnosisFramePlane, DiagnosisHeldOut, DiagnosisParameter,
    DiagnosisRound, DiagnosisStep, GainInterval, HeldOutErrors, Separability, Verdict,
};
pub use digest::digest_files;
pub use evaluation::{BeforeAfter, DatasetEvaluation, Evaluation, FrameEvaluation, MeanStd, Rms};
pub use export::{Export, ExportCamera, ExportError, ExportFormat, ExportWarning};
pub use file_error::FileError;
pub use frame_table::FrameMetadata;
pub use image::{DepthImage, GrayImage, RgbImage};
pub use image_error::ImageError;
pub use json::{read_json, write_json, write_json_compact};
pub use observations::{DepthSample, FrameObservations, MarkerObservation, Observations};
pub use ply::{Cloud, PlyFormat, write_ply};
pub use read_image::{check_same_size, read_depth, read_gray, read_rgb, write_depth, write_gray};
pub use write::write_atomically;
