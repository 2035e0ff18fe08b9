//! depthcal calibrates depth cameras: one joint adjustment of intrinsics, lens, depth distortion and board poses to images
//! and depth images of a printed board; correction of every pixel; and a search for what the model still lacks.
//!
//! # The measurement
//!
//! Camera frame as in OpenCV (x right, y down, z forward), millimetres and pixels. Depth is the z coordinate, inverse depth
//! ρ = 1/z. A board point P is seen at the pixel (u, v) with the measured depth `z_m = 1/ρ_m`:
//!
//! ```text
//! P ──board──▶ P' ──pose──▶ X = R P' + t ──project──▶ (x, y, ρ) = (X/Z, Y/Z, 1/Z)
//!     (x, y) ──lens──▶ (x', y') ──pinhole──▶ (u, v) = (fx x' + s y' + cx, fy y' + cy)
//!     (x, y, ρ) ──depth──▶ ρ_m = dx x + dy y + dz + dw ρ        projective (Sjöholm 2017), or any other depth model
//! ```
//!
//! Every arrow is a stack of *pieces*: small smooth maps with a few parameters each ([`model`]). A new depth model is one
//! more piece.
//!
//! # From captures to corrected depth
//!
//! ```no_run
//! use depthcal::{CalibrateOptions, Corrector, FrameContext, LoadOptions, Register, calibrate, calibration_record};
//! use depthcal::{evaluate_fitted, load};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let loaded = load("captures/".as_ref(), &LoadOptions::default())?;
//! let capture = loaded.capture(None, &Register::builtin())?;
//! let fit = calibrate(&capture, &CalibrateOptions::default())?;
//! let errors = evaluate_fitted(&fit);
//! let dataset = loaded.cameras[0].reference.clone();
//! calibration_record(&fit, &errors, dataset, None).write("calibration.json")?;
//! let corrector = Corrector::new(&fit.reference().calibrated.camera)?;
//! let depth = depthcal::io::read_depth("depth/0001.png")?;
//! let mut corrected = depth.clone();
//! corrector.correct_u16(&depth, 1.0, &FrameContext::default(), &mut corrected)?;
//! depthcal::io::write_depth("corrected/0001.png", &corrected)?;
//! # Ok(())
//! # }
//! ```
//!
//! # Where things are
//!
//! | crate | what it is |
//! |---|---|
//! | [`model`] | the camera as pieces, with all Jacobians |
//! | [`formula`] | effects given as formulas instead of Rust |
//! | [`solver`] | nonlinear least squares on factor graphs; knows no cameras |
//! | [`io`] | datasets, images, result files, exports |
//! | [`calibration`] | captures of one camera or a rig to a judged model: calibrate, evaluate, compare, diagnose |
//! | [`fleet`] | what the calibrations of many cameras say together |
//! | [`correction`] | every pixel of every frame |
//! | `report` (feature `cli`) | self-contained HTML pages |
//! | `cli` (feature `cli`) | the command line, also for programs with pieces of their own |
//!
//! # Features
//!
//! All but the last two are on by default.
//!
//! | feature | what it adds |
//! |---|---|
//! | `cli` | the command line and its reports; with it `detect` |
//! | `detect` | boards in images, found by code of this workspace; without it, [`load`] fails on images without cached corners |
//! | `import` | `depthcal import`: recordings (ROS bags, MCAP, Matroska) as datasets |
//! | `live` | `depthcal live`: guided capture with a page |
//! | `opencv` | chessboards and tags by OpenCV instead, which has to be installed; with it `detect` |
//! | `rerun` | `--rrd`: recordings for the rerun viewer, some 230 more crates |

pub use depthcal_calibration as calibration;
#[cfg(feature = "cli")]
pub use depthcal_cli as cli;
pub use depthcal_correction as correction;
pub use depthcal_fleet as fleet;
pub use depthcal_formula as formula;
pub use depthcal_io as io;
pub use depthcal_model as model;
#[cfg(feature = "cli")]
pub use depthcal_report as report;
pub use depthcal_solver as solver;

pub use depthcal_calibration::calibrate::{
    CalibrateError, CalibrateOptions, Calibrated, CalibratedCamera, CameraOptions, calibrate, calibrate_camera,
};
pub use depthcal_calibration::calibration_record::calibration_record;
pub use depthcal_calibration::camera_record::{camera_from_record, cameras_from_record};
pub use depthcal_calibration::compare::{CompareOptions, compare};
pub use depthcal_calibration::diagnose::{
    CameraDiagnoseOptions, CameraDiagnosis, DiagnoseOptions, Diagnosis, diagnose, diagnose_camera,
};
pub use depthcal_calibration::judge::camera::{EvaluatedCamera, evaluate_camera};
pub use depthcal_calibration::judge::evaluate::{Evaluated, evaluate, evaluate_fitted};
pub use depthcal_calibration::load::{LoadError, LoadOptions, Loaded, LoadedCamera, load};
pub use depthcal_calibration::observe::{CameraFrames, Capture};
pub use depthcal_correction::{Corrector, FrameContext};
pub use depthcal_model::{Camera, Register};

/// Documents whose Rust is compiled as tests.
#[cfg(all(doctest, feature = "cli"))]
mod documents {
    #[doc = include_str!("../docs/adding-a-depth-model.md")]
    struct AddingADepthModel;
}
