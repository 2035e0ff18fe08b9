//! The register, the progress bars and the clock that the commands of one run share.

use std::fmt::Display;

use depthcal_calibration::calibrate::{CalibrateOptions, HeldError, HeldParameter};
use depthcal_calibration::judge::evaluate::{Evaluated, evaluate};
use depthcal_calibration::observe::{Capture, EvaluableFrame};
use depthcal_calibration::progress::ProgressHandle;
use depthcal_io::Dataset;
use depthcal_model::{Camera, ModelSpec, PieceSpec, Register};

use super::failure::Failure;
use crate::progress::Bars;

/// Values of `--lens`.
pub(super) const LENSES: [&str; 12] = [
    "brown-conrady",
    "brown-conrady:full",
    "brown-conrady:k1k2p1p2",
    "brown-conrady:k1k2",
    "brown-conrady:k1",
    "opencv8",
    "opencv12",
    "opencv14",
    "kannala-brandt",
    "division",
    "none",
    "auto",
];

/// The lens model of a fit: that of the command line, else of the dataset, else Brown–Conrady.
pub(super) fn lens_of(asked: Option<&str>, dataset: &Dataset) -> String {
    let declared = dataset.camera.as_ref().and_then(|camera| camera.lens.as_deref());
    asked.or(declared).unwrap_or("brown-conrady").to_owned()
}

/// The known pieces, and where progress is shown.
#[derive(Debug)]
pub(crate) struct Session {
    /// Pieces of depthcal and of the program that runs the command line.
    pub(crate) register: Register,
    /// Bars on terminals, and the times of the run's stages.
    pub(crate) progress: ProgressHandle,
}

impl Session {
    /// A session with these pieces.
    pub(crate) fn new(register: Register) -> Self {
        Self { register, progress: ProgressHandle::new(Bars) }
    }

    /// The depth model that an option names.
    pub(crate) fn model(&self, option: &str, text: &str) -> Result<ModelSpec, Failure> {
        self.register.model_spec(text).map_err(|e| Failure::Input(format!("{option} {text}: {e}")))
    }

    /// The effects that `--with` names, and the parameters that it holds.
    pub(crate) fn effects(&self, texts: &[String]) -> Result<(Vec<PieceSpec>, Vec<HeldParameter>), Failure> {
        let (mut effects, mut held) = (Vec::new(), Vec::new());
        for text in texts {
            let wrong = |e: &dyn Display| Failure::Input(format!("--with {text}: {e}"));
            match text.strip_prefix("fixed:") {
                Some(parameter) => held.push(parameter.parse().map_err(|e: HeldError| wrong(&e))?),
                None => effects.push(self.register.piece_spec(text).map_err(|e| wrong(&e))?),
            }
        }
        Ok((effects, held))
    }

    /// Evaluates a camera on all frames of a capture, as a stage of the run.
    pub(crate) fn evaluate<F: EvaluableFrame>(&self, camera: &Camera, capture: &Capture<F>) -> Evaluated {
        let _stage = self.progress.stage("evaluation");
        evaluate(camera, capture)
    }

    /// Default options of a fit with this session's pieces and progress.
    pub(crate) fn calibrate_options(&self) -> CalibrateOptions {
        CalibrateOptions {
            register: self.register.clone(),
            progress: self.progress.clone(),
            ..CalibrateOptions::default()
        }
    }
}
