//! Whole tasks on datasets, as the command line and the Python package run them: options in words become options of the library, a
//! dataset is fitted and judged, and the results are written. Both callers give the same files because they share this module.

mod added_effects;
mod diagnosis_record;
mod error;
mod fit;
mod model_request;
mod prior;
mod result_files;
pub mod rig;
mod rig_diagnosis;

pub use added_effects::with_effects;
pub use diagnosis_record::diagnosis_record;
pub use error::TaskError;
pub use fit::{DatasetFit, FitRequest, HoldOut, JudgedFit, PreparedFit};
pub use model_request::{LENSES, ModelRequest, OptionNames, lens_of};
pub use prior::prior_for;
pub use result_files::write_calibration;
pub use rig_diagnosis::RigDiagnosisRecords;
