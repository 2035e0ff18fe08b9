//! The entry: the loop on one camera, or on each of several, which are then adjusted jointly again.

use tracing::warn;

use super::capture_diagnosis::{DiagnosedCamera, Diagnosis};
use super::closed_loop::diagnose_camera;
use super::error::DiagnoseError;
use super::options::DiagnoseOptions;
use super::rig::diagnose_rig;
use crate::observe::Capture;

/// Diagnoses a capture: which effects do the declared models of its cameras lack?
///
/// Errors before and after are those on `verify` where it is given, else on frames that the fits leave out. Several cameras are
/// calibrated with the declared models, each that has depth is diagnosed, and all are adjusted jointly again with the effects
/// that were added.
///
/// # Errors
///
/// [`DiagnoseError`] where no camera has depth, where a model cannot be fitted or examined, also where several cameras still
/// contradict each other with all effects; [`DiagnoseError::Camera`] of one of several.
pub fn diagnose(
    capture: &Capture,
    verify: Option<&Capture>,
    options: &DiagnoseOptions,
) -> Result<Diagnosis, DiagnoseError> {
    if !capture.has_depth() {
        return Err(DiagnoseError::NoDepth { dataset: capture.name.clone() });
    }
    warn_of_few_frames(capture);
    let [only] = &capture.cameras[..] else { return diagnose_rig(capture, verify, options) };
    let of_camera = options.of(options.calibrate.of_only(only));
    let verify = verify.and_then(|verify| verify.cameras.first()).map(|camera| &camera.capture);
    let diagnosis = diagnose_camera(&only.capture, verify, &of_camera)?;
    let register = diagnosis.register(&of_camera.calibrate.register)?;
    let camera = DiagnosedCamera { name: only.name.clone(), diagnosis, register, in_rig: None };
    Ok(Diagnosis { verdict: camera.verdict(), cameras: vec![camera], rig: None })
}

/// Warns of captures on which hardly any effect can be told from chance.
fn warn_of_few_frames(capture: &Capture) {
    /// Left-out frames from which a gain of a tenth can be certain.
    const ENOUGH: usize = 8;
    for camera in capture.cameras.iter().filter(|camera| camera.capture.has_depth()) {
        let frames = camera.capture.frames.len();
        if frames < ENOUGH {
            warn!(
                "{frames} frames of {} are too few to find what a model lacks: an effect counts where it lowers the error of left-out frames for certain; \
                 capture at least {ENOUGH}, 20 to 40 for most effects",
                camera.capture.name
            );
        }
    }
}
