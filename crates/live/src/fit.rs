//! Fits of the kept frames, and the poses that are wanted next.

use std::sync::Arc;

use depthcal_calibration::calibrate::CameraOptions;
use depthcal_calibration::judge::cross_validation::errors;
use depthcal_calibration::judge::evaluate::Evaluated;
use depthcal_calibration::load::{DatasetInMemory, FrameInMemory, load_from_memory};
use depthcal_calibration::plan::{Goal, ProposedFrame};
use depthcal_calibration::task::{FitRequest, NextCaptures, NextRequest};
use depthcal_io::{DepthFrame, FrameMetadata, MarkerObservation};
use depthcal_model::{Camera, Target};
use nalgebra::Isometry3;
use serde::Serialize;

/// Fewest frames for a cross-validation, and its parts.
const VALIDATED: (usize, usize) = (6, 3);

/// How kept frames are fitted and which frames are wanted next.
#[derive(Debug, Clone)]
pub struct LiveFit {
    /// The model; errors on frames that were not fitted are those of a cross-validation.
    pub request: FitRequest,
    /// The known pieces.
    pub options: CameraOptions,
    /// The goal.
    pub next: NextRequest,
}

/// A kept frame as it is fitted.
#[derive(Debug, Clone)]
pub(crate) struct KeptFrame {
    pub name: String,
    pub markers: Vec<MarkerObservation>,
    pub depth: Option<Arc<DepthFrame>>,
    pub metadata: FrameMetadata,
}

/// Frames to fit.
#[derive(Debug, Clone)]
pub struct FitJob {
    pub(crate) frames: Vec<KeptFrame>,
    pub(crate) target: Target,
    pub(crate) size: [usize; 2],
    pub(crate) unit_mm: Option<f64>,
}

/// A fit as the page shows it. Errors are root mean squares.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FitSummary {
    /// Number of frames that were fitted.
    pub frames: usize,
    /// Reprojection error of fitted frames, px.
    pub fitted_px: Option<f64>,
    /// Depth error of fitted frames after correction, mm.
    pub fitted_mm: Option<f64>,
    /// Reprojection error of frames that were not fitted, px.
    pub held_px: Option<f64>,
    /// Depth error of frames that were not fitted, mm.
    pub held_mm: Option<f64>,
    /// Where further frames lead; absent where nothing can be planned.
    pub plan: Option<PlanSummary>,
    /// Why nothing can be planned.
    pub unplanned: Option<String>,
}

/// The goal and its way, as the page shows them.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PlanSummary {
    /// `depth`, `projection` or the name of a parameter.
    pub goal: String,
    /// Nearest and farthest distance of the goal, mm.
    pub range_mm: Option<[f64; 2]>,
    /// Unit of the goal.
    pub unit: String,
    /// The value that the goal's error is below with 95 % certainty.
    pub now_95: f64,
    /// The error that is small enough.
    pub within: f64,
    /// Frames like the wanted ones until it is small enough: 0 where it is.
    pub frames_needed: Option<usize>,
    /// The value that is left where more frames hardly help.
    pub reachable_95: f64,
    /// Noise of a depth pixel, which no frame lowers, mm.
    pub noise_mm: Option<f64>,
}

/// A fit that has ended.
#[derive(Debug, Clone)]
pub struct FitOutcome {
    /// Number of frames of the job.
    pub frames: usize,
    /// The camera, the wanted poses and the errors, or why the frames do not suffice.
    pub result: Result<Box<LiveFitted>, String>,
}

/// The result of a fit.
#[derive(Debug, Clone)]
pub struct LiveFitted {
    /// The camera.
    pub camera: Camera,
    /// Wanted poses.
    pub poses: Vec<(ProposedFrame, Isometry3<f64>)>,
    /// Errors and plan.
    pub summary: FitSummary,
}

/// Fits frames and plans the next ones.
pub fn fit(job: FitJob, live: &LiveFit) -> FitOutcome {
    let frames = job.frames.len();
    FitOutcome { frames, result: fitted(job, live).map(Box::new) }
}

fn fitted(job: FitJob, live: &LiveFit) -> Result<LiveFitted, String> {
    let FitJob { frames, target, size: [width, height], unit_mm } = job;
    let count = frames.len();
    let in_memory = |frame: KeptFrame| FrameInMemory {
        name: frame.name,
        image: None,
        depth: frame.depth.map(Arc::unwrap_or_clone),
        markers: frame.markers,
        metadata: frame.metadata,
    };
    let dataset = DatasetInMemory {
        name: "live".to_owned(),
        target,
        size: (width, height),
        depth_unit_mm: unit_mm,
        camera: None,
        frames: frames.into_iter().map(in_memory).collect(),
    };
    let loaded = Arc::new(load_from_memory(dataset).map_err(|error| error.to_string())?);
    let cross_validate = (count >= VALIDATED.0).then_some(VALIDATED.1);
    let request = FitRequest { hold_out: None, cross_validate, ..live.request.clone() };
    // Frames that cannot be left out are no reason to show no fit.
    let fit = match request.fit(&loaded, live.options.clone()) {
        Err(_) if cross_validate.is_some() => {
            FitRequest { cross_validate: None, ..request }.fit(&loaded, live.options.clone())
        }
        fit => fit,
    };
    let fit = fit.map_err(|error| error.to_string())?;
    let of_errors = |evaluated: Option<&Evaluated>| {
        evaluated.and_then(|rig| rig.cameras.first()).map_or((None, None), |(_, evaluated)| {
            let errors = errors(evaluated);
            (errors.reprojection_px, errors.depth_rms_mm)
        })
    };
    let (fitted_px, fitted_mm) = of_errors(Some(&fit.on_fitted));
    let (held_px, held_mm) = of_errors(fit.held_out.as_ref().map(|held| &held.evaluated));
    let next = live.next.next(&fit.fitted);
    let poses = next.as_ref().map_or_else(
        |_| Vec::new(),
        |next| next.plan.poses.iter().map(|planned| (planned.frame, planned.rig_from_board)).collect(),
    );
    let (plan, unplanned) = match &next {
        Ok(next) => (Some(plan_summary(next)), None),
        Err(error) => (None, Some(error.to_string())),
    };
    let camera = fit.fitted.reference().calibrated.camera.clone();
    let summary = FitSummary { frames: count, fitted_px, fitted_mm, held_px, held_mm, plan, unplanned };
    Ok(LiveFitted { camera, poses, summary })
}

fn plan_summary(next: &NextCaptures) -> PlanSummary {
    let (goal, range_mm) = match &next.goal {
        Goal::Depth { range_mm } => ("depth".to_owned(), Some(*range_mm)),
        Goal::Projection { distance_mm } => ("projection".to_owned(), Some([*distance_mm; 2])),
        Goal::Parameter(name) => (name.clone(), None),
    };
    PlanSummary {
        goal,
        range_mm,
        unit: next.unit.clone(),
        now_95: next.plan.now_certain,
        within: next.target,
        frames_needed: next.plan.frames_needed,
        reachable_95: next.plan.reachable,
        noise_mm: next.noise_mm,
    }
}
