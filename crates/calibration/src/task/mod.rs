//! Whole tasks on datasets, as the command line and the Python package run them: options in words become options of the library,
//! a dataset of one camera or of several is fitted, judged, diagnosed or evaluated, and the results have their files and what
//! their report shows. Both callers give the same files because they share this module.

mod added_effects;
mod comparison;
mod diagnosed_camera;
mod diagnosis;
mod difference;
#[cfg(test)]
mod difference_tests;
mod error;
mod evaluated;
mod evaluation;
mod extrinsics_difference;
mod fit;
mod given_camera;
mod made;
mod model_request;
mod next;
mod option_names;
mod prior;
mod report_input;
mod results;
mod rig_diagnosis;
mod select;
mod unlike_calibration;

pub use added_effects::with_effects;
pub use comparison::{CompareRequest, Compared};
pub use diagnosed_camera::DiagnosedCamera;
pub use diagnosis::{DiagnoseRequest, Diagnosed};
pub use difference::{DiffSide, Differed};
pub use error::TaskError;
pub use evaluation::Evaluations;
pub use fit::{Fit, FitRequest, HeldOut, HoldOut};
pub use given_camera::GivenCamera;
pub use made::Made;
pub use model_request::{LENSES, ModelRequest};
pub use next::{NextCaptures, NextRequest};
pub use option_names::OptionNames;
pub use prior::GivenPrior;
pub use report_input::{ReportCamera, ReportDataset, ReportDiagnosis, ReportInput, ReportRig, Role};
pub use results::{Results, Shown};
pub use rig_diagnosis::DiagnosedRig;
pub use select::{SelectRequest, Selected};
pub use unlike_calibration::UnlikeCalibration;
